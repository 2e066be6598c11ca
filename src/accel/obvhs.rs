//! The library's own tree of two children and its own traversal, as a baseline: what the in-house kernel is measured against.
//!
//! One tree a group; a placed group is a primitive of its parent's tree, whose rays are taken into it in double precision.
//! Triangles are decided by the test of all kernels ([`crate::math::triangle`]). The library tests boxes in single precision
//! without bounds, so boxes are padded, and rays from afar begin nearer.

use super::failure::Failure;
use super::tame::{Tame, check_extent, extent, grown};
use super::{KernelRow, accepted, first_crossing};
use crate::base::geometry::{Geometry, Group};
use crate::base::hit::Hit;
use crate::base::intersectable::{BuildQuality, Intersectable, KernelOptions};
use crate::base::ray::Ray;
use crate::base::shape::LocalRay;
use crate::error::Result;
use crate::math::aabb::{Aabb, DAabb};
use crate::math::triangle::TriangleRay;
use glam::{DAffine3, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb as Box3;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use obvhs::ray::RayHit;
use std::sync::Arc;
use std::time::Duration;

/// The table row.
pub const ROW: KernelRow = KernelRow {
    name: "obvhs",
    doc: "the obvhs library's own traversal, as a baseline",
    build_bytes: 260,
    build: |geometry, options| Ok(Box::new(Kernel::new(geometry, options)?) as Box<dyn Intersectable>),
};

/// A primitive of a group's tree.
#[derive(Clone, Copy)]
enum Primitive {
    Leaf { leaf: u32, prim: u32 },
    Child(u32),
}

struct Tree {
    bvh: Bvh2,
    /// In the tree's own order.
    primitives: Vec<Primitive>,
    grown: DAabb,
    reach: f64,
}

/// See the module.
pub struct Kernel {
    geometry: Arc<Geometry>,
    /// By group; none for groups with nothing in them.
    trees: Vec<Option<Tree>>,
    failure: Failure,
}

impl Kernel {
    /// Builds the trees. Errors where coordinates are beyond [`MAX_COORDINATE`](crate::base::ray::MAX_COORDINATE).
    pub fn new(geometry: Arc<Geometry>, options: &KernelOptions) -> Result<Self> {
        check_extent(&geometry)?;
        let trees = geometry.groups.iter().map(|g| tree(&geometry, g, options)).collect();
        Ok(Kernel { geometry, trees, failure: Failure::default() })
    }

    /// Shortens `search` to the closest hit in and below a group.
    fn visit(&self, group: usize, first_path: u64, from_render: Option<&DAffine3>, search: &mut Search) {
        let (Some(tree), g) = (&self.trees[group], &self.geometry.groups[group]) else { return };
        let exact = from_render.map_or(search.ray, |m| search.ray.transformed(m));
        let Some(tame) = Tame::new(&exact, &tree.grown, tree.reach) else { return };
        // The library takes components of the direction below 1.2e-7 for that, so the largest has to be about 1.
        let length = tame.ray.d.abs().max_element();
        let (o, d) = (tame.ray.o.as_vec3a(), (tame.ray.d / length).as_vec3a());
        let local = |t: f64| ((t - tame.shift) / tame.scale * length) as f32;
        let any = search.any;
        let ray =
            obvhs::ray::Ray::new(o, d, (tame.ray.tnear * length) as f32, local(search.ray.tfar).next_up());
        let test = TriangleRay::new(exact.o, exact.d);
        let mut visit = |i: usize| match tree.primitives[i] {
            Primitive::Leaf { leaf, prim } => {
                let shortened = LocalRay { tfar: search.ray.tfar, ..exact };
                let path = first_path + u64::from(leaf);
                if let Some(t) = self.meets(g, leaf, prim, path, &shortened, &test, search.key) {
                    search.offer(t, prim, path);
                }
                search.hit.map(|_| search.ray.tfar)
            }
            Primitive::Child(child) => {
                let child = &g.children[child as usize];
                let below = from_render.map_or(child.from_parent, |m| child.from_parent * *m);
                self.visit(child.group, first_path + child.first_path, Some(&below), search);
                search.hit.map(|_| search.ray.tfar)
            }
        };
        if any {
            // A distance below the ray's end stops the traversal.
            tree.bvh.ray_traverse_miss(ray, |_, i| if visit(i).is_some() { 0.0 } else { f32::INFINITY });
            return;
        }
        tree.bvh.ray_traverse(ray, &mut RayHit::none(), |ray, i| {
            match visit(i).map(|t| local(t).next_up()) {
                // What the library culls by: a step more, so that it goes on to others at the same distance.
                Some(end) if end < ray.tmax => end,
                _ => f32::INFINITY,
            }
        });
    }

    /// Where a ray meets a primitive of a leaf, if a filter lets that stand.
    #[expect(clippy::too_many_arguments, reason = "one call")]
    fn meets(
        &self,
        g: &Group,
        leaf: u32,
        prim: u32,
        path: u64,
        ray: &LocalRay,
        test: &TriangleRay,
        key: u32,
    ) -> Option<f64> {
        let leaf = &g.leaves[leaf as usize];
        let Some(mesh) = leaf.shape.triangles() else {
            let mut t = None;
            self.failure.guard(|| t = first_crossing(leaf, ray, prim, path, key));
            return t;
        };
        let t = test.distance(mesh.corners(prim).map(|v| v.as_dvec3()))?;
        if !(t >= ray.tnear && t <= ray.tfar) {
            return None;
        }
        let mut stands = leaf.filter.is_none();
        if !stands {
            let hit = Hit { t: t as f32, prim, path };
            self.failure.guard(|| stands = accepted(leaf, ray, &hit, key));
        }
        stands.then_some(t)
    }

    fn search(&self, ray: &Ray, any: bool) -> Option<Hit> {
        if !ray.is_valid() {
            return None;
        }
        let mut search = Search { ray: LocalRay::from_ray(ray), key: ray.key, any, hit: None };
        self.visit(self.trees.len() - 1, 0, None, &mut search);
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

impl Search {
    /// Of several at one distance the first in the order of paths and primitives stays.
    fn offer(&mut self, t: f64, prim: u32, path: u64) {
        let first = self.hit.is_none_or(|h| (path, prim) < (h.path, h.prim));
        if t < self.ray.tfar || t == self.ray.tfar && first {
            self.ray.tfar = t;
            self.hit = Some(Hit { t: t as f32, prim, path });
        }
    }
}

fn tree(geometry: &Geometry, group: &Group, options: &KernelOptions) -> Option<Tree> {
    let size = extent(&group.bounds.into());
    // The library's test is off by some four roundings of the way from the ray's origin, at most `NEAR` sizes of the
    // group away, to a plane.
    let pad = (size * (NEAR + 1.0) * 4.0 * f64::from(f32::EPSILON)) as f32;
    let mut boxes = Vec::new();
    let mut primitives = Vec::new();
    for (i, leaf) in group.leaves.iter().enumerate() {
        for prim in 0..leaf.shape.primitive_count() {
            boxes.push(box3(&leaf.shape.primitive_bounds(prim), pad));
            primitives.push(Primitive::Leaf { leaf: i as u32, prim });
        }
    }
    for (i, child) in group.children.iter().enumerate() {
        let inner = &geometry.groups[child.group];
        if !inner.bounds.is_empty() {
            boxes.push(box3(&grown(inner.bounds).transformed(&child.to_parent).to_f32(), pad));
            primitives.push(Primitive::Child(i as u32));
        }
    }
    if boxes.is_empty() {
        return None;
    }
    let params = match options.quality {
        BuildQuality::Fast => BvhBuildParams::fast_build(),
        BuildQuality::Balanced => BvhBuildParams::medium_build(),
        BuildQuality::Best => BvhBuildParams::slow_build(),
    };
    // Parts of split primitives would have to be known to the traversal.
    let params = BvhBuildParams { pre_split: false, ..params };
    let bvh = build_bvh2(&boxes, params, &mut Duration::default());
    let primitives = bvh.primitive_indices.iter().map(|&i| primitives[i as usize]).collect();
    Some(Tree { bvh, primitives, grown: grown(group.bounds), reach: NEAR * size })
}

/// How many sizes of a group from its origin a ray may start to be traced as it is.
const NEAR: f64 = 4.0;

fn box3(b: &Aabb, pad: f32) -> Box3 {
    Box3 { min: Vec3A::from(b.min - Vec3::splat(pad)), max: Vec3A::from(b.max + Vec3::splat(pad)) }
}

impl Intersectable for Kernel {
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
        let of = |t: &Tree| {
            size_of_val(&t.bvh.nodes[..])
                + size_of_val(&t.bvh.primitive_indices[..])
                + size_of_val(&t.primitives[..])
        };
        self.trees.iter().flatten().map(of).sum::<usize>() as u64
    }

    fn describe(&self) -> String {
        "obvhs 0.4 two children".to_owned()
    }

    fn take_failure(&self) -> Result<()> {
        self.failure.take()
    }
}
