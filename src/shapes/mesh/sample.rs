//! Points on a triangle as seen from elsewhere.

use super::refine::Triangle;
use crate::base::shape::{LocalRay, ShapeSample};
use crate::sampling::spherical::SphericalTriangle;
use crate::sampling::warp;
use glam::{DVec3, Vec2, Vec3};

/// A sampled point and where it lies in the triangle.
pub struct TriangleSample {
    /// The sample, without texture coordinates.
    pub sample: ShapeSample,
    /// Weights of the second and third corner.
    pub b: [f64; 2],
}

/// Below this ratio of twice the area to the squared distance of a corner a triangle is sampled by area, as it is where
/// the formulas of the spherical triangle end: seen from so far it is as good as flat, and most triangles of
/// a mesh are spared the trigonometry.
const FLAT: f64 = 1e-4;

/// The triangle as seen from a point; None where it is to be sampled by area.
#[inline]
fn seen(corners: [Vec3; 3], triangle: &Triangle, from: Vec3) -> Option<SphericalTriangle> {
    let distance2 = (triangle.v0 - from.as_dvec3()).length_squared();
    // Squares of both: no root. The longest edge is bounded too, or a needle might reach close to the viewer.
    let edges2 = triangle.e1.length_squared().max(triangle.e2.length_squared());
    if triangle.n.length_squared() < FLAT * FLAT * distance2 * distance2 && edges2 < 0.01 * distance2 {
        return None;
    }
    SphericalTriangle::new(from, corners)
}

/// Uniform over the solid angle, or, where that is small, over the area. None where the triangle is seen edge on.
pub fn sample(corners: [Vec3; 3], from: Vec3, u: [f32; 2]) -> Option<TriangleSample> {
    let triangle = Triangle::new(corners);
    let (n, o) = (triangle.n, from.as_dvec3());
    let (b, pdf) = match seen(corners, &triangle, from) {
        Some(seen) => {
            let d = seen.sample(Vec2::from_array(u)).as_dvec3();
            let at = triangle.locate(&LocalRay { o, d, tnear: 0.0, tfar: f64::INFINITY });
            ([at.b1, at.b2], Some(seen.pdf()))
        }
        None => (warp::triangle(Vec2::from_array(u)).as_dvec2().to_array(), None),
    };
    let p = triangle.at(b[0], b[1]);
    let (wi, dist) = (p - o).normalize_and_length();
    let pdf = pdf.unwrap_or_else(|| area_pdf(n, p - o));
    (pdf > 0.0 && pdf.is_finite() && dist > 0.0).then(|| TriangleSample {
        sample: ShapeSample {
            p: p.as_vec3(),
            ng: n.normalize().as_vec3(),
            uv: Vec2::ZERO,
            wi: wi.as_vec3(),
            dist: dist as f32,
            pdf,
        },
        b,
    })
}

/// The density per solid angle with which [`sample`] takes the direction from `from` to `p` on the triangle.
pub fn pdf(corners: [Vec3; 3], from: Vec3, p: Vec3) -> f32 {
    let triangle = Triangle::new(corners);
    let pdf = match seen(corners, &triangle, from) {
        Some(seen) => seen.pdf(),
        None => area_pdf(triangle.n, p.as_dvec3() - from.as_dvec3()),
    };
    if pdf.is_finite() { pdf } else { 0.0 }
}

/// dist^2 / (cos area), with n = 2 area times the unit normal and d = dist times the unit direction.
fn area_pdf(n: DVec3, d: DVec3) -> f32 {
    (2.0 * d.length_squared() * d.length() / n.dot(d).abs()) as f32
}
