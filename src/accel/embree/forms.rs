//! Embree's own forms of query over rays that lie as each form wants them: what a program gets that makes its rays in
//! that layout. For measurements alone; the renderer's form is `batch.rs`.
//!
//! Laying out is not a part of a run. Records are overwritten by a run, so each run needs them laid out anew.

use super::Kernel;
use super::batch::{CHUNK, Columns, tame};
use super::query::Query;
use crate::base::hit::NO_PRIMITIVE;
use crate::base::intersectable::QueryKind;
use crate::base::ray::{Coherence, RayBatch};
use embree_sys::*;

/// A form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// `rtcIntersect1`, a record at a time.
    Single,
    /// `rtcIntersect16`.
    Packet,
    /// `rtcIntersect1M` of 1,024 records; a loop in Embree 4.
    Stream,
    /// `rtcIntersectNM` of 64 packets; a loop in Embree 4.
    PacketStream,
    /// `rtcIntersectNp` over columns; a loop over packets in Embree 4.
    Arrays,
}

/// Lanes of a packet.
const LANES: usize = 16;
/// Packets of a stream of packets.
const PACKETS: usize = CHUNK / LANES;

#[repr(align(64))]
struct Mask([i32; LANES]);

/// Records in a form's layout, and after a run the answers in them.
enum Records {
    Hits(Vec<RTCRayHit>),
    Rays(Vec<RTCRay>),
    Hits16(Vec<RTCRayHit16>),
    Rays16(Vec<RTCRay16>),
    Columns(Box<Ends>),
}

/// The columns that a query by columns writes.
#[derive(Default)]
struct Ends {
    t: Vec<f32>,
    uv: [Vec<f32>; 2],
    prim: Vec<u32>,
    geom: Vec<u32>,
    inst: Vec<u32>,
}

/// Rays of some batches, laid out.
pub struct Laid<'a> {
    kernel: &'a Kernel,
    batches: &'a [RayBatch],
    form: Form,
    query: QueryKind,
    coherent: bool,
    records: Records,
}

fn zeroed<T: Plain>() -> T {
    // SAFETY: `Plain` is for records of numbers alone, of which all bits zero are a value.
    unsafe { std::mem::zeroed() }
}

/// Embree's records of numbers.
trait Plain {}
impl Plain for RTCHit {}
impl Plain for RTCRay16 {}
impl Plain for RTCHit16 {}

fn record(b: &RayBatch, i: usize) -> RTCRay {
    RTCRay {
        org_x: b.ox[i],
        org_y: b.oy[i],
        org_z: b.oz[i],
        tnear: b.tnear[i],
        dir_x: b.dx[i],
        dir_y: b.dy[i],
        dir_z: b.dz[i],
        time: 0.0,
        tfar: b.tfar[i],
        mask: u32::MAX,
        id: i as u32,
        flags: 0,
    }
}

fn no_hit(ray: RTCRay) -> RTCRayHit {
    let mut hit: RTCHit = zeroed();
    hit.geomID = INVALID_ID;
    hit.instID[0] = INVALID_ID;
    RTCRayHit { ray, hit }
}

fn no_hits(ray: RTCRay16) -> RTCRayHit16 {
    let mut hit: RTCHit16 = zeroed();
    hit.geomID = [INVALID_ID; LANES];
    hit.instID[0] = [INVALID_ID; LANES];
    RTCRayHit16 { ray, hit }
}

/// Rays `first` on; lanes past the last one are off: they end before they start.
fn packet(b: &RayBatch, first: usize) -> RTCRay16 {
    let mut to: RTCRay16 = zeroed();
    (to.dir_z, to.tnear, to.tfar) = ([1.0; LANES], [1.0; LANES], [-1.0; LANES]);
    to.mask = [u32::MAX; LANES];
    let n = LANES.min(b.len() - first);
    let rows = [
        (&mut to.org_x, &b.ox),
        (&mut to.org_y, &b.oy),
        (&mut to.org_z, &b.oz),
        (&mut to.dir_x, &b.dx),
        (&mut to.dir_y, &b.dy),
        (&mut to.dir_z, &b.dz),
        (&mut to.tnear, &b.tnear),
        (&mut to.tfar, &b.tfar),
    ];
    for (row, column) in rows {
        row[..n].copy_from_slice(&column[first..first + n]);
    }
    for (lane, id) in to.id.iter_mut().enumerate() {
        *id = (first + lane.min(n - 1)) as u32;
    }
    to
}

fn singles(batches: &[RayBatch]) -> impl Iterator<Item = RTCRay> {
    batches.iter().flat_map(|b| (0..b.len()).map(|i| record(b, i)))
}

fn packets(batches: &[RayBatch]) -> impl Iterator<Item = RTCRay16> {
    batches.iter().flat_map(|b| (0..b.len()).step_by(LANES).map(|i| packet(b, i)))
}

impl Kernel {
    /// Lays rays out for a form. None where Embree cannot be given one of them as it is: such rays are moved and
    /// rescaled one by one in the forms that the renderer uses.
    pub fn lay_out<'a>(
        &'a self,
        batches: &'a [RayBatch],
        form: Form,
        query: QueryKind,
        coherence: Coherence,
    ) -> Option<Laid<'a>> {
        let reach = self.root().reach as f32;
        let fits = |b: &RayBatch| {
            (0..b.len()).step_by(CHUNK).all(|i| tame(Columns::new(b, i..b.len().min(i + CHUNK)), reach))
        };
        if self.is_empty() || !batches.iter().all(fits) {
            return None;
        }
        let closest = query == QueryKind::Closest;
        let records = match (form, closest) {
            (Form::Single | Form::Stream, true) => Records::Hits(singles(batches).map(no_hit).collect()),
            (Form::Single | Form::Stream, false) => Records::Rays(singles(batches).collect()),
            (Form::Packet | Form::PacketStream, true) => {
                Records::Hits16(packets(batches).map(no_hits).collect())
            }
            (Form::Packet | Form::PacketStream, false) => Records::Rays16(packets(batches).collect()),
            (Form::Arrays, _) => Records::Columns(Box::new(Ends::new(batches, closest))),
        };
        // As in `any_chunk`: coherent any-hit packets through instances never end in some builds of Embree.
        let coherent = coherence == Coherence::Coherent && (closest || self.root().instances.is_empty());
        Some(Laid { kernel: self, batches, form, query, coherent, records })
    }
}

impl Ends {
    fn new(batches: &[RayBatch], closest: bool) -> Self {
        let t: Vec<f32> = batches.iter().flat_map(|b| b.tfar.iter().copied()).collect();
        let n = if closest { t.len() } else { 0 };
        let ids = || vec![INVALID_ID; n];
        Ends { t, uv: [vec![0.0; n], vec![0.0; n]], prim: vec![NO_PRIMITIVE; n], geom: ids(), inst: ids() }
    }
}

impl Laid<'_> {
    /// Asks for all rays, once.
    pub fn run(&mut self) {
        let Laid { kernel, batches, form, query: kind, coherent, records } = self;
        let scene = kernel.root().scene.raw();
        let (mut ray, mut group) = (0, 0);
        for batch in batches.iter() {
            let (n, groups) = (batch.len(), batch.len().div_ceil(LANES));
            let query = Query::batch(&kernel.levels, batch, 0);
            let mut em = EmQuery::new(*coherent, query.user());
            match records {
                // SAFETY (here and below): the scene is committed; `lay_out` let tame rays through alone, and wrote all
                // records; counts are those of the slices; `query` outlives the calls.
                Records::Hits(all) if *form == Form::Single => {
                    for r in &mut all[ray..ray + n] {
                        // SAFETY: see above.
                        unsafe { em_intersect1(scene, &mut em, r) };
                    }
                }
                Records::Hits(all) => {
                    for part in all[ray..ray + n].chunks_mut(CHUNK) {
                        // SAFETY: see above.
                        unsafe { em_intersect_stream1(scene, &mut em, part.as_mut_ptr(), part.len() as u32) };
                    }
                }
                Records::Rays(all) if *form == Form::Single => {
                    for r in &mut all[ray..ray + n] {
                        // SAFETY: see above.
                        unsafe { em_occluded1(scene, &mut em, r) };
                    }
                }
                Records::Rays(all) => {
                    for part in all[ray..ray + n].chunks_mut(CHUNK) {
                        // SAFETY: see above.
                        unsafe { em_occluded_stream1(scene, &mut em, part.as_mut_ptr(), part.len() as u32) };
                    }
                }
                Records::Hits16(all) => {
                    closest_packets(scene, &mut em, &mut all[group..group + groups], *form, n);
                }
                Records::Rays16(all) => {
                    any_packets(scene, &mut em, &mut all[group..group + groups], *form, n)
                }
                Records::Columns(ends) => {
                    columns(kernel, batch, ends, ray, [*kind == QueryKind::Closest, *coherent])
                }
            }
            (ray, group) = (ray + n, group + groups);
        }
    }

    /// Of each ray after a run, in order: the primitive (or [`NO_PRIMITIVE`]) and its path. For any-hit queries primitive
    /// 0 says that something is in the way.
    pub fn answers(&self, mut tell: impl FnMut(u32, u64)) {
        let level = self.kernel.root();
        let mut hit = |t: f32, prim: u32, geom: u32, inst: u32, uv: [f32; 2]| {
            if geom == INVALID_ID || !t.is_finite() {
                return tell(NO_PRIMITIVE, 0);
            }
            tell(prim, level.path(&self.kernel.levels, geom, inst, uv.map(f32::to_bits)));
        };
        match &self.records {
            Records::Hits(all) => all.iter().for_each(|r| {
                let h = &r.hit;
                hit(r.ray.tfar, h.primID, h.geomID, h.instID[0], [h.u, h.v]);
            }),
            Records::Rays(all) => all.iter().for_each(|r| tell(blocked(r.tfar), 0)),
            Records::Hits16(all) => each_lane(self.batches, |packet, l| {
                let (r, h) = (&all[packet].ray, &all[packet].hit);
                hit(r.tfar[l], h.primID[l], h.geomID[l], h.instID[0][l], [h.u[l], h.v[l]]);
            }),
            Records::Rays16(all) => {
                each_lane(self.batches, |packet, l| tell(blocked(all[packet].tfar[l]), 0));
            }
            Records::Columns(e) if self.query == QueryKind::Any => {
                e.t.iter().for_each(|t| tell(blocked(*t), 0));
            }
            Records::Columns(e) => (0..e.t.len()).for_each(|i| {
                hit(e.t[i], e.prim[i], e.geom[i], e.inst[i], [e.uv[0][i], e.uv[1][i]]);
            }),
        }
    }
}

fn blocked(tfar: f32) -> u32 {
    if tfar == f32::NEG_INFINITY { 0 } else { NO_PRIMITIVE }
}

/// Packet and lane of every ray.
fn each_lane(batches: &[RayBatch], mut f: impl FnMut(usize, usize)) {
    let mut first = 0;
    for b in batches {
        (0..b.len()).for_each(|i| f(first + i / LANES, i % LANES));
        first += b.len().div_ceil(LANES);
    }
}

/// Lanes of a packet of `n` that hold a ray.
fn mask(n: usize) -> Mask {
    Mask(std::array::from_fn(|l| if l < n { LANE_ON } else { 0 }))
}

/// `n` rays in packets, the last of which may be short.
fn closest_packets(scene: RTCScene, em: &mut EmQuery, all: &mut [RTCRayHit16], form: Form, n: usize) {
    if form == Form::PacketStream {
        for part in all.chunks_mut(PACKETS) {
            // SAFETY: as in `Laid::run`.
            unsafe { em_intersect_stream16(scene, em, part.as_mut_ptr(), part.len() as u32) };
        }
        return;
    }
    let (full, short) = (mask(LANES), mask(n % LANES));
    for (i, p) in all.iter_mut().enumerate() {
        let valid = if n - i * LANES >= LANES { &full } else { &short };
        // SAFETY: as in `Laid::run`; the mask is aligned by its type.
        unsafe { em_intersect16(valid.0.as_ptr(), scene, em, p) };
    }
}

fn any_packets(scene: RTCScene, em: &mut EmQuery, all: &mut [RTCRay16], form: Form, n: usize) {
    if form == Form::PacketStream {
        for part in all.chunks_mut(PACKETS) {
            // SAFETY: as in `Laid::run`.
            unsafe { em_occluded_stream16(scene, em, part.as_mut_ptr(), part.len() as u32) };
        }
        return;
    }
    let (full, short) = (mask(LANES), mask(n % LANES));
    for (i, p) in all.iter_mut().enumerate() {
        let valid = if n - i * LANES >= LANES { &full } else { &short };
        // SAFETY: as in `Laid::run`; the mask is aligned by its type.
        unsafe { em_occluded16(valid.0.as_ptr(), scene, em, p) };
    }
}

/// A batch by its columns, its results from `first` on.
fn columns(kernel: &Kernel, batch: &RayBatch, ends: &mut Ends, first: usize, [closest, coherent]: [bool; 2]) {
    let level = kernel.root();
    for from in (0..batch.len()).step_by(CHUNK) {
        let columns = Columns::new(batch, from..batch.len().min(from + CHUNK));
        let to = first + from..first + from + columns.len();
        let query = Query::batch(&kernel.levels, batch, from);
        let mut em = EmQuery::new(coherent, query.user());
        let rays = columns.embree(level, &mut ends.t[to.clone()]);
        if !closest {
            // SAFETY: as in `Laid::run`; every column has as many entries.
            unsafe { em_occluded_soa(level.scene.raw(), &mut em, &rays, columns.len() as u32) };
            continue;
        }
        let [u, v] = &mut ends.uv;
        let hits = EmHits {
            u: u[to.clone()].as_mut_ptr(),
            v: v[to.clone()].as_mut_ptr(),
            primID: ends.prim[to.clone()].as_mut_ptr(),
            geomID: ends.geom[to.clone()].as_mut_ptr(),
            instID: ends.inst[to].as_mut_ptr(),
        };
        // SAFETY: as above.
        unsafe { em_intersect_soa(level.scene.raw(), &mut em, &rays, &hits, columns.len() as u32) };
    }
}
