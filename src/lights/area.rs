//! Light from the surface of an object whose material emits.

use crate::base::light::{EmitterBounds, Extent, Light, LightSample, PathEnd, Receiver};
use crate::base::material::{Emitter, Material};
use crate::base::shape::{Shape, ShapeSample};
use crate::color::Rgb;
use crate::lights::rectangle::RectangleLamp;
use crate::lights::tree::{LightTree, union};
use crate::math::polygon::triangle_irradiance;
use crate::sampling::distribution::Distribution1D;
use glam::Vec3;
use std::sync::Arc;

/// An emitting shape in render space. A primitive is chosen by what it may bring to the receiver, or, where there are
/// very many, by its area times its material's mean radiance; then a point of it by solid angle where the shape knows how.
pub struct AreaLight {
    shape: Arc<dyn Shape>,
    /// By slot; the last one stands in for slots beyond.
    materials: Vec<Arc<dyn Material>>,
    primitives: Primitives,
    bounds: EmitterBounds,
}

/// The choice of a primitive.
enum Primitives {
    /// By place and power.
    Near(LightTree),
    /// By power alone.
    Power(Distribution1D),
    /// None is needed: both are one rectangle.
    Rectangle(RectangleLamp),
}

/// More primitives than this are chosen by power alone: a tree takes 100 bytes for each.
const MOST_IN_TREE: u32 = 1 << 16;

/// Bytes that a lamp takes for each primitive: most for its tree.
pub const BYTES_PER_PRIMITIVE: u64 = 150;

impl AreaLight {
    /// From a shape in render space, whose primitives have the numbers that hits report, and the materials of its
    /// object by slot. None if nothing of it emits.
    pub fn new(shape: Arc<dyn Shape>, materials: Vec<Arc<dyn Material>>) -> Option<Self> {
        let last = materials.len().checked_sub(1)?;
        let emitters: Vec<Option<Emitter>> = materials.iter().map(|m| m.emitter()).collect();
        let emitter = |p| emitters[shape.material_slot(p).min(last)];
        let count = shape.primitive_count();
        let primitives = match (rectangle(&*shape, &emitter), count) {
            (Some(lamp), _) => Primitives::Rectangle(lamp),
            (None, 2..=MOST_IN_TREE) => {
                let all: Vec<EmitterBounds> =
                    (0..count).map(|p| primitive_bounds(&*shape, p, emitter(p))).collect();
                Primitives::Near(LightTree::new(&all)?)
            }
            (None, _) => {
                let weights = (0..count).map(|p| power(&*shape, p, emitter(p)));
                Primitives::Power(Distribution1D::new(weights)?)
            }
        };
        let shining = (0..count).filter(|&p| emitter(p).is_some());
        let bounds =
            shining.map(|p| primitive_bounds(&*shape, p, emitter(p))).reduce(|a, b| union(&a, &b))?;
        // Sums of millions in f32 would lose the last ones.
        let total: f64 = (0..count).map(|p| power(&*shape, p, emitter(p))).sum();
        if total == 0.0 {
            return None;
        }
        let bounds = EmitterBounds { power: total as f32, ..bounds };
        Some(AreaLight { shape, materials, primitives, bounds })
    }

    /// What a point of a primitive sends; None if that is nothing.
    fn light_sample(&self, prim: u32, s: ShapeSample, pdf: f32) -> Option<LightSample> {
        let li = self.material(prim).emission(s.uv, -s.wi.dot(s.ng));
        let usable = !li.is_black() && pdf > 0.0 && pdf.is_finite();
        usable.then_some(LightSample { wi: s.wi, dist: s.dist, li: Some(li), pdf, delta: false })
    }

    #[inline]
    fn material(&self, prim: u32) -> &dyn Material {
        let slot = self.shape.material_slot(prim);
        &**self.materials.get(slot).unwrap_or(&self.materials[self.materials.len() - 1])
    }
}

/// The rectangle that a shape of two triangles is, if it shines alike from all of it.
fn rectangle(shape: &dyn Shape, emitter: &dyn Fn(u32) -> Option<Emitter>) -> Option<RectangleLamp> {
    if shape.primitive_count() != 2 || shape.material_slot(0) != shape.material_slot(1) {
        return None;
    }
    let emitter = emitter(0).filter(|e| e.uniform)?;
    RectangleLamp::of(shape.triangles()?, emitter.two_sided)
}

/// Luminous power of a primitive: pi times radiance and area, on each side that shines.
fn power(shape: &dyn Shape, prim: u32, emitter: Option<Emitter>) -> f64 {
    let Some(e) = emitter else { return 0.0 };
    let sides = if e.two_sided { 2.0 } else { 1.0 };
    std::f64::consts::PI * f64::from(e.mean.luminance()) * sides * shape.primitive_area(prim)
}

fn primitive_bounds(shape: &dyn Shape, prim: u32, emitter: Option<Emitter>) -> EmitterBounds {
    let flat = shape.triangles().and_then(|t| {
        let [a, b, c] = t.corners(prim).map(|v| v.as_dvec3());
        (b - a).cross(c - a).try_normalize()
    });
    EmitterBounds {
        bounds: shape.primitive_bounds(prim),
        axis: flat.map_or(Vec3::Z, |n| n.as_vec3()),
        cos_spread: if flat.is_some() { 1.0 } else { -1.0 },
        cos_reach: 0.0,
        two_sided: emitter.is_some_and(|e| e.two_sided),
        power: power(shape, prim, emitter) as f32,
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
        let (prim, pmf, du) = match &self.primitives {
            Primitives::Rectangle(lamp) => {
                let s = lamp.sample(at.p, u)?;
                return self.light_sample(0, s, s.pdf);
            }
            Primitives::Near(tree) => {
                let c = tree.sample(at, refined(u))?;
                (c.emitter, c.pmf, c.du)
            }
            Primitives::Power(table) => {
                let c = table.sample(refined(u));
                (c.index as u32, c.pmf, c.du)
            }
        };
        // Below 1 also after rounding to f32.
        let u = [(du as f32).min(1.0 - f32::EPSILON / 2.0), u[1]];
        let s = self.shape.sample_primitive(prim, at.p, u)?;
        self.light_sample(prim, s, pmf as f32 * s.pdf)
    }

    fn pdf_li(&self, at: &Receiver, end: &PathEnd) -> f32 {
        let Some(v) = end.vertex else { return 0.0 };
        let pmf = match &self.primitives {
            Primitives::Rectangle(lamp) => return lamp.pdf(at.p, v.p),
            Primitives::Near(tree) => tree.pmf(at, v.prim),
            Primitives::Power(table) => table.pmf(v.prim as usize),
        };
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
        self.bounds.power
    }

    fn bounds(&self) -> Option<EmitterBounds> {
        Some(self.bounds)
    }
}
