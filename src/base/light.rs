//! Where light comes from. A sky is a light like any other; a path that leaves the scene has met it.

use crate::base::directions::{DirectionLanes, Directions, LANES};
use crate::base::material::Scattering;
use crate::base::space::RenderSpace;
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::error::Result;
use crate::math::aabb::Aabb;
use glam::Vec3;
use std::sync::Arc;

/// The point that asks for light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Receiver {
    /// Where.
    pub p: Vec3,
    /// Unit geometric normal towards the side that is lit, or zero if any direction may be.
    pub ng: Vec3,
    /// Unit shading normal of that side, or zero.
    pub ns: Vec3,
}

impl Receiver {
    /// Stands where none is asked about.
    pub const NOWHERE: Receiver = Receiver { p: Vec3::ZERO, ng: Vec3::ZERO, ns: Vec3::ZERO };
}

/// Light arriving along a sampled direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightSample {
    /// Unit direction towards the light.
    pub wi: Vec3,
    /// Distance to it; infinite for the sky.
    pub dist: f32,
    /// Radiance arriving (for a delta light: irradiance at normal incidence), before anything blocks it. None from a
    /// light at infinity whose radiance is dear to look up: it is asked for all directions that are not blocked
    /// together, by [`Light::le_escaped`].
    pub li: Option<Rgb>,
    /// Density per solid angle; 1 for a delta light.
    pub pdf: f32,
    /// Whether no other way of sampling can meet this light.
    pub delta: bool,
}

/// Where a path ended: on a surface, or nowhere.
#[derive(Debug, Clone, Copy)]
pub struct PathEnd<'a> {
    /// Unit direction of travel towards the end.
    pub wi: Vec3,
    /// The surface, if there is one.
    pub vertex: Option<&'a Vertex>,
}

/// What a light may know of the surface when it chooses a direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lobes {
    /// Unit direction to the viewer.
    pub wo: Vec3,
    /// About the receiver's shading normal.
    pub scattering: Scattering,
    /// Whether no scattered ray competes, so that all that is scattered has to be found.
    pub alone: bool,
    /// How many samples will be taken whose numbers are even together; at least 1.
    pub samples: u32,
}

/// What a guided light has worked out for one receiver: which of its tables it will ask, by numbers of its own.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Guide {
    /// Numbers of the tables.
    pub tables: [u32; 2],
    /// How often each is asked; together 1.
    pub shares: [f32; 2],
    /// How often a sample is taken at all: less than 1 where it would hardly be worth its ray.
    pub worth: f32,
}

/// A few samples of a light at infinity, whose radiance is asked for later (see [`LightSample::li`]).
#[derive(Debug, Clone, Copy, Default)]
pub struct LightLanes {
    /// Unit directions towards the light.
    pub wi: DirectionLanes,
    /// Density per solid angle; 0 where nothing can arrive, or nothing was asked for.
    pub pdf: [f32; LANES],
}

/// A light at infinity that chooses directions by what it brings times what the surface makes of it. For each receiver
/// first [`GuidedLight::prepare`], then any of the others with the same guide.
pub trait GuidedLight: Send + Sync {
    /// Works out what is needed for a receiver; false if no sample can be drawn.
    fn prepare(&self, at: &Receiver, lobes: &Lobes, guide: &mut Guide) -> bool;

    /// As [`Light::sample_li`].
    fn sample(&self, at: &Receiver, guide: &Guide, u: [f32; 2]) -> Option<LightSample>;

    /// [`GuidedLight::sample`] of the first `n` of these points, bit for bit.
    fn sample_many(&self, at: &Receiver, guide: &Guide, u: &[[f32; LANES]; 2], n: usize) -> LightLanes;

    /// As [`Light::pdf_li`], of the direction `wi`.
    fn pdf(&self, at: &Receiver, guide: &Guide, wi: Vec3) -> f32;

    /// Largest radiance over the mean over all directions: how much a direction that is never looked at may hide.
    fn contrast(&self) -> f32;
}

/// A bounding sphere of what is lit, in render space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent {
    /// Centre.
    pub center: Vec3,
    /// Radius, more than 0.
    pub radius: f32,
}

/// What bounds a source of light: where it is, and where it shines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EmitterBounds {
    /// Encloses it.
    pub bounds: Aabb,
    /// Unit vector in the middle of its surfaces' normals.
    pub axis: Vec3,
    /// Cosine of how far those normals spread about the axis; -1 where they look anywhere.
    pub cos_spread: f32,
    /// Cosine of how far from a normal light leaves: 0 for surfaces.
    pub cos_reach: f32,
    /// Whether it shines against its normals as well.
    pub two_sided: bool,
    /// Its power, as [`Light::power`] has it.
    pub power: f32,
}

/// A source of light, in render space.
pub trait Light: Send + Sync {
    /// Samples a direction to the light; None if nothing can arrive.
    fn sample_li(&self, at: &Receiver, u: [f32; 2]) -> Option<LightSample>;

    /// The density per solid angle with which [`Light::sample_li`] takes the direction to `end`; 0 for delta
    /// lights.
    fn pdf_li(&self, at: &Receiver, end: &PathEnd) -> f32;

    /// Radiance that leaves `end` against the direction of travel.
    fn le(&self, end: &PathEnd) -> Rgb;

    /// [`Light::le`] of many paths that leave the scene in these directions, bit for bit; as many as `out` has room
    /// for.
    fn le_escaped(&self, wi: Directions, out: &mut [Rgb]) {
        for (i, out) in out.iter_mut().enumerate() {
            *out = self.le(&PathEnd { wi: wi.get(i), vertex: None });
        }
    }

    /// What a sample of this light brings, looked up now if it was not.
    fn arriving(&self, sample: &LightSample) -> Rgb {
        sample.li.unwrap_or_else(|| self.le(&PathEnd { wi: sample.wi, vertex: None }))
    }

    /// How it is sampled, for people, such as "by a table"; empty where there is nothing to tell.
    fn describe(&self) -> String {
        String::new()
    }

    /// Whether it shines from one point or direction alone, which no path meets by chance; its samples are all the same.
    fn is_delta(&self) -> bool {
        false
    }

    /// Whether [`Light::sample_li`] ever gives a sample. If not, nothing need be drawn for it, and no path that ends on it
    /// competes with light samples.
    fn is_sampled(&self) -> bool {
        true
    }

    /// Whether nothing comes from it, ever: a scene does without it.
    fn is_black(&self) -> bool {
        false
    }

    /// The radiance that paths which leave the scene meet, if it is the same in all directions.
    fn le_everywhere(&self) -> Option<Rgb> {
        None
    }

    /// Whether what paths which leave the scene meet varies without detail in the directions within `half_angle` of `axis`:
    /// points that lie a degree apart and fit to each other tell what lies between them.
    fn is_smooth(&self, _axis: Vec3, _half_angle: f32) -> bool {
        false
    }

    /// This light as one that takes the surface into account; None if it does not.
    fn guided(&self) -> Option<&dyn GuidedLight> {
        None
    }

    /// Whether paths that leave the scene end on this light.
    fn at_infinity(&self) -> bool {
        false
    }

    /// Power in watts (or, for lights without end, through a disc as large as the extent): steers the choice
    /// between lights.
    fn power(&self, extent: &Extent) -> f32;

    /// What bounds it, for a choice between many lights by place; None for those at infinity, which are chosen by power
    /// alone. Nothing may arrive from outside of the bounds, or where they say that it does not shine.
    fn bounds(&self) -> Option<EmitterBounds> {
        None
    }

    /// Irradiance on an unoccluded surface at `p` with unit normal `n`, where a closed form is known.
    fn irradiance_closed_form(&self, _p: Vec3, _n: Vec3) -> Option<Rgb> {
        None
    }
}

/// A light in world space, as a scene describes it.
pub trait LightSource: Send + Sync {
    /// The light in render space. Errors where it cannot be represented there.
    fn place(&self, space: &RenderSpace) -> Result<Arc<dyn Light>>;
}

/// A light chosen, with its probability.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChosenLight {
    /// Index in the scene's list.
    pub light: u32,
    /// Probability of the choice.
    pub pmf: f32,
}

/// Chooses a light for a receiver.
pub trait LightSampler: Send + Sync {
    /// Chooses by `u` in [0, 1); None if no light can contribute.
    fn sample(&self, at: &Receiver, u: f32) -> Option<ChosenLight>;

    /// The probability with which [`LightSampler::sample`] chooses `light` there.
    fn pmf(&self, at: &Receiver, light: u32) -> f32;
}
