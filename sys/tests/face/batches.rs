//! Packets and streams against single rays.

use crate::planes::{Planes, planes};
use crate::support::{Device, Scene, no_hit, scattered_rays, sheet, zeroed};
use embree_sys::*;
use std::ffi::c_void;
use std::ptr;

/// The scene and what single rays find in it.
struct Reference {
    scene: Scene,
    rays: Vec<RTCRay>,
    single: Vec<(RTCRayHit, bool)>,
}

impl Reference {
    /// Over a bumpy sheet and a user geometry; `user` counts the calls of the latter.
    fn new(device: &Device, mesh: RTCGeometry, data: &Planes, user: *mut c_void) -> Self {
        let scene = device.scene(&[mesh, planes(device, data)]);
        let rays = scattered_rays(16 * 40);
        let single: Vec<(RTCRayHit, bool)> = rays
            .iter()
            .map(|&ray| {
                let mut hit = RTCRayHit { ray, hit: no_hit() };
                let mut shadow = ray;
                // SAFETY: scene committed, rays finite, the counter lives.
                unsafe {
                    em_intersect1(scene.0, &mut EmQuery::new(false, user), &mut hit);
                    em_occluded1(scene.0, &mut EmQuery::new(false, user), &mut shadow);
                }
                (hit, shadow.tfar < 0.0)
            })
            .collect();
        let hits = single.iter().filter(|(h, _)| h.hit.geomID != INVALID_ID).count();
        assert!(hits > 200 && hits < rays.len() - 50, "the rays must both hit and miss: {hits}");
        Reference { scene, rays, single }
    }

    fn same(&self, what: &str, i: usize, geom: u32, prim: u32, t: f32, dark: bool) {
        let (h, d) = &self.single[i];
        assert_eq!((geom, dark), (h.hit.geomID, *d), "{what}, ray {i}");
        if geom == INVALID_ID {
            return;
        }
        // Single rays and packets use different instruction widths, so t may differ in rounding: some 10 ulps.
        // On a shared edge either triangle is right.
        assert!((t - h.ray.tfar).abs() <= 2e-6 * h.ray.tfar, "{what}, ray {i}: {t} {}", h.ray.tfar);
        assert!(prim == h.hit.primID || (t - h.ray.tfar).abs() < 1e-6, "{what}, ray {i}");
    }
}

macro_rules! packets {
    ($reference:expr, $user:expr, $n:literal, $Rays:ty, $RayHits:ty, $intersect:ident, $occluded:ident) => {
        for (c, chunk) in $reference.rays.chunks($n).enumerate() {
            for coherent in [false, true] {
                let mut p: $RayHits = zeroed();
                pack(ptr::from_mut(&mut p).cast(), $n, chunk, true);
                let mut s: $Rays = zeroed();
                pack(ptr::from_mut(&mut s).cast(), $n, chunk, false);
                // An aligned mask; the last lane is off and must come back untouched.
                #[repr(align(64))]
                struct Mask([i32; $n]);
                let mut valid = Mask([LANE_ON; $n]);
                valid.0[$n - 1] = 0;
                let mut q = EmQuery::new(coherent, $user);
                // SAFETY: aligned packets of finite rays, scene committed.
                unsafe {
                    $intersect(valid.0.as_ptr(), $reference.scene.0, &mut q, &mut p);
                    $occluded(valid.0.as_ptr(), $reference.scene.0, &mut q, &mut s);
                }
                for i in 0..$n - 1 {
                    let (h, dark) = (&p.hit, s.tfar[i] < 0.0);
                    let (geom, prim, t) = (h.geomID[i], h.primID[i], p.ray.tfar[i]);
                    $reference.same(stringify!($intersect), c * $n + i, geom, prim, t, dark);
                }
                assert_eq!((p.hit.geomID[$n - 1], s.tfar[$n - 1]), (INVALID_ID, f32::INFINITY));
                assert_eq!((p.hit.primID[$n - 1], p.ray.tfar[$n - 1]), (INVALID_ID, f32::INFINITY));
            }
        }
    };
}

/// On the CPU as it is, and as if it had narrower registers: a width that is not native takes another way through
/// Embree, and which widths are depends on the machine that runs the tests.
#[test]
fn packets_equal_single_rays() {
    for isa in [c"", c"isa=avx2", c"isa=sse2"] {
        match Device::configured(isa) {
            Some(device) => packets_equal_single_rays_on(&device),
            None => assert!(!isa.is_empty(), "the default device"),
        }
    }
}

fn packets_equal_single_rays_on(device: &Device) {
    let (vertices, indices) = sheet(40);
    let data = Planes { height: -0.1 };
    let mut calls = 0u32;
    let user: *mut c_void = ptr::from_mut(&mut calls).cast();
    let reference = Reference::new(device, device.mesh(&vertices, &indices), &data, user);
    packets!(reference, user, 4, RTCRay4, RTCRayHit4, em_intersect4, em_occluded4);
    packets!(reference, user, 8, RTCRay8, RTCRayHit8, em_intersect8, em_occluded8);
    packets!(reference, user, 16, RTCRay16, RTCRayHit16, em_intersect16, em_occluded16);
    assert_eq!(device.error(), RTC_ERROR_NONE);
}

#[test]
fn streams_equal_single_rays() {
    let device = Device::new();
    let (vertices, indices) = sheet(40);
    let data = Planes { height: -0.1 };
    let mut calls = 0u32;
    let user: *mut c_void = ptr::from_mut(&mut calls).cast();
    let reference = Reference::new(&device, device.mesh(&vertices, &indices), &data, user);
    let (scene, rays) = (&reference.scene, &reference.rays);
    for coherent in [false, true] {
        let mut q = EmQuery::new(coherent, user);
        let mut hits: Vec<_> = rays.iter().map(|&ray| RTCRayHit { ray, hit: no_hit() }).collect();
        let mut shadows = rays.clone();
        let mut hits16: Vec<RTCRayHit16> = rays.chunks(16).map(|_| zeroed()).collect();
        let mut shadows16: Vec<RTCRay16> = rays.chunks(16).map(|_| zeroed()).collect();
        for (chunk, (h, s)) in rays.chunks(16).zip(hits16.iter_mut().zip(&mut shadows16)) {
            pack(ptr::from_mut(h).cast(), 16, chunk, true);
            pack(ptr::from_mut(s).cast(), 16, chunk, false);
        }
        // SAFETY: as many records as are named, finite rays, scene committed.
        unsafe {
            em_intersect_stream1(scene.0, &mut q, hits.as_mut_ptr(), hits.len() as u32);
            em_occluded_stream1(scene.0, &mut q, shadows.as_mut_ptr(), shadows.len() as u32);
            em_intersect_stream16(scene.0, &mut q, hits16.as_mut_ptr(), hits16.len() as u32);
            em_occluded_stream16(scene.0, &mut q, shadows16.as_mut_ptr(), shadows16.len() as u32);
        }
        for (i, (h, s)) in hits.iter().zip(&shadows).enumerate() {
            reference.same("stream1", i, h.hit.geomID, h.hit.primID, h.ray.tfar, s.tfar < 0.0);
            let (h, s, k) = (&hits16[i / 16], &shadows16[i / 16], i % 16);
            reference.same("stream16", i, h.hit.geomID[k], h.hit.primID[k], h.ray.tfar[k], s.tfar[k] < 0.0);
        }
    }
    assert_eq!(device.error(), RTC_ERROR_NONE);
}

/// Plain arrays of a length that is no multiple of any packet, with one ray switched off, and ids that a callback
/// could read.
#[test]
fn plain_arrays_equal_single_rays() {
    let device = Device::new();
    let (vertices, indices) = sheet(40);
    let data = Planes { height: -0.1 };
    let mut calls = 0u32;
    let user: *mut c_void = ptr::from_mut(&mut calls).cast();
    let reference = Reference::new(&device, device.mesh(&vertices, &indices), &data, user);
    let n = reference.rays.len() - 5;
    let rays = &reference.rays[..n];
    let column = |f: fn(&RTCRay) -> f32| rays.iter().map(f).collect::<Vec<f32>>();
    let [ox, oy, oz] = [column(|r| r.org_x), column(|r| r.org_y), column(|r| r.org_z)];
    let [dx, dy, dz] = [column(|r| r.dir_x), column(|r| r.dir_y), column(|r| r.dir_z)];
    let mut near = column(|r| r.tnear);
    near[7] = 1.0;
    let ids: Vec<u32> = (0..n as u32).collect();
    for coherent in [false, true] {
        let mut q = EmQuery::new(coherent, user);
        let [mut t, mut dark] = [column(|r| r.tfar), column(|r| r.tfar)];
        (t[7], dark[7]) = (-1.0, -1.0);
        let [mut u, mut v] = [vec![0.0; n], vec![0.0; n]];
        let [mut prim, mut geom, mut inst] = [(); 3].map(|()| vec![INVALID_ID; n]);
        let mut soa = EmRays {
            org_x: ox.as_ptr(),
            org_y: oy.as_ptr(),
            org_z: oz.as_ptr(),
            tnear: near.as_ptr(),
            dir_x: dx.as_ptr(),
            dir_y: dy.as_ptr(),
            dir_z: dz.as_ptr(),
            id: ids.as_ptr(),
            tfar: t.as_mut_ptr(),
        };
        let hits = EmHits {
            u: u.as_mut_ptr(),
            v: v.as_mut_ptr(),
            primID: prim.as_mut_ptr(),
            geomID: geom.as_mut_ptr(),
            instID: inst.as_mut_ptr(),
        };
        // SAFETY: n entries in every array, finite rays, scene committed.
        unsafe {
            em_intersect_soa(reference.scene.0, &mut q, &soa, &hits, n as u32);
            soa.tfar = dark.as_mut_ptr();
            em_occluded_soa(reference.scene.0, &mut q, &soa, n as u32);
        }
        assert_eq!((geom[7], t[7], dark[7]), (INVALID_ID, -1.0, -1.0), "ray 7 is off");
        for i in (0..n).filter(|&i| i != 7) {
            reference.same("soa", i, geom[i], prim[i], t[i], dark[i] < 0.0);
        }
    }
    assert_eq!(device.error(), RTC_ERROR_NONE);
}

/// Scatters rays over the rows of a packet of width `n`; with room for hits if `hits`.
fn pack(words: *mut u32, n: usize, rays: &[RTCRay], hits: bool) {
    for (lane, ray) in rays.iter().enumerate() {
        let source = ptr::from_ref(ray).cast::<u32>();
        // SAFETY: a single ray is 12 words, one a row; the packet has `n` lanes in each of its rows.
        unsafe {
            for r in 0..row::HIT {
                *words.add(r * n + lane) = *source.add(r);
            }
            if hits {
                for r in [row::PRIM_ID, row::GEOM_ID, row::INST_ID] {
                    *words.add((row::HIT + r) * n + lane) = INVALID_ID;
                }
            }
        }
    }
}
