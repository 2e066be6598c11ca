//! Lambert's surface, lit and seen from the same side, whichever it is.

use crate::base::directions::{DirectionLanes, LANES};
use crate::base::lanes::{Columns, LANES as MANY};
use crate::base::material::{BsdfEval, BsdfLanes, BsdfSample, Material, Prepared, SampleLanes, Scattering};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::shape::Needs;
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::error::Result;
use crate::materials::reflectance::Reflectance;
use crate::math::simd::{Kernel, dispatch};
use crate::sampling::warp::{cosine_hemisphere, cosine_hemisphere_pdf};
use glam::{Vec2, Vec3};
use std::sync::Arc;

pub(super) const ROW: Row<dyn Material> = Row {
    kind: "diffuse",
    doc: "scatters evenly (Lambert), from both sides",
    params: &[ParamSpec {
        name: "albedo",
        kind: ParamKind::Texture,
        default: Some("0.8"),
        doc: "share of the light that is scattered, 0 to 1",
    }],
    build: |p| Ok(Arc::new(Diffuse::from_params(p, 0.8)?)),
    samples: || {
        vec![
            Params::new(),
            Params::new().with("albedo", Value::Numbers(vec![1.0, 0.5, 0.0])),
            Params::new().with("albedo", Value::Number(0.0)),
        ]
    },
};

/// The material; also what scatters on a surface that glows.
pub(super) struct Diffuse {
    albedo: Reflectance,
}

impl Diffuse {
    pub(super) fn from_params(p: &Params, default: f64) -> Result<Self> {
        Ok(Diffuse { albedo: Reflectance::from_params(p, "albedo", [default; 3])? })
    }
}

impl Material for Diffuse {
    fn needs(&self) -> Needs {
        self.albedo.needs()
    }

    fn prepare(&self, vertex: &Vertex, out: &mut Prepared) {
        *out.view_mut::<Rgb>() = self.albedo.at(vertex);
    }

    fn prepared_everywhere(&self) -> Option<Prepared> {
        self.albedo.constant().map(Prepared::of)
    }

    #[inline]
    fn eval(&self, m: &Prepared, wo: Vec3, wi: Vec3) -> BsdfEval {
        if wo.z * wi.z <= 0.0 {
            return BsdfEval::default();
        }
        let pdf = cosine_hemisphere_pdf(wi.z.abs());
        BsdfEval { f_cos: *m.view::<Rgb>() * pdf, pdf }
    }

    fn eval_many(&self, m: &Prepared, wo: Vec3, wi: &DirectionLanes) -> BsdfLanes {
        let albedo = m.view::<Rgb>().to_array();
        let mut out = BsdfLanes::default();
        for k in 0..LANES {
            let pdf = cosine_hemisphere_pdf(wi.z[k].abs());
            out.pdf[k] = if wo.z * wi.z[k] <= 0.0 { 0.0 } else { pdf };
        }
        for (column, albedo) in out.f_cos.iter_mut().zip(albedo) {
            (0..LANES).for_each(|k| column[k] = albedo * out.pdf[k]);
        }
        out
    }

    #[inline]
    fn picks_lobe(&self) -> bool {
        false
    }

    fn sample(&self, m: &Prepared, wo: Vec3, u: [f32; 2], _uc: f32) -> Option<BsdfSample> {
        let mut wi = cosine_hemisphere(Vec2::from(u));
        let pdf = cosine_hemisphere_pdf(wi.z);
        if wo.z < 0.0 {
            wi.z = -wi.z;
        }
        // Directions in the surface itself scatter nothing.
        (wo.z * wi.z > 0.0).then(|| BsdfSample { wi, weight: *m.view::<Rgb>(), pdf, delta: false })
    }

    fn sample_many(
        &self,
        m: &Prepared,
        wo: &Columns<f32>,
        u: &[[f32; MANY]; 2],
        _uc: &[f32; MANY],
        _n: usize,
    ) -> SampleLanes {
        let mut out = SampleLanes::default();
        dispatch(SampleMany { albedo: *m.view::<Rgb>(), wo, u, out: &mut out });
        out
    }

    fn samples_together(&self) -> bool {
        true
    }

    fn scattering(&self, m: &Prepared) -> Option<Scattering> {
        let even = m.view::<Rgb>().luminance() * std::f32::consts::FRAC_1_PI;
        Some(Scattering { even, ..Scattering::EVEN })
    }

    fn albedo(&self, m: &Prepared, _wo: Vec3) -> Rgb {
        *m.view::<Rgb>()
    }

    fn diffuse(&self, m: &Prepared) -> Rgb {
        *m.view::<Rgb>()
    }

    fn is_black(&self) -> bool {
        self.albedo.is_black()
    }
}

/// [`Diffuse::sample`] of all lanes.
struct SampleMany<'a> {
    albedo: Rgb,
    wo: &'a Columns<f32>,
    u: &'a [[f32; MANY]; 2],
    out: &'a mut SampleLanes,
}

impl Kernel for SampleMany<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        sample_many(self.albedo, self.wo, self.u, self.out);
    }
}

// A function of its own: the compiler knows of arguments, but not of a struct's fields, that they do not overlap.
#[inline(always)]
fn sample_many(albedo: Rgb, wo: &Columns<f32>, u: &[[f32; MANY]; 2], out: &mut SampleLanes) {
    let albedo = albedo.to_array();
    for k in 0..MANY {
        let wi = cosine_hemisphere(Vec2::new(u[0][k], u[1][k]));
        let z = wo.0[2][k];
        out.pdf[k] = cosine_hemisphere_pdf(wi.z);
        let up = if z < 0.0 { -wi.z } else { wi.z };
        out.wi.set(k, Vec3::new(wi.x, wi.y, up));
        let scatters = z * up > 0.0;
        for (column, albedo) in out.weight.0.iter_mut().zip(albedo) {
            column[k] = if scatters { albedo } else { 0.0 };
        }
    }
}
