//! Wavefront OBJ.
//!
//! All groups and objects become one mesh; `usemtl` becomes material ids. Polygons are cut into triangles, concave
//! ones too. Corners that share position, texture coordinate and normal share a vertex; vertices that no face uses
//! are left out. Where only some corners have a normal, the others get one computed from the faces; where only some
//! have texture coordinates, the others get (0, 0). References to either where the file has none are left out. Points, lines and free-form elements are counted and left out.
//!
//! An index out of range, or 0, is an error with its place: the file is damaged, and guessing would hide it.
//!
//! A file is read in blocks of whole statements, several at a time by as many threads as the current pool has, and
//! the text of those done is given up at once: memory holds the tables and not the file. The steps, a room each:
//! `blocks`, `statements` (with `numbers` and `corners`), `tables`, `join`.

mod blocks;
mod columns;
mod corners;
mod face_materials;
mod join;
mod mtl;
mod numbers;
mod statements;
mod tables;

use crate::base::mesh_data::{MeshData, Positions, Repairs};
use crate::error::{Error, Result};
use crate::formats::source::Source;
use crate::formats::triangulate::Triangulator;
use crate::memory;
use blocks::Blocks;
use face_materials::Run;
use glam::DVec3;
use join::Joined;
use mtl::MaterialTable;
use rayon::prelude::*;
use std::path::Path;
use tables::Tables;

/// Reads an OBJ file from memory; `path` is for messages and for the folder in which its material libraries are.
/// A library that cannot be read is a logged warning.
///
/// # Errors
/// [`Error::Content`] with the place of what is no OBJ, and where there is no face.
pub fn parse(path: &Path, bytes: &[u8]) -> Result<MeshData> {
    read(path, Source::of_bytes(path, bytes))
}

/// As [`parse`], with a material library from memory for all that the file names, whatever their names.
///
/// # Errors
/// As [`parse`].
pub fn parse_with_library(path: &Path, bytes: &[u8], library: &[u8]) -> Result<MeshData> {
    read_blocks(path, Blocks::new(Source::of_bytes(path, bytes)), Some(library))
}

/// As [`parse`], from a file.
///
/// # Errors
/// As [`parse`], and those of reading.
pub fn read(path: &Path, source: Source) -> Result<MeshData> {
    read_blocks(path, Blocks::new(source), None)
}

fn read_blocks(path: &Path, blocks: Blocks, library: Option<&[u8]>) -> Result<MeshData> {
    let tables = Tables::read(path, blocks)?;
    if tables.arities.faces == 0 {
        return Err(Error::content(path, no_surface(&tables)));
    }
    let _room = memory::room(bytes_to_assemble(&tables), || format!("{}: the mesh", path.display()))?;
    Ok(assemble(path, tables, library))
}

fn no_surface(tables: &Tables) -> String {
    let (points, others) = (tables.positions.len(), tables.repairs.not_surface);
    match points {
        0 => "it holds no vertices and no faces".to_string(),
        _ => format!(
            "it holds {points} points, {others} points and lines as elements, and no faces; a surface is needed"
        ),
    }
}

/// About what the mesh takes beside the tables: a number for each corner and position, and the vertices.
fn bytes_to_assemble(tables: &Tables) -> u64 {
    let [positions, uvs, normals] = tables.counts();
    let corners = tables.corners.len();
    (12 * corners + (4 + 24) * positions + 8 * uvs + 12 * normals) as u64
}

/// Makes the mesh of what stands in the file, giving up each table when its part is made.
fn assemble(path: &Path, tables: Tables, library: Option<&[u8]>) -> MeshData {
    let Tables { positions, uvs, normals, mut corners, arities, materials, libraries, mut repairs, .. } =
        tables;
    let count = corners.len();
    let mut has = [false; 2];
    for (kind, defined) in [uvs.len(), normals.len()].into_iter().enumerate() {
        let given = corners.given(kind);
        has[kind] = given > 0 && defined > 0;
        let changed = match kind {
            _ if !has[kind] => given,
            // Filled in; normals that are filled in are counted where they are computed.
            0 => count - given,
            _ => 0,
        };
        repairs.bad_attributes += changed as u64;
        if !has[kind] {
            corners.attributes[kind] = Default::default();
        }
    }
    let joined = join::join(corners, positions.len());
    let positions = gather(positions, &joined.positions);
    let uvs = attribute(uvs, has[0], &joined, 0);
    let normals = attribute(normals, has[1], &joined, 1);
    let Joined { indices, .. } = joined;
    let names = materials.names();
    let runs = if names.len() > 1 { materials.runs() } else { &[] };
    let faces = Faces { corners: indices, arities: arities.list };
    let (indices, material_ids) = faces.triangulate(&positions, runs, &mut repairs);
    let mut mesh = MeshData {
        positions: Positions::F64(positions),
        normals,
        uvs,
        indices,
        material_ids,
        materials: MaterialTable::load(path, &libraries, library, names).materials,
        repairs,
    };
    if mesh.materials.len() <= 1 {
        // Faces under no material at all need no entry.
        mesh.materials.retain(|m| !m.name.is_empty());
    }
    mesh.mend_normals();
    mesh
}

/// `values` in the order of vertices.
fn gather<T: Copy + Send + Sync>(values: Vec<T>, order: &[u32]) -> Vec<T> {
    order.par_iter().map(|&i| values[i as usize]).collect()
}

/// One value of an attribute for each vertex, zeros where a vertex has none; nothing if no vertex has one.
fn attribute<T: Copy + Default + Send + Sync>(
    values: Vec<T>,
    has: bool,
    joined: &Joined,
    kind: usize,
) -> Vec<T> {
    if !has {
        return Vec::new();
    }
    if joined.attributes.is_empty() {
        return gather(values, &joined.positions);
    }
    let value = |numbers: &[u32; 2]| match numbers[kind] {
        0 => T::default(),
        number => values[number as usize - 1],
    };
    joined.attributes.par_iter().map(value).collect()
}

/// Faces as the file has them.
struct Faces {
    /// Vertices, one face after another.
    corners: Vec<u32>,
    /// Corners by face; empty if all are triangles.
    arities: Vec<u32>,
}

impl Faces {
    /// Triangles, and the material of each as `runs` say.
    fn triangulate(
        self,
        positions: &[[f64; 3]],
        runs: &[Run],
        repairs: &mut Repairs,
    ) -> (Vec<[u32; 3]>, Vec<u16>) {
        let mut materials = Vec::new();
        if self.arities.is_empty() {
            for run in runs {
                materials.resize(materials.len() + run.faces, run.material);
            }
            return (self.corners.as_chunks().0.to_vec(), materials);
        }
        let mut cutter = Triangulator::default();
        let mut triangles = Vec::with_capacity(self.corners.len() - 2 * self.arities.len());
        let mut corners = &self.corners[..];
        let mut arities = self.arities.iter();
        let mut cut = |faces: usize, triangles: &mut Vec<[u32; 3]>| {
            for &arity in arities.by_ref().take(faces) {
                let (face, rest) = corners.split_at(arity as usize);
                corners = rest;
                repairs.triangulated += u64::from(arity > 3);
                cutter.cut(face, |i| DVec3::from_array(positions[i as usize]), triangles);
            }
        };
        for run in runs {
            cut(run.faces, &mut triangles);
            materials.resize(triangles.len(), run.material);
        }
        cut(usize::MAX, &mut triangles);
        (triangles, materials)
    }
}

#[cfg(test)]
mod tests;
