//! What one sample went through, for people: every number is the one that the integrator works with.

use crate::base::hit::Hit;
use crate::base::light::{ChosenLight, LightSample};
use crate::base::ray::Ray;
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use glam::Vec3;

/// The rays of one sample with what they met, those of a depth together.
#[derive(Debug, Clone, Default)]
pub struct Story {
    /// In the order in which they were traced.
    pub legs: Vec<Leg>,
    /// The sum of all that they brought, added in the integrator's order.
    pub radiance: Rgb,
    /// Whether all rays, throughputs and contributions that are told are, bit for bit, those that the integrator's own
    /// stages put out.
    pub faithful: bool,
}

/// A ray of a path, and where it ends.
#[derive(Debug, Clone)]
pub struct Leg {
    /// The camera ray's is 1.
    pub depth: u32,
    /// The leg at whose end it starts; none for the camera ray.
    pub from: Option<usize>,
    /// In render space.
    pub ray: Ray,
    /// What radiance at its end counts for.
    pub beta: Rgb,
    /// Density per solid angle of its direction; infinite where no light sample competes.
    pub pdf: f32,
    /// Where it leads.
    pub end: End,
    /// What lights at its end show.
    pub met: Vec<Met>,
}

/// Where a ray leads.
#[derive(Debug, Clone)]
pub enum End {
    /// Out of the scene.
    Escape,
    /// Something was in the way of the last ray, which only asked whether it leaves.
    Blocked,
    /// A surface.
    Surface(Box<Stop>),
}

/// What a surface made of a path.
#[derive(Debug, Clone)]
pub struct Stop {
    /// What was hit.
    pub hit: Hit,
    /// The point.
    pub vertex: Vertex,
    /// Whether paths that get here may go on at all.
    pub goes_on: bool,
    /// Lights that were asked.
    pub lit: Vec<Lit>,
    /// How it went on: once, or several times where paths end there.
    pub onward: Vec<Onward>,
}

/// A light at a path's end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Met {
    /// Index in the scene's list; none for a background that is no light.
    pub light: Option<u32>,
    /// What it shows.
    pub le: Rgb,
    /// Density per solid angle with which light samples would have found it; 0 where none competes.
    pub pdf: f32,
    /// By multiple importance sampling.
    pub weight: f32,
    /// What was added.
    pub value: Rgb,
}

/// A sample of a light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lit {
    /// Which, and the probability of the choice (times the number of samples, if several are taken of the only one).
    pub chosen: ChosenLight,
    /// What the light says; none if nothing can arrive.
    pub sample: Option<LightSample>,
    /// What the surface makes of it; none where it faces away or scatters none of it.
    pub weighed: Option<Weighed>,
    /// Scattered rays that compete.
    pub rivals: f32,
    /// The shadow ray.
    pub ray: Option<Ray>,
    /// Whether something is in its way.
    pub blocked: bool,
    /// The radiance of the light; black where nobody asked for it, as something is in the way.
    pub li: Rgb,
    /// What was added.
    pub value: Rgb,
}

/// What a light sample counts at a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weighed {
    /// Scattering function times cosine.
    pub f_cos: Rgb,
    /// Density per solid angle of a scattered ray in the same direction.
    pub bsdf_pdf: f32,
    /// Density of the light sample, with that of the choice.
    pub pdf: f32,
    /// By multiple importance sampling.
    pub weight: f32,
    /// What the path brings, but for radiance that the light left open.
    pub value: Rgb,
}

/// A direction in which a path was to go on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Onward {
    /// What was sampled; none if nothing is scattered.
    pub scattered: Option<Scattered>,
    /// Russian roulette: the chance to survive, and the number that must be less.
    pub roulette: Option<[f32; 2]>,
    /// What came of it.
    pub fate: Fate,
}

/// A sampled direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scattered {
    /// Unit direction in render space.
    pub wi: Vec3,
    /// Scattering function times cosine over density.
    pub weight: Rgb,
    /// Density per solid angle; of a Dirac lobe its probability.
    pub pdf: f32,
    /// Whether it is of a Dirac lobe.
    pub delta: bool,
}

/// What became of a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// A leg of the next depth, by number.
    Leg(usize),
    /// Nothing is scattered that way.
    Absorbed,
    /// Russian roulette ended it.
    Roulette,
    /// Light samples have counted all that it would find.
    LitAlone,
}
