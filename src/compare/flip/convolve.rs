//! The passes of FLIP's filters over one tile, along rows and then along columns, sixteen pixels at a time. Weights are
//! halves ([`Half`]): what lies at equal distance on both sides is added, or subtracted, first.

use super::kernels::{Half, Kernels};
use crate::compare::lanes::{LANES, Lanes, add, filtered, load, plus, scale, store, sub};
use crate::math::simd::Kernel;

/// A plane of a tile: rows of `stride` values, of which those that a pass writes start at 0.
#[derive(Debug, Clone, Copy)]
pub(super) struct Source<'a> {
    pub data: &'a [f32],
    pub stride: usize,
}

#[inline(always)]
fn length(mut a: Lanes<f32>, b: Lanes<f32>) -> Lanes<f32> {
    for (a, b) in a.iter_mut().zip(b) {
        *a = (*a * *a + b * b).sqrt();
    }
    a
}

/// Symmetric filters along rows: for every one of `out`, whose rows are of `width`.
pub(super) struct AlongRows<'a, const N: usize> {
    /// Its rows start `margin` values left of the first one of `out`.
    pub source: Source<'a>,
    pub margin: usize,
    pub width: usize,
    /// Of equal lengths.
    pub halves: [&'a Half; N],
    pub out: [&'a mut [f32]; N],
}

impl<const N: usize> Kernel for AlongRows<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run(mut self) {
        let rows = self.source.data.chunks_exact(self.source.stride).take(self.out[0].len() / self.width);
        for (y, row) in rows.enumerate() {
            for x in (0..self.width).step_by(LANES) {
                let sums = filtered(row, x + self.margin, 1, self.halves.map(|h| &h[..]));
                for (out, s) in self.out.iter_mut().zip(sums) {
                    store(out, y * self.width + x, s);
                }
            }
        }
    }
}

/// The sum of symmetric filters along columns, each of a plane of its own, whose first row is `len - 1` rows above that
/// of `out`.
pub(super) struct AlongColumns<'a, const N: usize> {
    pub sources: [&'a [f32]; N],
    /// Of all planes.
    pub width: usize,
    /// Of equal lengths.
    pub halves: [&'a Half; N],
    pub out: &'a mut [f32],
}

impl<const N: usize> Kernel for AlongColumns<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let (n, width) = (self.halves[0].len(), self.width);
        for (y, out) in self.out.chunks_exact_mut(width).enumerate() {
            for x in (0..width).step_by(LANES) {
                let middle = (y + n - 1) * width + x;
                let mut total = [0.0; LANES];
                for (source, half) in self.sources.iter().zip(&self.halves) {
                    let [sum] = filtered(source, middle, width, [&half[..n]]);
                    total = add(total, sum);
                }
                store(out, x, total);
            }
        }
    }
}

/// The detectors along rows: Gaussian, first and second derivative of the same plane.
pub(super) struct DetectRows<'a> {
    pub source: Source<'a>,
    pub margin: usize,
    pub width: usize,
    pub filters: &'a Kernels,
    /// Smoothed, first derivative, second derivative.
    pub out: [&'a mut [f32]; 3],
}

impl Kernel for DetectRows<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let n = self.filters.gauss.len();
        let [gauss, first, second] =
            [&self.filters.gauss, &self.filters.first, &self.filters.second].map(|h| &h[..n]);
        let [smooth, slope, bend] = self.out;
        let rows = self.source.data.chunks_exact(self.source.stride).take(smooth.len() / self.width);
        for (y, row) in rows.enumerate() {
            for x in (0..self.width).step_by(LANES) {
                let middle = x + self.margin;
                let center = load(row, middle);
                let twice = add(center, center);
                let [mut g, mut d, mut dd] = [scale(center, gauss[0]), [0.0; LANES], [0.0; LANES]];
                for k in 1..n {
                    let (left, right) = (load(row, middle - k), load(row, middle + k));
                    let pair = add(left, right);
                    g = plus(g, pair, gauss[k]);
                    d = plus(d, sub(right, left), first[k]);
                    // Its weights sum to zero: the middle is in every term, so that flat parts give exactly nothing.
                    dd = plus(dd, sub(pair, twice), second[k]);
                }
                let at = y * self.width + x;
                store(smooth, at, g);
                store(slope, at, d);
                store(bend, at, dd);
            }
        }
    }
}

/// The detectors along columns of what [`DetectRows`] has made, whose first row is `len - 1` rows above that of the results.
pub(super) struct DetectColumns<'a> {
    /// Smoothed, first derivative, second derivative.
    pub sources: [&'a [f32]; 3],
    pub width: usize,
    pub filters: &'a Kernels,
    /// Length of the gradient.
    pub edges: &'a mut [f32],
    /// Length of the second derivatives.
    pub points: &'a mut [f32],
}

impl Kernel for DetectColumns<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let (n, width) = (self.filters.gauss.len(), self.width);
        let [gauss, first, second] =
            [&self.filters.gauss, &self.filters.first, &self.filters.second].map(|h| &h[..n]);
        let [smooth, slope, bend] = self.sources;
        let rows = self.edges.chunks_exact_mut(width).zip(self.points.chunks_exact_mut(width));
        for (y, (edges, points)) in rows.enumerate() {
            for x in (0..width).step_by(LANES) {
                let middle = (y + n - 1) * width + x;
                let center = load(smooth, middle);
                let twice = add(center, center);
                let mut dx = scale(load(slope, middle), gauss[0]);
                let mut ddx = scale(load(bend, middle), gauss[0]);
                let [mut dy, mut ddy] = [[0.0; LANES]; 2];
                for k in 1..n {
                    let (above, below) = (middle - k * width, middle + k * width);
                    dx = plus(dx, add(load(slope, above), load(slope, below)), gauss[k]);
                    ddx = plus(ddx, add(load(bend, above), load(bend, below)), gauss[k]);
                    let (up, down) = (load(smooth, above), load(smooth, below));
                    dy = plus(dy, sub(down, up), first[k]);
                    ddy = plus(ddy, sub(add(up, down), twice), second[k]);
                }
                store(edges, x, length(dx, dy));
                store(points, x, length(ddx, ddy));
            }
        }
    }
}
