//! A ray in the space of a leaf, exact to double precision, with a bound on what single precision makes of it on the
//! way there.

use crate::base::geometry::{Child, Geometry, Leaf};
use crate::base::ray::Ray;
use crate::base::shape::LocalRay;
use crate::base::vertex::local_ray;
use crate::math::bounds::{UNDERFLOW, abs_mul, gamma};
use glam::{DAffine3, DVec3};

/// See the module.
#[derive(Debug, Clone, Copy)]
pub struct LeafRay {
    /// The ray as the oracle sees it.
    pub ray: LocalRay,
    /// How far a kernel's origin may be off, per axis; zero where no placement stands between.
    pub origin_error: DVec3,
    /// The same of the direction.
    pub direction_error: DVec3,
}

/// The way from render space down to a group.
#[derive(Debug, Clone, Copy)]
pub struct Descent {
    render: Ray,
    from_render: Option<DAffine3>,
    /// In the space of the group.
    pub local: LeafRay,
}

impl Descent {
    /// At the root, where nothing has been rounded yet.
    pub fn new(ray: &Ray) -> Self {
        let local =
            LeafRay { ray: local_ray(ray, None), origin_error: DVec3::ZERO, direction_error: DVec3::ZERO };
        Descent { render: *ray, from_render: None, local }
    }

    /// Into a child. The oracle composes the placements in double precision, as refinement does. A kernel may carry the
    /// ray down level by level in f32, matrix entries rounded to f32: three products, three sums and the entry's own
    /// rounding are at most gamma(5) of |A| |o| + |t|, and the error so far goes through |A|.
    pub fn into_child(&self, child: &Child) -> Self {
        let from_render = self.from_render.map_or(child.from_parent, |m| child.from_parent * m);
        let (o, d) = (self.render.o.as_dvec3(), self.render.d.as_dvec3());
        let ray = LocalRay {
            o: from_render.transform_point3(o),
            d: from_render.transform_vector3(d),
            ..self.local.ray
        };
        let (a, up) = (&child.from_parent, &self.local);
        let rounding = f64::from(gamma(5));
        let lost = DVec3::splat(4.0 * UNDERFLOW);
        let origin = abs_mul(&a.matrix3, up.ray.o.abs() + up.origin_error) + a.translation.abs();
        let direction = abs_mul(&a.matrix3, up.ray.d.abs() + up.direction_error);
        let local = LeafRay {
            ray,
            origin_error: abs_mul(&a.matrix3, up.origin_error) + origin * rounding + lost,
            direction_error: abs_mul(&a.matrix3, up.direction_error) + direction * rounding + lost,
        };
        Descent { render: self.render, from_render: Some(from_render), local }
    }

    /// Down to the leaf of a path; none where the geometry has no such path.
    pub fn to_leaf<'a>(&self, geometry: &'a Geometry, mut path: u64) -> Option<(&'a Leaf, LeafRay)> {
        let (mut group, mut at) = (geometry.root(), *self);
        while path >= group.leaves.len() as u64 {
            let next = group.children.partition_point(|c| c.first_path <= path).checked_sub(1)?;
            let child = &group.children[next];
            path -= child.first_path;
            at = at.into_child(child);
            group = &geometry.groups[child.group];
            if path >= group.paths {
                return None;
            }
        }
        Some((&group.leaves[path as usize], at.local))
    }
}
