//! The chart of skies made of formulas: the sphere mapped to its cylinder, which keeps areas (Archimedes). u runs
//! around as in a sphere map, v from the zenith down.

use crate::base::skybox::ChartPoint;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Solid angle per unit of u and v.
pub(super) const DENSITY: f64 = 4.0 * PI;

/// See [`crate::base::skybox::Skybox::direction`].
pub(super) fn direction(c: ChartPoint) -> DVec3 {
    let (sin, cos) = ((c.u - 0.5) * TAU).sin_cos();
    // sqrt(1 - y^2) without cancellation at the poles.
    let r = 2.0 * (c.v * (1.0 - c.v)).max(0.0).sqrt();
    DVec3::new(r * cos, 1.0 - 2.0 * c.v, r * sin)
}

/// See [`crate::base::skybox::Skybox::locate`].
pub(super) fn locate(d: DVec3) -> ChartPoint {
    let u = 0.5 + d.z.atan2(d.x) / TAU;
    let r2 = d.x * d.x + d.z * d.z;
    // (1 - |y|) / 2 = r^2 / 2 (1 + |y|), without cancellation at the poles.
    let near = 0.5 * r2 / (1.0 + d.y.abs());
    ChartPoint { chart: 0, u, v: if d.y > 0.0 { near } else { 1.0 - near } }
}
