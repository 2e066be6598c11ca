//! SSIM over several scales.

use super::{Options, Ssim, measure, ssim};
use crate::error::Result;
use rayon::prelude::*;

/// Exponents of the scales, the finest first: Wang, Simoncelli, Bovik 2003, section 3.2. Their sum is 1.0001, there as here.
pub const WEIGHTS: [f64; 5] = [0.0448, 0.2856, 0.3001, 0.2363, 0.1333];

/// Multi-scale similarity of two pictures of `C` channels.
#[derive(Debug, Clone, PartialEq)]
pub struct MultiScale<const C: usize> {
    /// Of each channel.
    pub channels: [f64; C],
    /// Mean of `channels`.
    pub mean: f64,
    /// How many scales there were: fewer than five where the picture is too small for them.
    pub scales: usize,
}

/// Multi-scale similarity of `test` and `reference`, as [`ssim()`] takes them: the product over scales of the mean contrast
/// and structure, that of the coarsest scale times luminance, each to the power of its weight. A negative mean counts as 0.
///
/// A scale is the means of blocks of 2x2 pixels of the one before; a last odd row or column is left out. Where a
/// scale would be smaller than the window, there are fewer, whose weights are scaled so that the sum stays. `first` is what
/// [`ssim()`] made of the same pictures and options, if that is at hand: it is the finest scale.
///
/// # Errors
/// As [`ssim()`].
pub fn multi_scale<const C: usize>(
    size: [usize; 2],
    reference: &[[f32; C]],
    test: &[[f32; C]],
    options: &Options,
    first: Option<&Ssim<C>>,
) -> Result<MultiScale<C>> {
    let side = 2 * options.window.radius() + 1;
    let mut found = match first {
        Some(s) => vec![(s.channels, s.contrast)],
        None => {
            let s = ssim(size, reference, test, options)?;
            vec![(s.channels, s.contrast)]
        }
    };
    let mut next = [half(size, reference), half(size, test)];
    let mut size = size.map(|n| n / 2);
    while found.len() < WEIGHTS.len() && size[0].min(size[1]) >= side {
        let s = measure(size, &next[0], &next[1], options);
        found.push((s.channels, s.contrast));
        next = next.map(|p| half(size, &p));
        size = size.map(|n| n / 2);
    }
    let scales = found.len();
    let sum = |weights: &[f64]| weights.iter().sum::<f64>();
    let more = sum(&WEIGHTS) / sum(&WEIGHTS[..scales]);
    let channels: [f64; C] = std::array::from_fn(|c| {
        let factors = found.iter().zip(WEIGHTS).enumerate().map(|(i, ((whole, contrast), weight))| {
            let mean = if i + 1 == scales { whole[c] } else { contrast[c] };
            mean.max(0.0).powf(weight * more)
        });
        factors.product()
    });
    Ok(MultiScale { channels, mean: channels.iter().sum::<f64>() / C as f64, scales })
}

/// Means of blocks of 2x2 pixels.
fn half<T, const C: usize>([width, height]: [usize; 2], picture: &[[T; C]]) -> Vec<[f64; C]>
where
    T: Copy + Into<f64> + Sync,
{
    let [w, h] = [width / 2, height / 2];
    let mut out = vec![[0.0; C]; w * h];
    if w == 0 {
        return out;
    }
    out.par_chunks_mut(w).enumerate().for_each(|(y, row)| {
        let above = &picture[2 * y * width..][..2 * w];
        let below = &picture[(2 * y + 1) * width..][..2 * w];
        for ((out, a), b) in row.iter_mut().zip(above.chunks_exact(2)).zip(below.chunks_exact(2)) {
            let sum = |c: usize| (a[0][c].into() + a[1][c].into()) + (b[0][c].into() + b[1][c].into());
            *out = std::array::from_fn(|c| 0.25 * sum(c));
        }
    });
    out
}
