//! Surface points of a geometry for rays to be aimed at, and the vertices where they arrive: the code that a renderer
//! uses, without a scene around it.

use super::random::Stream;
use crate::base::geometry::{Geometry, Placement};
use crate::base::hit::Hit;
use crate::base::ray::Ray;
use crate::base::shape::Needs;
use crate::base::vertex::{Origin, Vertex, local_ray};
use crate::math::aabb::DAabb;
use crate::math::bounds::UNDERFLOW;
use glam::{DVec3, Vec3};

/// A ray to a random point of a random primitive of a random leaf, from up to two radii of the leaf to any side of the
/// point. None where the primitive cannot be sampled.
pub fn ray_to_surface(geometry: &Geometry, random: &mut Stream) -> Option<Ray> {
    let paths = geometry.root().paths;
    if paths == 0 {
        return None;
    }
    let found = geometry.resolve(random.below(paths));
    let shape = &found.leaf.shape;
    let prim = random.below(u64::from(shape.primitive_count().max(1))) as u32;
    let [u, v] = random.barycentrics();
    let p = match shape.triangles() {
        Some(mesh) => {
            let [a, b, c] = mesh.corners(prim).map(|c| c.as_dvec3());
            a + (b - a) * u + (c - a) * v
        }
        None => {
            let from = shape.bounds().center() + random.direction() * (2.0 * shape.bounds().radius());
            shape.sample_primitive(prim, from, [u as f32, v as f32])?.p.as_dvec3()
        }
    };
    let to_render = |p: DVec3| found.placement.as_ref().map_or(p, |pl| pl.to_render.transform_point3(p));
    let radius = radius(&shape.bounds().into(), found.placement.as_ref());
    let target = to_render(p);
    let away = random.direction().as_dvec3() * (radius * (0.01 + 2.0 * random.unit()));
    let o = (target + away).as_vec3();
    let d = (target - o.as_dvec3()).normalize_or_zero().as_vec3();
    Some(Ray::new(o, d, random.bits() as u32)).filter(Ray::is_valid)
}

/// Half the diagonal of placed bounds, in render space.
fn radius(bounds: &DAabb, placement: Option<&Placement>) -> f64 {
    placement.map_or(*bounds, |p| bounds.transformed(&p.to_render)).radius()
}

/// The vertex where a ray arrives.
pub fn vertex_at(geometry: &Geometry, ray: &Ray, hit: Hit) -> Vertex {
    let found = geometry.resolve(hit.path);
    let placement = found.placement.as_ref();
    let surface = found.leaf.shape.refine(&local_ray(ray, placement), hit.prim, hit.t, Needs::default());
    Vertex::new(ray, &surface, placement, Origin { hit, object: 0, slot: 0, spread: 0.0 })
}

/// The vertex's bound along its normal: how far from the surface a ray must start. Where it is below the normal numbers,
/// in planes of a coordinate 0, that is their smallest.
pub fn bound(v: &Vertex) -> f64 {
    f64::from(v.ng.abs().dot(v.error)).max(UNDERFLOW)
}

/// The spacing of normal f32 numbers at a point, along a direction: what placing an origin there costs at least.
pub fn spacing(p: Vec3, n: Vec3) -> f64 {
    let ulp = |x: f32| (f64::from(x.abs().next_up()) - f64::from(x.abs())).max(UNDERFLOW);
    n.abs().as_dvec3().dot(DVec3::new(ulp(p.x), ulp(p.y), ulp(p.z)))
}

/// A triangle's plane in render space, in double precision.
#[derive(Debug, Clone, Copy)]
pub struct Plane {
    /// A corner.
    pub corner: DVec3,
    /// Unit normal.
    pub n: DVec3,
    /// Product of two edges over twice the area, at least 1: how badly the normal is known.
    pub needle: f64,
}

impl Plane {
    /// Of the primitive of a hit, if it is a triangle.
    pub fn of(geometry: &Geometry, path: u64, prim: u32) -> Option<Self> {
        let found = geometry.resolve(path);
        let corners = found.leaf.shape.triangles()?.corners(prim).map(|c| {
            let p = c.as_dvec3();
            found.placement.as_ref().map_or(p, |pl| pl.to_render.transform_point3(p))
        });
        let (e1, e2) = (corners[1] - corners[0], corners[2] - corners[0]);
        let (n, twice_area) = e1.cross(e2).normalize_and_length();
        let longest = e1.length().max(e2.length()).max((e2 - e1).length());
        Some(Plane { corner: corners[0], n, needle: longest * longest / twice_area })
    }

    /// Signed distance of a point.
    pub fn height(&self, p: DVec3) -> f64 {
        (p - self.corner).dot(self.n)
    }
}
