//! The rays of a stream, column by column.

use super::layout::Tree;
use super::ray::{BoxRays, PlainRay, sign};
use super::sheared::ShearedRay;
use super::simd::{LANES, Lanes, Simd};
use crate::accel::tame::DIRECTION;
use crate::base::ray::{MAX_COORDINATE, RayBatch};
use bytemuck::cast_slice_mut;
use glam::Vec3;
use std::ops::Range;

/// Rays of a stream, the bits of a set.
pub(super) const RAYS: usize = 64;
pub(super) const VECTORS: usize = RAYS / LANES;

/// A number of each ray.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct Column(pub(super) [Lanes; VECTORS]);

impl Column {
    #[inline(always)]
    pub(super) fn get(&self, r: usize) -> f32 {
        self.0[r / LANES % VECTORS].0[r % LANES]
    }

    #[inline(always)]
    pub(super) fn set(&mut self, r: usize, x: f32) {
        self.0[r / LANES % VECTORS].0[r % LANES] = x;
    }
}

/// What tests of triangles read, as [`ShearedRay`].
pub(super) struct ShearedColumns {
    /// The bits of an axis.
    k: Column,
    o: [Column; 3],
    shear: [Column; 2],
    along: Column,
}

impl ShearedColumns {
    /// Works out a vector of rays.
    #[inline(always)]
    fn set<S: Simd>(&mut self, i: usize, o: [S::V; 3], d: [S::V; 3]) {
        let size = S::splat(f32::from_bits(0x7fff_ffff));
        let (ax, ay, az) = (S::and(d[0], size), S::and(d[1], size), S::and(d[2], size));
        let (is_x, is_z) = (S::le_bits(ay, ax), S::le_bits(S::max(ax, ay), az));
        let axis = |k| S::splat(f32::from_bits(k));
        self.k.0[i] = S::store(S::select(is_z, axis(2), S::select(is_x, axis(0), axis(1))));
        for (c, [z, x, y]) in [[0, 1, 2], [1, 2, 0], [2, 0, 1]].into_iter().enumerate() {
            self.o[c].0[i] = S::store(S::select(is_z, o[z], S::select(is_x, o[x], o[y])));
        }
        let along = S::div(S::splat(1.0), S::select(is_z, d[2], S::select(is_x, d[0], d[1])));
        self.along.0[i] = S::store(along);
        for (c, [z, x, y]) in [[0, 1, 2], [1, 2, 0]].into_iter().enumerate() {
            let d = S::select(is_z, d[z], S::select(is_x, d[x], d[y]));
            self.shear[c].0[i] = S::store(S::mul(d, along));
        }
    }

    #[inline(always)]
    pub(super) fn ray(&self, r: usize) -> ShearedRay {
        ShearedRay::from_parts(
            self.k.get(r).to_bits() as usize,
            [self.o[0].get(r), self.o[1].get(r), self.o[2].get(r)],
            [self.shear[0].get(r), self.shear[1].get(r)],
            self.along.get(r),
        )
    }
}

/// The rays of a stream.
pub(super) struct Columns {
    pub(super) o: [Column; 3],
    pub(super) d: [Column; 3],
    pub(super) inv: [Column; 3],
    pub(super) near: [Column; 3],
    pub(super) far: [Column; 3],
    pub(super) tnear: Column,
    pub(super) tfar: Column,
    /// For tests of triangles.
    pub(super) sheared: ShearedColumns,
}

impl Columns {
    pub(super) const ZERO: Columns = {
        let zero = Column([Lanes([0.0; LANES]); VECTORS]);
        Columns {
            o: [zero; 3],
            d: [zero; 3],
            inv: [zero; 3],
            near: [zero; 3],
            far: [zero; 3],
            tnear: zero,
            tfar: zero,
            sheared: ShearedColumns { k: zero, o: [zero; 3], shear: [zero; 2], along: zero },
        }
    };

    /// Takes a ray of a batch.
    #[inline(always)]
    pub(super) fn set(&mut self, r: usize, rays: &RayBatch, i: usize) {
        self.o[0].set(r, rays.ox[i]);
        self.o[1].set(r, rays.oy[i]);
        self.o[2].set(r, rays.oz[i]);
        self.d[0].set(r, rays.dx[i]);
        self.d[1].set(r, rays.dy[i]);
        self.d[2].set(r, rays.dz[i]);
        self.tnear.set(r, rays.tnear[i]);
        self.tfar.set(r, rays.tfar[i]);
    }

    /// Takes rays that stand together in a batch.
    #[inline(always)]
    pub(super) fn set_all(&mut self, rays: &RayBatch, at: Range<usize>) {
        let [ox, oy, oz] = &mut self.o;
        let [dx, dy, dz] = &mut self.d;
        let n = at.len();
        let columns = [ox, oy, oz, dx, dy, dz, &mut self.tnear, &mut self.tfar];
        let from = [&rays.ox, &rays.oy, &rays.oz, &rays.dx, &rays.dy, &rays.dz, &rays.tnear, &rays.tfar];
        for (to, from) in columns.into_iter().zip(from) {
            cast_slice_mut::<Lanes, f32>(&mut to.0)[..n].copy_from_slice(&from[at.clone()]);
        }
    }

    /// Repeats the last of `n` rays to the end of its vector.
    #[inline(always)]
    pub(super) fn pad(&mut self, n: usize) {
        for r in n..n.next_multiple_of(LANES) {
            for axis in 0..3 {
                self.o[axis].set(r, self.o[axis].get(n - 1));
                self.d[axis].set(r, self.d[axis].get(n - 1));
            }
            self.tnear.set(r, self.tnear.get(n - 1));
            self.tfar.set(r, self.tfar.get(n - 1));
        }
    }

    /// Works out the rest from the first `n` rays. Returns the set of those that single precision carries as they are.
    #[inline(always)]
    pub(super) fn prepare<S: Simd>(&mut self, n: usize, tree: &Tree) -> u64 {
        // No further than valid rays may start (`Ray::is_valid`), whatever the tree's extent.
        let reach = (tree.reach as f32).min(MAX_COORDINATE);
        let mut plain = 0;
        let size = S::splat(f32::from_bits(0x7fff_ffff));
        for i in 0..n.div_ceil(LANES) {
            let o = [S::load(&self.o[0].0[i]), S::load(&self.o[1].0[i]), S::load(&self.o[2].0[i])];
            let d = [S::load(&self.d[0].0[i]), S::load(&self.d[1].0[i]), S::load(&self.d[2].0[i])];
            let rays = BoxRays::<S>::new(o, d, tree, 0.0);
            for axis in 0..3 {
                self.inv[axis].0[i] = S::store(rays.inv[axis]);
                self.near[axis].0[i] = S::store(rays.near[axis]);
                self.far[axis].0[i] = S::store(rays.far[axis]);
            }
            self.sheared.set::<S>(i, o, d);
            // Comparisons that NaN fails: a maximum would lose one.
            let (dx, dy, dz) = (S::and(d[0], size), S::and(d[1], size), S::and(d[2], size));
            let (far, long) = (S::splat(reach), S::splat(*DIRECTION.end()));
            let (tnear, tfar) = (S::load(&self.tnear.0[i]), S::load(&self.tfar.0[i]));
            let ok = S::le(S::and(o[0], size), far)
                & S::le(S::and(o[1], size), far)
                & S::le(S::and(o[2], size), far)
                & S::le(dx, long)
                & S::le(dy, long)
                & S::le(dz, long)
                & S::le(S::splat(*DIRECTION.start()), S::max(dx, S::max(dy, dz)))
                & S::le(S::splat(0.0), tnear)
                & S::le(tnear, tfar)
                & S::le(tnear, S::splat(f32::MAX));
            plain |= u64::from(ok) << (i * LANES);
        }
        plain & u64::MAX >> (RAYS - n)
    }

    #[inline(always)]
    pub(super) fn ray<'a>(&self, r: usize, tree: &'a Tree) -> PlainRay<'a> {
        let of = |c: &[Column; 3]| Vec3::new(c[0].get(r), c[1].get(r), c[2].get(r));
        PlainRay {
            tree,
            o: of(&self.o),
            d: of(&self.d),
            tnear: self.tnear.get(r),
            sheared: self.sheared.ray(r),
        }
    }

    /// The set of the first `n` rays whose directions have the signs of ray `r`.
    #[inline(always)]
    pub(super) fn same_octant<S: Simd>(&self, r: usize, n: usize) -> u64 {
        let mut same = 0;
        let d = [&self.d[0], &self.d[1], &self.d[2]];
        let of = |axis: usize| 0u32.wrapping_sub(sign(d[axis].get(r)) as u32);
        let (x, y, z) = (of(0), of(1), of(2));
        for i in 0..n.div_ceil(LANES) {
            let differ = (S::bits(S::load(&d[0].0[i])) ^ x)
                | (S::bits(S::load(&d[1].0[i])) ^ y)
                | (S::bits(S::load(&d[2].0[i])) ^ z);
            same |= u64::from(!differ & 0xff) << (i * LANES);
        }
        same & u64::MAX >> (RAYS - n)
    }
}
