//! The oracle: a loop over everything in double precision, without any structure. Slow, and simple enough to trust.

use super::{KernelRow, first_crossing};
use crate::base::geometry::{Geometry, Group};
use crate::base::hit::Hit;
use crate::base::intersectable::{Intersectable, KernelOptions};
use crate::base::ray::Ray;
use crate::base::shape::LocalRay;
use crate::math::aabb::Aabb;
use glam::DAffine3;
use std::sync::Arc;

/// The table row.
pub const ROW: KernelRow = KernelRow {
    name: "brute",
    doc: "the oracle: tests every primitive in double precision",
    build_bytes: 0,
    build: |geometry, _: &KernelOptions| Ok(Box::new(Brute::new(geometry)) as Box<dyn Intersectable>),
};

/// See the module.
pub struct Brute {
    geometry: Arc<Geometry>,
}

impl Brute {
    /// Over a geometry with at least its root group.
    pub fn new(geometry: Arc<Geometry>) -> Self {
        Brute { geometry }
    }

    /// Shortens `search` to the closest hit in and below a group.
    fn visit(&self, group: &Group, first_path: u64, from_render: Option<&DAffine3>, search: &mut Search) {
        let mut ray = from_render.map_or(search.ray, |m| search.ray.transformed(m));
        for (path, leaf) in (first_path..).zip(&group.leaves) {
            for prim in 0..leaf.shape.primitive_count() {
                ray.tfar = search.ray.tfar;
                let Some(t) = first_crossing(leaf, &ray, prim, path, search.key) else { continue };
                // The first of several at one distance stays.
                if t < search.ray.tfar || search.hit.is_none() {
                    search.ray.tfar = t;
                    search.hit = Some(Hit { t: t as f32, prim, path });
                }
                if search.any {
                    return;
                }
            }
        }
        for child in &group.children {
            // Composed in the order of `Geometry::resolve`, so that shapes see the bits that refinement sees.
            let below = from_render.map_or(child.from_parent, |m| child.from_parent * *m);
            self.visit(
                &self.geometry.groups[child.group],
                first_path + child.first_path,
                Some(&below),
                search,
            );
            if search.any && search.hit.is_some() {
                return;
            }
        }
    }

    fn search(&self, ray: &Ray, any: bool) -> Option<Hit> {
        if !ray.is_valid() {
            return None;
        }
        let mut search = Search { ray: LocalRay::from_ray(ray), key: ray.key, any, hit: None };
        self.visit(self.geometry.root(), 0, None, &mut search);
        search.hit.filter(|h| h.t.is_finite())
    }
}

/// What has been found so far; the ray is in render space and ends there.
struct Search {
    ray: LocalRay,
    key: u32,
    any: bool,
    hit: Option<Hit>,
}

impl Intersectable for Brute {
    fn bounds(&self) -> Aabb {
        self.geometry.root().bounds
    }

    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.search(ray, false)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.search(ray, true).is_some()
    }

    fn memory(&self) -> u64 {
        0
    }

    fn describe(&self) -> String {
        "brute".to_owned()
    }
}
