//! Nodes and leaves as they lie in memory.

use super::simd::{LANES, Lanes, Simd};
use crate::math::aabb::{Aabb, DAabb};
use crate::math::pages::Pages;
use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, Vec3};

/// An inner node: the boxes of up to eight children, four cache lines in all.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C, align(64))]
pub(super) struct Node {
    /// By axis; of each the lower and the upper planes. The box of a lane without a child is inside out.
    pub(super) planes: [[Lanes; 2]; 3],
    /// By lane.
    pub(super) children: Children,
    /// To the end of the cache line.
    rest: [u32; LANES],
}

/// The children of a node, where vectors can be loaded from.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C, align(32))]
pub(super) struct Children(pub(super) [Child; LANES]);

impl Node {
    /// Without children.
    pub(super) fn empty() -> Self {
        let outside = [Lanes([f32::INFINITY; LANES]), Lanes([f32::NEG_INFINITY; LANES])];
        Node { planes: [outside; 3], children: Children([Child::NONE; LANES]), rest: [0; LANES] }
    }

    /// Sets a lane; `bounds` is not empty.
    pub(super) fn set(&mut self, lane: usize, bounds: &Aabb, child: Child) {
        for axis in 0..3 {
            self.planes[axis][0].0[lane] = bounds.min[axis];
            self.planes[axis][1].0[lane] = bounds.max[axis];
        }
        self.children.0[lane] = child;
    }

    /// The box of a lane.
    pub(super) fn bounds(&self, lane: usize) -> Aabb {
        let corner =
            |side: usize| Vec3::from_array([0, 1, 2].map(|axis: usize| self.planes[axis][side].0[lane]));
        Aabb { min: corner(0), max: corner(1) }
    }
}

/// What hangs below a lane of a node: two bits for its kind, and a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub(super) struct Child(u32);

/// A child by kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Target {
    /// Index of a node.
    Node(usize),
    /// Index of a block of triangles.
    Block(usize),
    /// The first of some procedural primitives, and how many.
    Shapes(usize, usize),
    /// Index of an instance.
    Instance(usize),
}

const KIND_SHIFT: u32 = 30;
const COUNT_SHIFT: u32 = 27;
/// The largest index.
pub(super) const MAX_INDEX: usize = (1 << COUNT_SHIFT) - 1;
/// The most procedural primitives of one leaf.
pub(super) const MAX_SHAPES: usize = 1 << (KIND_SHIFT - COUNT_SHIFT);

impl Child {
    /// In lanes without a child.
    pub(super) const NONE: Child = Child(u32::MAX);

    pub(super) fn new(target: Target) -> Self {
        let (kind, count, index) = match target {
            Target::Node(i) => (0, 1, i),
            Target::Block(i) => (1, 1, i),
            Target::Shapes(first, count) => (2, count, first),
            Target::Instance(i) => (3, 1, i),
        };
        debug_assert!(index <= MAX_INDEX && (1..=MAX_SHAPES).contains(&count));
        Child(kind << KIND_SHIFT | (count as u32 - 1) << COUNT_SHIFT | index as u32)
    }

    #[inline(always)]
    pub(super) fn index(self) -> usize {
        self.0 as usize & MAX_INDEX
    }

    #[inline(always)]
    pub(super) fn is_node(self) -> bool {
        self.0 >> KIND_SHIFT == 0
    }

    #[inline(always)]
    pub(super) fn target(self) -> Target {
        match self.0 >> KIND_SHIFT {
            0 => Target::Node(self.index()),
            1 => Target::Block(self.index()),
            2 => Target::Shapes(self.index(), (self.0 >> COUNT_SHIFT) as usize % MAX_SHAPES + 1),
            _ => Target::Instance(self.index()),
        }
    }

    /// The same child of a part of a tree whose arrays were appended to others of these lengths.
    pub(super) fn moved(self, nodes: usize, blocks: usize, shapes: usize, instances: usize) -> Self {
        Child::new(match self.target() {
            _ if self == Child::NONE => return self,
            Target::Node(i) => Target::Node(i + nodes),
            Target::Block(i) => Target::Block(i + blocks),
            Target::Shapes(first, count) => Target::Shapes(first + shapes, count),
            Target::Instance(i) => Target::Instance(i + instances),
        })
    }
}

/// Up to eight triangles with their vertices in full, so that a test reads nothing else: five cache lines.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C, align(64))]
pub(super) struct Block {
    /// By axis and corner.
    pub(super) v: [[Lanes; 3]; 3],
    /// The longest side of each triangle's box; NaN in lanes without a triangle, so that every comparison fails.
    pub(super) size: Lanes,
}

impl Block {
    /// Without triangles.
    pub(super) fn empty() -> Self {
        Block { v: [[Lanes([0.0; LANES]); 3]; 3], size: Lanes([f32::NAN; LANES]) }
    }

    pub(super) fn set(&mut self, lane: usize, corners: [Vec3; 3]) {
        for axis in 0..3 {
            for (corner, p) in corners.iter().enumerate() {
                self.v[axis][corner].0[lane] = p[axis];
            }
        }
        let longest = Aabb::from_points(corners).size().max_element();
        // The difference was rounded.
        self.size.0[lane] = longest * (1.0 + f32::EPSILON);
    }

    /// The corners of a triangle with their coordinates in the order of these axes, without loss.
    #[inline(always)]
    pub(super) fn corners(&self, lane: usize, axes: [usize; 3]) -> [[f64; 3]; 3] {
        let (lane, [x, y, z]) = (lane % LANES, axes);
        let (x, y, z) = (&self.v[x % 3], &self.v[y % 3], &self.v[z % 3]);
        let corner = |c: usize| [x[c].0[lane].into(), y[c].0[lane].into(), z[c].0[lane].into()];
        [corner(0), corner(1), corner(2)]
    }

    /// How many lanes hold a triangle.
    pub(super) fn count(&self) -> u64 {
        self.size.0.iter().filter(|s| !s.is_nan()).count() as u64
    }
}

/// A primitive tested by its shape's own code, by leaf of the group.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct ShapePrimitive {
    pub(super) leaf: u32,
    pub(super) prim: u32,
}

/// A placed group.
#[derive(Debug, Clone, Copy)]
pub(super) struct Instance {
    /// Whose tree it is.
    pub(super) group: u32,
    /// Which of the group's children.
    pub(super) child: u32,
    /// Added to the paths below.
    pub(super) first_path: u64,
    /// Into the space of the child.
    pub(super) from_parent: DAffine3,
}

/// Which triangles a block holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct BlockIds {
    /// Triangle within its mesh, by lane.
    pub(super) prim: [u32; LANES],
}

/// Everything of one group. What rays read at random lies in large pages.
pub(super) struct Tree {
    nodes: Pages<Node>,
    pub(super) node_count: usize,
    blocks: Pages<Block>,
    pub(super) block_count: usize,
    ids: Pages<BlockIds>,
    /// Leaf of the group by block and lane; empty where all triangles are those of `only_mesh`.
    pub(super) owners: Vec<[u32; LANES]>,
    /// The group's leaf with triangles, if there is just one.
    pub(super) only_mesh: u32,
    pub(super) shapes: Vec<ShapePrimitive>,
    pub(super) instances: Vec<Instance>,
    /// None if there is nothing.
    pub(super) root: Option<Child>,
    /// Of everything.
    pub(super) bounds: Aabb,
    /// As `bounds`, and larger by more than rounding.
    pub(super) grown: DAabb,
    /// Largest sizes of coordinates, by axis.
    pub(super) extent: Vec3,
    /// 1, or 0 where boxes are not enlarged and single precision decides: fast, and not watertight.
    pub(super) slack: f32,
    /// How far from the origin a ray may start to be traced as it is.
    pub(super) reach: f64,
    /// The most that a search can leave waiting.
    pub(super) waiting: usize,
    /// Whether a hit on a triangle must be shown to a filter.
    pub(super) has_filters: bool,
}

impl Tree {
    /// With nothing in it.
    pub(super) fn empty() -> Self {
        Tree {
            nodes: Pages::from_parts(&[], |_, _| ()),
            node_count: 0,
            blocks: Pages::from_parts(&[], |_, _| ()),
            block_count: 0,
            ids: Pages::from_parts(&[], |_, _| ()),
            owners: Vec::new(),
            only_mesh: 0,
            shapes: Vec::new(),
            instances: Vec::new(),
            root: None,
            bounds: Aabb::EMPTY,
            grown: DAabb::EMPTY,
            extent: Vec3::ZERO,
            slack: 1.0,
            reach: 0.0,
            waiting: 0,
            has_filters: false,
        }
    }

    /// Takes its arrays.
    pub(super) fn fill(
        &mut self,
        nodes: (Pages<Node>, usize),
        blocks: (Pages<Block>, usize),
        ids: Pages<BlockIds>,
    ) {
        (self.nodes, self.node_count) = nodes;
        (self.blocks, self.block_count) = blocks;
        self.ids = ids;
    }

    #[inline(always)]
    pub(super) fn nodes(&self) -> &[Node] {
        self.nodes.as_slice()
    }

    #[inline(always)]
    pub(super) fn blocks(&self) -> &[Block] {
        self.blocks.as_slice()
    }

    /// By block.
    #[inline(always)]
    pub(super) fn ids(&self) -> &[BlockIds] {
        self.ids.as_slice()
    }

    /// Asks for what will be visited soon.
    #[inline(always)]
    pub(super) fn fetch<S: Simd>(&self, child: Child) {
        if child.is_node() {
            S::prefetch(&self.nodes()[child.index()]);
        } else if let Target::Block(i) = child.target() {
            S::prefetch(&self.blocks()[i]);
        }
    }

    /// The group's leaf whose triangle is in this lane.
    #[inline(always)]
    pub(super) fn owner(&self, block: usize, lane: usize) -> u32 {
        self.owners.get(block).map_or(self.only_mesh, |o| o[lane % LANES])
    }

    /// Inner nodes, leaves and primitives that a line through the bounds visits on average: each box is met by as many
    /// lines as it has surface (MacDonald and Booth, "Heuristics for Ray Tracing Using Space Subdivision", 1990).
    pub(super) fn predicted_visits(&self) -> [f64; 3] {
        let area = |b: &Aabb| f64::from(b.surface_area());
        let whole = area(&self.bounds);
        let part = |b: &Aabb| if whole > 0.0 { area(b) / whole } else { 1.0 };
        let mut sum = [0.0; 3];
        let mut add = |child: Child, part: f64| match child.target() {
            Target::Node(_) => sum[0] += part,
            leaf => {
                let primitives = match leaf {
                    Target::Block(i) => self.blocks()[i].count(),
                    Target::Shapes(_, n) => n as u64,
                    _ => 1,
                };
                sum[1] += part;
                sum[2] += part * primitives as f64;
            }
        };
        self.root.iter().for_each(|c| add(*c, 1.0));
        for node in &self.nodes()[..self.node_count] {
            for (lane, &child) in node.children.0.iter().enumerate().filter(|(_, c)| **c != Child::NONE) {
                add(child, part(&node.bounds(lane)));
            }
        }
        sum
    }

    /// Bytes of all arrays.
    pub(super) fn memory(&self) -> u64 {
        let rest =
            size_of_val(&self.owners[..]) + size_of_val(&self.shapes[..]) + size_of_val(&self.instances[..]);
        self.nodes.memory() + self.blocks.memory() + self.ids.memory() + rest as u64
    }
}
