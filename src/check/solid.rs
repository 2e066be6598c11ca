//! A placed mesh with its holes capped, and points that lie inside of it.
//!
//! The faces and the caps (a fan over each hole) together have an even number of faces at every edge. So from a point
//! at which the number of crossings is odd, it is odd in every direction: each ray must meet a face, or leave through a
//! cap. That is the whole criterion for a leak, and it needs no orientation and no manifold.

use super::exact::{crossing, distance_to_segment};
use super::random::Stream;
use super::topology::Connectivity;
use crate::base::geometry::{Geometry, Placement};
use crate::base::hit::Hit;
use crate::base::mesh::TriangleMesh;
use crate::base::ray::Ray;
use crate::base::shape::{Needs, Shape};
use crate::base::vertex::{Origin, Vertex, local_ray};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

/// Points inside a solid that are looked for, for meshes of up to 100,000 triangles; larger ones make do with fewer.
const POINTS: usize = 64;
/// Tests of a triangle that the search for points may spend on each placement.
const SEARCH_WORK: usize = 100_000_000;
/// Tests of caps and rims that a batch of rays may spend to judge its misses; what is left is set aside.
const JUDGE_WORK: usize = 200_000;

/// See the module.
pub struct Solid {
    shape: Arc<dyn Shape>,
    /// From the mesh's space to render space and back.
    pub placement: Option<Placement>,
    /// The leaf's path.
    pub path: u64,
    /// What was found of its edges.
    pub connectivity: Connectivity,
    /// Fans over the holes, in the space of the mesh.
    caps: Vec<[DVec3; 3]>,
    /// Points inside, in render space.
    pub inside: Vec<Vec3>,
}

/// What a ray from inside that met nothing did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Miss {
    /// It passed through the surface.
    Leak,
    /// It went out through a hole, or so close along its rim that rounding decides.
    Hole,
}

impl Solid {
    /// Of the mesh with this path. None where the shape there is no mesh.
    pub fn new(geometry: &Geometry, path: u64, seed: u64) -> Option<Self> {
        let found = geometry.resolve(path);
        let shape = found.leaf.shape.clone();
        let connectivity = Connectivity::new(shape.triangles()?);
        let caps = connectivity.topology.holes.iter().flat_map(|h| {
            let n = h.corners.len();
            let middle = DVec3::from_array(h.place);
            (0..n).map(move |i| [middle, h.corners[i], h.corners[(i + 1) % n]])
        });
        let caps = caps.collect();
        let mut solid =
            Solid { placement: found.placement, path, connectivity, caps, inside: Vec::new(), shape };
        solid.find_points(seed);
        Some(solid)
    }

    /// The triangles.
    pub fn mesh(&self) -> &TriangleMesh {
        self.shape.triangles().expect("a solid is a mesh")
    }

    /// A point of the mesh's space in render space.
    #[inline]
    pub fn to_render(&self, p: DVec3) -> DVec3 {
        self.placement.as_ref().map_or(p, |pl| pl.to_render.transform_point3(p))
    }

    /// How far, in render space, a kernel may see the point `target` of a triangle from where it is, when a ray from
    /// `origin` is aimed at it: the bound of the vertex there, and the rounding of the ray.
    pub fn blur(&self, prim: u32, target: DVec3, origin: Vec3) -> f64 {
        let ray = Ray::new(origin, (target - origin.as_dvec3()).as_vec3(), 0);
        let local = local_ray(&ray, self.placement.as_ref());
        let surface = self.shape.refine(&local, prim, 1.0, Needs::default());
        let hit = Hit { t: 1.0, prim, path: self.path };
        let origin_of = Origin { hit, object: 0, slot: 0, spread: 0.0 };
        let v = Vertex::new(&ray, &surface, self.placement.as_ref(), origin_of);
        let rounding = (origin.length() + target.as_vec3().length()) * f32::EPSILON;
        f64::from(2.0 * v.error.length() + rounding)
    }

    fn faces(&self) -> impl Iterator<Item = (u32, [DVec3; 3])> + '_ {
        let mesh = self.mesh();
        self.connectivity.faces(mesh).map(|t| (t, mesh.corners(t).map(|v| v.as_dvec3())))
    }

    /// The number of crossings ahead and the distance of the first, faces and caps alike but for face `skip`.
    fn crossings(&self, o: DVec3, d: DVec3, skip: u32) -> (u32, f64) {
        let faces = self.faces().filter(|(t, _)| *t != skip).map(|(_, c)| c);
        let ahead =
            faces.chain(self.caps.iter().copied()).filter_map(|c| crossing(o, d, c).filter(|t| *t > 0.0));
        ahead.fold((0, f64::INFINITY), |(n, first), t| (n + 1, f64::min(first, t)))
    }

    /// Halfway along chords that start at random places of the surface and run straight in.
    fn find_points(&mut self, seed: u64) {
        let faces = self.connectivity.faces(self.mesh()).collect::<Vec<_>>();
        if faces.len() < 4 {
            return;
        }
        let wanted = (SEARCH_WORK / (16 * faces.len())).clamp(8, POINTS);
        let points = (0..wanted as u64).into_par_iter().filter_map(|k| {
            let mut random = Stream::new(seed, k);
            (0..4).find_map(|_| {
                self.point_inside(faces[random.below(faces.len() as u64) as usize], &mut random)
            })
        });
        self.inside = points.collect();
    }

    fn point_inside(&self, face: u32, random: &mut Stream) -> Option<Vec3> {
        let [a, b, c] = self.mesh().corners(face).map(|v| v.as_dvec3());
        let [u, v] = random.barycentrics();
        let p = a + (b - a) * u + (c - a) * v;
        let n = (b - a).cross(c - a).normalize();
        let (count, along) = self.crossings(p, n, face);
        let (inward, chord) = if count % 2 == 1 { (n, along) } else { (-n, self.crossings(p, -n, face).1) };
        if !chord.is_finite() {
            return None;
        }
        let point = self.to_render(p + inward * (0.5 * chord)).as_vec3();
        // Deep enough that no rounding of the ray brings it out again.
        let depth = (self.to_render(p) - point.as_dvec3()).length();
        let local = self.placement.as_ref();
        let back = local.map_or(point.as_dvec3(), |pl| pl.from_render.transform_point3(point.as_dvec3()));
        let odd = |d: Vec3| self.crossings(back, d.as_dvec3(), u32::MAX).0 % 2 == 1;
        let deep = depth > 16.0 * self.blur(face, self.to_render(p), point);
        (deep && odd(random.direction()) && odd(random.direction())).then_some(point)
    }

    /// How many misses of a batch can be judged.
    pub fn judged_per_batch(&self) -> usize {
        (JUDGE_WORK / self.caps.len().max(1)).max(8)
    }

    /// What became of a ray from inside that met nothing.
    pub fn judge(&self, ray: &Ray) -> Miss {
        let local = local_ray(ray, self.placement.as_ref());
        let through = self.caps.iter().filter(|c| crossing(local.o, local.d, **c).is_some_and(|t| t > 0.0));
        if through.count() % 2 == 1 {
            return Miss::Hole;
        }
        let blurred = |a: DVec3, b: DVec3| {
            let distance = distance_to_segment(local.o, local.d, a, b);
            // In the mesh's space; what a placement loses is in proportion to coordinates there, too.
            let size = local.o.length() + a.length() + b.length() + self.lost_in_placement();
            distance <= size * 4.0 * f64::from(f32::EPSILON)
        };
        let rim = self.caps.iter().any(|[_, a, b]| blurred(*a, *b));
        if rim { Miss::Hole } else { Miss::Leak }
    }

    /// Size of what cancels when a ray is brought into the mesh's space.
    fn lost_in_placement(&self) -> f64 {
        self.placement.map_or(0.0, |p| p.from_render.translation.length())
    }
}
