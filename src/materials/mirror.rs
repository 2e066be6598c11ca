//! A perfect mirror on both sides.

use crate::base::material::{BsdfEval, BsdfSample, Material, Prepared};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::shape::Needs;
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::error::Result;
use crate::materials::reflectance::Reflectance;
use glam::Vec3;
use std::sync::Arc;

pub(super) const ROW: Row<dyn Material> = Row {
    kind: "mirror",
    doc: "reflects perfectly, from both sides",
    params: &[ParamSpec {
        name: "reflectance",
        kind: ParamKind::Texture,
        default: Some("0.95"),
        doc: "share of the light that is reflected, 0 to 1",
    }],
    build: |p| Ok(Arc::new(Mirror::from_params(p)?)),
    samples: || vec![Params::new(), Params::new().with("reflectance", Value::Numbers(vec![1.0, 0.5, 0.0]))],
};

struct Mirror {
    reflectance: Reflectance,
}

impl Mirror {
    fn from_params(p: &Params) -> Result<Self> {
        Ok(Mirror { reflectance: Reflectance::from_params(p, "reflectance", [0.95; 3])? })
    }
}

impl Material for Mirror {
    fn needs(&self) -> Needs {
        self.reflectance.needs()
    }

    fn prepare(&self, vertex: &Vertex, out: &mut Prepared) {
        *out.view_mut::<Rgb>() = self.reflectance.at(vertex);
    }

    fn prepared_everywhere(&self) -> Option<Prepared> {
        self.reflectance.constant().map(Prepared::of)
    }

    fn eval(&self, _m: &Prepared, _wo: Vec3, _wi: Vec3) -> BsdfEval {
        BsdfEval::default()
    }

    #[inline]
    fn picks_lobe(&self) -> bool {
        false
    }

    fn sample(&self, m: &Prepared, wo: Vec3, _u: [f32; 2], _uc: f32) -> Option<BsdfSample> {
        let wi = Vec3::new(-wo.x, -wo.y, wo.z);
        (wi.z != 0.0).then(|| BsdfSample { wi, weight: *m.view::<Rgb>(), pdf: 1.0, delta: true })
    }

    fn albedo(&self, m: &Prepared, _wo: Vec3) -> Rgb {
        *m.view::<Rgb>()
    }

    fn is_delta(&self) -> bool {
        true
    }

    fn is_black(&self) -> bool {
        self.reflectance.is_black()
    }
}
