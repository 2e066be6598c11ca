//! A user geometry: horizontal planes.

use crate::support::Device;
use embree_sys::*;
use std::ptr;

/// A horizontal plane at the height that the geometry's data says, patched by primitive in x: [prim, prim + 1].
pub struct Planes {
    pub height: f32,
}

unsafe extern "C" fn plane_bounds(args: *const RTCBoundsFunctionArguments) {
    // SAFETY: Embree passes valid arguments; the data is a `Planes`.
    unsafe {
        let args = &*args;
        let planes = &*args.geometryUserPtr.cast::<Planes>();
        let x = args.primID as f32;
        let b = &mut *args.bounds_o;
        [b.lower_x, b.lower_y, b.lower_z] = [x, 0.0, planes.height];
        [b.upper_x, b.upper_y, b.upper_z] = [x + 1.0, 1.0, planes.height];
    }
}

/// Distance to the plane, if it lies within the ray's segment and the patch. `ray` is an `RTCRayN` of width `n`.
unsafe fn plane_distance(planes: &Planes, prim: u32, ray: *const f32, n: usize, lane: usize) -> Option<f32> {
    // SAFETY: rows and lane are inside the record.
    let at = |r: usize| unsafe { *ray.add(r * n + lane) };
    let t = (planes.height - at(row::ORG + 2)) / at(row::DIR + 2);
    let [x, y] = [0, 1].map(|k| at(row::ORG + k) + t * at(row::DIR + k));
    let inside = x >= prim as f32 && x <= prim as f32 + 1.0 && (0.0..=1.0).contains(&y);
    (inside && t > at(row::TNEAR) && t < at(row::TFAR)).then_some(t)
}

unsafe extern "C" fn plane_intersect(args: *const RTCIntersectFunctionNArguments) {
    // SAFETY: Embree passes valid arguments; the query's user pointer is a counter.
    unsafe {
        let args = &*args;
        let n = args.N as usize;
        let calls = (*query_of(args.context)).user.cast::<u32>();
        *calls += 1;
        let ray = args.rayhit.cast::<f32>();
        let hit = ray.add(row::HIT * n);
        for lane in (0..n).filter(|&i| *args.valid.add(i) == LANE_ON) {
            let planes = &*args.geometryUserPtr.cast::<Planes>();
            let Some(t) = plane_distance(planes, args.primID, ray, n, lane) else { continue };
            *ray.add(row::TFAR * n + lane) = t;
            *hit.add((row::NG + 2) * n + lane) = 1.0;
            *hit.cast::<u32>().add(row::PRIM_ID * n + lane) = args.primID;
            *hit.cast::<u32>().add(row::GEOM_ID * n + lane) = args.geomID;
            *hit.cast::<u32>().add(row::INST_ID * n + lane) = (*args.context).instID[0];
        }
    }
}

unsafe extern "C" fn plane_occluded(args: *const RTCOccludedFunctionNArguments) {
    // SAFETY: as above.
    unsafe {
        let args = &*args;
        let n = args.N as usize;
        let calls = (*query_of(args.context)).user.cast::<u32>();
        *calls += 1;
        let ray = args.ray.cast::<f32>();
        for lane in (0..n).filter(|&i| *args.valid.add(i) == LANE_ON) {
            let planes = &*args.geometryUserPtr.cast::<Planes>();
            if plane_distance(planes, args.primID, ray, n, lane).is_some() {
                *ray.add(row::TFAR * n + lane) = f32::NEG_INFINITY;
            }
        }
    }
}

pub fn planes(device: &Device, data: &Planes) -> RTCGeometry {
    // SAFETY: the data outlives the scene in every test, and the callbacks read it as what it is.
    unsafe {
        let user = rtcNewGeometry(device.0, RTC_GEOMETRY_TYPE_USER);
        rtcSetGeometryUserPrimitiveCount(user, 3);
        rtcSetGeometryUserData(user, ptr::from_ref(data).cast_mut().cast());
        rtcSetGeometryBoundsFunction(user, Some(plane_bounds), ptr::null_mut());
        rtcSetGeometryIntersectFunction(user, Some(plane_intersect));
        rtcSetGeometryOccludedFunction(user, Some(plane_occluded));
        user
    }
}
