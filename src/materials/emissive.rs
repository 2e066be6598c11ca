//! A surface that glows, and may scatter as a diffuse one.

use crate::base::directions::DirectionLanes;
use crate::base::material::{BsdfEval, BsdfLanes, BsdfSample, Emitter, Material, Prepared, Scattering};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::shape::Needs;
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::error::Result;
use crate::materials::diffuse::Diffuse;
use glam::{Vec2, Vec3};
use std::sync::Arc;

pub(super) const ROW: Row<dyn Material> = Row {
    kind: "emissive",
    doc: "emits the same radiance in every direction; scatters evenly, if it has an albedo",
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
        ParamSpec {
            name: "albedo",
            kind: ParamKind::Texture,
            default: Some("0"),
            doc: "share of the light that is scattered, 0 to 1, from both sides",
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
            Params::new().with("albedo", Value::Number(0.6)),
        ]
    },
};

struct Emissive {
    radiance: Rgb,
    two_sided: bool,
    /// What scatters.
    body: Diffuse,
}

impl Emissive {
    fn from_params(p: &Params) -> Result<Self> {
        Ok(Emissive {
            radiance: p.color_or("radiance", [1.0; 3])?,
            two_sided: p.bool_or("two_sided", false)?,
            body: Diffuse::from_params(p, 0.0)?,
        })
    }
}

impl Material for Emissive {
    fn needs(&self) -> Needs {
        self.body.needs()
    }

    fn prepare(&self, vertex: &Vertex, out: &mut Prepared) {
        self.body.prepare(vertex, out);
    }

    fn scattering(&self, m: &Prepared) -> Option<Scattering> {
        self.body.scattering(m)
    }

    fn eval(&self, m: &Prepared, wo: Vec3, wi: Vec3) -> BsdfEval {
        self.body.eval(m, wo, wi)
    }

    fn eval_many(&self, m: &Prepared, wo: Vec3, wi: &DirectionLanes) -> BsdfLanes {
        self.body.eval_many(m, wo, wi)
    }

    fn picks_lobe(&self) -> bool {
        self.body.picks_lobe()
    }

    fn sample(&self, m: &Prepared, wo: Vec3, u: [f32; 2], uc: f32) -> Option<BsdfSample> {
        self.body.sample(m, wo, u, uc)
    }

    fn albedo(&self, m: &Prepared, wo: Vec3) -> Rgb {
        self.body.albedo(m, wo)
    }

    fn diffuse(&self, m: &Prepared) -> Rgb {
        self.body.diffuse(m)
    }

    fn is_black(&self) -> bool {
        self.body.is_black()
    }

    fn emission(&self, _uv: Vec2, cos_o: f32) -> Rgb {
        if cos_o > 0.0 || self.two_sided { self.radiance } else { Rgb::BLACK }
    }

    fn emitter(&self) -> Option<Emitter> {
        let Emissive { radiance, two_sided, .. } = *self;
        (!radiance.is_black()).then_some(Emitter { mean: radiance, two_sided, uniform: true })
    }
}
