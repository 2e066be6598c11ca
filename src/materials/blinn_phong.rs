//! Blinn's highlight over a diffuse base, as classic ray tracers have it (Blinn, "Models of Light Reflection for
//! Computer Synthesized Pictures", 1977): neither reciprocal nor bounded by the light that arrives.

use crate::base::material::Material;
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::error::Result;
use crate::materials::glossy::{
    AMBIENT, DIFFUSE, EMISSION, Glossy, Lobe, LobeValue, SAMPLING, SHININESS, SPECULAR, Style,
};
use crate::materials::microfacet::reflect;
use crate::math::trig::{SinCos, sin_cos_2pi};
use glam::Vec3;
use std::f32::consts::{FRAC_1_PI, TAU};
use std::sync::Arc;

pub(super) const ROW: Row<dyn Material> = Row {
    kind: "blinn-phong",
    doc: "a diffuse base under Blinn's highlight; the integrator whitted adds the mirror's picture in its colour",
    params: &[
        DIFFUSE,
        SPECULAR,
        SHININESS,
        AMBIENT,
        EMISSION,
        ParamSpec {
            name: "units",
            kind: ParamKind::Choice(&["radiometric", "classic"]),
            default: Some("radiometric"),
            doc: "radiometric: (diffuse n.l + specular (n.h)^shininess) / pi; classic: the same without 1 / pi",
        },
        ParamSpec {
            name: "two_sided",
            kind: ParamKind::Bool,
            default: Some("true"),
            doc: "whether the back looks as the front does; if not, it shows how the front is lit",
        },
        SAMPLING,
    ],
    build: |p| Ok(Arc::new(from_params(p)?)),
    samples: || {
        let classic = |shininess: f64, two_sided| {
            Params::new()
                .with("shininess", Value::Number(shininess))
                .with("two_sided", Value::Bool(two_sided))
                .with("units", Value::Text("classic".into()))
        };
        vec![
            Params::new(),
            classic(20.0, false),
            classic(100.0, true).with("diffuse", Value::Number(0.0)),
            classic(0.0, true).with("sampling", Value::Text("hemisphere".into())),
            classic(3.0, false).with("specular", Value::Numbers(vec![1.0, 0.2, 0.0])),
            Params::new().with("emission", Value::Number(2.0)).with("ambient", Value::Number(0.1)),
        ]
    },
};

fn from_params(p: &Params) -> Result<Glossy<Blinn>> {
    let scale = if p.text_or("units", "radiometric")? == "classic" { 1.0 } else { FRAC_1_PI };
    let style = Style {
        diffuse_scale: scale,
        two_sided: p.bool_or("two_sided", true)?,
        mirrors: true,
        physical: false,
    };
    let lobe = Blinn { shininess: p.number_or("shininess", 20.0)? as f32, scale };
    Glossy::from_params(p, lobe, style)
}

/// scale (n.h)^s, without a cosine.
struct Blinn {
    shininess: f32,
    scale: f32,
}

impl Lobe for Blinn {
    fn alpha(&self) -> f32 {
        // cos^s against 1 / (cos^2 (a^2 - 1) + 1)^2 near the peak.
        (2.0 / (self.shininess + 2.0)).sqrt()
    }

    #[inline]
    fn f_cos(&self, wo: Vec3, wi: Vec3) -> LobeValue {
        let h = wo + wi;
        let cos = h.z / h.length();
        // Opposite directions have no half vector (NaN), and one below the surface no highlight.
        let value = if cos > 0.0 { self.scale * cos.powf(self.shininess) } else { 0.0 };
        LobeValue { colored: value, white: 0.0 }
    }

    /// Half vectors by (s + 1) / 2 pi cos^s; 1 / (4 wo.h) for the reflection.
    #[inline]
    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        let h = wo + wi;
        let length = h.length();
        let cos = h.z / length;
        let pdf = (self.shininess + 1.0) / TAU * cos.max(0.0).powf(self.shininess) / (2.0 * length);
        if cos > 0.0 && pdf.is_finite() { pdf } else { 0.0 }
    }

    #[inline]
    fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<Vec3> {
        let cos = (1.0 - u[0]).powf(1.0 / (self.shininess + 1.0));
        let r = ((1.0 - cos) * (1.0 + cos)).max(0.0).sqrt();
        let SinCos { sin, cos: c } = sin_cos_2pi(u[1]);
        let h = Vec3::new(r * c, r * sin, cos);
        // A facet seen from behind reflects nothing.
        (wo.dot(h) > 0.0).then(|| reflect(wo, h))
    }
}
