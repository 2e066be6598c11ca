//! Whether a ray that leaves a surface jumps over a sheet that lies four bounds above it.

use super::batches::{Batch, in_batches};
use super::random::Stream;
use super::surface::{bound, vertex_at};
use super::tally::Tally;
use crate::base::geometry::{Geometry, Group, Leaf};
use crate::base::hit::{Hit, HitBatch};
use crate::base::intersectable::Intersectable;
use crate::base::mesh_data::{MeshData, Positions, Repairs};
use crate::base::ray::{Coherence, Ray, RayBatch};
use crate::base::shape::ShapeSource;
use crate::base::vertex::{Vertex, local_ray};
use crate::error::Result;
use crate::shapes::mesh::{MeshSource, Normals};
use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

/// Facets that get sheets: enough to meet every kind there is in a mesh, few enough to add little to its size.
const FACETS: usize = 20_000;
/// Distance of the sheets in bounds.
const BOUNDS: f64 = 4.0;

/// A mesh with a sheet on both sides of some of its facets.
pub struct Sheets {
    /// The geometry with the sheets in it, for kernels.
    pub geometry: Arc<Geometry>,
    path: u64,
    /// Paths of the sheets on the outer and the inner side.
    sheets: [u64; 2],
    facets: Vec<Facet>,
}

/// A facet that has sheets: `facets[i]` has the triangles i of the two leaves of sheets.
struct Facet {
    prim: u32,
    /// The largest bound anywhere on it.
    bound: f64,
}

impl Sheets {
    /// For the mesh with this path. None where it is no mesh, or stands deeper than in a group that the root places
    /// once.
    ///
    /// # Errors
    /// Where the sheets lie beyond what can be represented.
    pub fn new(geometry: &Geometry, path: u64, seed: u64) -> Result<Option<Self>> {
        let found = geometry.resolve(path);
        let Some(mesh) = found.leaf.shape.triangles() else { return Ok(None) };
        let own = |g: &Group| g.leaves.iter().position(|l| Arc::ptr_eq(&l.shape, &found.leaf.shape));
        let at = geometry.groups.iter().position(|g| g.children.is_empty() && own(g).is_some());
        let Some(at) = at else { return Ok(None) };
        let leaves = &geometry.groups[at];
        let first = path - own(leaves).map_or(0, |i| i as u64) + leaves.leaves.len() as u64;
        let mut random = Stream::new(seed, 0);
        let count = mesh.indices.len();
        let chosen: Vec<u32> = if count <= FACETS {
            (0..count as u32).collect()
        } else {
            (0..FACETS).map(|_| random.below(count as u64) as u32).collect()
        };
        let facets: Vec<Facet> = chosen
            .into_par_iter()
            .filter_map(|prim| Some(Facet { prim, bound: largest_bound(geometry, path, prim)? }))
            .collect();
        let side = |sign: f64| -> Result<Leaf> {
            let corners = facets.iter().flat_map(|f| moved(geometry, path, f, sign));
            let positions = Positions::F64(corners.map(|p| p.to_array()).collect());
            let indices = (0..facets.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
            let data = MeshData {
                positions,
                normals: Vec::new(),
                uvs: Vec::new(),
                indices,
                material_ids: Vec::new(),
                materials: Vec::new(),
                repairs: Repairs::default(),
            };
            let placed =
                Arc::new(MeshSource::new(Arc::new(data), Normals::Flat)).place(&DAffine3::IDENTITY)?;
            Ok(Leaf { shape: placed.shape, filter: None, object: 0 })
        };
        let more = [side(1.0)?, side(-1.0)?];
        let sheets = [first, first + 1];
        Ok(with_leaves(geometry, at, more).map(|geometry| Sheets { geometry, path, sheets, facets }))
    }
}

impl Sheets {
    /// Whether the mesh has shading normals, which lift origins.
    pub fn is_smooth(&self) -> bool {
        let shape = &self.geometry.resolve(self.path).leaf.shape;
        shape.triangles().is_some_and(|m| !m.normals.is_empty())
    }
}

/// The geometry with more leaves in a group without children, which is the root or the one child of the root.
fn with_leaves(geometry: &Geometry, at: usize, more: [Leaf; 2]) -> Option<Arc<Geometry>> {
    let mut groups: Vec<Group> = geometry.groups.clone();
    let root = groups.len() - 1;
    let g = &mut groups[at];
    g.bounds = more.iter().fold(g.bounds, |b, l| b.union(l.shape.bounds()));
    g.leaves.extend(more);
    g.paths = g.leaves.len() as u64;
    let (bounds, paths) = (g.bounds, g.paths);
    if at != root {
        let [child] = &mut groups[root].children[..] else { return None };
        if child.group != at {
            return None;
        }
        let placed = crate::math::aabb::DAabb::from(bounds).transformed(&child.to_parent).to_f32();
        groups[root].bounds = groups[root].bounds.union(placed);
        groups[root].paths = groups[root].leaves.len() as u64 + paths;
    }
    Some(Arc::new(Geometry { groups }))
}

/// A ray straight down on a point of a facet, and the hit that it is.
fn straight_at(geometry: &Geometry, path: u64, prim: u32, weights: [f64; 3]) -> Option<(Ray, Hit)> {
    let found = geometry.resolve(path);
    let corners = found.leaf.shape.triangles()?.corners(prim).map(|c| {
        let p = c.as_dvec3();
        found.placement.as_ref().map_or(p, |pl| pl.to_render.transform_point3(p))
    });
    let p = corners.iter().zip(weights).map(|(c, w)| *c * w).sum::<DVec3>();
    let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
    let size = corners[0].distance(corners[1]).max(corners[0].distance(corners[2]));
    let ray = Ray::new((p + n * size).as_vec3(), (-n * size).as_vec3(), 0);
    ray.is_valid().then_some((ray, Hit { t: 1.0, prim, path }))
}

/// The bound is a sum of absolute values of linear functions of the point, so it is largest at a corner.
fn largest_bound(geometry: &Geometry, path: u64, prim: u32) -> Option<f64> {
    let corners = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0 / 3.0; 3]];
    let bounds = corners.into_iter().map(|w| {
        let (ray, hit) = straight_at(geometry, path, prim, w)?;
        Some(bound(&vertex_at(geometry, &ray, hit)))
    });
    bounds.into_iter().try_fold(0.0, |a, b| Some(f64::max(a, b?)))
}

/// A facet's corners, moved along its normal by four of its bounds in render space, in the space of its group.
fn moved(geometry: &Geometry, path: u64, facet: &Facet, sign: f64) -> [DVec3; 3] {
    let found = geometry.resolve(path);
    let corners = found.leaf.shape.triangles().expect("a mesh").corners(facet.prim).map(|c| c.as_dvec3());
    let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    let (n, from) = match &found.placement {
        None => (n, glam::DMat3::IDENTITY),
        // Normals go by the inverse transpose.
        Some(p) => (p.from_render.matrix3.transpose() * n, p.from_render.matrix3),
    };
    let up = from * (n.normalize() * (sign * BOUNDS * facet.bound));
    // Rounding may bring a corner closer: one spacing of its coordinates further.
    corners.map(|c| c + up + up.signum() * c.abs() * f64::from(f32::EPSILON))
}

/// Sends `rays` rays from points of facets with sheets, to both sides, within 60 degrees of the normal. A ray tunnels if
/// it starts beyond its sheet, or meets neither the sheet nor anything before it. Points so near to their facet's edge
/// that the ray may pass by the sheet are set aside.
///
/// Smooth shading lifts origins to the surface that its normals pretend, further than any bound: the promise is for rays
/// that start at the true surface, which `lifted` asks to be otherwise.
pub fn tunnelling(sheets: &Sheets, kernel: &dyn Intersectable, lifted: bool, rays: u64, seed: u64) -> Tally {
    if sheets.facets.is_empty() {
        return Tally::default();
    }
    let of = |b: &mut Buffers, batch| run_batch(sheets, kernel, b, lifted, batch, seed);
    in_batches(rays, of, Tally::merged)
}

#[derive(Default)]
struct Buffers {
    rays: RayBatch,
    hits: HitBatch,
    blocked: Vec<bool>,
    orders: Vec<u64>,
}

fn run_batch(
    sheets: &Sheets,
    kernel: &dyn Intersectable,
    b: &mut Buffers,
    lifted: bool,
    batch: Batch,
    seed: u64,
) -> Tally {
    let mut random = Stream::new(seed, batch.number);
    let mut tally = Tally::default();
    b.rays.clear();
    b.orders.clear();
    for k in 0..batch.count {
        let order = batch.first + k;
        let i = random.below(sheets.facets.len() as u64) as usize;
        let facet = &sheets.facets[i];
        let [u, v] = random.barycentrics();
        // Of the whole facet, drawn in a little.
        let [u, v] = [0.05 + 0.85 * u, 0.05 + 0.85 * v];
        let outward = random.bits() >> 63 == 0;
        let Some((ray, hit)) = straight_at(&sheets.geometry, sheets.path, facet.prim, [1.0 - u - v, u, v])
        else {
            continue;
        };
        let mut vertex = vertex_at(&sheets.geometry, &ray, hit);
        if !lifted {
            vertex.lift = Vec3::ZERO;
        }
        let spawned = leave(&vertex, outward, &mut random);
        match sheet_ahead(sheets, i, outward, &vertex, &spawned) {
            Ahead::At(t) => {
                // A kernel knows the height of the origin under the sheet to a bound, which is much of it.
                b.rays.push(&Ray { tfar: (t * 4.0) as f32, ..spawned });
                b.orders.push(order);
            }
            Ahead::Behind => tally.count(true, &spawned, order),
            Ahead::Beside => tally.aside += 1,
        }
    }
    kernel.intersect_batch(&b.rays, &mut b.hits, Coherence::Incoherent);
    kernel.occluded_batch(&b.rays, &mut b.blocked, Coherence::Incoherent);
    for (i, order) in b.orders.iter().enumerate() {
        let met = b.hits.get(i).is_some() && b.blocked[i];
        tally.count(!met, &b.rays.get(i), *order);
    }
    tally
}

fn leave(v: &Vertex, outward: bool, random: &mut Stream) -> Ray {
    let n = if outward { v.ng } else { -v.ng };
    let mut w = random.direction();
    if w.dot(n) < 0.0 {
        w = -w;
    }
    // Within 60 degrees.
    let w: Vec3 = if w.dot(n) < 0.5 { (w + n * 0.6).normalize() } else { w };
    v.spawn(w, 0)
}

enum Ahead {
    /// The sheet is met at this t.
    At(f64),
    /// The origin lies beyond it.
    Behind,
    /// The ray passes it, or rounding has brought it too close.
    Beside,
}

/// Where a ray from facet `i` meets its sheet, in double precision.
fn sheet_ahead(sheets: &Sheets, i: usize, outward: bool, v: &Vertex, spawned: &Ray) -> Ahead {
    let path = sheets.sheets[usize::from(!outward)];
    let found = sheets.geometry.resolve(path);
    let shape = &found.leaf.shape;
    let mesh = shape.triangles().expect("sheets are a mesh");
    // A sheet that lost its area is left out, and those after it have other numbers.
    if mesh.indices.len() != sheets.facets.len() {
        return Ahead::Beside;
    }
    let Some(plane) = super::surface::Plane::of(&sheets.geometry, path, i as u32) else {
        return Ahead::Beside;
    };
    let n = if outward { v.ng } else { -v.ng }.as_dvec3();
    let side = plane.n.dot(n).signum();
    let gap = -side * plane.height(v.p.as_dvec3());
    if gap < 3.9 * bound(v) {
        return Ahead::Beside;
    }
    if side * plane.height(spawned.o.as_dvec3()) >= 0.0 {
        return Ahead::Behind;
    }
    let local = local_ray(spawned, found.placement.as_ref());
    let corners = mesh.corners(i as u32).map(|c| c.as_dvec3());
    // Well inside: a smaller triangle about the same middle.
    let middle = corners.iter().sum::<DVec3>() / 3.0;
    let smaller = corners.map(|c| middle + (c - middle) * 0.97);
    let crossing = super::exact::crossing(local.o, local.d, smaller).filter(|t| *t > 0.0);
    let Some(t) = crossing else { return Ahead::Beside };
    // What a kernel's transforms lose also moves the ray sideways.
    let to_render = |p: DVec3| found.placement.as_ref().map_or(p, |pl| pl.to_render.transform_point3(p));
    let (p, c) = (spawned.o.as_dvec3() + spawned.d.as_dvec3() * t, corners.map(to_render));
    let sideways = 8.0 * f64::from(v.error.length());
    let inside = (0..3).all(|k| {
        let along = (c[(k + 1) % 3] - c[k]).normalize();
        let w = p - c[k];
        (w - along * along.dot(w)).length() > sideways
    });
    if inside { Ahead::At(t) } else { Ahead::Beside }
}
