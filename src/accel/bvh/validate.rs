//! Whether a tree is what traversal takes it for.

use super::Kernel;
use super::layout::{Child, Target, Tree};
use super::simd::LANES;
use crate::math::aabb::Aabb;
use glam::Vec3;

impl Kernel {
    /// Walks every tree: each primitive of each group stands in exactly one leaf, inside of all boxes above it; every
    /// node and leaf is reached once; no search can leave more waiting than its tree says. For tests; errors with the first
    /// thing that is wrong.
    pub fn validate(&self) -> Result<(), String> {
        self.trees.iter().enumerate().try_for_each(|(g, tree)| {
            let group = &self.geometry.groups[g];
            let mut seen =
                Seen { triangles: Vec::new(), shapes: Vec::new(), instances: Vec::new(), nodes: 0 };
            if let Some(root) = tree.root {
                self.visit(tree, root, &tree.bounds, 1, &mut seen).map_err(|e| format!("group {g}: {e}"))?;
            }
            seen.triangles.sort_unstable();
            seen.shapes.sort_unstable();
            seen.instances.sort_unstable();
            let mut triangles = Vec::new();
            let mut shapes = Vec::new();
            for (i, leaf) in group.leaves.iter().enumerate() {
                let all = (0..leaf.shape.primitive_count()).map(|p| (i as u32, p));
                if leaf.shape.triangles().is_some() { triangles.extend(all) } else { shapes.extend(all) }
            }
            let placed = |c: &u32| !self.geometry.groups[group.children[*c as usize].group].bounds.is_empty();
            let instances: Vec<u32> = (0..group.children.len() as u32).filter(placed).collect();
            let complete = [
                ("triangles", seen.triangles == triangles),
                ("shapes", seen.shapes == shapes),
                ("instances", seen.instances == instances),
                ("nodes", seen.nodes == tree.node_count),
            ];
            match complete.iter().find(|(_, ok)| !ok) {
                Some((what, _)) => Err(format!("group {g}: its {what} are not each in one place")),
                None => Ok(()),
            }
        })
    }

    fn visit(
        &self,
        tree: &Tree,
        child: Child,
        bounds: &Aabb,
        depth: usize,
        seen: &mut Seen,
    ) -> Result<(), String> {
        match child.target() {
            Target::Node(i) => {
                seen.nodes += 1;
                if 8 * depth >= tree.waiting {
                    return Err(format!("node {i} at depth {depth}, but only {} may wait", tree.waiting));
                }
                let node = tree.nodes().get(i).ok_or_else(|| format!("there is no node {i}"))?;
                for lane in (0..LANES).filter(|&l| node.children.0[l] != Child::NONE) {
                    let inner = node.bounds(lane);
                    if inner.is_empty() || !bounds.contains_box(&inner) {
                        return Err(format!("lane {lane} of node {i} has {inner:?}, outside of {bounds:?}"));
                    }
                    self.visit(tree, node.children.0[lane], &inner, depth + 1, seen)?;
                }
                Ok(())
            }
            Target::Block(i) => {
                let block = tree.blocks().get(i).ok_or_else(|| format!("there is no block {i}"))?;
                for lane in (0..LANES).filter(|&l| !block.size.0[l].is_nan()) {
                    let inner = Aabb::from_points(
                        block.corners(lane, [0, 1, 2]).map(|c| Vec3::from_array(c.map(|x| x as f32))),
                    );
                    if !bounds.contains_box(&inner) {
                        return Err(format!("triangle {lane} of block {i} is outside of its box"));
                    }
                    seen.triangles.push((tree.owner(i, lane), tree.ids()[i].prim[lane]));
                }
                Ok(())
            }
            Target::Shapes(first, n) => {
                seen.shapes.extend(tree.shapes[first..first + n].iter().map(|s| (s.leaf, s.prim)));
                Ok(())
            }
            Target::Instance(i) => {
                seen.instances.push(tree.instances[i].child);
                Ok(())
            }
        }
    }
}

/// What was met on the way.
struct Seen {
    triangles: Vec<(u32, u32)>,
    shapes: Vec<(u32, u32)>,
    instances: Vec<u32>,
    nodes: usize,
}
