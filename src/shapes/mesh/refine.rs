//! Rays against one triangle, in double precision.

use crate::base::shape::LocalRay;
use crate::math::bounds::{U32, UNDERFLOW, gamma};
use crate::math::triangle::TriangleRay;
use glam::{DVec3, Vec3, Vec3Swizzles};

/// A point of a triangle.
#[derive(Debug, Clone, Copy)]
pub struct TrianglePoint {
    /// Weight of the second corner, at least 0.
    pub b1: f64,
    /// Weight of the third corner, at least 0; the first has 1 - b1 - b2, which is not negative but for rounding.
    pub b2: f64,
    /// Distance in lengths of the ray's direction.
    pub t: f64,
}

/// The t at which the ray meets the triangle, by the test that decides for all kernels: see [`TriangleRay`].
pub fn intersect(ray: &LocalRay, v: [DVec3; 3]) -> Option<f64> {
    let t = TriangleRay::new(ray.o, ray.d).distance(v)?;
    (t >= ray.tnear && t <= ray.tfar).then_some(t)
}

/// A triangle in double precision.
#[derive(Debug, Clone, Copy)]
pub struct Triangle {
    /// A corner.
    pub v0: DVec3,
    /// From there to the second corner.
    pub e1: DVec3,
    /// From there to the third corner.
    pub e2: DVec3,
    /// e1 x e2: the normal, of twice the area's length.
    pub n: DVec3,
}

impl Triangle {
    /// From single precision, without error but for differences of very unequal numbers.
    #[inline(always)]
    pub fn new([v0, b, c]: [Vec3; 3]) -> Self {
        let v0 = v0.as_dvec3();
        let (e1, e2) = (b.as_dvec3() - v0, c.as_dvec3() - v0);
        Triangle { v0, e1, e2, n: e1.cross(e2) }
    }

    /// The point with these weights of the second and third corner.
    #[inline(always)]
    pub fn at(&self, b1: f64, b2: f64) -> DVec3 {
        self.v0 + self.e1 * b1 + self.e2 * b2
    }

    /// The corners.
    pub fn corners(&self) -> [DVec3; 3] {
        [self.v0, self.v0 + self.e1, self.v0 + self.e2]
    }

    /// The point of the triangle that the ray crosses; where a kernel's rounding has it that a ray hits which just
    /// passes by, the point nearest to the ray.
    #[inline(always)]
    pub fn locate(&self, ray: &LocalRay) -> TrianglePoint {
        let (point, inside) = self.cross(ray.o, ray.d);
        if inside { point } else { nearest_on_edges(*ray, *self) }
    }

    /// The point of the triangle's plane that a ray crosses, and whether it lies within the triangle; false for all that
    /// is odd, NaN among it. Without a branch, for loops over many.
    #[inline(always)]
    pub fn cross(&self, o: DVec3, d: DVec3) -> (TrianglePoint, bool) {
        // Cramer's rule as by Moeller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", JGT 2(1), 1997.
        let s = o - self.v0;
        let q = s.cross(d);
        let inv = -1.0 / d.dot(self.n);
        let (b1, b2, t) = (self.e2.dot(q) * inv, -self.e1.dot(q) * inv, s.dot(self.n) * inv);
        let b0 = 1.0 - b1 - b2;
        let inside = (b0 >= 0.0) & (b1 >= 0.0) & (b2 >= 0.0) & (inv.abs() < f64::INFINITY);
        (TrianglePoint { b1, b2, t }, inside)
    }
}

/// The point of the three edges that lies nearest to the line of the ray.
#[cold]
#[inline(never)]
fn nearest_on_edges(ray: LocalRay, triangle: Triangle) -> TrianglePoint {
    let v = triangle.corners();
    let length = ray.d.length();
    let d = ray.d / length;
    let across = |w: DVec3| w - d * d.dot(w);
    let mut best = (f64::INFINITY, TrianglePoint { b1: 0.0, b2: 0.0, t: 0.0 });
    for i in 0..3 {
        let j = (i + 1) % 3;
        let (w, e) = (across(v[i] - ray.o), across(v[j] - v[i]));
        let s = (-w.dot(e) / e.length_squared()).clamp(0.0, 1.0);
        // An edge along the ray: its first end.
        let s = if s.is_nan() { 0.0 } else { s };
        let distance = (w + e * s).length_squared();
        if distance < best.0 {
            let mut b = [0.0; 3];
            (b[i], b[j]) = (1.0 - s, s);
            let p = v[i] + (v[j] - v[i]) * s;
            best = (distance, TrianglePoint { b1: b[1], b2: b[2], t: d.dot(p - ray.o) / length });
        }
    }
    best.1
}

/// How far the point `p` of a triangle may lie from the triangle as an f32 kernel sees it when it tests a ray that
/// starts next to `p`, per axis; `n` is the cross product of its edges.
///
/// Robust kernels (Davidovic et al., "3D Rasterization: A Bridge between Rasterization and Ray Casting", 2012; also
/// Embree's robust mode) first subtract the origin, so they see each corner off by u |v_i - p|, and `p`, a mean of
/// corners, by no more than the largest of these. Then they compute the height over the plane, T = v . N with N a
/// product of two edges: each component of N is off by gamma(4) of m, the sum of the sizes of its two terms (edges
/// rounded once each, a product, a difference), and the scalar product adds gamma(3). |N_k| <= m_k, so the height
/// is off by gamma(7) sum |v_k| m_k / |N|. They choose for each component the pair of edges with the smaller first
/// term; its terms are at most 2 min(m) + |N| <= 3 min(m): 21 roundings.
///
/// In a plane of one coordinate that is zero (a floor at y = 0) all of this vanishes, yet the products of a height of
/// almost nothing do not survive: nine of them underflow, which leaves a height of 9 UNDERFLOW / |N| unseen. (By 0.5 m
/// squares a ray would meet the floor it leaves, if its origin were but the next number above zero.)
///
/// Worked out in f32, but for what could underflow: the bound is generous, and where the rounding of `p` matters
/// beside the triangle's size, the rounding of a vertex' position is added anyway.
#[inline(always)]
pub fn test_error(v: [Vec3; 3], p: Vec3, n: DVec3) -> DVec3 {
    let r0 = (v[0] - p).abs();
    let r = r0.max((v[1] - p).abs()).max((v[2] - p).abs());
    let (e1, e2) = (v[1] - v[0], v[2] - v[0]);
    let m = terms(e1, e2).min(terms(e1, v[2] - v[1]));
    let height = (f64::from(gamma(21)) * r0.as_dvec3().dot(m.as_dvec3()) + 9.0 * UNDERFLOW) / n.length();
    // A plane through a corner cannot be further away than the corner.
    let height = (height as f32).min(r.max_element());
    (r * (2.0 * U32) + Vec3::splat(height)).as_dvec3()
}

/// The sizes of the terms of a x b, added up.
#[inline(always)]
fn terms(a: Vec3, b: Vec3) -> Vec3 {
    (a.yzx() * b.zxy()).abs() + (a.zxy() * b.yzx()).abs()
}
