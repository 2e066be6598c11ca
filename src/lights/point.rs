//! A point that shines alike in all directions.

use crate::base::light::{Extent, Light, LightSample, LightSource, PathEnd, Receiver};
use crate::base::ray::MAX_COORDINATE;
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::space::RenderSpace;
use crate::color::Rgb;
use crate::error::{Error, Result};
use glam::{DVec3, Vec3};
use std::f32::consts::PI;
use std::sync::Arc;

pub(super) const ROW: Row<dyn LightSource> = Row {
    kind: "point",
    doc: "a point that shines alike in all directions",
    params: &[
        ParamSpec { name: "position", kind: ParamKind::Vector, default: Some("[0, 0, 0]"), doc: "metres" },
        ParamSpec {
            name: "intensity",
            kind: ParamKind::Color,
            default: Some("1"),
            doc: "radiant intensity, W/sr: irradiance at one metre",
        },
    ],
    build: |p| {
        Ok(Arc::new(PointSource {
            position: DVec3::from_array(p.vector_or("position", [0.0; 3])?),
            intensity: p.color_or("intensity", [1.0; 3])?,
        }))
    },
    samples: || {
        vec![
            Params::new(),
            Params::new()
                .with("position", Value::Numbers(vec![3.0, 3.0, -1.0]))
                .with("intensity", Value::Numbers(vec![10.0, 0.0, 2.5])),
        ]
    },
};

struct PointSource {
    position: DVec3,
    intensity: Rgb,
}

impl LightSource for PointSource {
    fn place(&self, space: &RenderSpace) -> Result<Arc<dyn Light>> {
        let position = space.point(self.position).as_vec3();
        let intensity = self.intensity.map(|i| space.intensity(f64::from(i)) as f32);
        if !position.abs().cmple(Vec3::splat(MAX_COORDINATE)).all() || !intensity.is_finite() {
            return Err(Error::Usage(format!(
                "the point light at {} lies too far from the scene, or is too bright, to be represented",
                self.position
            )));
        }
        Ok(Arc::new(PointLight { position, intensity }))
    }
}

/// In render space.
struct PointLight {
    position: Vec3,
    intensity: Rgb,
}

impl Light for PointLight {
    fn sample_li(&self, at: &Receiver, _u: [f32; 2]) -> Option<LightSample> {
        let (wi, dist) = (self.position.as_dvec3() - at.p.as_dvec3()).normalize_and_length();
        let li = self.intensity * (1.0 / (dist * dist)) as f32;
        // At the light itself there is no direction to it.
        (dist > 0.0 && li.is_finite() && !li.is_black()).then(|| LightSample {
            wi: wi.as_vec3(),
            dist: dist as f32,
            li: Some(li),
            pdf: 1.0,
            delta: true,
        })
    }

    fn pdf_li(&self, _at: &Receiver, _end: &PathEnd) -> f32 {
        0.0
    }

    fn le(&self, _end: &PathEnd) -> Rgb {
        Rgb::BLACK
    }

    fn power(&self, _extent: &Extent) -> f32 {
        4.0 * PI * self.intensity.luminance()
    }

    fn irradiance_closed_form(&self, p: Vec3, n: Vec3) -> Option<Rgb> {
        let to = self.position - p;
        let d2 = to.length_squared();
        Some(self.intensity * (n.dot(to).max(0.0) / (d2 * d2.sqrt())))
    }
}
