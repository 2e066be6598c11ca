//! A flat disc, or an ellipse once it is placed askew: kernels have no primitive of that kind and ask it.

use glam::{DAffine3, DVec3, Vec2, Vec3};
use skylit::base::ray::MAX_COORDINATE;
use skylit::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use skylit::base::shape::{Dropped, LocalRay, Needs, Placed, Shape, ShapeSample, ShapeSource, Surface};
use skylit::error::{Error, Result};
use skylit::math::aabb::{Aabb, DAabb};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// The registry row.
pub const ROW: Row<dyn ShapeSource> = Row {
    kind: "disc",
    doc: "a flat disc",
    params: &[
        ParamSpec { name: "center", kind: ParamKind::Vector, default: Some("[0, 0, 0]"), doc: "metres" },
        ParamSpec {
            name: "normal",
            kind: ParamKind::Vector,
            default: Some("[0, 1, 0]"),
            doc: "where its outer side looks, any length but 0",
        },
        ParamSpec {
            name: "radius",
            kind: ParamKind::Number { min: 1e-30, max: 1e30 },
            default: Some("1"),
            doc: "metres",
        },
    ],
    build: |p| {
        let normal = DVec3::from_array(p.vector_or("normal", [0.0, 1.0, 0.0])?);
        let Some(n) = (normal / normal.abs().max_element()).try_normalize() else {
            return Err(p.error("normal", "must not be zero"));
        };
        let (u, r) = (n.any_orthonormal_vector(), p.number_or("radius", 1.0)?);
        let center = DVec3::from_array(p.vector_or("center", [0.0; 3])?);
        Ok(Arc::new(Disc { center, u: u * r, v: n.cross(u) * r, outward: 1.0 }))
    },
    samples: || {
        vec![
            Params::new(),
            Params::new()
                .with("center", Value::Numbers(vec![-1.0, 0.5, 2.0]))
                .with("normal", Value::Numbers(vec![1.0, 1.0, -0.3]))
                .with("radius", Value::Number(0.7)),
        ]
    },
};

/// All points center + a u + b v with a^2 + b^2 <= 1. Its outer side is that of u x v times `outward`, which a mirror
/// turns over.
#[derive(Debug, Clone, Copy)]
struct Disc {
    center: DVec3,
    u: DVec3,
    v: DVec3,
    outward: f64,
}

impl Disc {
    fn cross(&self) -> DVec3 {
        self.u.cross(self.v)
    }

    fn bounds64(&self) -> DAabb {
        let half = DVec3::new(self.u.x.hypot(self.v.x), self.u.y.hypot(self.v.y), self.u.z.hypot(self.v.z));
        // A few roundings, outwards.
        let half = half * (1.0 + 4.0 * f64::EPSILON) + self.center.abs() * (2.0 * f64::EPSILON);
        DAabb::new(self.center - half, self.center + half)
    }

    fn placed(&self, m: &DAffine3) -> Result<Disc> {
        let det = m.matrix3.determinant();
        let (u, v) = (m.matrix3 * self.u, m.matrix3 * self.v);
        let disc =
            Disc { center: m.transform_point3(self.center), u, v, outward: self.outward * det.signum() };
        let bounds = disc.bounds64().to_f32();
        if !(det.is_finite() && det != 0.0 && bounds.is_finite() && bounds.max_abs() <= MAX_COORDINATE) {
            return Err(Error::Usage("a disc is placed by a transform that cannot be used".into()));
        }
        Ok(disc)
    }

    /// Where the ray's line meets the plane: its t, and a and b there.
    fn meet(&self, ray: &LocalRay) -> (f64, f64, f64) {
        let n = self.cross();
        let t = (self.center - ray.o).dot(n) / ray.d.dot(n);
        let p = ray.o + ray.d * t - self.center;
        let n2 = n.length_squared();
        (t, p.dot(self.v.cross(n)) / n2, p.dot(n.cross(self.u)) / n2)
    }
}

impl ShapeSource for Disc {
    fn bounds(&self) -> DAabb {
        self.bounds64()
    }

    fn place(self: Arc<Self>, to_group: &DAffine3) -> Result<Placed> {
        Ok(Placed { shape: Arc::new(self.placed(to_group)?), dropped: Dropped::default() })
    }

    fn describe(&self) -> String {
        "disc".into()
    }
}

impl Shape for Disc {
    fn bounds(&self) -> Aabb {
        self.bounds64().to_f32()
    }

    fn primitive_count(&self) -> u32 {
        1
    }

    fn primitive_bounds(&self, _prim: u32) -> Aabb {
        self.bounds64().to_f32()
    }

    fn intersect(&self, ray: &LocalRay, _prim: u32) -> Option<f64> {
        let (t, a, b) = self.meet(ray);
        // A ray in the plane has a t that is no number, and meets nothing.
        (t >= ray.tnear && t <= ray.tfar && a * a + b * b <= 1.0).then_some(t)
    }

    fn refine(&self, ray: &LocalRay, _prim: u32, _hint: f32, _needs: Needs) -> Surface {
        let (t, a, b) = self.meet(ray);
        let p = self.center + self.u * a + self.v * b;
        let n = self.cross() * self.outward;
        Surface {
            t,
            p,
            error: (p.abs() + self.center.abs() + DVec3::splat((p - ray.o).length())) * (8.0 * f64::EPSILON),
            ng: n,
            ns: n,
            uv: (Vec2::new(a as f32, b as f32) + 1.0) * 0.5,
            dpdu: self.u * 2.0,
            dpdv: self.v * 2.0,
            lift: DVec3::ZERO,
        }
    }

    fn primitive_area(&self, _prim: u32) -> f64 {
        PI * self.cross().length()
    }

    fn sample_primitive(&self, prim: u32, from: Vec3, u: [f32; 2]) -> Option<ShapeSample> {
        let (r, phi) = (f64::from(u[0]).sqrt(), TAU * f64::from(u[1]));
        let (a, b) = (r * phi.cos(), r * phi.sin());
        let p = self.center + self.u * a + self.v * b;
        let ng = (self.cross() * self.outward).normalize().as_vec3();
        let to = p - from.as_dvec3();
        let (wi, dist) = (to.normalize_or_zero().as_vec3(), to.length() as f32);
        let pdf = self.pdf_primitive(prim, from, wi, p.as_vec3(), ng);
        let uv = (Vec2::new(a as f32, b as f32) + 1.0) * 0.5;
        (pdf > 0.0 && pdf.is_finite()).then(|| ShapeSample { p: p.as_vec3(), ng, uv, wi, dist, pdf })
    }

    /// Density 1 / area, seen under dist^2 / cos.
    fn pdf_primitive(&self, prim: u32, from: Vec3, wi: Vec3, p: Vec3, ng: Vec3) -> f32 {
        let distance2 = (p - from).as_dvec3().length_squared();
        let cos = f64::from(wi.dot(ng).abs());
        if cos > 0.0 { (distance2 / (cos * self.primitive_area(prim))) as f32 } else { 0.0 }
    }

    fn transformed(&self, by: &DAffine3) -> Result<Arc<dyn Shape>> {
        Ok(Arc::new(self.placed(by)?))
    }

    fn memory(&self) -> u64 {
        size_of::<Self>() as u64
    }

    fn describe(&self) -> String {
        "disc".into()
    }
}
