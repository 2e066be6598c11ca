//! Owners of Embree's objects, which are reference-counted, and what a device reports: errors and memory.

use crate::error::{Error, Result};
use crate::math::simd::Level;
use crate::memory;
use embree_sys::*;
use std::ffi::{CStr, CString, c_char, c_void};
use std::ptr;
use std::sync::atomic::{AtomicIsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// What the device's callbacks write to; it must not move while the device lives.
struct Reports {
    bytes: AtomicIsize,
    error: Mutex<Option<(RTCError, String)>>,
}

/// A device. Its reports live as long as every object made from it.
pub(super) struct Device {
    raw: RTCDevice,
    reports: Arc<Reports>,
}

// SAFETY: Embree's devices may be used from any thread (API manual, "Embree API", thread safety), and the reports
// are atomics and a mutex.
unsafe impl Send for Device {}
// SAFETY: as above.
unsafe impl Sync for Device {}

impl Device {
    /// A device that builds with so many threads (0 means all) and uses no more than an instruction set.
    pub(super) fn new(threads: usize, simd: Option<Level>) -> Result<Self> {
        let threads = if threads == 0 { String::new() } else { format!("threads={threads}") };
        let isa = match simd {
            None => "",
            Some(Level::Portable) => ",isa=sse2",
            Some(Level::Sse42) => ",isa=sse4.2",
            Some(Level::Avx2) => ",isa=avx2",
            Some(Level::Avx512) => ",isa=avx512",
        };
        let config = format!("{threads}{isa}");
        let config = config.trim_start_matches(',');
        let config = CString::new(config).map_err(|e| Error::Internal(e.to_string()))?;
        // SAFETY: a C string that outlives the call; errors before a device exists are asked for with null.
        let (raw, error) = unsafe { (rtcNewDevice(config.as_ptr()), rtcGetDeviceError(ptr::null_mut())) };
        if raw.is_null() {
            return Err(Error::Internal(format!("Embree cannot start: {}", error_name(error))));
        }
        let device = Device {
            raw,
            reports: Arc::new(Reports { bytes: AtomicIsize::new(0), error: Mutex::new(None) }),
        };
        if device.property(RTC_DEVICE_PROPERTY_VERSION_MAJOR) != MAJOR as isize {
            let version = device.version();
            return Err(Error::Internal(format!(
                "built for Embree {MAJOR}, but the library loaded is {version}"
            )));
        }
        let user: *mut c_void = Arc::as_ptr(&device.reports).cast_mut().cast();
        // SAFETY: the reports are dropped after the device (see `drop`), and the callbacks match their types.
        unsafe {
            rtcSetDeviceErrorFunction(raw, Some(keep_error), user);
            rtcSetDeviceMemoryMonitorFunction(raw, Some(count_bytes), user);
        }
        Ok(device)
    }

    fn property(&self, property: RTCDeviceProperty) -> isize {
        // SAFETY: the device lives.
        unsafe { rtcGetDeviceProperty(self.raw, property) }
    }

    /// Of the library that runs, "3.13.5".
    pub(super) fn version(&self) -> String {
        let [major, minor, patch] = [
            RTC_DEVICE_PROPERTY_VERSION_MAJOR,
            RTC_DEVICE_PROPERTY_VERSION_MINOR,
            RTC_DEVICE_PROPERTY_VERSION_PATCH,
        ]
        .map(|p| self.property(p));
        format!("{major}.{minor}.{patch}")
    }

    /// Bytes that Embree holds at the moment.
    pub(super) fn bytes(&self) -> u64 {
        self.reports.bytes.load(Ordering::Relaxed).max(0) as u64
    }

    /// The first error since the last call, from any thread that builds.
    pub(super) fn check(&self, doing: &str) -> Result<()> {
        let error = self.reports.error.lock().unwrap_or_else(PoisonError::into_inner).take();
        match error {
            None => Ok(()),
            // Its message says nothing that helps; there is room for what `build_kernel` expects, but not for this.
            Some((RTC_ERROR_OUT_OF_MEMORY, _)) if memory::is_limited() => {
                Err(Error::Usage(format!("Embree, while {doing}: it needs more than --max-memory allows")))
            }
            Some((code, text)) => {
                let name = error_name(code);
                Err(Error::Internal(format!("Embree, while {doing}: {name}: {text}")))
            }
        }
    }

    pub(super) fn new_scene(&self) -> SceneHandle {
        // SAFETY: the device lives.
        SceneHandle(unsafe { rtcNewScene(self.raw) })
    }

    pub(super) fn new_geometry(&self, kind: RTCGeometryType) -> GeometryHandle {
        // SAFETY: the device lives.
        GeometryHandle(unsafe { rtcNewGeometry(self.raw, kind) })
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: made by rtcNewDevice. The owner drops all scenes and geometries before the device (field order of
        // `Kernel`), so this is the last reference, and no callback comes after it: the reports may go.
        unsafe { rtcReleaseDevice(self.raw) }
    }
}

unsafe extern "C" fn keep_error(user: *mut c_void, code: RTCError, text: *const c_char) {
    if user.is_null() || text.is_null() {
        return;
    }
    // SAFETY: `user` is the device's `Reports`, which outlive it; Embree's text is a C string.
    let (reports, text) = unsafe { (&*user.cast::<Reports>(), CStr::from_ptr(text)) };
    let mut error = reports.error.lock().unwrap_or_else(PoisonError::into_inner);
    error.get_or_insert_with(|| (code, text.to_string_lossy().into_owned()));
}

/// Embree gives up what it does, with RTC_ERROR_OUT_OF_MEMORY, where this says false.
unsafe extern "C" fn count_bytes(user: *mut c_void, bytes: isize, _post: bool) -> bool {
    // SAFETY: `user` is the device's `Reports`, which outlive it.
    unsafe { (*user.cast::<Reports>()).bytes.fetch_add(bytes, Ordering::Relaxed) };
    u64::try_from(bytes).map_or(true, memory::fits)
}

fn error_name(code: RTCError) -> &'static str {
    match code {
        RTC_ERROR_NONE => "no error given",
        RTC_ERROR_INVALID_ARGUMENT => "invalid argument",
        RTC_ERROR_INVALID_OPERATION => "invalid operation",
        RTC_ERROR_OUT_OF_MEMORY => "out of memory",
        RTC_ERROR_UNSUPPORTED_CPU => "unsupported CPU",
        RTC_ERROR_CANCELLED => "cancelled",
        _ => "unknown error",
    }
}

/// A scene, committed before it is queried.
pub(super) struct SceneHandle(RTCScene);

// SAFETY: queries of a committed scene may come from any number of threads, and reference counts are atomic (API
// manual, rtcIntersect1, rtcRetainScene); building takes `&mut`.
unsafe impl Send for SceneHandle {}
// SAFETY: as above.
unsafe impl Sync for SceneHandle {}

impl SceneHandle {
    #[inline]
    pub(super) fn raw(&self) -> RTCScene {
        self.0
    }

    /// Puts a geometry in as number `id`; the scene holds its own reference.
    pub(super) fn attach(&mut self, geometry: &GeometryHandle, id: u32) {
        // SAFETY: both live.
        unsafe { rtcAttachGeometryByID(self.0, geometry.0, id) }
    }

    /// Builds. Nothing may trace this scene meanwhile, which `&mut` promises.
    pub(super) fn commit(&mut self, flags: RTCSceneFlags, quality: RTCBuildQuality) {
        // SAFETY: the scene and its geometries live, and their shared buffers do.
        unsafe {
            rtcSetSceneFlags(self.0, flags);
            rtcSetSceneBuildQuality(self.0, quality);
            rtcCommitScene(self.0);
        }
    }
}

impl Clone for SceneHandle {
    fn clone(&self) -> Self {
        // SAFETY: the scene lives.
        unsafe { rtcRetainScene(self.0) };
        SceneHandle(self.0)
    }
}

impl Drop for SceneHandle {
    fn drop(&mut self) {
        // SAFETY: one reference is ours.
        unsafe { rtcReleaseScene(self.0) }
    }
}

/// A geometry.
pub(super) struct GeometryHandle(RTCGeometry);

// SAFETY: as for `SceneHandle`.
unsafe impl Send for GeometryHandle {}
// SAFETY: as for `SceneHandle`.
unsafe impl Sync for GeometryHandle {}

impl GeometryHandle {
    #[inline]
    pub(super) fn raw(&self) -> RTCGeometry {
        self.0
    }

    pub(super) fn commit(&mut self) {
        // SAFETY: the geometry lives.
        unsafe { rtcCommitGeometry(self.0) }
    }
}

impl Drop for GeometryHandle {
    fn drop(&mut self) {
        // SAFETY: one reference is ours.
        unsafe { rtcReleaseGeometry(self.0) }
    }
}
