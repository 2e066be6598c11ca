//! What surfaces of one direction make of light from each cell, in vector code.

use crate::math::simd::Kernel;
use glam::Vec3;

/// Columns of what is known of cells.
#[derive(Default)]
pub(super) struct Columns {
    pub x: Vec<f32>,
    pub y: Vec<f32>,
    pub z: Vec<f32>,
    /// Sine, at least, of the largest angle between a direction of the cell and its middle; more than 0.
    pub reach: Vec<f32>,
    /// Integral of luminance, over that of all cells.
    pub flux: Vec<f32>,
    /// Solid angle, steradians.
    pub angle: Vec<f32>,
    /// Half way to the middles of its sides of larger u and of larger v, see [`super::partition::CellLight::sides`].
    pub sides: [[Vec<f32>; 3]; 2],
}

impl Columns {
    pub fn push(&mut self, middle: Vec3, sides: [Vec3; 2], reach: f32, flux: f32, angle: f32) {
        self.x.push(middle.x);
        self.y.push(middle.y);
        self.z.push(middle.z);
        self.reach.push(reach.max(1e-4));
        self.flux.push(flux);
        self.angle.push(angle);
        for (columns, side) in self.sides.iter_mut().zip(sides) {
            columns.iter_mut().zip((middle + 0.5 * side).to_array()).for_each(|(column, x)| column.push(x));
        }
    }

    pub fn memory(&self) -> u64 {
        48 * self.flux.len() as u64
    }
}

/// The larger one; one instruction, where `f32::max` also minds NaN.
#[inline(always)]
pub(super) fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// See [`larger`].
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The mean, roughly, of the cosine over a cell whose middle has cosine `x`, zero only where all of it lies below the
/// horizon: a parabola where the horizon may cut it.
#[inline(always)]
fn clipped_cosine(x: f32, reach: f32) -> f32 {
    let t = smaller(larger(x + reach, 0.0), 2.0 * reach);
    larger(t * t * (0.25 / reach), x)
}

/// Directions that differ by no more than `spread` (a sine) from one.
#[derive(Clone, Copy)]
pub(super) struct About {
    pub axis: Vec3,
    pub spread: f32,
}

/// Of surfaces that scatter evenly, by their normals: the cosine.
pub(super) struct Even<'a> {
    pub cells: &'a Columns,
    pub normals: About,
    pub weights: &'a mut [f32],
}

impl Kernel for Even<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let len = self.weights.len();
        let c = self.cells;
        let (x, y, z) = (&c.x[..len], &c.y[..len], &c.z[..len]);
        let reach = &c.reach[..len];
        let About { axis: n, spread } = self.normals;
        for (i, w) in self.weights.iter_mut().enumerate() {
            let cos = n.x * x[i] + n.y * y[i] + n.z * z[i];
            *w = clipped_cosine(cos, reach[i] + spread);
        }
    }
}

/// Of surfaces of facets, by the directions in which they would mirror their viewers: the facets' distribution
/// D (Walter et al. 2007, eq. 33) over 4, as if seen from straight above, where the half vector lies half as far from the
/// normal as light from the mirrored direction. Seen aslant the lobe is narrower across.
pub(super) struct Facets<'a> {
    pub cells: &'a Columns,
    pub mirrored: About,
    pub alpha: f32,
    pub weights: &'a mut [f32],
}

impl Kernel for Facets<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let len = self.weights.len();
        let c = self.cells;
        let (x, y, z) = (&c.x[..len], &c.y[..len], &c.z[..len]);
        let reach = &c.reach[..len];
        let About { axis: r, spread } = self.mirrored;
        // Half vectors of a cell, and of mirrored directions, spread half as far; of a square, the second moment is a
        // third.
        let a2 = self.alpha * self.alpha + spread * spread * (1.0 / 12.0);
        for (i, w) in self.weights.iter_mut().enumerate() {
            let cos = r.x * x[i] + r.y * y[i] + r.z * z[i];
            let cos2 = smaller(larger(0.5 + 0.5 * cos, 0.0), 1.0);
            let a2 = a2 + reach[i] * reach[i] * (1.0 / 12.0);
            let q = cos2 * (a2 - 1.0) + 1.0;
            *w = (0.25 / std::f32::consts::PI) * a2 / (q * q);
        }
    }
}
