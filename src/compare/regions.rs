//! Where a picture is worst: rectangles to look at first.

use super::metrics::Input;
use super::metrics::pointwise;
use serde::Serialize;

/// A part of the picture with a large share of the error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Region {
    /// Left top pixel, in the pictures' coordinates.
    pub at: [usize; 2],
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// Its share of the sum of relative squared errors, each at most 1.
    pub share: f64,
    /// Root of its mean of these.
    pub error: f64,
}

/// Regions that are told.
const TOLD: usize = 8;
/// Across the shorter side of the picture.
const ACROSS: usize = 12;

/// The worst regions, the worst first; none where there is no error.
pub fn worst(input: &Input) -> Vec<Region> {
    let pair = input.pair;
    let [w, h] = pair.size;
    let side = (w.min(h) / ACROSS).clamp(8, 128);
    let (epsilon, _) = input.epsilon();
    // No pixel counts for more than one that is off by its own size: a few outliers would be all that is told.
    let map = pointwise::map(pair, |r, t| ((t - r).powi(2) / (r * r + epsilon)).min(1.0));
    let blocks = [w.div_ceil(side), h.div_ceil(side)];
    let mut sums = vec![0.0; blocks[0] * blocks[1]];
    for (i, v) in map.iter().enumerate() {
        sums[i / w / side * blocks[0] + i % w / side] += f64::from(*v);
    }
    let total: f64 = sums.iter().sum();
    if total <= 0.0 {
        return Vec::new();
    }
    let mut order: Vec<usize> = (0..sums.len()).filter(|b| sums[*b] > 0.0).collect();
    order.sort_by(|a, b| sums[*b].total_cmp(&sums[*a]));
    let mut chosen: Vec<usize> = Vec::new();
    for block in order {
        // The neighbours of a bad block are seen with it.
        let beside = |a: usize, b: usize| {
            let apart = |a: usize, b: usize| a.abs_diff(b) <= 1;
            apart(a % blocks[0], b % blocks[0]) && apart(a / blocks[0], b / blocks[0])
        };
        if chosen.len() < TOLD && !chosen.iter().any(|c| beside(*c, block)) {
            chosen.push(block);
        }
    }
    let region = |b: usize| {
        let from = [b % blocks[0] * side, b / blocks[0] * side];
        let size = [side.min(w - from[0]), side.min(h - from[1])];
        let pixels = (size[0] * size[1]) as f64;
        let at = [pair.origin[0] + from[0], pair.origin[1] + from[1]];
        Region { at, size, share: sums[b] / total, error: (sums[b] / pixels).sqrt() }
    };
    chosen.into_iter().map(region).collect()
}
