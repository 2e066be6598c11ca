//! A surface that glows and scatters nothing.

use crate::base::material::{BsdfEval, BsdfSample, Emitter, Material, Prepared};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::error::Result;
use glam::{Vec2, Vec3};
use std::sync::Arc;

pub(super) const ROW: Row<dyn Material> = Row {
    kind: "emissive",
    doc: "emits the same radiance in every direction, and scatters nothing",
    params: &[
        ParamSpec {
            name: "radiance",
            kind: ParamKind::Color,
            default: Some("1"),
            doc: "emitted radiance, W sr^-1 m^-2",
        },
        ParamSpec {
            name: "two_sided",
            kind: ParamKind::Bool,
            default: Some("false"),
            doc: "whether the back emits too; the front is the side of the geometric normal",
        },
    ],
    build: |p| Ok(Arc::new(Emissive::from_params(p)?)),
    samples: || {
        vec![
            Params::new(),
            Params::new()
                .with("radiance", Value::Numbers(vec![10.0, 5.0, 0.0]))
                .with("two_sided", Value::Bool(true)),
            Params::new().with("radiance", Value::Number(0.0)),
        ]
    },
};

struct Emissive {
    radiance: Rgb,
    two_sided: bool,
}

impl Emissive {
    fn from_params(p: &Params) -> Result<Self> {
        Ok(Emissive {
            radiance: p.color_or("radiance", [1.0; 3])?,
            two_sided: p.bool_or("two_sided", false)?,
        })
    }
}

impl Material for Emissive {
    fn prepare(&self, _vertex: &Vertex, _out: &mut Prepared) {}

    fn eval(&self, _m: &Prepared, _wo: Vec3, _wi: Vec3) -> BsdfEval {
        BsdfEval::default()
    }

    fn sample(&self, _m: &Prepared, _wo: Vec3, _u: [f32; 2], _uc: f32) -> Option<BsdfSample> {
        None
    }

    fn albedo(&self, _m: &Prepared, _wo: Vec3) -> Rgb {
        Rgb::BLACK
    }

    fn is_black(&self) -> bool {
        true
    }

    fn emission(&self, _uv: Vec2, cos_o: f32) -> Rgb {
        if cos_o > 0.0 || self.two_sided { self.radiance } else { Rgb::BLACK }
    }

    fn emitter(&self) -> Option<Emitter> {
        (!self.radiance.is_black()).then_some(Emitter { mean: self.radiance, two_sided: self.two_sided })
    }
}
