//! Coarse cells, and their weights for a surface, in vector code.

use super::LANES;
use crate::base::light::Lobes;
use crate::base::material::Scattering;
use crate::math::simd::Kernel;
use glam::Vec3;

/// Columns of what is known of coarse cells; padding has no flux.
#[derive(Default)]
pub(super) struct Cells {
    pub x: Vec<f32>,
    pub y: Vec<f32>,
    pub z: Vec<f32>,
    /// Sine, at least, of the largest angle between a direction of the cell and its middle.
    pub reach: Vec<f32>,
    /// A quarter over `reach`.
    pub quarter: Vec<f32>,
    /// Integral of luminance.
    pub flux: Vec<f32>,
}

impl Cells {
    pub fn resize(&mut self, n: usize) {
        // A middle that is a direction and a reach that is not zero: no division goes wrong.
        self.x.resize(n, 1.0);
        self.y.resize(n, 0.0);
        self.z.resize(n, 0.0);
        self.reach.resize(n, 1.0);
        self.quarter.resize(n, 0.25);
        self.flux.resize(n, 0.0);
    }

    pub fn set(&mut self, i: usize, middle: Vec3, reach: f32, flux: f32) {
        (self.x[i], self.y[i], self.z[i]) = (middle.x, middle.y, middle.z);
        self.reach[i] = reach.max(1e-4);
        self.quarter[i] = 0.25 / self.reach[i];
        self.flux[i] = flux;
    }
}

/// The larger one; one instruction, where `f32::max` also minds NaN.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// See [`larger`].
#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The mean, roughly, of the cosine over a cell whose middle has cosine `x`, zero only where all of it lies below the
/// horizon: a parabola where the horizon may cut it. `quarter` is a quarter over `reach`.
#[inline(always)]
fn clipped_cosine(x: f32, reach: f32, quarter: f32) -> f32 {
    let t = smaller(larger(x + reach, 0.0), 2.0 * reach);
    larger(t * t * quarter, x)
}

/// Weights of surfaces that scatter evenly.
pub(super) struct Even<'a> {
    pub cells: &'a Cells,
    pub n: Vec3,
    pub weights: &'a mut [f32],
}

impl Kernel for Even<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let len = self.weights.len();
        let c = self.cells;
        let (x, y, z) = (&c.x[..len], &c.y[..len], &c.z[..len]);
        let (reach, quarter, flux) = (&c.reach[..len], &c.quarter[..len], &c.flux[..len]);
        for (i, w) in self.weights.iter_mut().enumerate() {
            let cos = self.n.x * x[i] + self.n.y * y[i] + self.n.z * z[i];
            *w = flux[i] * clipped_cosine(cos, reach[i], quarter[i]);
        }
    }
}

/// Weights of surfaces that also have facets: their distribution D (Walter et al. 2007, eq. 33) at the half vector of
/// the viewer and the cell's middle, over 4 cos of the viewer; cosine of the light and masking nearly cancel the rest.
pub(super) struct Both<'a> {
    pub cells: &'a Cells,
    pub n: Vec3,
    pub lobes: Lobes,
    pub weights: &'a mut [f32],
}

impl Kernel for Both<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let len = self.weights.len();
        let c = self.cells;
        let (x, y, z) = (&c.x[..len], &c.y[..len], &c.z[..len]);
        let (reach, quarter, flux) = (&c.reach[..len], &c.quarter[..len], &c.flux[..len]);
        let (n, wo) = (self.n, self.lobes.wo);
        let cos_o = n.dot(wo).max(0.0);
        let Scattering { even, facets, alpha } = self.lobes.scattering;
        let alpha2 = alpha * alpha;
        let facets = facets / (4.0 * std::f32::consts::PI * cos_o.max(0.05));
        for (i, w) in self.weights.iter_mut().enumerate() {
            let cos = n.x * x[i] + n.y * y[i] + n.z * z[i];
            let cos_wo = wo.x * x[i] + wo.y * y[i] + wo.z * z[i];
            // cos^2 of the angle between the normal and the half vector: (cos + cos_o)^2 / |wo + wi|^2.
            let up = larger(cos + cos_o, 0.0);
            let cos2 = smaller(up * up / larger(2.0 + 2.0 * cos_wo, 1e-6), 1.0);
            // Half vectors of a cell spread half as far as its directions; of a square, the second moment is a third.
            let a2 = alpha2 + reach[i] * reach[i] * (1.0 / 12.0);
            let q = cos2 * (a2 - 1.0) + 1.0;
            let d = a2 / (q * q);
            let lit = if cos > -reach[i] { facets * d } else { 0.0 };
            *w = flux[i] * (even * clipped_cosine(cos, reach[i], quarter[i]) + lit);
        }
    }
}

/// Running sums of rows.
pub(super) struct Sum<'a> {
    pub weights: &'a [f32],
    pub stride: usize,
    pub sums: &'a mut [f64],
}

impl Kernel for Sum<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let mut total = 0.0;
        for (row, sum) in self.weights.chunks_exact(self.stride).zip(self.sums) {
            let mut lanes = [0f32; LANES];
            for eight in row.chunks_exact(LANES) {
                for (lane, w) in lanes.iter_mut().zip(eight) {
                    *lane += *w;
                }
            }
            let of_row: f64 = lanes.iter().map(|l| f64::from(*l)).sum();
            // A row without weight adds nothing, so that it is never chosen.
            total += of_row;
            *sum = total;
        }
    }
}
