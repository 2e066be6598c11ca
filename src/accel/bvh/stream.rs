//! Batches of rays with something in common. Up to 64 go through the tree together: a node is opened once for all of
//! them that may meet it, and they are tested against it without a branch between them; what waits on the stack is a
//! child and the set of its rays (Barringer and Akenine-Moeller, "Dynamic Ray Stream Traversal", 2014). Rays that run
//! nearly parallel are tested eight at a time, against the boxes that a frustum around all of them meets.

use super::columns::{Columns, RAYS};
use super::layout::{Child, Node, Target, Tree};
use super::open::{Frustum, Opened, open_by_box, open_by_ray};
use super::ray::sign;
use super::simd::{LANES, Simd};
use super::walk::{Search, Stack, decide, decide_rarely, leaf_of};
use super::{Kernel, batch::Sink};
use crate::base::ray::{Coherence, RayBatch};
use crate::math::aabb::round_up;

/// A child, and which rays may meet it.
#[derive(Clone, Copy)]
struct Waiting {
    rays: u64,
    child: Child,
    /// Where the first of them enters.
    near: f32,
}

/// What has been found for the rays of a stream.
struct Results {
    /// Rays with a hit; the others have nothing below.
    found: u64,
    t: [f64; RAYS],
    prim: [u32; RAYS],
    path: [u64; RAYS],
    key: [u32; RAYS],
}

/// Scratch of a thread.
pub(super) struct Room {
    columns: Columns,
    results: Results,
    waiting: Vec<Waiting>,
    stack: Stack,
    /// Rays by octant, of a batch.
    order: Vec<u32>,
}

impl Default for Room {
    fn default() -> Self {
        Room {
            columns: Columns::ZERO,
            results: Results { found: 0, t: [0.0; RAYS], prim: [0; RAYS], path: [0; RAYS], key: [0; RAYS] },
            waiting: Vec::new(),
            stack: Stack::default(),
            order: Vec::new(),
        }
    }
}

/// How many visits streams made, and how many rays took part in them.
#[derive(Default)]
struct Sharing {
    visits: usize,
    rays: usize,
}

impl Kernel {
    /// Traces the rays of a batch and hands what was found to `out`, while they have something in common. Returns the
    /// numbers of those that remain.
    #[inline(always)]
    pub(super) fn streams<'r, S: Simd, const ANY: bool>(
        &self,
        rays: &RayBatch,
        coherence: Coherence,
        out: &mut impl Sink,
        room: &'r mut Room,
    ) -> &'r [u32] {
        let tree = &self.trees[self.root()];
        let Some(root) = tree.root else { return &[] };
        if coherence == Coherence::Coherent {
            for at in (0..rays.len()).step_by(RAYS) {
                let n = RAYS.min(rays.len() - at);
                room.columns.set_all(rays, at..at + n);
                room.columns.pad(n);
                room.results.key[..n].copy_from_slice(&rays.key[at..at + n]);
                let plain = room.columns.prepare::<S>(n, tree);
                room.results.found = 0;
                let mut rest = plain;
                while rest != 0 {
                    let r = rest.trailing_zeros() as usize;
                    let same = rest & room.columns.same_octant::<S>(r, n);
                    rest &= !same;
                    // A frustum is around all rays: it is of use if those are all.
                    let whole = same == u64::MAX >> (RAYS - n);
                    let frustum = Frustum::<S>::new(&room.columns, n, tree.extent);
                    let frustum = if whole { Some(&frustum) } else { None };
                    self.stream::<S, ANY>(same, root, frustum, room, &mut Sharing::default());
                }
                self.deliver::<S, ANY>(rays, n, plain, |r| at + r, out, room);
            }
            return &[];
        }
        sort_by_octant(rays, &mut room.order);
        let mut sharing = Sharing::default();
        let mut at = 0;
        while at < room.order.len() && sharing.rays >= sharing.visits * LEAST_SHARING {
            let of = octant(rays, room.order[at] as usize);
            let rest = &room.order[at..];
            let n = rest.iter().take(RAYS).take_while(|&&i| octant(rays, i as usize) == of).count();
            for (r, &i) in rest[..n].iter().enumerate() {
                room.columns.set(r, rays, i as usize);
                room.results.key[r] = rays.key[i as usize];
            }
            room.columns.pad(n);
            let plain = room.columns.prepare::<S>(n, tree);
            room.results.found = 0;
            self.stream::<S, ANY>(plain, root, None, room, &mut sharing);
            let order = std::mem::take(&mut room.order);
            self.deliver::<S, ANY>(rays, n, plain, |r| order[at + r] as usize, out, room);
            room.order = order;
            at += n;
        }
        &room.order[at..]
    }

    /// Hands over what was found for the first `n` rays, after searching for those that are not plain one by one.
    #[inline(always)]
    fn deliver<S: Simd, const ANY: bool>(
        &self,
        rays: &RayBatch,
        n: usize,
        plain: u64,
        index: impl Fn(usize) -> usize,
        out: &mut impl Sink,
        room: &mut Room,
    ) {
        let mut odd = !plain & u64::MAX >> (RAYS - n);
        while odd != 0 {
            let i = index(odd.trailing_zeros() as usize);
            odd &= odd - 1;
            let search = self.search::<S, (), ANY>(&rays.get(i), &mut room.stack, &mut ());
            if let Some((prim, path)) = search.found {
                out.take(i, search.t, prim, path);
            }
        }
        let mut found = room.results.found;
        while found != 0 {
            let r = found.trailing_zeros() as usize;
            found &= found - 1;
            let results = &room.results;
            out.take(index(r), results.t[r], results.prim[r], results.path[r]);
        }
    }

    /// Searches the tree for the rays of a set, all of one octant.
    #[inline(always)]
    fn stream<S: Simd, const ANY: bool>(
        &self,
        mut alive: u64,
        root: Child,
        frustum: Option<&Frustum<S>>,
        room: &mut Room,
        sharing: &mut Sharing,
    ) {
        if alive == 0 {
            return;
        }
        let tree = &self.trees[self.root()];
        let Room { columns, results, waiting, stack, .. } = room;
        let r = alive.trailing_zeros() as usize;
        let first = [sign(columns.d[0].get(r)), sign(columns.d[1].get(r)), sign(columns.d[2].get(r))];
        waiting.clear();
        waiting.push(Waiting { child: root, rays: alive, near: 0.0 });
        while let Some(Waiting { child, mut rays, .. }) = waiting.pop() {
            if ANY {
                rays &= alive;
                if rays == 0 {
                    continue;
                }
            }
            let count = rays.count_ones();
            sharing.visits += 1;
            sharing.rays += count as usize;
            if child.is_node() {
                let node = &tree.nodes()[child.index()];
                // A ray against eight boxes costs about twice what eight rays against one do.
                let lanes = match frustum {
                    Some(f) if count >= 8 => f.lanes(node, first),
                    _ => 0xff,
                };
                if lanes == 0 {
                    continue;
                }
                let opened = if lanes.count_ones() <= count / 4 {
                    open_by_box::<S, ANY>(columns, first, node, rays, lanes)
                } else {
                    open_by_ray::<S, ANY>(columns, first, node, rays)
                };
                push::<S, ANY>(tree, &opened, node, waiting);
                continue;
            }
            let block = match child.target() {
                Target::Block(i) if tree.slack != 0.0 => Some((i, &tree.blocks()[i])),
                _ => None,
            };
            while rays != 0 {
                let r = rays.trailing_zeros() as usize % RAYS;
                rays &= rays - 1;
                let work = if let Some((i, block)) = block {
                    let (tnear, tfar) = (columns.tnear.get(r), columns.tfar.get(r));
                    let candidates = columns.sheared.ray(r).test::<S, ANY>(block, tnear, tfar);
                    if candidates.maybe == 0 {
                        continue;
                    }
                    if ANY && candidates.certain != 0 && !tree.has_filters {
                        alive &= !(1 << r);
                        results.found |= 1 << r;
                        continue;
                    }
                    LeafWork::Candidates(i, candidates.maybe)
                } else {
                    LeafWork::Child(child)
                };
                if self.leaf::<S, ANY>(r, work, columns, results, stack) {
                    if ANY {
                        alive &= !(1 << r);
                    } else {
                        columns.tfar.set(r, round_up(results.t[r]));
                    }
                }
            }
        }
    }

    /// Searches a leaf for ray `r`, and says whether that has a closer hit now.
    #[inline(always)]
    fn leaf<S: Simd, const ANY: bool>(
        &self,
        r: usize,
        work: LeafWork,
        columns: &Columns,
        results: &mut Results,
        stack: &mut Stack,
    ) -> bool {
        let tree = &self.trees[self.root()];
        let group = &self.geometry.groups[self.root()];
        let ray = columns.ray(r, tree);
        // A ray that asks for any hit has none while it is searched for.
        let has = !ANY && results.found >> r & 1 == 1;
        let tfar = columns.tfar.get(r);
        let t = if has { results.t[r] } else { f64::from(tfar) };
        let mut search = Search::ending(t, results.key[r], &self.failure);
        search.found = has.then(|| (results.prim[r], results.path[r]));
        let closer = match work {
            LeafWork::Candidates(i, maybe) if ANY => decide_rarely(&ray, group, &mut search, i, maybe),
            LeafWork::Candidates(i, maybe) => decide::<false>(&ray, group, &mut search, i, maybe),
            LeafWork::Child(child) if matches!(child.target(), Target::Instance(_)) => {
                let before = search.found;
                stack.len = 0;
                stack.reserve(tree.waiting);
                stack.push(child, f32::NEG_INFINITY);
                self.rest::<(), ANY>(&ray.level(), &mut search, stack, &mut ());
                search.found != before
            }
            LeafWork::Child(child) => leaf_of::<S, ANY>(&ray, group, &mut search, child, tfar),
        };
        if closer {
            let (prim, path) = search.found.unwrap_or_default();
            results.found |= 1 << r;
            (results.t[r], results.prim[r], results.path[r]) = (search.t, prim, path);
        }
        closer
    }
}

/// What is left to do in a leaf for a ray.
#[derive(Clone, Copy)]
enum LeafWork {
    /// The lanes of a block that it may meet.
    Candidates(usize, u32),
    /// All.
    Child(Child),
}

/// Streams whose visits serve fewer rays than this on average gain nothing.
const LEAST_SHARING: usize = 3;

/// Puts the children of a node that rays may meet on the stack: the nearest last, unless any hit will do.
#[inline(always)]
fn push<S: Simd, const ANY: bool>(tree: &Tree, opened: &Opened, node: &Node, waiting: &mut Vec<Waiting>) {
    let from = waiting.len();
    let mut hit = opened.hit;
    while hit != 0 {
        let lane = hit.trailing_zeros() as usize % LANES;
        hit &= hit - 1;
        let child = node.children.0[lane];
        tree.fetch::<S>(child);
        waiting.push(Waiting { child, rays: opened.rays[lane], near: opened.near[lane] });
    }
    if ANY {
        return;
    }
    let part = &mut waiting[from..];
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

/// The signs of a direction, three bits.
#[inline(always)]
fn octant(rays: &RayBatch, i: usize) -> usize {
    sign(rays.dx[i]) | sign(rays.dy[i]) << 1 | sign(rays.dz[i]) << 2
}

/// The numbers of all rays, by octant, and within one in their order.
fn sort_by_octant(rays: &RayBatch, order: &mut Vec<u32>) {
    let n = rays.len();
    let mut starts = [0usize; 9];
    (0..n).for_each(|i| starts[octant(rays, i) + 1] += 1);
    (0..8).for_each(|o| starts[o + 1] += starts[o]);
    order.resize(n, 0);
    for i in 0..n {
        let place = &mut starts[octant(rays, i)];
        order[*place] = i as u32;
        *place += 1;
    }
}
