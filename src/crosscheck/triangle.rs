//! One ray against one triangle: what the oracle says, and what a careful kernel in single precision may say instead.
//!
//! Two families of tests count as careful. Both subtract the ray's origin from the corners first, and both keep the error
//! of an edge function E = d . (a x b) in proportion to the edge, however far away the triangle is. (Pluecker by plain
//! products a x b does not: it is off by u |a| |b|, many times a small triangle at a distance.)
//!
//! A corner that is off by w moves E by w . (d x b), and d x b is as small as the corner is near to the ray; both corners
//! together by w_a . |d x b| + w_b . |d x a| + |d| . (w_a x w_b), where x of sizes here adds the sizes of the two terms.
//!
//! - Edge and sum (Embree's robust mode; Davidovic et al. 2012): 2 E = d . (e x s), e = a - b, s = a + b. The corners are
//!   off by u |a|; e and s one rounding each, two of the cross product and three of the scalar product are gamma(7) of
//!   |d| . (|e| x |s|) / 2.
//! - Sheared corners (Woop, Benthin, Wald, JCGT 2(1), 2013): x - (dx/dz) z, with z along the direction's largest axis, is
//!   (d x a) / dz up to sign and order, and off by gamma(4) of |x| + |z|: that is w. The difference of two products, times
//!   dz, adds gamma(4) of (|d x a| x |d x b|) / |dz|.
//!
//! The sum of all bounds either. What a placement's f32 transform does to the ray goes the same way: an origin off by w
//! moves both corners by w, a direction off by v adds v . |a x b|.

use super::leaf_ray::LeafRay;
use crate::math::bounds::{U32, UNDERFLOW, gamma};
use glam::{DVec3, Vec3};

/// What is known of a ray and a triangle that it may meet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TriangleTest {
    /// Edge functions d . (a x b) of the edges opposite to the first, second, third corner.
    pub edges: [f64; 3],
    /// How far a kernel's edge functions may be off.
    pub edge_bounds: [f64; 3],
    /// Where the ray crosses the plane, in lengths of its direction; anything finite where it runs along it.
    pub t: f64,
    /// How far a kernel's t may be off; infinite where the ray runs along the plane to rounding.
    pub reach: f64,
}

/// Sizes of the terms of a cross product, added.
fn terms(a: DVec3, b: DVec3) -> DVec3 {
    let (a, b) = (a.abs(), b.abs());
    DVec3::new(a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x)
}

impl TriangleTest {
    /// None where no careful kernel can say that the ray meets the triangle (leaving its range of t aside): one edge
    /// function is surely above zero and another surely below.
    pub fn new(at: &LeafRay, corners: [Vec3; 3]) -> Option<Self> {
        let v = corners.map(|c| c.as_dvec3() - at.ray.o);
        let corners = v.map(|a| Corner::new(at, a));
        let pairs = [(1, 2), (2, 0), (0, 1)];
        let edges = pairs.map(|(i, j)| v[j].dot(corners[i].across));
        let edge_bounds = pairs.map(|(i, j)| edge_bound(at, &corners[i], &corners[j]));
        let any = |s: f64| edges.iter().zip(edge_bounds).any(|(e, b)| s * e > b);
        if any(1.0) && any(-1.0) {
            return None;
        }
        let (t, reach) = distance(at, &v);
        Some(TriangleTest { edges, edge_bounds, t, reach })
    }

    /// Whether every careful kernel finds the ray's line inside.
    pub fn is_surely_inside(&self) -> bool {
        let above = |s: f64| self.edges.iter().zip(self.edge_bounds).all(|(e, b)| s * e > b);
        above(1.0) || above(-1.0)
    }
}

/// A corner as it is seen along the ray.
struct Corner {
    /// From the ray's origin.
    a: DVec3,
    /// d x a: how far it lies beside the ray.
    across: DVec3,
    /// How far off it may be seen, per axis: w in the module's text.
    off: DVec3,
}

impl Corner {
    fn new(at: &LeafRay, a: DVec3) -> Self {
        let along = a[largest_axis(at.ray.d)].abs();
        let off = (a.abs() + DVec3::splat(along)) * f64::from(gamma(4)) + at.origin_error;
        Corner { a, across: at.ray.d.cross(a), off }
    }
}

fn largest_axis(d: DVec3) -> usize {
    let d = d.abs();
    if d.x >= d.y && d.x >= d.z {
        0
    } else if d.y >= d.z {
        1
    } else {
        2
    }
}

fn sum(v: DVec3) -> f64 {
    v.x + v.y + v.z
}

/// See the module.
fn edge_bound(at: &LeafRay, p: &Corner, q: &Corner) -> f64 {
    let d = at.ray.d.abs();
    let moved = p.off.dot(q.across.abs()) + q.off.dot(p.across.abs()) + d.dot(terms(p.off, q.off));
    let edge_and_sum = f64::from(gamma(7)) * 0.5 * d.dot(terms(p.a - q.a, p.a + q.a));
    let sheared = f64::from(gamma(4)) * sum(terms(p.across, q.across)) / d.max_element();
    let cross = p.a.cross(q.a).abs() + terms(p.off, q.a) + terms(p.a, q.off);
    // Nine products may underflow.
    moved + edge_and_sum + sheared + at.direction_error.dot(cross) + 9.0 * UNDERFLOW
}

/// Where the ray crosses the plane, and how far off a kernel may see that: the height of the origin over the plane and
/// its own error as in `shapes::mesh::refine::test_error`, over the cosine, which has an error too.
///
/// With m the sizes of the terms of N = e1 x e2, the height T = a . N is off by gamma(21) of sum |a_k| m_k (shown
/// there), and by what the corners' own errors move the plane within the triangle: their largest, along the normal. The
/// divisor D = N . d is off by gamma(7) of sum |d_k| m_k, and by the same errors of the corners in N's edges. So t = T/D
/// is off by (dT + |t| dD) / (|D| - dD), and by its last rounding.
fn distance(at: &LeafRay, v: &[DVec3; 3]) -> (f64, f64) {
    let d = at.ray.d;
    let (e1, e2) = (v[1] - v[0], v[2] - v[0]);
    let n = e1.cross(e2);
    let divisor = n.dot(d);
    let t = n.dot(v[0]) / divisor;
    if !t.is_finite() {
        return (0.0, f64::INFINITY);
    }
    let m = terms(e1, e2);
    let largest = v[0].abs().max(v[1].abs()).max(v[2].abs());
    // Where the hit itself is nearest to the corners, it is nearer than the origin: the origin's distance counts.
    let moved = largest * f64::from(U32) + at.origin_error + at.direction_error * t.abs();
    let n_error = terms(e1, 2.0 * moved) + terms(2.0 * moved, e2) + terms(2.0 * moved, 2.0 * moved);
    let height = f64::from(gamma(21)) * v[0].abs().dot(m) + n.abs().dot(moved) + 9.0 * UNDERFLOW;
    // Corners that move tilt the plane about the triangle, so what the tilt does at the hit is in `height` already; what
    // is left of it multiplies the height's error alone.
    let tilt = f64::from(gamma(7)) * d.abs().dot(m) + n.length() * sum(at.direction_error);
    let left = divisor.abs() - tilt - d.abs().dot(n_error);
    if left <= 0.0 {
        return (t, f64::INFINITY);
    }
    (t, (height + t.abs() * tilt) / left + 2.0 * f64::from(U32) * t.abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::shape::LocalRay;
    use crate::testing::TestRng;

    fn plain(o: Vec3, d: Vec3) -> LeafRay {
        let ray = LocalRay { o: o.as_dvec3(), d: d.as_dvec3(), tnear: 0.0, tfar: f64::INFINITY };
        LeafRay { ray, origin_error: DVec3::ZERO, direction_error: DVec3::ZERO }
    }

    /// The two families of the module's text in f32: edge functions, and t by edge and sum.
    fn in_f32(o: Vec3, d: Vec3, corners: [Vec3; 3]) -> ([[f32; 3]; 2], f32) {
        let v = corners.map(|c| c - o);
        let pairs = [(v[1], v[2]), (v[2], v[0]), (v[0], v[1])];
        let edge_and_sum = pairs.map(|(a, b)| 0.5 * d.dot((a - b).cross(a + b)));
        let k = (0..3).max_by(|&i, &j| d[i].abs().total_cmp(&d[j].abs())).unwrap();
        let (x, y) = ((k + 1) % 3, (k + 2) % 3);
        let (sx, sy) = (d[x] / d[k], d[y] / d[k]);
        let flat = |a: Vec3| [a[x] - sx * a[k], a[y] - sy * a[k]];
        let sheared = pairs.map(|(a, b)| {
            let (a, b) = (flat(a), flat(b));
            d[k] * (a[0] * b[1] - a[1] * b[0])
        });
        let n = (v[1] - v[0]).cross(v[2] - v[0]);
        ([edge_and_sum, sheared], v[0].dot(n) / n.dot(d))
    }

    /// Small triangles far away, large ones near, needles, and rays that graze.
    #[test]
    fn bounds_hold_for_two_ways_to_test_in_f32_and_are_not_idle() {
        let mut rng = TestRng::new(7);
        let (mut worst, mut worst_t) = (0f64, 0f64);
        for i in 0..60_000 {
            let size = [1.0, 1e-2, 1e-4][i % 3];
            let center = rng.cube() * 2.0;
            let corner = |rng: &mut TestRng| (center + rng.cube() * size).as_vec3();
            let corners = [corner(&mut rng), corner(&mut rng), corner(&mut rng)];
            let o = (rng.cube() * [3.0, 100.0][i % 2]).as_vec3();
            let [b1, b2] = [rng.f32() * 0.5, rng.f32() * 0.5];
            let p = corners[0] + (corners[1] - corners[0]) * b1 + (corners[2] - corners[0]) * b2;
            let at = plain(o, p - o);
            let Some(test) = TriangleTest::new(&at, corners) else { continue };
            let (edges, t) = in_f32(o, p - o, corners);
            for family in edges {
                for (k, e) in family.into_iter().enumerate() {
                    let off = (f64::from(e) - test.edges[k]).abs();
                    assert!(off <= test.edge_bounds[k], "{off} {test:?}");
                    worst = worst.max(off / test.edge_bounds[k]);
                }
            }
            if test.reach.is_finite() {
                let off = (f64::from(t) - test.t).abs();
                assert!(off <= test.reach, "{off} {test:?}");
                worst_t = worst_t.max(off / test.reach);
            }
        }
        // Bounds that no case ever came near would explain anything.
        assert!(worst > 0.1 && worst_t > 0.05, "{worst} {worst_t}");
    }

    /// At a thousand times its size a triangle is as clear as near by, but for a few thousandths at its edges.
    #[test]
    fn distance_does_not_blur_small_triangles() {
        let center = Vec3::new(30.0, -20.0, 35.0);
        let corners =
            [Vec3::ZERO, Vec3::new(0.05, 0.0, 0.01), Vec3::new(0.0, 0.05, -0.01)].map(|v| v + center);
        let test = |b: [f32; 2]| {
            let p = corners[0] + (corners[1] - corners[0]) * b[0] + (corners[2] - corners[0]) * b[1];
            TriangleTest::new(&plain(Vec3::ZERO, p.normalize()), corners)
        };
        for b in [[0.3, 0.3], [0.02, 0.5], [0.5, 0.02], [0.49, 0.49]] {
            assert!(test(b).is_some_and(|t| t.is_surely_inside()), "{b:?} {:?}", test(b));
        }
        for b in [[-0.02, 0.5], [0.5, -0.02], [0.51, 0.51]] {
            assert!(test(b).is_none(), "{b:?}");
        }
    }

    /// Aslant, as what lies along the axes is not rounded at all.
    #[test]
    fn sure_and_unsure_are_told_apart() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let o = Vec3::new(0.3, 0.2, 1.0);
        let to = |x: f32, y: f32| plain(o, Vec3::new(x, y, 0.0) - o);
        let test = |x, y| TriangleTest::new(&to(x, y), corners);
        assert!(test(0.25, 0.25).is_some_and(|t| t.is_surely_inside() && (t.t - 1.0).abs() < 1e-7));
        // On an edge, on a corner, and a rounding beside them.
        for (x, y) in [(0.25, 0.0), (0.0, 0.0), (0.5, 0.5), (0.25, -3e-8), (0.25, 3e-8)] {
            assert!(test(x, y).is_some_and(|t| !t.is_surely_inside()), "{x} {y}");
        }
        assert!(test(0.25, -1e-4).is_none() && test(2.0, 2.0).is_none());
        // A placement that loses a thousandth leaves the last but one open.
        let mut loose = to(0.25, -1e-4);
        loose.origin_error = DVec3::splat(1e-3);
        assert!(TriangleTest::new(&loose, corners).is_some_and(|t| !t.is_surely_inside()));
    }
}
