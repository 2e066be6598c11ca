//! Shading normals from the faces around a vertex.

use crate::base::mesh::TriangleMesh;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// A unit normal by vertex; zero for vertices of no triangle.
///
/// Each face counts by its cross product over the squared lengths of the two edges at the vertex: exact on a sphere,
/// and without trigonometry (Max, "Weights for computing vertex normals from facet normals", JGT 4(2), 1999).
pub fn smooth_normals(mesh: &TriangleMesh) -> Vec<[f32; 3]> {
    let vertices = mesh.positions().len();
    let mut normals = vec![[0f32; 3]; vertices];
    // Each task owns a range of vertices and reads all triangles, so that the order of sums, and with it every
    // bit, is the same for any number of threads. More than a few tasks would only read more.
    let tasks = rayon::current_num_threads().clamp(1, 8);
    let range = vertices.div_ceil(tasks).max(1);
    normals.par_chunks_mut(range).enumerate().for_each(|(task, own)| {
        let first = (task * range) as u32;
        let end = first + own.len() as u32;
        for t in &mesh.indices {
            if t.iter().any(|i| (first..end).contains(i)) {
                add_face(mesh, t, first, own);
            }
        }
        for n in own {
            let v = Vec3::from_array(*n).as_dvec3();
            *n = v.try_normalize().unwrap_or(DVec3::ZERO).as_vec3().to_array();
        }
    });
    normals
}

fn add_face(mesh: &TriangleMesh, t: &[u32; 3], first: u32, own: &mut [[f32; 3]]) {
    let p = t.map(|i| Vec3::from_array(mesh.positions()[i as usize]).as_dvec3());
    let n = (p[1] - p[0]).cross(p[2] - p[0]);
    let edges = [(p[1] - p[0]), (p[2] - p[1]), (p[0] - p[2])].map(|e| e.length_squared());
    for (k, &i) in t.iter().enumerate() {
        if i.wrapping_sub(first) < own.len() as u32 {
            let w = n / (edges[k] * edges[(k + 2) % 3]);
            // The weight goes with one over the squared size of the face: kept inside f32 for any size.
            let w = w.clamp(DVec3::splat(-1e30), DVec3::splat(1e30)).as_vec3();
            let a = &mut own[(i - first) as usize];
            *a = (Vec3::from_array(*a) + w).to_array();
        }
    }
}
