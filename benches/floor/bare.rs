//! Embree without anything around it: one robust scene of a scene's meshes, and the fastest calls for batches.

use embree_sys::*;
use skylit::base::ray::RayBatch;
use skylit::scene::Scene;
use std::ptr;

/// Rays a call, as in skylit's kernel.
const CALL: usize = 1024;

/// Positions, padded, and indices of a mesh.
type Arrays = (Vec<[f32; 3]>, Vec<[u32; 3]>);

/// An Embree scene of all meshes of the root group, and what it points into.
pub struct Bare {
    device: RTCDevice,
    scene: RTCScene,
    _arrays: Vec<Arrays>,
}

// SAFETY: a committed scene may be queried from any thread (API manual, rtcIntersect1).
unsafe impl Sync for Bare {}

/// Where results go.
pub struct Room {
    t: Vec<f32>,
    uv: [Vec<f32>; 2],
    ids: [Vec<u32>; 3],
}

impl Default for Room {
    fn default() -> Self {
        Room {
            t: vec![0.0; CALL],
            uv: [(); 2].map(|()| vec![0.0; CALL]),
            ids: [(); 3].map(|()| vec![0; CALL]),
        }
    }
}

impl Bare {
    /// # Panics
    /// If the scene has anything but meshes in its root group.
    pub fn new(scene: &Scene) -> Self {
        let root = scene.geometry.root();
        assert!(root.children.is_empty(), "the floor is taken of scenes without nested groups");
        let arrays: Vec<_> = root
            .leaves
            .iter()
            .map(|l| {
                let mesh = l.shape.triangles().expect("the floor is taken of meshes");
                (mesh.padded_positions().to_vec(), mesh.indices.clone())
            })
            .collect();
        // SAFETY: the arrays live as long as the scene, hold as many entries as is said, and positions are padded.
        unsafe {
            let device = rtcNewDevice(ptr::null());
            let scene = rtcNewScene(device);
            for (id, (positions, indices)) in arrays.iter().enumerate() {
                let g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
                let (p, i) = (positions.as_ptr().cast(), indices.as_ptr().cast());
                let (v, n) = (RTC_BUFFER_TYPE_VERTEX, positions.len() - 1);
                rtcSetSharedGeometryBuffer(g, v, 0, RTC_FORMAT_FLOAT3, p, 0, 12, n);
                rtcSetSharedGeometryBuffer(
                    g,
                    RTC_BUFFER_TYPE_INDEX,
                    0,
                    RTC_FORMAT_UINT3,
                    i,
                    0,
                    12,
                    indices.len(),
                );
                rtcCommitGeometry(g);
                rtcAttachGeometryByID(scene, g, id as u32);
                rtcReleaseGeometry(g);
            }
            rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
            rtcCommitScene(scene);
            Bare { device, scene, _arrays: arrays }
        }
    }

    /// Closest hits of coherent rays.
    pub fn closest(&self, rays: &RayBatch, room: &mut Room) {
        for first in (0..rays.len()).step_by(CALL) {
            let n = CALL.min(rays.len() - first);
            room.ids[0].fill(INVALID_ID);
            let em = columns(rays, first, n, &mut room.t);
            let [u, v] = room.uv.each_mut().map(|c| c.as_mut_ptr());
            let [prim, geom, inst] = room.ids.each_mut().map(|c| c.as_mut_ptr());
            let hits = EmHits { u, v, primID: prim, geomID: geom, instID: inst };
            let mut query = EmQuery::new(true, ptr::null_mut());
            // SAFETY: committed scene; columns of n entries; the rays are those of a render, so finite.
            unsafe { em_intersect_soa(self.scene, &mut query, &em, &hits, n as u32) };
        }
    }

    /// Any hits of incoherent rays.
    pub fn any(&self, rays: &RayBatch, room: &mut Room) {
        for first in (0..rays.len()).step_by(CALL) {
            let n = CALL.min(rays.len() - first);
            let em = columns(rays, first, n, &mut room.t);
            let mut query = EmQuery::new(false, ptr::null_mut());
            // SAFETY: as above.
            unsafe { em_occluded_soa(self.scene, &mut query, &em, n as u32) };
        }
    }
}

fn columns(rays: &RayBatch, first: usize, n: usize, t: &mut [f32]) -> EmRays {
    t[..n].copy_from_slice(&rays.tfar[first..first + n]);
    let at = |c: &Vec<f32>| c[first..first + n].as_ptr();
    EmRays {
        org_x: at(&rays.ox),
        org_y: at(&rays.oy),
        org_z: at(&rays.oz),
        tnear: at(&rays.tnear),
        dir_x: at(&rays.dx),
        dir_y: at(&rays.dy),
        dir_z: at(&rays.dz),
        id: ptr::null(),
        tfar: t.as_mut_ptr(),
    }
}

impl Drop for Bare {
    fn drop(&mut self) {
        // SAFETY: one reference of each is ours.
        unsafe {
            rtcReleaseScene(self.scene);
            rtcReleaseDevice(self.device);
        }
    }
}
