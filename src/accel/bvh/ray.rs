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
use super::simd::{Lanes, Simd};
use crate::accel::tame::Tame;
use crate::base::shape::LocalRay;
use crate::math::aabb::{round_down, round_up};
use crate::math::bounds::U32;
use glam::Vec3;

/// A ray in the space of a tree.
#[derive(Clone, Copy)]
pub(super) struct CullRay {
    pub(super) o: Vec3,
    pub(super) d: Vec3,
    pub(super) tnear: f32,
    /// What double precision has lost of an origin far away.
    lost: f32,
    /// The error of a sheared coordinate.
    pub(super) delta: f32,
    /// Culling's own t is `(t - shift) * rescale`.
    shift: f64,
    rescale: f64,
}

/// Rays against boxes: one in each lane, or one in all.
#[derive(Clone, Copy)]
pub(super) struct BoxRays<S: Simd> {
    /// 1 / d.
    pub(super) inv: [S::V; 3],
    /// What to add to the product with the plane that is met first, and with the other.
    pub(super) near: [S::V; 3],
    pub(super) far: [S::V; 3],
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
    /// Those that it may meet, all bits of their lanes.
    pub(super) hit: S::V,
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
        let lost = if tame.shift == 0.0 { 0.0 } else { (ray.o.abs().max_element() * 1e-15) as f32 };
        let most = (tree.extent + o.abs()).max_element().max(LEAST_EXTENT) + lost * (1.0 / U32);
        let delta = DELTA * most;
        let tnear = round_down(tame.ray.tnear);
        Some(CullRay { o, d, tnear, lost, delta, shift: tame.shift, rescale: 1.0 / tame.scale })
    }

    /// An upper bound of culling's own t.
    #[inline(always)]
    pub(super) fn end(&self, t: f64) -> f32 {
        round_up((t - self.shift) * self.rescale)
    }

    /// Which of the two planes of each axis the ray meets first.
    #[inline(always)]
    pub(super) fn first(&self) -> [usize; 3] {
        [sign(self.d.x), sign(self.d.y), sign(self.d.z)]
    }

    /// For tests of boxes, in all lanes.
    #[inline(always)]
    pub(super) fn boxes<S: Simd>(&self, tree: &Tree) -> BoxRays<S> {
        BoxRays::new(splat3::<S>(self.o), splat3::<S>(self.d), tree, self.lost)
    }

    /// Tests the triangles of a block. `tfar` is the ray's end; whether a hit is certain is only asked where `CERTAIN`.
    #[inline(always)]
    pub(super) fn triangles<S: Simd, const CERTAIN: bool>(&self, block: &Block, tfar: f32) -> Candidates {
        let (ray, along) = self.sheared::<S>();
        let (a, b, c) = (ray.corner(block, 0), ray.corner(block, 1), ray.corner(block, 2));
        let (u, v, w) = (edge::<S>(&b, &c), edge::<S>(&c, &a), edge::<S>(&a, &b));
        let least = S::min(u, S::min(v, w));
        let most = S::max(u, S::max(v, w));
        let scale = 14.0 * self.delta;
        let constant = S::splat(scale * self.delta + f32::MIN_POSITIVE);
        let slack = S::mul_add(S::load(&block.size), S::splat(scale), constant);
        let minus = S::sub(S::splat(0.0), slack);
        let maybe = S::le(minus, least) | S::le(most, slack);
        if maybe == 0 {
            return Candidates { maybe, certain: 0 };
        }
        // Between which distances each triangle lies as a whole.
        let error = S::splat(16.0 / 12.0 * self.delta * along.abs());
        let along = S::splat(along);
        let (z0, z1, z2) = (S::mul(a[2], along), S::mul(b[2], along), S::mul(c[2], along));
        let (first, last) = (S::min(z0, S::min(z1, z2)), S::max(z0, S::max(z1, z2)));
        let (tnear, tfar) = (S::splat(self.tnear), S::splat(tfar));
        let maybe = maybe & S::le(tnear, S::add(last, error)) & S::le(S::sub(first, error), tfar);
        if !CERTAIN {
            return Candidates { maybe, certain: 0 };
        }
        let inside = S::le(slack, least) | S::le(most, minus);
        let within = S::le(S::add(tnear, error), first) & S::le(last, S::sub(tfar, error));
        Candidates { maybe, certain: maybe & inside & within }
    }

    /// As [`CullRay::triangles`], without bounds: whatever single precision says. The triangles that are hit by its
    /// word, and where.
    #[inline(always)]
    pub(super) fn triangles_by_single<S: Simd>(&self, block: &Block, tfar: f32) -> (u32, Lanes) {
        let (ray, along) = self.sheared::<S>();
        let (a, b, c) = (ray.corner(block, 0), ray.corner(block, 1), ray.corner(block, 2));
        let (u, v, w) = (edge::<S>(&b, &c), edge::<S>(&c, &a), edge::<S>(&a, &b));
        let zero = S::splat(0.0);
        let inside = S::le(zero, S::min(u, S::min(v, w))) | S::le(S::max(u, S::max(v, w)), zero);
        let sum = S::mul_add(u, a[2], S::mul_add(v, b[2], S::mul(w, c[2])));
        let t = S::div(S::mul(sum, S::splat(along)), S::add(u, S::add(v, w)));
        let held = S::le(zero, S::load(&block.size));
        (inside & held & S::le(S::splat(self.tnear), t) & S::le(t, S::splat(tfar)), S::store(t))
    }

    /// For tests of triangles, and 1 / dz.
    #[inline(always)]
    fn sheared<S: Simd>(&self) -> (ShearedRay<S>, f32) {
        let k = shear_axes(self.d.abs());
        let [kx, ky, kz] = k;
        let along = 1.0 / self.d[kz % 3];
        let ray = ShearedRay::<S> {
            k,
            o: [S::splat(self.o[kx % 3]), S::splat(self.o[ky % 3]), S::splat(self.o[kz % 3])],
            shear: [S::splat(self.d[kx % 3] * along), S::splat(self.d[ky % 3] * along)],
        };
        (ray, along)
    }

    /// Where the original ray is when culling's own t is this.
    #[inline(always)]
    pub(super) fn restored(&self, t: f32) -> f64 {
        f64::from(t) / self.rescale + self.shift
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

/// 1 for negative numbers, else 0.
#[inline(always)]
pub(super) fn sign(x: f32) -> usize {
    (x.to_bits() >> 31) as usize
}

/// The error of a sheared coordinate over R: see the module.
const DELTA: f32 = 12.0 * U32;
/// R of a tree without extent, so that bounds do not vanish.
const LEAST_EXTENT: f32 = 1e-30;

impl<S: Simd> BoxRays<S> {
    /// Rays in a tree. `lost` is an error of the origins beyond rounding.
    #[inline(always)]
    pub(super) fn new(o: [S::V; 3], d: [S::V; 3], tree: &Tree, lost: f32) -> Self {
        let (extent, slack) = (tree.extent, tree.slack);
        let size = S::splat(f32::from_bits(0x7fff_ffff));
        let a = [S::and(d[0], size), S::and(d[1], size), S::and(d[2], size)];
        let floor = S::mul(S::max(a[0], S::max(a[1], a[2])), S::splat(1e-10));
        let r = [
            S::add(S::and(o[0], size), S::splat(extent.x)),
            S::add(S::and(o[1], size), S::splat(extent.y)),
            S::add(S::and(o[2], size), S::splat(extent.z)),
        ];
        let most = S::max(S::max(r[0], S::splat(LEAST_EXTENT)), S::max(r[1], r[2]));
        let rest = S::mul_add(most, S::splat(1e-9 * slack), S::splat(lost));
        let mut out = BoxRays { inv: d, near: d, far: d };
        for axis in 0..3 {
            let large = S::max(a[axis], floor);
            let inv = S::div(S::splat(1.0), large);
            let pad = S::mul(S::mul_add(r[axis], S::splat(8.0 * U32 * slack), rest), inv);
            out.inv[axis] = S::or(inv, S::and(d[axis], S::splat(-0.0)));
            let c = S::mul(o[axis], out.inv[axis]);
            out.near[axis] = S::sub(S::sub(S::splat(0.0), c), pad);
            out.far[axis] = S::sub(pad, c);
        }
        out
    }

    /// Tests one ray, which is in all lanes, against the boxes of a node between `tnear` and `tfar`.
    #[inline(always)]
    pub(super) fn test(&self, first: [usize; 3], node: &Node, tnear: S::V, tfar: S::V) -> Boxes<S> {
        let [x, y, z] = first;
        let p = &node.planes;
        let ex = S::mul_add(S::load(&p[0][x & 1]), self.inv[0], self.near[0]);
        let ey = S::mul_add(S::load(&p[1][y & 1]), self.inv[1], self.near[1]);
        let ez = S::mul_add(S::load(&p[2][z & 1]), self.inv[2], self.near[2]);
        let lx = S::mul_add(S::load(&p[0][(x ^ 1) & 1]), self.inv[0], self.far[0]);
        let ly = S::mul_add(S::load(&p[1][(y ^ 1) & 1]), self.inv[1], self.far[1]);
        let lz = S::mul_add(S::load(&p[2][(z ^ 1) & 1]), self.inv[2], self.far[2]);
        let enter = S::max(S::max(ex, ey), S::max(ez, tnear));
        let leave = S::min(S::min(lx, ly), S::min(lz, tfar));
        Boxes { hit: S::le_bits(enter, leave), near: enter }
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

/// A ray in a tree, as its leaves ask for it.
pub(super) trait TreeRay {
    fn tree(&self) -> &Tree;
    fn cull(&self) -> CullRay;
    /// As the tests that decide take it; its end means nothing.
    fn exact(&self) -> LocalRay;
    /// Of the first leaf of the tree's group.
    fn first_path(&self) -> u64;
}

impl TreeRay for LevelRay<'_> {
    #[inline(always)]
    fn tree(&self) -> &Tree {
        self.tree
    }
    #[inline(always)]
    fn cull(&self) -> CullRay {
        self.cull
    }
    #[inline(always)]
    fn exact(&self) -> LocalRay {
        self.exact
    }
    #[inline(always)]
    fn first_path(&self) -> u64 {
        self.first_path
    }
}

/// A ray of render space in the root's tree that single precision carries as it is.
#[derive(Clone, Copy)]
pub(super) struct PlainRay<'a> {
    pub(super) tree: &'a Tree,
    pub(super) o: Vec3,
    pub(super) d: Vec3,
    pub(super) tnear: f32,
}

impl TreeRay for PlainRay<'_> {
    #[inline(always)]
    fn tree(&self) -> &Tree {
        self.tree
    }
    #[inline(always)]
    fn cull(&self) -> CullRay {
        let most = (self.tree.extent + self.o.abs()).max_element().max(LEAST_EXTENT);
        let delta = DELTA * most;
        CullRay { o: self.o, d: self.d, tnear: self.tnear, lost: 0.0, delta, shift: 0.0, rescale: 1.0 }
    }
    #[inline(always)]
    fn exact(&self) -> LocalRay {
        let (o, d) = (self.o.as_dvec3(), self.d.as_dvec3());
        LocalRay { o, d, tnear: f64::from(self.tnear), tfar: f64::INFINITY }
    }
    #[inline(always)]
    fn first_path(&self) -> u64 {
        0
    }
}

impl<'a> PlainRay<'a> {
    /// The same, for searches that may leave the root's tree.
    #[inline(always)]
    pub(super) fn level(&self) -> LevelRay<'a> {
        LevelRay { tree: self.tree, cull: self.cull(), exact: self.exact(), first_path: 0 }
    }
}
