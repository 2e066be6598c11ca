//! Points on a quadric as seen from elsewhere.
//!
//! A sphere seen from outside is sampled uniformly in the cone of directions it fills (Shirley, Wang, Zimmerman,
//! "Monte Carlo Techniques for Direct Lighting Calculations", 1996). Otherwise a point w is taken uniformly from the
//! unit sphere, or from outside from the cap of it that can be seen, which is where w . o >= 1 with o the viewer in
//! the unit sphere's space. Its image under M has the density 1 / (C |N|) by area, with C the area of the cap and
//! N = det(M) M^-T w, whose length is the ratio of areas.

use super::{Ball, Quadric, uv};
use crate::base::shape::ShapeSample;
use crate::math::frame::Frame;
use crate::sampling::warp;
use glam::{DVec3, Vec2};
use std::f64::consts::TAU;

/// See the module.
pub fn sample(q: &Quadric, from: DVec3, u: [f32; 2]) -> Option<ShapeSample> {
    let u = Vec2::from_array(u);
    let cone = q.ball.and_then(|b| Cone::of(&b, from));
    let (w, pdf) = match &cone {
        Some(cone) => (q.to_unit(cone.point(from, u)).normalize(), cone.pdf()),
        None => {
            let o = q.to_unit(from);
            let m = cap(o);
            let axis = o.try_normalize().unwrap_or(DVec3::Z);
            let w = around(axis, m, u);
            let (wi, dist) = (q.to_group.transform_point3(w) - from).normalize_and_length();
            (w, area_pdf(q, m, dist * dist, wi, q.normal(w).normalize()))
        }
    };
    let p = q.to_group.transform_point3(w);
    let (wi, dist) = (p - from).normalize_and_length();
    let pdf = pdf as f32;
    (pdf > 0.0 && pdf.is_finite() && dist > 0.0).then(|| ShapeSample {
        p: p.as_vec3(),
        ng: q.normal(w).normalize().as_vec3(),
        uv: uv(w),
        wi: wi.as_vec3(),
        dist: dist as f32,
        pdf,
    })
}

/// The density per solid angle with which [`sample`] takes the direction `wi` from `from` to `p` on the quadric,
/// where the unit normal is `ng`.
pub fn pdf(q: &Quadric, from: DVec3, wi: DVec3, p: DVec3, ng: DVec3) -> f32 {
    let pdf = match q.ball.and_then(|b| Cone::of(&b, from)) {
        Some(cone) => cone.pdf(),
        None => area_pdf(q, cap(q.to_unit(from)), (p - from).length_squared(), wi, ng),
    };
    if pdf.is_finite() { pdf as f32 } else { 0.0 }
}

/// The cone that a sphere fills.
struct Cone {
    ball: Ball,
    /// Unit vector to the sphere's centre, and how far that is.
    axis: DVec3,
    distance: f64,
    /// 1 - cos of the cone's half angle.
    m: f64,
}

impl Cone {
    /// None from inside.
    fn of(ball: &Ball, from: DVec3) -> Option<Cone> {
        let (axis, distance) = (ball.center - from).normalize_and_length();
        let sin = ball.radius / distance;
        // Written so that no digit is lost for small angles.
        (distance > ball.radius).then(|| Cone {
            ball: *ball,
            axis,
            distance,
            m: sin * sin / (1.0 + (1.0 - sin * sin).sqrt()),
        })
    }

    fn pdf(&self) -> f64 {
        1.0 / (TAU * self.m)
    }

    /// The near crossing of a direction uniform in the cone.
    fn point(&self, from: DVec3, u: Vec2) -> DVec3 {
        let wi = around(self.axis, self.m, u);
        // The distance from the centre to the line of sight, squared: |c x wi|^2.
        let across = (self.axis * self.distance).cross(wi).length_squared();
        let half_chord = (self.ball.radius * self.ball.radius - across).max(0.0).sqrt();
        from + wi * (self.distance * self.axis.dot(wi) - half_chord)
    }
}

/// A direction uniform in the cone about `axis` with 1 - cos up to `m`, in (0, 2].
fn around(axis: DVec3, m: f64, u: Vec2) -> DVec3 {
    let d = warp::disk(u).as_dvec2();
    let h = m * d.length_squared().min(1.0);
    // sin^2 = h (2 - h), shared out along the point of the disc.
    let s = d * (m * (2.0 - h)).sqrt();
    let f = Frame::from_z(axis.as_vec3());
    // The f32 frame's rounding is taken out again by one step against the axis in double precision.
    let x = f.s.as_dvec3();
    let x = (x - axis * axis.dot(x)).normalize();
    x * s.x + axis.cross(x) * s.y + axis * (1.0 - h)
}

/// 1 - cos of the cap of the unit sphere that can be seen from `o`; the whole sphere from inside.
fn cap(o: DVec3) -> f64 {
    let r = o.length();
    if r > 1.0 { (r - 1.0) / r } else { 2.0 }
}

/// The density per solid angle of a point with this squared distance, direction and unit normal, uniform in the cap
/// `m` before the map: dist^2 / (cos |N| C). |N| = |det M| / |M^T n|, so that the point itself, which on a flat
/// quadric says little about w once it is rounded, does not enter.
fn area_pdf(q: &Quadric, m: f64, dist2: f64, wi: DVec3, ng: DVec3) -> f64 {
    let linear = &q.to_group.matrix3;
    let ratio = linear.determinant().abs() / (linear.transpose() * ng).length();
    dist2 / (wi.dot(ng).abs() * ratio * TAU * m)
}
