//! Rough metal: GGX facets, and the light that bounces between them.

use crate::base::material::{BsdfEval, BsdfSample, Material, Prepared, Scattering};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::shape::Needs;
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::error::Result;
use crate::materials::conductor::{CONDUCTORS, Conductor, schlick, schlick_average};
use crate::materials::microfacet::{Ggx, MIN_COS, reflect};
use crate::materials::multiscatter::{Entry, MultiScatter};
use crate::materials::reflectance::Reflectance;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use std::sync::Arc;

pub(super) const ROW: Row<dyn Material> = Row {
    kind: "metal",
    doc: "rough metal (GGX), of a given colour or of a known metal, from both sides",
    params: &[
        ParamSpec {
            name: "metal",
            kind: ParamKind::Choice(&["custom", "aluminium", "copper", "gold", "iron", "silver"]),
            default: Some("custom"),
            doc: "a metal known by its measured refractive index; custom takes `color`",
        },
        ParamSpec {
            name: "color",
            kind: ParamKind::Texture,
            default: Some("0.9"),
            doc: "reflectance at normal incidence, 0 to 1; it rises to 1 at grazing (Schlick)",
        },
        ParamSpec {
            name: "roughness",
            kind: ParamKind::Number { min: 0.0, max: 1.0 },
            default: Some("0.3"),
            doc: "square root of the GGX width alpha; below 0.032 all are alike",
        },
        ParamSpec {
            name: "anisotropy",
            kind: ParamKind::Number { min: 0.0, max: 1.0 },
            default: Some("0"),
            doc: "stretches highlights along u: alpha there is up to 10 times that along v",
        },
    ],
    build: |p| Ok(Arc::new(Metal::from_params(p)?)),
    samples,
};

fn samples() -> Vec<Params> {
    let metal = |name: &str, roughness| {
        Params::new().with("metal", Value::Text(name.into())).with("roughness", Value::Number(roughness))
    };
    let white = |roughness, anisotropy| {
        Params::new()
            .with("color", Value::Number(1.0))
            .with("roughness", Value::Number(roughness))
            .with("anisotropy", Value::Number(anisotropy))
    };
    vec![
        Params::new(),
        white(0.0, 0.0),
        white(0.15, 0.0),
        white(0.4, 0.0),
        white(0.7, 0.0),
        white(1.0, 0.0),
        white(0.5, 0.7),
        white(1.0, 1.0),
        metal("gold", 0.0),
        metal("aluminium", 0.5),
        metal("iron", 1.0),
        Params::new()
            .with("color", Value::Numbers(vec![0.9, 0.3, 0.0]))
            .with("roughness", Value::Number(0.6)),
    ]
}

struct Metal {
    ggx: Ggx,
    /// A known metal; Schlick's approximation stands in for the rest.
    conductor: Option<Conductor>,
    color: Color,
    /// None where the facets lose next to nothing.
    multiple: Option<MultiScatter>,
}

enum Color {
    Fixed(At),
    Textured(Reflectance),
}

/// A vertex' reflectance.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct At {
    /// At normal incidence.
    f0: Rgb,
    /// Colour of the light that bounces between facets.
    multiple: Rgb,
    /// Brightness of `multiple` over that of the facets' average reflectance: how the two lobes share samples.
    share: f32,
}

impl At {
    /// From the reflectance at normal incidence and over a hemisphere of light.
    fn new(f0: Rgb, average: Rgb, multiple: Option<&MultiScatter>) -> Self {
        let multiple = multiple.map_or(Rgb::BLACK, |m| m.color(average));
        At { f0, multiple, share: multiple.luminance() / average.luminance().max(1e-6) }
    }
}

/// Both directions, turned to the upper side.
struct Pair {
    wo: Vec3,
    wi: Vec3,
}

impl Metal {
    fn from_params(p: &Params) -> Result<Self> {
        let name = p.text_or("metal", "custom")?;
        let conductor = CONDUCTORS.iter().find(|c| c.name == name).copied();
        if conductor.is_some() && p.get("color").is_some() {
            return Err(p.error("color", format!("is that of \"{name}\" already: give one of the two")));
        }
        let number = |name: &str, default: f64| Ok(p.number_or(name, default)?.clamp(0.0, 1.0) as f32);
        let ggx = Ggx::new(number("roughness", 0.3)?, number("anisotropy", 0.0)?);
        let multiple = MultiScatter::new(ggx);
        let color = match conductor {
            Some(c) => Color::Fixed(At::new(c.reflectance(1.0), c.average(), multiple.as_ref())),
            None => {
                let color = Reflectance::from_params(p, "color", [0.9; 3])?;
                match color.constant() {
                    Some(f0) => Color::Fixed(At::new(f0, schlick_average(f0), multiple.as_ref())),
                    None => Color::Textured(color),
                }
            }
        };
        Ok(Metal { ggx, conductor, color, multiple })
    }

    #[inline]
    fn fresnel(&self, at: &At, cos: f32) -> Rgb {
        match &self.conductor {
            None => schlick(at.f0, cos),
            Some(c) => c.reflectance(cos),
        }
    }

    /// Value and density, `lost` being what [`MultiScatter::at`] says of `wo`.
    #[inline]
    fn evaluate(&self, at: &At, Pair { wo, wi }: Pair, lost: Entry) -> BsdfEval {
        if wi.z < MIN_COS {
            return BsdfEval::default();
        }
        let Some(facet) = self.ggx.facet(wo, wi) else { return BsdfEval::default() };
        // Torrance and Sparrow: F D G / (4 cos cos) (Walter et al. 2007, eq. 20).
        let once = facet.d * self.ggx.masking_over_4cos(wo, wi) * wi.z;
        let mut f_cos = self.fresnel(at, facet.cos) * once;
        let mut pdf = facet.d * self.ggx.visible_over_4cos(wo);
        if let Some(m) = &self.multiple {
            let chance = chance_of_multiple(at, lost);
            f_cos += at.multiple * (m.lobe(lost, m.at(wi)) * wi.z);
            pdf += (m.pdf(wi) - pdf) * chance;
        }
        BsdfEval { f_cos, pdf }
    }

    #[inline]
    fn lost(&self, wo: Vec3) -> Entry {
        self.multiple.as_ref().map_or_else(Entry::default, |m| m.at(wo))
    }
}

/// The share of samples spent on light that bounces between facets: its share of the light.
#[inline]
fn chance_of_multiple(at: &At, lost: Entry) -> f32 {
    let multiple = lost.loss * at.share;
    multiple / (1.0 - lost.loss + multiple)
}

impl Material for Metal {
    fn needs(&self) -> Needs {
        let tangents = Needs { uv: false, tangents: !self.ggx.is_isotropic() };
        match &self.color {
            Color::Textured(c) => c.needs().or(tangents),
            Color::Fixed(_) => tangents,
        }
    }

    fn prepare(&self, vertex: &Vertex, out: &mut Prepared) {
        *out.view_mut() = match &self.color {
            Color::Fixed(at) => *at,
            Color::Textured(color) => {
                let f0 = color.at(vertex);
                At::new(f0, schlick_average(f0), self.multiple.as_ref())
            }
        };
    }

    fn prepared_everywhere(&self) -> Option<Prepared> {
        match &self.color {
            Color::Fixed(at) => Some(Prepared::of(*at)),
            Color::Textured(_) => None,
        }
    }

    fn eval(&self, m: &Prepared, wo: Vec3, wi: Vec3) -> BsdfEval {
        let side = 1f32.copysign(wo.z);
        let (mut up_o, mut up_i) = (wo, wi);
        up_o.z *= side;
        up_i.z *= side;
        if up_o.z < MIN_COS {
            return BsdfEval::default();
        }
        self.evaluate(m.view(), Pair { wo: up_o, wi: up_i }, self.lost(up_o))
    }

    fn sample(&self, m: &Prepared, wo: Vec3, u: [f32; 2], uc: f32) -> Option<BsdfSample> {
        let at: &At = m.view();
        let side = 1f32.copysign(wo.z);
        let up = Vec3::new(wo.x, wo.y, wo.z * side);
        if up.z < MIN_COS {
            return None;
        }
        let lost = self.lost(up);
        let mut wi = match &self.multiple {
            Some(m) if uc < chance_of_multiple(at, lost) => m.sample(u),
            _ => reflect(up, self.ggx.sample_visible(up, u)?),
        };
        let e = self.evaluate(at, Pair { wo: up, wi }, lost);
        wi.z *= side;
        (e.pdf > 0.0).then(|| BsdfSample { wi, weight: e.f_cos / e.pdf, pdf: e.pdf, delta: false })
    }

    fn scattering(&self, m: &Prepared) -> Option<Scattering> {
        let at: &At = m.view();
        // Light that bounced between facets leaves almost evenly.
        let even = 0.1 * at.multiple.luminance() * std::f32::consts::FRAC_1_PI;
        let alpha = (self.ggx.ax * self.ggx.ay).sqrt();
        Some(Scattering { even, facets: at.f0.luminance().max(0.05), alpha })
    }

    fn albedo(&self, m: &Prepared, wo: Vec3) -> Rgb {
        let at: &At = m.view();
        let up = Vec3::new(wo.x, wo.y, wo.z.abs());
        match &self.multiple {
            None => self.fresnel(at, up.z.min(1.0)),
            Some(m) => {
                let lost = m.at(up);
                self.fresnel(at, lost.mean_facet_cos()) * (1.0 - lost.loss) + at.multiple * lost.loss
            }
        }
    }
}
