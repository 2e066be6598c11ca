//! The one trait behind which ray kernels stand.

use crate::base::hit::{Hit, HitBatch};
use crate::base::ray::{Coherence, Ray, RayBatch};
use crate::error::Result;
use crate::math::aabb::Aabb;
use crate::math::simd::Level;

/// Anything a ray can be tested against. Queries may come from many threads at once; a ray that is not valid
/// ([`Ray::is_valid`]) is a miss.
pub trait Intersectable: Send + Sync {
    /// Encloses everything; empty if there is nothing.
    fn bounds(&self) -> Aabb;

    /// The closest hit with `tnear <= t <= tfar`.
    fn intersect(&self, ray: &Ray) -> Option<Hit>;

    /// Whether anything lies at `tnear <= t <= tfar`.
    fn occluded(&self, ray: &Ray) -> bool;

    /// Closest hits of a batch; `hits` is resized to it.
    fn intersect_batch(&self, rays: &RayBatch, hits: &mut HitBatch, _coherence: Coherence) {
        hits.reset(rays.len());
        for i in 0..rays.len() {
            hits.set(i, self.intersect(&rays.get(i)));
        }
    }

    /// Any hit of each ray of a batch; `blocked` is resized to it.
    fn occluded_batch(&self, rays: &RayBatch, blocked: &mut Vec<bool>, _coherence: Coherence) {
        blocked.clear();
        blocked.extend((0..rays.len()).map(|i| self.occluded(&rays.get(i))));
    }

    /// What the kernel does to answer for one ray, by its form for single rays; none where it cannot count.
    fn visits(&self, _ray: &Ray, _query: QueryKind) -> Option<Visits> {
        None
    }

    /// What the surface area heuristic expects of a line through the kernel's bounds that nothing stops: inner nodes,
    /// leaves and primitives visited; none where the kernel cannot say. Instances count as one primitive.
    fn predicted_visits(&self) -> Option<[f64; 3]> {
        None
    }

    /// Bytes that the acceleration structure holds beyond the geometry it was given.
    fn memory(&self) -> u64;

    /// Name and version for records: "embree 3.13.5 robust", "brute".
    fn describe(&self) -> String;

    /// A failure inside a query (a panic in a shape's code, say) since the last call. The renderer asks at the
    /// end of each block and then fails the render: a query itself has no way to.
    fn take_failure(&self) -> Result<()> {
        Ok(())
    }
}

/// A kernel without geometry, for where there must be one before there is.
pub struct Nothing;

impl Intersectable for Nothing {
    fn bounds(&self) -> Aabb {
        Aabb::EMPTY
    }

    fn intersect(&self, _: &Ray) -> Option<Hit> {
        None
    }

    fn occluded(&self, _: &Ray) -> bool {
        false
    }

    fn memory(&self) -> u64 {
        0
    }

    fn describe(&self) -> String {
        "nothing".into()
    }
}

/// What is asked of a ray.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum QueryKind {
    /// The closest hit.
    Closest,
    /// Any hit.
    Any,
}

/// What a kernel did for rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Visits {
    /// Inner nodes opened.
    pub nodes: u64,
    /// Leaves opened.
    pub leaves: u64,
    /// Primitives tested, all lanes of a leaf counted that hold one.
    pub primitives: u64,
}

impl std::ops::AddAssign for Visits {
    fn add_assign(&mut self, o: Visits) {
        self.nodes += o.nodes;
        self.leaves += o.leaves;
        self.primitives += o.primitives;
    }
}

/// How carefully a kernel builds; every kernel maps these to its own means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BuildQuality {
    /// Shortest time to the first ray.
    Fast,
    /// The default.
    #[default]
    Balanced,
    /// Fastest rays.
    Best,
}

/// How a kernel tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum KernelMode {
    /// No leaks between neighbouring triangles, as far as the kernel can promise it.
    #[default]
    Robust,
    /// Fastest tests.
    Fast,
}

/// What a kernel's builder is told beside the geometry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct KernelOptions {
    /// See [`BuildQuality`].
    pub quality: BuildQuality,
    /// See [`KernelMode`].
    pub mode: KernelMode,
    /// Threads for the build; 0 means all.
    pub threads: usize,
    /// The instruction set of hand-written kernels; none means [`Level::chosen`]. Changes no answer of these. Kernels of
    /// a library take it as a limit, if they can, and then say so in [`Intersectable::describe`].
    pub simd: Option<Level>,
    /// How many rays will be asked for, roughly; 0 where that is not known. Changes no answer.
    pub expected_rays: u64,
}
