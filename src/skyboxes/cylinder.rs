//! The chart of skies made of formulas: the sphere mapped to its cylinder, which keeps areas (Archimedes). u runs
//! around as in a sphere map, v from the zenith down.

use crate::base::skybox::ChartPoint;
use crate::math::trig::{atan2_turns_f64, sin_cos_2pi_f64};
use glam::DVec3;
use std::f64::consts::PI;

/// Solid angle per unit of u and v.
pub(super) const DENSITY: f64 = 4.0 * PI;

/// See [`crate::base::skybox::Skybox::direction`].
#[inline(always)]
pub(super) fn direction(c: ChartPoint) -> DVec3 {
    // From -x, where u begins.
    let a = sin_cos_2pi_f64(c.u);
    // sqrt(1 - y^2) without cancellation at the poles.
    let inside = c.v * (1.0 - c.v);
    let r = -2.0 * if inside > 0.0 { inside.sqrt() } else { 0.0 };
    DVec3::new(r * a.cos, 1.0 - 2.0 * c.v, r * a.sin)
}

/// See [`crate::base::skybox::Skybox::direction_and_density`].
#[inline(always)]
pub(super) fn toward(c: ChartPoint) -> (DVec3, f64) {
    (direction(c), DENSITY)
}

/// See [`crate::base::skybox::Skybox::locate`].
pub(super) fn locate(d: DVec3) -> ChartPoint {
    let u = 0.5 + atan2_turns_f64(d.z, d.x);
    let r2 = d.x * d.x + d.z * d.z;
    // (1 - |y|) / 2 = r^2 / 2 (1 + |y|), without cancellation at the poles.
    let near = 0.5 * r2 / (1.0 + d.y.abs());
    ChartPoint { chart: 0, u, v: if d.y > 0.0 { near } else { 1.0 - near } }
}
