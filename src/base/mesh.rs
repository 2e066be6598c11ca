//! A triangle mesh ready for kernels: single precision, recentred, only valid triangles.

/// Triangles in the space of their group. Made by the scene builder from [`super::mesh_data::MeshData`]:
/// every index is in range, every vertex of a triangle is finite, no triangle is degenerate.
#[derive(Debug, Clone, Default)]
pub struct TriangleMesh {
    /// Vertex positions and, after them, one entry of padding: kernels read 16 bytes from a vertex' start.
    positions: Vec<[f32; 3]>,
    /// Three vertex indices a triangle.
    pub indices: Vec<[u32; 3]>,
    /// Unit shading normals by vertex; empty if flat.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates by vertex, v up; empty if none.
    pub uvs: Vec<[f32; 2]>,
    /// Triangle number in the source by triangle; empty where it is the same number.
    pub source_ids: Vec<u32>,
    /// Material slot by triangle; empty where all have slot 0.
    pub material_slots: Vec<u16>,
}

impl TriangleMesh {
    /// From positions and indices; the padding is added here.
    pub fn new(mut positions: Vec<[f32; 3]>, indices: Vec<[u32; 3]>) -> Self {
        positions.reserve_exact(1);
        positions.push([0.0; 3]);
        TriangleMesh { positions, indices, ..TriangleMesh::default() }
    }

    /// Vertex positions without the padding.
    #[inline]
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions[..self.positions.len().saturating_sub(1)]
    }

    /// Vertex positions with one entry of padding at the end, for kernels.
    pub fn padded_positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// The corners of a triangle.
    #[inline]
    pub fn corners(&self, triangle: u32) -> [glam::Vec3; 3] {
        // Written out: array::map is not always inlined, and this is read for every hit.
        let [a, b, c] = self.indices[triangle as usize];
        let vertex = |i: u32| glam::Vec3::from_array(self.positions[i as usize]);
        [vertex(a), vertex(b), vertex(c)]
    }

    /// The shading normals at the corners of a triangle, which must not be flat.
    #[inline]
    pub fn corner_normals(&self, triangle: u32) -> [glam::Vec3; 3] {
        let [a, b, c] = self.indices[triangle as usize];
        let normal = |i: u32| glam::Vec3::from_array(self.normals[i as usize]);
        [normal(a), normal(b), normal(c)]
    }

    /// Bytes of all arrays.
    pub fn memory(&self) -> u64 {
        (size_of_val(&self.positions[..])
            + size_of_val(&self.indices[..])
            + size_of_val(&self.normals[..])
            + size_of_val(&self.uvs[..])
            + size_of_val(&self.source_ids[..])
            + size_of_val(&self.material_slots[..])) as u64
    }
}
