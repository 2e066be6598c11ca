//! Maps from the unit square to directions and surfaces, each a triple: `sample`, its density, and `invert`.
//!
//! All are continuous and of low distortion where one is known, so that stratified points stay stratified. Directions
//! are in a local frame whose z is the axis. Densities are per solid angle, or per area for flat targets.

use std::f32::consts::{FRAC_1_PI, PI, TAU};

use glam::{Vec2, Vec3};

use crate::math::trig::{SinCos, atan2_turns, sin_cos_2pi};

/// A point of the disc in polar form: what the concentric map gives before any square root is spent.
#[derive(Debug, Clone, Copy)]
struct Concentric {
    /// Signed radius in [-1, 1].
    a: f32,
    /// 1 - |a|, without cancellation.
    one_minus_a: f32,
    /// Unit vector; the point is `a * dir`.
    dir: Vec2,
}

#[inline(always)]
fn concentric(u: Vec2) -> Concentric {
    // Shirley and Chiu, "A Low Distortion Map Between Disk and Square", 1997; in the two-case form with a signed
    // radius of D. Cline (in P. Shirley's blog, 2011): the ratio's sign carries the angle's.
    let p = 2.0 * u - Vec2::ONE;
    let x_major = p.x.abs() > p.y.abs();
    let (a, other, edge) = if x_major { (p.x, p.y, u.x) } else { (p.y, p.x, u.y) };
    let ratio = if a != 0.0 { other / a } else { 0.0 };
    // An eighth of a turn per unit; the angle is counted from x, or from y backwards.
    let SinCos { sin, cos } = sin_cos_2pi(0.125 * ratio);
    let dir = if x_major { Vec2::new(cos, sin) } else { Vec2::new(sin, cos) };
    Concentric { a, one_minus_a: 2.0 * edge.min(1.0 - edge), dir }
}

/// Unit square to unit disc, area-preserving; density 1/pi. Shirley and Chiu 1997.
#[inline(always)]
pub fn disk(u: Vec2) -> Vec2 {
    let c = concentric(u);
    c.a * c.dir
}

/// Density of [`disk`] per area, inside the disc.
pub const DISK_PDF: f32 = FRAC_1_PI;

/// The point of the square that [`disk`] maps to `p`, |p| <= 1.
#[inline]
pub fn disk_invert(p: Vec2) -> Vec2 {
    let x_major = p.x.abs() > p.y.abs();
    let (major, minor) = if x_major { (p.x, p.y) } else { (p.y, p.x) };
    let a = p.length().copysign(major);
    // Angle off the major axis in eighths of a turn, in [-1, 1]: atan(minor / major), odd in both.
    let b = if major == 0.0 { 0.0 } else { a * 8.0 * atan2_turns(minor * major.signum(), major.abs()) };
    let q = if x_major { Vec2::new(a, b) } else { Vec2::new(b, a) };
    (0.5 * q + Vec2::splat(0.5)).clamp(Vec2::ZERO, Vec2::ONE)
}

/// Cosine-weighted direction of the upper hemisphere. z is zero only at the border of the square.
#[inline(always)]
pub fn cosine_hemisphere(u: Vec2) -> Vec3 {
    let c = concentric(u);
    // 1 - a^2 as a product keeps the digits of grazing directions.
    (c.a * c.dir).extend((c.one_minus_a * (1.0 + c.a.abs())).sqrt())
}

/// Density of [`cosine_hemisphere`] for a direction with this cosine: cos / pi, zero below the horizon.
#[inline(always)]
pub fn cosine_hemisphere_pdf(cos_theta: f32) -> f32 {
    cos_theta.max(0.0) * FRAC_1_PI
}

/// The point of the square that [`cosine_hemisphere`] maps to the unit vector `w`, w.z >= 0.
#[inline]
pub fn cosine_hemisphere_invert(w: Vec3) -> Vec2 {
    disk_invert(w.truncate())
}

/// Uniform direction of the upper hemisphere, by the concentric map: z = 1 - r^2. Shirley and Chiu 1997.
#[inline(always)]
pub fn uniform_hemisphere(u: Vec2) -> Vec3 {
    uniform_cone(u, 1.0)
}

/// Density of [`uniform_hemisphere`] above the horizon.
pub const UNIFORM_HEMISPHERE_PDF: f32 = 0.5 * FRAC_1_PI;

/// The point of the square that [`uniform_hemisphere`] maps to the unit vector `w`, w.z >= 0.
#[inline]
pub fn uniform_hemisphere_invert(w: Vec3) -> Vec2 {
    uniform_cone_invert(w, 1.0)
}

/// Uniform direction of the whole sphere: z = 1 - 2 u.x, azimuth 2 pi u.y.
#[inline(always)]
pub fn uniform_sphere(u: Vec2) -> Vec3 {
    let SinCos { sin, cos } = sin_cos_2pi(u.y);
    // sqrt(1 - z^2) without cancellation at the poles.
    let r = 2.0 * (u.x * (1.0 - u.x)).sqrt();
    Vec3::new(r * cos, r * sin, 1.0 - 2.0 * u.x)
}

/// Density of [`uniform_sphere`].
pub const UNIFORM_SPHERE_PDF: f32 = 0.25 * FRAC_1_PI;

/// The point of the square that [`uniform_sphere`] maps to the unit vector `w`.
#[inline]
pub fn uniform_sphere_invert(w: Vec3) -> Vec2 {
    let turns = atan2_turns(w.y, w.x);
    let v = if turns < 0.0 { turns + 1.0 } else { turns };
    Vec2::new(one_minus_cos(w) * 0.5, v)
}

/// 1 - cos of the angle between the unit vector `w` and z, without cancellation near z: sin^2 / (1 + cos).
#[inline(always)]
pub fn one_minus_cos(w: Vec3) -> f32 {
    if w.z > 0.0 { w.truncate().length_squared() / (1.0 + w.z) } else { 1.0 - w.z }
}

/// 1 - cos of an angle in [0, pi/2] given its squared sine, without cancellation for small ones. A sphere of radius r
/// seen from distance d fills the cone with sin^2 = r^2 / d^2.
#[inline(always)]
pub fn one_minus_cos_from_sin2(sin2: f32) -> f32 {
    sin2 / (1.0 + (1.0 - sin2).max(0.0).sqrt())
}

/// Uniform direction inside the cone about z whose border is at 1 - cos = `m`, in (0, 2]. Given so rather than as a
/// cosine, angles down to 1e-18 keep their digits: 1 - cos of the result is m r^2 for r on the concentric disc.
#[inline(always)]
pub fn uniform_cone(u: Vec2, m: f32) -> Vec3 {
    let c = concentric(u);
    let h = m * c.a * c.a;
    // sin^2 = h (2 - h) with h = m a^2.
    (c.a * (m * (2.0 - h)).max(0.0).sqrt() * c.dir).extend(1.0 - h)
}

/// Density of [`uniform_cone`] inside the cone: 1 / (2 pi m).
#[inline(always)]
pub fn uniform_cone_pdf(m: f32) -> f32 {
    1.0 / (TAU * m)
}

/// The point of the square that [`uniform_cone`] with the same `m` maps to the unit vector `w` inside the cone.
#[inline]
pub fn uniform_cone_invert(w: Vec3, m: f32) -> Vec2 {
    let h = one_minus_cos(w).min(m);
    disk_invert(w.truncate() / (m * (2.0 - h)).sqrt())
}

/// Barycentric weights of the second and third vertex (that of the first is 1 - b1 - b2), uniform over the triangle's
/// area. Heitz, "A Low-Distortion Map Between Triangle and Square", 2019.
#[inline(always)]
pub fn triangle(u: Vec2) -> Vec2 {
    if u.y > u.x {
        let half = 0.5 * u.x;
        Vec2::new(half, u.y - half)
    } else {
        let half = 0.5 * u.y;
        Vec2::new(u.x - half, half)
    }
}

/// The point of the square that [`triangle`] maps to the barycentric weights (b1, b2).
#[inline]
pub fn triangle_invert(b: Vec2) -> Vec2 {
    if b.y > b.x { Vec2::new(2.0 * b.x, b.x + b.y) } else { Vec2::new(b.x + b.y, 2.0 * b.y) }
}

/// A point of [-1, 1] with density 1 - |x|.
#[inline(always)]
pub fn tent(u: f32) -> f32 {
    if u < 0.5 { (2.0 * u).sqrt() - 1.0 } else { 1.0 - (2.0 * (1.0 - u)).sqrt() }
}

/// Density of [`tent`].
#[inline(always)]
pub fn tent_pdf(x: f32) -> f32 {
    (1.0 - x.abs()).max(0.0)
}

/// The number that [`tent`] maps to `x`.
#[inline]
pub fn tent_invert(x: f32) -> f32 {
    let tail = 0.5 * tent_pdf(x) * tent_pdf(x);
    if x < 0.0 { tail } else { 1.0 - tail }
}

/// Solid angle of the cone whose border is at 1 - cos = `m`.
#[inline(always)]
pub fn cone_solid_angle(m: f32) -> f32 {
    2.0 * PI * m
}

#[cfg(test)]
mod tests;
