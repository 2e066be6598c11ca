//! Points on a triangle as seen from elsewhere.

use super::refine::Triangle;
use crate::base::shape::{LocalRay, ShapeSample};
use crate::math::trig::{SinCos, atan2_turns, sin_cos_2pi};
use crate::sampling::warp;
use glam::{DVec3, Vec2};
use std::f64::consts::TAU;

/// A sampled point and where it lies in the triangle.
pub struct TriangleSample {
    /// The sample, without texture coordinates.
    pub sample: ShapeSample,
    /// Weights of the second and third corner.
    pub b: [f64; 2],
}

/// Below this solid angle (steradians) the triangle is as good as flat to its viewer, and is sampled by area; in
/// double precision the formulas of the spherical triangle keep at least six digits above it.
const SMALLEST: f64 = 1e-5;

/// A triangle as seen from a point.
struct Seen {
    /// To its corners.
    d: [DVec3; 3],
    /// How far they are.
    l: [f64; 3],
    /// tan(solid angle / 2) = g0 / (g1 + g2), all three times the product of `l`.
    g0: f64,
    g1: f64,
    g2: f64,
    /// In turns: the solid angle is 2 pi times twice this.
    half_turns: f32,
}

impl Seen {
    /// None where the solid angle is too small, or a corner is the viewer.
    #[inline]
    fn new(triangle: &Triangle, from: DVec3) -> Option<Seen> {
        let first = triangle.v0 - from;
        let d = [first, first + triangle.e1, first + triangle.e2];
        let l = [d[0].length(), d[1].length(), d[2].length()];
        // Van Oosterom and Strackee, "The Solid Angle of a Plane Triangle", 1983. The triple product of the corners
        // comes by way of the normal, so that small triangles keep their digits.
        let g0 = triangle.n.dot(first).abs();
        let g1 = d[0].dot(d[2]) * l[1] + d[1].dot(d[2]) * l[0];
        let g2 = l[0] * l[1] * l[2] + d[0].dot(d[1]) * l[2];
        // Most triangles of a mesh are small: for those tan x = x is near enough to decide. NaN is small, too.
        let cos = g1 + g2;
        let wide = g0 > 0.25 * SMALLEST * cos.max(0.0);
        if !wide {
            return None;
        }
        // Any common factor does; this one keeps the arguments inside f32.
        let scale = 1.0 / (g0 + cos.abs());
        let half_turns = atan2_turns((g0 * scale) as f32, (cos * scale) as f32);
        (f64::from(half_turns) * (2.0 * TAU) > SMALLEST).then_some(Seen { d, l, g0, g1, g2, half_turns })
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
        let w = |k: usize| self.d[k] * (1.0 / self.l[k]);
        let (first, start) = (w(0), w(1));
        // The half vector between corner 0 and the arc's other end, which lies between corners 0 and 2.
        let h = first * (self.g0 * cos - self.g1 * sin) + w(2) * (self.g2 * sin);
        let end = h * (2.0 * first.dot(h) / h.length_squared()) - first;
        // Along the arc uniform in cosine, from corner 1: 1 - cos as a chord, so that short arcs keep their digits.
        let chord2 = (end - start).length_squared() * f64::from(u[1]);
        let s = 1.0 - 0.5 * chord2;
        let across = end - start * start.dot(end);
        // An arc without length is its start.
        let length2 = across.length_squared().max(f64::MIN_POSITIVE);
        start * s + across * (chord2 * (1.0 - 0.25 * chord2) / length2).max(0.0).sqrt()
    }
}

/// Uniform over the solid angle, or, where that is small, over the area. None where the triangle is seen edge on.
pub fn sample(triangle: &Triangle, from: DVec3, u: [f32; 2]) -> Option<TriangleSample> {
    let n = triangle.n;
    let (b, pdf) = match Seen::new(triangle, from) {
        Some(seen) => {
            let ray = LocalRay { o: from, d: seen.direction(u), tnear: 0.0, tfar: f64::INFINITY };
            let at = triangle.locate(&ray);
            ([at.b1, at.b2], Some(seen.pdf()))
        }
        None => (warp::triangle(Vec2::from_array(u)).as_dvec2().to_array(), None),
    };
    let p = triangle.at(b[0], b[1]);
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
pub fn pdf(triangle: &Triangle, from: DVec3, p: DVec3) -> f32 {
    let pdf = Seen::new(triangle, from).map_or_else(|| area_pdf(triangle.n, p - from), |s| s.pdf());
    if pdf.is_finite() { pdf as f32 } else { 0.0 }
}

/// dist^2 / (cos area), with n = 2 area times the unit normal and d = dist times the unit direction.
fn area_pdf(n: DVec3, d: DVec3) -> f64 {
    2.0 * d.length_squared() * d.length() / n.dot(d).abs()
}
