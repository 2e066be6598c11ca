//! Placing a mesh: the one step from double to single precision, and the one decision on what is a triangle.

use super::Normals;
use super::shape::MeshShape;
use super::smooth::smooth_normals;
use crate::base::mesh::TriangleMesh;
use crate::base::mesh_data::{MeshData, Positions};
use crate::base::ray::MAX_COORDINATE;
use crate::base::shape::Dropped;
use crate::error::{Error, Result};
use crate::math::aabb::{Aabb, DAabb};
use crate::memory;
use glam::{DAffine3, DMat3, DVec3, Vec3};
use rayon::prelude::*;
use std::sync::Arc;

/// Items a task takes at a time: enough to hide the cost of a task, few enough to share out evenly.
const GRAIN: usize = 1 << 14;

/// The arrays of a mesh, owned.
pub struct Parts {
    /// See [`MeshData::positions`].
    pub positions: Positions,
    /// Empty where none are wanted.
    pub normals: Vec<[f32; 3]>,
    /// See [`MeshData::uvs`].
    pub uvs: Vec<[f32; 2]>,
    /// See [`MeshData::indices`].
    pub indices: Vec<[u32; 3]>,
    /// See [`MeshData::material_ids`].
    pub slots: Vec<u16>,
}

impl Parts {
    /// Moves the arrays where nobody else holds the mesh, else copies those that are needed.
    ///
    /// # Errors
    /// No room for what is copied.
    pub fn from_shared(data: Arc<MeshData>, normals: Normals) -> Result<Self> {
        let wanted = normals == Normals::File;
        Ok(match Arc::try_unwrap(data) {
            Ok(d) => Parts {
                positions: d.positions,
                normals: if wanted { d.normals } else { Vec::new() },
                uvs: d.uvs,
                indices: d.indices,
                slots: d.material_ids,
            },
            Err(d) => {
                let _room = memory::room(d.memory(), || "a copy of a mesh".into())?;
                Parts {
                    positions: d.positions.clone(),
                    normals: if wanted { d.normals.clone() } else { Vec::new() },
                    uvs: d.uvs.clone(),
                    indices: d.indices.clone(),
                    slots: d.material_ids.clone(),
                }
            }
        })
    }
}

/// Calls `f` with every corner of the triangles whose corners are finite.
fn for_each_corner(data: &MeshData, triangles: &[[u32; 3]], mut f: impl FnMut(DVec3)) {
    let count = data.positions.len();
    for t in triangles.iter().filter(|t| t.iter().all(|&i| (i as usize) < count)) {
        let c = t.map(|i| data.positions.get(i as usize));
        if c.iter().all(|p| p.is_finite()) {
            c.into_iter().for_each(&mut f);
        }
    }
}

/// Encloses the triangles whose corners are finite; vertices that no such triangle uses do not count.
pub fn bounds(data: &MeshData) -> DAabb {
    let of = |triangles: &[[u32; 3]]| {
        let mut b = DAabb::EMPTY;
        for_each_corner(data, triangles, |p| b.extend(p));
        b
    };
    data.indices.par_chunks(GRAIN).map(of).reduce(|| DAabb::EMPTY, |a, b| a.union(b))
}

/// The largest p . d of the same triangles for each direction.
pub fn support(data: &MeshData, directions: &[DVec3]) -> Vec<f64> {
    let none = || vec![f64::NEG_INFINITY; directions.len()];
    let of = |triangles: &[[u32; 3]]| {
        let mut most = none();
        for_each_corner(data, triangles, |p| {
            for (m, d) in most.iter_mut().zip(directions) {
                *m = m.max(p.dot(*d));
            }
        });
        most
    };
    let larger = |a: Vec<f64>, b: Vec<f64>| a.into_iter().zip(b).map(|(a, b)| a.max(b)).collect();
    data.indices.par_chunks(GRAIN).map(of).reduce(none, larger)
}

/// A mesh in its group, and what was left out.
pub struct PlacedMesh {
    /// The mesh.
    pub shape: MeshShape,
    /// What was left out.
    pub dropped: Dropped,
}

/// Carries a mesh into its group and drops what is no triangle there.
pub fn place(parts: Parts, normals: Normals, to_group: &DAffine3) -> Result<PlacedMesh> {
    // In single precision, and with normals of its own.
    let each = if normals == Normals::Smooth { 12 + 12 } else { 12 };
    let bytes = each * parts.positions.len() as u64;
    let _room = memory::room(bytes, || format!("a mesh of {} triangles", parts.indices.len()))?;
    let (mut mesh, slots) = carry(parts, normals, to_group)?;
    let dropped = drop_invalid(&mut mesh, slots);
    if normals == Normals::Smooth {
        mesh.normals = smooth_normals(&mesh);
    }
    let bounds = single_bounds(&mesh);
    Ok(PlacedMesh { shape: MeshShape::new(mesh, bounds), dropped })
}

/// A placed mesh after another map, with all of its triangles and their numbers; some may have lost their area.
pub fn transformed(mesh: &TriangleMesh, by: &DAffine3) -> Result<MeshShape> {
    let _room = memory::room(mesh.memory(), || "a copy of a mesh".into())?;
    let parts = Parts {
        positions: Positions::F32(mesh.positions().to_vec()),
        normals: mesh.normals.clone(),
        uvs: mesh.uvs.clone(),
        indices: mesh.indices.clone(),
        slots: Vec::new(),
    };
    let (mut out, _) = carry(parts, Normals::File, by)?;
    out.material_slots = mesh.material_slots.clone();
    out.source_ids = mesh.source_ids.clone();
    let bounds = single_bounds(&out);
    if !bounds.is_empty() && (!bounds.is_finite() || bounds.max_abs() > MAX_COORDINATE) {
        return Err(Error::Usage("a mesh is placed too far from the origin to be represented".into()));
    }
    Ok(MeshShape::new(out, bounds))
}

/// The arrays of a mesh after a map, and its slots; which triangles are valid is still open.
fn carry(parts: Parts, normals: Normals, by: &DAffine3) -> Result<(TriangleMesh, Vec<u16>)> {
    let det = by.matrix3.determinant();
    let inverse = by.matrix3.inverse();
    if !(det.abs() > 0.0 && inverse.is_finite() && by.is_finite()) {
        return Err(Error::Usage(
            "a mesh is placed by a transform that cannot be inverted; scales must be finite and not 0".into(),
        ));
    }
    let mut indices = parts.indices;
    if det < 0.0 {
        // A mirror turns triangles inside out; the other order of corners keeps outward outward.
        indices.par_iter_mut().with_min_len(GRAIN).for_each(|t| t.swap(1, 2));
    }
    let mut mesh = TriangleMesh::new(to_single(parts.positions, by), indices);
    if normals == Normals::File && usable(parts.normals.len(), &mesh) {
        mesh.normals = carry_normals(parts.normals, &inverse.transpose());
    }
    if usable(parts.uvs.len(), &mesh) {
        mesh.uvs = parts.uvs;
    }
    Ok((mesh, parts.slots))
}

/// Whether an attribute has an entry for each vertex.
fn usable(len: usize, mesh: &TriangleMesh) -> bool {
    len > 0 && len == mesh.positions().len()
}

/// Positions after the map, rounded once. Single precision is overwritten in place.
fn to_single(positions: Positions, m: &DAffine3) -> Vec<[f32; 3]> {
    match positions {
        Positions::F32(mut v) => {
            // Nothing changes: do not touch the memory.
            if *m != DAffine3::IDENTITY {
                v.par_iter_mut().with_min_len(GRAIN).for_each(|p| {
                    *p = m.transform_point3(Vec3::from_array(*p).as_dvec3()).as_vec3().to_array();
                });
            }
            v
        }
        Positions::F64(v) => {
            // One entry more, so that the kernels' padding finds room.
            let mut out = Vec::with_capacity(v.len() + 1);
            v.par_iter()
                .with_min_len(GRAIN)
                .map(|p| m.transform_point3(DVec3::from_array(*p)).as_vec3().to_array())
                .collect_into_vec(&mut out);
            out
        }
    }
}

/// Normals go by the inverse transpose. One that comes out without direction becomes zero, which a hit takes as
/// "flat here".
fn carry_normals(mut normals: Vec<[f32; 3]>, inverse_transpose: &DMat3) -> Vec<[f32; 3]> {
    normals.par_iter_mut().with_min_len(GRAIN).for_each(|n| {
        let v = *inverse_transpose * Vec3::from_array(*n).as_dvec3();
        *n = v.try_normalize().unwrap_or(DVec3::ZERO).as_vec3().to_array();
    });
    normals
}

/// Why a triangle is none.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    OutOfRange,
    NotFinite,
    Degenerate,
}

fn fault(t: &[u32; 3], positions: &[[f32; 3]]) -> Option<Fault> {
    if t.iter().any(|&i| i as usize >= positions.len()) {
        return Some(Fault::OutOfRange);
    }
    let [a, b, c] = t.map(|i| Vec3::from_array(positions[i as usize]));
    // NaN fails the comparison.
    let inside = |v: Vec3| v.abs().cmple(Vec3::splat(MAX_COORDINATE)).all();
    if !(inside(a) && inside(b) && inside(c)) {
        return Some(Fault::NotFinite);
    }
    // Products of differences of f32 are exact in f64 unless their sizes differ by more than 2^29.
    let (a, b, c) = (a.as_dvec3(), b.as_dvec3(), c.as_dvec3());
    (b - a).cross(c - a).eq(&DVec3::ZERO).then_some(Fault::Degenerate)
}

fn count_faults(indices: &[[u32; 3]], positions: &[[f32; 3]]) -> Dropped {
    let mut d = Dropped::default();
    for t in indices {
        match fault(t, positions) {
            None => {}
            Some(Fault::OutOfRange) => d.out_of_range += 1,
            Some(Fault::NotFinite) => d.not_finite += 1,
            Some(Fault::Degenerate) => d.degenerate += 1,
        }
    }
    d
}

/// Removes invalid triangles, with the map back to the source's numbers; a clean mesh is only read.
fn drop_invalid(mesh: &mut TriangleMesh, mut slots: Vec<u16>) -> Dropped {
    if slots.len() != mesh.indices.len() {
        slots.clear();
    }
    let dropped = mesh
        .indices
        .par_chunks(GRAIN)
        .map(|chunk| count_faults(chunk, mesh.positions()))
        .reduce(Dropped::default, |a, b| a + b);
    if dropped.total() > 0 {
        let valid: Vec<u32> = (0..mesh.indices.len() as u32)
            .into_par_iter()
            .filter(|&t| fault(&mesh.indices[t as usize], mesh.positions()).is_none())
            .collect();
        mesh.indices = valid.par_iter().map(|&t| mesh.indices[t as usize]).collect();
        if !slots.is_empty() {
            slots = valid.par_iter().map(|&t| slots[t as usize]).collect();
        }
        mesh.source_ids = valid;
    }
    mesh.material_slots = slots;
    dropped
}

fn single_bounds(mesh: &TriangleMesh) -> Aabb {
    let of = |triangles: &[[u32; 3]]| {
        let mut b = Aabb::EMPTY;
        for i in triangles.iter().flatten() {
            b.extend(Vec3::from_array(mesh.positions()[*i as usize]));
        }
        b
    };
    mesh.indices.par_chunks(GRAIN).map(of).reduce(|| Aabb::EMPTY, |a, b| a.union(b))
}
