//! Hits of one mesh together: what [`super::MeshShape`] works out hit by hit, as loops over columns.

use super::refine::{Triangle, test_error};
use super::shading::shading;
use crate::base::hit::Hit;
use crate::base::lanes::{Columns, LANES, LocalRays, Surfaces};
use crate::base::mesh::TriangleMesh;
use crate::math::simd::{Kernel, dispatch};
use glam::Vec3;

/// Where the rays cross the planes of their triangles.
#[derive(Default)]
pub struct Weights {
    /// Of the second corners.
    pub b1: [f64; LANES],
    /// Of the third corners.
    pub b2: [f64; LANES],
    /// 1 outside of the triangle, else 0: of the other columns' width, so that the loop has but one.
    odd: [f64; LANES],
}

impl Weights {
    /// Whether the ray passes its triangle by a rounding, and what was worked out for it is wrong.
    pub fn is_odd(&self, lane: usize) -> bool {
        self.odd[lane] != 0.0
    }
}

/// Corners of triangles, and something that stands there.
type Corners = [Columns<f32>; 3];

/// All of `out` but what textures need, in the lanes that [`Weights`] says are not odd.
pub fn refine_batch(mesh: &TriangleMesh, rays: &LocalRays, hits: &[Hit], out: &mut Surfaces) -> Weights {
    let mut corners = Corners::default();
    for (lane, hit) in hits.iter().enumerate() {
        put(&mut corners, lane, mesh.corners(hit.prim));
    }
    let mut weights = Weights::default();
    dispatch(Cross { rays, corners: &corners, weights: &mut weights, out });
    if !mesh.normals.is_empty() {
        let mut normals = Corners::default();
        for (lane, hit) in hits.iter().enumerate() {
            put(&mut normals, lane, mesh.corner_normals(hit.prim));
        }
        dispatch(Smooth { corners: &corners, normals: &normals, weights: &weights, out });
    }
    weights
}

#[inline(always)]
fn put(columns: &mut Corners, lane: usize, [a, b, c]: [Vec3; 3]) {
    columns[0].set(lane, a);
    columns[1].set(lane, b);
    columns[2].set(lane, c);
}

#[inline(always)]
fn at(columns: &Corners, lane: usize) -> [Vec3; 3] {
    [columns[0].get(lane), columns[1].get(lane), columns[2].get(lane)]
}

/// Points and their errors, flat.
struct Cross<'a> {
    rays: &'a LocalRays,
    corners: &'a Corners,
    weights: &'a mut Weights,
    out: &'a mut Surfaces,
}

impl Kernel for Cross<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        cross(self.rays, self.corners, self.weights, self.out);
    }
}

// Functions of their own: the compiler knows of arguments, but not of a struct's fields, that they do not overlap.
#[inline(always)]
fn cross(rays: &LocalRays, corners: &Corners, weights: &mut Weights, out: &mut Surfaces) {
    for l in 0..LANES {
        let triangle = Triangle::new(at(corners, l));
        let (point, inside) = triangle.cross(rays.o.get(l), rays.d.get(l));
        (weights.b1[l], weights.b2[l], out.t[l]) = (point.b1, point.b2, point.t);
        weights.odd[l] = if inside { 0.0 } else { 1.0 };
        out.p.set(l, triangle.at(point.b1, point.b2));
        out.ng.set(l, triangle.n);
    }
    for l in 0..LANES {
        out.error.set(l, test_error(at(corners, l), out.p.get(l).as_vec3(), out.ng.get(l)));
    }
    out.ns = out.ng;
    out.lift = Columns::default();
}

/// Shading normals and lifts.
struct Smooth<'a> {
    corners: &'a Corners,
    normals: &'a Corners,
    weights: &'a Weights,
    out: &'a mut Surfaces,
}

impl Kernel for Smooth<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        smooth(self.corners, self.normals, self.weights, self.out);
    }
}

#[inline(always)]
fn smooth(corners: &Corners, normals: &Corners, weights: &Weights, out: &mut Surfaces) {
    for l in 0..LANES {
        let b = [weights.b1[l], weights.b2[l]];
        let (p, ng) = (out.p.get(l).as_vec3(), out.ng.get(l));
        let s = shading(at(normals, l), b, at(corners, l), p, ng);
        out.ns.set(l, s.ns);
        out.lift.set(l, s.lift);
    }
}
