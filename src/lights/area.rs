//! Light from the surface of an object whose material emits.

use crate::base::light::{Extent, Light, LightSample, PathEnd, Receiver};
use crate::base::material::Material;
use crate::base::shape::Shape;
use crate::color::Rgb;
use crate::math::polygon::triangle_irradiance;
use crate::sampling::distribution::Distribution1D;
use glam::Vec3;
use std::f32::consts::PI;
use std::sync::Arc;

/// An emitting shape in render space. A primitive is chosen by its area times its material's mean radiance, then a
/// point of it by solid angle where the shape knows how.
pub struct AreaLight {
    shape: Arc<dyn Shape>,
    /// By slot; the last one stands in for slots beyond.
    materials: Vec<Arc<dyn Material>>,
    primitives: Distribution1D,
}

impl AreaLight {
    /// From a shape in render space, whose primitives have the numbers that hits report, and the materials of its
    /// object by slot. None if nothing of it emits.
    pub fn new(shape: Arc<dyn Shape>, materials: Vec<Arc<dyn Material>>) -> Option<Self> {
        let last = materials.len().checked_sub(1)?;
        // Luminous exitance of each slot.
        let exitance: Vec<f64> = materials
            .iter()
            .map(|m| {
                m.emitter()
                    .map_or(0.0, |e| f64::from(e.mean.luminance()) * if e.two_sided { 2.0 } else { 1.0 })
            })
            .collect();
        let weight = |p| match exitance[shape.material_slot(p).min(last)] {
            0.0 => 0.0,
            e => e * shape.primitive_area(p),
        };
        let primitives = Distribution1D::new((0..shape.primitive_count()).map(weight))?;
        Some(AreaLight { shape, materials, primitives })
    }

    #[inline]
    fn material(&self, prim: u32) -> &dyn Material {
        let slot = self.shape.material_slot(prim);
        &**self.materials.get(slot).unwrap_or(&self.materials[self.materials.len() - 1])
    }
}

/// `u[0]` with more digits than an f32 has, taken from both numbers' own bits. Choosing among millions of primitives
/// uses up the 24 digits of an f32, and points would lie on lines in the chosen one. What is added is smaller than
/// the distance between neighbouring values of u[0], so that stratified numbers stay stratified.
#[inline]
fn refined(u: [f32; 2]) -> f64 {
    let bits = u64::from(u[0].to_bits()) << 32 | u64::from(u[1].to_bits());
    // Finaliser of MurmurHash3 (Appleby), one round.
    let h = (bits ^ bits >> 33).wrapping_mul(0xff51_afd7_ed55_8ccd);
    let fraction = ((h ^ h >> 33) >> 11) as f64 / (1u64 << 53) as f64;
    f64::from(u[0]) + fraction * (0.5 * f64::from(f32::EPSILON))
}

impl Light for AreaLight {
    fn sample_li(&self, at: &Receiver, u: [f32; 2]) -> Option<LightSample> {
        let choice = self.primitives.sample(refined(u));
        let prim = choice.index as u32;
        // Below 1 also after rounding to f32.
        let u = [(choice.du as f32).min(1.0 - f32::EPSILON / 2.0), u[1]];
        let s = self.shape.sample_primitive(prim, at.p, u)?;
        let li = self.material(prim).emission(s.uv, -s.wi.dot(s.ng));
        let pdf = choice.pmf as f32 * s.pdf;
        if li.is_black() || pdf <= 0.0 || !pdf.is_finite() {
            return None;
        }
        Some(LightSample { wi: s.wi, dist: s.dist, li: Some(li), pdf, delta: false })
    }

    fn pdf_li(&self, at: &Receiver, end: &PathEnd) -> f32 {
        let Some(v) = end.vertex else { return 0.0 };
        let pmf = self.primitives.pmf(v.prim as usize);
        if pmf == 0.0 {
            return 0.0;
        }
        pmf as f32 * self.shape.pdf_primitive(v.prim, at.p, end.wi, v.p, v.ng)
    }

    fn le(&self, end: &PathEnd) -> Rgb {
        match end.vertex {
            Some(v) => self.material(v.prim).emission(v.uv, v.wo.dot(v.ng)),
            None => Rgb::BLACK,
        }
    }

    /// Lambert's formula over all triangles of an unvarying light: as slow as they are many.
    fn irradiance_closed_form(&self, p: Vec3, n: Vec3) -> Option<Rgb> {
        let mesh = self.shape.triangles()?;
        let (p, n) = (p.as_dvec3(), n.as_dvec3());
        let mut sum = Rgb::BLACK;
        for prim in 0..self.shape.primitive_count() {
            let Some(emitter) = self.material(prim).emitter() else { continue };
            if !emitter.uniform {
                return None;
            }
            let corners = mesh.corners(prim).map(|c| c.as_dvec3() - p);
            let ng = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            if emitter.two_sided || corners[0].dot(ng) < 0.0 {
                sum += emitter.mean * triangle_irradiance(corners, n) as f32;
            }
        }
        Some(sum)
    }

    fn power(&self, _extent: &Extent) -> f32 {
        PI * self.primitives.total() as f32
    }
}
