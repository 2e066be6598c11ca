//! Rays that arrive on surfaces, and rays that leave again: how well the point is known, and whether the surface that
//! was left is met once more.

use super::batches::{Batch, in_batches};
use super::random::Stream;
use super::surface::{Plane, bound, ray_to_surface, spacing, vertex_at};
use super::tally::Tally;
use crate::base::geometry::Geometry;
use crate::base::hit::HitBatch;
use crate::base::intersectable::Intersectable;
use crate::base::ray::{Coherence, Ray, RayBatch};
use crate::base::shape::LocalRay;
use crate::base::vertex::{Vertex, local_ray};
use glam::Vec3;

/// What is counted of rays that arrive and leave.
#[derive(Debug, Clone, Copy, Default)]
pub struct SpawnTallies {
    /// Spawned rays that meet the primitive they left.
    pub self_hits: Tally,
    /// Spawned rays that meet another triangle, next to where they start, whose plane they move away from.
    pub neighbours: Tally,
    /// Distance of the origin from the point over the derived bound and the rounding of the origin; at most 2.
    pub offset: Tally,
    /// Distance of the refined point from the exact plane over the derived bound; at most 1.
    pub point: Tally,
    /// Difference of the kernel's t from the refined one, in the roundings that a test in f32 is due; at most 1.
    pub distance: Tally,
}

/// An origin lies no further from its point than so many bounds.
pub const MAX_OFFSET: f64 = 2.0;

/// Roundings of f32 that a kernel's distance may be off, of the sizes that enter it.
const ROUNDINGS: f64 = 32.0;

impl SpawnTallies {
    fn merged(self, o: &SpawnTallies) -> Self {
        SpawnTallies {
            self_hits: self.self_hits.merged(&o.self_hits),
            neighbours: self.neighbours.merged(&o.neighbours),
            offset: self.offset.merged(&o.offset),
            point: self.point.merged(&o.point),
            distance: self.distance.merged(&o.distance),
        }
    }
}

/// Sends `rays` rays to surfaces, and one on from each point met.
pub fn spawned(geometry: &Geometry, kernel: &dyn Intersectable, rays: u64, seed: u64) -> SpawnTallies {
    let of = |b: &mut Buffers, batch| run_batch(geometry, kernel, b, batch, seed);
    in_batches(rays, of, SpawnTallies::merged)
}

#[derive(Default)]
struct Buffers {
    arriving: RayBatch,
    hits: HitBatch,
    leaving: RayBatch,
    next: HitBatch,
    near: RayBatch,
    blocked: Vec<bool>,
    vertices: Vec<Vertex>,
}

fn run_batch(
    geometry: &Geometry,
    kernel: &dyn Intersectable,
    b: &mut Buffers,
    batch: Batch,
    seed: u64,
) -> SpawnTallies {
    let mut random = Stream::new(seed, batch.number);
    let mut tallies = SpawnTallies::default();
    for r in [&mut b.arriving, &mut b.leaving, &mut b.near] {
        r.clear();
    }
    b.vertices.clear();
    (0..batch.count).filter_map(|_| ray_to_surface(geometry, &mut random)).for_each(|r| b.arriving.push(&r));
    kernel.intersect_batch(&b.arriving, &mut b.hits, Coherence::Incoherent);
    for i in 0..b.arriving.len() {
        let Some(hit) = b.hits.get(i) else { continue };
        let ray = b.arriving.get(i);
        let mut vertex = vertex_at(geometry, &ray, hit);
        // Smooth shading lifts origins off the surface: half the rays start without.
        if i % 2 == 1 {
            vertex.lift = Vec3::ZERO;
        }
        let order = batch.first + i as u64;
        if let Some(plane) = Plane::of(geometry, hit.path, hit.prim) {
            arrived(&mut tallies, &vertex, &plane, &ray, hit.t, order);
        }
        let w = leaving_direction(&vertex, geometry, &mut random);
        let spawned = vertex.spawn(w, ray.key);
        let travelled = (spawned.o - vertex.p).as_dvec3().dot(vertex.ng.as_dvec3()).abs();
        let lift = f64::from(vertex.lift.dot(vertex.ng).abs());
        let allowed = bound(&vertex) + spacing(spawned.o, vertex.ng);
        tallies.offset.measure((travelled - lift).max(0.0) / allowed, MAX_OFFSET, &ray, order);
        b.leaving.push(&spawned);
        // As far as a failure of the offset could reach, for the query that tells no primitive.
        let reach = near(&vertex, &spawned) as f32;
        b.near.push(&Ray { tfar: reach, ..spawned });
        b.vertices.push(vertex);
    }
    kernel.intersect_batch(&b.leaving, &mut b.next, Coherence::Incoherent);
    kernel.occluded_batch(&b.near, &mut b.blocked, Coherence::Incoherent);
    for (i, vertex) in b.vertices.iter().enumerate() {
        let order = batch.first + i as u64;
        left(&mut tallies, geometry, vertex, &b.leaving.get(i), (b.next.get(i), b.blocked[i]), order);
    }
    tallies
}

/// Any direction; off shapes that curve none that just grazes, whose way through the shape is as short as the offset.
fn leaving_direction(v: &Vertex, geometry: &Geometry, random: &mut Stream) -> Vec3 {
    let curved = geometry.resolve(v.path).leaf.shape.triangles().is_none();
    let w = random.direction();
    if curved && w.dot(v.ng).abs() < 0.05 { (w + v.ng * 0.1).normalize() } else { w }
}

/// Whether a ray leaves a convex shape's surface inwards and starts inside, so that it rightly meets the far side, however
/// near that is: what lies behind the origin tells.
fn crosses_inside(geometry: &Geometry, v: &Vertex, ray: &Ray) -> bool {
    let found = geometry.resolve(v.path);
    let local = local_ray(ray, found.placement.as_ref());
    let back = LocalRay { d: -local.d, ..local };
    ray.d.dot(v.ng) < 0.0 && found.leaf.shape.intersect(&back, v.prim).is_some()
}

/// Eight times as far along a spawned ray as its origin lies from the surface.
fn near(v: &Vertex, spawned: &Ray) -> f64 {
    let cosine = f64::from(spawned.d.dot(v.ng).abs()).max(1e-3);
    8.0 * (bound(v) + spacing(spawned.o, v.ng)) / cosine
}

/// How well the point of a triangle is known.
fn arrived(tallies: &mut SpawnTallies, v: &Vertex, plane: &Plane, ray: &Ray, t: f32, order: u64) {
    let residual = plane.height(v.p.as_dvec3()).abs();
    tallies.point.measure(residual / bound(v), 1.0, ray, order);
    // The height of the origin over the plane is known to roundings of what it is computed from, times what a needle
    // of a triangle loses of its normal; along the ray that is longer by the cosine.
    let length = f64::from(ray.d.length());
    let cosine = plane.n.dot(ray.d.as_dvec3()).abs() / length;
    let travelled = f64::from(v.t) * length;
    let sizes = travelled + (ray.o.length() + v.p.length()) as f64;
    let due = (ROUNDINGS * f64::from(f32::EPSILON) * sizes * plane.needle + bound(v)) / cosine;
    let off = (f64::from(t) - f64::from(v.t)).abs() * length;
    tallies.distance.measure(off / due, 1.0, ray, order);
}

type Found = (Option<crate::base::hit::Hit>, bool);

/// Whether a ray that left met what it left.
fn left(t: &mut SpawnTallies, geometry: &Geometry, v: &Vertex, ray: &Ray, (hit, blocked): Found, order: u64) {
    let flat = geometry.resolve(v.path).leaf.shape.triangles().is_some();
    let near = near(v, ray);
    let same = hit.is_some_and(|h| {
        let met = (h.path, h.prim) == (v.path, v.prim);
        met && (flat || (f64::from(h.t) <= near && !crosses_inside(geometry, v, ray)))
    });
    // Blocked at once, where the closest thing is far: by the surface itself, then.
    let only_any = blocked && hit.is_none_or(|h| f64::from(h.t) > 1.001 * near);
    t.self_hits.count(same || only_any, ray, order);
    let other = hit.filter(|h| !same && f64::from(h.t) <= near);
    let Some(plane) = other.and_then(|h| Plane::of(geometry, h.path, h.prim)) else {
        t.neighbours.tried += 1;
        return;
    };
    let moves_away = plane.height(ray.o.as_dvec3()) * plane.n.dot(ray.d.as_dvec3()) > 0.0;
    t.neighbours.count(moves_away, ray, order);
}
