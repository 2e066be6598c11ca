//! Spheres and ellipsoids from afar: is it right which rays meet them, where is the point, does a ray leave it again?

use super::batches::{Batch, in_batches};
use super::random::Stream;
use super::surface::{bound, vertex_at};
use super::tally::Tally;
use crate::base::geometry::{Geometry, Group, Leaf};
use crate::base::hit::HitBatch;
use crate::base::intersectable::Intersectable;
use crate::base::ray::{Coherence, Ray, RayBatch};
use crate::base::shape::ShapeSource;
use crate::error::Result;
use crate::shapes::quadric::QuadricSource;
use glam::{DAffine3, DVec3};
use std::sync::Arc;

/// From how many radii away the bodies are looked at.
pub const DISTANCES: [f64; 7] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6];

/// A point of a sphere lies within so many units in the last place of its radius.
pub const MAX_ULP: f64 = 4.0;

/// An ellipsoid about the origin of its group.
#[derive(Debug, Clone, Copy)]
pub struct Body {
    /// For people.
    pub name: &'static str,
    /// Half its extents.
    pub semi_axes: DVec3,
}

/// A ball, a needle, a disc and one of three very different axes.
pub const BODIES: [Body; 4] = [
    Body { name: "sphere", semi_axes: DVec3::ONE },
    Body { name: "ellipsoid 1:1e4, a needle", semi_axes: DVec3::new(1e-4, 1.0, 1e-4) },
    Body { name: "ellipsoid 1:1e4, a disc", semi_axes: DVec3::new(1.0, 1e-4, 1.0) },
    Body { name: "ellipsoid 1:100:1e4", semi_axes: DVec3::new(1e-4, 1e-2, 1.0) },
];

/// What is counted.
#[derive(Debug, Clone, Copy, Default)]
pub struct QuadricTallies {
    /// Rays whose hit or miss is wrong by the exact condition; those too close to the rim to tell are set aside.
    pub decision: Tally,
    /// Distance of the point from a sphere in units in the last place of the radius; at most [`MAX_ULP`].
    pub ulp: Tally,
    /// Distance of the point from the surface over the derived bound; at most 1.
    pub point: Tally,
    /// Rays that leave outwards, and meet the convex body again.
    pub self_hits: Tally,
}

impl QuadricTallies {
    fn merged(self, o: &QuadricTallies) -> Self {
        QuadricTallies {
            decision: self.decision.merged(&o.decision),
            ulp: self.ulp.merged(&o.ulp),
            point: self.point.merged(&o.point),
            self_hits: self.self_hits.merged(&o.self_hits),
        }
    }
}

impl Body {
    /// Alone in a geometry.
    ///
    /// # Errors
    /// Never, for the bodies here.
    pub fn geometry(&self) -> Result<Arc<Geometry>> {
        let placed = Arc::new(QuadricSource::new(DVec3::ZERO, self.semi_axes)).place(&DAffine3::IDENTITY)?;
        let bounds = placed.shape.bounds();
        let leaves = vec![Leaf { shape: placed.shape, filter: None, object: 0 }];
        Ok(Arc::new(Geometry { groups: vec![Group { leaves, children: Vec::new(), bounds, paths: 1 }] }))
    }

    /// Whether all axes are the same.
    pub fn is_sphere(&self) -> bool {
        self.semi_axes == DVec3::splat(self.semi_axes.x)
    }
}

/// Sends `rays` rays from `distance` radii away (the largest semi-axis counts) to all parts of a body and just past it.
pub fn quadrics(
    body: &Body,
    geometry: &Geometry,
    kernel: &dyn Intersectable,
    distance: f64,
    rays: u64,
    seed: u64,
) -> QuadricTallies {
    let of = |b: &mut Buffers, batch: Batch| {
        let mut random = Stream::new(seed, batch.number);
        b.rays.clear();
        (0..batch.count).for_each(|_| b.rays.push(&aimed(body, distance, &mut random)));
        run_batch(body, geometry, kernel, b, &mut random, batch.first)
    };
    in_batches(rays, of, QuadricTallies::merged)
}

#[derive(Default)]
struct Buffers {
    rays: RayBatch,
    hits: HitBatch,
    blocked: Vec<bool>,
    leaving: RayBatch,
    next: HitBatch,
    blocked_next: Vec<bool>,
    orders: Vec<u64>,
}

fn aimed(body: &Body, distance: f64, random: &mut Stream) -> Ray {
    let largest = body.semi_axes.max_element();
    let o = (random.direction().as_dvec3() * (largest * (1.0 + distance))).as_vec3();
    // Within the body, and one ray in twenty past its rim.
    let target = body.semi_axes * random.direction().as_dvec3() * (1.05 * random.unit().sqrt());
    Ray::new(o, (target - o.as_dvec3()).normalize().as_vec3(), random.bits() as u32)
}

/// How far the ray's closest approach to the middle of the unit sphere, into which the body is mapped, lies inside of
/// it, and how well that is known.
fn depth_of(body: &Body, ray: &Ray) -> (f64, f64) {
    let (o, d) = (ray.o.as_dvec3() / body.semi_axes, ray.d.as_dvec3() / body.semi_axes);
    let closest = o.cross(d).length() / d.length();
    // Of numbers that are f32 the products are exact, and the difference is rounded once; elsewhere the quotients are
    // rounded before they cancel.
    let known = if body.is_sphere() { 4.0 * closest } else { 8.0 * o.length() };
    (1.0 - closest, known * f64::EPSILON)
}

fn run_batch(
    body: &Body,
    geometry: &Geometry,
    kernel: &dyn Intersectable,
    b: &mut Buffers,
    random: &mut Stream,
    first: u64,
) -> QuadricTallies {
    let mut t = QuadricTallies::default();
    kernel.intersect_batch(&b.rays, &mut b.hits, Coherence::Incoherent);
    kernel.occluded_batch(&b.rays, &mut b.blocked, Coherence::Incoherent);
    b.leaving.clear();
    b.orders.clear();
    for i in 0..b.rays.len() {
        let (ray, order) = (b.rays.get(i), first + i as u64);
        let hit = b.hits.get(i);
        let (depth, known) = depth_of(body, &ray);
        if depth.abs() <= known {
            t.decision.aside += 1;
        } else {
            let wrong = hit.is_some() != (depth > 0.0) || b.blocked[i] != (depth > 0.0);
            t.decision.count(wrong, &ray, order);
        }
        let Some(hit) = hit else { continue };
        let v = vertex_at(geometry, &ray, hit);
        let unit = v.p.as_dvec3() / body.semi_axes;
        let gradient = (unit / body.semi_axes).length() / unit.length();
        let off = (unit.length() - 1.0).abs() / gradient;
        t.point.measure(off / bound(&v), 1.0, &ray, order);
        if body.is_sphere() {
            let ulp = body.semi_axes.x * f64::from(f32::EPSILON);
            t.ulp.measure(off / ulp, MAX_ULP, &ray, order);
        }
        // Where a rim is thinner than the error of the point, the far side may have been found.
        if v.wo.dot(v.ng) <= 0.0 {
            t.self_hits.aside += 1;
            continue;
        }
        let w = random.direction();
        let w = if w.dot(v.ng) < 0.0 { -w } else { w };
        b.leaving.push(&v.spawn(w, ray.key));
        b.orders.push(order);
    }
    kernel.intersect_batch(&b.leaving, &mut b.next, Coherence::Incoherent);
    kernel.occluded_batch(&b.leaving, &mut b.blocked_next, Coherence::Incoherent);
    for (i, order) in b.orders.iter().enumerate() {
        let met = b.next.get(i).is_some() || b.blocked_next[i];
        t.self_hits.count(met, &b.leaving.get(i), *order);
    }
    t
}
