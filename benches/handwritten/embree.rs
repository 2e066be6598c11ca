//! What the hand-written kernel asks of Embree: one robust mesh, closest hits and any hits of rays in plain arrays.

use embree_sys::*;
use skylit::base::mesh::TriangleMesh;
use std::ptr;

/// Rays a call: Embree's streams sort that many.
pub const CALL: usize = 1024;

/// Rays as columns of [`CALL`] entries.
pub struct Rays {
    pub o: [Vec<f32>; 3],
    pub d: [Vec<f32>; 3],
    tnear: Vec<f32>,
    tfar: Vec<f32>,
}

impl Default for Rays {
    fn default() -> Self {
        let column = |v: f32| vec![v; CALL];
        Rays {
            o: [(); 3].map(|()| column(0.0)),
            d: [(); 3].map(|()| column(0.0)),
            tnear: column(0.0),
            tfar: column(0.0),
        }
    }
}

impl Rays {
    fn columns(&mut self, n: usize) -> EmRays {
        assert!(n <= CALL);
        self.tfar[..n].fill(f32::INFINITY);
        let [org_x, org_y, org_z] = self.o.each_ref().map(|c| c[..n].as_ptr());
        let [dir_x, dir_y, dir_z] = self.d.each_ref().map(|c| c[..n].as_ptr());
        let (tnear, tfar) = (self.tnear[..n].as_ptr(), self.tfar[..n].as_mut_ptr());
        EmRays { org_x, org_y, org_z, tnear, dir_x, dir_y, dir_z, id: ptr::null(), tfar }
    }

    /// Whether [`Mesh::any`] found something.
    pub fn is_blocked(&self, i: usize) -> bool {
        self.tfar[i] == f32::NEG_INFINITY
    }
}

/// Closest hits as columns of [`CALL`] entries.
pub struct Hits {
    /// The triangle; [`INVALID_ID`] where nothing was hit, and then the rest means nothing.
    pub prim: Vec<u32>,
    /// Weights of the second and third corner.
    pub uv: [Vec<f32>; 2],
    geom: Vec<u32>,
    inst: Vec<u32>,
}

impl Default for Hits {
    fn default() -> Self {
        let ids = || vec![INVALID_ID; CALL];
        Hits { prim: ids(), uv: [(); 2].map(|()| vec![0.0; CALL]), geom: ids(), inst: ids() }
    }
}

/// A committed scene of one mesh.
pub struct Mesh {
    device: RTCDevice,
    scene: RTCScene,
    /// Positions, with one more as padding.
    pub positions: Vec<[f32; 3]>,
    pub indices: Vec<[u32; 3]>,
    pub normals: Vec<[f32; 3]>,
}

// SAFETY: a committed scene may be queried from any thread (API manual, rtcIntersect1).
unsafe impl Sync for Mesh {}

impl Mesh {
    pub fn new(mesh: &TriangleMesh) -> Self {
        let (positions, indices) = (mesh.padded_positions().to_vec(), mesh.indices.clone());
        let (vertices, triangles) = (positions.len() - 1, indices.len());
        // SAFETY: the arrays live as long as the scene, hold as many entries as is said, and positions are padded.
        unsafe {
            let device = rtcNewDevice(ptr::null());
            let scene = rtcNewScene(device);
            let g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
            let (p, i) = (positions.as_ptr().cast(), indices.as_ptr().cast());
            rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, p, 0, 12, vertices);
            rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, i, 0, 12, triangles);
            rtcCommitGeometry(g);
            rtcAttachGeometryByID(scene, g, 0);
            rtcReleaseGeometry(g);
            rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
            rtcCommitScene(scene);
            Mesh { device, scene, positions, indices, normals: mesh.normals.clone() }
        }
    }

    /// Closest hits of the first `n` rays, which are coherent.
    pub fn closest(&self, rays: &mut Rays, n: usize, hits: &mut Hits) {
        let em = rays.columns(n);
        hits.prim[..n].fill(INVALID_ID);
        let [u, v] = hits.uv.each_mut().map(|c| c.as_mut_ptr());
        let (prim, geom, inst) = (hits.prim.as_mut_ptr(), hits.geom.as_mut_ptr(), hits.inst.as_mut_ptr());
        let to = EmHits { u, v, primID: prim, geomID: geom, instID: inst };
        let mut query = EmQuery::new(true, ptr::null_mut());
        // SAFETY: committed scene; columns of n <= CALL entries; rays are finite, as the camera and the mesh are.
        unsafe { em_intersect_soa(self.scene, &mut query, &em, &to, n as u32) };
    }

    /// Any hits of the first `n` rays, which are not coherent; see [`Rays::is_blocked`].
    pub fn any(&self, rays: &mut Rays, n: usize) {
        let em = rays.columns(n);
        let mut query = EmQuery::new(false, ptr::null_mut());
        // SAFETY: as in `closest`.
        unsafe { em_occluded_soa(self.scene, &mut query, &em, n as u32) };
    }
}

impl Drop for Mesh {
    fn drop(&mut self) {
        // SAFETY: one reference of each is ours.
        unsafe {
            rtcReleaseScene(self.scene);
            rtcReleaseDevice(self.device);
        }
    }
}
