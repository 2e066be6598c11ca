//! Structural similarity of two planes (Wang, Bovik, Sheikh, Simoncelli 2004), and at several scales (Wang, Simoncelli,
//! Bovik 2003).
//!
//! Means, variances and covariance are those under a moving window; the picture is mirrored at its borders, and the mean
//! leaves out pixels whose window reaches beyond, both as scikit-image has it. All of it is worked out in double precision: a
//! variance is a small difference of large squares.

mod moments;
#[cfg(test)]
mod tests;

use crate::math::exact_sum::ExactSum;
use moments::{TILE, Tile};
use rayon::prelude::*;
use std::borrow::Cow;

/// What the moments are taken under.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Window {
    /// A Gaussian of sigma 1.5 pixels, 11 across: the paper's.
    Gaussian,
    /// All alike, so many pixels across; odd, at least 3.
    Uniform(usize),
}

/// Choices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// See [`Window`].
    pub window: Window,
    /// The largest possible value less the smallest.
    pub range: f64,
    /// Keeps the comparison of means from dividing by nothing: 0.01 in the paper.
    pub k1: f64,
    /// The same of variances: 0.03.
    pub k2: f64,
    /// Whether variances are those of samples (divided by one less than the pixels of the window, as scikit-image has it by default)
    /// or of the whole (as the paper has it).
    pub sample_covariance: bool,
}

impl Options {
    /// The paper's, for values from 0 to `range`.
    pub fn new(range: f64) -> Self {
        Options { window: Window::Gaussian, range, k1: 0.01, k2: 0.03, sample_covariance: false }
    }
}

/// What came out.
#[derive(Debug, Clone, PartialEq)]
pub struct Ssim {
    /// Mean of the similarity; 1 of equal planes, at least -1.
    pub mean: f64,
    /// Mean of its part that compares contrast and structure, but not brightness.
    pub structure: f64,
    /// Similarity at each pixel; empty if it was not wanted.
    pub map: Vec<f32>,
}

impl Window {
    /// Pixels on either side of the middle.
    pub fn radius(self) -> usize {
        match self {
            Window::Gaussian => 5,
            Window::Uniform(n) => n / 2,
        }
    }

    /// From the middle outwards; the sum over both sides is 1.
    fn weights(self) -> Vec<f64> {
        let radius = self.radius();
        let one_sided: Vec<f64> = match self {
            Window::Gaussian => (0..=radius).map(|i| (-0.5 * (i as f64 / 1.5).powi(2)).exp()).collect(),
            Window::Uniform(_) => vec![1.0; radius + 1],
        };
        let sum = one_sided[0] + 2.0 * one_sided[1..].iter().sum::<f64>();
        one_sided.into_iter().map(|w| w / sum).collect()
    }
}

/// The similarity of two planes of `size` pixels, whose values are finite. None where a side is shorter than the window.
pub fn ssim(size: [usize; 2], a: &[f32], b: &[f32], options: &Options, wants_map: bool) -> Option<Ssim> {
    let radius = options.window.radius();
    if size.iter().any(|n| *n < 2 * radius + 1) {
        return None;
    }
    let weights = options.window.weights();
    let count = ((2 * radius + 1) as f64).powi(2);
    let norm = if options.sample_covariance { count / (count - 1.0) } else { 1.0 };
    let constants = [options.k1, options.k2].map(|k| (k * options.range).powi(2));
    let tiles: Vec<[usize; 2]> = (0..size[1])
        .step_by(TILE[1])
        .flat_map(|y| (0..size[0]).step_by(TILE[0]).map(move |x| [x, y]))
        .collect();
    let of_tile = |at: &[usize; 2]| {
        let tile = Tile { size, at: *at, planes: [a, b], weights: &weights, norm, constants };
        tile.similarity(radius, wants_map)
    };
    let parts: Vec<_> = tiles.par_iter().map(of_tile).collect();
    let (mut sum, mut structure) = (ExactSum::default(), ExactSum::default());
    let mut map = if wants_map { vec![0.0; size[0] * size[1]] } else { Vec::new() };
    for (at, part) in tiles.iter().zip(&parts) {
        sum.extend(part.rows.iter().map(|r| r[0]));
        structure.extend(part.rows.iter().map(|r| r[1]));
        if wants_map {
            let width = TILE[0].min(size[0] - at[0]);
            for (y, row) in part.map.chunks(width).enumerate() {
                let start = (at[1] + y) * size[0] + at[0];
                map[start..start + width].copy_from_slice(row);
            }
        }
    }
    let inside = size.map(|n| (n - 2 * radius) as f64);
    let n = inside[0] * inside[1];
    Some(Ssim { mean: sum.value() / n, structure: structure.value() / n, map })
}

/// What each scale counts, from the finest (Wang et al. 2003, section 3.2).
const SCALES: [f64; 5] = [0.0448, 0.2856, 0.3001, 0.2363, 0.1333];

/// Similarity at several scales.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MsSsim {
    /// 1 of equal planes, at least 0.
    pub value: f64,
    /// Scales that the picture is large enough for: five if both sides have 176 pixels; the weights of fewer are scaled to a
    /// sum of 1.
    pub scales: usize,
}

/// Similarity at up to five scales, each of half the resolution of the one before (means of 2 x 2 pixels; a last odd row or
/// column is left out): structure at all of them, brightness at the coarsest. A negative mean counts as 0, as a power needs
/// it. `finest` is what [`ssim`] finds of the planes as they are. None where a side is shorter than the window.
pub fn ms_ssim(size: [usize; 2], planes: [&[f32]; 2], options: &Options, finest: &Ssim) -> Option<MsSsim> {
    let least = 2 * options.window.radius() + 1;
    let scales = (0..SCALES.len()).take_while(|s| size.iter().all(|n| n >> s >= least)).count();
    let total: f64 = SCALES[..scales].iter().sum();
    let factor = |scale: usize, found: &Ssim| {
        let mean = if scale + 1 == scales { found.mean } else { found.structure };
        mean.max(0.0).powf(SCALES[scale] / total)
    };
    let mut value = (scales > 0).then(|| factor(0, finest))?;
    let (mut size, mut planes) = (size, planes.map(Cow::Borrowed));
    for scale in 1..scales {
        planes = planes.map(|p| halved(size, &p).into());
        size = size.map(|n| n / 2);
        value *= factor(scale, &ssim(size, &planes[0], &planes[1], options, false)?);
    }
    Some(MsSsim { value, scales })
}

/// Means of 2 x 2 pixels.
fn halved([w, h]: [usize; 2], plane: &[f32]) -> Vec<f32> {
    let half = w / 2;
    let mut out = vec![0.0; half * (h / 2)];
    out.par_chunks_mut(half.max(1)).enumerate().for_each(|(y, row)| {
        let [upper, lower] = [0, 1].map(|dy| &plane[(2 * y + dy) * w..][..2 * half]);
        let pairs = upper.chunks_exact(2).zip(lower.chunks_exact(2));
        row.iter_mut().zip(pairs).for_each(|(o, (u, l))| *o = 0.25 * ((u[0] + u[1]) + (l[0] + l[1])));
    });
    out
}
