//! The light that one reflection off rough facets loses: how much, and a lobe that gives it back.
//!
//! Kulla and Conty, "Revisiting Physically Based Shading at Imageworks", SIGGRAPH 2017 course: with E(w) the share of
//! light that a white surface reflects at once, the lobe (1 - E(wo)) (1 - E(wi)) / (pi (1 - Eavg)) reflects the rest,
//! and is reciprocal. E is integrated here for the one width a material has, not looked up in a general table, so it
//! holds for anisotropic surfaces as well.

use crate::color::Rgb;
use crate::materials::conductor::schlick_weight;
use crate::materials::microfacet::{Ggx, reflect};
use crate::math::trig::{SinCos, sin_cos_2pi};
use glam::Vec3;
use std::f32::consts::TAU;

/// Cells of the table along the cosine.
const CELLS: usize = 32;
/// Rows of the table along the azimuth of an anisotropic surface, ends included.
const ROWS: usize = 9;
/// Reflections averaged for an entry, on the Fibonacci lattice of so many points and this generator (Sloan and Joe,
/// "Lattice Methods for Multiple Integration", 1994, section 3.2): what grazes the horizon is thinly spread in one
/// direction, and a grid would miss it.
const LATTICE: [u32; 2] = [1597, 987];
/// The same where there are more entries to fill.
const ANISOTROPIC_LATTICE: [u32; 2] = [610, 377];
/// A surface that loses less than this of the light from a hemisphere is left alone.
const NEGLIGIBLE: f32 = 1e-4;

/// Losses over directions, and the lobe made of them.
#[derive(Debug, Clone)]
pub struct MultiScatter {
    ggx: Ggx,
    /// Rows of [`Entry`] by azimuth; one row if isotropic.
    rows: Vec<[Entry; CELLS + 1]>,
    /// 1 - Eavg.
    mean_loss: f32,
    /// Geometric mean of the widths: the scale along the cosine by which directions are drawn.
    alpha: f32,
    /// Density over [`abscissa`] at the ends of cells by which directions are drawn; linear between.
    density: [f32; CELLS + 1],
    /// Its integral up to each cell's end.
    below: [f32; CELLS],
}

/// What a direction loses.
#[derive(Debug, Clone, Copy, Default)]
pub struct Entry {
    /// 1 - E.
    pub loss: f32,
    /// The part of E that Schlick's approximation whitens: E of (1 - cos)^5.
    pub whitened: f32,
}

impl Entry {
    fn lerp(self, o: Entry, t: f32) -> Entry {
        Entry {
            loss: self.loss + (o.loss - self.loss) * t,
            whitened: self.whitened + (o.whitened - self.whitened) * t,
        }
    }

    /// A cosine at which to take Fresnel's reflectance for all the facets that reflect once; exact for Schlick's.
    pub fn mean_facet_cos(&self) -> f32 {
        1.0 - (self.whitened / (1.0 - self.loss).max(1e-6)).clamp(0.0, 1.0).powf(0.2)
    }
}

impl MultiScatter {
    /// Integrates the losses; None where they are negligible.
    pub fn new(ggx: Ggx) -> Option<Self> {
        let count = if ggx.is_isotropic() { 1 } else { ROWS };
        let row = |r: usize| {
            // Rows are even in the width towards their azimuth, on which losses depend: ay^2 + (ax^2 - ay^2) x^2.
            let f = r as f32 / (ROWS - 1) as f32;
            let alpha = ggx.ay + (ggx.ax - ggx.ay) * f;
            let x = (f * (alpha + ggx.ay) / (ggx.ax + ggx.ay)).sqrt();
            let y = sine(x);
            std::array::from_fn(|i| {
                let mu = cosine(alpha, i as f32 / CELLS as f32);
                integrate(&ggx, Vec3::new(sine(mu) * x, sine(mu) * y, mu))
            })
        };
        let mut table = MultiScatter {
            ggx,
            rows: (0..count).map(row).collect(),
            mean_loss: 0.0,
            alpha: (ggx.ax * ggx.ay).sqrt(),
            density: [0.0; CELLS + 1],
            below: [0.0; CELLS],
        };
        table.mean_loss = table.integrate_mean();
        if table.mean_loss < NEGLIGIBLE {
            return None;
        }
        table.build_density();
        Some(table)
    }

    /// Losses at a cosine, averaged over the azimuth. A quarter is all there is, by symmetry.
    fn loss_at(&self, mu: f32) -> f64 {
        let turns = if self.rows.len() == 1 { 1 } else { 32 };
        let loss = |i: usize| {
            let SinCos { sin, cos } = sin_cos_2pi(0.25 * (i as f32 + 0.5) / turns as f32);
            f64::from(self.at(Vec3::new(sine(mu) * cos, sine(mu) * sin, mu)).loss)
        };
        (0..turns).map(loss).sum::<f64>() / turns as f64
    }

    /// 2 * integral of loss(mu) mu dmu of the table as it is interpolated, so that the lobe returns exactly what the
    /// table says is lost.
    fn integrate_mean(&self) -> f32 {
        const STEPS: usize = 8 * CELLS;
        let at = |s: f32| cosine(self.alpha, s / STEPS as f32);
        let strip = |i: usize| {
            let (a, b) = (at(i as f32), at(i as f32 + 1.0));
            self.loss_at(at(i as f32 + 0.5)) * f64::from((b - a) * (b + a))
        };
        (0..STEPS).map(strip).sum::<f64>() as f32
    }

    fn build_density(&mut self) {
        let value = |i: usize| {
            let x = i as f32 / CELLS as f32;
            let mu = cosine(self.alpha, x);
            self.loss_at(mu) * f64::from(mu / slope(self.alpha, mu))
        };
        let values: [f64; CELLS + 1] = std::array::from_fn(value);
        let mut sum = 0.0;
        let sums: [f64; CELLS] = std::array::from_fn(|i| {
            sum += 0.5 * (values[i] + values[i + 1]) / CELLS as f64;
            sum
        });
        self.density = values.map(|v| (v / sum) as f32);
        self.below = sums.map(|s| (s / sum) as f32);
    }

    /// What is lost of the light from `w`.
    #[inline]
    pub fn at(&self, w: Vec3) -> Entry {
        let along = |row: &[Entry; CELLS + 1], i: usize, f: f32| row[i].lerp(row[i + 1], f);
        if self.rows.len() == 1 {
            let (i, f) = cell(abscissa(self.ggx.ax, w.z.min(1.0)) * CELLS as f32, CELLS);
            return along(&self.rows[0], i, f);
        }
        let (x2, y2) = (w.x * w.x, w.y * w.y);
        // Straight down any azimuth will do, but the quotient must not be 0 / 0.
        let cos2 = x2 / (x2 + y2).max(f32::MIN_POSITIVE);
        // The width towards this azimuth (Heitz 2014, eq. 80).
        let (ax, ay) = (self.ggx.ax, self.ggx.ay);
        let alpha = (ay * ay + (ax * ax - ay * ay) * cos2).sqrt();
        let (i, f) = cell(abscissa(alpha, w.z.min(1.0)) * CELLS as f32, CELLS);
        let (j, g) = cell((alpha - ay).max(0.0) / (ax - ay) * (ROWS - 1) as f32, ROWS - 1);
        along(&self.rows[j], i, f).lerp(along(&self.rows[j + 1], i, f), g)
    }

    /// The lobe's value per cosine, given what both directions lose and [`MultiScatter::color`].
    #[inline]
    pub fn lobe(&self, wo: Entry, wi: Entry) -> f32 {
        wo.loss * wi.loss / (0.5 * TAU * self.mean_loss)
    }

    /// The lobe's colour for facets that reflect `average` of the light from a hemisphere: of light reflected twice or
    /// more, Eavg leaves at each reflection and the rest meets another facet: F^2 Eavg / (1 - F (1 - Eavg)), which is
    /// Kulla and Conty's series without its first term (Hill, "A Multi-Faceted Exploration", part 3, 2018).
    pub fn color(&self, average: Rgb) -> Rgb {
        average.map(|f| f * f * (1.0 - self.mean_loss) / (1.0 - f * self.mean_loss))
    }

    /// Draws a direction nearly in proportion to the lobe times the cosine.
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> Vec3 {
        let i = self.below.partition_point(|c| *c <= u[0]).min(CELLS - 1);
        let before = if i == 0 { 0.0 } else { self.below[i - 1] };
        let (a, b) = (self.density[i], self.density[i + 1]);
        // The share s of the cell for which a s + (b - a) s^2 / 2 = c.
        let c = ((u[0] - before) * CELLS as f32).max(0.0);
        let root = (a * a + 2.0 * (b - a) * c).max(0.0).sqrt();
        let s = (2.0 * c / (a + root).max(f32::MIN_POSITIVE)).min(1.0);
        let mu = cosine(self.alpha, (i as f32 + s) / CELLS as f32);
        let SinCos { sin, cos } = sin_cos_2pi(u[1]);
        Vec3::new(sine(mu) * cos, sine(mu) * sin, mu)
    }

    /// Density of [`MultiScatter::sample`] per solid angle.
    #[inline]
    pub fn pdf(&self, w: Vec3) -> f32 {
        let mu = w.z.min(1.0);
        let (i, f) = cell(abscissa(self.alpha, mu) * CELLS as f32, CELLS);
        let density = self.density[i] + (self.density[i + 1] - self.density[i]) * f;
        density * slope(self.alpha, mu) / TAU
    }
}

/// The cell of `count` in which `x` lies, and where in it.
#[inline]
fn cell(x: f32, count: usize) -> (usize, f32) {
    let i = (x as usize).min(count - 1);
    (i, x - i as f32)
}

/// The sine of an angle in [0, pi / 2] of this cosine.
#[inline]
fn sine(mu: f32) -> f32 {
    ((1.0 - mu) * (1.0 + mu)).max(0.0).sqrt()
}

/// Where a cosine lies in the table: losses change over cosines of about alpha, whatever alpha is.
#[inline]
fn abscissa(alpha: f32, mu: f32) -> f32 {
    mu * (1.0 + alpha) / (mu + alpha)
}

/// The inverse of [`abscissa`].
#[inline]
fn cosine(alpha: f32, x: f32) -> f32 {
    (alpha * x / (1.0 + alpha - x)).min(1.0)
}

/// The derivative of [`abscissa`].
#[inline]
fn slope(alpha: f32, mu: f32) -> f32 {
    alpha * (1.0 + alpha) / ((mu + alpha) * (mu + alpha))
}

/// Averages the weights of reflections drawn from `wo`.
fn integrate(ggx: &Ggx, wo: Vec3) -> Entry {
    let (mut e, mut whitened) = (0f64, 0f64);
    let [count, generator] = if ggx.is_isotropic() { LATTICE } else { ANISOTROPIC_LATTICE };
    for i in 0..count {
        let u = [i * generator % count, i].map(|k| (k as f32 + 0.5) / count as f32);
        let Some(h) = ggx.sample_visible(wo, u) else { continue };
        let wi = reflect(wo, h);
        if wi.z > 0.0 {
            let weight = ggx.weight(wo, wi);
            e += f64::from(weight);
            whitened += f64::from(weight * schlick_weight(wo.dot(h).clamp(0.0, 1.0)));
        }
    }
    let count = f64::from(count);
    Entry { loss: (1.0 - e / count).clamp(0.0, 1.0) as f32, whitened: (whitened / count) as f32 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{ChiSquare, chi_square_sphere, integrate_sphere};

    #[test]
    fn the_lobe_returns_what_is_lost() {
        for (roughness, anisotropy) in [(1.0, 0.0), (0.5, 0.0), (0.3, 0.0), (0.8, 0.9)] {
            let ms = MultiScatter::new(Ggx::new(roughness, anisotropy)).expect("rough enough");
            for w in [Vec3::Z, Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.1, 0.99, 0.1).normalize()] {
                let wo = ms.at(w);
                let lobe = |wi: glam::DVec3| match wi.z > 0.0 {
                    true => f64::from(ms.lobe(wo, ms.at(wi.as_vec3()))) * wi.z,
                    false => 0.0,
                };
                let returned = integrate_sphere(lobe, 1e-5);
                // The midpoint rule inside cells, relative to what is lost.
                let error = (returned - f64::from(wo.loss)).abs();
                assert!(error < 1e-4 + 2e-3 * f64::from(wo.loss), "{roughness}: {returned} {wo:?}");
            }
        }
    }

    #[test]
    fn directions_follow_their_density() {
        for (i, roughness) in [1.0, 0.5, 0.25].into_iter().enumerate() {
            let ms = MultiScatter::new(Ggx::new(roughness, 0.0)).expect("rough enough");
            let how = ChiSquare { tests: 3, seed: i as u64, ..ChiSquare::default() };
            let pdf = |w: Vec3| if w.z > 0.0 { ms.pdf(w) } else { 0.0 };
            chi_square_sphere("lobe", &how, |rng| Some(ms.sample(rng.vec2().into())), pdf);
        }
    }

    #[test]
    fn smooth_surfaces_lose_nothing() {
        assert!(MultiScatter::new(Ggx::new(0.0, 0.0)).is_none());
    }
}
