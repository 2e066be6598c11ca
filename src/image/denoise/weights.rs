//! Non-local-means weights: how alike two pixels are, judged by the squares of 7 x 7 pixels around them and by the
//! noise that is expected there (Rousselle et al. 2012, section 4).

use super::plane::{LANES, Lanes, Size, least, most, span};

/// Radius of a patch in pixels.
const PATCH: usize = 3;

/// Pixels in a patch.
const PATCH_AREA: f32 = ((2 * PATCH + 1) * (2 * PATCH + 1)) as f32;

/// Values that a row of patches reads: a multiple of four for the sake of vectors.
const SPAN: usize = LANES + 8;

/// To the left of a tile, in a span.
const LEFT: usize = 4;

/// A pixel's share in a distance ends here, where it alone takes the weight to zero: sums stay exact.
const LARGEST_TERM: f32 = REACH * PATCH_AREA;

/// The distance from which on weights are zero.
const REACH: f32 = 8.0;

/// What pixels are compared by. All planes are padded, and finite.
pub(super) struct Guide {
    pub size: Size,
    /// Channels of each half.
    pub halves: [Vec<Vec<f32>>; 2],
    /// Variance of one half, summed over channels; positive.
    pub variance: Vec<f32>,
    /// 1 for pixels that may be compared, else 0.
    pub comparable: Vec<f32>,
}

/// Weights of a tile's pixels, row by row, as each half has them.
pub(super) type TileWeights = [[Lanes; LANES]; 2];

impl Guide {
    /// Weights between the pixels of the tile whose first one is at `corner` of the padded planes, and those that are
    /// `step` further on; from 0 to 1, and 1 where `step` is 0.
    ///
    /// The sums over patches share their rows, so that a pixel costs the same whatever the radius of the window.
    pub fn weights(&self, corner: usize, step: isize, out: &mut TileWeights) {
        let stride = self.size.stride();
        let mut across = [[[0.0; LANES]; LANES + 2 * PATCH]; 2];
        for row in 0..LANES + 2 * PATCH {
            let p = corner + row * stride - PATCH * stride - LEFT;
            let terms = self.terms(p, p.wrapping_add_signed(step));
            for (across, terms) in across.iter_mut().zip(&terms) {
                for tap in 0..=2 * PATCH {
                    let taps: &Lanes = span(terms, LEFT - PATCH + tap);
                    for (sum, term) in across[row].iter_mut().zip(taps) {
                        *sum += term;
                    }
                }
            }
        }
        for (out, across) in out.iter_mut().zip(&across) {
            for (row, out) in out.iter_mut().enumerate() {
                let mut sum = across[row];
                for other in &across[row + 1..=row + 2 * PATCH] {
                    for (sum, s) in sum.iter_mut().zip(other) {
                        *sum += s;
                    }
                }
                *out = sum.map(|s| kernel(s / PATCH_AREA));
            }
        }
    }

    /// Squared differences of pixels in units of their variance, less the part that noise alone would give
    /// (Rousselle et al. 2012, eq. 6, with `k` = 1). One quotient stands for all channels: noise has mostly no hue,
    /// and a channel that happens to be silent does not blow up the distance.
    fn terms(&self, p: usize, q: usize) -> [[f32; SPAN]; 2] {
        let (vp, vq): (&[f32; SPAN], &[f32; SPAN]) = (span(&self.variance, p), span(&self.variance, q));
        let (mp, mq): (&[f32; SPAN], &[f32; SPAN]) = (span(&self.comparable, p), span(&self.comparable, q));
        let mut scale = [0.0; SPAN];
        let mut noise = [0.0; SPAN];
        for i in 0..SPAN {
            scale[i] = mp[i] * mq[i] / (vp[i] + vq[i]);
            noise[i] = vp[i] + least(vp[i], vq[i]);
        }
        [0, 1].map(|half| {
            let mut sum = [0.0; SPAN];
            for channel in &self.halves[half] {
                let (up, uq): (&[f32; SPAN], &[f32; SPAN]) = (span(channel, p), span(channel, q));
                for i in 0..SPAN {
                    let d = up[i] - uq[i];
                    sum[i] += d * d;
                }
            }
            for i in 0..SPAN {
                sum[i] = least((sum[i] - noise[i]) * scale[i], LARGEST_TERM);
            }
            sum
        })
    }
}

/// `(1 - d/8)^8`, which is near `exp(-d)`, costs five multiplications, and ends: what is far has no part at all.
#[inline]
fn kernel(distance: f32) -> f32 {
    let t = 1.0 - most(distance, 0.0) / REACH;
    // Weights below 2e-4 are none: their powers would be denormal numbers, which are a hundred times slower.
    if t > 0.35 { fourth(t * t) } else { 0.0 }
}

/// The fourth power. Of a weight it is the weight for half the bandwidth, `k` = 0.5.
#[inline]
pub(super) fn fourth(w: f32) -> f32 {
    let square = w * w;
    square * square
}
