//! Glass, water, clear plastic: a boundary between two transparent media, smooth or rough.
//!
//! Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007, with facets drawn and masked as
//! in [`super::microfacet`]. Radiance that enters a denser medium grows with the square of its index (Veach, "Robust
//! Monte Carlo Methods for Light Transport Simulation", 1997, 5.2), and shrinks again where it leaves.

use crate::base::material::{BsdfEval, BsdfSample, Material, Prepared, Transmission};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::shape::Needs;
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::error::Result;
use crate::materials::microfacet::{Ggx, MIN_COS, reflect};
use crate::materials::reflectance::Reflectance;
use glam::Vec3;
use std::sync::Arc;

pub(super) const ROW: Row<dyn Material> = Row {
    kind: "dielectric",
    doc: "glass and other clear media: reflects and refracts (exact Fresnel), smooth or rough (GGX)",
    params: &[
        ParamSpec {
            name: "eta",
            kind: ParamKind::Number { min: 0.1, max: 10.0 },
            default: Some("1.5"),
            doc: "refractive index behind the surface over that in front, where its normal points",
        },
        ParamSpec {
            name: "tint",
            kind: ParamKind::Texture,
            default: Some("1"),
            doc: "share of the refracted light that passes at each crossing, 0 to 1",
        },
        ParamSpec {
            name: "roughness",
            kind: ParamKind::Number { min: 0.0, max: 1.0 },
            default: Some("0"),
            doc: "square root of the GGX width alpha; 0 is smooth",
        },
    ],
    build: |p| Ok(Arc::new(Dielectric::from_params(p)?)),
    samples,
};

fn samples() -> Vec<Params> {
    let glass = |eta, roughness| {
        Params::new().with("eta", Value::Number(eta)).with("roughness", Value::Number(roughness))
    };
    vec![
        Params::new(),
        glass(1.33, 0.0).with("tint", Value::Numbers(vec![0.9, 0.5, 0.0])),
        // An air bubble, diamond, and what is hardly there.
        glass(0.75, 0.0),
        glass(1.0, 0.0),
        glass(1.5, 0.03),
        glass(1.5, 0.3),
        glass(1.5, 0.6).with("tint", Value::Number(0.5)),
        glass(1.5, 1.0),
        glass(0.7, 0.5),
        glass(2.4, 0.4),
        glass(1.02, 0.7),
        glass(1.0, 0.7),
    ]
}

/// A rough surface bends light by about alpha (eta - 1). Below this, f32 no longer tells facets apart by where they
/// send it (a half vector's rounding, 1e-7, is a thousandth of it), and the surface counts as smooth.
const LEAST_BEND: f32 = 1e-4;

struct Dielectric {
    eta: f32,
    tint: Reflectance,
    rough: Option<Rough>,
}

struct Rough {
    ggx: Ggx,
    /// From above and from below, at the cosines of [`cosine`].
    shares: [[Shares; CELLS + 1]; 2],
}

/// How the light that reaches a boundary is shared out. Together 1, or less where facets hide each other.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Shares {
    reflected: f32,
    refracted: f32,
}

impl Shares {
    /// Fresnel's equations for unpolarised light (Born and Wolf, "Principles of Optics", 1.5.2), from the cosines on
    /// both sides, in [0, 1]; `eta` is the index on the second side over that on the first. Each share in a form that
    /// loses no digits where it is small.
    #[inline]
    fn at(cos: f32, cos_t: f32, eta: f32) -> Shares {
        let (p, s) = (1.0 / (eta * cos + cos_t), 1.0 / (cos + eta * cos_t));
        let (rp, rs) = ((eta * cos - cos_t) * p, (cos - eta * cos_t) * s);
        let refracted = (2.0 * eta * cos * cos_t * (p * p + s * s)).min(1.0);
        Shares { reflected: (0.5 * (rp * rp + rs * rs)).min(1.0), refracted }
    }

    /// All that arrives beyond the critical angle is reflected.
    const TOTAL_REFLECTION: Shares = Shares { reflected: 1.0, refracted: 0.0 };
}

/// The cosine on the other side (Snell); None beyond the critical angle.
#[inline]
fn refracted_cosine(cos: f32, eta: f32) -> Option<f32> {
    let sin2 = (1.0 - cos) * (1.0 + cos) / (eta * eta);
    (sin2 < 1.0).then(|| (1.0 - sin2.max(0.0)).sqrt())
}

/// [`Shares::at`] for a cosine in (0, 1] on the first side, and the cosine on the other.
#[inline]
fn fresnel(cos: f32, eta: f32) -> (Shares, f32) {
    match refracted_cosine(cos, eta) {
        Some(cos_t) => (Shares::at(cos, cos_t, eta), cos_t),
        None => (Shares::TOTAL_REFLECTION, 0.0),
    }
}

/// `w` as it goes on behind a facet with unit normal `h`: `cos` is w . h, and `cos_t` that on the other side.
#[inline]
fn refract(w: Vec3, h: Vec3, [cos, cos_t]: [f32; 2], eta: f32) -> Vec3 {
    (h * (cos / eta - cos_t) - w / eta).normalize()
}

/// A viewer above the boundary: the real one, or mirrored from below, with the relative index it meets.
#[derive(Clone, Copy)]
struct View {
    wo: Vec3,
    /// In f64, so that the way back has the inverse of it: cosines of grazing facets tell.
    eta64: f64,
    eta: f32,
    /// -1 if mirrored.
    side: f32,
}

impl View {
    /// None along the surface.
    #[inline]
    fn new(wo: Vec3, eta: f32) -> Option<View> {
        let side = 1f32.copysign(wo.z);
        let eta64 = if wo.z < 0.0 { 1.0 / f64::from(eta) } else { f64::from(eta) };
        let up = Vec3::new(wo.x, wo.y, wo.z * side);
        (up.z >= MIN_COS).then_some(View { wo: up, eta64, eta: eta64 as f32, side })
    }

    #[inline]
    fn turn(&self, w: Vec3) -> Vec3 {
        Vec3::new(w.x, w.y, w.z * self.side)
    }
}

impl Rough {
    fn new(ggx: Ggx, eta: f32) -> Rough {
        let row = |eta| std::array::from_fn(|i| average(&ggx, cosine(i as f32), eta));
        Rough { ggx, shares: [row(eta), row(1.0 / eta)] }
    }

    /// `tint` colours what passes.
    #[inline]
    fn evaluate(&self, view: &View, wi: Vec3, tint: Rgb) -> BsdfEval {
        if wi.z > 0.0 { self.reflected(view, wi) } else { self.refracted(view, wi, tint) }
    }

    #[inline]
    fn reflected(&self, &View { wo, eta, .. }: &View, wi: Vec3) -> BsdfEval {
        if wi.z < MIN_COS {
            return BsdfEval::default();
        }
        let Some(facet) = self.ggx.facet(wo, wi) else { return BsdfEval::default() };
        // Walter eq. 20.
        let d = facet.d * fresnel(facet.cos, eta).0.reflected;
        BsdfEval {
            f_cos: Rgb::splat(d * self.ggx.masking_over_4cos(wo, wi) * wi.z),
            pdf: d * self.ggx.visible_over_4cos(wo),
        }
    }

    #[inline]
    fn refracted(&self, &View { wo, eta64, eta, .. }: &View, wi: Vec3, tint: Rgb) -> BsdfEval {
        if wi.z > -MIN_COS {
            return BsdfEval::default();
        }
        // Walter eq. 16; along or against it, so that it points up. In f64: the cosines cancel for grazing facets.
        let (wo64, wi64) = (wo.as_dvec3(), wi.as_dvec3());
        let h = wo64 + wi64 * eta64;
        let l2 = h.length_squared();
        // The shortest is |eta - 1|, which LEAST_BEND bounds; its square then is above this by a factor of 100.
        if l2 < 1e-10 {
            return BsdfEval::default();
        }
        let h = h * 1f64.copysign(h.z);
        let l = l2.sqrt();
        let (cos, cos_t) = ((wo64.dot(h) / l) as f32, (-wi64.dot(h) / l) as f32);
        // A facet refracts from its front to its back alone.
        if cos <= 0.0 || cos_t <= 0.0 {
            return BsdfEval::default();
        }
        let (h, l2) = (h.as_vec3(), l2 as f32);
        // Walter eq. 17: facets per direction, where (wo.m + eta wi.m)^2 is |h|^2; times 4 for what masking is over.
        let facets = 4.0 * self.ggx.density(h, l2) * cos * cos_t * (eta * eta / l2);
        // From both cosines, which are exact by how h is made: the same, then, for light that goes backwards.
        let d = facets * Shares::at(cos.min(1.0), cos_t.min(1.0), eta).refracted;
        let below = Vec3::new(wi.x, wi.y, -wi.z);
        // Walter eq. 21 over eta^2, for radiance.
        let radiance = d * self.ggx.masking_over_4cos(wo, below) * below.z / (eta * eta);
        BsdfEval { f_cos: tint * radiance, pdf: d * self.ggx.visible_over_4cos(wo) }
    }

    /// A direction, above or below.
    #[inline]
    fn draw(&self, &View { wo, eta, .. }: &View, u: [f32; 2], uc: f32) -> Option<Vec3> {
        let h = self.ggx.sample_visible(wo, u)?;
        let cos = wo.dot(h).min(1.0);
        if cos <= 0.0 {
            return None;
        }
        let (shares, cos_t) = fresnel(cos, eta);
        // What leaves to the wrong side would meet the surface again: it is lost, as in all models without such light.
        match uc < shares.reflected {
            true => Some(reflect(wo, h)).filter(|wi| wi.z > 0.0),
            false => Some(refract(wo, h, [cos, cos_t], eta)).filter(|wi| wi.z < 0.0),
        }
    }

    fn shares(&self, view: &View) -> Shares {
        let row = &self.shares[usize::from(view.side < 0.0)];
        let x = view.wo.z.min(1.0).sqrt() * CELLS as f32;
        let i = (x as usize).min(CELLS - 1);
        let lerp = |a: f32, b: f32| a + (b - a) * (x - i as f32);
        Shares {
            reflected: lerp(row[i].reflected, row[i + 1].reflected),
            refracted: lerp(row[i].refracted, row[i + 1].refracted),
        }
    }
}

/// Cells of the tables of shares, for albedo alone.
const CELLS: usize = 24;

/// Ends of cells are closer towards grazing, where shares change fastest.
fn cosine(i: f32) -> f32 {
    let x = i / CELLS as f32;
    (x * x).max(1e-4)
}

/// What facets reflect and refract of light from this cosine: an average over a Fibonacci lattice.
fn average(ggx: &Ggx, mu: f32, eta: f32) -> Shares {
    const COUNT: u32 = 610;
    let wo = Vec3::new(((1.0 - mu) * (1.0 + mu)).sqrt(), 0.0, mu);
    let mut sum = Shares::default();
    for i in 0..COUNT {
        let u = [i * 377 % COUNT, i].map(|k| (k as f32 + 0.5) / COUNT as f32);
        let Some(h) = ggx.sample_visible(wo, u) else { continue };
        let cos = wo.dot(h).clamp(0.0, 1.0);
        let (shares, cos_t) = fresnel(cos, eta);
        let (up, down) = (reflect(wo, h), refract(wo, h, [cos, cos_t], eta));
        if up.z > MIN_COS {
            sum.reflected += shares.reflected * ggx.weight(wo, up);
        }
        if down.z < -MIN_COS && shares.refracted > 0.0 {
            sum.refracted += shares.refracted * ggx.weight(wo, Vec3::new(down.x, down.y, -down.z));
        }
    }
    Shares { reflected: sum.reflected / COUNT as f32, refracted: sum.refracted / COUNT as f32 }
}

impl Dielectric {
    fn from_params(p: &Params) -> Result<Self> {
        let eta = p.number_or("eta", 1.5)?.clamp(0.1, 10.0) as f32;
        let roughness = p.number_or("roughness", 0.0)?.clamp(0.0, 1.0) as f32;
        let ggx = Ggx::new(roughness, 0.0);
        let is_rough = roughness > 0.0 && ggx.ax * (eta - 1.0).abs() >= LEAST_BEND;
        Ok(Dielectric {
            eta,
            tint: Reflectance::from_params(p, "tint", [1.0; 3])?,
            rough: is_rough.then(|| Rough::new(ggx, eta)),
        })
    }

    /// The smooth boundary's two directions.
    #[inline]
    fn sample_smooth(view: &View, uc: f32, tint: Rgb) -> BsdfSample {
        let &View { wo, eta, .. } = view;
        let (shares, cos_t) = fresnel(wo.z.min(1.0), eta);
        if uc < shares.reflected {
            let wi = view.turn(Vec3::new(-wo.x, -wo.y, wo.z));
            return BsdfSample { wi, weight: Rgb::WHITE, pdf: shares.reflected, delta: true };
        }
        let wi = view.turn(Vec3::new(-wo.x / eta, -wo.y / eta, -cos_t).normalize());
        BsdfSample { wi, weight: tint / (eta * eta), pdf: shares.refracted, delta: true }
    }
}

impl Material for Dielectric {
    fn needs(&self) -> Needs {
        self.tint.needs()
    }

    fn prepare(&self, vertex: &Vertex, out: &mut Prepared) {
        *out.view_mut::<Rgb>() = self.tint.at(vertex);
    }

    fn prepared_everywhere(&self) -> Option<Prepared> {
        self.tint.constant().map(Prepared::of)
    }

    fn eval(&self, m: &Prepared, wo: Vec3, wi: Vec3) -> BsdfEval {
        match (&self.rough, View::new(wo, self.eta)) {
            (Some(rough), Some(view)) => rough.evaluate(&view, view.turn(wi), *m.view()),
            _ => BsdfEval::default(),
        }
    }

    fn sample(&self, m: &Prepared, wo: Vec3, u: [f32; 2], uc: f32) -> Option<BsdfSample> {
        let view = View::new(wo, self.eta)?;
        let Some(rough) = &self.rough else {
            return Some(Self::sample_smooth(&view, uc, *m.view())).filter(|s| s.pdf > 0.0 && s.wi.z != 0.0);
        };
        let wi = rough.draw(&view, u, uc)?;
        let e = rough.evaluate(&view, wi, *m.view());
        let wi = view.turn(wi);
        (e.pdf > 0.0).then(|| BsdfSample { wi, weight: e.f_cos / e.pdf, pdf: e.pdf, delta: false })
    }

    fn albedo(&self, m: &Prepared, wo: Vec3) -> Rgb {
        let Some(view) = View::new(wo, self.eta) else { return Rgb::WHITE };
        let shares = match &self.rough {
            Some(rough) => rough.shares(&view),
            None => fresnel(view.wo.z.min(1.0), view.eta).0,
        };
        *m.view::<Rgb>() * shares.refracted + Rgb::splat(shares.reflected)
    }

    fn is_delta(&self) -> bool {
        self.rough.is_none()
    }

    fn transmission(&self) -> Option<Transmission> {
        Some(Transmission { eta: self.eta })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fresnel_has_its_closed_forms() {
        for eta in [0.4f32, 1.0 / 1.5, 1.0, 1.33, 1.5, 2.4] {
            let normal = ((eta - 1.0) / (eta + 1.0)).powi(2);
            // A few roundings of numbers of size 1, squared.
            assert!((fresnel(1.0, eta).0.reflected - normal).abs() < 1e-6, "{eta}");
            for i in 1..=1000 {
                let cos = i as f32 / 1000.0;
                let (f, cos_t) = fresnel(cos, eta);
                assert!((f.reflected + f.refracted - 1.0).abs() < 1e-6, "{eta} {cos}: {f:?}");
                // The same way back: both directions of one ray lose alike (Stokes).
                if f.refracted > 0.0 {
                    let back = Shares::at(cos_t, cos, 1.0 / eta);
                    assert!((back.refracted / f.refracted - 1.0).abs() < 2e-6, "{eta} {cos}: {f:?} {back:?}");
                }
            }
            // Brewster's angle: tan = eta; what is polarised along the plane of incidence passes whole, so half of
            // cos^2(2 theta) is left.
            let cos = 1.0 / (1.0 + eta * eta).sqrt();
            let left = 0.5 * ((1.0 - eta * eta) / (1.0 + eta * eta)).powi(2);
            assert!((fresnel(cos, eta).0.reflected - left).abs() < 1e-6, "{eta}");
        }
        // Beyond the critical angle sin = eta.
        let critical = (1.0f32 - 1.0 / 2.25).sqrt();
        assert_eq!(fresnel(critical * 0.999, 1.0 / 1.5).0, Shares::TOTAL_REFLECTION);
        assert!(fresnel(critical * 1.001, 1.0 / 1.5).0.refracted > 0.0);
    }

    /// What single bounces lose under light from everywhere: known, and none where facets are nearly flat. Prints.
    #[test]
    fn rough_glass_loses_no_more_than_facets_hide() {
        // From inside more is lost: beyond the critical angle a tilted facet still refracts, along the surface, where
        // others stand.
        let roughness = [0.1, 0.3, 0.5, 0.7, 1.0];
        for (eta, most) in
            [(1.5f32, [2e-3, 0.015, 0.04, 0.1, 0.25]), (1.0 / 1.5, [5e-3, 0.04, 0.17, 0.35, 0.6])]
        {
            for (roughness, most) in roughness.into_iter().zip(most) {
                let rough = Rough::new(Ggx::new(roughness, 0.0), eta);
                let at = |i: usize| {
                    let mu = (i as f32 + 0.5) / 64.0;
                    let s = rough
                        .shares(&View::new(Vec3::new((1.0 - mu * mu).sqrt(), 0.0, mu), eta).expect("above"));
                    // The lattice's error.
                    assert!(s.reflected + s.refracted < 1.005, "{eta} {roughness} {mu}: {s:?}");
                    (1.0 - s.reflected - s.refracted) * 2.0 * mu / 64.0
                };
                let lost: f32 = (0..64).map(at).sum();
                println!("eta {eta:.2}, roughness {roughness}: loses {:.2} %", 100.0 * lost);
                assert!(lost < most && lost > -2e-3, "{eta} {roughness}: {lost}");
            }
        }
    }

    #[test]
    fn light_bends_as_snell_says() {
        let n = Vec3::Z;
        for eta in [1.0 / 1.5f32, 1.33, 1.5, 2.4] {
            for i in 0..50 {
                let theta = (i as f32 * 1.8).to_radians();
                let wo = Vec3::new(theta.sin() * 0.6, theta.sin() * 0.8, theta.cos());
                let Some(cos_t) = refracted_cosine(wo.z, eta) else { continue };
                let wi = refract(wo, n, [wo.z, cos_t], eta);
                // sin = eta sin_t, in one plane, on the other side.
                let error = (wo.truncate() + wi.truncate() * eta).length();
                assert!(error < 1e-6 && wi.z <= 0.0, "{eta} {wo}: {wi}");
            }
        }
    }
}
