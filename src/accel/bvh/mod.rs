//! The in-house kernel: trees of eight children over the triangles, shapes and placed groups of each group.
//!
//! **It decides as the oracle does.** Boxes and triangles are culled in single precision, eight at a time, by tests
//! that provably let through whatever the double-precision tests would accept (`ray.rs`); what is left is decided by
//! those very tests ([`crate::math::triangle`], [`Shape::intersect`](crate::base::shape::Shape)), and of several hits
//! at one distance the first in the order of paths and primitives counts. So the kernel finds what [`super::brute`]
//! finds, to the bit, whatever the tree, the instruction set or the order of visits; and it is watertight because that
//! test is.
//!
//! Nested groups are met as they are nested, to any depth: a ray is taken into a group's space in double precision, and
//! what remains to be done outside waits on an explicit stack.

mod batch;
mod build;
mod columns;
mod count;
mod layout;
mod open;
mod ray;
mod sheared;
mod simd;
mod stream;
mod validate;
mod walk;

#[cfg(test)]
mod tests;

use super::KernelRow;
use super::failure::Failure;
use super::tame::check_extent;
use crate::base::geometry::Geometry;
use crate::base::hit::{Hit, HitBatch};
use crate::base::intersectable::{Intersectable, KernelMode, KernelOptions, QueryKind, Visits};
use crate::base::ray::{Coherence, Ray, RayBatch};
use crate::base::shape::LocalRay;
use crate::error::Result;
use crate::math::aabb::Aabb;
use batch::Batch;
use count::Counter;
use glam::DAffine3;
use layout::{Child, Instance, Target, Tree};
use ray::{BoxRays, LevelRay, PlainRay};
use simd::{Available, Job, Simd, enter};
use std::cell::Cell;
use std::sync::Arc;
use walk::{Search, Stack, Stop, walk};

/// The table row.
pub const ROW: KernelRow = KernelRow {
    name: "bvh",
    doc: "in-house: strictly watertight, decides in double precision",
    build_bytes: 125,
    build: |geometry, options| Ok(Box::new(Kernel::new(geometry, options)?) as Box<dyn Intersectable>),
};

/// See the module.
pub struct Kernel {
    geometry: Arc<Geometry>,
    /// By group.
    trees: Vec<Tree>,
    level: Available,
    mode: KernelMode,
    failure: Failure,
}

impl Kernel {
    /// Builds the trees. Errors where coordinates are beyond [`MAX_COORDINATE`](crate::base::ray::MAX_COORDINATE),
    /// where there are more primitives than its numbers can name, and where the processor lacks the instructions asked
    /// for.
    pub fn new(geometry: Arc<Geometry>, options: &KernelOptions) -> Result<Self> {
        check_extent(&geometry)?;
        let level = Available::new(options.simd)?;
        let trees = build::build(&geometry, options)?;
        Ok(Kernel { geometry, trees, level, mode: options.mode, failure: Failure::default() })
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
        let mut search = Search::ending(f64::from(ray.tfar), ray.key, &self.failure);
        let tree = &self.trees[self.root()];
        let Some(root) = tree.root else { return search };
        stack.len = 0;
        stack.reserve(tree.waiting);
        stack.push(root, f32::NEG_INFINITY);
        if let Some(plain) = PlainRay::new(ray, tree) {
            self.search_plain::<S, C, ANY>(&plain, &plain.cull().boxes(tree), &mut search, stack, count);
        } else if ray.is_valid()
            && let Some(level) = LevelRay::new(tree, LocalRay::from_ray(ray), 0)
        {
            self.rest::<C, ANY>(&level, &mut search, stack, count);
        }
        search
    }

    /// Searches what waits on the stack, of the root's tree, and all that is placed there.
    #[inline(always)]
    fn search_plain<'a, S: Simd, C: Counter, const ANY: bool>(
        &'a self,
        ray: &PlainRay<'a>,
        boxes: &BoxRays<S>,
        search: &mut Search,
        stack: &mut Stack,
        count: &mut C,
    ) {
        let group = &self.geometry.groups[self.root()];
        if let Stop::At(i) = walk::<S, C, ANY>(ray, boxes, group, search, stack, 0, count) {
            stack.push(Child::new(Target::Instance(i)), f32::NEG_INFINITY);
            self.rest::<C, ANY>(&ray.level(), search, stack, count);
        }
    }

    /// As [`Kernel::search_plain`], for any ray, through all levels. Not part of its caller's code, which is of use to
    /// most rays without it: so it has to enter the level of instructions again.
    fn rest<'a, C: Counter, const ANY: bool>(
        &'a self,
        root: &LevelRay<'a>,
        search: &mut Search,
        stack: &mut Stack,
        count: &mut C,
    ) {
        C::enter(self.level, Rest::<C, ANY> { kernel: self, root, search, stack, count });
    }

    /// The root's level, and where its tree begins; none if the ray meets nothing, or is not valid.
    #[inline(always)]
    fn enter_root<'a>(&'a self, ray: &Ray, exact: &LocalRay) -> Option<(LevelRay<'a>, Child)> {
        let tree = &self.trees[self.root()];
        let level = match PlainRay::new(ray, tree) {
            Some(plain) => plain.level(),
            None if !ray.is_valid() => return None,
            None => LevelRay::new(tree, *exact, 0)?,
        };
        Some((level, tree.root?))
    }

    /// The level of an instance, and where its tree begins; none if the ray passes it by.
    #[inline(always)]
    fn below<'a>(
        &'a self,
        from: &Frame<'a>,
        is_root: bool,
        instance: &Instance,
        render: &LocalRay,
        search: &Search,
        stack: &mut Stack,
    ) -> Option<(Frame<'a>, Child)> {
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
        Some((Frame { level, group, from_render, base }, root))
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

/// A search that goes through levels of nesting.
struct Rest<'r, 'a, 's, C, const ANY: bool> {
    kernel: &'a Kernel,
    root: &'r LevelRay<'a>,
    search: &'r mut Search<'s>,
    stack: &'r mut Stack,
    count: &'r mut C,
}

impl<C: Counter, const ANY: bool> Job for Rest<'_, '_, '_, C, ANY> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self) {
        let Rest { kernel, root, search, stack, count } = self;
        let mut here = Frame { level: *root, group: kernel.root(), from_render: DAffine3::IDENTITY, base: 0 };
        // The levels that wait until the one above them is done.
        let mut outer: Vec<Frame> = Vec::new();
        loop {
            let group = &kernel.geometry.groups[here.group];
            let boxes = here.level.cull.boxes::<S>(here.level.tree);
            match walk::<S, C, ANY>(&here.level, &boxes, group, search, stack, here.base, count) {
                Stop::At(i) => {
                    let instance = here.level.tree.instances[i];
                    let inner = kernel.below(&here, outer.is_empty(), &instance, &root.exact, search, stack);
                    if let Some((inner, child)) = inner {
                        stack.push(child, f32::NEG_INFINITY);
                        outer.push(std::mem::replace(&mut here, inner));
                    }
                }
                Stop::Done if ANY && search.found.is_some() => return,
                Stop::Done => match outer.pop() {
                    Some(frame) => here = frame,
                    None => return,
                },
            }
        }
    }
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

    fn intersect_batch(&self, rays: &RayBatch, hits: &mut HitBatch, coherence: Coherence) {
        hits.reset(rays.len());
        enter(self.level, Batch::<_, false> { kernel: self, rays, coherence, out: hits });
    }

    fn occluded_batch(&self, rays: &RayBatch, blocked: &mut Vec<bool>, coherence: Coherence) {
        blocked.clear();
        blocked.resize(rays.len(), false);
        enter(self.level, Batch::<_, true> { kernel: self, rays, coherence, out: &mut blocked[..] });
    }

    fn visits(&self, ray: &Ray, query: QueryKind) -> Option<Visits> {
        let mut count = Visits::default();
        match query {
            QueryKind::Closest => {
                Visits::enter(self.level, One::<_, false> { kernel: self, ray, count: &mut count });
            }
            QueryKind::Any => {
                Visits::enter(self.level, One::<_, true> { kernel: self, ray, count: &mut count });
            }
        }
        Some(count)
    }

    fn predicted_visits(&self) -> Option<[f64; 3]> {
        Some(self.trees[self.root()].predicted_visits())
    }

    fn memory(&self) -> u64 {
        self.trees.iter().map(Tree::memory).sum()
    }

    fn describe(&self) -> String {
        let mode = match self.mode {
            KernelMode::Robust => "robust",
            KernelMode::Fast => "fast",
        };
        format!("bvh {} {mode}", self.level.level().name())
    }

    fn take_failure(&self) -> Result<()> {
        self.failure.take()
    }
}
