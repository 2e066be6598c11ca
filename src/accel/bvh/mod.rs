//! The in-house kernel: trees of eight children over the triangles, shapes and placed groups of each group.
//!
//! **It decides as the oracle does.** Boxes and triangles are culled in single precision, eight at a time, by tests that
//! provably let through whatever the double-precision tests would accept (`ray.rs`); what is left is decided by those very
//! tests ([`crate::math::triangle`], [`Shape::intersect`](crate::base::shape::Shape)), and of several hits at one distance the
//! first in the order of paths and primitives counts. So the kernel finds what [`super::brute`] finds, to the bit,
//! whatever the tree, the instruction set or the order of visits; and it is watertight because that test is.
//!
//! Nested groups are met as they are nested, to any depth: a ray is taken into a group's space in double precision, and
//! what remains to be done outside waits on an explicit stack.

mod build;
mod layout;
mod ray;
mod simd;
mod validate;
mod walk;



use super::KernelRow;
use super::failure::Failure;
use super::tame::check_extent;
use crate::base::geometry::Geometry;
use crate::base::hit::{Hit, HitBatch};
use crate::base::intersectable::{Intersectable, KernelOptions, QueryKind, Visits};
use crate::base::ray::{Coherence, Ray, RayBatch};
use crate::base::shape::LocalRay;
use crate::error::Result;
use crate::math::aabb::Aabb;
use glam::DAffine3;
use layout::{Instance, Tree};
use ray::LevelRay;
use simd::{Available, Job, Simd, enter};
use std::cell::Cell;
use std::sync::Arc;
use walk::{Counter, Search, Stack, Stop, walk};

/// The table row.
pub const ROW: KernelRow = KernelRow {
    name: "bvh",
    doc: "in-house: strictly watertight, decides in double precision",
    build: |geometry, options| Ok(Box::new(Kernel::new(geometry, options)?) as Box<dyn Intersectable>),
};

/// See the module.
pub struct Kernel {
    geometry: Arc<Geometry>,
    /// By group.
    trees: Vec<Tree>,
    level: Available,
    failure: Failure,
}

impl Kernel {
    /// Builds the trees. Errors where coordinates are beyond [`MAX_COORDINATE`](crate::base::ray::MAX_COORDINATE), where there are more primitives than its numbers can
    /// name, and where the processor lacks the instructions asked for.
    pub fn new(geometry: Arc<Geometry>, options: &KernelOptions) -> Result<Self> {
        check_extent(&geometry)?;
        let level = Available::new(options.simd)?;
        let trees = build::build(&geometry, options)?;
        Ok(Kernel { geometry, trees, level, failure: Failure::default() })
    }

    fn root(&self) -> usize {
        self.trees.len() - 1
    }

    /// Finds the closest hit, or any.
    #[inline(always)]
    fn search<'a, S: Simd, C: Counter, const ANY: bool>(
        &'a self,
        ray: &Ray,
        stack: &mut Stack,
        count: &mut C,
    ) -> Search<'a> {
        let exact = LocalRay::from_ray(ray);
        let mut search = Search::new(&exact, ray.key, &self.failure);
        if !ray.is_valid() {
            return search;
        }
        let group = self.root();
        let tree = &self.trees[group];
        let Some(child) = tree.root else { return search };
        let Some(level) = LevelRay::new(tree, exact, 0) else { return search };
        stack.len = 0;
        stack.reserve(tree.waiting);
        stack.push(child, f32::NEG_INFINITY);
        let mut here = Frame { level, group, from_render: DAffine3::IDENTITY, base: 0 };
        // The levels that wait until the one above them is done.
        let mut outer: Vec<Frame> = Vec::new();
        loop {
            let group = &self.geometry.groups[here.group];
            match walk::<S, C, ANY>(&here.level, group, &mut search, stack, here.base, count) {
                Stop::At(i) => {
                    let instance = here.level.tree.instances[i];
                    if let Some(inner) = self.below(&here, outer.is_empty(), &instance, &exact, &search, stack) {
                        outer.push(std::mem::replace(&mut here, inner));
                    }
                }
                Stop::Done if ANY && search.found.is_some() => break,
                Stop::Done => match outer.pop() {
                    Some(frame) => here = frame,
                    None => break,
                },
            }
        }
        search
    }

    /// The level of an instance, with its tree waiting on the stack; none if the ray passes it by.
    #[inline(always)]
    fn below<'a>(
        &'a self,
        from: &Frame<'a>,
        is_root: bool,
        instance: &Instance,
        render: &LocalRay,
        search: &Search,
        stack: &mut Stack,
    ) -> Option<Frame<'a>> {
        let group = instance.group as usize;
        let tree = &self.trees[group];
        let root = tree.root?;
        // Composed in the order of `Geometry::resolve`, so that shapes see the bits that refinement sees.
        let from_render =
            if is_root { instance.from_parent } else { instance.from_parent * from.from_render };
        let exact = LocalRay { tfar: search.t, ..render.transformed(&from_render) };
        let first_path = from.level.first_path + instance.first_path;
        let level = LevelRay::new(tree, exact, first_path)?;
        let base = stack.len;
        stack.reserve(tree.waiting);
        stack.push(root, f32::NEG_INFINITY);
        Some(Frame { level, group, from_render, base })
    }
}

/// A level of nesting in the course of a search.
struct Frame<'a> {
    level: LevelRay<'a>,
    group: usize,
    /// Not used at the root.
    from_render: DAffine3,
    /// The length of the stack where the level began.
    base: usize,
}

thread_local! {
    /// The stack of the thread's last search, for the next. (Taken and set rather than lent to a closure, which would
    /// not be compiled for the instructions of its caller.)
    static STACK: Cell<Option<Stack>> = const { Cell::new(None) };
}

/// One ray.
struct One<'a, C, const ANY: bool> {
    kernel: &'a Kernel,
    ray: &'a Ray,
    count: &'a mut C,
}

impl<C: Counter, const ANY: bool> Job for One<'_, C, ANY> {
    type Output = (bool, Option<Hit>);

    #[inline(always)]
    fn run<S: Simd>(self) -> (bool, Option<Hit>) {
        let mut stack = STACK.take().unwrap_or_default();
        let search = self.kernel.search::<S, C, ANY>(self.ray, &mut stack, self.count);
        STACK.set(Some(stack));
        (search.found.is_some(), if ANY { None } else { search.hit() })
    }
}

/// The closest hits of a batch, ray by ray.
struct Closest<'a> {
    kernel: &'a Kernel,
    rays: &'a RayBatch,
    hits: &'a mut HitBatch,
}

impl Job for Closest<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let mut stack = STACK.take().unwrap_or_default();
        for i in 0..self.rays.len() {
            let search = self.kernel.search::<S, (), false>(&self.rays.get(i), &mut stack, &mut ());
            if let Some(hit) = search.hit() {
                self.hits.set(i, Some(hit));
            }
        }
        STACK.set(Some(stack));
    }
}

/// Any hits of a batch, ray by ray.
struct Any<'a> {
    kernel: &'a Kernel,
    rays: &'a RayBatch,
    blocked: &'a mut [bool],
}

impl Job for Any<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let mut stack = STACK.take().unwrap_or_default();
        for (i, blocked) in self.blocked.iter_mut().enumerate() {
            let search = self.kernel.search::<S, (), true>(&self.rays.get(i), &mut stack, &mut ());
            *blocked = search.found.is_some();
        }
        STACK.set(Some(stack));
    }
}

impl Intersectable for Kernel {
    fn bounds(&self) -> Aabb {
        self.geometry.root().bounds
    }

    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        enter(self.level, One::<(), false> { kernel: self, ray, count: &mut () }).1
    }

    fn occluded(&self, ray: &Ray) -> bool {
        enter(self.level, One::<(), true> { kernel: self, ray, count: &mut () }).0
    }

    fn intersect_batch(&self, rays: &RayBatch, hits: &mut HitBatch, _coherence: Coherence) {
        hits.reset(rays.len());
        enter(self.level, Closest { kernel: self, rays, hits });
    }

    fn occluded_batch(&self, rays: &RayBatch, blocked: &mut Vec<bool>, _coherence: Coherence) {
        blocked.clear();
        blocked.resize(rays.len(), false);
        enter(self.level, Any { kernel: self, rays, blocked });
    }

    fn visits(&self, ray: &Ray, query: QueryKind) -> Option<Visits> {
        let mut count = Visits::default();
        match query {
            QueryKind::Closest => {
                enter(self.level, One::<_, false> { kernel: self, ray, count: &mut count });
            }
            QueryKind::Any => {
                enter(self.level, One::<_, true> { kernel: self, ray, count: &mut count });
            }
        }
        Some(count)
    }

    fn memory(&self) -> u64 {
        self.trees.iter().map(Tree::memory).sum()
    }

    fn describe(&self) -> String {
        format!("bvh {}", self.level.level().name())
    }

    fn take_failure(&self) -> Result<()> {
        self.failure.take()
    }
}
