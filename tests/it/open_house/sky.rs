//! A sky that brightens towards +x, in a chart of its own.

use glam::{DVec3, Vec3};
use skylit::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use skylit::base::skybox::{ChartGrid, ChartPoint, Skybox};
use skylit::color::Rgb;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// The registry row.
pub const ROW: Row<dyn Skybox> = Row {
    kind: "sideways",
    doc: "radiance linear in the x of the direction",
    params: &[
        ParamSpec { name: "mean", kind: ParamKind::Color, default: Some("1"), doc: "radiance at x = 0" },
        ParamSpec {
            name: "slope",
            kind: ParamKind::Number { min: 0.0, max: 1.0 },
            default: Some("0.5"),
            doc: "by which share of the mean it grows towards +x",
        },
    ],
    build: |p| {
        let slope = p.number_or("slope", 0.5)?.clamp(0.0, 1.0) as f32;
        Ok(Arc::new(Sideways { mean: p.color_or("mean", [1.0; 3])?, slope }))
    },
    samples: || {
        vec![
            Params::new(),
            Params::new().with("mean", Value::Numbers(vec![2.0, 0.5, 1.0])).with("slope", Value::Number(1.0)),
        ]
    },
};

struct Sideways {
    mean: Rgb,
    slope: f32,
}

impl Skybox for Sideways {
    fn radiance(&self, d: Vec3) -> Rgb {
        self.mean * (1.0 + self.slope * d.x.clamp(-1.0, 1.0))
    }

    fn grid(&self) -> ChartGrid {
        ChartGrid { count: 1, width: 1, height: 64 }
    }

    // The cylinder about the x axis, which keeps areas (Archimedes); v grows towards +x.
    fn direction(&self, c: ChartPoint) -> DVec3 {
        let (sin, cos) = ((c.u - 0.5) * TAU).sin_cos();
        let r = 2.0 * (c.v * (1.0 - c.v)).max(0.0).sqrt();
        DVec3::new(2.0 * c.v - 1.0, r * cos, r * sin)
    }

    fn locate(&self, d: DVec3) -> ChartPoint {
        // (1 - |x|) / 2 without cancellation at the poles.
        let near = 0.5 * (d.y * d.y + d.z * d.z) / (1.0 + d.x.abs());
        let v = if d.x < 0.0 { near } else { 1.0 - near };
        ChartPoint { chart: 0, u: 0.5 + d.z.atan2(d.y) / TAU, v }
    }

    fn solid_angle_density(&self, _c: ChartPoint) -> f64 {
        4.0 * PI
    }

    /// The integral of max(0, n.w) is pi, that of max(0, n.w) w.x is 2 pi / 3 n.x.
    fn irradiance_closed_form(&self, n: DVec3) -> Option<Rgb> {
        Some(self.mean * (PI * (1.0 + 2.0 / 3.0 * f64::from(self.slope) * n.x)) as f32)
    }

    fn memory(&self) -> u64 {
        size_of::<Self>() as u64
    }
}
