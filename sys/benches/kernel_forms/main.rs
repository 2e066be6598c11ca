//! Which form of query is fastest: single rays, packets, streams; by kind of ray, and for the Embree at hand.
//!
//!     cargo bench -p embree-sys --bench kernel_forms [-- TRIANGLES]
//!
//! A knotted tube fills about a quarter of the picture. Rays are made beforehand and stand in structure-of-arrays
//! batches of 1,024, as a renderer's do; a form's own copying is part of its time. One thread, robust scene, forms
//! interleaved, median of five.

mod rays;

use embree_sys::*;
use rays::{BATCH, Batch, no_hit, no_hits, rays, scattered, scene, zeroed};
use std::hint::black_box;
use std::ptr;
use std::sync::LazyLock;
use std::time::Instant;

/// Room for the results of one batch in any form.
struct Room {
    single: Vec<RTCRayHit>,
    shadow: Vec<RTCRay>,
    packets: Vec<RTCRayHit16>,
    shadow_packets: Vec<RTCRay16>,
    t: Vec<f32>,
    ids: [Vec<u32>; 3],
    uv: [Vec<f32>; 2],
}

impl Room {
    fn new() -> Self {
        Room {
            single: vec![no_hit(zeroed()); BATCH],
            shadow: vec![zeroed(); BATCH],
            packets: vec![no_hits(zeroed()); BATCH / 16],
            shadow_packets: vec![zeroed(); BATCH / 16],
            t: vec![0.0; BATCH],
            ids: [(); 3].map(|()| vec![0; BATCH]),
            uv: [(); 2].map(|()| vec![0.0; BATCH]),
        }
    }
}

#[repr(align(64))]
struct Mask([i32; 16]);
static ALL: Mask = Mask([LANE_ON; 16]);

type Form = fn(RTCScene, &mut EmQuery, &Batch, &mut Room) -> usize;

fn closest_single(scene: RTCScene, q: &mut EmQuery, b: &Batch, _: &mut Room) -> usize {
    let hit = |i| {
        let mut h = no_hit(b.ray(i));
        // SAFETY: committed scene, finite rays; as in every form below.
        unsafe { em_intersect1(scene, q, &mut h) };
        usize::from(h.hit.geomID != INVALID_ID)
    };
    (0..b.len()).map(hit).sum()
}

fn closest_packets(scene: RTCScene, q: &mut EmQuery, b: &Batch, _: &mut Room) -> usize {
    let hit = |first| {
        let mut h = no_hits(b.packet(first));
        // SAFETY: as above; the mask and the packet are aligned by their types.
        unsafe { em_intersect16(ALL.0.as_ptr(), scene, q, &mut h) };
        h.hit.geomID.iter().filter(|&&g| g != INVALID_ID).count()
    };
    (0..b.len()).step_by(16).map(hit).sum()
}

fn closest_stream1(scene: RTCScene, q: &mut EmQuery, b: &Batch, room: &mut Room) -> usize {
    for (i, to) in room.single.iter_mut().enumerate() {
        *to = no_hit(b.ray(i));
    }
    // SAFETY: as above; BATCH records.
    unsafe { em_intersect_stream1(scene, q, room.single.as_mut_ptr(), BATCH as u32) };
    room.single.iter().filter(|h| h.hit.geomID != INVALID_ID).count()
}

fn closest_stream16(scene: RTCScene, q: &mut EmQuery, b: &Batch, room: &mut Room) -> usize {
    for (i, to) in room.packets.iter_mut().enumerate() {
        *to = no_hits(b.packet(16 * i));
    }
    // SAFETY: as above; BATCH / 16 records.
    unsafe { em_intersect_stream16(scene, q, room.packets.as_mut_ptr(), BATCH as u32 / 16) };
    room.packets.iter().flat_map(|h| h.hit.geomID).filter(|&g| g != INVALID_ID).count()
}

fn soa_rays(b: &Batch, t: &mut [f32]) -> EmRays {
    t.copy_from_slice(&b.columns[7]);
    let [org_x, org_y, org_z, tnear, dir_x, dir_y, dir_z, _] = b.columns.each_ref().map(|c| c.as_ptr());
    EmRays { org_x, org_y, org_z, tnear, dir_x, dir_y, dir_z, id: ptr::null(), tfar: t.as_mut_ptr() }
}

fn closest_soa(scene: RTCScene, q: &mut EmQuery, b: &Batch, room: &mut Room) -> usize {
    let rays = soa_rays(b, &mut room.t);
    room.ids[0].fill(INVALID_ID);
    room.ids[1].fill(INVALID_ID);
    let [u, v] = room.uv.each_mut().map(|c| c.as_mut_ptr());
    let [geom, inst, prim] = room.ids.each_mut().map(|c| c.as_mut_ptr());
    let hits = EmHits { u, v, primID: prim, geomID: geom, instID: inst };
    // SAFETY: as above; every column that is not null has BATCH entries.
    unsafe { em_intersect_soa(scene, q, &rays, &hits, BATCH as u32) };
    room.ids[0].iter().filter(|&&g| g != INVALID_ID).count()
}

fn any_single(scene: RTCScene, q: &mut EmQuery, b: &Batch, _: &mut Room) -> usize {
    let hit = |i| {
        let mut r = b.ray(i);
        // SAFETY: as above.
        unsafe { em_occluded1(scene, q, &mut r) };
        usize::from(r.tfar < 0.0)
    };
    (0..b.len()).map(hit).sum()
}

fn any_packets(scene: RTCScene, q: &mut EmQuery, b: &Batch, _: &mut Room) -> usize {
    let hit = |first| {
        let mut r = b.packet(first);
        // SAFETY: as above.
        unsafe { em_occluded16(ALL.0.as_ptr(), scene, q, &mut r) };
        r.tfar.iter().filter(|&&t| t < 0.0).count()
    };
    (0..b.len()).step_by(16).map(hit).sum()
}

fn any_stream1(scene: RTCScene, q: &mut EmQuery, b: &Batch, room: &mut Room) -> usize {
    for (i, to) in room.shadow.iter_mut().enumerate() {
        *to = b.ray(i);
    }
    // SAFETY: as above; BATCH records.
    unsafe { em_occluded_stream1(scene, q, room.shadow.as_mut_ptr(), BATCH as u32) };
    room.shadow.iter().filter(|r| r.tfar < 0.0).count()
}

fn any_stream16(scene: RTCScene, q: &mut EmQuery, b: &Batch, room: &mut Room) -> usize {
    for (i, to) in room.shadow_packets.iter_mut().enumerate() {
        *to = b.packet(16 * i);
    }
    // SAFETY: as above; BATCH / 16 records.
    unsafe { em_occluded_stream16(scene, q, room.shadow_packets.as_mut_ptr(), BATCH as u32 / 16) };
    room.shadow_packets.iter().flat_map(|r| r.tfar).filter(|&t| t < 0.0).count()
}

fn any_soa(scene: RTCScene, q: &mut EmQuery, b: &Batch, room: &mut Room) -> usize {
    let soa = soa_rays(b, &mut room.t);
    // SAFETY: as above; every column that is not null has BATCH entries.
    unsafe { em_occluded_soa(scene, q, &soa, BATCH as u32) };
    room.t.iter().filter(|&&t| t < 0.0).count()
}

/// Time that this thread has run, so that other programs on the machine disturb less; elapsed time where the system
/// does not say.
fn thread_seconds() -> f64 {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = text.split(' ').next().and_then(|n| n.parse::<f64>().ok());
    nanoseconds.map_or_else(|| START.elapsed().as_secs_f64(), |n| n * 1e-9)
}

fn main() {
    let triangles = std::env::args().skip(1).find_map(|a| a.parse().ok()).unwrap_or(300_000);
    let (scene, triangles) = scene(triangles);
    let [camera, bounce] = rays(scene);
    let scattered = scattered();
    println!(
        "Embree {EM_MAJOR}.{EM_MINOR}.{EM_PATCH} by its header, robust, {triangles} triangles, one thread"
    );
    let closest: [(&str, Form); 5] = [
        ("single", closest_single),
        ("packet 16", closest_packets),
        ("stream of 1,024", closest_stream1),
        ("stream of 64 packets", closest_stream16),
        ("plain arrays", closest_soa),
    ];
    let any: [(&str, Form); 5] = [
        ("single", any_single),
        ("packet 16", any_packets),
        ("stream of 1,024", any_stream1),
        ("stream of 64 packets", any_stream16),
        ("plain arrays", any_soa),
    ];
    let kinds = [
        ("camera, closest", closest, &camera),
        ("camera, any", any, &camera),
        ("bounce, closest", closest, &bounce),
        ("bounce, any", any, &bounce),
        ("scattered, closest", closest, &scattered),
        ("scattered, any", any, &scattered),
    ];
    for (what, forms, batches) in kinds {
        let rows: Vec<_> =
            [false, true].iter().flat_map(|&c| forms.map(|(name, form)| (name, c, form))).collect();
        let mut seconds = vec![Vec::new(); rows.len()];
        let mut found = vec![0; rows.len()];
        let mut room = Room::new();
        for _ in 0..5 {
            for (k, &(_, coherent, form)) in rows.iter().enumerate() {
                let mut q = EmQuery::new(coherent, ptr::null_mut());
                let start = thread_seconds();
                found[k] =
                    black_box(batches.iter().map(|b| form(scene, &mut q, b, &mut room)).sum::<usize>());
                seconds[k].push(thread_seconds() - start);
            }
        }
        let n = (batches.len() * BATCH) as f64;
        println!(
            "\n{what}: {n} rays, {:.1} % hit\n{:22} {:>12} {:>12}",
            100.0 * found[0] as f64 / n,
            "Mrays/s",
            "incoherent",
            "coherent"
        );
        let mrays = |k: usize| {
            let mut s = seconds[k].clone();
            s.sort_by(f64::total_cmp);
            n / s[2] * 1e-6
        };
        for (k, (name, _)) in forms.iter().enumerate() {
            println!("{name:22} {:12.2} {:12.2}", mrays(k), mrays(k + forms.len()));
        }
        // Vertices and edges seen exactly may differ by form; a mistake of ours would show as thousands.
        let spread = found.iter().max().unwrap_or(&0) - found.iter().min().unwrap_or(&0);
        println!("largest difference in hits between forms: {spread}");
    }
}
