//! A ray as traversal uses it: in single precision, to cull, with bounds on what that loses.
//!
//! **What must hold.** Whatever the double-precision tests would accept, culling lets through. Let u = 2^-24, and R the
//! largest sum, by axis, of the extent of the tree and the size of the ray's origin: no difference between a point of the
//! tree and the origin exceeds it.
//!
//! *Boxes.* A plane b is met at t = (b - o) / d, computed as fma(b, r, c) with r = 1/d and c = -o r. Against the exact ray, b r is
//! off by 2u |b r| (d, and the division, rounded once each) and o r by 4u |o r| (o, d, the division, the product), the sums by u each:
//! less than 8u (|b| + |o|) |r| <= 8u R |r| together, which is a constant of the ray. Added to the far planes' c and
//! taken from the near planes', it makes the test conservative at no cost. A component of d below 1e-10 of the largest is
//! enlarged to that, which moves the ray by no more than 1e-10 R within the tree, and keeps 1/d finite.
//!
//! *Triangles.* As Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013, corners are moved to the
//! origin and sheared so that the ray runs along z: x' = (x - ox) - (dx/dz) (z - oz), with dz the largest component. Each x' is off by
//! at most u (3 Rx + 7 Rz), and one more u Rz where multiplication and subtraction are rounded each: delta = 12u R, to be safe. If the ray meets
//! a triangle with sides of its box no longer than L, then all corners have |x'| <= 2L; so each product of two in an
//! edge function is off by 2 (2L delta) + delta^2 + 2u (2L + delta)^2, and with L <= 2R the whole by less than 14 delta (L + delta). An
//! edge function counts as having a sign only beyond that.

use super::layout::{Block, Node, Tree};
use super::simd::Simd;
use crate::accel::tame::Tame;
use crate::base::shape::LocalRay;
use crate::math::aabb::{round_down, round_up};
use crate::math::bounds::U32;
use glam::Vec3;

/// A ray in the space of a tree.
#[derive(Clone, Copy)]
pub(super) struct CullRay {
    /// Which of the two planes of each axis the ray meets first.
    first: [usize; 3],
    /// 1 / d.
    inv: Vec3,
    /// What to add to the product with the first plane, and with the second.
    near: Vec3,
    far: Vec3,
    /// The axes x, y, z of the sheared space.
    k: [usize; 3],
    o: Vec3,
    d: Vec3,
    /// The error of a sheared coordinate.
    delta: f32,
    /// Culling's own t is `(t - shift) * rescale`.
    shift: f64,
    rescale: f64,
    tnear: f32,
}

/// A ray against boxes: one number a lane, the same in all.
#[derive(Clone, Copy)]
pub(super) struct BoxRay<S: Simd> {
    first: [usize; 3],
    inv: [S::V; 3],
    near: [S::V; 3],
    far: [S::V; 3],
    tnear: S::V,
}

/// A ray against triangles, likewise.
#[derive(Clone, Copy)]
struct ShearedRay<S: Simd> {
    k: [usize; 3],
    /// The origin, by those axes.
    o: [S::V; 3],
    shear: [S::V; 2],
}

/// What eight boxes say to a ray.
pub(super) struct Boxes<S: Simd> {
    /// Those that it may meet, a bit each.
    pub(super) hit: u32,
    /// Where it enters them.
    pub(super) near: S::V,
}

/// What eight triangles say to a ray.
pub(super) struct Candidates {
    /// Those that it may meet, a bit each.
    pub(super) maybe: u32,
    /// Those that it meets for certain.
    pub(super) certain: u32,
}

impl CullRay {
    /// None if the ray cannot meet anything in the tree.
    #[inline(always)]
    pub(super) fn new(ray: &LocalRay, tree: &Tree) -> Option<Self> {
        let tame = Tame::new(ray, &tree.grown, tree.reach)?;
        let (o, d) = (tame.ray.o.as_vec3(), tame.ray.d.as_vec3());
        let a = d.abs();
        let r = tree.extent + o.abs();
        // What double precision loses of an origin far away is no longer nothing.
        let lost = if tame.shift == 0.0 { 0.0 } else { (ray.o.abs().max_element() * 1e-15) as f32 };
        let most = r.max_element().max(1e-30) + lost * (1.0 / U32);
        let d_box = a.max(Vec3::splat(a.max_element() * 1e-10)).copysign(d);
        let inv = d_box.recip();
        let c = -(o * inv);
        let pad = (r * (8.0 * U32) + Vec3::splat(most * 1e-9 + lost)) * inv.abs();
        Some(CullRay {
            first: [d_box.x, d_box.y, d_box.z].map(|d| (d.to_bits() >> 31) as usize),
            inv,
            near: c - pad,
            far: c + pad,
            k: shear_axes(a),
            o,
            d,
            delta: 12.0 * U32 * most,
            shift: tame.shift,
            rescale: 1.0 / tame.scale,
            tnear: round_down(tame.ray.tnear),
        })
    }

    /// An upper bound of culling's own t.
    #[inline(always)]
    pub(super) fn end(&self, t: f64) -> f32 {
        round_up((t - self.shift) * self.rescale)
    }

    /// For tests of boxes.
    #[inline(always)]
    pub(super) fn boxes<S: Simd>(&self) -> BoxRay<S> {
        BoxRay {
            first: self.first,
            inv: splat3::<S>(self.inv),
            near: splat3::<S>(self.near),
            far: splat3::<S>(self.far),
            tnear: S::splat(self.tnear),
        }
    }

    /// Tests the triangles of a block. `tfar` is the ray's end; whether a hit is certain is only asked where `CERTAIN`.
    #[inline(always)]
    pub(super) fn triangles<S: Simd, const CERTAIN: bool>(&self, block: &Block, tfar: f32) -> Candidates {
        let [kx, ky, kz] = self.k;
        let along = 1.0 / self.d[kz % 3];
        let ray = ShearedRay::<S> {
            k: self.k,
            o: [S::splat(self.o[kx % 3]), S::splat(self.o[ky % 3]), S::splat(self.o[kz % 3])],
            shear: [S::splat(self.d[kx % 3] * along), S::splat(self.d[ky % 3] * along)],
        };
        let (a, b, c) = (ray.corner(block, 0), ray.corner(block, 1), ray.corner(block, 2));
        let (u, v, w) = (edge::<S>(&b, &c), edge::<S>(&c, &a), edge::<S>(&a, &b));
        let least = S::min(u, S::min(v, w));
        let most = S::max(u, S::max(v, w));
        let scale = 14.0 * self.delta;
        let constant = S::splat(scale * self.delta + f32::MIN_POSITIVE);
        let slack = S::mul_add(S::load(&block.size), S::splat(scale), constant);
        let minus = S::sub(S::splat(0.0), slack);
        let maybe = S::le(minus, least) | S::le(most, slack);
        if !CERTAIN || maybe == 0 {
            return Candidates { maybe, certain: 0 };
        }
        let inside = S::le(slack, least) | S::le(most, minus);
        let error = 16.0 / 12.0 * self.delta * along.abs();
        let along = S::splat(along);
        let (z0, z1, z2) = (S::mul(a[2], along), S::mul(b[2], along), S::mul(c[2], along));
        let (first, last) = (S::min(z0, S::min(z1, z2)), S::max(z0, S::max(z1, z2)));
        let within = S::le(S::splat(self.tnear + error), first) & S::le(last, S::splat(tfar - error));
        Candidates { maybe, certain: maybe & inside & within }
    }
}

/// The axes of the sheared space, by the sizes of a direction's components: the largest is z.
#[inline(always)]
fn shear_axes(a: Vec3) -> [usize; 3] {
    // Without a branch: nothing here could be predicted.
    let z = if a.x > a.y { 0 } else { 1 };
    let z = if a.z > a.x.max(a.y) { 2 } else { z };
    [(z + 1) % 3, (z + 2) % 3, z]
}

impl<S: Simd> BoxRay<S> {
    #[inline(always)]
    fn enter(&self, node: &Node, axis: usize) -> S::V {
        S::mul_add(S::load(&node.planes[axis][self.first[axis] & 1]), self.inv[axis], self.near[axis])
    }

    #[inline(always)]
    fn leave(&self, node: &Node, axis: usize) -> S::V {
        S::mul_add(S::load(&node.planes[axis][(self.first[axis] ^ 1) & 1]), self.inv[axis], self.far[axis])
    }

    /// Tests the boxes of a node up to `tfar`.
    #[inline(always)]
    pub(super) fn test(&self, node: &Node, tfar: S::V) -> Boxes<S> {
        let enter = S::max(S::max(self.enter(node, 0), self.enter(node, 1)), S::max(self.enter(node, 2), self.tnear));
        let leave = S::min(S::min(self.leave(node, 0), self.leave(node, 1)), S::min(self.leave(node, 2), tfar));
        Boxes { hit: S::le(enter, leave), near: enter }
    }
}

impl<S: Simd> ShearedRay<S> {
    /// A corner of a block's triangles, sheared.
    #[inline(always)]
    fn corner(&self, block: &Block, c: usize) -> [S::V; 3] {
        // The axes are a permutation of 0, 1, 2, which the compiler does not know.
        let [kx, ky, kz] = self.k;
        let z = S::sub(S::load(&block.v[kz % 3][c]), self.o[2]);
        let x = S::neg_mul_add(self.shear[0], z, S::sub(S::load(&block.v[kx % 3][c]), self.o[0]));
        let y = S::neg_mul_add(self.shear[1], z, S::sub(S::load(&block.v[ky % 3][c]), self.o[1]));
        [x, y, z]
    }
}

/// The edge function of two sheared corners.
#[inline(always)]
fn edge<S: Simd>(p: &[S::V; 3], q: &[S::V; 3]) -> S::V {
    S::mul_sub(p[0], q[1], S::mul(p[1], q[0]))
}

#[inline(always)]
fn splat3<S: Simd>(v: Vec3) -> [S::V; 3] {
    [S::splat(v.x), S::splat(v.y), S::splat(v.z)]
}

/// A ray at one level of nesting: exact, and for culling.
#[derive(Clone, Copy)]
pub(super) struct LevelRay<'a> {
    pub(super) tree: &'a Tree,
    pub(super) cull: CullRay,
    pub(super) exact: LocalRay,
    /// Of the level's first leaf.
    pub(super) first_path: u64,
}

impl<'a> LevelRay<'a> {
    /// None if the ray cannot meet anything in the tree.
    #[inline(always)]
    pub(super) fn new(tree: &'a Tree, exact: LocalRay, first_path: u64) -> Option<Self> {
        let cull = CullRay::new(&exact, tree)?;
        Some(LevelRay { tree, cull, exact, first_path })
    }
}
