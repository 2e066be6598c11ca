//! Points on a triangle as seen from elsewhere.

use crate::base::shape::ShapeSample;
use crate::sampling::warp;
use glam::{DVec3, Vec2};

/// A sampled point and where it lies in the triangle.
pub struct TriangleSample {
    /// The sample, without texture coordinates.
    pub sample: ShapeSample,
    /// Barycentric coordinates.
    pub b: [f64; 3],
}

/// Uniform over the area. None where the triangle is seen edge on.
pub fn sample(v: &[DVec3; 3], from: DVec3, u: [f32; 2]) -> Option<TriangleSample> {
    let b = warp::triangle(Vec2::from_array(u)).as_dvec2();
    let (e1, e2) = (v[1] - v[0], v[2] - v[0]);
    let p = v[0] + e1 * b.x + e2 * b.y;
    let pdf = area_pdf(e1.cross(e2), p - from);
    let dist = (p - from).length();
    if !(pdf > 0.0 && pdf.is_finite()) {
        return None;
    }
    let sample = ShapeSample {
        p: p.as_vec3(),
        ng: e1.cross(e2).normalize().as_vec3(),
        uv: Vec2::ZERO,
        wi: ((p - from) / dist).as_vec3(),
        dist: dist as f32,
        pdf,
    };
    Some(TriangleSample { sample, b: [1.0 - b.x - b.y, b.x, b.y] })
}

/// The density per solid angle with which [`sample`] takes the direction from `from` to `p` on the triangle.
pub fn pdf(v: &[DVec3; 3], from: DVec3, p: DVec3) -> f32 {
    area_pdf((v[1] - v[0]).cross(v[2] - v[0]), p - from)
}

/// dist^2 / (cos area), with n = 2 area times the unit normal and d = dist times the unit direction.
fn area_pdf(n: DVec3, d: DVec3) -> f32 {
    let pdf = 2.0 * d.length_squared() * d.length() / n.dot(d).abs();
    if pdf.is_finite() { pdf as f32 } else { 0.0 }
}
