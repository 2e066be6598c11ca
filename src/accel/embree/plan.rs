//! Which placements become Embree instances, and which are carried by callbacks ("portals").
//!
//! Embree as Debian builds it has one level of instances; an instance inside an instance ends the process. So
//! nested groups are flattened, breadth first, while the number of instances stays within a budget. What lies deeper
//! is a portal: a user primitive whose callback takes the ray, in double precision, into the child's own scene.

use crate::base::geometry::Geometry;
use crate::math::aabb::Aabb;
use glam::{DAffine3, DMat3, DVec3, Mat3};
use std::collections::VecDeque;

/// Instances that all flattening of a scene may add, at some 500 bytes each (Embree's part is 350).
pub(super) const FLATTEN_BUDGET: usize = 1 << 18;

/// Coordinates that Embree may meet anywhere. Its own limit, asserted in Debian's build, is 1.8e18.
const SAFE: f64 = 1e17;

/// A group placed in a level.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placed {
    pub(super) group: usize,
    pub(super) to_level: DAffine3,
    pub(super) from_level: DAffine3,
    pub(super) first_path: u64,
}

/// What stands in a level beside the leaves of its own group.
#[derive(Default)]
pub(super) struct Plan {
    /// Embree instances of the group's own leaves (not of what is nested in it).
    pub(super) instances: Vec<Placed>,
    /// Groups with all that is below them, asked by callback.
    pub(super) portals: Vec<Placed>,
}

impl Plan {
    /// For a group whose rays begin no further than `reach` from its origin. `budget` is what flattening may add,
    /// and is reduced by what it does.
    pub(super) fn new(geometry: &Geometry, group: usize, reach: f64, budget: &mut usize) -> Plan {
        let mut plan = Plan::default();
        let mut queue: VecDeque<Placed> = children(geometry, group, None).collect();
        while let Some(item) = queue.pop_front() {
            let g = &geometry.groups[item.group];
            if g.paths == 0 || g.bounds.is_empty() {
                continue;
            }
            if !embree_can_hold(&item, g.bounds, reach) {
                plan.portals.push(item);
            } else if g.children.is_empty() {
                plan.instances.push(item);
            } else {
                let added = g.children.len();
                if added > *budget {
                    plan.portals.push(item);
                    continue;
                }
                *budget -= added;
                if !g.leaves.is_empty() {
                    plan.instances.push(item);
                }
                queue.extend(children(geometry, item.group, Some(&item)));
            }
        }
        plan
    }
}

fn children<'a>(g: &'a Geometry, group: usize, parent: Option<&Placed>) -> impl Iterator<Item = Placed> + 'a {
    let parent = parent.copied();
    g.groups[group].children.iter().map(move |c| match parent {
        None => {
            let (to_level, from_level) = (c.to_parent, c.from_parent);
            Placed { group: c.group, to_level, from_level, first_path: c.first_path }
        }
        // The inverses are composed in the order of `Geometry::resolve`, for the same bits.
        Some(p) => Placed {
            group: c.group,
            to_level: p.to_level * c.to_parent,
            from_level: c.from_parent * p.from_level,
            first_path: p.first_path + c.first_path,
        },
    })
}

/// Whether Embree's own f32 transform of rays is sound for this placement: it inverts the matrix it is given in
/// f32, so that inverse must be near the exact one, and no ray may leave the range of coordinates that it asserts.
fn embree_can_hold(item: &Placed, bounds: Aabb, reach: f64) -> bool {
    let (to, from) = (&item.to_level, &item.from_level);
    let size = |m: &DMat3| {
        [m.x_axis, m.y_axis, m.z_axis].map(|a| a.abs().max_element()).into_iter().fold(0.0, f64::max)
    };
    let (grow, shrink) = (size(&from.matrix3), size(&to.matrix3));
    // Comparisons that NaN fails. The scales leave room for products of three lengths in f32.
    let scales = (1e-8..=1e8).contains(&grow) && (1e-8..=1e8).contains(&shrink);
    let far = |v: DVec3| v.abs().max_element();
    let origins = 3.0 * grow * reach + far(from.translation) <= SAFE;
    let extent = far(bounds.min.as_dvec3()).max(far(bounds.max.as_dvec3()));
    let corners = 3.0 * shrink * extent + far(to.translation) <= SAFE;
    if !(scales && origins && corners) {
        return false;
    }
    let single: Mat3 = to.matrix3.as_mat3();
    let det = single.determinant();
    if !det.is_normal() || !single.inverse().is_finite() {
        return false;
    }
    // 1e-4: a placement so sheared that f32 inversion loses more than that goes by double precision instead.
    let error = single.inverse().as_dmat3() - from.matrix3;
    size(&error) <= 1e-4 * grow
}
