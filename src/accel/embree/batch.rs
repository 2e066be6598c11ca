//! Batches. Embree is given the columns of the batch as they are (`em_*_soa`), with a flag for coherent rays: nothing
//! is copied, and of all forms of query this is the fastest or equal to it on both versions, for camera rays, bounces
//! and scattered rays (`cargo bench -p embree-sys`, kernel_forms).

use super::Kernel;
use super::level::Level;
use super::query::{Entry, Query};
use crate::accel::tame::DIRECTION;
use crate::base::hit::{HitBatch, NO_PRIMITIVE};
use crate::base::ray::{Coherence, Ray, RayBatch};
use crate::base::shape::LocalRay;
use crate::math::simd;
use embree_sys::*;
use std::mem::MaybeUninit;
use std::ops::Range;

/// Rays that Embree is given at once: its streams sort that many, and 4 columns of scratch fit on the stack.
pub(super) const CHUNK: usize = 1024;

/// Numbers of the rays of a chunk, for callbacks.
static IDS: [u32; CHUNK] = {
    let mut ids = [0; CHUNK];
    let mut i = 0;
    while i < CHUNK {
        ids[i] = i as u32;
        i += 1;
    }
    ids
};

/// The columns of a chunk of a batch.
#[derive(Clone, Copy)]
pub(super) struct Columns<'a> {
    o: [&'a [f32]; 3],
    d: [&'a [f32]; 3],
    tnear: &'a [f32],
    tfar: &'a [f32],
}

impl<'a> Columns<'a> {
    /// Panics if the batch's columns are not of one length.
    pub(super) fn new(rays: &'a RayBatch, range: Range<usize>) -> Self {
        let cut = |c: &'a Vec<f32>| &c[range.clone()];
        Columns {
            o: [cut(&rays.ox), cut(&rays.oy), cut(&rays.oz)],
            d: [cut(&rays.dx), cut(&rays.dy), cut(&rays.dz)],
            tnear: cut(&rays.tnear),
            tfar: cut(&rays.tfar),
        }
    }

    pub(super) fn len(&self) -> usize {
        self.tnear.len()
    }

    /// For Embree, with the ends of the rays in `tfar` (which it overwrites), of the same length.
    pub(super) fn embree(&self, level: &Level, tfar: &mut [f32]) -> EmRays {
        assert!(self.len() <= CHUNK && tfar.len() == self.len());
        let [org_x, org_y, org_z] = self.o.map(<[f32]>::as_ptr);
        let [dir_x, dir_y, dir_z] = self.d.map(<[f32]>::as_ptr);
        let id = if level.calls_back { IDS.as_ptr() } else { std::ptr::null() };
        let (tnear, tfar) = (self.tnear.as_ptr(), tfar.as_mut_ptr());
        EmRays { org_x, org_y, org_z, tnear, dir_x, dir_y, dir_z, id, tfar }
    }

    /// Whether Embree may be given ray `i` as it is. No short cuts, so that it compiles to vector code; NaN fails.
    #[inline(always)]
    fn is_tame(&self, i: usize, reach: f32) -> bool {
        let o = self.o.map(|c| c[i].abs());
        let d = self.d.map(|c| c[i].abs());
        let (low, high) = (*DIRECTION.start(), *DIRECTION.end());
        (o[0] <= reach)
            & (o[1] <= reach)
            & (o[2] <= reach)
            & (d[0] <= high)
            & (d[1] <= high)
            & (d[2] <= high)
            & ((d[0] >= low) | (d[1] >= low) | (d[2] >= low))
            & (self.tnear[i] >= 0.0)
            & (self.tnear[i] < f32::INFINITY)
            & (self.tfar[i] >= self.tnear[i])
    }
}

/// Whether all rays of a chunk are tame.
struct AllTame<'a> {
    columns: Columns<'a>,
    reach: f32,
}

impl simd::Kernel for AllTame<'_> {
    type Output = bool;

    #[inline(always)]
    fn run(self) -> bool {
        let n = self.columns.len();
        // Same-length slices, so that the loop has no bounds checks.
        let c = Columns {
            o: self.columns.o.map(|c| &c[..n]),
            d: self.columns.d.map(|c| &c[..n]),
            tnear: &self.columns.tnear[..n],
            tfar: &self.columns.tfar[..n],
        };
        let mut bad = 0u32;
        for i in 0..n {
            bad |= u32::from(!c.is_tame(i, self.reach));
        }
        bad == 0
    }
}

/// Whether Embree may be given all rays of these columns as they are.
pub(super) fn tame(columns: Columns, reach: f32) -> bool {
    simd::dispatch(AllTame { columns, reach })
}

/// Copies of a chunk's columns in which the rays that Embree cannot be given are off.
struct Patched {
    columns: [Vec<f32>; 8],
    /// Which they are; those that are valid go by themselves.
    odd: Vec<usize>,
}

impl Patched {
    fn new(c: &Columns, reach: f32) -> Self {
        let odd: Vec<usize> = (0..c.len()).filter(|&i| !c.is_tame(i, reach)).collect();
        let [ox, oy, oz] = c.o;
        let [dx, dy, dz] = c.d;
        let mut columns = [ox, oy, oz, dx, dy, dz, c.tnear, c.tfar].map(<[f32]>::to_vec);
        // From the origin along z, with the end before the start.
        let off = [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, -1.0];
        for &i in &odd {
            for (column, value) in columns.iter_mut().zip(off) {
                column[i] = value;
            }
        }
        Patched { columns, odd }
    }

    fn columns(&self) -> Columns<'_> {
        let [ox, oy, oz, dx, dy, dz, tnear, tfar] = self.columns.each_ref().map(Vec::as_slice);
        Columns { o: [ox, oy, oz], d: [dx, dy, dz], tnear, tfar }
    }
}

/// Results of a chunk that only hits write.
type Words = [MaybeUninit<u32>; CHUNK];

const fn words() -> Words {
    [MaybeUninit::uninit(); CHUNK]
}

impl Kernel {
    pub(super) fn closest_batch(&self, rays: &RayBatch, hits: &mut HitBatch, coherence: Coherence) {
        let n = rays.len();
        // The distances and paths of misses mean nothing, so old values may stay.
        hits.t.resize(n, f32::INFINITY);
        hits.path.resize(n, 0);
        hits.prim.clear();
        hits.prim.resize(n, NO_PRIMITIVE);
        self.in_chunks(rays, |columns, range, odd| {
            let (t, prim) = (&mut hits.t[range.clone()], &mut hits.prim[range.clone()]);
            let out = Out { t, prim, path: &mut hits.path[range.clone()] };
            let query = Query::batch(&self.levels, rays, range.start);
            self.closest_chunk(&query, columns, out, coherence);
            for &i in odd {
                let i = range.start + i;
                hits.set(i, self.closest(&rays.get(i)));
            }
        });
    }

    pub(super) fn any_batch(&self, rays: &RayBatch, blocked: &mut Vec<bool>, coherence: Coherence) {
        blocked.clear();
        blocked.resize(rays.len(), false);
        self.in_chunks(rays, |columns, range, odd| {
            let query = Query::batch(&self.levels, rays, range.start);
            self.any_chunk(&query, columns, &mut blocked[range.clone()], coherence);
            for &i in odd {
                let i = range.start + i;
                blocked[i] = self.any(&rays.get(i));
            }
        });
    }

    /// Calls `work` with columns that Embree can be given, where they stand in the batch, and which rays (counted
    /// within the chunk) were switched off in them.
    fn in_chunks(&self, rays: &RayBatch, mut work: impl FnMut(&Columns, Range<usize>, &[usize])) {
        if self.is_empty() {
            return;
        }
        let n = rays.len();
        let reach = self.root().reach as f32;
        for first in (0..n).step_by(CHUNK) {
            let range = first..n.min(first + CHUNK);
            let columns = Columns::new(rays, range.clone());
            if tame(columns, reach) {
                work(&columns, range, &[]);
            } else {
                let patched = Patched::new(&columns, reach);
                work(&patched.columns(), range, &patched.odd);
            }
        }
    }

    fn closest_chunk(&self, query: &Query, c: &Columns, out: Out, how: Coherence) {
        let level = self.root();
        let n = c.len();
        let (mut u, mut v, mut geom, mut inst) = (words(), words(), words(), words());
        out.t.copy_from_slice(c.tfar);
        let to = EmHits {
            u: u.as_mut_ptr().cast(),
            v: v.as_mut_ptr().cast(),
            primID: out.prim.as_mut_ptr(),
            geomID: geom.as_mut_ptr().cast(),
            instID: inst.as_mut_ptr().cast(),
        };
        let mut em = EmQuery::new(how == Coherence::Coherent, query.user());
        // SAFETY: the scene is committed; every column holds n <= CHUNK entries and outlives the call; `in_chunks`
        // lets only tame rays and rays that are off through.
        unsafe { em_intersect_soa(level.scene.raw(), &mut em, &c.embree(level, out.t), &to, n as u32) };
        if level.is_huge {
            // The triangle test overflows in such a scene.
            let lost = out.t.iter().zip(out.prim.iter_mut()).filter(|(t, _)| !t.is_finite());
            lost.for_each(|(_, prim)| *prim = NO_PRIMITIVE);
        }
        if let Some(leaf) = level.only_leaf {
            out.path.fill(u64::from(leaf));
            return;
        }
        for i in (0..n).filter(|&i| out.prim[i] != NO_PRIMITIVE) {
            // SAFETY: a hit has a primitive, and Embree wrote its other words too.
            let [u, v, geom, inst] = unsafe { [u[i], v[i], geom[i], inst[i]].map(|w| w.assume_init()) };
            out.path[i] = level.path(&self.levels, geom, inst, [u, v]);
        }
    }

    fn any_chunk(&self, query: &Query, c: &Columns, blocked: &mut [bool], how: Coherence) {
        let level = self.root();
        let mut ends = [0.0f32; CHUNK];
        let tfar = &mut ends[..c.len()];
        tfar.copy_from_slice(c.tfar);
        // Coherent any-hit packets that enter an instance loop forever in Debian's 3.13.5 on AVX-512, where tnear is not
        // 0: its compiler stores a mask of 16 bits and reads back 64. The closest-hit code has no such place.
        let coherent = how == Coherence::Coherent && level.instances.is_empty();
        let mut em = EmQuery::new(coherent, query.user());
        // SAFETY: as in `closest_chunk`.
        unsafe { em_occluded_soa(level.scene.raw(), &mut em, &c.embree(level, tfar), c.len() as u32) };
        for (blocked, end) in blocked.iter_mut().zip(tfar) {
            *blocked = *end == f32::NEG_INFINITY;
        }
    }

    pub(super) fn any(&self, ray: &Ray) -> bool {
        !self.is_empty() && ray.is_valid() && Entry::root(&self.levels).any(&LocalRay::from_ray(ray), ray.key)
    }
}

/// Where the hits of a chunk go.
struct Out<'a> {
    t: &'a mut [f32],
    prim: &'a mut [u32],
    path: &'a mut [u64],
}
