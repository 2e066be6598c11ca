//! The ray-triangle test that decides, in double precision.

use glam::DVec3;

/// What the test needs of a ray; worked out once for all triangles.
#[derive(Debug, Clone, Copy)]
pub struct TriangleRay {
    /// The axes x, y, z of the sheared space: z is that of the direction's largest component, x and y follow it in a circle.
    k: [usize; 3],
    /// Origin and direction, by those axes.
    o: [f64; 3],
    d: [f64; 3],
    /// Shear along x and y, and scale along z.
    s: [f64; 3],
}

impl TriangleRay {
    /// For the line `o + t d`; `d` is finite and not zero.
    #[inline(always)]
    pub fn new(o: DVec3, d: DVec3) -> Self {
        let a = d.abs();
        // Without a branch: nothing here could be predicted.
        let z = if a.x > a.y { 0 } else { 1 };
        let z = if a.x > a.z || a.y > a.z { z } else { 2 };
        let k = [[1, 2, 0], [2, 0, 1], [0, 1, 2]][z];
        let [x, y, z] = k;
        let (o, d) = (o.to_array(), d.to_array());
        let (o, d) = ([o[x], o[y], o[z]], [d[x], d[y], d[z]]);
        let scale = 1.0 / d[2];
        TriangleRay { k, o, d, s: [d[0] * scale, d[1] * scale, scale] }
    }

    /// The axes by which [`TriangleRay::distance_by_axes`] wants corners.
    #[inline(always)]
    pub fn axes(&self) -> [usize; 3] {
        self.k
    }

    /// The t at which the line crosses the plane of the triangle, if that lies within it; closed at the edges, and
    /// without gaps between neighbours: an edge gives both its triangles the same edge function, up to the sign, and one
    /// that rounds to zero counts for both (Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013,
    /// in double precision). NaN where the line runs within the plane of a triangle that has no extent along it.
    ///
    /// Always the same operations in the same order: all kernels that decide by this test agree to the bit.
    #[inline]
    pub fn distance(&self, v: [DVec3; 3]) -> Option<f64> {
        let [x, y, z] = self.k;
        let [a, b, c] = [v[0].to_array(), v[1].to_array(), v[2].to_array()];
        self.distance_by_axes([[a[x], a[y], a[z]], [b[x], b[y], b[z]], [c[x], c[y], c[z]]])
    }

    /// As [`TriangleRay::distance`], with the coordinates of each corner in the order of [`TriangleRay::axes`].
    #[inline(always)]
    pub fn distance_by_axes(&self, v: [[f64; 3]; 3]) -> Option<f64> {
        let [sx, sy, sz] = self.s;
        let (a, b, c) = (sub(v[0], self.o), sub(v[1], self.o), sub(v[2], self.o));
        let (ax, ay) = (a[0] - sx * a[2], a[1] - sy * a[2]);
        let (bx, by) = (b[0] - sx * b[2], b[1] - sy * b[2]);
        let (cx, cy) = (c[0] - sx * c[2], c[1] - sy * c[2]);
        let e0 = bx * cy - by * cx;
        let e1 = cx * ay - cy * ax;
        let e2 = ax * by - ay * bx;
        let (least, most) = (e0.min(e1).min(e2), e0.max(e1).max(e2));
        if least < 0.0 && most > 0.0 || least == 0.0 && most == 0.0 {
            return None;
        }
        // The distance by the plane and not by the sheared corners: a ray that leaves a triangle in a plane of one
        // coordinate (a floor at y = 0) starts a single step of f32 beside it, which is nothing next to the rounding of
        // the other coordinates, but here multiplies exact zeros by those. Where the ray runs in the plane (t may
        // be NaN), the corners bound it.
        let (u, w) = (sub(v[1], v[0]), sub(v[2], v[0]));
        let n = [u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]];
        let t = dot(a, n) / dot(self.d, n);
        let (az, bz, cz) = (sz * a[2], sz * b[2], sz * c[2]);
        Some(t.max(az.min(bz).min(cz)).min(az.max(bz).max(cz)))
    }
}

#[inline(always)]
fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
