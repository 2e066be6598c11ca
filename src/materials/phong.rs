//! The modified Phong model: a diffuse base and a normalised lobe about the mirror direction (Lafortune and Willems,
//! "Using the Modified Phong Reflectance Model for Physically Based Rendering", 1994, eq. 5 and 6). No more light leaves
//! than arrives where the two colours sum to 1 at most, which published scenes do not keep to.

use crate::base::material::Material;
use crate::base::registry::{Params, Row, Value};
use crate::error::Result;
use crate::materials::glossy::{
    AMBIENT, DIFFUSE, EMISSION, Glossy, Lobe, LobeValue, SAMPLING, SHININESS, SPECULAR, Style,
};
use crate::math::Frame;
use crate::math::trig::{SinCos, sin_cos_2pi};
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, TAU};
use std::sync::Arc;

pub(super) const ROW: Row<dyn Material> = Row {
    kind: "phong",
    doc: "a diffuse base and a normalised Phong lobe about the mirror direction, from both sides",
    params: &[DIFFUSE, SPECULAR, SHININESS, AMBIENT, EMISSION, SAMPLING],
    build: |p| Ok(Arc::new(from_params(p)?)),
    samples: || {
        let with = |shininess: f64, sampling: &str| {
            Params::new()
                .with("shininess", Value::Number(shininess))
                .with("sampling", Value::Text(sampling.into()))
        };
        vec![
            Params::new(),
            with(1000.0, "brdf").with("diffuse", Value::Number(0.2)),
            with(30.0, "brdf").with("diffuse", Value::Number(0.0)),
            with(2.0, "cosine"),
            with(2.0, "hemisphere").with("specular", Value::Numbers(vec![0.3, 0.1, 0.0])),
            with(4.0, "brdf"),
        ]
    },
};

fn from_params(p: &Params) -> Result<Glossy<Phong>> {
    let style = Style { diffuse_scale: FRAC_1_PI, two_sided: true, mirrors: false, physical: false };
    Glossy::from_params(p, Phong { shininess: p.number_or("shininess", 20.0)? as f32 }, style)
}

/// (s + 2) / 2 pi max(r.wi, 0)^s, r being the mirror direction of wo.
struct Phong {
    shininess: f32,
}

/// Cosine between `wi` and the mirror direction of `wo`, at least 0.
#[inline]
fn off_mirror(wo: Vec3, wi: Vec3) -> f32 {
    Vec3::new(-wo.x, -wo.y, wo.z).dot(wi).clamp(0.0, 1.0)
}

impl Lobe for Phong {
    fn alpha(&self) -> f32 {
        // As Blinn's with four times the exponent: half vectors turn half as far.
        (2.0 / (4.0 * self.shininess + 2.0)).sqrt()
    }

    #[inline]
    fn f_cos(&self, wo: Vec3, wi: Vec3) -> LobeValue {
        let lobe = (self.shininess + 2.0) / TAU * off_mirror(wo, wi).powf(self.shininess);
        // Far from the mirror nothing is left but the rounding of subnormal numbers.
        LobeValue { colored: if lobe > 1e-30 { lobe * wi.z } else { 0.0 }, white: 0.0 }
    }

    #[inline]
    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let cos = off_mirror(wo, wi);
        // What lies behind the mirror direction is never drawn, not even with an exponent of 0.
        if cos > 0.0 { (self.shininess + 1.0) / TAU * cos.powf(self.shininess) } else { 0.0 }
    }

    #[inline]
    fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<Vec3> {
        let cos = (1.0 - u[0]).powf(1.0 / (self.shininess + 1.0));
        let r = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
        let SinCos { sin, cos: c } = sin_cos_2pi(u[1]);
        let mirror = Vec3::new(-wo.x, -wo.y, wo.z);
        Some(Frame::from_z(mirror).to_world(Vec3::new(r * c, r * sin, cos)))
    }
}
