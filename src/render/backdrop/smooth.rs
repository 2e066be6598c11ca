//! Tiles of a sky without detail: a few points for all pixels.
//!
//! Radiance is looked up on a lattice that spans the tile and all that its pixels' filters reach, and interpolated between,
//! by cubics along each axis. The filter's integral of that is a weighted sum of the lattice's values. Whether it can be
//! trusted the lattice tells by itself: every other line of points is foretold by those between, in three ways, as in
//! [`super`]: in rows, in columns, and in both. The whole lattice has half of the steps of what foretells, so that it is off
//! by half as much where the sky bends sharply, as on a horizon, and by a sixteenth elsewhere. What is straight and cuts the
//! tile has a corner of the lattice, at least, to itself. Where it does not fit, a finer lattice is tried.

use super::PER_PIXEL;
use crate::color::Rgb;
use crate::render::film::TILE_SIDE;

/// Widest steps of a lattice, in pixels and in radians. Clear skies vary fastest at the horizon, within some degrees.
const WIDEST: [f32; 2] = [4.0, 0.0175];
/// Least steps, in pixels: with smaller ones, most lookups would be saved no more.
const LEAST: f32 = 0.75;
/// Largest sum, over the three ways, of the difference between a point and what foretells it, over the point. Measured over
/// clear skies, what is taken differs by less from what many points give.
const TOLERANCE: f32 = 5e-4;
/// Least number of points along an axis: four on every other line, which a cubic takes.
const FEWEST: usize = 7;

/// Points along either side of a tile, and what its pixels make of them.
#[derive(Default)]
pub(super) struct Axis {
    /// What it was made for.
    made_for: (usize, u32),
    /// Where they are, in pixels from the tile's edge.
    pub points: Vec<f32>,
    /// By pixel: the first point that counts for it, and the weights of those from there on: the filter's integral of what
    /// is interpolated.
    weights: Vec<(usize, Vec<f32>)>,
    /// By point: the first of four that foretell it, each the next but one, and their weights. Every other one stands for
    /// itself.
    foretold: Vec<(usize, [f32; 4])>,
}

/// The steps of a tile's lattices, in pixels, each half of the one before: for those that the one before does not fit.
/// `pixel` is the angle of a pixel.
pub(super) fn steps(pixel: f32) -> impl Iterator<Item = f32> {
    let widest = WIDEST[0].min(WIDEST[1] / pixel);
    [1.0, 0.5, 0.25].map(|part| part * widest).into_iter().filter(|step| *step >= LEAST)
}

/// The cubic through four values in a row: the first of them, for a point among `n`, and their weights.
fn cubic(x: f32, n: usize) -> (usize, [f32; 4]) {
    let first = (x.floor() as usize).saturating_sub(1).min(n - 4);
    let t = x - first as f32;
    let [a, b, c, d] = [t, t - 1.0, t - 2.0, t - 3.0];
    (first, [b * c * d / -6.0, a * c * d / 2.0, a * b * d / -2.0, a * b * c / 6.0])
}

impl Axis {
    /// Prepares for a filter and steps of at most so many pixels.
    pub fn prepare(&mut self, taps: &[[f32; 2]], step: f32) {
        let made_for = (taps.len(), step.to_bits());
        if self.made_for == made_for {
            return;
        }
        let pixels = TILE_SIDE as usize;
        self.made_for = made_for;
        let reach = taps.len() as f32 / (2 * PER_PIXEL) as f32;
        // One step beyond on either side: what differs only at a point on the rim counts for next to nothing.
        let before = reach - 0.5 + step;
        let length = pixels as f32 + 2.0 * before;
        let n = ((length / step).ceil() as usize + 1).max(FEWEST) | 1;
        let step = length / (n - 1) as f32;
        self.points.clear();
        self.points.extend((0..n).map(|k| k as f32 * step - before));
        self.weights.clear();
        self.weights.extend((0..pixels).map(|pixel| {
            let mut weights = vec![0.0; n];
            for (k, [weight, _]) in taps.iter().enumerate() {
                let at = pixel as f32 + 0.5 - reach + (k as f32 + 0.5) / PER_PIXEL as f32;
                let (first, parts) = cubic((at + before) / step, n);
                weights[first..].iter_mut().zip(parts).for_each(|(w, part)| *w += weight * part);
            }
            let counts = |w: &f32| *w != 0.0;
            let first = weights.iter().position(counts).unwrap_or(0);
            let end = weights.iter().rposition(counts).map_or(first, |last| last + 1);
            (first, weights[first..end].to_vec())
        }));
        self.foretold.clear();
        self.foretold.extend((0..n).map(|k| {
            let (first, parts) = cubic(0.5 * k as f32, n.div_ceil(2));
            (2 * first, parts)
        }));
    }

    /// A point as the others foretell it; `at` gives their values.
    #[inline(always)]
    fn foretell(&self, point: usize, at: impl Fn(usize) -> Rgb) -> Rgb {
        let (first, parts) = self.foretold[point];
        (0..).zip(parts).fold(Rgb::BLACK, |sum, (k, part)| sum + at(first + 2 * k) * part)
    }

    /// Whether the values of a lattice, row by row, fit to each other.
    pub fn fits(&self, values: &[Rgb], room: &mut Room) -> bool {
        let n = self.points.len();
        room.along.clear();
        for row in values.chunks_exact(n) {
            room.along.extend((0..n).map(|i| self.foretell(i, |k| row[k])));
        }
        let along = &room.along;
        let fit = |j: usize, i: usize| {
            let value = values[j * n + i];
            let ways = [
                along[j * n + i],
                self.foretell(j, |k| values[k * n + i]),
                self.foretell(j, |k| along[k * n + i]),
            ];
            let spread = ways.iter().fold(Rgb::BLACK, |sum, &w| sum + (value - w).map(f32::abs));
            spread.max_component() <= TOLERANCE * value.map(f32::abs).max_component()
        };
        (0..n).all(|j| (0..n).all(|i| fit(j, i)))
    }

    /// What the pixels show, row by row, of a lattice's values.
    pub fn pixels(&self, values: &[Rgb], room: &mut Room, out: &mut Vec<Rgb>) {
        let n = self.points.len();
        room.rows.clear();
        for row in values.chunks_exact(n) {
            room.rows.extend(self.weights.iter().map(|(first, w)| sum(w, row[*first..].iter())));
        }
        let width = TILE_SIDE as usize;
        out.clear();
        for (first, weights) in &self.weights {
            let rows = &room.rows[first * width..];
            out.extend((0..width).map(|x| sum(weights, rows[x..].iter().step_by(width))));
        }
    }
}

#[inline(always)]
fn sum<'a>(weights: &[f32], values: impl Iterator<Item = &'a Rgb>) -> Rgb {
    weights.iter().zip(values).fold(Rgb::BLACK, |sum, (w, v)| sum + *v * *w)
}

/// Room for what [`Axis`] works out.
#[derive(Default)]
pub(super) struct Room {
    /// By row of points, foretold along it.
    along: Vec<Rgb>,
    /// By row of points, then pixel.
    rows: Vec<Rgb>,
}
