//! What Embree calls: bounds and tests of procedural shapes, portals to nested groups, and hit filters.
//!
//! Each callback is given an array of rays (`n` lanes, structure of arrays) and does its lanes one by one, with the
//! original ray in double precision: the transform that Embree made in f32 is used for nothing but culling.

use super::handles::GeometryHandle;
use super::level::{PORTAL_ID, SHAPE_BIT, user_data};
use super::query::Query;
use crate::accel::failure::Failure;
use crate::accel::{accepted, first_crossing};
use crate::base::geometry::Geometry;
use crate::base::hit::Hit;
use crate::math::aabb::Aabb;
use embree_sys::*;
use glam::DAffine3;
use std::ptr;
use std::sync::Arc;

/// All procedural shapes of a group.
pub(super) struct ShapeData {
    pub(super) geometry: Arc<Geometry>,
    pub(super) group: usize,
    pub(super) primitives: Vec<ShapePrimitive>,
    pub(super) failure: Arc<Failure>,
}

/// One primitive of one leaf.
pub(super) struct ShapePrimitive {
    pub(super) leaf: u32,
    pub(super) prim: u32,
}

/// A mesh with a hit filter.
pub(super) struct FilterData {
    pub(super) geometry: Arc<Geometry>,
    pub(super) group: usize,
    pub(super) leaf: u32,
    pub(super) failure: Arc<Failure>,
}

/// All portals of a level.
pub(super) struct PortalData {
    pub(super) portals: Vec<Portal>,
    pub(super) failure: Arc<Failure>,
}

/// A group that is asked by callback.
pub(super) struct Portal {
    pub(super) bounds: Aabb,
    pub(super) from_level: DAffine3,
    pub(super) first_path: u64,
    pub(super) level: u32,
}

/// Registers the callbacks of procedural shapes. The data must outlive every scene that holds the geometry.
pub(super) fn set_shapes(g: &GeometryHandle, data: &ShapeData, count: u32) {
    // SAFETY: the callbacks cast the user pointer to the type that is given here.
    unsafe {
        rtcSetGeometryUserPrimitiveCount(g.raw(), count);
        rtcSetGeometryUserData(g.raw(), user_data(data));
        rtcSetGeometryBoundsFunction(g.raw(), Some(shape_bounds), ptr::null_mut());
        rtcSetGeometryIntersectFunction(g.raw(), Some(shape_closest));
        rtcSetGeometryOccludedFunction(g.raw(), Some(shape_any));
    }
}

/// Registers the callbacks of portals; as [`set_shapes`].
pub(super) fn set_portals(g: &GeometryHandle, data: &PortalData) {
    // SAFETY: as above.
    unsafe {
        rtcSetGeometryUserPrimitiveCount(g.raw(), data.portals.len() as u32);
        rtcSetGeometryUserData(g.raw(), user_data(data));
        rtcSetGeometryBoundsFunction(g.raw(), Some(portal_bounds), ptr::null_mut());
        rtcSetGeometryIntersectFunction(g.raw(), Some(portal_closest));
        rtcSetGeometryOccludedFunction(g.raw(), Some(portal_any));
    }
}

/// Registers a mesh's hit filter; as [`set_shapes`].
pub(super) fn set_filter(g: &GeometryHandle, data: &FilterData) {
    // SAFETY: as above.
    unsafe {
        rtcSetGeometryUserData(g.raw(), user_data(data));
        rtcSetGeometryIntersectFilterFunction(g.raw(), Some(filter));
        rtcSetGeometryOccludedFilterFunction(g.raw(), Some(filter));
    }
}

/// Embree accepts no coordinate beyond 1.8e18, and drops what has one.
const LARGEST: f32 = 1e17;

/// # Safety
/// `out` must be valid for writing.
unsafe fn write_bounds(out: *mut RTCBounds, b: Aabb) {
    let (lower, upper) = (b.min.max(glam::Vec3::splat(-LARGEST)), b.max.min(glam::Vec3::splat(LARGEST)));
    // SAFETY: the caller's promise.
    unsafe {
        [(*out).lower_x, (*out).lower_y, (*out).lower_z] = lower.to_array();
        [(*out).upper_x, (*out).upper_y, (*out).upper_z] = upper.to_array();
    }
}

unsafe extern "C" fn shape_bounds(args: *const RTCBoundsFunctionArguments) {
    // SAFETY: Embree passes valid arguments, and the user pointer of `set_shapes`.
    let (args, data) = unsafe { (&*args, &*(*args).geometryUserPtr.cast::<ShapeData>()) };
    data.failure.guard(|| {
        let p = &data.primitives[args.primID as usize];
        let bounds = data.geometry.groups[data.group].leaves[p.leaf as usize].shape.primitive_bounds(p.prim);
        // SAFETY: Embree's box is valid for writing during the call.
        unsafe { write_bounds(args.bounds_o, bounds) };
    });
}

unsafe extern "C" fn portal_bounds(args: *const RTCBoundsFunctionArguments) {
    // SAFETY: as for `shape_bounds`, with `set_portals`.
    let (args, data) = unsafe { (&*args, &*(*args).geometryUserPtr.cast::<PortalData>()) };
    // SAFETY: as above.
    data.failure.guard(|| unsafe { write_bounds(args.bounds_o, data.portals[args.primID as usize].bounds) });
}

/// The rays of a callback: rows of `n` lanes each (see `embree_sys::row`).
struct Lanes {
    n: usize,
    valid: *mut i32,
    ray: *mut f32,
    hit: *mut u32,
}

/// What is written for a hit.
struct Record {
    t: f32,
    geom: u32,
    prim: u32,
    inst: u32,
    path: u64,
}

impl Lanes {
    /// # Safety
    /// The pointers must be those of a callback's arguments, with `n` lanes, and valid while this lives.
    unsafe fn closest(valid: *mut i32, rayhit: *mut RTCRayHitN, n: u32) -> Self {
        let (n, ray) = (n as usize, rayhit.cast::<f32>());
        // SAFETY: the hit follows the rows of the ray.
        Lanes { n, valid, ray, hit: unsafe { ray.add(row::HIT * n) }.cast() }
    }

    /// # Safety
    /// As for [`Lanes::closest`]; there is no hit to write.
    unsafe fn any(valid: *mut i32, ray: *mut RTCRayN, n: u32) -> Self {
        Lanes { n: n as usize, valid, ray: ray.cast(), hit: ptr::null_mut() }
    }

    /// The lanes that are on.
    fn on(&self) -> impl Iterator<Item = usize> + '_ {
        // SAFETY: `valid` has n entries.
        (0..self.n).filter(|&i| unsafe { *self.valid.add(i) } != 0)
    }

    #[inline]
    fn word(&self, row: usize, lane: usize) -> f32 {
        debug_assert!(row < row::HIT && lane < self.n);
        // SAFETY: a ray has row::HIT rows of n lanes.
        unsafe { *self.ray.add(row * self.n + lane) }
    }

    #[inline]
    fn id(&self, lane: usize) -> u32 {
        self.word(row::ID, lane).to_bits()
    }

    fn set_occluded(&self, lane: usize) {
        // SAFETY: as for `word`.
        unsafe { *self.ray.add(row::TFAR * self.n + lane) = f32::NEG_INFINITY }
    }

    /// Only for lanes made by [`Lanes::closest`].
    fn set_hit(&self, lane: usize, r: &Record) {
        debug_assert!(!self.hit.is_null());
        let (low, high) = (r.path as u32, (r.path >> 32) as u32);
        // SAFETY: as for `word`; a hit has at least INST_ID + 1 rows. Each word is written as it is read later.
        unsafe {
            *self.ray.add(row::TFAR * self.n + lane) = r.t;
            let rows = [(row::UV, low), (row::UV + 1, high), (row::PRIM_ID, r.prim)];
            for (k, value) in rows.into_iter().chain([(row::GEOM_ID, r.geom), (row::INST_ID, r.inst)]) {
                *self.hit.add(k * self.n + lane) = value;
            }
        }
    }
}

/// The query behind a callback's context, and the instance it is in.
///
/// # Safety
/// `context` must be that of a callback's arguments.
unsafe fn query<'a>(context: *mut EmContext) -> (&'a Query<'a>, u32) {
    // SAFETY: all queries of this kernel are made with an EmQuery whose user pointer is a `Query` on the stack of
    // the thread that waits for Embree to return.
    unsafe { (&*(*query_of(context)).user.cast::<Query>(), (*context).instID[0]) }
}

unsafe extern "C" fn shape_closest(args: *const RTCIntersectFunctionNArguments) {
    // SAFETY: Embree passes valid arguments, and the user pointer of `set_shapes`.
    let (args, data) = unsafe { (&*args, &*(*args).geometryUserPtr.cast::<ShapeData>()) };
    // SAFETY: the pointers of this call.
    let (lanes, (query, inst)) =
        unsafe { (Lanes::closest(args.valid, args.rayhit, args.N), query(args.context)) };
    data.failure.guard(|| {
        let p = &data.primitives[args.primID as usize];
        for lane in lanes.on() {
            if let Some(t) = shape_crossing(data, p, query, inst, &lanes, lane) {
                let geom = SHAPE_BIT | p.leaf;
                lanes.set_hit(lane, &Record { t: t as f32, geom, prim: p.prim, inst, path: 0 });
            }
        }
    });
}

unsafe extern "C" fn shape_any(args: *const RTCOccludedFunctionNArguments) {
    // SAFETY: as for `shape_closest`.
    let (args, data) = unsafe { (&*args, &*(*args).geometryUserPtr.cast::<ShapeData>()) };
    // SAFETY: the pointers of this call.
    let (lanes, (query, inst)) = unsafe { (Lanes::any(args.valid, args.ray, args.N), query(args.context)) };
    data.failure.guard(|| {
        let p = &data.primitives[args.primID as usize];
        for lane in lanes.on() {
            if shape_crossing(data, p, query, inst, &lanes, lane).is_some() {
                lanes.set_occluded(lane);
            }
        }
    });
}

#[inline]
fn shape_crossing(
    data: &ShapeData,
    p: &ShapePrimitive,
    query: &Query,
    inst: u32,
    lanes: &Lanes,
    lane: usize,
) -> Option<f64> {
    let leaf = &data.geometry.groups[data.group].leaves[p.leaf as usize];
    let id = lanes.id(lane);
    let (ray, first_path) = query.ray_in(inst, id, lanes.word(row::TNEAR, lane), lanes.word(row::TFAR, lane));
    let path = first_path + u64::from(p.leaf);
    first_crossing(leaf, &ray, p.prim, path, if leaf.filter.is_some() { query.key(id) } else { 0 })
}

unsafe extern "C" fn portal_closest(args: *const RTCIntersectFunctionNArguments) {
    // SAFETY: as for `shape_closest`, with `set_portals`.
    let (args, data) = unsafe { (&*args, &*(*args).geometryUserPtr.cast::<PortalData>()) };
    // SAFETY: the pointers of this call.
    let (lanes, (query, inst)) =
        unsafe { (Lanes::closest(args.valid, args.rayhit, args.N), query(args.context)) };
    data.failure.guard(|| {
        let portal = &data.portals[args.primID as usize];
        for lane in lanes.on() {
            let (near, far, id) = (lanes.word(row::TNEAR, lane), lanes.word(row::TFAR, lane), lanes.id(lane));
            let ray = query.ray(id, near, far).transformed(&portal.from_level);
            let below = query.below(portal.level, portal.first_path);
            if let Some(h) = below.closest(&ray, query.key(id)) {
                let path = portal.first_path + h.path;
                // Rescaling below may round t past the end of this ray.
                let t = (h.t as f32).min(far);
                lanes.set_hit(lane, &Record { t, geom: PORTAL_ID, prim: h.prim, inst, path });
            }
        }
    });
}

unsafe extern "C" fn portal_any(args: *const RTCOccludedFunctionNArguments) {
    // SAFETY: as for `shape_closest`, with `set_portals`.
    let (args, data) = unsafe { (&*args, &*(*args).geometryUserPtr.cast::<PortalData>()) };
    // SAFETY: the pointers of this call.
    let (lanes, (query, _)) = unsafe { (Lanes::any(args.valid, args.ray, args.N), query(args.context)) };
    data.failure.guard(|| {
        let portal = &data.portals[args.primID as usize];
        for lane in lanes.on() {
            let (near, far, id) = (lanes.word(row::TNEAR, lane), lanes.word(row::TFAR, lane), lanes.id(lane));
            let ray = query.ray(id, near, far).transformed(&portal.from_level);
            if query.below(portal.level, portal.first_path).any(&ray, query.key(id)) {
                lanes.set_occluded(lane);
            }
        }
    });
}

unsafe extern "C" fn filter(args: *const RTCFilterFunctionNArguments) {
    // SAFETY: Embree passes valid arguments, and the user pointer of `set_filter`.
    let (args, data) = unsafe { (&*args, &*(*args).geometryUserPtr.cast::<FilterData>()) };
    // SAFETY: the pointers of this call; the ray's rows are those of an occlusion query, and the hit stands apart.
    let (lanes, (query, inst)) = unsafe { (Lanes::any(args.valid, args.ray, args.N), query(args.context)) };
    let hit = args.hit.cast::<u32>();
    data.failure.guard(|| {
        let leaf = &data.geometry.groups[data.group].leaves[data.leaf as usize];
        for lane in lanes.on() {
            let id = lanes.id(lane);
            // Embree has set the ray's end to the candidate's distance.
            let t = lanes.word(row::TFAR, lane);
            let (ray, first_path) = query.ray_in(inst, id, lanes.word(row::TNEAR, lane), t);
            // SAFETY: a hit has more than PRIM_ID rows of N lanes.
            let prim = unsafe { *hit.add(row::PRIM_ID * lanes.n + lane) };
            let hit = Hit { t, prim, path: first_path + u64::from(data.leaf) };
            if !accepted(leaf, &ray, &hit, query.key(id)) {
                // SAFETY: `valid` has N entries.
                unsafe { *args.valid.add(lane) = 0 };
            }
        }
    });
}
