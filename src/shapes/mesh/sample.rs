//! Points on a triangle as seen from elsewhere.

use super::refine::locate;
use crate::base::shape::{LocalRay, ShapeSample};
use crate::math::trig::{SinCos, atan2_turns, sin_cos_2pi};
use crate::sampling::warp;
use glam::{DVec3, Vec2};
use std::f64::consts::TAU;

/// A sampled point and where it lies in the triangle.
pub struct TriangleSample {
    /// The sample, without texture coordinates.
    pub sample: ShapeSample,
    /// Barycentric coordinates.
    pub b: [f64; 3],
}

/// Below this solid angle (steradians) the triangle is as good as flat to its viewer, and is sampled by area; in
/// double precision the formulas of the spherical triangle keep at least six digits above it.
const SMALLEST: f64 = 1e-5;

/// A triangle as seen from a point.
struct Seen {
    /// Unit directions to its corners.
    w: [DVec3; 3],
    /// tan(solid angle / 2) = g0 / (g1 + g2); g0 is their scalar triple product.
    g0: f64,
    g1: f64,
    g2: f64,
    /// In turns: the solid angle is 2 pi times twice this.
    half_turns: f32,
}

impl Seen {
    /// None where the solid angle is too small, or a corner is the viewer.
    fn new(v: &[DVec3; 3], n: DVec3, from: DVec3) -> Option<Seen> {
        let d = v.map(|c| c - from);
        let l = d.map(|d| d.length());
        let w = [d[0] / l[0], d[1] / l[1], d[2] / l[2]];
        // The triple product by way of the normal: small triangles keep their digits.
        let g0 = n.dot(d[0]).abs() / (l[0] * l[1] * l[2]);
        let (g1, g2) = (w[0].dot(w[2]) + w[1].dot(w[2]), 1.0 + w[0].dot(w[1]));
        // Van Oosterom and Strackee, "The Solid Angle of a Plane Triangle", 1983. Most triangles of a mesh are
        // small: for those tan x = x is near enough to decide.
        if g0 <= 0.25 * SMALLEST * (g1 + g2).max(0.0) || !g0.is_finite() {
            return None;
        }
        let half_turns = atan2_turns(g0 as f32, (g1 + g2) as f32);
        (f64::from(half_turns) * (2.0 * TAU) > SMALLEST).then_some(Seen { w, g0, g1, g2, half_turns })
    }

    fn pdf(&self) -> f64 {
        1.0 / (2.0 * TAU * f64::from(self.half_turns))
    }

    /// A direction uniform over the solid angle (Arvo, "Stratified Sampling of Spherical Triangles", 1995, in the
    /// form of Peters, "BRDF Importance Sampling for Polygonal Lights", 2021, which needs no inverse cosine): the
    /// triangle is cut by an arc through corner 1 into the part u[0] of its area, then a point taken on the arc.
    fn direction(&self, u: [f32; 2]) -> DVec3 {
        let SinCos { sin, cos } = sin_cos_2pi(self.half_turns * u[0]);
        let (sin, cos) = (f64::from(sin), f64::from(cos));
        // The half vector between corner 0 and the arc's other end, which lies between corners 0 and 2.
        let h = self.w[0] * (self.g0 * cos - self.g1 * sin) + self.w[2] * (self.g2 * sin);
        let end = h * (2.0 * self.w[0].dot(h) / h.length_squared()) - self.w[0];
        // Along the arc uniform in cosine, from corner 1: 1 - cos as a chord, so that short arcs keep their digits.
        let start = self.w[1];
        let chord2 = (end - start).length_squared() * f64::from(u[1]);
        let s = 1.0 - 0.5 * chord2;
        let sin = (chord2 * (1.0 - 0.25 * chord2)).max(0.0).sqrt();
        let across = (end - start * start.dot(end)).normalize_or_zero();
        start * s + across * sin
    }
}

/// Uniform over the solid angle, or, where that is small, over the area. None where the triangle is seen edge on.
pub fn sample(v: &[DVec3; 3], from: DVec3, u: [f32; 2]) -> Option<TriangleSample> {
    let (e1, e2) = (v[1] - v[0], v[2] - v[0]);
    let n = e1.cross(e2);
    let (b, pdf) = match Seen::new(v, n, from) {
        Some(seen) => {
            let ray = LocalRay { o: from, d: seen.direction(u), tnear: 0.0, tfar: f64::INFINITY };
            (locate(&ray, v, n, e1, e2).b, Some(seen.pdf()))
        }
        None => {
            let b = warp::triangle(Vec2::from_array(u)).as_dvec2();
            ([1.0 - b.x - b.y, b.x, b.y], None)
        }
    };
    let p = v[0] + e1 * b[1] + e2 * b[2];
    let (wi, dist) = (p - from).normalize_and_length();
    let pdf = pdf.unwrap_or_else(|| area_pdf(n, p - from)) as f32;
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
pub fn pdf(v: &[DVec3; 3], from: DVec3, p: DVec3) -> f32 {
    let n = (v[1] - v[0]).cross(v[2] - v[0]);
    let pdf = Seen::new(v, n, from).map_or_else(|| area_pdf(n, p - from), |s| s.pdf());
    if pdf.is_finite() { pdf as f32 } else { 0.0 }
}

/// dist^2 / (cos area), with n = 2 area times the unit normal and d = dist times the unit direction.
fn area_pdf(n: DVec3, d: DVec3) -> f64 {
    2.0 * d.length_squared() * d.length() / n.dot(d).abs()
}
