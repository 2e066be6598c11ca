//! Paper: scatters evenly to both of its sides, unlike any material of the crate.

use glam::{Vec2, Vec3};
use skylit::base::material::{BsdfEval, BsdfSample, Material, Prepared, Transmission};
use skylit::base::registry::{ParamKind, ParamSpec, Params, Row, TextureOrColor, Value};
use skylit::base::shape::Needs;
use skylit::base::vertex::Vertex;
use skylit::color::Rgb;
use skylit::sampling::warp::{cosine_hemisphere, cosine_hemisphere_pdf};
use std::sync::Arc;

/// The registry row.
pub const ROW: Row<dyn Material> = Row {
    kind: "paper",
    doc: "scatters evenly to the side it is lit from, and to the other",
    params: &[
        ParamSpec {
            name: "reflectance",
            kind: ParamKind::Texture,
            default: Some("0.5"),
            doc: "share that returns; cut to what is not transmitted",
        },
        ParamSpec {
            name: "transmittance",
            kind: ParamKind::Number { min: 0.0, max: 1.0 },
            default: Some("0.3"),
            doc: "share that passes",
        },
    ],
    build: |p| {
        let transmittance = p.number_or("transmittance", 0.3)? as f32;
        let reflectance = p.texture_or("reflectance", [0.5; 3])?;
        Ok(Arc::new(Paper { reflectance, transmittance: transmittance.clamp(0.0, 1.0) }))
    },
    samples: || {
        vec![
            Params::new(),
            Params::new()
                .with("reflectance", Value::Numbers(vec![0.6, 0.2, 0.0]))
                .with("transmittance", Value::Number(0.4)),
            Params::new().with("reflectance", Value::Number(0.0)).with("transmittance", Value::Number(1.0)),
        ]
    },
};

struct Paper {
    reflectance: TextureOrColor,
    transmittance: f32,
}

/// The reflectance at a vertex.
type Kept = Rgb;

impl Paper {
    /// The share of samples that stay on the side of the viewer: no weight exceeds the two shares together.
    fn stay(&self, reflectance: Rgb) -> f32 {
        let all = reflectance.max_component() + self.transmittance;
        if all > 0.0 { reflectance.max_component() / all } else { 1.0 }
    }
}

impl Material for Paper {
    fn needs(&self) -> Needs {
        match &self.reflectance {
            TextureOrColor::Color(_) => Needs::default(),
            TextureOrColor::Texture(t) => Needs { uv: true, tangents: t.uses_footprint() },
        }
    }

    fn prepare(&self, v: &Vertex, out: &mut Prepared) {
        let reflectance = match &self.reflectance {
            TextureOrColor::Color(c) => *c,
            TextureOrColor::Texture(t) => t.eval(v.uv, v.footprint),
        };
        *out.view_mut::<Kept>() = reflectance.map(|r| r.min(1.0 - self.transmittance));
    }

    fn eval(&self, m: &Prepared, wo: Vec3, wi: Vec3) -> BsdfEval {
        if wo.z == 0.0 || wi.z == 0.0 {
            return BsdfEval::default();
        }
        let (reflectance, lobe) = (*m.view::<Kept>(), cosine_hemisphere_pdf(wi.z.abs()));
        let stay = self.stay(reflectance);
        match (wo.z > 0.0) == (wi.z > 0.0) {
            true => BsdfEval { f_cos: reflectance * lobe, pdf: stay * lobe },
            false => BsdfEval { f_cos: Rgb::splat(self.transmittance) * lobe, pdf: (1.0 - stay) * lobe },
        }
    }

    fn sample(&self, m: &Prepared, wo: Vec3, u: [f32; 2], uc: f32) -> Option<BsdfSample> {
        let reflectance = *m.view::<Kept>();
        let (share, stays) = (self.stay(reflectance), uc < self.stay(reflectance));
        let mut wi = cosine_hemisphere(Vec2::from(u));
        if wo.z == 0.0 || wi.z == 0.0 {
            return None;
        }
        let pdf = cosine_hemisphere_pdf(wi.z);
        if (wo.z > 0.0) != stays {
            wi.z = -wi.z;
        }
        Some(match stays {
            true => BsdfSample { wi, weight: reflectance / share, pdf: share * pdf, delta: false },
            false => {
                let weight = Rgb::splat(self.transmittance / (1.0 - share));
                BsdfSample { wi, weight, pdf: (1.0 - share) * pdf, delta: false }
            }
        })
    }

    fn transmission(&self) -> Option<Transmission> {
        Some(Transmission { eta: 1.0 })
    }

    fn albedo(&self, m: &Prepared, _wo: Vec3) -> Rgb {
        *m.view::<Kept>() + Rgb::splat(self.transmittance)
    }
}
