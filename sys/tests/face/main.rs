//! The face answers the same, whichever Embree is behind it. Run against another one with `EMBREE_DIR`.

mod batches;
mod planes;
mod support;

use embree_sys::*;
use planes::{Planes, planes};
use std::ffi::{CStr, c_char, c_void};
use std::ptr;
use support::{Device, TRIANGLE, no_hit, ray, sheet, zeroed};

#[test]
fn header_and_library_are_of_one_major_version() {
    let device = Device::new();
    // SAFETY: the device lives.
    let version = unsafe { rtcGetDeviceProperty(device.0, RTC_DEVICE_PROPERTY_VERSION_MAJOR) };
    assert_eq!(version, MAJOR as isize);
}

#[test]
fn triangle_is_hit_and_missed() {
    let device = Device::new();
    let scene = device.scene(&[device.mesh(&TRIANGLE, &[[0, 1, 2]])]);
    let hit = scene.closest(ray([0.25, 0.5, 2.0], [0.0, 0.0, -1.0]));
    assert_eq!((hit.hit.geomID, hit.hit.primID, hit.hit.instID[0]), (0, 0, INVALID_ID));
    // A distance of 2 along an axis and dyadic barycentrics: every operation is exact, apart from a reciprocal.
    let near = |a: f32, b: f32| (a - b).abs() < 4.0 * f32::EPSILON;
    assert!(near(hit.ray.tfar, 2.0) && near(hit.hit.u, 0.25) && near(hit.hit.v, 0.5), "{hit:?}");
    let away = ray([0.75, 0.75, 2.0], [0.0, 0.0, -1.0]);
    assert_eq!(scene.closest(away).hit.geomID, INVALID_ID);
    assert!(!scene.is_occluded(away));
    assert!(scene.is_occluded(ray([0.25, 0.5, 2.0], [0.0, 0.0, -1.0])));
    let short = RTCRay { tfar: 1.5, ..ray([0.25, 0.5, 2.0], [0.0, 0.0, -1.0]) };
    assert!(!scene.is_occluded(short));
    assert_eq!(device.error(), RTC_ERROR_NONE);
}

/// A vertex buffer whose last vertex is its last 12 bytes but for 4 of padding: Embree reads 16 from its start.
#[test]
fn shared_buffer_needs_four_bytes_of_padding_only() {
    let device = Device::new();
    let words: Vec<f32> = TRIANGLE.iter().flatten().copied().take(9).chain([f32::NAN]).collect();
    let indices = [[0u32, 1, 2]];
    // SAFETY: 40 bytes are readable, which is 16 past the start of the last vertex at byte 24.
    let scene = unsafe {
        let mesh = rtcNewGeometry(device.0, RTC_GEOMETRY_TYPE_TRIANGLE);
        let (v, i) = (words.as_ptr().cast(), indices.as_ptr().cast());
        rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, v, 0, 12, 3);
        rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, i, 0, 12, 1);
        device.scene(&[mesh])
    };
    assert_eq!(scene.closest(ray([0.25, 0.5, 2.0], [0.0, 0.0, -1.0])).hit.geomID, 0);
    let mut bounds: RTCBounds = zeroed();
    // SAFETY: the scene is committed.
    unsafe { rtcGetSceneBounds(scene.0, &mut bounds) };
    assert_eq!([bounds.lower_x, bounds.lower_y, bounds.upper_x, bounds.upper_y], [0.0, 0.0, 1.0, 1.0]);
}

#[test]
fn instance_reports_its_id_and_mirrors() {
    let device = Device::new();
    let child = device.scene(&[device.mesh(&TRIANGLE, &[[0, 1, 2]])]);
    let columns: [[f32; 12]; 2] = [
        [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 10.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
    ];
    let instances = columns.map(|m| {
        // SAFETY: the child is committed; the transform is read during the call.
        unsafe {
            let instance = rtcNewGeometry(device.0, RTC_GEOMETRY_TYPE_INSTANCE);
            rtcSetGeometryInstancedScene(instance, child.0);
            rtcSetGeometryTransform(instance, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, m.as_ptr().cast());
            instance
        }
    });
    let scene = device.scene(&instances);
    for (x, id) in [(10.25, 0), (-0.25, 1), (0.25, INVALID_ID)] {
        let hit = scene.closest(ray([x, 0.5, 2.0], [0.0, 0.0, -1.0]));
        assert_eq!(hit.hit.instID[0], id);
        assert_eq!(hit.hit.geomID, if id == INVALID_ID { INVALID_ID } else { 0 });
    }
}

#[test]
fn user_geometry_is_called_with_the_query() {
    let device = Device::new();
    let data = Planes { height: 0.5 };
    let scene = device.scene(&[planes(&device, &data)]);
    let mut calls = 0u32;
    let mut query = EmQuery::new(false, ptr::from_mut(&mut calls).cast());
    let mut hit = RTCRayHit { ray: ray([1.5, 0.5, 2.5], [0.0, 0.0, -1.0]), hit: no_hit() };
    let mut shadow = hit.ray;
    // SAFETY: scene committed, ray finite, and `calls` lives.
    unsafe {
        em_intersect1(scene.0, &mut query, &mut hit);
        em_occluded1(scene.0, &mut query, &mut shadow);
    }
    assert_eq!((hit.ray.tfar, hit.hit.primID, hit.hit.geomID), (2.0, 1, 0));
    assert_eq!(shadow.tfar, f32::NEG_INFINITY);
    assert!(calls >= 2);
}

/// Rejects every hit on primitive 0.
unsafe extern "C" fn reject_first(args: *const RTCFilterFunctionNArguments) {
    // SAFETY: Embree passes valid arguments; the user pointer of the query is a counter.
    unsafe {
        let args = &*args;
        let n = args.N as usize;
        *(*query_of(args.context)).user.cast::<u32>() += 1;
        for lane in (0..n).filter(|&i| *args.valid.add(i) == LANE_ON) {
            if *args.hit.cast::<u32>().add(row::PRIM_ID * n + lane) == 0 {
                *args.valid.add(lane) = 0;
            }
        }
    }
}

#[test]
fn filter_sees_the_query_and_rejects() {
    let device = Device::new();
    let vertices =
        [TRIANGLE[0], TRIANGLE[1], TRIANGLE[2], [0.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 1.0, -1.0]];
    let vertices: Vec<_> = vertices.into_iter().chain([[0.0; 3]]).collect();
    let indices = [[0, 1, 2], [3, 4, 5]];
    let mesh = device.mesh(&vertices, &indices);
    // SAFETY: the geometry lives; the filter's arguments are Embree's.
    unsafe {
        rtcSetGeometryIntersectFilterFunction(mesh, Some(reject_first));
        rtcSetGeometryOccludedFilterFunction(mesh, Some(reject_first));
    }
    let scene = device.scene(&[mesh]);
    let mut calls = 0u32;
    let mut query = EmQuery::new(false, ptr::from_mut(&mut calls).cast());
    let mut hit = RTCRayHit { ray: ray([0.25, 0.5, 2.0], [0.0, 0.0, -1.0]), hit: no_hit() };
    let mut shadow = RTCRay { tfar: 2.5, ..hit.ray };
    // SAFETY: scene committed, rays finite, `calls` lives.
    unsafe {
        em_intersect1(scene.0, &mut query, &mut hit);
        em_occluded1(scene.0, &mut query, &mut shadow);
    }
    assert_eq!((hit.hit.primID, hit.hit.geomID), (1, 0));
    assert_eq!(shadow.tfar, 2.5, "only the rejected triangle lies before 2.5");
    assert!(calls >= 2);
}

unsafe extern "C" fn keep_message(user: *mut c_void, code: RTCError, message: *const c_char) {
    // SAFETY: the user pointer is the test's list; Embree's message is a C string.
    unsafe {
        let text = CStr::from_ptr(message).to_string_lossy().into_owned();
        (*user.cast::<Vec<(RTCError, String)>>()).push((code, text));
    }
}

#[test]
fn bad_build_calls_the_error_function() {
    let device = Device::new();
    let mut errors: Vec<(RTCError, String)> = Vec::new();
    let indices = [[0u32, 1, 2]];
    // SAFETY: `errors` outlives the device's last call; the bad stride is refused before anything is read.
    unsafe {
        rtcSetDeviceErrorFunction(device.0, Some(keep_message), ptr::from_mut(&mut errors).cast());
        let mesh = rtcNewGeometry(device.0, RTC_GEOMETRY_TYPE_TRIANGLE);
        let i = indices.as_ptr().cast();
        rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, i, 0, 3, 1);
        rtcReleaseGeometry(mesh);
        rtcSetDeviceErrorFunction(device.0, None, ptr::null_mut());
    }
    assert!(errors.iter().any(|(code, text)| *code != RTC_ERROR_NONE && !text.is_empty()), "{errors:?}");
    assert_ne!(device.error(), RTC_ERROR_NONE);
}

unsafe extern "C" fn count_bytes(user: *mut c_void, bytes: isize, _post: bool) -> bool {
    use std::sync::atomic::{AtomicIsize, Ordering};
    // SAFETY: the user pointer is the test's counter, and atomic, as builds call from many threads.
    unsafe { (*user.cast::<AtomicIsize>()).fetch_add(bytes, Ordering::Relaxed) };
    true
}

#[test]
fn memory_monitor_balances_to_zero() {
    use std::sync::atomic::{AtomicIsize, Ordering};
    let bytes = AtomicIsize::new(0);
    let (vertices, indices) = sheet(50);
    {
        let device = Device::new();
        let counter = ptr::from_ref(&bytes).cast_mut().cast();
        // SAFETY: the counter outlives the device.
        unsafe { rtcSetDeviceMemoryMonitorFunction(device.0, Some(count_bytes), counter) };
        let _scene = device.scene(&[device.mesh(&vertices, &indices)]);
        // 5,000 triangles at no less than 30 bytes each in any of Embree's layouts.
        assert!(bytes.load(Ordering::Relaxed) > 150_000);
    }
    assert_eq!(bytes.load(Ordering::Relaxed), 0);
}
