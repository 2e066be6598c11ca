//! How a surface scatters and emits, in the local frame of its shading normal (z).

use crate::base::directions::{DirectionLanes, LANES};
use crate::base::lanes::{Columns, LANES as MANY};
use crate::base::shape::Needs;
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use bytemuck::{Pod, Zeroable};
use glam::{Vec2, Vec3};

/// Room for what a material wants to keep of a vertex: textures are read once, by [`Material::prepare`], into a
/// plain struct of the material's own, which is viewed through [`Prepared::view`].
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C, align(16))]
pub struct Prepared([f32; 24]);

impl Default for Prepared {
    fn default() -> Self {
        Prepared([0.0; 24])
    }
}

impl Prepared {
    /// The material's own struct, kept. Panics as [`Prepared::view`].
    pub fn of<T: Pod>(own: T) -> Self {
        let mut out = Prepared::default();
        *out.view_mut() = own;
        out
    }

    /// The material's own struct. Panics (at the first use, in any test) if it is larger than the room.
    #[inline]
    pub fn view<T: Pod>(&self) -> &T {
        bytemuck::from_bytes(&bytemuck::bytes_of(self)[..size_of::<T>()])
    }

    /// As [`Prepared::view`], to write.
    #[inline]
    pub fn view_mut<T: Pod>(&mut self) -> &mut T {
        bytemuck::from_bytes_mut(&mut bytemuck::bytes_of_mut(self)[..size_of::<T>()])
    }
}

/// A direction sampled from a material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BsdfSample {
    /// Local direction, away from the surface.
    pub wi: Vec3,
    /// f cos / pdf: what the throughput is multiplied by.
    pub weight: Rgb,
    /// Density per solid angle; for a delta lobe its probability.
    pub pdf: f32,
    /// Whether the direction comes from a Dirac lobe, which no light sample can meet.
    pub delta: bool,
}

/// How a surface scatters, as far as a light is told of it when it chooses a direction: an even part, and facets about
/// the shading normal. It guides sampling, and may be wrong by any factor at the cost of variance alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scattering {
    /// f of the part that scatters evenly, per steradian.
    pub even: f32,
    /// Reflectance of the facets; 0 where there are none.
    pub facets: f32,
    /// Width of the facets' distribution (GGX alpha).
    pub alpha: f32,
}

impl Scattering {
    /// Evenly.
    pub const EVEN: Scattering = Scattering { even: 1.0, facets: 0.0, alpha: 1.0 };
}

/// Value and density of a pair of directions.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BsdfEval {
    /// f times |cos| of `wi` at the shading normal.
    pub f_cos: Rgb,
    /// Density per solid angle of [`Material::sample`].
    pub pdf: f32,
}

/// Values and densities of one direction with a few others, as columns.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(32))]
pub struct BsdfLanes {
    /// See [`BsdfEval::f_cos`]; a column for each channel.
    pub f_cos: [[f32; LANES]; 3],
    /// See [`BsdfEval::pdf`].
    pub pdf: [f32; LANES],
}

/// Samples for several points of one material, as columns.
#[derive(Debug, Clone, Copy, Default)]
pub struct SampleLanes {
    /// See [`BsdfSample::wi`].
    pub wi: Columns<f32>,
    /// See [`BsdfSample::weight`]; black where the path ends.
    pub weight: Columns<f32>,
    /// See [`BsdfSample::pdf`].
    pub pdf: [f32; MANY],
    /// See [`BsdfSample::delta`].
    pub delta: [bool; MANY],
}

impl SampleLanes {
    /// One of them; None if the path ends there.
    #[inline]
    pub fn get(&self, lane: usize) -> Option<BsdfSample> {
        let weight = Rgb::from(self.weight.get(lane).to_array());
        let (wi, pdf, delta) = (self.wi.get(lane), self.pdf[lane], self.delta[lane]);
        (!weight.is_black()).then_some(BsdfSample { wi, weight, pdf, delta })
    }
}

/// Scattering and emission. All directions are local (z is the shading normal), of unit length and away from the
/// surface; `wo` may lie below (z < 0) when the surface is seen from behind.
pub trait Material: Send + Sync {
    /// What [`Material::prepare`] and the emission read of a vertex.
    fn needs(&self) -> Needs {
        Needs::default()
    }

    /// Reads textures at the vertex into `out`, once.
    fn prepare(&self, vertex: &Vertex, out: &mut Prepared);

    /// What [`Material::prepare`] makes of every vertex, if that is the same everywhere: then it is not asked.
    fn prepared_everywhere(&self) -> Option<Prepared> {
        None
    }

    /// f |cos| and density for a pair of directions; zero for delta lobes.
    fn eval(&self, m: &Prepared, wo: Vec3, wi: Vec3) -> BsdfEval;

    /// [`Material::eval`] of each `wi`, bit for bit. Those that are zero mean nothing, nor does what is made of them.
    fn eval_many(&self, m: &Prepared, wo: Vec3, wi: &DirectionLanes) -> BsdfLanes {
        let mut out = BsdfLanes::default();
        for k in (0..LANES).filter(|&k| wi.get(k) != Vec3::ZERO) {
            let e = self.eval(m, wo, wi.get(k));
            [out.f_cos[0][k], out.f_cos[1][k], out.f_cos[2][k]] = e.f_cos.to_array();
            out.pdf[k] = e.pdf;
        }
        out
    }

    /// Whether [`Material::sample`] reads `uc` at all; if not, none is made.
    fn picks_lobe(&self) -> bool {
        true
    }

    /// Samples `wi`. `uc` picks a lobe where there are several. None if the path ends here.
    fn sample(&self, m: &Prepared, wo: Vec3, u: [f32; 2], uc: f32) -> Option<BsdfSample>;

    /// [`Material::sample`] of each of the first `n` viewers, bit for bit, by a column for each number; what other lanes hold
    /// means nothing.
    fn sample_many(
        &self,
        m: &Prepared,
        wo: &Columns<f32>,
        u: &[[f32; MANY]; 2],
        uc: &[f32; MANY],
        n: usize,
    ) -> SampleLanes {
        let mut out = SampleLanes::default();
        for k in 0..n.min(MANY) {
            if let Some(s) = self.sample(m, wo.get(k), [u[0][k], u[1][k]], uc[k]) {
                out.wi.set(k, s.wi);
                out.weight.set(k, s.weight.to_array().into());
                (out.pdf[k], out.delta[k]) = (s.pdf, s.delta);
            }
        }
        out
    }

    /// Whether [`Material::sample_many`] is faster than a call for each.
    fn samples_together(&self) -> bool {
        false
    }

    /// Reflectance for light from everywhere, seen from `wo`: an estimate good to some percent, for AOVs and
    /// decisions, not for radiometry.
    fn albedo(&self, m: &Prepared, wo: Vec3) -> Rgb;

    /// What lights may know of it. None where that is not known: lights take it for even, and light samples alone are
    /// never trusted with it, as they might miss a narrow lobe.
    fn scattering(&self, _m: &Prepared) -> Option<Scattering> {
        None
    }

    /// Reflectance of the part that scatters evenly (Lambert), for closed forms; black where there is none.
    fn diffuse(&self, _m: &Prepared) -> Rgb {
        Rgb::BLACK
    }

    /// Whether it keeps the laws: light may travel backwards, and no more leaves than arrives. The looks of some old
    /// programs do not, and say so.
    fn is_physical(&self) -> bool {
        true
    }

    /// Radiance that the surface shows of itself to a classic ray tracer, without shining on anything.
    fn ambient(&self, _m: &Prepared) -> Rgb {
        Rgb::BLACK
    }

    /// The share of what lies in the mirror direction that a classic ray tracer adds to what [`Material::eval`] gives,
    /// seen from `wo`; black for materials that reflect by [`Material::sample`] alone.
    fn mirrored(&self, _m: &Prepared, _wo: Vec3) -> Rgb {
        Rgb::BLACK
    }

    /// Whether it scatters by Dirac lobes alone, so that sampling lights is in vain.
    fn is_delta(&self) -> bool {
        false
    }

    /// What light that passes to the other side meets there; None if all that is scattered stays on its own side.
    /// Lights are then asked for light from everywhere, and radiance is measured per eta^2 where it is compared.
    fn transmission(&self) -> Option<Transmission> {
        None
    }

    /// Whether nothing leaves by scattering at all.
    fn is_black(&self) -> bool {
        false
    }

    /// Radiance emitted towards a viewer, where the material emits; `cos_o` is the cosine between the viewer and
    /// the geometric normal (negative from behind).
    fn emission(&self, _uv: Vec2, _cos_o: f32) -> Rgb {
        Rgb::BLACK
    }

    /// Mean emitted radiance over the surface, and whether it emits from both sides; None if it emits nothing.
    fn emitter(&self) -> Option<Emitter> {
        None
    }
}

/// A boundary that light passes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Transmission {
    /// Refractive index below the surface (z < 0) over that above; 1 where both sides are alike, as at a sheet of paper.
    pub eta: f32,
}

impl Transmission {
    /// Squared index on the side of `wi` over that on the side of `wo`. Radiance that crosses a boundary without loss
    /// changes by this factor, so f(wo, wi) times it is what f(wi, wo) is (Veach, "Robust Monte Carlo Methods for Light
    /// Transport Simulation", 1997, 5.2).
    #[inline]
    pub fn eta2(&self, wo: Vec3, wi: Vec3) -> f32 {
        match (wo.z < 0.0, wi.z < 0.0) {
            (false, true) => self.eta * self.eta,
            (true, false) => 1.0 / (self.eta * self.eta),
            _ => 1.0,
        }
    }
}

/// What the light list has to know of an emitting material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Emitter {
    /// Mean radiance.
    pub mean: Rgb,
    /// Whether the back emits as the front does.
    pub two_sided: bool,
    /// Whether the radiance is the same all over the surface and in all directions.
    pub uniform: bool,
}
