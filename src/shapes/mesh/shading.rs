//! Interpolated normals.

use crate::base::lanes::choose;
use glam::{DVec3, Vec3};

/// A shading normal on the side of the geometric one, and the lift to the surface it pretends.
pub struct Shading {
    pub ns: DVec3,
    pub lift: DVec3,
}

/// Interpolates the corners' normals `c`. The lift projects `p` onto the tangent planes of the corners and mixes the
/// results by the same weights (Hanika, "Hacking the shadow terminator", Ray Tracing Gems II, ch. 4).
///
/// In f32: a lift that is off by the rounding of `p` still points outward, and normals have no more digits. Without a
/// branch, for loops over many.
#[inline(always)]
pub fn shading(c: [Vec3; 3], b: [f64; 2], v: [Vec3; 3], p: Vec3, ng: DVec3) -> Shading {
    let (b0, b1, b2) = ((1.0 - b[0] - b[1]) as f32, b[0] as f32, b[1] as f32);
    let ns = c[0] * b0 + c[1] * b1 + c[2] * b2;
    // Normals that cancel each other say nothing.
    let cancelled = ns.length_squared() <= 1e-12;
    let ns = ns.as_dvec3();
    let side = 1f64.copysign(ns.dot(ng));
    let side32 = side as f32;
    let lift = above(c[0], v[0], b0, p, side32) + above(c[1], v[1], b1, p, side32);
    let lift = lift + above(c[2], v[2], b2, p, side32);
    // A corner whose normal looks away from the face could push the point through it.
    let outward = lift.dot(ng.as_vec3()) >= 0.0;
    Shading {
        ns: choose(cancelled, ng, ns * side),
        lift: choose(outward & !cancelled, lift.as_dvec3(), DVec3::ZERO),
    }
}

/// The part of p - v below the plane through `v` with normal `c`, upwards, with a weight of `b`.
#[inline(always)]
fn above(c: Vec3, v: Vec3, b: f32, p: Vec3, side: f32) -> Vec3 {
    let h = c.dot(p - v) * side;
    c * if h < 0.0 { -h * b * side } else { 0.0 }
}
