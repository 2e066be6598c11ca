//! Batches of rays that have nothing in common: several are on their way at once, and take turns. What one visits next is
//! fetched while the others go on, so rays do not wait for memory, which is most of what a single one does in a large mesh.

use super::layout::{Child, Target};
use super::ray::BoxRays;
use super::simd::{Job, Simd};
use super::walk::{Search, Stack, choose_one, leaf_of};
use super::{Frame, Kernel, stream};
use crate::base::hit::{Hit, HitBatch};
use crate::base::ray::{Coherence, RayBatch};
use crate::base::shape::LocalRay;
use glam::DAffine3;
use std::cell::Cell;

/// Rays on their way at once: more than the latency of memory over the time of a visit gain nothing.
const SLOTS: usize = 8;

/// What tests of boxes read of a ray.
struct BoxRay {
    inv: [f32; 3],
    near: [f32; 3],
    far: [f32; 3],
    first: [usize; 3],
    tnear: f32,
    /// The ray's end.
    tfar: f32,
}

/// A ray on its way.
struct Slot<'a> {
    ray: BoxRay,
    /// What is visited next.
    next: Child,
    /// In the batch.
    index: usize,
    search: Search<'a>,
    here: Frame<'a>,
    outer: Vec<Frame<'a>>,
    /// As it was at the root.
    exact: LocalRay,
}

impl BoxRay {
    #[inline(always)]
    fn new<S: Simd>(here: &Frame, search: &Search) -> Self {
        let cull = &here.level.cull;
        let rays = cull.boxes::<S>(here.level.tree);
        let one = |v: S::V| S::store(v).0[0];
        BoxRay {
            inv: [one(rays.inv[0]), one(rays.inv[1]), one(rays.inv[2])],
            near: [one(rays.near[0]), one(rays.near[1]), one(rays.near[2])],
            far: [one(rays.far[0]), one(rays.far[1]), one(rays.far[2])],
            first: cull.first(),
            tnear: cull.tnear,
            tfar: cull.end(search.t),
        }
    }

    #[inline(always)]
    fn rays<S: Simd>(&self) -> BoxRays<S> {
        let (i, n, f) = (&self.inv, &self.near, &self.far);
        BoxRays {
            inv: [S::splat(i[0]), S::splat(i[1]), S::splat(i[2])],
            near: [S::splat(n[0]), S::splat(n[1]), S::splat(n[2])],
            far: [S::splat(f[0]), S::splat(f[1]), S::splat(f[2])],
        }
    }
}

impl Kernel {
    /// Traces the rays of these numbers and hands what was found to `out`.
    #[inline(always)]
    fn interleaved<'a, S: Simd, const ANY: bool>(
        &'a self,
        rays: &RayBatch,
        order: &[u32],
        out: &mut impl Sink,
        stacks: &mut [Stack; SLOTS],
    ) {
        let mut order = order.iter();
        let mut slots: Vec<Slot<'a>> = Vec::with_capacity(SLOTS);
        while slots.len() < SLOTS {
            let Some(slot) = self.start::<S>(rays, &mut order) else { break };
            slots.push(slot);
        }
        for stack in stacks.iter_mut() {
            stack.len = 0;
            stack.reserve(self.trees[self.root()].waiting);
        }
        while !slots.is_empty() {
            let mut i = 0;
            while i < slots.len() {
                let (slot, stack) = (&mut slots[i], &mut stacks[i]);
                if self.turn::<S, ANY>(slot, stack) {
                    i += 1;
                    continue;
                }
                if let Some((prim, path)) = slot.search.found {
                    out.take(slot.index, slot.search.t, prim, path);
                }
                stack.len = 0;
                match self.start::<S>(rays, &mut order) {
                    Some(next) => {
                        *slot = next;
                        i += 1;
                    }
                    None => {
                        slots.swap_remove(i);
                        stacks.swap(i, slots.len());
                    }
                }
            }
        }
    }

    /// The next ray of the batch that may meet anything.
    #[inline(always)]
    fn start<'a, S: Simd>(&'a self, rays: &RayBatch, order: &mut std::slice::Iter<u32>) -> Option<Slot<'a>> {
        for &index in order {
            let index = index as usize;
            let ray = rays.get(index);
            let exact = LocalRay::from_ray(&ray);
            if let Some((level, next)) = self.enter_root(&ray, &exact) {
                let search = Search::ending(exact.tfar, ray.key, &self.failure);
                let here = Frame { level, group: self.root(), from_render: DAffine3::IDENTITY, base: 0 };
                let ray = BoxRay::new::<S>(&here, &search);
                return Some(Slot { ray, next, index, search, here, outer: Vec::new(), exact });
            }
        }
        None
    }

    /// Visits one node or leaf; whether the ray goes on.
    #[inline(always)]
    fn turn<'a, S: Simd, const ANY: bool>(&'a self, slot: &mut Slot<'a>, stack: &mut Stack) -> bool {
        let tree = slot.here.level.tree;
        if slot.next.is_node() {
            let node = &tree.nodes()[slot.next.index()];
            let ray = &slot.ray;
            let boxes = ray.rays::<S>().test(ray.first, node, S::splat(ray.tnear), S::splat(ray.tfar));
            if let Some(child) = choose_one::<S, ANY>(node, &boxes, stack) {
                return go_on::<S>(slot, child);
            }
        } else if let Target::Instance(i) = slot.next.target() {
            let instance = tree.instances[i];
            let inner =
                self.below(&slot.here, slot.outer.is_empty(), &instance, &slot.exact, &slot.search, stack);
            if let Some((inner, child)) = inner {
                slot.outer.push(std::mem::replace(&mut slot.here, inner));
                slot.ray = BoxRay::new::<S>(&slot.here, &slot.search);
                return go_on::<S>(slot, child);
            }
        } else {
            let group = &self.geometry.groups[slot.here.group];
            if leaf_of::<S, ANY>(&slot.here.level, group, &mut slot.search, slot.next, slot.ray.tfar) {
                if ANY {
                    return false;
                }
                slot.ray.tfar = slot.here.level.cull.end(slot.search.t);
            }
        }
        loop {
            while stack.len > slot.here.base {
                if let Some(child) = stack.pop_before(slot.ray.tfar) {
                    return go_on::<S>(slot, child);
                }
            }
            let Some(frame) = slot.outer.pop() else { return false };
            slot.here = frame;
            slot.ray = BoxRay::new::<S>(&slot.here, &slot.search);
        }
    }
}

/// Makes a child the next that the ray visits, and asks for it.
#[inline(always)]
fn go_on<S: Simd>(slot: &mut Slot, child: Child) -> bool {
    slot.next = child;
    slot.here.level.tree.fetch::<S>(child);
    true
}

/// Where results go.
pub(super) trait Sink {
    /// Ray `index` meets this at `t`, which may be infinite where only the fact counts.
    fn take(&mut self, index: usize, t: f64, prim: u32, path: u64);
}

impl Sink for &mut HitBatch {
    #[inline(always)]
    fn take(&mut self, index: usize, t: f64, prim: u32, path: u64) {
        let t = t as f32;
        if t.is_finite() {
            self.set(index, Some(Hit { t, prim, path }));
        }
    }
}

impl Sink for &mut [bool] {
    #[inline(always)]
    fn take(&mut self, index: usize, _t: f64, _prim: u32, _path: u64) {
        self[index] = true;
    }
}

/// Scratch of a thread.
#[derive(Default)]
struct Room {
    stream: stream::Room,
    stacks: [Stack; SLOTS],
}

thread_local! {
    /// As `super::STACK`.
    static ROOM: Cell<Option<Box<Room>>> = const { Cell::new(None) };
}

/// A batch: the closest hits, or whether there is any.
pub(super) struct Batch<'a, O, const ANY: bool> {
    pub(super) kernel: &'a Kernel,
    pub(super) rays: &'a RayBatch,
    pub(super) coherence: Coherence,
    /// As long as the batch, and nothing found so far.
    pub(super) out: O,
}

impl<O: Sink, const ANY: bool> Job for Batch<'_, O, ANY> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(mut self) {
        let mut room = ROOM.take().unwrap_or_default();
        let Room { stream, stacks } = &mut *room;
        let rest = self.kernel.streams::<S, ANY>(self.rays, self.coherence, &mut self.out, stream);
        self.kernel.interleaved::<S, ANY>(self.rays, rest, &mut self.out, stacks);
        ROOM.set(Some(room));
    }
}
