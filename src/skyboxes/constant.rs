//! The same radiance from everywhere.

use super::cylinder;
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::skybox::{ChartDirections, ChartGrid, ChartLanes, ChartPoint, Skybox};
use crate::color::Rgb;
use glam::{DVec3, Vec3};
use std::sync::Arc;

struct Constant(Rgb);

impl Skybox for Constant {
    #[inline]
    fn radiance(&self, _d: Vec3) -> Rgb {
        self.0
    }

    fn constant(&self) -> Option<Rgb> {
        Some(self.0)
    }

    fn grid(&self) -> ChartGrid {
        ChartGrid { count: 1, width: 1, height: 1 }
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

    fn irradiance_closed_form(&self, _n: DVec3) -> Option<Rgb> {
        Some(self.0 * std::f32::consts::PI)
    }

    fn memory(&self) -> u64 {
        0
    }
}

/// A constant sky in scene files.
pub const ROW: Row<dyn Skybox> = Row {
    kind: "constant",
    doc: "the same radiance from everywhere",
    params: &[ParamSpec {
        name: "radiance",
        kind: ParamKind::Color,
        default: Some("1.0"),
        doc: "radiance, W sr^-1 m^-2 per channel",
    }],
    build: |p| Ok(Arc::new(Constant(p.color_or("radiance", [1.0; 3])?))),
    samples: || {
        vec![
            Params::new(),
            Params::new().with("radiance", Value::Numbers(vec![0.2, 0.5, 3.0])),
            Params::new().with("radiance", Value::Number(0.0)),
        ]
    },
};
