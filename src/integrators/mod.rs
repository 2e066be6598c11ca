//! L3: integrators advance a block of paths together: all rays of one depth go to the kernel as one batch. They
//! know the nouns of `base` and the [`Scene`], and name no kind of anything.

pub mod ambient_occlusion;
pub mod analytic;
mod avoided;
mod columns;
mod depth;
pub mod direct;
mod escapes;
mod guided;
pub mod normals;
pub mod path;
mod pending;
mod pilot;
mod points;
mod several;
pub mod story;
pub mod strategy;
mod surface;
mod tell;
mod together;
pub mod whitted;

pub use avoided::Avoided;

use crate::base::hit::HitBatch;
use crate::base::material::Prepared;
use crate::base::pixel_rect::PixelRect;
use crate::base::ray::RayBatch;
use crate::base::registry::Row;
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::sampler::{Dim, PixelSampler, Sampler, Slot};
use crate::sampling::filter::PixelFilter;
use crate::scene::Scene;
use std::sync::Arc;

/// Every integrator, by name.
pub static REGISTRY: &[Row<dyn Integrator>] =
    &[path::ROW, direct::ROW, ambient_occlusion::ROW, normals::ROW, whitted::ROW, analytic::ROW];

/// Depths between the sample dimensions of one light and the next: more than any path is long.
const LIGHT_STRIDE: u32 = 1 << 14;

/// Where the point on a light is drawn at a depth, if each light is sampled: those after the first have dimensions of
/// their own, far from those of any depth.
fn light_dim(depth: u32, number: u32) -> Dim {
    Dim::at(depth.wrapping_add(number.wrapping_mul(LIGHT_STRIDE)), Slot::LightUv)
}

/// Which sample of which pixel a path is.
#[derive(Debug, Clone, Copy)]
pub struct PathId {
    /// The points of its pixel and replicate.
    pub sampler: PixelSampler,
    /// Its index among them.
    pub index: u32,
    /// Hash of its pixel and replicate, for ray keys.
    pub key: u32,
}

/// A block of camera rays.
#[derive(Default)]
pub struct CameraBatch {
    /// The rays, of unit direction, neighbours in the batch close together.
    pub rays: RayBatch,
    /// Their identities.
    pub ids: PathIds,
    /// Width of a camera ray per unit of distance.
    pub spread: f32,
    /// Whether [`PathResults::first`] is wanted.
    pub want_first: bool,
    /// How many samples these pixels take for each of another, if more than one: what takes several samples of a light for
    /// each camera ray takes as many fewer.
    pub times: u32,
}

/// Identities as a structure of arrays, all of one length.
#[derive(Debug, Clone, Default)]
pub struct PathIds {
    /// See [`PathId::sampler`].
    pub samplers: Vec<PixelSampler>,
    /// See [`PathId::index`].
    pub indices: Vec<u32>,
    /// See [`PathId::key`].
    pub keys: Vec<u32>,
}

impl PathIds {
    /// Identity `i`.
    #[inline]
    pub fn get(&self, i: usize) -> PathId {
        PathId { sampler: self.samplers[i], index: self.indices[i], key: self.keys[i] }
    }

    /// Appends consecutive samples, `first` on.
    pub fn extend(&mut self, first: PathId, n: usize) {
        self.samplers.extend(std::iter::repeat_n(first.sampler, n));
        self.indices.extend(first.index..first.index + n as u32);
        self.keys.extend(std::iter::repeat_n(first.key, n));
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.samplers.clear();
        self.indices.clear();
        self.keys.clear();
    }
}

/// A surface that the camera sees, from which AOVs read.
#[derive(Debug, Clone, Copy)]
pub struct FirstHit {
    /// The surface point.
    pub vertex: Vertex,
    /// The material's albedo there.
    pub albedo: Rgb,
}

impl FirstHit {
    /// A surface point with its material.
    pub fn new(scene: &Scene, vertex: Vertex) -> FirstHit {
        let material = scene.material(&vertex);
        let mut prepared = Prepared::default();
        material.prepare(&vertex, &mut prepared);
        FirstHit { vertex, albedo: material.albedo(&prepared, vertex.frame.to_local(vertex.wo)) }
    }
}

/// What a block of paths brings back, one entry a path.
#[derive(Default)]
pub struct PathResults {
    /// Radiance.
    pub li: Vec<Rgb>,
    /// 1 where the camera ray met something, else 0.
    pub alpha: Vec<f32>,
    /// First surfaces, if asked for; else empty.
    pub first: Vec<Option<FirstHit>>,
}

impl PathResults {
    /// Black and transparent, `n` times.
    pub fn reset(&mut self, n: usize, want_first: bool) {
        self.li.clear();
        self.li.resize(n, Rgb::BLACK);
        self.alpha.clear();
        self.alpha.resize(n, 0.0);
        self.first.clear();
        self.first.resize(if want_first { n } else { 0 }, None);
    }
}

/// What a camera ray's surface point takes beside the rays that leave it, in units of some 48 ns of a render by two threads on
/// the machine of benches/README.md. These costs were fitted to even renders of three diffuse scenes with several strategies; on
/// metal, a light sample that is not worth its ray takes something too, which no count of rays tells.
const SAMPLE_COST: f64 = 4.0;
/// The same of a coherent camera ray, a scattered ray with the surface that it may meet, and a shadow ray with its light
/// sample.
const RAY_COSTS: [f64; 3] = [0.5, 4.0, 1.6];
/// What a sample that meets no surface costs in all, in the same.
pub const BARE_COST: f64 = 0.2;

/// Rays counted by kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RayCounts {
    /// From the camera.
    pub camera: u64,
    /// Scattered, for the closest hit.
    pub scattered: u64,
    /// Asking only whether anything is in the way.
    pub shadow: u64,
}

impl RayCounts {
    /// Adds another count.
    pub fn add(&mut self, o: &RayCounts) {
        self.camera += o.camera;
        self.scattered += o.scattered;
        self.shadow += o.shadow;
    }

    /// What has been counted since an earlier count.
    pub fn since(&self, before: &RayCounts) -> RayCounts {
        RayCounts {
            camera: self.camera - before.camera,
            scattered: self.scattered - before.scattered,
            shadow: self.shadow - before.shadow,
        }
    }

    /// What they take with all that goes with them, where they meet surfaces, in shadow rays.
    pub fn cost(&self) -> f64 {
        let kinds = [self.camera, self.scattered, self.shadow];
        self.camera as f64 * SAMPLE_COST
            + kinds.iter().zip(RAY_COSTS).map(|(n, c)| *n as f64 * c).sum::<f64>()
    }

    /// Of all kinds.
    pub fn total(&self) -> u64 {
        self.camera + self.scattered + self.shadow
    }
}

/// Memory that a thread keeps from block to block, so that nothing is allocated on the way.
#[derive(Default)]
pub struct Workspace {
    /// Rays of the present depth.
    pub rays: RayBatch,
    /// Rays of the next depth.
    pub next: RayBatch,
    /// Hits of the present depth.
    pub hits: HitBatch,
    /// Rays that only ask whether anything is in the way.
    pub shadow: RayBatch,
    /// Answers to them.
    pub blocked: Vec<bool>,
    /// Which path each of `shadow` belongs to, for integrators that keep no more of it.
    pub indices: Vec<u32>,
    /// Rays traced so far.
    pub counts: RayCounts,
    /// Rays that were not needed.
    pub avoided: Avoided,
    /// State of the path integrators.
    pub paths: path::PathScratch,
}

/// What a render tells an integrator beforehand, so that it may try out what pays.
#[derive(Clone, Copy)]
pub struct PilotPlan<'a> {
    /// Pixels that will be rendered.
    pub pixels: PixelRect,
    /// Samples that each of them will take, at most.
    pub spp: u32,
    /// Seed of the render.
    pub seed: u64,
    /// Kind of its points.
    pub kind: Sampler,
    /// Its pixel filter.
    pub filter: PixelFilter,
    /// Pixels that take more samples than others.
    pub is_outline: &'a (dyn Fn(u32, u32) -> bool + Sync),
    /// How many for each of another's.
    pub outline_times: u32,
    /// Whether pixels take samples by their own need, so that what suits a material need not suit others.
    pub by_need: bool,
}

/// An integrator that has adapted to a scene.
pub struct Specialised {
    /// It estimates the same.
    pub integrator: Arc<dyn Integrator>,
    /// What was decided, for people and records.
    pub decided: String,
    /// Rays that were spent on deciding.
    pub rays: RayCounts,
}

/// Estimates the radiance along a block of camera rays.
pub trait Integrator: Send + Sync {
    /// Fills `out` (reset by the integrator) for every ray of the batch. Results depend on each path's identity
    /// alone, not on what else is in the batch.
    fn trace(&self, scene: &Scene, batch: &CameraBatch, work: &mut Workspace, out: &mut PathResults);

    /// Sampler dimensions beyond the camera's that a path may use, for information.
    fn describe(&self) -> String;

    /// Whether camera rays that meet nothing show the scene's background and nothing else, so that a pixel of such rays
    /// alone need not be asked for.
    fn shows_background(&self) -> bool {
        false
    }

    /// Whether pixels that outlines run through are worth more camera rays: not where each brings along as much more work as
    /// there are more of them.
    fn gains_by_outlines(&self, _scene: &Scene) -> bool {
        true
    }

    /// An integrator of the same estimate that suits this scene better, decided by a pilot that is a function of its
    /// arguments alone; None where there is nothing to decide.
    fn specialise(&self, _scene: &Scene, _plan: &PilotPlan) -> Option<Specialised> {
        None
    }

    /// What the path of the only ray of a batch goes through, as [`Integrator::trace`] traces it; None from those that tell
    /// nothing but their rays.
    fn tell(&self, _scene: &Scene, _batch: &CameraBatch, _work: &mut Workspace) -> Option<story::Story> {
        None
    }
}
