//! A round lamp far away, of one radiance: unlike the crate's point and directional lights it has a size, so that
//! scattered rays can find it too.

use glam::{DVec3, Vec3};
use skylit::base::light::{Extent, Light, LightSample, LightSource, PathEnd, Receiver};
use skylit::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use skylit::base::space::RenderSpace;
use skylit::color::Rgb;
use skylit::error::Result;
use skylit::math::frame::Frame;
use std::f32::consts::{PI, TAU};
use std::sync::Arc;

/// The registry row.
pub const ROW: Row<dyn LightSource> = Row {
    kind: "far_lamp",
    doc: "a disc at infinity",
    params: &[
        ParamSpec {
            name: "toward",
            kind: ParamKind::Vector,
            default: Some("[0, 1, 0]"),
            doc: "where it stands, any length but 0",
        },
        ParamSpec {
            name: "half_angle_deg",
            kind: ParamKind::Number { min: 0.01, max: 80.0 },
            default: Some("5"),
            doc: "half of its angle across",
        },
        ParamSpec { name: "radiance", kind: ParamKind::Color, default: Some("1"), doc: "W sr^-1 m^-2" },
    ],
    build: |p| {
        let toward = DVec3::from_array(p.vector_or("toward", [0.0, 1.0, 0.0])?);
        let Some(toward) = (toward / toward.abs().max_element()).try_normalize() else {
            return Err(p.error("toward", "must not be zero"));
        };
        let angle = p.number_or("half_angle_deg", 5.0)?.clamp(0.01, 80.0).to_radians();
        Ok(Arc::new(FarLamp {
            toward: toward.as_vec3(),
            cap: (2.0 * (0.5 * angle).sin().powi(2)) as f32,
            radiance: p.color_or("radiance", [1.0; 3])?,
        }))
    },
    samples: || {
        vec![
            Params::new(),
            Params::new()
                .with("toward", Value::Numbers(vec![1.0, 2.0, -0.5]))
                .with("half_angle_deg", Value::Number(30.0))
                .with("radiance", Value::Numbers(vec![3.0, 2.0, 1.0])),
        ]
    },
};

#[derive(Clone, Copy)]
struct FarLamp {
    toward: Vec3,
    /// 1 - cos of its half angle.
    cap: f32,
    radiance: Rgb,
}

impl FarLamp {
    fn pdf(&self) -> f32 {
        1.0 / (TAU * self.cap)
    }

    fn holds(&self, wi: Vec3) -> bool {
        // |a - b|^2 = 2 (1 - cos) loses no digits where the lamp is small.
        (wi - self.toward).length_squared() <= 2.0 * self.cap
    }
}

impl LightSource for FarLamp {
    fn place(&self, _space: &RenderSpace) -> Result<Arc<dyn Light>> {
        Ok(Arc::new(*self))
    }
}

impl Light for FarLamp {
    fn sample_li(&self, _at: &Receiver, u: [f32; 2]) -> Option<LightSample> {
        let m = u[0] * self.cap;
        let (sin, cos) = (TAU * u[1]).sin_cos();
        let r = (m * (2.0 - m)).sqrt();
        let wi = Frame::from_z(self.toward).to_world(Vec3::new(r * cos, r * sin, 1.0 - m));
        Some(LightSample { wi, dist: f32::INFINITY, li: Some(self.radiance), pdf: self.pdf(), delta: false })
    }

    fn pdf_li(&self, _at: &Receiver, end: &PathEnd) -> f32 {
        if end.vertex.is_none() && self.holds(end.wi) { self.pdf() } else { 0.0 }
    }

    fn le(&self, end: &PathEnd) -> Rgb {
        if end.vertex.is_none() && self.holds(end.wi) { self.radiance } else { Rgb::BLACK }
    }

    fn at_infinity(&self) -> bool {
        true
    }

    fn power(&self, extent: &Extent) -> f32 {
        PI * extent.radius * extent.radius * TAU * self.cap * self.radiance.luminance()
    }

    /// pi L sin^2 cos where all of it stands above the horizon.
    fn irradiance_closed_form(&self, _p: Vec3, n: Vec3) -> Option<Rgb> {
        let (cos, sin2) = (n.dot(self.toward), self.cap * (2.0 - self.cap));
        match cos.abs() > sin2.sqrt() {
            true => Some(self.radiance * (PI * sin2 * cos.max(0.0))),
            false => None,
        }
    }
}
