//! Features made ready: brought to a common scale, and rid of their own noise by non-local means across the halves
//! (Rousselle et al. 2013, section 4).

use super::Halves;
use super::plane::{LANES, Lanes, Size, span};
use super::prepare::pooled;
use super::weights::{Guide, TileWeights};
use rayon::prelude::*;

/// Radius of the window in which a feature's noise is averaged out.
const WINDOW: isize = 5;

/// In units of the usual deviation; larger values are cut off, so that squares stay far within `f32`.
const LARGEST: f64 = 1e6;

/// Variance in units of the usual deviation squared that counts as none.
const SMALLEST_VARIANCE: f32 = 1e-8;

/// A feature as the regression reads it.
pub(super) struct Feature {
    /// Values, padded: less their mean over the picture, in units of their mean absolute deviation.
    pub values: Vec<f32>,
    /// Variance that the filter has left in `values`, by pixel, not padded.
    pub variance: Vec<f32>,
}

/// Prepares every channel but those that are constant, which explain nothing, and gives the place in the
/// picture where there is no other.
pub(super) fn prepare(input: &Halves) -> Vec<Feature> {
    let size = Size { width: input.width, height: input.height };
    let prepared = input.features.iter().filter_map(|&halves| {
        let halves = normalized(halves)?;
        Some(if halves[0] == halves[1] {
            Feature { values: size.pad(|i| halves[0][i]), variance: vec![0.0; size.area()] }
        } else {
            filtered(size, &halves)
        })
    });
    let mut features: Vec<Feature> = prepared.collect();
    if features.is_empty() {
        features.extend([position(size, |i| i % size.width), position(size, |i| i / size.width)]);
    }
    features
}

/// A coordinate in the picture as a feature: fits then follow light that changes slowly. The papers have none.
/// Measured on `tests::Scene::ball`: without other features, the error of the ball falls to a fifth. Beside seven
/// others it gains in a picture of 128 x 80 (0.0016 to 0.0015), and loses in one of 480 x 270 (0.00053 to 0.00076):
/// two more unknowns keep more of the noise.
fn position(size: Size, coordinate: impl Fn(usize) -> usize) -> Feature {
    // In units of about a window's radius, as what is far does not matter.
    Feature { values: size.pad(|i| coordinate(i) as f32 / 8.0), variance: vec![0.0; size.area()] }
}

/// `None` if no two values differ. Values that are not finite are common (nothing was hit) and mean something: `+inf`
/// is put beyond the largest value, the rest below the smallest.
fn normalized(halves: [&[f32]; 2]) -> Option<[Vec<f32>; 2]> {
    let finite =
        || halves.iter().flat_map(|half| half.iter()).filter(|v| v.is_finite()).map(|&v| f64::from(v));
    let n = finite().count();
    let (low, high) = finite().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if n == 0 {
        return None;
    }
    let mean = finite().sum::<f64>() / n as f64;
    let mut deviation = finite().map(|v| (v - mean).abs()).sum::<f64>() / n as f64;
    if low == high {
        // Where it was hit or not may still be all that a feature has to say.
        if n == halves[0].len() + halves[1].len() {
            return None;
        }
        deviation = 1.0;
    }
    let beyond = (high - low).max(deviation);
    let value = |v: f32, other: f32| {
        let v = match (v.is_finite(), other.is_finite()) {
            (true, _) => f64::from(v),
            (false, true) => f64::from(other),
            _ if v == f32::INFINITY => high + beyond,
            _ => low - beyond,
        };
        ((v - mean) / deviation).clamp(-LARGEST, LARGEST) as f32
    };
    Some([0, 1].map(|h| halves[h].iter().zip(halves[1 - h]).map(|(&v, &other)| value(v, other)).collect()))
}

fn filtered(size: Size, halves: &[Vec<f32>; 2]) -> Feature {
    let all = vec![true; size.area()];
    let squares: Vec<f32> = halves[0].iter().zip(&halves[1]).map(|(a, b)| (a - b) * (a - b) / 2.0).collect();
    let variance = pooled(size, &squares, &all);
    let guide = Guide {
        size,
        halves: halves.each_ref().map(|half| vec![size.pad(|i| half[i])]),
        variance: size.pad(|i| variance[i].max(SMALLEST_VARIANCE)),
        comparable: size.pad(|_| 1.0),
    };
    let inside = size.pad_with_zero(|_| 1.0);
    let tiles = size.tiles();
    let done: Vec<_> =
        tiles.par_iter().map(|&[x, y]| filter_tile(&guide, &inside, size.padded_index(x, y))).collect();
    let mut smooth = halves.clone();
    for (&[x0, y0], tile) in tiles.iter().zip(&done) {
        for y in y0..(y0 + LANES).min(size.height) {
            for x in x0..(x0 + LANES).min(size.width) {
                for h in 0..2 {
                    smooth[h][y * size.width + x] = tile[h][y - y0][x - x0];
                }
            }
        }
    }
    let left: Vec<f32> = smooth[0].iter().zip(&smooth[1]).map(|(a, b)| (a - b) * (a - b) / 4.0).collect();
    let variance = pooled(size, &left, &all);
    Feature { values: size.pad(|i| 0.5 * (smooth[0][i] + smooth[1][i])), variance }
}

/// Means of each half under the weights of the other.
fn filter_tile(guide: &Guide, inside: &[f32], corner: usize) -> TileWeights {
    let stride = guide.size.stride();
    let mut weights: TileWeights = [[[0.0; LANES]; LANES]; 2];
    let mut sums = weights;
    let mut totals = weights;
    for dy in -WINDOW..=WINDOW {
        for dx in -WINDOW..=WINDOW {
            let step = dy * stride as isize + dx;
            guide.weights(corner, step, &mut weights);
            for row in 0..LANES {
                let q = (corner + row * stride).wrapping_add_signed(step);
                let inside: &Lanes = span(inside, q);
                for h in 0..2 {
                    let value: &Lanes = span(&guide.halves[h][0], q);
                    for i in 0..LANES {
                        let w = weights[1 - h][row][i] * inside[i];
                        sums[h][row][i] += w * value[i];
                        totals[h][row][i] += w;
                    }
                }
            }
        }
    }
    for (sum, total) in
        sums.as_flattened_mut().as_flattened_mut().iter_mut().zip(totals.as_flattened().as_flattened())
    {
        // Lanes beyond the picture may have no weight; nobody reads them.
        *sum /= total;
    }
    sums
}
