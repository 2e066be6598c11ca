//! What materials of a diffuse base and one glossy lobe share: parameters, the choice between the two, and sampling.

use crate::base::material::{BsdfEval, BsdfSample, Emitter, Material, Prepared, Scattering, Transmission};
use crate::base::registry::{ParamKind, ParamSpec, Params};
use crate::base::shape::Needs;
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::error::Result;
use crate::materials::reflectance::Reflectance;
use crate::sampling::warp::{
    UNIFORM_HEMISPHERE_PDF, cosine_hemisphere, cosine_hemisphere_pdf, uniform_hemisphere,
};
use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};

/// A glossy lobe. Directions lie above the surface (z > 0) unless a method says otherwise.
pub(super) trait Lobe: Send + Sync {
    /// f cos, as the factor of the specular colour and as white that comes on top.
    fn f_cos(&self, wo: Vec3, wi: Vec3) -> LobeValue;

    /// Density per solid angle of [`Lobe::sample`].
    fn pdf(&self, wo: Vec3, wi: Vec3) -> f32;

    /// Draws a direction, which may lie below the surface: what it would bring is lost.
    fn sample(&self, wo: Vec3, u: [f32; 2]) -> Option<Vec3>;

    /// Width of the GGX distribution of facets that comes near to it.
    fn alpha(&self) -> f32;

    /// Whether the lobe brings something where the specular colour is black.
    fn has_white(&self) -> bool {
        false
    }
}

/// See [`Lobe::f_cos`].
#[derive(Debug, Clone, Copy)]
pub(super) struct LobeValue {
    /// Factor of the specular colour.
    pub colored: f32,
    /// On top of it, in every channel.
    pub white: f32,
}

/// How directions are drawn. All estimate the same; the poorer ones make the noise of programs that drew so.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sampling {
    Brdf,
    Cosine,
    Hemisphere,
}

pub(super) const DIFFUSE: ParamSpec = ParamSpec {
    name: "diffuse",
    kind: ParamKind::Texture,
    default: Some("0.5"),
    doc: "share of the light that is scattered evenly, 0 to 1",
};

pub(super) const SPECULAR: ParamSpec = ParamSpec {
    name: "specular",
    kind: ParamKind::Texture,
    default: Some("0.5"),
    doc: "colour of the glossy lobe, 0 to 1",
};

pub(super) const SHININESS: ParamSpec = ParamSpec {
    name: "shininess",
    kind: ParamKind::Number { min: 0.0, max: 1e6 },
    default: Some("20"),
    doc: "exponent of the glossy lobe: the higher, the narrower",
};

pub(super) const AMBIENT: ParamSpec = ParamSpec {
    name: "ambient",
    kind: ParamKind::Color,
    default: Some("0"),
    doc: "radiance that classic ray tracers show of the surface and that lights nothing",
};

pub(super) const EMISSION: ParamSpec = ParamSpec {
    name: "emission",
    kind: ParamKind::Color,
    default: Some("0"),
    doc: "radiance emitted from both sides, W sr^-1 m^-2",
};

pub(super) const SAMPLING: ParamSpec = ParamSpec {
    name: "sampling",
    kind: ParamKind::Choice(&["brdf", "cosine", "hemisphere"]),
    default: Some("brdf"),
    doc: "how directions are drawn: by the material, by the cosine, or evenly; all have the same mean",
};

/// How a kind differs from the usual.
#[derive(Debug, Clone, Copy)]
pub(super) struct Style {
    /// f cos of the diffuse base per cosine and reflectance: 1 / pi, but for looks that leave it out.
    pub diffuse_scale: f32,
    /// Whether the back looks as the front does. If not, the viewer may stand behind what the front is lit by.
    pub two_sided: bool,
    /// Whether a classic ray tracer adds the mirror's picture in the specular colour.
    pub mirrors: bool,
    /// See [`Material::is_physical`].
    pub physical: bool,
}

/// The material.
pub(super) struct Glossy<L> {
    diffuse: Reflectance,
    specular: Reflectance,
    ambient: Rgb,
    emission: Rgb,
    sampling: Sampling,
    lobe: L,
    style: Style,
}

/// A vertex' colours.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct At {
    diffuse: Rgb,
    specular: Rgb,
    /// Probability of drawing from the lobe.
    share: f32,
}

impl<L: Lobe> Glossy<L> {
    pub fn from_params(p: &Params, lobe: L, style: Style) -> Result<Self> {
        Ok(Glossy {
            diffuse: Reflectance::from_params(p, "diffuse", [0.5; 3])?,
            specular: Reflectance::from_params(p, "specular", [0.5; 3])?,
            ambient: p.color_or("ambient", [0.0; 3])?,
            emission: p.color_or("emission", [0.0; 3])?,
            sampling: match p.text_or("sampling", "brdf")? {
                "cosine" => Sampling::Cosine,
                "hemisphere" => Sampling::Hemisphere,
                _ => Sampling::Brdf,
            },
            lobe,
            style,
        })
    }

    fn at(&self, diffuse: Rgb, specular: Rgb) -> At {
        let (d, s) = (diffuse.luminance(), specular.luminance());
        let least = if self.lobe.has_white() { 0.1 } else { 0.0 };
        let share = if d + s > 0.0 { (s / (d + s)).max(least) } else { 1.0 };
        At { diffuse, specular, share }
    }

    /// Both directions as seen from the front, if the back looks the same; None where nothing is scattered.
    #[inline]
    fn upright(&self, wo: Vec3, wi: Vec3) -> Option<(Vec3, Vec3)> {
        let side = self.side(wo);
        let (wo, wi) = (wo * side, wi * side);
        // Without a back, light from the front shows on both sides.
        (wi.z > 0.0 && (wo.z > 0.0 || !self.style.two_sided)).then_some((wo, wi))
    }

    #[inline]
    fn side(&self, wo: Vec3) -> f32 {
        if self.style.two_sided && wo.z < 0.0 { -1.0 } else { 1.0 }
    }

    #[inline]
    fn pdf(&self, how: Sampling, m: &At, wo: Vec3, wi: Vec3) -> f32 {
        match how {
            Sampling::Cosine => cosine_hemisphere_pdf(wi.z),
            Sampling::Brdf if wo.z > 0.0 => {
                (1.0 - m.share) * cosine_hemisphere_pdf(wi.z) + m.share * self.lobe.pdf(wo, wi)
            }
            // Seen from behind, a highlight without a cosine may lie anywhere, also at grazing.
            Sampling::Brdf | Sampling::Hemisphere => UNIFORM_HEMISPHERE_PDF,
        }
    }

    #[inline]
    fn f_cos(&self, m: &At, wo: Vec3, wi: Vec3) -> Rgb {
        let base = m.diffuse * (self.style.diffuse_scale * wi.z);
        if wo.z <= 0.0 && self.style.two_sided {
            return base;
        }
        let lobe = self.lobe.f_cos(wo, wi);
        base + m.specular * lobe.colored + Rgb::splat(lobe.white)
    }

    #[inline]
    fn draw(&self, how: Sampling, m: &At, wo: Vec3, u: [f32; 2], uc: f32) -> Option<Vec3> {
        match how {
            Sampling::Brdf if wo.z > 0.0 && uc < m.share => self.lobe.sample(wo, u),
            Sampling::Brdf if wo.z > 0.0 => Some(cosine_hemisphere(u.into())),
            Sampling::Cosine => Some(cosine_hemisphere(u.into())),
            Sampling::Brdf | Sampling::Hemisphere => Some(uniform_hemisphere(u.into())),
        }
    }

    fn sample_by(&self, how: Sampling, m: &At, wo: Vec3, u: [f32; 2], uc: f32) -> Option<BsdfSample> {
        let side = self.side(wo);
        let wo = wo * side;
        if self.style.two_sided && wo.z <= 0.0 {
            return None;
        }
        let wi = self.draw(how, m, wo, u, uc)?;
        if wi.z <= 0.0 {
            return None;
        }
        let pdf = self.pdf(how, m, wo, wi);
        let weight = self.f_cos(m, wo, wi) / pdf;
        (pdf > 0.0 && weight.is_finite()).then(|| BsdfSample { wi: wi * side, weight, pdf, delta: false })
    }
}

impl<L: Lobe> Material for Glossy<L> {
    fn needs(&self) -> Needs {
        self.diffuse.needs().or(self.specular.needs())
    }

    fn prepare(&self, vertex: &Vertex, out: &mut Prepared) {
        *out.view_mut() = self.at(self.diffuse.at(vertex), self.specular.at(vertex));
    }

    fn prepared_everywhere(&self) -> Option<Prepared> {
        let colors = self.diffuse.constant().zip(self.specular.constant());
        colors.map(|(diffuse, specular)| Prepared::of(self.at(diffuse, specular)))
    }

    #[inline]
    fn eval(&self, m: &Prepared, wo: Vec3, wi: Vec3) -> BsdfEval {
        let Some((wo, wi)) = self.upright(wo, wi) else { return BsdfEval::default() };
        let m = m.view::<At>();
        BsdfEval { f_cos: self.f_cos(m, wo, wi), pdf: self.pdf(self.sampling, m, wo, wi) }
    }

    fn picks_lobe(&self) -> bool {
        self.sampling == Sampling::Brdf
    }

    fn sample(&self, m: &Prepared, wo: Vec3, u: [f32; 2], uc: f32) -> Option<BsdfSample> {
        self.sample_by(self.sampling, m.view::<At>(), wo, u, uc)
    }

    fn albedo(&self, m: &Prepared, wo: Vec3) -> Rgb {
        // A coarse grid over the sampler: albedo is asked for once a path at most.
        const N: usize = 16;
        let cell = |i: usize| (i as f32 + 0.5) / N as f32;
        let mut rotation = 0.5f32;
        let mut sum = Rgb::BLACK;
        for (i, j) in (0..N).flat_map(|i| (0..N).map(move |j| (i, j))) {
            // Golden-ratio steps, so that the choice of the lobe is spread over the grid.
            rotation = (rotation + 0.618_034).fract();
            if let Some(s) = self.sample_by(Sampling::Brdf, m.view(), wo, [cell(i), cell(j)], rotation) {
                sum += s.weight;
            }
        }
        sum / (N * N) as f32
    }

    fn scattering(&self, m: &Prepared) -> Option<Scattering> {
        let m = m.view::<At>();
        // White on top is Fresnel's, which is little but at grazing.
        let white = if self.lobe.has_white() { 0.05 } else { 0.0 };
        Some(Scattering {
            even: m.diffuse.luminance() * self.style.diffuse_scale,
            facets: m.specular.luminance() + white,
            alpha: self.lobe.alpha(),
        })
    }

    fn diffuse(&self, m: &Prepared) -> Rgb {
        m.view::<At>().diffuse
    }

    fn is_physical(&self) -> bool {
        self.style.physical
    }

    fn transmission(&self) -> Option<Transmission> {
        (!self.style.two_sided).then_some(Transmission { eta: 1.0 })
    }

    fn ambient(&self, _m: &Prepared) -> Rgb {
        self.ambient
    }

    fn mirrored(&self, m: &Prepared, _wo: Vec3) -> Rgb {
        if self.style.mirrors { m.view::<At>().specular } else { Rgb::BLACK }
    }

    fn is_black(&self) -> bool {
        self.diffuse.is_black() && self.specular.is_black() && !self.lobe.has_white()
    }

    fn emission(&self, _uv: Vec2, _cos_o: f32) -> Rgb {
        self.emission
    }

    fn emitter(&self) -> Option<Emitter> {
        (!self.emission.is_black()).then_some(Emitter { mean: self.emission, two_sided: true, uniform: true })
    }
}
