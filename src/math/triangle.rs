//! The ray-triangle test that decides, in double precision.

use glam::DVec3;

/// What the test needs of a ray; worked out once for all triangles.
#[derive(Debug, Clone, Copy)]
pub struct TriangleRay {
    o: DVec3,
    d: DVec3,
    /// The axes; z is that of the direction's largest component.
    k: [usize; 3],
    /// Shear along x and y, and scale along z.
    s: [f64; 3],
}

impl TriangleRay {
    /// For the line `o + t d`; `d` is finite and not zero.
    #[inline]
    pub fn new(o: DVec3, d: DVec3) -> Self {
        let a = d.abs();
        let k = if a.x > a.y && a.x > a.z {
            [1, 2, 0]
        } else if a.y > a.z {
            [2, 0, 1]
        } else {
            [0, 1, 2]
        };
        let [x, y, z] = k.map(|k| d[k]);
        TriangleRay { o, d, k, s: [x / z, y / z, 1.0 / z] }
    }

    /// The t at which the line crosses the plane of the triangle, if that lies within it; closed at the edges, and
    /// without gaps between neighbours: an edge gives both its triangles the same edge function, up to the sign, and one
    /// that rounds to zero counts for both (Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013,
    /// in double precision).
    ///
    /// Always the same operations in the same order: all kernels that decide by this test agree to the bit.
    #[inline(always)]
    pub fn distance(&self, v: [DVec3; 3]) -> Option<f64> {
        let [kx, ky, kz] = self.k;
        let [sx, sy, sz] = self.s;
        let shear = |c: DVec3| {
            let c = (c - self.o).to_array();
            [c[kx] - sx * c[kz], c[ky] - sy * c[kz], sz * c[kz]]
        };
        let (p0, p1, p2) = (shear(v[0]), shear(v[1]), shear(v[2]));
        let e0 = p1[0] * p2[1] - p1[1] * p2[0];
        let e1 = p2[0] * p0[1] - p2[1] * p0[0];
        let e2 = p0[0] * p1[1] - p0[1] * p1[0];
        if (e0 < 0.0 || e1 < 0.0 || e2 < 0.0) && (e0 > 0.0 || e1 > 0.0 || e2 > 0.0) {
            return None;
        }
        if e0 == 0.0 && e1 == 0.0 && e2 == 0.0 {
            return None;
        }
        // The distance by the plane and not by the sheared corners: a ray that leaves a triangle in a plane of one
        // coordinate (a floor at y = 0) starts a single step of f32 beside it, which is nothing next to the rounding of
        // the other coordinates, but here multiplies exact zeros by those. Where the ray runs in the plane (t may
        // be NaN), the corners bound it.
        let n = (v[1] - v[0]).cross(v[2] - v[0]);
        let t = (v[0] - self.o).dot(n) / self.d.dot(n);
        let near = p0[2].min(p1[2]).min(p2[2]);
        let far = p0[2].max(p1[2]).max(p2[2]);
        Some(t.max(near).min(far))
    }
}
