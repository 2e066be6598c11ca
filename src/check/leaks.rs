//! Rays that start inside a mesh and aim at random, at vertices, along edges, and just beside both.

use super::batches::{Batch, in_batches};
use super::random::Stream;
use super::solid::{Miss, Solid};
use super::tally::Tally;
use crate::base::hit::{Hit, HitBatch};
use crate::base::intersectable::Intersectable;
use crate::base::ray::{Coherence, Ray, RayBatch};
use glam::{DVec3, Vec3};

/// Where rays go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aim {
    /// In a random direction.
    Random,
    /// At a vertex, as exactly as f32 can say.
    Vertex,
    /// At a point of an edge, as exactly as f32 can say.
    Edge,
    /// At either, then up to 4 units in the last place to any side.
    Beside,
}

/// Faces that a ray meets at less than this cosine are grazed: whether it passes them is not asked.
const GRAZING: f64 = 0.1;

/// Sends `rays` rays from points inside the solid.
///
/// A leak is a ray that meets nothing, by either form of query, and does not leave through a hole; or one that passes by
/// the vertex or edge it is aimed at and meets only something behind, where all faces there stand across it. Rays
/// through holes, and those whose misses are too many to judge, are set aside. No rays are sent where no point inside
/// is known.
pub fn leaks(solid: &Solid, kernel: &dyn Intersectable, aim: Aim, rays: u64, seed: u64) -> Tally {
    if solid.inside.is_empty() || rays == 0 {
        return Tally::default();
    }
    in_batches(rays, |b: &mut Buffers, batch| run_batch(solid, kernel, aim, b, batch, seed), Tally::merged)
}

#[derive(Default)]
struct Buffers {
    rays: RayBatch,
    targets: Vec<Target>,
    hits: HitBatch,
    blocked: Vec<bool>,
}

/// What a ray is aimed at: corners `a` to `b` of a triangle, the same for a vertex.
#[derive(Clone, Copy)]
struct Target {
    prim: u32,
    ends: [u8; 2],
    point: DVec3,
}

fn run_batch(
    solid: &Solid,
    kernel: &dyn Intersectable,
    aim: Aim,
    buffers: &mut Buffers,
    batch: Batch,
    seed: u64,
) -> Tally {
    let Buffers { rays, targets, hits, blocked } = buffers;
    let mut random = Stream::new(seed, batch.number);
    rays.clear();
    targets.clear();
    for _ in 0..batch.count {
        let (ray, target) = aimed(solid, aim, &mut random);
        rays.push(&ray);
        targets.push(target);
    }
    kernel.intersect_batch(rays, hits, Coherence::Incoherent);
    kernel.occluded_batch(rays, blocked, Coherence::Incoherent);
    let mut tally = Tally::default();
    let mut left = solid.judged_per_batch();
    for (i, target) in targets.iter().enumerate() {
        let order = batch.first + i as u64;
        match hits.get(i).filter(|_| blocked[i]) {
            Some(hit) => {
                // A hit at the target or before it is what nearly all of them are.
                let passed = aim != Aim::Random && hit.t > 1.0 && {
                    let ray = rays.get(i);
                    has_passed(solid, &ray, &hit, target)
                };
                tally.tried += 1;
                if passed {
                    tally.tried -= 1;
                    tally.count(true, &rays.get(i), order);
                }
            }
            None if left == 0 => tally.aside += 1,
            None => {
                left -= 1;
                let ray = rays.get(i);
                match solid.judge(&ray) {
                    Miss::Leak => tally.count(true, &ray, order),
                    Miss::Hole => tally.aside += 1,
                }
            }
        }
    }
    tally
}

/// A ray from a point inside, and what it is aimed at: there t is 1.
fn aimed(solid: &Solid, aim: Aim, random: &mut Stream) -> (Ray, Target) {
    let o = solid.inside[random.below(solid.inside.len() as u64) as usize];
    let key = random.bits() as u32;
    let at_nothing = Target { prim: 0, ends: [0; 2], point: DVec3::ZERO };
    if aim == Aim::Random {
        return (Ray::new(o, random.direction(), key), at_nothing);
    }
    let mesh = solid.mesh();
    let prim = random.below(mesh.indices.len() as u64) as u32;
    let bits = random.bits();
    let a = (bits % 3) as u8;
    let at_vertex = aim == Aim::Vertex || (aim == Aim::Beside && bits >> 63 == 0);
    let b = if at_vertex { a } else { (a + 1) % 3 };
    let corners = mesh.corners(prim);
    let (from, to) = (corners[a as usize].as_dvec3(), corners[b as usize].as_dvec3());
    let on_edge = if at_vertex { from } else { from + (to - from) * random.unit() };
    let point = solid.to_render(on_edge);
    let mut d = (point - o.as_dvec3()).as_vec3();
    if aim == Aim::Beside {
        let nudge = random.bits();
        let nudged = |x: f32, shift: u32| {
            f32::from_bits(x.to_bits().wrapping_add(((nudge >> shift) % 9) as u32).wrapping_sub(4))
        };
        // Not past zero, where neighbours are no neighbours any more.
        let safe = |x: f32, shift| if x.abs() > 1e-30 { nudged(x, shift) } else { x };
        d = Vec3::new(safe(d.x, 0), safe(d.y, 16), safe(d.z, 32));
    }
    (Ray::new(o, d, key), Target { prim, ends: [a, b], point })
}

/// Whether a ray that hits something behind what it was aimed at has slipped through there.
///
/// It has, if every face around the target stands across the ray from the same side (as seen from the origin they are
/// then one sheet around the target), the target is far from the sheet's rim compared with the error of rays, and the
/// hit lies further behind than that error explains.
fn has_passed(solid: &Solid, ray: &Ray, hit: &Hit, target: &Target) -> bool {
    let mesh = solid.mesh();
    let weld = |i: u32| solid.connectivity.weld[i as usize];
    let ends = target.ends.map(|k| weld(mesh.indices[target.prim as usize][k as usize]));
    if !ends.iter().all(|e| solid.connectivity.regular[*e as usize]) {
        return false;
    }
    let d = ray.d.as_dvec3();
    let blur = solid.blur(target.prim, target.point, ray.o);
    if f64::from(hit.t) < 1.0 + 1e-4 + 4.0 * blur / (GRAZING * d.length()) {
        return false;
    }
    let around = solid.connectivity.faces_at(ends[0]).iter().copied().filter(|t| {
        let c = mesh.indices[*t as usize].map(weld);
        ends.iter().all(|e| c.contains(e))
    });
    let mut side = 0.0;
    for face in around {
        if hit.path == solid.path && hit.prim == face {
            return false;
        }
        let corners = mesh.corners(face).map(|v| solid.to_render(v.as_dvec3()));
        let numbers = mesh.indices[face as usize].map(weld);
        let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        let cosine = n.dot(d) / (n.length() * d.length());
        if cosine.is_nan() || cosine.abs() < GRAZING || cosine * side < 0.0 {
            return false;
        }
        side = cosine;
        // The distance to the edges that are not at the target, foreshortened at most by the cosine.
        for k in 0..3 {
            let (p, q) = (k, (k + 1) % 3);
            if ends.iter().all(|e| [numbers[p], numbers[q]].contains(e)) {
                continue;
            }
            let along = (corners[q] - corners[p]).normalize();
            let w = target.point - corners[p];
            if (w - along * along.dot(w)).length() * GRAZING < 16.0 * blur {
                return false;
            }
        }
    }
    side != 0.0
}
