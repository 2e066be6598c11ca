//! Vertices and triangles as they come, gathered into meshes.

use super::statements::Statement;
use crate::base::mesh_data::{MeshData, Positions, Repairs};
use crate::error::Result;

/// Vertices, and the triangles since the last mesh was taken.
#[derive(Default)]
pub struct Soup {
    flat: Corners,
    smooth: Corners,
}

/// Vertices of one kind and triangles between them.
#[derive(Default)]
struct Corners {
    positions: Vec<[f64; 3]>,
    /// As many as positions, or none.
    normals: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    /// By vertex, the mesh that used it last and its number there: so that a mesh costs what it holds, however many
    /// vertices the file has.
    used: Vec<(u32, u32)>,
    meshes: u32,
}

impl Soup {
    /// Commands that [`Soup::apply`] takes.
    pub const WORDS: [&'static str; 4] = ["vertex", "vertexnormal", "tri", "trinormal"];

    /// Does what a statement says; false if it is none of [`Soup::WORDS`].
    pub fn apply(&mut self, s: &mut Statement) -> Result<bool> {
        match s.word {
            "vertex" => self.flat.positions.push(s.vector()?),
            "vertexnormal" => {
                self.smooth.positions.push(s.vector()?);
                self.smooth.normals.push(s.vector()?.map(|x| x as f32));
            }
            "tri" => self.flat.triangle(s)?,
            "trinormal" => self.smooth.triangle(s)?,
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Makes room for so many vertices; a file's word is not trusted beyond its own size in bytes.
    pub fn reserve(&mut self, vertices: usize, file_bytes: usize) {
        self.flat.positions.reserve(vertices.min(file_bytes / 8));
    }

    /// Whether there are triangles that no mesh has taken.
    pub fn has_triangles(&self) -> bool {
        !self.flat.triangles.is_empty() || !self.smooth.triangles.is_empty()
    }

    /// The triangles since the last time as meshes: those without normals, those with.
    pub fn take(&mut self) -> impl Iterator<Item = MeshData> {
        [self.flat.take(), self.smooth.take()].into_iter().flatten()
    }
}

impl Corners {
    fn triangle(&mut self, s: &mut Statement) -> Result<()> {
        let n = self.positions.len();
        self.triangles.push([s.index(n)?, s.index(n)?, s.index(n)?]);
        Ok(())
    }

    fn take(&mut self) -> Option<MeshData> {
        if self.triangles.is_empty() {
            return None;
        }
        self.meshes += 1;
        self.used.resize(self.positions.len(), (0, 0));
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        let mut indices = std::mem::take(&mut self.triangles);
        for i in indices.iter_mut().flatten() {
            let old = *i as usize;
            let (mesh, number) = &mut self.used[old];
            if *mesh != self.meshes {
                (*mesh, *number) = (self.meshes, positions.len() as u32);
                positions.push(self.positions[old]);
                normals.extend(self.normals.get(old));
            }
            *i = *number;
        }
        Some(MeshData {
            positions: Positions::F64(positions),
            normals,
            uvs: Vec::new(),
            indices,
            material_ids: Vec::new(),
            materials: Vec::new(),
            repairs: Repairs::default(),
        })
    }
}
