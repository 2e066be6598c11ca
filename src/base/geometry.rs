//! What a ray kernel is given: groups of shapes, nested by affine placements.
//!
//! Every leaf that a ray can reach has a *path*, a number that names the whole chain of instances down to it.
//! A group numbers its own leaves first, then the paths of its first child, then of its second: the path of a leaf
//! is the sum of the offsets met on the way down, whatever the depth, and a kernel only adds.

use crate::base::hit::Hit;
use crate::base::ray::Ray;
use crate::base::shape::Shape;
use crate::math::aabb::Aabb;
use glam::DAffine3;
use std::sync::Arc;

/// Decides whether a hit counts, such as an alpha cut-out. Must depend on its arguments alone: kernels ask in
/// different orders and different numbers of times.
pub trait HitFilter: Send + Sync {
    /// Whether the hit stands; `ray` is in the space of the leaf's group.
    fn accept(&self, ray: &Ray, hit: &Hit) -> bool;
}

/// A shape in the space of its group.
#[derive(Clone)]
pub struct Leaf {
    /// The shape, its placement within the group already applied.
    pub shape: Arc<dyn Shape>,
    /// Optional test of each hit.
    pub filter: Option<Arc<dyn HitFilter>>,
    /// Index into the scene's table of objects (material, name).
    pub object: u32,
}

/// A group placed within another.
#[derive(Clone)]
pub struct Child {
    /// Index into [`Geometry::groups`], below that of the group it stands in.
    pub group: usize,
    /// From the child's space to that of the group it stands in.
    pub to_parent: DAffine3,
    /// The inverse of `to_parent`.
    pub from_parent: DAffine3,
    /// What is added to the child's own paths.
    pub first_path: u64,
}

/// Shapes and placed groups in one space, recentred in double precision before anything became f32.
#[derive(Clone, Default)]
pub struct Group {
    /// Shapes; their paths are 0, 1, 2, ...
    pub leaves: Vec<Leaf>,
    /// Placed groups, in order of `first_path`.
    pub children: Vec<Child>,
    /// Encloses all of it.
    pub bounds: Aabb,
    /// The number of leaf paths in and below this group.
    pub paths: u64,
}

/// The whole scene for a kernel. `groups` stand in order of dependence: children before parents, the root last,
/// so cycles cannot be expressed.
#[derive(Clone, Default)]
pub struct Geometry {
    /// All groups.
    pub groups: Vec<Group>,
}

/// A leaf found by its path.
pub struct Resolved<'a> {
    /// The leaf.
    pub leaf: &'a Leaf,
    /// The placement of its group, if it is not the root: to render space and back.
    pub placement: Option<Placement>,
}

/// A composed placement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// From the group's space to render space.
    pub to_render: DAffine3,
    /// The inverse.
    pub from_render: DAffine3,
}

impl Geometry {
    /// The group that nothing contains. Panics if there is no group at all.
    pub fn root(&self) -> &Group {
        self.groups.last().expect("a geometry has at least its root group")
    }

    /// The leaf with this path, from the root. Panics if there is no such path.
    #[inline]
    pub fn resolve(&self, path: u64) -> Resolved<'_> {
        let root = self.root();
        if let Some(leaf) = root.leaves.get(path as usize) {
            return Resolved { leaf, placement: None };
        }
        self.resolve_below(root, path)
    }

    fn resolve_below<'a>(&'a self, mut group: &'a Group, mut path: u64) -> Resolved<'a> {
        let mut placement: Option<Placement> = None;
        while path >= group.leaves.len() as u64 {
            let child = &group.children[group.children.partition_point(|c| c.first_path <= path) - 1];
            path -= child.first_path;
            placement = Some(match placement {
                None => Placement { to_render: child.to_parent, from_render: child.from_parent },
                Some(p) => Placement {
                    to_render: p.to_render * child.to_parent,
                    from_render: child.from_parent * p.from_render,
                },
            });
            group = &self.groups[child.group];
        }
        Resolved { leaf: &group.leaves[path as usize], placement }
    }

    /// Calls `visit` with every leaf path, its leaf and its placement (for lights, statistics); stops early when
    /// `visit` says false. The number of calls is the number of paths, which nesting can make huge.
    pub fn for_each_path(&self, visit: &mut dyn FnMut(u64, &Leaf, Option<Placement>) -> bool) {
        self.visit_group(self.groups.len() - 1, 0, None, visit);
    }

    fn visit_group(
        &self,
        group: usize,
        first: u64,
        placement: Option<Placement>,
        visit: &mut dyn FnMut(u64, &Leaf, Option<Placement>) -> bool,
    ) -> bool {
        let g = &self.groups[group];
        for (i, leaf) in g.leaves.iter().enumerate() {
            if !visit(first + i as u64, leaf, placement) {
                return false;
            }
        }
        g.children.iter().all(|c| {
            let below = match placement {
                None => Placement { to_render: c.to_parent, from_render: c.from_parent },
                Some(p) => Placement {
                    to_render: p.to_render * c.to_parent,
                    from_render: c.from_parent * p.from_render,
                },
            };
            self.visit_group(c.group, first + c.first_path, Some(below), visit)
        })
    }

    /// The depth of nesting: 1 for a root without children.
    pub fn depth(&self) -> usize {
        let mut depth = vec![1; self.groups.len()];
        for (i, g) in self.groups.iter().enumerate() {
            depth[i] = 1 + g.children.iter().map(|c| depth[c.group]).max().unwrap_or(0);
        }
        depth.last().copied().unwrap_or(0)
    }
}
