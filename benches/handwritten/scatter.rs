//! From hits to the rays that leave them, sixteen at a time: plain loops over lanes, which the compiler turns into
//! vector code.

use super::embree::Mesh;
use glam::{Vec2, Vec3};
use skylit::math::Frame;
use skylit::sampling::warp::cosine_hemisphere;

/// Hits worked on together.
pub const LANES: usize = 16;

type Row = [f32; LANES];

/// Rows of three floats each.
type Row3 = [Row; 3];

/// Hits, and the points of their samples.
#[derive(Default)]
pub struct Lanes {
    /// Corners of the triangles, and the normals there.
    corners: [Row3; 3],
    normals: [Row3; 3],
    /// Weights of the second and third corner.
    hit: [Row; 2],
    /// Directions of the camera's rays.
    d: Row3,
    points: [Row; 2],
}

/// Rays that leave.
#[derive(Default)]
pub struct Leaving {
    pub o: Row3,
    pub d: Row3,
    /// Cosine to the geometric normal.
    up: Row,
}

impl Leaving {
    /// Whether the ray leaves the triangle on the side that it was hit from: a shading normal may have it otherwise.
    #[inline(always)]
    pub fn is_up(&self, lane: usize) -> bool {
        self.up[lane] > 0.0
    }
}

impl Lanes {
    /// Reads a hit's triangle.
    #[inline(always)]
    pub fn gather(&mut self, lane: usize, mesh: &Mesh, prim: u32, hit: [f32; 2], d: [f32; 3]) {
        let corners = mesh.indices[prim as usize];
        for (k, i) in corners.into_iter().enumerate() {
            let (p, n) = (mesh.positions[i as usize], mesh.normals[i as usize]);
            for axis in 0..3 {
                self.corners[k][axis][lane] = p[axis];
                self.normals[k][axis][lane] = n[axis];
            }
        }
        put(&mut self.d, lane, Vec3::from(d));
        (self.hit[0][lane], self.hit[1][lane]) = (hit[0], hit[1]);
    }

    /// Takes a sample's point.
    #[inline(always)]
    pub fn point(&mut self, lane: usize, [u, v]: [f32; 2]) {
        (self.points[0][lane], self.points[1][lane]) = (u, v);
    }
}

#[inline(always)]
fn at(rows: &Row3, lane: usize) -> Vec3 {
    Vec3::new(rows[0][lane], rows[1][lane], rows[2][lane])
}

#[inline(always)]
fn put(rows: &mut Row3, lane: usize, v: Vec3) {
    (rows[0][lane], rows[1][lane], rows[2][lane]) = (v.x, v.y, v.z);
}

/// A direction about each shading normal, by the cosine, and where its ray starts.
#[inline(always)]
pub fn scatter(lanes: &Lanes, out: &mut Leaving) {
    for l in 0..LANES {
        let [a, b, c] = [at(&lanes.corners[0], l), at(&lanes.corners[1], l), at(&lanes.corners[2], l)];
        let (u, v) = (lanes.hit[0][l], lanes.hit[1][l]);
        let wo = -at(&lanes.d, l);
        let (e1, e2) = (b - a, c - a);
        let p = a + e1 * u + e2 * v;
        let ng = e1.cross(e2);
        let ng = ng * (1.0 / ng.length_squared().sqrt()).copysign(ng.dot(wo));
        let corners = [(a, 1.0 - u - v), (b, u), (c, v)];
        let normals = [at(&lanes.normals[0], l), at(&lanes.normals[1], l), at(&lanes.normals[2], l)];
        let ns = normals[0] * corners[0].1 + normals[1] * corners[1].1 + normals[2] * corners[2].1;
        let side = 1f32.copysign(ns.dot(ng));
        let ns = ns * (side / ns.length_squared().sqrt());
        // Up to the smooth surface, as skylit does it: the part below the planes through the corners (Hanika, "Hacking the
        // shadow terminator", Ray Tracing Gems II, ch. 4).
        let mut lift = Vec3::ZERO;
        for k in 0..3 {
            let below = -(normals[k].dot(p - corners[k].0) * side).min(0.0);
            lift += normals[k] * (below * corners[k].1 * side);
        }
        let lift = lift * f32::from(lift.dot(ng) >= 0.0);
        // Where the smooth surface turns away from the viewer, the flat one stands in.
        let turned = ns.dot(wo) <= 0.0;
        let pick = |flat: f32, smooth: f32| if turned { flat } else { smooth };
        let ns = Vec3::new(pick(ng.x, ns.x), pick(ng.y, ns.y), pick(ng.z, ns.z));
        let wi = cosine_hemisphere(Vec2::new(lanes.points[0][l], lanes.points[1][l]));
        let wi = Frame::from_z(ns).to_world(wi);
        // Eight roundings of the largest coordinate: the point is off its triangle by about two, and Embree's robust
        // test sees it as exactly as its distance from the corners.
        let reach = p.x.abs().max(p.y.abs()).max(p.z.abs());
        put(&mut out.o, l, p + lift + ng * (reach * (8.0 * f32::EPSILON)));
        put(&mut out.d, l, wi);
        out.up[l] = wi.dot(ng);
    }
}
