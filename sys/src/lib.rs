//! The system's Intel Embree, 3 or 4, behind one face.
//!
//! This crate holds C facts only: bindings that `bindgen` makes from the installed header (an allowlist of what a
//! ray kernel needs), and a small C shim (`shim.c`) for what differs between the versions. Code written against it
//! compiles unchanged for both.
//!
//! # Finding Embree
//!
//! 1. `EMBREE_DIR`: a folder with `include/embree4/rtcore.h` (or `embree3`) and `lib/libembree4.so` (or `lib64/`),
//!    or with header and library side by side. If it is set, nothing else is tried.
//! 2. pkg-config: `embree4`, `embree3`, `embree`.
//! 3. The C compiler's own search path, which is where Debian and Ubuntu's `libembree-dev` installs: Embree 4
//!    (Debian 13), then Embree 3 (Debian 12).
//!
//! A dependent's build script can read `DEP_EMBREE_VERSION` ("4.3.3", by the header) and `DEP_EMBREE_LIBDIR`: not
//! empty if the library lies outside of the loader's search path, and then to be made an rpath of executables
//! (`cargo::rustc-link-arg=-Wl,-rpath,...`; Cargo does not pass such arguments on to dependents).
//!
//! # The face
//!
//! Objects are Embree's own (`rtcNewDevice`, `rtcNewScene`, `rtcNewGeometry` ...). Queries are `em_*` functions and
//! take an [`EmQuery`]: Embree's per-query context, a coherence hint and a pointer of the caller's. In a callback
//! (user geometry, filter) the `context` of the arguments may be cast back to the `EmQuery` of the call:
//! [`query_of`].
//!
//! | call | Embree 3 | Embree 4 |
//! |---|---|---|
//! | `em_intersect1`, `em_occluded1` | `rtcIntersect1` ... | the same, with arguments on the stack |
//! | `em_intersect4/8/16`, `em_occluded4/8/16` | packets with a mask of -1 (on) and 0 (off), also where the CPU lacks the width | the same |
//! | `em_intersect_stream1`, `em_occluded_stream1` | `rtcIntersect1M` ... | a loop over single rays |
//! | `em_intersect_stream16`, `em_occluded_stream16` | `rtcIntersectNM` ... | a loop over packets |
//! | `em_intersect_soa`, `em_occluded_soa` | `rtcIntersectNp` ... | a loop over packets |
//!
//! Embree's own rules stand: queries do not check their arguments (a NaN aborts Debian's 3.13.5), and must not
//! overlap with a commit of the same scene; packets are aligned as the `RTCRay*` types are; a shared vertex buffer
//! must be readable for 16 bytes from the start of its last vertex; nothing may unwind out of a callback.

#![allow(non_camel_case_types, non_snake_case, non_upper_case_globals)]

mod bindings {
    include!(concat!(env!("OUT_DIR"), "/bindings.rs"));
}
pub use bindings::*;

/// Version of the header that this crate was built with: 3 or 4.
pub const MAJOR: u32 = EM_MAJOR;

/// Whether `em_*_stream*` and `em_*_soa` are real streams (Embree 3), or loops (Embree 4).
pub const HAS_STREAMS: bool = EM_MAJOR == 3;

/// "None" as a geometry, primitive or instance id (`RTC_INVALID_GEOMETRY_ID`).
pub const INVALID_ID: u32 = u32::MAX;

/// `valid` value of a lane that takes part in a packet; 0 is off.
pub const LANE_ON: i32 = -1;

/// The query behind the `context` pointer that a callback is given.
///
/// # Safety
/// `context` must come from the arguments of a callback of a query that was made by an `em_*` function.
#[inline(always)]
pub unsafe fn query_of(context: *mut EmContext) -> *mut EmQuery {
    context.cast()
}

impl EmQuery {
    /// A query ready for use; the shim's `em_query_init`.
    #[inline]
    #[expect(clippy::not_unsafe_ptr_arg_deref, reason = "the pointer is stored, not followed")]
    pub fn new(coherent: bool, user: *mut std::ffi::c_void) -> Self {
        let mut query = std::mem::MaybeUninit::uninit();
        // SAFETY: em_query_init writes every field (the shim's text), and all are plain integers and pointers.
        unsafe {
            em_query_init(query.as_mut_ptr(), u32::from(coherent), user);
            query.assume_init()
        }
    }
}

/// Rows of the structure-of-arrays records that callbacks are given (`RTCRayN`, `RTCHitN`, `RTCRayHitN`): the value
/// of lane `i` in a record of width `n` is the 32-bit word `row * n + i`.
pub mod row {
    /// Origin x, y, z are rows 0, 1, 2.
    pub const ORG: usize = 0;
    /// Start of the ray's segment.
    pub const TNEAR: usize = 3;
    /// Direction x, y, z are rows 4, 5, 6.
    pub const DIR: usize = 4;
    /// Time, for motion blur.
    pub const TIME: usize = 7;
    /// End of the ray's segment; the distance once something is hit; -inf once occluded.
    pub const TFAR: usize = 8;
    /// Ray mask.
    pub const MASK: usize = 9;
    /// The caller's id of the ray.
    pub const ID: usize = 10;
    /// Reserved by Embree.
    pub const FLAGS: usize = 11;
    /// Rows of a ray, and so the first row of the hit in an `RTCRayHitN`. The rows below count from there.
    pub const HIT: usize = 12;
    /// Geometric normal x, y, z are rows 0, 1, 2 of a hit.
    pub const NG: usize = 0;
    /// Barycentric u, v are rows 3, 4 of a hit.
    pub const UV: usize = 3;
    /// Primitive.
    pub const PRIM_ID: usize = 5;
    /// Geometry.
    pub const GEOM_ID: usize = 6;
    /// Instance (one level).
    pub const INST_ID: usize = 7;
}

// What Rust code relies on beyond bindgen's own layout checks: the rows, and records that can lie in plain arrays.
const _: () = {
    use std::mem::{align_of, offset_of, size_of};
    assert!(EM_MAX_INSTANCE_LEVELS == 1, "skylit counts on builds of Embree with one level of instances");
    assert!(size_of::<RTCRay>() == 48 && size_of::<RTCRay16>() == 12 * 64);
    assert!(size_of::<RTCRayHit>() == if MAJOR == 3 { 80 } else { 96 });
    assert!(offset_of!(RTCRayHit, hit) == 48 && offset_of!(RTCRayHit16, hit) == row::HIT * 64);
    assert!(align_of::<RTCRay>() == 16 && align_of::<RTCRayHit16>() == 64);
    assert!(offset_of!(RTCRay16, tnear) == row::TNEAR * 64 && offset_of!(RTCRay16, tfar) == row::TFAR * 64);
    assert!(offset_of!(RTCRay16, dir_x) == row::DIR * 64 && offset_of!(RTCRay16, id) == row::ID * 64);
    assert!(offset_of!(RTCRay16, mask) == row::MASK * 64 && offset_of!(RTCRay16, flags) == row::FLAGS * 64);
    assert!(offset_of!(RTCRay16, time) == row::TIME * 64);
    assert!(offset_of!(RTCHit16, Ng_x) == row::NG * 64 && offset_of!(RTCHit16, u) == row::UV * 64);
    assert!(
        offset_of!(RTCHit16, primID) == row::PRIM_ID * 64
            && offset_of!(RTCHit16, geomID) == row::GEOM_ID * 64
    );
    assert!(
        offset_of!(RTCHit16, instID) == row::INST_ID * 64 && offset_of!(RTCHit, instID) == row::INST_ID * 4
    );
    assert!(offset_of!(EmQuery, context) == 0);
};
