//! One ray through one tree.

use super::layout::{Block, Child, Target};
use super::ray::LevelRay;
use super::simd::{LANES, Simd};
use crate::accel::{accepted, first_crossing, failure::Failure};
use crate::base::geometry::Group;
use crate::base::hit::Hit;
use crate::base::intersectable::Visits;
use crate::base::shape::LocalRay;
use crate::math::triangle::TriangleRay;

/// A child, and where the ray enters its box.
#[derive(Clone, Copy)]
pub(super) struct Waiting {
    child: Child,
    near: f32,
}

/// The stack of a search. Levels of nesting share it: each counts from where it began.
#[derive(Default)]
pub(super) struct Stack {
    waiting: Vec<Waiting>,
    /// How many wait.
    pub(super) len: usize,
}

impl Stack {
    /// Makes room for what a tree may leave waiting.
    #[inline(always)]
    pub(super) fn reserve(&mut self, more: usize) {
        if self.waiting.len() < self.len + more {
            self.grow(more);
        }
    }

    #[cold]
    fn grow(&mut self, more: usize) {
        self.waiting.resize((self.len + more).next_power_of_two(), Waiting { child: Child::NONE, near: 0.0 });
    }

    #[inline(always)]
    pub(super) fn push(&mut self, child: Child, near: f32) {
        self.waiting[self.len] = Waiting { child, near };
        self.len += 1;
    }

    #[inline(always)]
    fn pop(&mut self) -> Waiting {
        self.len -= 1;
        self.waiting[self.len]
    }

    /// Brings those from `first` on into the order in which they shall be popped: the nearest last.
    #[inline(always)]
    fn sort(&mut self, first: usize) {
        let part = &mut self.waiting[first..self.len];
        for i in 1..part.len() {
            let it = part[i];
            let mut j = i;
            while j > 0 && part[j - 1].near < it.near {
                part[j] = part[j - 1];
                j -= 1;
            }
            part[j] = it;
        }
    }
}

/// What has been found, and what is asked.
pub(super) struct Search<'a> {
    /// Where the ray ends: the closest hit so far.
    pub(super) t: f64,
    /// Its primitive and path.
    pub(super) found: Option<(u32, u64)>,
    pub(super) key: u32,
    pub(super) failure: &'a Failure,
}

impl<'a> Search<'a> {
    pub(super) fn new(ray: &LocalRay, key: u32, failure: &'a Failure) -> Self {
        Search { t: ray.tfar, found: None, key, failure }
    }

    /// Takes a hit at `t`, which lies between the ray's ends, if it is the closest; of several at one distance the one
    /// with the smallest path, then primitive, so that the order of visits does not matter.
    #[inline(always)]
    fn offer(&mut self, t: f64, prim: u32, path: u64) -> bool {
        let closer = t < self.t
            || t == self.t && self.found.is_none_or(|(old_prim, old_path)| (path, prim) < (old_path, old_prim));
        if closer {
            self.t = t;
            self.found = Some((prim, path));
        }
        closer
    }

    pub(super) fn hit(&self) -> Option<Hit> {
        let t = self.t as f32;
        self.found.filter(|_| t.is_finite()).map(|(prim, path)| Hit { t, prim, path })
    }
}

/// Counts what a search does, or nothing.
pub(super) trait Counter {
    fn node(&mut self) {}
    fn leaf(&mut self, _primitives: impl FnOnce() -> u64) {}
}

impl Counter for () {}

impl Counter for Visits {
    fn node(&mut self) {
        self.nodes += 1;
    }
    fn leaf(&mut self, primitives: impl FnOnce() -> u64) {
        self.leaves += 1;
        self.primitives += primitives();
    }
}

/// Why a walk stopped.
pub(super) enum Stop {
    /// Nothing waits any more, or any hit was asked for and found.
    Done,
    /// At an instance of the tree's group.
    At(usize),
}

/// Goes through what waits on the stack above `base`.
#[inline(always)]
pub(super) fn walk<S: Simd, C: Counter, const ANY: bool>(
    ray: &LevelRay,
    group: &Group,
    search: &mut Search,
    stack: &mut Stack,
    base: usize,
    count: &mut C,
) -> Stop {
    let nodes = &ray.tree.nodes[..];
    let box_ray = ray.cull.boxes::<S>();
    let mut end = ray.cull.end(search.t);
    let mut tfar = S::splat(end);
    'next: while stack.len > base {
        let Waiting { mut child, near } = stack.pop();
        if near > end {
            continue;
        }
        while child.is_node() {
            count.node();
            let node = &nodes[child.index()];
            let boxes = box_ray.test(node, tfar);
            let mut hit = boxes.hit;
            if hit == 0 {
                continue 'next;
            }
            let first = hit.trailing_zeros() as usize;
            hit &= hit - 1;
            child = node.children[first % LANES];
            if hit == 0 {
                continue;
            }
            if ANY {
                // What is found first is as good as what is nearest.
                while hit != 0 {
                    let lane = hit.trailing_zeros() as usize;
                    hit &= hit - 1;
                    stack.push(node.children[lane % LANES], f32::NEG_INFINITY);
                }
                continue;
            }
            let second = hit.trailing_zeros() as usize;
            hit &= hit - 1;
            let near = S::store(boxes.near).0;
            let (d0, d1) = (near[first % LANES], near[second % LANES]);
            if hit == 0 {
                let (c0, c1) = (child, node.children[second % LANES]);
                if d0 <= d1 {
                    stack.push(c1, d1);
                } else {
                    stack.push(c0, d0);
                    child = c1;
                }
                continue;
            }
            let from = stack.len;
            stack.push(child, d0);
            stack.push(node.children[second % LANES], d1);
            while hit != 0 {
                let lane = hit.trailing_zeros() as usize;
                hit &= hit - 1;
                stack.push(node.children[lane % LANES], near[lane % LANES]);
            }
            stack.sort(from);
            child = stack.pop().child;
        }
        let closer = match child.target() {
            Target::Block(i) => {
                let block = &ray.tree.blocks[i];
                count.leaf(|| block.count());
                triangles::<S, ANY>(ray, group, search, block, i, end)
            }
            Target::Shapes(first, n) => {
                count.leaf(|| n as u64);
                shapes(ray, group, search, first, n)
            }
            Target::Instance(i) => return Stop::At(i),
            Target::Node(_) => false,
        };
        if closer {
            if ANY {
                return Stop::Done;
            }
            end = ray.cull.end(search.t);
            tfar = S::splat(end);
        }
    }
    Stop::Done
}

/// Whether one of a block's triangles is the closest hit now, or any hit.
#[inline(always)]
fn triangles<S: Simd, const ANY: bool>(
    ray: &LevelRay,
    group: &Group,
    search: &mut Search,
    block: &Block,
    index: usize,
    end: f32,
) -> bool {
    let candidates =
        if ANY { ray.cull.triangles::<S, true>(block, end) } else { ray.cull.triangles::<S, false>(block, end) };
    if ANY && candidates.certain != 0 && !ray.tree.has_filters {
        search.found = Some((0, 0));
        return true;
    }
    let mut maybe = candidates.maybe;
    if maybe == 0 {
        return false;
    }
    let test = TriangleRay::new(ray.exact.o, ray.exact.d);
    let mut closer = false;
    while maybe != 0 {
        let lane = maybe.trailing_zeros() as usize;
        maybe &= maybe - 1;
        // NaN, of a ray within the triangle's plane, is no hit.
        let Some(t) = test.distance(block.corners(lane)) else { continue };
        if !(t >= ray.exact.tnear && t <= search.t) {
            continue;
        }
        let owner = ray.tree.owner(index, lane);
        let (prim, path) = (ray.tree.ids[index].prim[lane % LANES], ray.first_path + u64::from(owner));
        if ray.tree.has_filters && !stands(ray, group, search, owner, t, prim, path) {
            continue;
        }
        closer |= search.offer(t, prim, path);
        if ANY && closer {
            return true;
        }
    }
    closer
}

/// Asks the filter of a mesh whether a hit counts.
#[cold]
fn stands(
    ray: &LevelRay,
    group: &Group,
    search: &Search,
    owner: u32,
    t: f64,
    prim: u32,
    path: u64,
) -> bool {
    let mut stands = false;
    let leaf = &group.leaves[owner as usize];
    let hit = Hit { t: t as f32, prim, path };
    search.failure.guard(|| stands = accepted(leaf, &ray.exact, &hit, search.key));
    stands
}

/// Whether one of some primitives, tested by their shapes' own code, is the closest hit now.
#[inline(never)]
fn shapes(
    ray: &LevelRay,
    group: &Group,
    search: &mut Search,
    first: usize,
    n: usize,
) -> bool {
    let mut closer = false;
    for p in &ray.tree.shapes[first..first + n] {
        let path = ray.first_path + u64::from(p.leaf);
        let leaf = &group.leaves[p.leaf as usize];
        let shortened = LocalRay { tfar: search.t, ..ray.exact };
        let mut t = None;
        search.failure.guard(|| t = first_crossing(leaf, &shortened, p.prim, path, search.key));
        closer |= t.is_some_and(|t| search.offer(t, p.prim, path));
    }
    closer
}
