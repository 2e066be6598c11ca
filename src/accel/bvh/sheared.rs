//! A ray against eight triangles, in single precision, to cull; with bounds on what that loses.
//!
//! **What must hold.** Whatever the double-precision test ([`crate::math::triangle`]) would accept, culling lets
//! through.
//!
//! As Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT 2(1), 2013, corners are moved to the origin
//! and sheared so that the ray runs along z, the axis of its direction's largest component: with z = vz - oz, x is vx -
//! ox less (dx/dz) z. Let u = 2^-24, L the longest side of the triangle's box, Z the largest |z| of its corners, and e
//! an error of the ray's origin (none if that is an f32). Where the ray meets the triangle, |x| <= 2L for every corner,
//! so |vx - ox| <= 2L + Z.
//!
//! *Corners.* Of x, the first difference is off by u |vx - ox| + e, the shear by 4u (the components of d, the division
//! and the product are rounded), z by u Z + e, the product by u, the result by u |x|: less than **D = 8u (L + Z) + 2e**
//! together.
//!
//! *Edge functions* p0 q1 - p1 q0 of such corners. The products are off by 2 (4L D + D^2), the roundings by 4u (2L +
//! D)^2; as u L <= D/8, less than **E = 14 D (L + D)** together. An edge function has a sign for certain only beyond E,
//! and a ray may meet a triangle while all three can have one sign.
//!
//! *Distances.* A corner's z / dz is off by less than D / |dz|.
//!
//! *Sides.* The volume A x B . C of the corners seen from the origin says on which side of the plane that lies; in
//! single precision it is off by less than 8u times the same with all products positive (Shewchuk, "Adaptive Precision
//! Floating-Point Arithmetic and Fast Robust Geometric Predicates", 1997, where 7.1 would do), and by 6 e L^2. U + V +
//! W says on which side of the ray's direction it lies, for certain beyond 4E. If both are certain and the plane lies
//! behind the origin, the ray meets nothing there: the plane's distance is negative, and so is a corner's, by which the
//! double-precision test bounds it. (Its own errors are less than 2^-47 (L + Z) L^2; the bound has 2^-40 for them.)
//! This spares rays the decision about the triangle that they leave, whose distance is some u of the scene's extent: a
//! hundred times the bound.

use super::layout::Block;
use super::simd::{Lanes, Simd};
use crate::math::bounds::U32;
use glam::Vec3;

/// A ray as triangles want it.
#[derive(Clone, Copy)]
pub(super) struct ShearedRay {
    /// The axes x, y, z of the sheared space.
    k: [u32; 3],
    /// The origin, by those axes.
    o: [f32; 3],
    /// dx / dz and dy / dz.
    shear: [f32; 2],
    /// 1 / dz.
    along: f32,
    /// Twice the error of the origin.
    slip: f32,
}

/// What eight triangles say to a ray.
pub(super) struct Candidates {
    /// Those that it may meet, a bit each.
    pub(super) maybe: u32,
    /// Those that it meets for certain.
    pub(super) certain: u32,
}

impl ShearedRay {
    /// Of a ray that single precision carries as it is: the axis that is z, and by the axes x, y, z of the sheared
    /// space the origin; dx / dz and dy / dz; 1 / dz.
    #[inline(always)]
    pub(super) fn from_parts(axis: usize, o: [f32; 3], shear: [f32; 2], along: f32) -> Self {
        ShearedRay { k: AXES[axis % 3], o, shear, along, slip: 0.0 }
    }

    /// `error` is that of the origin.
    #[inline(always)]
    pub(super) fn new(o: Vec3, d: Vec3, error: f32) -> Self {
        let a = d.abs();
        // Without a branch: nothing here could be predicted.
        let z = if a.x > a.y { 0 } else { 1 };
        let z = if a.z > a.x.max(a.y) { 2 } else { z };
        let k = AXES[z % 3];
        let [x, y, z] = k.map(|k| k as usize % 3);
        let (o, d) = (o.to_array(), d.to_array());
        let along = 1.0 / d[z];
        ShearedRay { k, o: [o[x], o[y], o[z]], shear: [d[x] * along, d[y] * along], along, slip: 2.0 * error }
    }

    /// A corner of a block's triangles, sheared.
    #[inline(always)]
    fn corner<S: Simd>(&self, block: &Block, c: usize) -> [S::V; 3] {
        // The axes are a permutation of 0, 1, 2, which the compiler does not know.
        let [kx, ky, kz] = self.k;
        let of = |k: u32| &block.v[k as usize % 3][c];
        let z = S::sub(S::load(of(kz)), S::splat(self.o[2]));
        let x = S::sub(S::load(of(kx)), S::splat(self.o[0]));
        let y = S::sub(S::load(of(ky)), S::splat(self.o[1]));
        [S::neg_mul_add(S::splat(self.shear[0]), z, x), S::neg_mul_add(S::splat(self.shear[1]), z, y), z]
    }

    /// Tests the triangles of a block. The ray runs from `tnear`, which is not negative, to `tfar`; whether a hit is
    /// certain is only asked where `CERTAIN`.
    #[inline(always)]
    pub(super) fn test<S: Simd, const CERTAIN: bool>(
        &self,
        block: &Block,
        tnear: f32,
        tfar: f32,
    ) -> Candidates {
        let (a, b, c) = (self.corner::<S>(block, 0), self.corner::<S>(block, 1), self.corner::<S>(block, 2));
        let (u, v, w) = (edge::<S>(&b, &c), edge::<S>(&c, &a), edge::<S>(&a, &b));
        let (least, most) = (S::min(u, S::min(v, w)), S::max(u, S::max(v, w)));
        let size = S::load(&block.size);
        let (low, high) = (S::min(a[2], S::min(b[2], c[2])), S::max(a[2], S::max(b[2], c[2])));
        let furthest = S::max(high, S::sub(S::splat(0.0), low));
        let reach = S::add(size, furthest);
        let error = S::mul_add(reach, S::splat(8.0 * U32), S::splat(self.slip + TINY));
        let scaled = S::mul(error, S::splat(14.0));
        let slack = S::mul_add(scaled, S::add(size, error), S::splat(f32::MIN_POSITIVE));
        let minus = S::sub(S::splat(0.0), slack);
        let maybe = S::le(minus, least) | S::le(most, slack);
        // Between which distances each triangle lies as a whole.
        let along = S::splat(self.along);
        let (one, other) = (S::mul(low, along), S::mul(high, along));
        let (first, last) = (S::min(one, other), S::max(one, other));
        let error = S::mul(error, S::splat(self.along.abs()));
        let (tnear, tfar) = (S::splat(tnear), S::splat(tfar));
        let reached = S::le(tnear, S::add(last, error)) & S::le(S::sub(first, error), tfar);
        let maybe = maybe & reached;
        let sum = S::add(u, S::add(v, w));
        let maybe = maybe & !self.behind::<S>(block, sum, slack, reach);
        if !CERTAIN {
            return Candidates { maybe, certain: 0 };
        }
        let inside = S::le(slack, least) | S::le(most, minus);
        let within = S::le(S::add(tnear, error), first) & S::le(last, S::sub(tfar, error));
        Candidates { maybe, certain: maybe & inside & within }
    }

    /// The triangles whose planes lie behind the ray's origin, for certain. `sum` is that of the edge functions,
    /// `slack` the error of one, `reach` the L + Z.
    #[inline(always)]
    fn behind<S: Simd>(&self, block: &Block, sum: S::V, slack: S::V, reach: S::V) -> u32 {
        // The bit of the sign, and a zero that is as good as another.
        let minus_zero = S::splat(-0.0);
        let abs = S::splat(f32::from_bits(0x7fff_ffff));
        let from = |axis: usize, c: usize| {
            S::sub(S::load(&block.v[self.k[axis] as usize % 3][c]), S::splat(self.o[axis]))
        };
        let (ax, ay, az) = (from(0, 0), from(1, 0), from(2, 0));
        let (bx, by, bz) = (from(0, 1), from(1, 1), from(2, 1));
        let (cx, cy, cz) = (from(0, 2), from(1, 2), from(2, 2));
        let (pa, na) = (S::mul(bx, cy), S::mul(by, cx));
        let (pb, nb) = (S::mul(cx, ay), S::mul(cy, ax));
        let (pc, nc) = (S::mul(ax, by), S::mul(ay, bx));
        let volume =
            S::mul_add(az, S::sub(pa, na), S::mul_add(bz, S::sub(pb, nb), S::mul(cz, S::sub(pc, nc))));
        let size = |p: S::V, n: S::V| S::add(S::and(p, abs), S::and(n, abs));
        let most = S::mul_add(
            S::and(az, abs),
            size(pa, na),
            S::mul_add(S::and(bz, abs), size(pb, nb), S::mul(S::and(cz, abs), size(pc, nc))),
        );
        let rest = S::mul_add(reach, S::splat(1e-12), S::splat(3.0 * self.slip));
        let length = S::load(&block.size);
        let margin = S::mul_add(S::mul(rest, length), length, S::splat(f32::MIN_POSITIVE));
        let margin = S::mul_add(most, S::splat(8.0 * U32), margin);
        let sign = S::and(S::xor(sum, S::splat(self.along)), minus_zero);
        let side = S::xor(volume, sign);
        let four = S::mul(slack, S::splat(4.0));
        let clear = S::le(four, sum) | S::le(sum, S::xor(four, minus_zero));
        // What overflows says nothing.
        clear & S::le(S::add(side, margin), minus_zero) & S::le(S::splat(f32::MIN), side)
    }

    /// As [`ShearedRay::test`], without bounds: whatever single precision says. The triangles that are hit by its
    /// word, and where.
    #[inline(always)]
    pub(super) fn hits<S: Simd>(&self, block: &Block, tnear: f32, tfar: f32) -> (u32, Lanes) {
        let (a, b, c) = (self.corner::<S>(block, 0), self.corner::<S>(block, 1), self.corner::<S>(block, 2));
        let (u, v, w) = (edge::<S>(&b, &c), edge::<S>(&c, &a), edge::<S>(&a, &b));
        let zero = S::splat(0.0);
        let inside = S::le(zero, S::min(u, S::min(v, w))) | S::le(S::max(u, S::max(v, w)), zero);
        let sum = S::mul_add(u, a[2], S::mul_add(v, b[2], S::mul(w, c[2])));
        let t = S::div(S::mul(sum, S::splat(self.along)), S::add(u, S::add(v, w)));
        let held = S::le(zero, S::load(&block.size));
        (inside & held & S::le(S::splat(tnear), t) & S::le(t, S::splat(tfar)), S::store(t))
    }
}

/// By the largest component of a direction, the axes x, y, z of the sheared space.
static AXES: [[u32; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];

/// Keeps D above what underflows.
const TINY: f32 = 1e-36;

/// The edge function of two sheared corners.
#[inline(always)]
fn edge<S: Simd>(p: &[S::V; 3], q: &[S::V; 3]) -> S::V {
    S::mul_sub(p[0], q[1], S::mul(p[1], q[0]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::bvh::simd::{Available, Job, LANES, enter};
    use crate::math::simd::Level;
    use crate::math::triangle::TriangleRay;
    use crate::testing::TestRng;

    struct Test<'a>(&'a ShearedRay, &'a Block, f32, f32);

    impl Job for Test<'_> {
        type Output = [Candidates; 2];
        #[inline(always)]
        fn run<S: Simd>(self) -> [Candidates; 2] {
            let Test(ray, block, tnear, tfar) = self;
            [ray.test::<S, false>(block, tnear, tfar), ray.test::<S, true>(block, tnear, tfar)]
        }
    }

    /// A block of triangles of about a size, and a ray at them, of which most are decided by rounding.
    fn case(rng: &mut TestRng, kind: u32) -> (Block, [[Vec3; 3]; LANES], Vec3, Vec3) {
        // From sizes whose products underflow to those whose products overflow.
        let scale = [1.0, 1e-3, 1e-13, 1e-19, 1e3, 1e14][kind as usize / 8 % 6];
        let middle = rng.cube().as_vec3() * scale;
        let size = scale * [1.0, 0.1, 1e-2, 1e-4][(rng.bits() % 4) as usize];
        let mut block = Block::empty();
        let triangles: [[Vec3; 3]; LANES] = std::array::from_fn(|_| {
            let mut v = [0; 3].map(|_| middle + rng.cube().as_vec3() * size);
            if kind.is_multiple_of(3) {
                // A sliver.
                v[2] = v[0] + (v[1] - v[0]) * rng.f32() + rng.cube().as_vec3() * (size * 1e-6);
            }
            v
        });
        for (lane, v) in triangles.iter().enumerate().skip(kind as usize % 2) {
            block.set(lane, *v);
        }
        let v = triangles[(rng.bits() % LANES as u64) as usize];
        let (a, b) = (rng.f32(), rng.f32());
        let inside = v[0] + (v[1] - v[0]) * (a * (1.0 - b)) + (v[2] - v[0]) * (a * b);
        let step = |rng: &mut TestRng| rng.cube().as_vec3() * (scale * f32::EPSILON * 4.0);
        let from = rng.cube().as_vec3() * scale;
        let (o, d) = match kind % 8 {
            // As rays are spawned: from beside a triangle, anywhere.
            0 | 1 => (inside + step(rng), rng.direction()),
            // Along the triangle.
            2 => (inside + step(rng), v[1] - v[0] + step(rng)),
            // At corners and edges, exactly and beside.
            3 => (from, v[0] - from),
            4 => (from, v[0] + (v[1] - v[0]) * rng.f32() - from),
            5 => (from, v[1] - from + step(rng)),
            // At the inside.
            6 => (from, inside - from),
            _ => (from, rng.direction()),
        };
        // Of a length as kernels see it.
        let longest = d.abs().max_element();
        let d = if longest > 0.0 { d / longest } else { Vec3::X };
        (block, triangles, o, d)
    }

    /// Culling lets through what double precision accepts, and is certain only of that.
    #[test]
    fn double_precision_is_never_contradicted() {
        let mut rng = TestRng::new(7);
        let (mut accepted, mut culled_behind, mut behind, mut certain) = (0, 0, 0, 0);
        for kind in 0..60_000 {
            let (block, triangles, o, d) = case(&mut rng, kind);
            let sheared = ShearedRay::new(o, d, 0.0);
            let exact = TriangleRay::new(o.as_dvec3(), d.as_dvec3());
            let t = triangles.map(|v| exact.distance(v.map(|p| p.as_dvec3())));
            let ends = [(0.0, f32::INFINITY), (0.0, 1.0), (0.5, 2.0)];
            let (tnear, tfar) = ends[kind as usize / 3 % 3];
            let is_hit = |t: f64| t >= f64::from(tnear) && t <= f64::from(tfar);
            for level in Level::available() {
                let available = Available::new(Some(level)).expect("available");
                let [plain, asked] = enter(available, Test(&sheared, &block, tnear, tfar));
                assert_eq!(plain.maybe, asked.maybe, "{level:?} {kind}");
                for lane in kind as usize % 2..LANES {
                    let [maybe, sure] = [asked.maybe, asked.certain].map(|set| set >> lane & 1 == 1);
                    let hit = t[lane].is_some_and(is_hit);
                    let what = || format!("{level:?}, case {kind}, lane {lane}: {:?} {o:?} {d:?}", t[lane]);
                    assert!(maybe || !hit, "culled: {}", what());
                    assert!(!sure || hit, "not certain: {}", what());
                    accepted += u32::from(hit);
                    certain += u32::from(sure);
                    let is_behind = kind % 8 < 2 && t[lane].is_some_and(|t| t < 0.0);
                    behind += u32::from(is_behind);
                    culled_behind += u32::from(is_behind && !maybe);
                }
                assert_eq!(asked.maybe & (kind % 2), 0, "a lane without a triangle");
            }
        }
        // That the cases are what they should be: many hits, many of them certain, and most planes behind known to be
        // (not those of slivers, a third).
        assert!(accepted > 50_000 && certain > accepted / 4, "{accepted} {certain}");
        assert!(culled_behind * 10 > behind * 6, "{culled_behind} of {behind}");
    }
}
