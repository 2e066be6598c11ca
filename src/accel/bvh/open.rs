//! A node opened for the rays of a stream.

use super::columns::{Column, Columns, RAYS, VECTORS};
use super::layout::Node;
use super::simd::{LANES, Lanes, Simd};
use crate::math::bounds::U32;
use glam::Vec3;

/// The bit of a ray in its half of a set.
static BITS: [f32; RAYS / 2] = {
    let mut bits = [0.0; RAYS / 2];
    let mut i = 0;
    while i < RAYS / 2 {
        bits[i] = f32::from_bits(1 << i);
        i += 1;
    }
    bits
};

/// The children of a node that rays may meet.
pub(super) struct Opened {
    /// The lanes that any may meet, a bit each.
    pub(super) hit: u32,
    /// By lane.
    pub(super) rays: [u64; LANES],
    /// Where the first of them enters.
    pub(super) near: [f32; LANES],
}

/// Tests the rays of a set, all of one octant, against the boxes of a node: ray by ray.
#[inline(always)]
pub(super) fn open_by_ray<S: Simd, const ANY: bool>(
    columns: &Columns,
    first: [usize; 3],
    node: &Node,
    rays: u64,
) -> Opened {
    let [x, y, z] = first;
    let p = &node.planes;
    let (x0, y0, z0) = (S::load(&p[0][x & 1]), S::load(&p[1][y & 1]), S::load(&p[2][z & 1]));
    let (x1, y1, z1) =
        (S::load(&p[0][(x ^ 1) & 1]), S::load(&p[1][(y ^ 1) & 1]), S::load(&p[2][(z ^ 1) & 1]));
    let infinity = S::splat(f32::INFINITY);
    let (mut near, mut met) = (infinity, S::splat(0.0));
    let mut sets = [Lanes([0.0; LANES]); 2];
    for (half, set) in sets.iter_mut().enumerate() {
        let mut bits = (rays >> (32 * half)) as u32;
        let mut acc = S::splat(0.0);
        while bits != 0 {
            let bit = bits.trailing_zeros() as usize % 32;
            bits &= bits - 1;
            let r = bit + 32 * half;
            let (ix, iy, iz) = (
                S::splat(columns.inv[0].get(r)),
                S::splat(columns.inv[1].get(r)),
                S::splat(columns.inv[2].get(r)),
            );
            let ex = S::mul_add(x0, ix, S::splat(columns.near[0].get(r)));
            let ey = S::mul_add(y0, iy, S::splat(columns.near[1].get(r)));
            let ez = S::mul_add(z0, iz, S::splat(columns.near[2].get(r)));
            let lx = S::mul_add(x1, ix, S::splat(columns.far[0].get(r)));
            let ly = S::mul_add(y1, iy, S::splat(columns.far[1].get(r)));
            let lz = S::mul_add(z1, iz, S::splat(columns.far[2].get(r)));
            let enter = S::max(S::max(ex, ey), S::max(ez, S::splat(columns.tnear.get(r))));
            let leave = S::min(S::min(lx, ly), S::min(lz, S::splat(columns.tfar.get(r))));
            let hit = S::le_bits(enter, leave);
            acc = S::or(acc, S::and(hit, S::splat(BITS[bit])));
            if ANY {
                met = S::or(met, hit);
            } else {
                near = S::min(near, S::select(hit, enter, infinity));
            }
        }
        *set = S::store(acc);
    }
    let hit = if ANY { S::bits(met) } else { S::le(near, S::splat(f32::MAX)) };
    let mut out = Opened { hit, rays: [0; LANES], near: S::store(near).0 };
    for lane in 0..LANES {
        out.rays[lane] = u64::from(sets[0].0[lane].to_bits()) | u64::from(sets[1].0[lane].to_bits()) << 32;
    }
    out
}

/// Tests the rays of a set, all of one octant, against the boxes of some lanes of a node: box by box.
#[inline(always)]
pub(super) fn open_by_box<S: Simd, const ANY: bool>(
    columns: &Columns,
    first: [usize; 3],
    node: &Node,
    rays: u64,
    mut lanes: u32,
) -> Opened {
    let mut out = Opened { hit: 0, rays: [0; LANES], near: [f32::INFINITY; LANES] };
    let infinity = S::splat(f32::INFINITY);
    while lanes != 0 {
        let lane = lanes.trailing_zeros() as usize % LANES;
        lanes &= lanes - 1;
        let [x, y, z] = first;
        let p = &node.planes;
        let (x0, y0, z0) =
            (S::splat(p[0][x & 1].0[lane]), S::splat(p[1][y & 1].0[lane]), S::splat(p[2][z & 1].0[lane]));
        let (x1, y1, z1) = (
            S::splat(p[0][(x ^ 1) & 1].0[lane]),
            S::splat(p[1][(y ^ 1) & 1].0[lane]),
            S::splat(p[2][(z ^ 1) & 1].0[lane]),
        );
        let mut near = infinity;
        let mut set = 0u64;
        for i in 0..VECTORS {
            let some = (rays >> (i * LANES)) as u32 & 0xff;
            if some == 0 {
                continue;
            }
            let (ix, iy, iz) =
                (S::load(&columns.inv[0].0[i]), S::load(&columns.inv[1].0[i]), S::load(&columns.inv[2].0[i]));
            let ex = S::mul_add(x0, ix, S::load(&columns.near[0].0[i]));
            let ey = S::mul_add(y0, iy, S::load(&columns.near[1].0[i]));
            let ez = S::mul_add(z0, iz, S::load(&columns.near[2].0[i]));
            let lx = S::mul_add(x1, ix, S::load(&columns.far[0].0[i]));
            let ly = S::mul_add(y1, iy, S::load(&columns.far[1].0[i]));
            let lz = S::mul_add(z1, iz, S::load(&columns.far[2].0[i]));
            let enter = S::max(S::max(ex, ey), S::max(ez, S::load(&columns.tnear.0[i])));
            let leave = S::min(S::min(lx, ly), S::min(lz, S::load(&columns.tfar.0[i])));
            let hit = S::le_bits(enter, leave);
            set |= u64::from(S::bits(hit) & some) << (i * LANES);
            if !ANY {
                near = S::min(near, S::select(hit, enter, infinity));
            }
        }
        out.rays[lane] = set;
        out.hit |= u32::from(set != 0) << lane;
        if !ANY {
            out.near[lane] = S::least(near);
        }
    }
    out
}

/// Bounds of the rays of a set, all of one octant: by axis, of their origins and of 1/d, and how much each plane is moved outward.
pub(super) struct Frustum<S: Simd> {
    o: [[S::V; 2]; 3],
    inv: [[S::V; 2]; 3],
    pad: [S::V; 3],
    tnear: S::V,
    tfar: S::V,
}

/// The least and the largest of a column, of the first `n` rays; what follows them in the last vector must repeat one of them.
#[inline(always)]
fn range<S: Simd>(column: &Column, n: usize) -> [f32; 2] {
    let (mut least, mut most) = (S::load(&column.0[0]), S::load(&column.0[0]));
    for i in 1..n.div_ceil(LANES) {
        let x = S::load(&column.0[i]);
        least = S::min(least, x);
        most = S::max(most, x);
    }
    [S::least(least), -S::least(S::sub(S::splat(0.0), most))]
}

/// The largest size of numbers in a range.
#[inline(always)]
fn largest(r: [f32; 2]) -> f32 {
    r[0].abs().max(r[1].abs())
}

#[inline(always)]
fn splat2<S: Simd>(r: [f32; 2]) -> [S::V; 2] {
    [S::splat(r[0]), S::splat(r[1])]
}

impl<S: Simd> Frustum<S> {
    /// Of the first `n` rays; `extent` is that of the tree.
    #[inline(always)]
    pub(super) fn new(columns: &Columns, n: usize, extent: Vec3) -> Self {
        let (ox, oy, oz) =
            (range::<S>(&columns.o[0], n), range::<S>(&columns.o[1], n), range::<S>(&columns.o[2], n));
        let (ix, iy, iz) =
            (range::<S>(&columns.inv[0], n), range::<S>(&columns.inv[1], n), range::<S>(&columns.inv[2], n));
        // As for single rays, where the sum of extent and origin bounds all errors (`ray.rs`), and a little more for the
        // roundings here.
        let r = extent + Vec3::new(largest(ox), largest(oy), largest(oz));
        let most = r.max_element().max(1e-30);
        let pad =
            (r * (16.0 * U32) + Vec3::splat(most * 2e-9)) * Vec3::new(largest(ix), largest(iy), largest(iz));
        Frustum {
            o: [splat2::<S>(ox), splat2::<S>(oy), splat2::<S>(oz)],
            inv: [splat2::<S>(ix), splat2::<S>(iy), splat2::<S>(iz)],
            pad: [S::splat(pad.x), S::splat(pad.y), S::splat(pad.z)],
            tnear: S::splat(range::<S>(&columns.tnear, n)[0]),
            tfar: S::splat(range::<S>(&columns.tfar, n)[1]),
        }
    }

    /// No ray enters a plane's half-space before this.
    #[inline(always)]
    fn enter(&self, node: &Node, axis: usize, first: usize) -> S::V {
        let plane = S::load(&node.planes[axis][first & 1]);
        // In the direction of the rays, the furthest origin is the nearest to the plane.
        let d = S::sub(plane, self.o[axis][(first ^ 1) & 1]);
        S::sub(S::min(S::mul(d, self.inv[axis][0]), S::mul(d, self.inv[axis][1])), self.pad[axis])
    }

    /// Every ray has left a plane's half-space after this.
    #[inline(always)]
    fn leave(&self, node: &Node, axis: usize, first: usize) -> S::V {
        let plane = S::load(&node.planes[axis][(first ^ 1) & 1]);
        let d = S::sub(plane, self.o[axis][first & 1]);
        S::add(S::max(S::mul(d, self.inv[axis][0]), S::mul(d, self.inv[axis][1])), self.pad[axis])
    }

    /// The lanes of a node that any of the rays may meet.
    #[inline(always)]
    pub(super) fn lanes(&self, node: &Node, first: [usize; 3]) -> u32 {
        let [x, y, z] = first;
        let (ex, ey, ez) = (self.enter(node, 0, x), self.enter(node, 1, y), self.enter(node, 2, z));
        let (lx, ly, lz) = (self.leave(node, 0, x), self.leave(node, 1, y), self.leave(node, 2, z));
        let enter = S::max(S::max(ex, ey), S::max(ez, self.tnear));
        S::le(enter, S::min(S::min(lx, ly), S::min(lz, self.tfar)))
    }
}
