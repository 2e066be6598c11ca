//! Rough metal with facets as Beckmann has them: smaller tails than GGX, and one reflection alone. What many renderers
//! had before GGX, and published scenes still ask for.
//!
//! Walter, Marschner, Li, Torrance, "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007: eq. 20 and 25 to
//! 27 (masking by their rational fit, within 0.35 % of Smith's).

use crate::base::material::{BsdfEval, BsdfSample, Material, Prepared};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::error::Result;
use crate::materials::conductor::{CONDUCTORS, Conductor};
use crate::materials::microfacet::{Ggx, MIN_COS, reflect};
use glam::Vec3;
use std::f32::consts::PI;
use std::sync::Arc;

pub(super) const ROW: Row<dyn Material> = Row {
    kind: "beckmann",
    doc: "rough metal (Beckmann facets, one reflection), from both sides",
    params: &[
        ParamSpec {
            name: "metal",
            kind: ParamKind::Choice(&["custom", "aluminium", "copper", "gold", "iron", "silver"]),
            default: Some("custom"),
            doc: "a metal known by its measured refractive index; custom takes `n` and `k`",
        },
        ParamSpec {
            name: "n",
            kind: ParamKind::Color,
            default: Some("1"),
            doc: "real part of the refractive index, by channel",
        },
        ParamSpec {
            name: "k",
            kind: ParamKind::Color,
            default: Some("5"),
            doc: "imaginary part of the refractive index, by channel",
        },
        ParamSpec {
            name: "tint",
            kind: ParamKind::Color,
            default: Some("1"),
            doc: "what the reflectance is multiplied by, 0 to 1; metals have 1",
        },
        ParamSpec {
            name: "roughness",
            kind: ParamKind::Number { min: 0.0, max: 1.0 },
            default: Some("0.3"),
            doc: "square root of Beckmann's width alpha; below 0.032 all are alike",
        },
    ],
    build: |p| Ok(Arc::new(Beckmann::from_params(p)?)),
    samples: || {
        let rough = |roughness: f64| Params::new().with("roughness", Value::Number(roughness));
        vec![
            Params::new(),
            rough(0.0),
            rough(0.1),
            rough(0.5),
            rough(1.0),
            Params::new().with("metal", Value::Text("gold".into())),
            Params::new()
                .with("n", Value::Numbers(vec![0.2, 0.9, 1.1]))
                .with("k", Value::Numbers(vec![3.9, 2.5, 2.1]))
                .with("tint", Value::Numbers(vec![0.3, 0.5, 1.0]))
                .with("roughness", Value::Number(0.7)),
        ]
    },
};

/// Entries of the table of albedos.
const CELLS: usize = 32;
/// Samples for an entry: a lattice of 1,597 points.
const LATTICE: [u32; 2] = [1597, 987];

struct Beckmann {
    /// The width, and how directions are sampled: GGX of the same width. Its tails are longer, so no weight is
    /// large: D / D of GGX is at most 4 / e, and G / G1 of GGX at most sqrt(pi).
    ggx: Ggx,
    metal: Conductor,
    tint: Rgb,
    /// Over the root of the cosine.
    albedo: [Rgb; CELLS + 1],
}

impl Beckmann {
    fn from_params(p: &Params) -> Result<Self> {
        let roughness = p.number_or("roughness", 0.3)?.clamp(0.0, 1.0) as f32;
        let tint = p.color_or("tint", [1.0; 3])?.map(|v| v.min(1.0));
        let mut it = Beckmann {
            ggx: Ggx::new(roughness, 0.0),
            metal: metal(p)?,
            tint,
            albedo: [Rgb::BLACK; CELLS + 1],
        };
        it.albedo = std::array::from_fn(|i| it.integrate((i as f32 / CELLS as f32).powi(2).max(1e-4)));
        Ok(it)
    }

    /// Reflectance seen at a cosine.
    fn integrate(&self, mu: f32) -> Rgb {
        let wo = Vec3::new((1.0 - mu * mu).max(0.0).sqrt(), 0.0, mu);
        let [n, g] = LATTICE;
        let part = |i: u32| {
            let u =
                [(i as f32 + 0.5) / n as f32, (u64::from(i) * u64::from(g) % u64::from(n)) as f32 / n as f32];
            self.sample_up(wo, u).map_or(Rgb::BLACK, |s| s.weight)
        };
        (0..n).map(part).sum::<Rgb>() / n as f32
    }

    /// Shadowing by facets along one direction (Walter eq. 27).
    #[inline]
    fn masking(&self, cos: f32) -> f32 {
        let tan2 = (1.0 - cos * cos).max(0.0) / (cos * cos);
        let a = 1.0 / (self.ggx.ax * tan2.sqrt());
        if a < 1.6 { a * (3.535 + 2.181 * a) / (1.0 + a * (2.276 + 2.577 * a)) } else { 1.0 }
    }

    /// Both directions above the surface.
    #[inline]
    fn evaluate(&self, wo: Vec3, wi: Vec3) -> BsdfEval {
        if wo.z < MIN_COS || wi.z < MIN_COS {
            return BsdfEval::default();
        }
        let Some(facet) = self.ggx.facet(wo, wi) else { return BsdfEval::default() };
        let h = wo + wi;
        let cos2 = (h.z * h.z / h.length_squared()).clamp(1e-12, 1.0);
        let alpha2 = self.ggx.ax * self.ggx.ax;
        // Eq. 25. 1 - cos^2 from the other two coordinates: near the peak a difference would be rounding alone.
        let tan2 = (h.x * h.x + h.y * h.y) / (h.z * h.z).max(f32::MIN_POSITIVE);
        let x = tan2 / alpha2;
        // 1e-26 of the peak: before products leave the range of f32.
        if x > 60.0 {
            return BsdfEval { f_cos: Rgb::BLACK, pdf: facet.d * self.ggx.visible_over_4cos(wo) };
        }
        let d = (-x).exp() / (PI * alpha2 * cos2 * cos2);
        let once = d * self.masking(wo.z) * self.masking(wi.z) / (4.0 * wo.z);
        let pdf = facet.d * self.ggx.visible_over_4cos(wo);
        BsdfEval { f_cos: self.metal.reflectance(facet.cos) * self.tint * once, pdf }
    }

    #[inline]
    fn sample_up(&self, wo: Vec3, u: [f32; 2]) -> Option<BsdfSample> {
        let wi = reflect(wo, self.ggx.sample_visible(wo, u)?);
        let e = self.evaluate(wo, wi);
        (e.pdf > 0.0).then(|| BsdfSample { wi, weight: e.f_cos / e.pdf, pdf: e.pdf, delta: false })
    }
}

/// By name, or by index.
fn metal(p: &Params) -> Result<Conductor> {
    let name = p.text_or("metal", "custom")?;
    let given = ["n", "k"].into_iter().find(|n| p.get(n).is_some());
    if let Some(known) = CONDUCTORS.iter().find(|c| c.name == name) {
        return match given {
            Some(n) => Err(p.error(n, format!("is that of \"{name}\" already: give one of the two"))),
            None => Ok(*known),
        };
    }
    let [n, k] = [p.color_or("n", [1.0; 3])?, p.color_or("k", [5.0; 3])?].map(|v| v.to_array());
    for c in 0..3 {
        if n[c].max(k[c]) == 0.0 || n[c].max(k[c]) > 1e3 {
            return Err(p.error("n", "and `k` must not both be 0 in a channel, nor above 1000"));
        }
    }
    Ok(Conductor { name: "custom", n, k })
}

impl Material for Beckmann {
    fn prepare(&self, _vertex: &Vertex, _out: &mut Prepared) {}

    fn eval(&self, _m: &Prepared, wo: Vec3, wi: Vec3) -> BsdfEval {
        let side = 1f32.copysign(wo.z);
        self.evaluate(Vec3::new(wo.x, wo.y, wo.z * side), Vec3::new(wi.x, wi.y, wi.z * side))
    }

    fn picks_lobe(&self) -> bool {
        false
    }

    fn sample(&self, _m: &Prepared, wo: Vec3, u: [f32; 2], _uc: f32) -> Option<BsdfSample> {
        let up = Vec3::new(wo.x, wo.y, wo.z.abs());
        if up.z < MIN_COS {
            return None;
        }
        let mut s = self.sample_up(up, u)?;
        s.wi.z *= 1f32.copysign(wo.z);
        Some(s)
    }

    fn albedo(&self, _m: &Prepared, wo: Vec3) -> Rgb {
        let at = wo.z.abs().min(1.0).sqrt() * CELLS as f32;
        let i = (at as usize).min(CELLS - 1);
        self.albedo[i].lerp(self.albedo[i + 1], at - i as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::integrate_sphere;

    /// Facets fill the plane: the integral of D cos over the hemisphere is 1. With wo along the normal
    /// f cos = F D G1(wi) / 4, and dwi = 4 cos(h) dh there.
    #[test]
    fn facets_cover_the_plane() {
        for roughness in [0.4, 0.7, 1.0] {
            let p = Params::new().with("n", Value::Number(0.0)).with("roughness", Value::Number(roughness));
            let it = Beckmann::from_params(&p).unwrap();
            let area = |h: glam::DVec3| {
                let h = h.as_vec3();
                // The reflected direction lies above the surface for facets up to 45 degrees; the rest by symmetry
                // of the formula is not asked for.
                if h.z <= std::f32::consts::FRAC_1_SQRT_2 {
                    return 0.0;
                }
                let wi = reflect(Vec3::Z, h);
                let f = it.evaluate(Vec3::Z, wi).f_cos.g / it.masking(wi.z);
                // F is 1 where n is 0.
                f64::from(4.0 * f * h.z)
            };
            let alpha2 = roughness.powi(4);
            // In closed form: the share with tan^2 < 1.
            let expected = 1.0 - (-1.0 / alpha2).exp();
            let total = integrate_sphere(area, 1e-5);
            // Quadrature across the edge at 45 degrees.
            assert!((total - expected).abs() < 2e-3, "{roughness}: {total}, {expected}");
        }
    }
}
