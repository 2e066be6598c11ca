//! Parallel light from far away.

use crate::base::light::{Extent, Light, LightSample, LightSource, PathEnd, Receiver};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::space::RenderSpace;
use crate::color::Rgb;
use crate::error::Result;
use glam::{DVec3, Vec3};
use std::f32::consts::PI;
use std::sync::Arc;

pub(super) const ROW: Row<dyn LightSource> = Row {
    kind: "directional",
    doc: "parallel light from far away; for a sun with a size use a sky that has one",
    params: &[
        ParamSpec {
            name: "direction",
            kind: ParamKind::Vector,
            default: Some("[0, -1, 0]"),
            doc: "where it shines: from the light into the scene, any length but 0",
        },
        ParamSpec {
            name: "irradiance",
            kind: ParamKind::Color,
            default: Some("1"),
            doc: "irradiance of a surface that faces it, W/m^2",
        },
    ],
    build: |p| {
        let direction = DVec3::from_array(p.vector_or("direction", [0.0, -1.0, 0.0])?);
        // Scaled first: the length of a very long or short vector over- or underflows.
        let Some(direction) = (direction / direction.abs().max_element()).try_normalize() else {
            return Err(p.error("direction", "must not be zero"));
        };
        Ok(Arc::new(Directional {
            to_light: -direction.as_vec3(),
            irradiance: p.color_or("irradiance", [1.0; 3])?,
        }))
    },
    samples: || {
        vec![
            Params::new(),
            Params::new()
                .with("direction", Value::Numbers(vec![-1.0, -2.0, 0.5]))
                .with("irradiance", Value::Numbers(vec![3.0, 2.0, 1.0])),
        ]
    },
};

/// The same in world and render space.
#[derive(Clone, Copy)]
struct Directional {
    to_light: Vec3,
    irradiance: Rgb,
}

impl LightSource for Directional {
    fn place(&self, _space: &RenderSpace) -> Result<Arc<dyn Light>> {
        Ok(Arc::new(*self))
    }
}

impl Light for Directional {
    fn sample_li(&self, _at: &Receiver, _u: [f32; 2]) -> Option<LightSample> {
        (!self.irradiance.is_black()).then_some(LightSample {
            wi: self.to_light,
            dist: f32::INFINITY,
            li: Some(self.irradiance),
            pdf: 1.0,
            delta: true,
        })
    }

    fn is_delta(&self) -> bool {
        true
    }

    fn is_black(&self) -> bool {
        self.irradiance.is_black()
    }

    fn pdf_li(&self, _at: &Receiver, _end: &PathEnd) -> f32 {
        0.0
    }

    fn le(&self, _end: &PathEnd) -> Rgb {
        Rgb::BLACK
    }

    fn power(&self, extent: &Extent) -> f32 {
        PI * extent.radius * extent.radius * self.irradiance.luminance()
    }

    fn irradiance_closed_form(&self, _p: Vec3, n: Vec3) -> Option<Rgb> {
        Some(self.irradiance * n.dot(self.to_light).max(0.0))
    }
}
