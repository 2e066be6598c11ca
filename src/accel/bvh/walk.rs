//! One ray through one tree.

use super::count::Counter;
use super::layout::{Child, Node, Target, Tree};
use super::ray::{BoxRays, Boxes, TreeRay};

use super::simd::{LANES, Lanes, Simd};
use crate::accel::{accepted, failure::Failure, first_crossing};
use crate::base::geometry::{Group, Leaf};
use crate::base::hit::Hit;
use crate::base::shape::LocalRay;
use crate::math::triangle::TriangleRay;
use bytemuck::{cast_ref, cast_slice_mut};

/// The children that wait for their turn in a search. Levels of nesting share it: each counts from where it began.
#[derive(Default)]
pub(super) struct Stack {
    children: Vec<Child>,
    /// Where the ray enters their boxes.
    near: Vec<f32>,
    /// How many wait.
    pub(super) len: usize,
}

impl Stack {
    /// Makes room for what a tree may leave waiting.
    #[inline(always)]
    pub(super) fn reserve(&mut self, more: usize) {
        if self.near.len() < self.len + more + LANES {
            self.grow(more);
        }
    }

    #[cold]
    fn grow(&mut self, more: usize) {
        let room = (self.len + more + LANES).next_power_of_two();
        self.children.resize(room, Child::NONE);
        self.near.resize(room, 0.0);
    }

    #[inline(always)]
    pub(super) fn push(&mut self, child: Child, near: f32) {
        self.children[self.len] = child;
        self.near[self.len] = near;
        self.len += 1;
    }

    /// Pushes the lanes of a set, without a branch: how many those are cannot be predicted.
    #[inline(always)]
    fn push_lanes<S: Simd>(&mut self, node: &Node, near: S::V, set: u32) {
        let end = self.len + LANES;
        let children = S::compress(S::load(cast_ref(&node.children)), set);
        let to: &mut [f32] = cast_slice_mut(&mut self.children[self.len..end]);
        to.copy_from_slice(&children.0);
        self.near[self.len..end].copy_from_slice(&S::compress(near, set).0);
        self.len += set.count_ones() as usize;
    }

    /// Brings those from `first` on into the order in which they shall be popped: the nearest last.
    #[inline(always)]
    fn sort(&mut self, first: usize) {
        let (near, children) = (&mut self.near[first..self.len], &mut self.children[first..self.len]);
        for i in 1..near.len().min(children.len()) {
            let it = (near[i], children[i]);
            let mut j = i;
            while j > 0 && near[j - 1] < it.0 {
                (near[j], children[j]) = (near[j - 1], children[j - 1]);
                j -= 1;
            }
            (near[j], children[j]) = it;
        }
    }

    /// The last one that waits; none if it lies beyond `end`.
    #[inline(always)]
    pub(super) fn pop_before(&mut self, end: f32) -> Option<Child> {
        self.len -= 1;
        (self.near[self.len] <= end).then_some(self.children[self.len])
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
    /// For a ray that ends at `t`.
    #[inline(always)]
    pub(super) fn ending(t: f64, key: u32, failure: &'a Failure) -> Self {
        Search { t, found: None, key, failure }
    }

    /// Takes a hit at `t`, which lies between the ray's ends, if it is the closest; of several at one distance the one
    /// with the smallest path, then primitive, so that the order of visits does not matter.
    #[inline(always)]
    fn offer(&mut self, t: f64, prim: u32, path: u64) -> bool {
        let closer = t < self.t
            || t == self.t
                && self.found.is_none_or(|(old_prim, old_path)| (path, prim) < (old_path, old_prim));
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
    ray: &impl TreeRay,
    boxes: &BoxRays<S>,
    group: &Group,
    search: &mut Search,
    stack: &mut Stack,
    base: usize,
    count: &mut C,
) -> Stop {
    let tree = ray.tree();
    let nodes = tree.nodes();
    let (first, tnear) = (ray.first(), S::splat(ray.tnear()));
    let mut end = ray.end(search.t);
    let mut tfar = S::splat(end);
    'next: while stack.len > base {
        let Some(mut child) = stack.pop_before(end) else { continue };
        while child.is_node() {
            count.node();
            let node = &nodes[child.index()];
            let hit = boxes.test(first, node, tnear, tfar);
            match choose::<S, ANY>(tree, node, &hit, stack) {
                Some(nearest) => child = nearest,
                None => continue 'next,
            }
        }
        if let Target::Instance(i) = child.target() {
            return Stop::At(i);
        }
        count.leaf(|| primitives(tree, child));
        if leaf_of::<S, ANY>(ray, group, search, child, end) {
            if ANY {
                return Stop::Done;
            }
            end = ray.end(search.t);
            tfar = S::splat(end);
        }
    }
    Stop::Done
}

/// The child to visit next, of those whose boxes are hit: the nearest. The others wait on the stack, the nearest last.
#[inline(always)]
fn choose<S: Simd, const ANY: bool>(
    tree: &Tree,
    node: &Node,
    boxes: &Boxes<S>,
    stack: &mut Stack,
) -> Option<Child> {
    let mut hit = S::bits(boxes.hit);
    if hit == 0 {
        return None;
    }
    let first = hit.trailing_zeros() as usize;
    hit &= hit - 1;
    let child = node.children.0[first % LANES];
    tree.fetch::<S>(child);
    if hit == 0 {
        return Some(child);
    }
    if ANY {
        // What is found first is as good as what is nearest.
        while hit != 0 {
            let lane = hit.trailing_zeros() as usize;
            hit &= hit - 1;
            let child = node.children.0[lane % LANES];
            tree.fetch::<S>(child);
            stack.push(child, f32::NEG_INFINITY);
        }
        return Some(child);
    }
    let near = S::store(boxes.near).0;
    let second = hit.trailing_zeros() as usize;
    hit &= hit - 1;
    let (d0, d1) = (near[first % LANES], near[second % LANES]);
    let other = node.children.0[second % LANES];
    tree.fetch::<S>(other);
    if hit == 0 {
        let (nearest, (child, near)) = if d0 <= d1 { (child, (other, d1)) } else { (other, (child, d0)) };
        stack.push(child, near);
        return Some(nearest);
    }
    let from = stack.len;
    stack.push(child, d0);
    stack.push(other, d1);
    while hit != 0 {
        let lane = hit.trailing_zeros() as usize;
        hit &= hit - 1;
        let child = node.children.0[lane % LANES];
        tree.fetch::<S>(child);
        stack.push(child, near[lane % LANES]);
    }
    stack.sort(from);
    stack.len -= 1;
    Some(stack.children[stack.len])
}

/// As `choose`, without a branch on how many are hit, and so without order among the others: for rays that take turns,
/// whose next visit is not waited for, so that mispredicted branches are what costs.
#[inline(always)]
pub(super) fn choose_one<S: Simd, const ANY: bool>(
    node: &Node,
    boxes: &Boxes<S>,
    stack: &mut Stack,
) -> Option<Child> {
    let hit = S::bits(boxes.hit);
    if hit == 0 {
        return None;
    }
    let lane = if ANY {
        // What is found first is as good as what is nearest.
        hit.trailing_zeros() as usize
    } else {
        // Distances are not negative, so their order is that of their bits; the last three hold the lane.
        let keys = S::or(S::and(boxes.near, S::splat(f32::from_bits(!7))), S::load(&LANE_BITS));
        S::least(S::select(boxes.hit, keys, S::splat(f32::INFINITY))).to_bits() as usize
    } % LANES;
    stack.push_lanes::<S>(node, boxes.near, hit & !(1 << lane));
    Some(node.children.0[lane])
}

/// The numbers of the lanes, as bits.
static LANE_BITS: Lanes = {
    let mut lanes = Lanes([0.0; LANES]);
    let mut i = 0;
    while i < LANES {
        lanes.0[i] = f32::from_bits(i as u32);
        i += 1;
    }
    lanes
};

/// How many primitives a leaf holds.
fn primitives(tree: &Tree, child: Child) -> u64 {
    match child.target() {
        Target::Block(i) => tree.blocks()[i].count(),
        Target::Shapes(_, n) => n as u64,
        Target::Node(_) | Target::Instance(_) => 0,
    }
}

/// Whether a primitive of a leaf is the closest hit now, or any hit. `end` is the ray's end, for culling.
#[inline(always)]
pub(super) fn leaf_of<S: Simd, const ANY: bool>(
    ray: &impl TreeRay,
    group: &Group,
    search: &mut Search,
    child: Child,
    end: f32,
) -> bool {
    match child.target() {
        Target::Block(i) => triangles::<S, ANY>(ray, group, search, i, end),
        Target::Shapes(first, n) => {
            let tree = ray.tree();
            shapes(tree, &ray.exact(), group, ray.first_path(), search, first, n)
        }
        Target::Node(_) | Target::Instance(_) => false,
    }
}

/// Whether one of a block's triangles is the closest hit now, or any hit.
#[inline(always)]
fn triangles<S: Simd, const ANY: bool>(
    ray: &impl TreeRay,
    group: &Group,
    search: &mut Search,
    index: usize,
    end: f32,
) -> bool {
    let tree = ray.tree();
    let block = &tree.blocks()[index];
    if tree.slack == 0.0 {
        return triangles_by_single::<S>(ray, group, search, index, end);
    }
    let candidates = ray.sheared().test::<S, ANY>(block, ray.tnear(), end);
    if candidates.maybe == 0 {
        return false;
    }
    if ANY && candidates.certain != 0 && !tree.has_filters {
        search.found = Some((0, 0));
        return true;
    }
    S::prefetch(&tree.ids()[index]);
    if ANY {
        return decide_rarely(ray, group, search, index, candidates.maybe);
    }
    decide::<false>(ray, group, search, index, candidates.maybe)
}

/// Most rays that ask for any hit are answered by single precision.
#[cold]
#[inline(never)]
pub(super) fn decide_rarely(
    ray: &impl TreeRay,
    group: &Group,
    search: &mut Search,
    index: usize,
    maybe: u32,
) -> bool {
    decide::<true>(ray, group, search, index, maybe)
}

/// Whether one of those lanes of a block that a ray may meet is the closest hit now, or any hit.
#[inline(always)]
pub(super) fn decide<const ANY: bool>(
    ray: &impl TreeRay,
    group: &Group,
    search: &mut Search,
    index: usize,
    mut maybe: u32,
) -> bool {
    let tree = ray.tree();
    let block = &tree.blocks()[index];
    let exact = ray.exact();
    let test = TriangleRay::new(exact.o, exact.d);
    let mut closer = false;
    while maybe != 0 {
        let lane = maybe.trailing_zeros() as usize;
        maybe &= maybe - 1;
        // NaN, of a ray within the triangle's plane, is no hit.
        let Some(t) = test.distance_by_axes(block.corners(lane, test.axes())) else { continue };
        if !(t >= exact.tnear && t <= search.t) {
            continue;
        }
        let owner = tree.owner(index, lane);
        let (prim, path) = (tree.ids()[index].prim[lane % LANES], ray.first_path() + u64::from(owner));
        let hit = Hit { t: t as f32, prim, path };
        if tree.has_filters && !stands(&exact, &group.leaves[owner as usize], search, &hit) {
            continue;
        }
        closer |= search.offer(t, prim, path);
        if ANY && closer {
            return true;
        }
    }
    closer
}

/// The same in the mode that is fast and not strict. It takes the first of several at one distance, in any order.
#[inline(always)]
fn triangles_by_single<S: Simd>(
    ray: &impl TreeRay,
    group: &Group,
    search: &mut Search,
    index: usize,
    end: f32,
) -> bool {
    let tree = ray.tree();
    let (mut hits, t) = ray.sheared().hits::<S>(&tree.blocks()[index], ray.tnear(), end);
    let mut closer = false;
    while hits != 0 {
        let lane = hits.trailing_zeros() as usize % LANES;
        hits &= hits - 1;
        let owner = tree.owner(index, lane);
        let (prim, path) = (tree.ids()[index].prim[lane], ray.first_path() + u64::from(owner));
        let t = ray.restored(t.0[lane]);
        let hit = Hit { t: t as f32, prim, path };
        if !tree.has_filters || stands(&ray.exact(), &group.leaves[owner as usize], search, &hit) {
            closer |= search.offer(t, prim, path);
        }
    }
    closer
}

/// Asks the filter of a mesh whether a hit counts.
#[cold]
fn stands(exact: &LocalRay, leaf: &Leaf, search: &Search, hit: &Hit) -> bool {
    let mut stands = false;
    search.failure.guard(|| stands = accepted(leaf, exact, hit, search.key));
    stands
}

/// Whether one of some primitives, tested by their shapes' own code, is the closest hit now.
#[inline(never)]
fn shapes(
    tree: &Tree,
    exact: &LocalRay,
    group: &Group,
    first_path: u64,
    search: &mut Search,
    first: usize,
    n: usize,
) -> bool {
    let mut closer = false;
    for p in &tree.shapes[first..first + n] {
        let path = first_path + u64::from(p.leaf);
        let leaf = &group.leaves[p.leaf as usize];
        let shortened = LocalRay { tfar: search.t, ..*exact };
        let mut t = None;
        search.failure.guard(|| t = first_crossing(leaf, &shortened, p.prim, path, search.key));
        closer |= t.is_some_and(|t| search.offer(t, p.prim, path));
    }
    closer
}
