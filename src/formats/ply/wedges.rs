//! Texture coordinates given by corner of a face: vertices are split where they differ.

use crate::base::mesh_data::Positions;
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// Vertices of the file, split by the texture coordinates they have in their faces.
#[derive(Debug)]
pub struct Wedges {
    vertices: u32,
    /// New vertex by vertex of the file and the bits of its texture coordinates.
    known: HashMap<(u32, [u32; 2]), u32>,
    /// Vertex of the file by new vertex.
    sources: Vec<u32>,
    uvs: Vec<[f32; 2]>,
    bad_lists: u64,
}

impl Wedges {
    /// For a file with so many vertices.
    pub fn new(vertices: u32) -> Self {
        Wedges { vertices, known: HashMap::new(), sources: Vec::new(), uvs: Vec::new(), bad_lists: 0 }
    }

    /// Faces whose list had not two numbers a corner; their corners got (0, 0).
    pub fn bad_lists(&self) -> u64 {
        self.bad_lists
    }

    /// Renames the corners of a face (each a vertex of the file) to new vertices. `uvs` holds u, v by corner.
    pub fn split_corners(&mut self, corners: &mut [u32], uvs: &[f64]) {
        let fits = uvs.len() == 2 * corners.len();
        if !fits {
            self.bad_lists += 1;
        }
        for (i, corner) in corners.iter_mut().enumerate() {
            debug_assert!(*corner < self.vertices);
            let uv = if fits { [uvs[2 * i] as f32, uvs[2 * i + 1] as f32] } else { [0.0; 2] };
            let new = self.sources.len() as u32;
            *corner = match self.known.entry((*corner, uv.map(f32::to_bits))) {
                Entry::Occupied(entry) => *entry.get(),
                Entry::Vacant(entry) => {
                    self.sources.push(*corner);
                    self.uvs.push(uv);
                    *entry.insert(new)
                }
            };
        }
    }

    /// Turns the arrays by vertex of the file into arrays by new vertex.
    pub fn split_vertices(
        self,
        positions: &mut Positions,
        normals: &mut Vec<[f32; 3]>,
        uvs: &mut Vec<[f32; 2]>,
    ) {
        fn gather<T: Copy>(all: &[T], sources: &[u32]) -> Vec<T> {
            sources.iter().map(|&i| all[i as usize]).collect()
        }
        *positions = match positions {
            Positions::F32(p) => Positions::F32(gather(p, &self.sources)),
            Positions::F64(p) => Positions::F64(gather(p, &self.sources)),
        };
        if !normals.is_empty() {
            *normals = gather(normals, &self.sources);
        }
        *uvs = self.uvs;
    }
}
