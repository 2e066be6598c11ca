//! The Embree kernel: triangle meshes over the arrays as they are, all procedural shapes of a group as one user
//! geometry, groups as instances to any depth.
//!
//! Embree trusts its caller: a NaN in a ray ends the process of Debian's build. Every ray is checked here, and rays
//! that are valid but extreme are moved and rescaled first; placements that f32 cannot carry go by double precision
//! (`plan.rs`). Panics in shapes and filters are kept for [`Intersectable::take_failure`].
#![allow(unsafe_code, reason = "the one user of embree-sys")]

mod batch;
mod callbacks;
pub mod forms;
mod handles;
mod level;
pub mod library;
mod plan;
mod query;
#[cfg(test)]
mod tests;

use super::KernelRow;
use super::failure::Failure;
use super::tame::check_extent;
use crate::base::geometry::Geometry;
use crate::base::hit::{Hit, HitBatch};
use crate::base::intersectable::{Intersectable, KernelMode, KernelOptions};
use crate::base::ray::{Coherence, Ray, RayBatch};
use crate::base::shape::LocalRay;
use crate::error::Result;
use crate::math::aabb::Aabb;
use crate::math::simd;
use handles::Device;
use level::{Builder, Level, Levels};
use query::Entry;
use std::sync::Arc;

/// The table row.
pub const ROW: KernelRow = KernelRow {
    name: "embree",
    doc: "Intel Embree",
    build_bytes: 105,
    build: |geometry, options| Ok(Box::new(Kernel::new(geometry, options)?) as Box<dyn Intersectable>),
};

/// See the module. Fields are dropped in this order: scenes before what their callbacks read, the device after all
/// that was made from it, the arrays that its buffers share last.
pub struct Kernel {
    levels: Levels,
    failure: Arc<Failure>,
    device: Device,
    mode: KernelMode,
    simd: Option<simd::Level>,
    geometry: Arc<Geometry>,
}

impl Kernel {
    /// Builds the scenes. Errors where Embree fails (out of memory, a CPU too old), and where coordinates are beyond
    /// [`MAX_COORDINATE`](crate::base::ray::MAX_COORDINATE) or there are more primitives than its numbers can name.
    pub fn new(geometry: Arc<Geometry>, options: &KernelOptions) -> Result<Self> {
        Kernel::with_budget(geometry, options, plan::FLATTEN_BUDGET)
    }

    /// With a limit on the instances that flattening may add.
    fn with_budget(geometry: Arc<Geometry>, options: &KernelOptions, budget: usize) -> Result<Self> {
        check_extent(&geometry)?;
        let device = Device::new(options.threads, options.simd)?;
        let failure = Arc::new(Failure::default());
        let levels = Builder::new(&geometry, &device, &failure, options).build(budget)?;
        Ok(Kernel { levels, failure, device, mode: options.mode, simd: options.simd, geometry })
    }

    fn root(&self) -> &Level {
        &self.levels.levels[0]
    }

    fn is_empty(&self) -> bool {
        self.root().bounds.is_empty()
    }

    fn closest(&self, ray: &Ray) -> Option<Hit> {
        if self.is_empty() || !ray.is_valid() {
            return None;
        }
        let found = Entry::root(&self.levels).closest(&LocalRay::from_ray(ray), ray.key)?;
        let t = found.t as f32;
        t.is_finite().then_some(Hit { t, prim: found.prim, path: found.path })
    }
}

impl Intersectable for Kernel {
    fn bounds(&self) -> Aabb {
        self.geometry.root().bounds
    }

    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.closest(ray)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.any(ray)
    }

    fn intersect_batch(&self, rays: &RayBatch, hits: &mut HitBatch, coherence: Coherence) {
        self.closest_batch(rays, hits, coherence);
    }

    fn occluded_batch(&self, rays: &RayBatch, blocked: &mut Vec<bool>, coherence: Coherence) {
        self.any_batch(rays, blocked, coherence);
    }

    fn memory(&self) -> u64 {
        self.device.bytes() + self.levels.memory()
    }

    fn describe(&self) -> String {
        let mode = match self.mode {
            KernelMode::Robust => "robust",
            KernelMode::Fast => "fast",
        };
        let limit = self.simd.map_or(String::new(), |l| format!(" at most {}", l.name()));
        format!("embree {} {mode}{limit}", self.device.version())
    }

    fn take_failure(&self) -> Result<()> {
        self.failure.take()
    }
}
