//! GGX facets over a diffuse base, in the simple form that courses teach: Schlick's Fresnel, masking of the two
//! directions taken apart, and a base that the facets take no light from (so that it may send back more than arrives).

use crate::base::material::Material;
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::error::Result;
use crate::materials::glossy::{
    AMBIENT, DIFFUSE, EMISSION, Glossy, Lobe, LobeValue, SAMPLING, SPECULAR, Style,
};
use crate::materials::microfacet::{Ggx, MIN_ALPHA, MIN_COS, reflect};
use glam::Vec3;
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

pub(super) const ROW: Row<dyn Material> = Row {
    kind: "ggx",
    doc: "a diffuse base under GGX facets with Schlick's Fresnel, from both sides; for rough metal alone see metal",
    params: &[
        DIFFUSE,
        SPECULAR,
        ParamSpec {
            name: "alpha",
            kind: ParamKind::Number { min: 0.0, max: 1.0 },
            default: Some("0.1"),
            doc: "width of the lobe; below 0.001 all are alike",
        },
        AMBIENT,
        EMISSION,
        SAMPLING,
    ],
    build: |p| Ok(Arc::new(from_params(p)?)),
    samples: || {
        let with = |alpha: f64, diffuse: f64, specular: f64| {
            Params::new()
                .with("alpha", Value::Number(alpha))
                .with("diffuse", Value::Number(diffuse))
                .with("specular", Value::Number(specular))
        };
        vec![
            Params::new(),
            with(0.25, 0.0, 0.9),
            with(0.01, 0.0, 0.0),
            with(0.7, 0.1, 0.5),
            with(0.5, 0.5, 0.0),
        ]
    },
};

fn from_params(p: &Params) -> Result<Glossy<Facets>> {
    let alpha = (p.number_or("alpha", 0.1)? as f32).clamp(MIN_ALPHA, 1.0);
    let style = Style { diffuse_scale: FRAC_1_PI, two_sided: true, mirrors: false, physical: false };
    Glossy::from_params(p, Facets { ggx: Ggx { ax: alpha, ay: alpha } }, style)
}

struct Facets {
    ggx: Ggx,
}

impl Lobe for Facets {
    #[inline]
    fn f_cos(&self, wo: Vec3, wi: Vec3) -> LobeValue {
        let facet = (wo.z > MIN_COS && wi.z > MIN_COS).then(|| self.ggx.facet(wo, wi)).flatten();
        let Some(facet) = facet else { return LobeValue { colored: 0.0, white: 0.0 } };
        // G1(w) / (4 cos) twice, less the 4 cos wi that the two have too many.
        let g = self.ggx.visible_over_4cos(wo) * self.ggx.visible_over_4cos(wi) * 4.0 * wi.z;
        // Schlick 1994: F = ks + (1 - ks) (1 - cos)^5.
        let grazing = (1.0 - facet.cos).powi(5);
        let lobe = facet.d * g;
        LobeValue { colored: lobe * (1.0 - grazing), white: lobe * grazing }
    }

    #[inline]
    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        if wo.z <= MIN_COS {
            return 0.0;
        }
        self.ggx.facet(wo, wi).map_or(0.0, |f| f.d * self.ggx.visible_over_4cos(wo))
    }

    #[inline]
    fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<Vec3> {
        if wo.z <= MIN_COS {
            return None;
        }
        let h = self.ggx.sample_visible(wo, u)?;
        Some(reflect(wo, h))
    }

    fn alpha(&self) -> f32 {
        self.ggx.ax
    }

    fn has_white(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lobe_is_the_textbook_formula() {
        // F G D / (4 cos cos) cos, with D = a^2 / (pi cos^4 (a^2 + tan^2)^2) and G1 = 2 / (1 + sqrt(1 + a^2 tan^2)).
        let tan2 = |c: f32| (1.0 - c * c) / (c * c);
        for alpha in [0.05f32, 0.3, 1.0] {
            let lobe = Facets { ggx: Ggx { ax: alpha, ay: alpha } };
            for (wo, wi) in [(Vec3::new(0.6, 0.0, 0.8), Vec3::new(-0.48, 0.36, 0.8)), (Vec3::Z, Vec3::Z)] {
                let h = (wo + wi).normalize();
                let t2 = tan2(h.z);
                let d = alpha * alpha / (std::f32::consts::PI * h.z.powi(4) * (alpha * alpha + t2).powi(2));
                let g1 = |w: Vec3| 2.0 / (1.0 + (1.0 + alpha * alpha * tan2(w.z)).sqrt());
                let f = |ks: f32| ks + (1.0 - ks) * (1.0 - wi.dot(h)).powi(5);
                let value = lobe.f_cos(wo, wi);
                for ks in [0.0, 0.04, 0.9] {
                    let want = f(ks) * g1(wo) * g1(wi) * d / (4.0 * wo.z);
                    let got = ks * value.colored + value.white;
                    // A dozen roundings, and the cancellation in a + b of D at the peak of a narrow lobe.
                    assert!((got - want).abs() <= 1e-4 * want + 1e-9, "{alpha} {ks}: {got} {want}");
                }
            }
        }
    }
}
