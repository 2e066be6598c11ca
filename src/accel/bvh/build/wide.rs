//! Nodes of eight children, from the top down: of the sets of a node the one with the largest surface is split, until
//! there are eight (Wald, Benthin, Boulos, "Getting Rid of Packets", 2008).

use super::refs::{Kind, Ref};
use super::split::{Bins, NO_BINS, Set, Units, split};
use crate::accel::bvh::layout::{
    Block, BlockIds, Child, Instance, MAX_INDEX, MAX_SHAPES, Node, ShapePrimitive, Target, Tree,
};
use crate::accel::bvh::simd::LANES;
use crate::base::geometry::Group;
use crate::error::{Error, Result};
use crate::math::aabb::Aabb;
use crate::math::pages::Pages;
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// Sets of at least so many are built by several threads.
const PARALLEL: usize = 1 << 14;

/// What a build goes by.
#[derive(Clone, Copy)]
pub(super) struct Plan<'a> {
    pub(super) group: &'a Group,
    pub(super) bins: usize,
    pub(super) units: Units,
    /// Whether leaves belong to more than one mesh.
    pub(super) owners: bool,
    /// The most procedural primitives of one leaf.
    pub(super) shapes_per_leaf: usize,
}

/// A part of a tree, with indices of its own.
#[derive(Default)]
pub(super) struct Part {
    pub(super) nodes: Vec<Node>,
    pub(super) blocks: Vec<Block>,
    pub(super) ids: Vec<BlockIds>,
    pub(super) owners: Vec<[u32; LANES]>,
    pub(super) shapes: Vec<ShapePrimitive>,
    pub(super) instances: Vec<Instance>,
}

fn too_many() -> Error {
    Error::Usage(format!("a group holds more than {MAX_INDEX} leaves; split it into several"))
}

/// A tree while its parts are still apart.
pub(super) enum Top {
    /// A node and what hangs below it.
    Node(Vec<(Aabb, Top)>),
    /// A finished part and its root.
    Part(Part, Child),
}

/// Where the arrays of a part begin in those of the tree.
#[derive(Debug, Clone, Copy, Default)]
struct Start {
    nodes: usize,
    blocks: usize,
    shapes: usize,
    instances: usize,
}

impl Start {
    fn after(self, p: &Part) -> Start {
        Start {
            nodes: self.nodes + p.nodes.len(),
            blocks: self.blocks + p.blocks.len(),
            shapes: self.shapes + p.shapes.len(),
            instances: self.instances + p.instances.len(),
        }
    }

    fn moved(self, child: Child) -> Child {
        child.moved(self.nodes, self.blocks, self.shapes, self.instances)
    }
}

impl Top {
    /// The nodes above all parts, and the parts in order.
    fn take_apart(self, upper: &mut usize, parts: &mut Vec<(Part, Child)>) -> Shape {
        match self {
            Top::Part(part, root) => {
                parts.push((part, root));
                Shape::Part(parts.len() - 1)
            }
            Top::Node(children) => {
                *upper += 1;
                Shape::Node(children.into_iter().map(|(b, t)| (b, t.take_apart(upper, parts))).collect())
            }
        }
    }

    /// Puts the parts together into a tree's arrays, by all threads.
    pub(super) fn assemble(self, tree: &mut Tree) -> Result<()> {
        let (mut upper, mut parts) = (0, Vec::new());
        let shape = self.take_apart(&mut upper, &mut parts);
        let mut starts = Vec::with_capacity(parts.len());
        let mut next = Start { nodes: upper, ..Start::default() };
        for (part, _) in &parts {
            starts.push(next);
            next = next.after(part);
        }
        if next.nodes.max(next.blocks).max(next.shapes).max(next.instances) > MAX_INDEX {
            return Err(too_many());
        }
        let roots: Vec<Child> = parts.iter().zip(&starts).map(|((_, root), s)| s.moved(*root)).collect();
        let mut top = Vec::with_capacity(upper);
        tree.root = Some(shape.write(&roots, &mut top));
        for (part, _) in &mut parts {
            tree.owners.append(&mut part.owners);
            tree.shapes.append(&mut part.shapes);
            tree.instances.append(&mut part.instances);
        }
        // Each array of a part is given up when it has been copied.
        let nodes = take_all(&mut parts, |p| &mut p.nodes);
        let lengths: Vec<usize> = [upper].into_iter().chain(nodes.iter().map(|n| n.1)).collect();
        let node_pages = Pages::from_parts(&lengths, |i, to| match i.checked_sub(1) {
            None => to.copy_from_slice(&top),
            Some(part) => {
                to.copy_from_slice(&nodes[part].take());
                let children = to.iter_mut().flat_map(|n| &mut n.children.0);
                children.for_each(|c| *c = starts[part].moved(*c));
            }
        });
        let blocks = take_all(&mut parts, |p| &mut p.blocks);
        let lengths: Vec<usize> = blocks.iter().map(|b| b.1).collect();
        let block_pages = Pages::from_parts(&lengths, |i, to| to.copy_from_slice(&blocks[i].take()));
        let ids = take_all(&mut parts, |p| &mut p.ids);
        let id_pages = Pages::from_parts(&lengths, |i, to| to.copy_from_slice(&ids[i].take()));
        tree.fill((node_pages, next.nodes), (block_pages, next.blocks), id_pages);
        Ok(())
    }
}

/// An array that one thread takes, and its length.
struct Taken<T>(Mutex<Vec<T>>, usize);

impl<T> Taken<T> {
    fn take(&self) -> Vec<T> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

fn take_all<T>(parts: &mut [(Part, Child)], of: impl Fn(&mut Part) -> &mut Vec<T>) -> Vec<Taken<T>> {
    let take = |(part, _): &mut (Part, Child)| {
        let array = std::mem::take(of(part));
        let n = array.len();
        Taken(Mutex::new(array), n)
    };
    parts.iter_mut().map(take).collect()
}

/// The nodes above all parts.
enum Shape {
    Node(Vec<(Aabb, Shape)>),
    Part(usize),
}

impl Shape {
    /// Writes nodes in order; `roots` are those of the parts.
    fn write(&self, roots: &[Child], to: &mut Vec<Node>) -> Child {
        match self {
            Shape::Part(i) => roots[*i],
            Shape::Node(children) => {
                let index = to.len();
                to.push(Node::empty());
                for (lane, (bounds, shape)) in children.iter().enumerate() {
                    let child = shape.write(roots, to);
                    to[index].set(lane, bounds, child);
                }
                Child::new(Target::Node(index))
            }
        }
    }
}

/// Builds large sets by several threads. `refs` are those of the set, which starts at 0.
pub(super) fn build_top(refs: &mut [Ref], set: Set, plan: &Plan) -> Result<Top> {
    if set.len() < PARALLEL {
        let mut part = Part::default();
        let root = build_part(refs, &set, plan, &mut NO_BINS.clone(), &mut part)?;
        return Ok(Top::Part(part, root));
    }
    let apart = eight_sets_by_all(refs, set, plan);
    let children = apart
        .into_par_iter()
        .map(|(own, s)| Ok((bounds(&s), build_top(own, s, plan)?)))
        .collect::<Result<Vec<_>>>()?;
    Ok(Top::Node(children))
}

fn bounds(s: &Set) -> Aabb {
    Aabb { min: s.bounds.lo.truncate(), max: s.bounds.hi.truncate() }
}

/// Whether a set can be a leaf.
fn is_leaf(refs: &[Ref], s: &Set, plan: &Plan) -> bool {
    let part = &refs[s.start..s.end];
    if part.len() > LANES.max(MAX_SHAPES) {
        return false;
    }
    let most = match part[0].kind() {
        Kind::Triangle(..) => LANES,
        Kind::Shape(..) => plan.shapes_per_leaf,
        Kind::Instance(_) => 1,
    };
    part.len() <= most && part.iter().all(|r| r.is_like(&part[0]))
}

/// Up to eight sets, in the order of their primitives; one if the set is a leaf.
fn eight_sets(refs: &mut [Ref], set: &Set, plan: &Plan, room: &mut Bins) -> Vec<Set> {
    let mut sets = Vec::with_capacity(LANES);
    sets.push((*set, is_leaf(refs, set, plan)));
    while sets.len() < LANES {
        let area = |i: &usize| sets[*i].0.bounds.half_area();
        let inner = (0..sets.len()).filter(|&i| !sets[i].1);
        let Some(largest) = inner.max_by(|a, b| area(a).total_cmp(&area(b))) else { break };
        let [left, right] = split(refs, &sets[largest].0, plan.bins, plan.units, room);
        sets[largest] = (left, is_leaf(refs, &left, plan));
        sets.insert(largest + 1, (right, is_leaf(refs, &right, plan)));
    }
    sets.into_iter().map(|(s, _)| s).collect()
}

/// As [`eight_sets`], of a large set, each with its own primitives: in rounds of splits that all threads share, the
/// largest sets first.
fn eight_sets_by_all<'r>(refs: &'r mut [Ref], set: Set, plan: &Plan) -> Vec<(&'r mut [Ref], Set)> {
    let mut parts = vec![(refs, set)];
    while parts.len() < LANES {
        let mut inner: Vec<usize> =
            (0..parts.len()).filter(|&i| !is_leaf(parts[i].0, &parts[i].1, plan)).collect();
        if inner.is_empty() {
            break;
        }
        let area = |i: &usize| parts[*i].1.bounds.half_area();
        inner.sort_by(|a, b| area(b).total_cmp(&area(a)));
        inner.truncate(LANES - parts.len());
        let of = |(i, (own, s)): (usize, (&'r mut [Ref], Set))| {
            if !inner.contains(&i) {
                return vec![(own, s)];
            }
            let [left, right] = split(own, &s, plan.bins, plan.units, &mut NO_BINS.clone());
            let (n, m) = (left.len(), right.len());
            let (a, b) = own.split_at_mut(n);
            vec![(a, Set { start: 0, end: n, ..left }), (b, Set { start: 0, end: m, ..right })]
        };
        parts = parts.into_par_iter().enumerate().flat_map_iter(of).collect();
    }
    parts
}

/// Builds a set into `part`. Recursion is as deep as the tree, which `split` bounds.
fn build_part(refs: &mut [Ref], set: &Set, plan: &Plan, room: &mut Bins, part: &mut Part) -> Result<Child> {
    if is_leaf(refs, set, plan) {
        return leaf(&refs[set.start..set.end], plan, part);
    }
    let sets = eight_sets(refs, set, plan, room);
    let index = part.nodes.len();
    if index >= MAX_INDEX {
        return Err(too_many());
    }
    part.nodes.push(Node::empty());
    for (lane, s) in sets.iter().enumerate() {
        let child = build_part(refs, s, plan, room, part)?;
        part.nodes[index].set(lane, &bounds(s), child);
    }
    Ok(Child::new(Target::Node(index)))
}

/// Primitives of one kind, as few as a leaf may hold.
fn leaf(refs: &[Ref], plan: &Plan, part: &mut Part) -> Result<Child> {
    if part.blocks.len().max(part.shapes.len()).max(part.instances.len()) + MAX_SHAPES > MAX_INDEX {
        return Err(too_many());
    }
    let target = match refs[0].kind() {
        Kind::Triangle(..) => {
            let (mut block, mut prim, mut owners) = (Block::empty(), [0; LANES], [0; LANES]);
            for (lane, r) in refs.iter().enumerate() {
                let Kind::Triangle(leaf, number) = r.kind() else { continue };
                let mesh = plan.group.leaves[leaf as usize].shape.triangles();
                block.set(lane, mesh.expect("it was a mesh when its triangles were counted").corners(number));
                (prim[lane], owners[lane]) = (number, leaf);
            }
            part.blocks.push(block);
            part.ids.push(BlockIds { prim });
            if plan.owners {
                part.owners.push(owners);
            }
            Target::Block(part.blocks.len() - 1)
        }
        Kind::Shape(..) => {
            let first = part.shapes.len();
            for r in refs {
                let Kind::Shape(leaf, prim) = r.kind() else { continue };
                part.shapes.push(ShapePrimitive { leaf, prim });
            }
            Target::Shapes(first, refs.len())
        }
        Kind::Instance(child) => {
            let c = &plan.group.children[child as usize];
            let (group, first_path, from_parent) = (c.group as u32, c.first_path, c.from_parent);
            part.instances.push(Instance { group, child, first_path, from_parent });
            Target::Instance(part.instances.len() - 1)
        }
    };
    Ok(Child::new(target))
}
