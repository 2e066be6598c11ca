//! Nodes of eight children, from the top down: of the sets of a node the one with the largest surface is split, until
//! there are eight (Wald, Benthin, Boulos, "Getting Rid of Packets", 2008).

use super::refs::{Kind, Ref};
use super::split::{Set, Units, split};
use crate::accel::bvh::layout::{
    Block, BlockIds, Child, Instance, MAX_INDEX, MAX_SHAPES, Node, ShapePrimitive, Target,
};
use crate::accel::bvh::simd::LANES;
use crate::base::geometry::Group;
use crate::error::{Error, Result};
use crate::math::aabb::Aabb;
use rayon::prelude::*;

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

impl Part {
    /// Appends `o`, whose root is `child`, and returns where that is now.
    fn append(&mut self, mut o: Part, child: Child) -> Result<Child> {
        let (nodes, blocks) = (self.nodes.len(), self.blocks.len());
        let (shapes, instances) = (self.shapes.len(), self.instances.len());
        let most = (nodes + o.nodes.len())
            .max(blocks + o.blocks.len())
            .max(shapes + o.shapes.len())
            .max(instances + o.instances.len());
        if most > MAX_INDEX {
            return Err(too_many());
        }
        let moved = |c: Child| c.moved(nodes, blocks, shapes, instances);
        for node in &mut o.nodes {
            for c in &mut node.children {
                *c = moved(*c);
            }
        }
        self.nodes.append(&mut o.nodes);
        self.blocks.append(&mut o.blocks);
        self.ids.append(&mut o.ids);
        self.owners.append(&mut o.owners);
        self.shapes.append(&mut o.shapes);
        self.instances.append(&mut o.instances);
        Ok(moved(child))
    }
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

impl Top {
    /// Puts the parts together, in order.
    pub(super) fn flatten(self, into: &mut Part) -> Result<Child> {
        match self {
            Top::Part(part, root) => into.append(part, root),
            Top::Node(children) => {
                let index = into.nodes.len();
                into.nodes.push(Node::empty());
                for (lane, (bounds, top)) in children.into_iter().enumerate() {
                    let child = top.flatten(into)?;
                    into.nodes[index].set(lane, &bounds, child);
                }
                Ok(Child::new(Target::Node(index)))
            }
        }
    }
}

/// Builds large sets by several threads. `refs` are those of the set, which starts at 0.
pub(super) fn build_top(refs: &mut [Ref], set: Set, plan: &Plan) -> Result<Top> {
    if set.len() < PARALLEL {
        let mut part = Part::default();
        let root = build_part(refs, &set, plan, &mut part)?;
        return Ok(Top::Part(part, root));
    }
    let sets = eight_sets(refs, &set, plan);
    // Each set's own primitives, so that the sets can be worked on at once.
    let mut rest = refs;
    let mut apart = Vec::with_capacity(sets.len());
    for s in sets {
        let (own, other) = rest.split_at_mut(s.len());
        rest = other;
        apart.push((own, Set { start: 0, end: s.len(), ..s }));
    }
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
    part.len() <= most && part.iter().all(|r| r.tag() == part[0].tag())
}

/// Up to eight sets, in the order of their primitives; one if the set is a leaf.
fn eight_sets(refs: &mut [Ref], set: &Set, plan: &Plan) -> Vec<Set> {
    let mut sets = Vec::with_capacity(LANES);
    sets.push((*set, is_leaf(refs, set, plan)));
    while sets.len() < LANES {
        let area = |i: &usize| sets[*i].0.bounds.half_area();
        let inner = (0..sets.len()).filter(|&i| !sets[i].1);
        let Some(largest) = inner.max_by(|a, b| area(a).total_cmp(&area(b))) else { break };
        let [left, right] = split(refs, &sets[largest].0, plan.bins, plan.units);
        sets[largest] = (left, is_leaf(refs, &left, plan));
        sets.insert(largest + 1, (right, is_leaf(refs, &right, plan)));
    }
    sets.into_iter().map(|(s, _)| s).collect()
}

/// Builds a set into `part`. Recursion is as deep as the tree, which `split` bounds.
fn build_part(refs: &mut [Ref], set: &Set, plan: &Plan, part: &mut Part) -> Result<Child> {
    if is_leaf(refs, set, plan) {
        return leaf(&refs[set.start..set.end], plan, part);
    }
    let sets = eight_sets(refs, set, plan);
    let index = part.nodes.len();
    if index >= MAX_INDEX {
        return Err(too_many());
    }
    part.nodes.push(Node::empty());
    for (lane, s) in sets.iter().enumerate() {
        let child = build_part(refs, s, plan, part)?;
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
