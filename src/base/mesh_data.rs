//! A triangle mesh as a file gives it: plain data, positions in the file's own precision.

use std::path::PathBuf;

/// Vertex positions in the precision of their file. Double precision is kept until a mesh is recentred, so that
/// a georeferenced mesh (coordinates of 4e6) renders as its local twin.
#[derive(Debug, Clone, PartialEq)]
pub enum Positions {
    /// As stored by a file of single precision.
    F32(Vec<[f32; 3]>),
    /// As stored, or parsed from text, in double precision.
    F64(Vec<[f64; 3]>),
}

impl Positions {
    /// The number of vertices.
    pub fn len(&self) -> usize {
        match self {
            Positions::F32(v) => v.len(),
            Positions::F64(v) => v.len(),
        }
    }

    /// Whether there is no vertex.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Vertex `i` in double precision.
    #[inline]
    pub fn get(&self, i: usize) -> glam::DVec3 {
        match self {
            Positions::F32(v) => glam::Vec3::from_array(v[i]).as_dvec3(),
            Positions::F64(v) => glam::DVec3::from_array(v[i]),
        }
    }
}

/// What a material library says of a group of faces (OBJ's MTL): the few facts every renderer shares.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MeshMaterial {
    /// Name in the file.
    pub name: String,
    /// Diffuse reflectance, linear Rec. 709.
    pub diffuse: Option<[f32; 3]>,
    /// Picture of diffuse reflectance; the path is already resolved against the mesh's folder.
    pub diffuse_map: Option<PathBuf>,
}

/// Counts of what a loader mended or passed over, for one warning line; all zero for a clean file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Repairs {
    /// Polygons with more than three corners that were cut into triangles.
    pub triangulated: u64,
    /// Faces left out: fewer than three corners, or an index out of range.
    pub bad_faces: u64,
    /// Points, lines and other elements that are no surface.
    pub not_surface: u64,
    /// Normals that were not finite or were zero and are now computed from the faces.
    pub bad_normals: u64,
    /// Attributes dropped for having the wrong count (uvs, normals).
    pub bad_attributes: u64,
}

/// Triangles with shared vertices. `indices` are all below `positions.len()` (the loaders guarantee it); normals
/// and uvs, where present, have one entry per vertex. Positions may still be non-finite: validity of primitives is
/// decided once, when the geometry for the kernels is built.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshData {
    /// Vertex positions, in the file's units.
    pub positions: Positions,
    /// Shading normals, one per vertex, any length; empty if the file has none.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates, one per vertex, v up; empty if the file has none.
    pub uvs: Vec<[f32; 2]>,
    /// Three vertex indices a triangle.
    pub indices: Vec<[u32; 3]>,
    /// For each triangle the index of its entry in `materials`; empty if there is at most one material.
    pub material_ids: Vec<u16>,
    /// Materials the file names; may be empty.
    pub materials: Vec<MeshMaterial>,
    /// What was mended while loading.
    pub repairs: Repairs,
}
