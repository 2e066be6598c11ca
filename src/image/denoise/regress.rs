//! First-order regression with collaboration (Bitterli et al. 2016, sections 4 and 5.1): around each pixel, colour is
//! fitted as a linear function of the features, and the fit speaks for every pixel it was made from.

mod solve;

use super::features::Feature;
use super::plane::{LANES, Lanes, PAD, Size, add_product, least, most, product, span};
use super::prepare::Prepared;
use super::weights::{Guide, TileWeights, fourth};
use rayon::prelude::*;
use solve::Equations;

/// Radius of the window in pixels.
const WINDOW: usize = 9;

/// Pixels in a window.
const OFFSETS: usize = (2 * WINDOW + 1) * (2 * WINDOW + 1);

/// Side of the square that a tile's fits speak for.
const REACHED: usize = LANES + 2 * WINDOW;

/// Fits of a pixel: two halves times two bandwidths. Number `2 half + bandwidth`; bandwidth 0 is `k` = 1, and 1 is
/// `k` = 0.5.
pub(super) const FITS: usize = 4;

/// Planes of a tile: three channels and the weight of each fit.
const PLANES: usize = 4 * FITS;

/// Surroundings whose brightness differs more than this are kept apart, whatever their noise.
const LARGEST_CONTRAST: f32 = 4.0;

/// Tiles whose results wait to be added up. It limits memory (74 kB each), and has no other effect.
const TILES_AT_ONCE: usize = 512;

/// Sums of predictions by pixel.
pub(super) struct Predictions {
    /// By fit, weighted colours and the sum of weights.
    sums: [Vec<[f32; 4]>; FITS],
}

impl Predictions {
    /// The weighted mean of what the fits say of this pixel; `None` where no pixel is like it.
    pub fn color(&self, fit: usize, pixel: usize) -> Option<[f32; 3]> {
        let [r, g, b, weight] = self.sums[fit][pixel];
        // Below that, squares of the weight are lost to f32.
        (weight > 1e-18).then(|| [r, g, b].map(|v| v / weight))
    }
}

/// What all tiles read.
struct Problem<'a> {
    guide: &'a Guide,
    features: &'a [Feature],
    /// 1 for pixels that fits are made from, else 0; padded.
    source: Vec<f32>,
    /// Square of the brightness around, padded.
    scale: Vec<f32>,
}

/// Memory of a thread.
struct Scratch {
    /// By row of the tile and offset: the weights that each half is filtered with.
    weights: Vec<[Lanes; 2]>,
    equations: Equations,
    /// 1, and the differences of features.
    differences: Vec<Lanes>,
}

/// Fits every sound pixel, and sums up what the fits say. The same bits with any number of threads: tiles share
/// nothing, and are added in their order.
pub(super) fn predictions(prepared: &Prepared, guide: &Guide, features: &[Feature]) -> Predictions {
    let size = prepared.size;
    let problem = Problem {
        guide,
        features,
        source: size.pad_with_zero(|i| f32::from(u8::from(prepared.sound[i]))),
        scale: size.pad(|i| prepared.scale[i] * prepared.scale[i]),
    };
    let n = features.len() + 1;
    let scratch = || Scratch {
        weights: vec![[[0.0; LANES]; 2]; LANES * OFFSETS],
        equations: Equations::new(n),
        differences: vec![[1.0; LANES]; n],
    };
    let mut sums = [(); FITS].map(|()| vec![[0.0; 4]; size.area()]);
    for tiles in size.tiles().chunks(TILES_AT_ONCE) {
        let done: Vec<Vec<f32>> =
            tiles.par_iter().map_init(scratch, |scratch, &tile| problem.tile(tile, scratch)).collect();
        for (&tile, planes) in tiles.iter().zip(&done) {
            add_tile(size, tile, planes, &mut sums);
        }
    }
    Predictions { sums }
}

/// Adds the part of a tile's planes that lies in the picture.
fn add_tile(size: Size, [x0, y0]: [usize; 2], planes: &[f32], sums: &mut [Vec<[f32; 4]>; FITS]) {
    for y in y0.saturating_sub(WINDOW)..(y0 + LANES + WINDOW).min(size.height) {
        for x in x0.saturating_sub(WINDOW)..(x0 + LANES + WINDOW).min(size.width) {
            let from = (y + WINDOW - y0) * REACHED + x + WINDOW - x0;
            for (fit, sums) in sums.iter_mut().enumerate() {
                for (channel, sum) in sums[y * size.width + x].iter_mut().enumerate() {
                    *sum += planes[(4 * fit + channel) * REACHED * REACHED + from];
                }
            }
        }
    }
}

/// Every step within a window, right and down.
fn offsets() -> impl Iterator<Item = (usize, [usize; 2])> {
    (0..OFFSETS).map(|o| (o, [o % (2 * WINDOW + 1), o / (2 * WINDOW + 1)]))
}

impl Problem<'_> {
    /// Planes of [`REACHED`] squared values: by fit, the weighted colours and the weights.
    fn tile(&self, [x, y]: [usize; 2], scratch: &mut Scratch) -> Vec<f32> {
        let size = self.guide.size;
        let corner = size.padded_index(x, y);
        self.weigh(corner, &mut scratch.weights);
        let mut planes = vec![0.0; PLANES * REACHED * REACHED];
        for row in 0..LANES.min(size.height - y) {
            let center = corner + row * size.stride();
            let first = (y + row) * size.width + x;
            let lanes = LANES.min(size.width - x);
            let weights = &scratch.weights[row * OFFSETS..][..OFFSETS];
            scratch.equations.clear();
            self.gather(center, weights, &mut scratch.differences, &mut scratch.equations);
            let source: &Lanes = span(&self.source, center);
            for lane in (0..lanes).filter(|&lane| source[lane] > 0.0) {
                scratch.equations.solve(lane, |i| self.features[i].variance[first + lane]);
            }
            self.spread(center, row, weights, &mut scratch.differences, &scratch.equations, &mut planes);
        }
        planes
    }

    /// Fills in the weights of all pixels of the tile and all offsets; those that half A is filtered with come from
    /// half B, and the other way round, so that they know nothing of the noise they average.
    fn weigh(&self, corner: usize, out: &mut [[Lanes; 2]]) {
        let stride = self.guide.size.stride();
        let mut weights: TileWeights = [[[0.0; LANES]; LANES]; 2];
        for (offset, at) in offsets() {
            let step = self.step(at);
            self.guide.weights(corner, step, &mut weights);
            for row in 0..LANES {
                let p = corner + row * stride;
                let near: &Lanes = span(&self.scale, p);
                let far: &Lanes = span(&self.scale, p.wrapping_add_signed(step));
                let out = &mut out[row * OFFSETS + offset];
                for i in 0..LANES {
                    let ratio = least(near[i], far[i]) / most(near[i], far[i]);
                    let factor = least(LARGEST_CONTRAST * LARGEST_CONTRAST * ratio, 1.0);
                    // The tail is cut off: a sun of a thousand times the sky is too much even at 1e-6.
                    let factor = if factor > 1e-2 { factor } else { 0.0 };
                    out[0][i] = weights[1][row][i] * factor;
                    out[1][i] = weights[0][row][i] * factor;
                }
            }
        }
    }

    fn step(&self, [right, down]: [usize; 2]) -> isize {
        let stride = self.guide.size.stride() as isize;
        (down as isize - WINDOW as isize) * stride + right as isize - WINDOW as isize
    }

    fn differences(&self, p: usize, q: usize, out: &mut [Lanes]) {
        for (feature, out) in self.features.iter().zip(&mut out[1..]) {
            let (fp, fq): (&Lanes, &Lanes) = (span(&feature.values, p), span(&feature.values, q));
            for i in 0..LANES {
                out[i] = fq[i] - fp[i];
            }
        }
    }

    /// Sums up the normal equations of a row of pixels.
    fn gather(&self, center: usize, weights: &[[Lanes; 2]], differences: &mut [Lanes], to: &mut Equations) {
        for (offset, at) in offsets() {
            let q = center.wrapping_add_signed(self.step(at));
            let source: &Lanes = span(&self.source, q);
            let w = weights[offset].each_ref().map(|half| product(half, source));
            if w.iter().flatten().all(|&w| w == 0.0) {
                continue;
            }
            self.differences(center, q, differences);
            let colors = self.guide.halves.each_ref().map(|half| [0, 1, 2].map(|c| span(&half[c], q)));
            to.add(differences, &by_fit(&w), colors);
        }
    }

    /// Adds to `planes` what the fits of a row of pixels say of all those in their windows.
    fn spread(
        &self,
        center: usize,
        row: usize,
        weights: &[[Lanes; 2]],
        differences: &mut [Lanes],
        fits: &Equations,
        planes: &mut [f32],
    ) {
        let source: &Lanes = span(&self.source, center);
        for (offset, at) in offsets() {
            let w = weights[offset].each_ref().map(|half| product(half, source));
            if w.iter().flatten().all(|&w| w == 0.0) {
                continue;
            }
            self.differences(center, center.wrapping_add_signed(self.step(at)), differences);
            let to = (row + at[1]) * REACHED + at[0];
            for (fit, w) in by_fit(&w).iter().enumerate() {
                for channel in 0..4 {
                    let values =
                        if channel < 3 { fits.predict(fit, channel, differences) } else { [1.0; LANES] };
                    let out = &mut planes[(4 * fit + channel) * REACHED * REACHED + to..][..LANES];
                    if let Some(out) = out.first_chunk_mut() {
                        add_product(out, w, &values);
                    }
                }
            }
        }
    }
}

/// Weights for either bandwidth, from those for `k` = 1.
fn by_fit([a, b]: &[Lanes; 2]) -> [Lanes; FITS] {
    [*a, a.map(fourth), *b, b.map(fourth)]
}

const _: () = assert!(WINDOW + 4 <= PAD, "windows and patches stay within the padding");
