//! From a geometry to trees, one a group.

mod refs;
mod split;
mod wide;

use super::layout::{Child, Node, Target, Tree};
use super::simd::LANES;
use crate::accel::tame::{grown, reach};
use crate::base::geometry::{Child as Placed, Geometry, Group};
use crate::base::intersectable::{BuildQuality, KernelMode, KernelOptions};
use crate::error::{Error, Result};
use crate::math::aabb::Aabb;
use rayon::prelude::*;
use refs::{Kind, MAX_NUMBER, Ref};
use split::{Set, Units};
use wide::{Plan, build_top};

/// The trees of all groups, in their order.
pub(super) fn build(geometry: &Geometry, options: &KernelOptions) -> Result<Vec<Tree>> {
    // The groups one after another: most scenes have one that is large, and that is built by all threads.
    geometry.groups.iter().map(|g| tree(geometry, g, options)).collect()
}

fn tree(geometry: &Geometry, group: &Group, options: &KernelOptions) -> Result<Tree> {
    if group.leaves.len().max(group.children.len()) > MAX_NUMBER {
        return Err(Error::Usage(format!("a group holds more than {MAX_NUMBER} objects")));
    }
    let mut refs = references(geometry, group)?;
    let meshes: Vec<usize> = (0..group.leaves.len()).filter(|&i| is_mesh(group, i)).collect();
    let mut tree = Tree::empty();
    tree.only_mesh = meshes.first().map_or(0, |&i| i as u32);
    tree.has_filters = meshes.iter().any(|&i| group.leaves[i].filter.is_some());
    if refs.is_empty() {
        return Ok(tree);
    }
    let plan = Plan {
        group,
        bins: match options.quality {
            BuildQuality::Fast => 8,
            BuildQuality::Balanced => 16,
            BuildQuality::Best => 32,
        },
        units: Units::new(if meshes.is_empty() { 1 } else { LANES }),
        owners: meshes.len() > 1,
        shapes_per_leaf: 2,
    };
    let set = Set::new(&refs, 0, 0);
    tree.bounds = Aabb { min: set.bounds.lo.truncate(), max: set.bounds.hi.truncate() };
    tree.grown = grown(tree.bounds);
    tree.extent = tree.bounds.min.abs().max(tree.bounds.max.abs());
    tree.reach = reach(tree.bounds);
    tree.slack = if options.mode == KernelMode::Fast { 0.0 } else { 1.0 };
    let top = build_top(&mut refs, set, &plan)?;
    drop(refs);
    top.assemble(&mut tree)?;
    tree.waiting = 8 * depth(tree.nodes(), tree.root) + 1;
    Ok(tree)
}

fn is_mesh(group: &Group, leaf: usize) -> bool {
    group.leaves[leaf].shape.triangles().is_some()
}

/// All primitives of a group with their boxes; those without a box can be met by no ray.
fn references(geometry: &Geometry, group: &Group) -> Result<Vec<Ref>> {
    let mut refs = Vec::new();
    for (i, leaf) in group.leaves.iter().enumerate() {
        let i = i as u32;
        match leaf.shape.triangles() {
            Some(mesh) => {
                let count = mesh.indices.len();
                if count > MAX_NUMBER {
                    return Err(Error::Usage(format!(
                        "a mesh of {count} triangles; this kernel holds {MAX_NUMBER}"
                    )));
                }
                let one = |t: u32| Ref::new(&Aabb::from_points(mesh.corners(t)), Kind::Triangle(i, t));
                refs.par_extend((0..count as u32).into_par_iter().map(one));
            }
            None => {
                let count = leaf.shape.primitive_count();
                if count as usize > MAX_NUMBER {
                    let message = format!("a shape of {count} primitives; this kernel holds {MAX_NUMBER}");
                    return Err(Error::Usage(message));
                }
                let one = |p: u32| Ref::new(&leaf.shape.primitive_bounds(p), Kind::Shape(i, p));
                refs.par_extend((0..count).into_par_iter().map(one));
            }
        }
    }
    for (i, child) in group.children.iter().enumerate() {
        let bounds = placed_bounds(geometry, child);
        if !bounds.is_empty() {
            refs.push(Ref::new(&bounds, Kind::Instance(i as u32)));
        }
    }
    Ok(refs)
}

/// The box around a placed group.
fn placed_bounds(geometry: &Geometry, child: &Placed) -> Aabb {
    let group = &geometry.groups[child.group];
    if group.paths == 0 || group.bounds.is_empty() {
        return Aabb::EMPTY;
    }
    // Grown for what its own tests may take beyond it, in double precision.
    grown(group.bounds).transformed(&child.to_parent).to_f32()
}

/// Nodes on the longest way down.
fn depth(nodes: &[Node], root: Option<Child>) -> usize {
    let mut deepest = 0;
    let mut waiting: Vec<(Child, usize)> = root.map(|c| (c, 1)).into_iter().collect();
    while let Some((child, depth)) = waiting.pop() {
        if let Target::Node(i) = child.target() {
            deepest = deepest.max(depth);
            let below = nodes[i].children.0.iter().filter(|c| **c != Child::NONE);
            waiting.extend(below.map(|c| (*c, depth + 1)));
        }
    }
    deepest
}
