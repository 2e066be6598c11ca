//! Owners of Embree objects, generated meshes and rays.

use embree_sys::*;
use std::ffi::CStr;
use std::ptr;

/// A device, released at the end of the test.
pub struct Device(pub RTCDevice);

impl Device {
    pub fn new() -> Self {
        Self::configured(c"").expect("the default device")
    }

    /// `None` if this CPU, or this build of Embree, does not know the configuration.
    pub fn configured(config: &CStr) -> Option<Self> {
        // SAFETY: the configuration is a C string, read during the call.
        let device = unsafe { rtcNewDevice(config.as_ptr()) };
        (!device.is_null()).then_some(Device(device))
    }

    pub fn error(&self) -> RTCError {
        // SAFETY: the device lives.
        unsafe { rtcGetDeviceError(self.0) }
    }

    pub fn scene(&self, geometries: &[RTCGeometry]) -> Scene {
        // SAFETY: device and geometries live; the scene takes its own reference to each geometry.
        unsafe {
            let scene = rtcNewScene(self.0);
            rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
            for (id, &geometry) in geometries.iter().enumerate() {
                rtcCommitGeometry(geometry);
                rtcAttachGeometryByID(scene, geometry, id as u32);
                rtcReleaseGeometry(geometry);
            }
            rtcCommitScene(scene);
            Scene(scene)
        }
    }

    pub fn mesh(&self, vertices: &[[f32; 3]], indices: &[[u32; 3]]) -> RTCGeometry {
        // SAFETY: the buffers outlive the scene in every test, and the last vertex is padding.
        unsafe {
            let mesh = rtcNewGeometry(self.0, RTC_GEOMETRY_TYPE_TRIANGLE);
            let (v, i) = (vertices.as_ptr().cast(), indices.as_ptr().cast());
            let n = vertices.len() - 1;
            rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, v, 0, 12, n);
            let n = indices.len();
            rtcSetSharedGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, i, 0, 12, n);
            mesh
        }
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: made by rtcNewDevice; scenes hold their own references.
        unsafe { rtcReleaseDevice(self.0) }
    }
}

pub struct Scene(pub RTCScene);

impl Scene {
    pub fn closest(&self, ray: RTCRay) -> RTCRayHit {
        let mut rayhit = RTCRayHit { ray, hit: no_hit() };
        // SAFETY: the scene is committed and the ray finite.
        unsafe { em_intersect1(self.0, &mut EmQuery::new(false, ptr::null_mut()), &mut rayhit) };
        rayhit
    }

    pub fn is_occluded(&self, mut ray: RTCRay) -> bool {
        // SAFETY: as above.
        unsafe { em_occluded1(self.0, &mut EmQuery::new(false, ptr::null_mut()), &mut ray) };
        ray.tfar == f32::NEG_INFINITY
    }
}

impl Drop for Scene {
    fn drop(&mut self) {
        // SAFETY: made by rtcNewScene.
        unsafe { rtcReleaseScene(self.0) }
    }
}

pub fn zeroed<T>() -> T {
    // SAFETY: used for Embree's records of numbers alone.
    unsafe { std::mem::zeroed() }
}

pub fn no_hit() -> RTCHit {
    let mut hit: RTCHit = zeroed();
    (hit.geomID, hit.primID, hit.instID[0]) = (INVALID_ID, INVALID_ID, INVALID_ID);
    hit
}

pub fn ray(org: [f32; 3], dir: [f32; 3]) -> RTCRay {
    let mut ray: RTCRay = zeroed();
    [ray.org_x, ray.org_y, ray.org_z] = org;
    [ray.dir_x, ray.dir_y, ray.dir_z] = dir;
    (ray.tfar, ray.mask) = (f32::INFINITY, u32::MAX);
    ray
}

/// The unit right triangle at z = 0, and a vertex of padding.
pub const TRIANGLE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3]];

/// A bumpy sheet of 2 n^2 triangles over [-1, 1]^2, with a vertex of padding.
pub fn sheet(n: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let at = |i: u32| 2.0 * i as f32 / n as f32 - 1.0;
    let mut vertices: Vec<_> = (0..=n)
        .flat_map(|j| (0..=n).map(move |i| (at(i), at(j))))
        .map(|(x, y)| [x, y, 0.2 * (5.0 * x).sin() * (7.0 * y).cos()])
        .collect();
    vertices.push([0.0; 3]);
    let corner = |i: u32, j: u32| j * (n + 1) + i;
    let indices = (0..n)
        .flat_map(|j| (0..n).map(move |i| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    (vertices, indices)
}

/// Rays from a sphere of radius 3 to scattered points; some miss the sheet.
pub fn scattered_rays(n: usize) -> Vec<RTCRay> {
    let mut state = 1u64;
    let mut uniform = move || {
        // Constants of Knuth's MMIX generator; the high bits are good enough to scatter rays.
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 40) as f32 / (1u64 << 24) as f32 * 2.0 - 1.0
    };
    (0..n)
        .map(|_| {
            let (from, to) = ([uniform(), uniform(), 3.0], [1.5 * uniform(), 1.5 * uniform(), 0.0]);
            ray(from, [to[0] - from[0], to[1] - from[1], to[2] - from[2]])
        })
        .collect()
}
