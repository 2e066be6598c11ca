//! A triangle mesh as a file gives it: plain data, positions in the file's own precision.

use glam::DVec3;
use rayon::prelude::*;
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
    /// Faces left out for having fewer than three corners. (An index out of range is an error: the file is damaged.)
    pub bad_faces: u64,
    /// Points, lines and other elements that are no surface.
    pub not_surface: u64,
    /// Normals that were absent at some vertices only, not finite or zero, and are now computed from the faces.
    pub bad_normals: u64,
    /// Corners and records whose attributes are absent, too many or refer to nothing: left out, or zero (uvs).
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

/// Triangles whose corner contributions are held at a time while normals are summed.
const NORMAL_BATCH: usize = 1 << 17;

impl MeshData {
    /// Bytes of all arrays.
    pub fn memory(&self) -> u64 {
        let positions = match &self.positions {
            Positions::F32(p) => size_of_val(&p[..]),
            Positions::F64(p) => size_of_val(&p[..]),
        };
        (positions
            + size_of_val(&self.normals[..])
            + size_of_val(&self.uvs[..])
            + size_of_val(&self.indices[..])
            + size_of_val(&self.material_ids[..])) as u64
    }

    /// Replaces the normals by smooth ones: at each vertex the unit normals of its triangles, weighted by the angle
    /// they span there (Thürmer and Wüthrich, "Computing vertex normals from polygonal facets", 1998), summed in
    /// double precision and in the order of the triangles, so that the result does not depend on the thread count.
    ///
    /// Loaders never do this by themselves: a mesh without normals is flat. Vertices are told apart by index and not
    /// by place, so a file that repeats a vertex for a crease or a texture seam keeps it. Triangles without area or
    /// with a non-finite corner count for nothing. The normal points to the side from which the corners run
    /// counter-clockwise; a vertex of no valid triangle, or whose triangles cancel, gets that of its first valid
    /// triangle, else +y.
    pub fn compute_smooth_normals(&mut self) {
        self.normals = self.smooth_normals();
    }

    /// Gives the smooth normal to vertices whose own is not finite or has no length, and counts them in `repairs`.
    /// All others stay untouched; a mesh without normals stays so.
    pub fn mend_normals(&mut self) {
        let bad = |n: &[f32; 3]| !n.iter().all(|c| c.is_finite()) || n.iter().all(|c| *c == 0.0);
        let count = self.normals.iter().filter(|n| bad(n)).count();
        if count == 0 {
            return;
        }
        let smooth = self.smooth_normals();
        self.normals.iter_mut().zip(smooth).filter(|(n, _)| bad(n)).for_each(|(n, s)| *n = s);
        self.repairs.bad_normals += count as u64;
    }

    fn smooth_normals(&self) -> Vec<[f32; 3]> {
        let mut sums = vec![DVec3::ZERO; self.positions.len()];
        let mut contributions = Vec::new();
        for batch in self.indices.chunks(NORMAL_BATCH) {
            batch.par_iter().map(|t| self.corner_normals(t)).collect_into_vec(&mut contributions);
            for (triangle, normals) in batch.iter().zip(&contributions) {
                for (&vertex, &normal) in triangle.iter().zip(normals) {
                    sums[vertex as usize] += normal;
                }
            }
        }
        let mut normals: Vec<DVec3> = sums.into_par_iter().map(DVec3::normalize_or_zero).collect();
        if normals.contains(&DVec3::ZERO) {
            for triangle in &self.indices {
                for (&vertex, normal) in triangle.iter().zip(self.corner_normals(triangle)) {
                    let slot = &mut normals[vertex as usize];
                    if *slot == DVec3::ZERO {
                        *slot = normal.normalize_or_zero();
                    }
                }
            }
        }
        let or_up = |n: DVec3| if n == DVec3::ZERO { DVec3::Y } else { n };
        normals.into_par_iter().map(|n| or_up(n).as_vec3().to_array()).collect()
    }

    /// The unit normal of a triangle times the angle at each corner; zero if it has none.
    fn corner_normals(&self, triangle: &[u32; 3]) -> [DVec3; 3] {
        let p = triangle.map(|i| self.positions.get(i as usize));
        let edges = [p[1] - p[0], p[2] - p[1], p[0] - p[2]];
        let cross = edges[0].cross(edges[1]);
        let Some(normal) = cross.try_normalize() else { return [DVec3::ZERO; 3] };
        let twice_area = cross.length();
        // atan2 of sine and cosine keeps its digits for angles near 0 and pi, where acos loses half of them.
        [2, 0, 1].map(|before| {
            let cosine = -edges[before].dot(edges[(before + 1) % 3]);
            normal * twice_area.atan2(cosine)
        })
    }
}

impl Repairs {
    /// One line that says what was mended or passed over, or `None` if nothing was. Cutting a polygon into triangles
    /// is no mending.
    pub fn describe(&self) -> Option<String> {
        let entries = [
            (self.bad_faces, "faces with fewer than three corners left out"),
            (self.not_surface, "points, lines and other elements that are no surface left out"),
            (self.bad_normals, "missing, zero or non-finite normals computed from the faces"),
            (self.bad_attributes, "absent or surplus attributes replaced by zero or left out"),
        ];
        let said: Vec<String> =
            entries.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")).collect();
        if said.is_empty() { None } else { Some(said.join("; ")) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mesh(positions: Positions, indices: Vec<[u32; 3]>) -> MeshData {
        MeshData {
            positions,
            normals: vec![],
            uvs: vec![],
            indices,
            material_ids: vec![],
            materials: vec![],
            repairs: Repairs::default(),
        }
    }

    /// The cube [-1, 1]^3, eight vertices, twelve triangles facing outwards; the diagonals are irregular.
    fn cube(offset: f64) -> MeshData {
        let corner = |i: usize| [0, 1, 2].map(|axis| offset + if i >> axis & 1 == 1 { 1.0 } else { -1.0 });
        let quads = [[0u32, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let indices = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        mesh(Positions::F64((0..8).map(corner).collect()), indices)
    }

    #[test]
    fn smooth_normals_of_a_cube_are_its_diagonals() {
        // Angle weights make the result independent of the diagonals: each face counts 90 degrees at each corner.
        // At an offset of 4e6 double precision still holds the edges exactly.
        for offset in [0.0, 4e6] {
            let mut cube = cube(offset);
            cube.compute_smooth_normals();
            for (i, n) in cube.normals.iter().enumerate() {
                let want = (cube.positions.get(i) - DVec3::splat(offset)).normalize().as_vec3();
                // One rounding to f32.
                assert!((glam::Vec3::from(*n) - want).length() < 1.2e-7, "{n:?} {want}");
            }
        }
    }

    #[test]
    fn cancelling_and_isolated_vertices_still_get_a_unit_normal() {
        let corners =
            vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [f32::NAN, 0.0, 0.0], [5.0, 5.0, 5.0]];
        // The same triangle from both sides, one with a NaN corner, one without area.
        let indices = vec![[0, 1, 2], [0, 2, 1], [0, 1, 3], [0, 0, 1]];
        let mut m = mesh(Positions::F32(corners), indices);
        m.compute_smooth_normals();
        assert_eq!(m.normals[..3], [[0.0, 0.0, 1.0]; 3]);
        assert_eq!(m.normals[3..], [[0.0, 1.0, 0.0]; 2]);
    }

    #[test]
    fn only_bad_normals_are_mended() {
        let mut m = cube(0.0);
        m.mend_normals();
        assert!(m.normals.is_empty(), "a mesh without normals stays flat");
        m.normals = vec![[3.0, 0.0, 0.0]; 8];
        m.normals[2] = [0.0; 3];
        m.normals[5] = [f32::NAN, 1.0, 0.0];
        m.mend_normals();
        assert_eq!(m.repairs.bad_normals, 2);
        let smooth = m.smooth_normals();
        for (i, n) in smooth.into_iter().enumerate() {
            assert_eq!(m.normals[i], if i == 2 || i == 5 { n } else { [3.0, 0.0, 0.0] });
        }
        assert!(m.repairs.describe().unwrap().starts_with("2 missing"));
    }
}
