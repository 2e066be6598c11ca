//! Three colours, blended by height.

use super::cylinder;
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::skybox::{ChartDirections, ChartGrid, ChartLanes, ChartPoint, Skybox};
use crate::color::Rgb;
use glam::{DVec3, Vec3};
use std::f64::consts::PI;
use std::sync::Arc;

/// Radiance is linear in the height y of the unit direction: from `horizon` at 0 to `zenith` at 1 and to `ground`
/// at -1. Continuous everywhere, smooth but at the horizon, and with a closed form of the irradiance.
struct Gradient {
    zenith: Rgb,
    horizon: Rgb,
    ground: Rgb,
}

impl Skybox for Gradient {
    #[inline]
    fn radiance(&self, d: Vec3) -> Rgb {
        let end = if d.y > 0.0 { self.zenith } else { self.ground };
        self.horizon.lerp(end, d.y.abs().min(1.0))
    }

    fn constant(&self) -> Option<Rgb> {
        (self.zenith == self.horizon && self.ground == self.horizon).then_some(self.horizon)
    }

    fn is_smooth(&self) -> bool {
        true
    }

    fn grid(&self) -> ChartGrid {
        // Nothing depends on u.
        ChartGrid { count: 1, width: 1, height: 64 }
    }

    fn direction(&self, c: ChartPoint) -> DVec3 {
        cylinder::direction(c)
    }

    fn locate(&self, d: DVec3) -> ChartPoint {
        cylinder::locate(d)
    }

    fn solid_angle_density(&self, _c: ChartPoint) -> f64 {
        cylinder::DENSITY
    }

    fn directions_and_densities(&self, at: &ChartLanes, _n: usize) -> ChartDirections {
        at.directions(cylinder::toward)
    }

    fn irradiance_closed_form(&self, n: DVec3) -> Option<Rgb> {
        // The integral of max(0, n.w) max(0, y.w) over the sphere, c = n.y the cosine of the angle g between the two.
        // In polar coordinates about the axis normal to both it is 4/3 (the integral of sin^3) times that of
        // cos(a) cos(a - g) over a from g - pi/2 to pi/2.
        let lobes = |c: f64| {
            let g = c.clamp(-1.0, 1.0).acos();
            (2.0 / 3.0 * ((PI - g) * g.cos() + g.sin())) as f32
        };
        let (above, below) = (lobes(n.y), lobes(-n.y));
        let horizon = self.horizon * (PI as f32 - above - below);
        Some(horizon + self.zenith * above + self.ground * below)
    }

    fn memory(&self) -> u64 {
        0
    }
}

const fn color(name: &'static str, default: &'static str, doc: &'static str) -> ParamSpec {
    ParamSpec { name, kind: ParamKind::Color, default: Some(default), doc }
}

/// A gradient sky in scene files.
pub const ROW: Row<dyn Skybox> = Row {
    kind: "gradient",
    doc: "three colours, blended in proportion to the sine of the elevation",
    params: &[
        color("zenith", "[0.25, 0.45, 0.9]", "radiance straight up"),
        color("horizon", "[0.85, 0.9, 1.0]", "radiance at the horizon"),
        color("ground", "[0.2, 0.18, 0.16]", "radiance straight down"),
    ],
    build: |p| {
        Ok(Arc::new(Gradient {
            zenith: p.color_or("zenith", [0.25, 0.45, 0.9])?,
            horizon: p.color_or("horizon", [0.85, 0.9, 1.0])?,
            ground: p.color_or("ground", [0.2, 0.18, 0.16])?,
        }))
    },
    samples: || {
        let color = |v: f64| Value::Numbers(vec![v, 0.5 * v, 2.0 * v]);
        vec![
            Params::new(),
            Params::new().with("zenith", color(3.0)).with("horizon", color(0.0)).with("ground", color(0.0)),
            Params::new().with("zenith", color(0.0)).with("horizon", color(1.0)),
        ]
    },
};
