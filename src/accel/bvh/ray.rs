//! A ray as traversal uses it: in single precision, to cull, with bounds on what that loses (for triangles:
//! `sheared.rs`).
//!
//! **What must hold.** Whatever the double-precision tests would accept, culling lets through. Let u = 2^-24, and R the
//! largest sum, by axis, of the extent of the tree and the size of the ray's origin: no difference between a point of
//! the tree and the origin exceeds it.
//!
//! *Boxes.* A plane b is met at t = (b - o) / d, computed as fma(b, r, c) with r = 1/d and c = -o r. Against the exact
//! ray, b r is off by 2u |b r| (d, and the division, rounded once each) and o r by 4u |o r| (o, d, the division, the
//! product), the sums by u each: less than 8u (|b| + |o|) |r| <= 8u R |r| together, which is a constant of the ray.
//! Added to the far planes' c and taken from the near planes', it makes the test conservative at no cost. A component
//! of d below 1e-10 of the largest is enlarged to that, which moves the ray by no more than 1e-10 R within the tree,
//! and keeps 1/d finite.

use super::layout::{Node, Tree};
use super::sheared::ShearedRay;
use super::simd::Simd;
use crate::accel::tame::{DIRECTION, Tame};
use crate::base::ray::{MAX_COORDINATE, Ray};
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

/// What eight boxes say to a ray.
pub(super) struct Boxes<S: Simd> {
    /// Those that it may meet, all bits of their lanes.
    pub(super) hit: S::V,
    /// Where it enters them.
    pub(super) near: S::V,
}

impl CullRay {
    /// None if the ray cannot meet anything in the tree.
    #[inline(always)]
    pub(super) fn new(ray: &LocalRay, tree: &Tree) -> Option<Self> {
        let tame = Tame::new(ray, &tree.grown, tree.reach)?;
        let (o, d) = (tame.ray.o.as_vec3(), tame.ray.d.as_vec3());
        let lost = if tame.shift == 0.0 { 0.0 } else { (ray.o.abs().max_element() * 1e-15) as f32 };
        let tnear = round_down(tame.ray.tnear);
        Some(CullRay { o, d, tnear, lost, shift: tame.shift, rescale: 1.0 / tame.scale })
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

    /// For tests of triangles.
    #[inline(always)]
    fn sheared(&self) -> ShearedRay {
        ShearedRay::new(self.o, self.d, self.o.abs().max_element() * U32 + self.lost)
    }

    /// Where the original ray is when culling's own t is this.
    #[inline(always)]
    pub(super) fn restored(&self, t: f32) -> f64 {
        f64::from(t) / self.rescale + self.shift
    }
}

/// 1 for negative numbers, else 0.
#[inline(always)]
pub(super) fn sign(x: f32) -> usize {
    (x.to_bits() >> 31) as usize
}

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

#[inline(always)]
fn splat3<S: Simd>(v: Vec3) -> [S::V; 3] {
    [S::splat(v.x), S::splat(v.y), S::splat(v.z)]
}

/// A ray at one level of nesting: exact, and for culling.
#[derive(Clone, Copy)]
pub(super) struct LevelRay<'a> {
    pub(super) tree: &'a Tree,
    pub(super) cull: CullRay,
    sheared: ShearedRay,
    pub(super) exact: LocalRay,
    /// Of the level's first leaf.
    pub(super) first_path: u64,
}

impl<'a> LevelRay<'a> {
    /// None if the ray cannot meet anything in the tree.
    #[inline(always)]
    pub(super) fn new(tree: &'a Tree, exact: LocalRay, first_path: u64) -> Option<Self> {
        let cull = CullRay::new(&exact, tree)?;
        Some(LevelRay { tree, cull, sheared: cull.sheared(), exact, first_path })
    }
}

/// A ray in a tree, as its leaves ask for it.
pub(super) trait TreeRay {
    fn tree(&self) -> &Tree;
    fn sheared(&self) -> ShearedRay;
    /// Which of the two planes of each axis it meets first.
    fn first(&self) -> [usize; 3];
    /// Where it begins, by culling's own t.
    fn tnear(&self) -> f32;
    /// An upper bound of culling's own t.
    fn end(&self, t: f64) -> f32;
    /// As the tests that decide take it; its end means nothing.
    fn exact(&self) -> LocalRay;
    /// Of the first leaf of the tree's group.
    fn first_path(&self) -> u64;
    /// Where the original ray is when culling's own t is this.
    fn restored(&self, t: f32) -> f64;
}

impl TreeRay for LevelRay<'_> {
    #[inline(always)]
    fn tree(&self) -> &Tree {
        self.tree
    }
    #[inline(always)]
    fn sheared(&self) -> ShearedRay {
        self.sheared
    }
    #[inline(always)]
    fn first(&self) -> [usize; 3] {
        self.cull.first()
    }
    #[inline(always)]
    fn tnear(&self) -> f32 {
        self.cull.tnear
    }
    #[inline(always)]
    fn end(&self, t: f64) -> f32 {
        self.cull.end(t)
    }
    #[inline(always)]
    fn exact(&self) -> LocalRay {
        self.exact
    }
    #[inline(always)]
    fn first_path(&self) -> u64 {
        self.first_path
    }
    #[inline(always)]
    fn restored(&self, t: f32) -> f64 {
        self.cull.restored(t)
    }
}

/// A ray of render space in the root's tree that single precision carries as it is.
#[derive(Clone, Copy)]
pub(super) struct PlainRay<'a> {
    pub(super) tree: &'a Tree,
    pub(super) o: Vec3,
    pub(super) d: Vec3,
    pub(super) tnear: f32,
    pub(super) sheared: ShearedRay,
}

impl TreeRay for PlainRay<'_> {
    #[inline(always)]
    fn tree(&self) -> &Tree {
        self.tree
    }
    #[inline(always)]
    fn sheared(&self) -> ShearedRay {
        self.sheared
    }
    #[inline(always)]
    fn first(&self) -> [usize; 3] {
        [sign(self.d.x), sign(self.d.y), sign(self.d.z)]
    }
    #[inline(always)]
    fn tnear(&self) -> f32 {
        self.tnear
    }
    #[inline(always)]
    fn end(&self, t: f64) -> f32 {
        round_up(t)
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
    #[inline(always)]
    fn restored(&self, t: f32) -> f64 {
        f64::from(t)
    }
}

impl<'a> PlainRay<'a> {
    /// None if double precision must see to the ray, or if it is not valid.
    #[inline(always)]
    pub(super) fn new(ray: &Ray, tree: &'a Tree) -> Option<Self> {
        // No further than valid rays may start (`Ray::is_valid`), whatever the tree's extent.
        let reach = (tree.reach as f32).min(MAX_COORDINATE);
        let (o, d) = (ray.o.abs(), ray.d.abs());
        // Comparisons that NaN fails: a maximum would lose one. No branch for each: most rays pass all.
        let fit = o.cmple(Vec3::splat(reach)).all()
            & d.cmple(Vec3::splat(*DIRECTION.end())).all()
            & (d.max_element() >= *DIRECTION.start())
            & (ray.tnear >= 0.0)
            & (ray.tnear <= ray.tfar)
            & (ray.tnear < f32::INFINITY);
        let sheared = ShearedRay::new(ray.o, ray.d, 0.0);
        fit.then_some(PlainRay { tree, o: ray.o, d: ray.d, tnear: ray.tnear, sheared })
    }

    #[inline(always)]
    pub(super) fn cull(&self) -> CullRay {
        CullRay { o: self.o, d: self.d, tnear: self.tnear, lost: 0.0, shift: 0.0, rescale: 1.0 }
    }

    /// The same, for searches that may leave the root's tree.
    #[inline(always)]
    pub(super) fn level(&self) -> LevelRay<'a> {
        let sheared = self.sheared;
        LevelRay { tree: self.tree, cull: self.cull(), sheared, exact: self.exact(), first_path: 0 }
    }
}
