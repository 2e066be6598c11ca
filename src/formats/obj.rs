//! Wavefront OBJ, by the `tobj` crate in double precision.
//!
//! All groups and objects become one mesh; `usemtl` becomes material ids. Polygons are cut into triangles, concave
//! ones too. Corners that share position, texture coordinate and normal share a vertex; vertices that no face uses
//! are left out. Where only some corners have a normal, the others get one computed from the faces; where only some
//! have texture coordinates, the others get (0, 0). References to either where the file has none are left out. Points, lines and free-form elements are counted and left out.
//!
//! An index out of range, or 0, is an error with its line: the file is damaged, and guessing would hide it.
//!
//! The module `lines` stands between the file and `tobj`: it joins, drops and mends statements, checks every index and counts
//! lines, because `tobj` takes lines for faces, refuses comments behind a face, mixes up corners with and without
//! normals, and says nothing of where an error stands.

mod corners;
mod face_materials;
mod lines;
mod mtl;

use crate::base::mesh_data::{MeshData, Positions, Repairs};
use crate::error::{Error, Result};
use crate::formats::triangulate::Triangulator;
use glam::DVec3;
use lines::{ObjLines, Rewrite};
use mtl::MaterialTable;
use std::borrow::Cow;
use std::path::Path;

/// Reads an OBJ file from memory; `path` is for messages and for the folder in which its material libraries are.
/// A library that cannot be read is a logged warning.
///
/// # Errors
/// [`Error::Content`] with the line for what is no OBJ, and where there is no face.
pub fn parse(path: &Path, bytes: &[u8]) -> Result<MeshData> {
    let bytes = &*with_line_feeds(bytes);
    let mut lines = ObjLines::new(path, bytes, Rewrite::default());
    let mut parsed = run_tobj(&mut lines)?;
    let rewrite = lines.rewrite_needed();
    if rewrite != Rewrite::default() {
        lines = ObjLines::new(path, bytes, rewrite);
        parsed = run_tobj(&mut lines)?;
    }
    if lines.faces() == 0 {
        return Err(Error::content(path, no_surface(&lines)));
    }
    assemble(path, parsed, &lines)
}

/// The text of an old Macintosh, whose lines end in CR alone, with LF instead; any other as it is.
fn with_line_feeds(bytes: &[u8]) -> Cow<'_, [u8]> {
    if bytes.contains(&b'\n') || !bytes.contains(&b'\r') {
        return Cow::Borrowed(bytes);
    }
    Cow::Owned(bytes.iter().map(|&b| if b == b'\r' { b'\n' } else { b }).collect())
}

fn no_surface(lines: &ObjLines) -> String {
    let (points, others) = (lines.positions(), lines.repairs().not_surface);
    match points {
        0 => "it holds no vertices and no faces".to_string(),
        _ => format!(
            "it holds {points} points, {others} points and lines as elements, and no faces; a surface is needed"
        ),
    }
}

fn run_tobj(lines: &mut ObjLines) -> Result<tobj::Mesh> {
    // One index for all attributes, polygons as they are; the materials are not tobj's business.
    let options = tobj::LoadOptions { single_index: true, ..tobj::LoadOptions::default() };
    let loaded = tobj::load_obj_buf(lines, &options, |_| Ok((Vec::new(), Default::default())));
    lines.check()?;
    let (models, _) = loaded.map_err(|e| lines.fail(describe(e)))?;
    // Without groups and materials, which are held back, there is one model.
    Ok(models.into_iter().next().map(|model| model.mesh).unwrap_or_default())
}

fn describe(error: tobj::LoadError) -> String {
    use tobj::LoadError as E;
    match error {
        E::PositionParseError => "a position is \"v x y z\" with three numbers".to_string(),
        E::NormalParseError => "a normal is \"vn x y z\" with three numbers".to_string(),
        E::TexcoordParseError => "a texture coordinate is \"vt u v\" with numbers".to_string(),
        other => other.to_string(),
    }
}

fn assemble(path: &Path, parsed: tobj::Mesh, lines: &ObjLines) -> Result<MeshData> {
    let tobj::Mesh { positions, normals, texcoords, indices, face_arities, .. } = parsed;
    let positions: Vec<[f64; 3]> = positions.as_chunks().0.to_vec();
    let count = positions.len();
    let normals: Vec<[f32; 3]> = normals.as_chunks().0.iter().map(|n| n.map(|c| c as f32)).collect();
    let uvs: Vec<[f32; 2]> = texcoords.as_chunks().0.iter().map(|t| t.map(|c| c as f32)).collect();
    if [normals.len(), uvs.len()].iter().any(|&n| n != 0 && n != count) {
        return Err(Error::Internal(format!("{}: attributes and vertices differ in number", path.display())));
    }
    let mut repairs = lines.repairs();
    repairs.bad_attributes += lines.changed_corners();
    let faces = Faces { indices, arities: face_arities };
    let (indices, material_of) = faces.triangulate(&positions, lines, &mut repairs);
    let table = MaterialTable::load(path, lines.libraries(), lines.materials().names());
    let mut mesh = MeshData {
        positions: Positions::F64(positions),
        normals,
        uvs,
        indices,
        material_ids: material_of,
        materials: table.materials,
        repairs,
    };
    if mesh.materials.len() <= 1 {
        mesh.material_ids = Vec::new();
        // Faces under no material at all need no entry.
        mesh.materials.retain(|m| !m.name.is_empty());
    }
    mesh.mend_normals();
    Ok(mesh)
}

/// Faces as `tobj` hands them out.
struct Faces {
    indices: Vec<u32>,
    /// Corners by face; empty if all are triangles.
    arities: Vec<u32>,
}

impl Faces {
    /// Triangles and the material of each.
    fn triangulate(
        self,
        positions: &[[f64; 3]],
        lines: &ObjLines,
        repairs: &mut Repairs,
    ) -> (Vec<[u32; 3]>, Vec<u16>) {
        let mut materials = Vec::new();
        if self.arities.is_empty() {
            for run in lines.materials().runs() {
                materials.resize(materials.len() + run.faces, run.material);
            }
            return (self.indices.as_chunks().0.to_vec(), materials);
        }
        let mut cutter = Triangulator::default();
        let mut triangles = Vec::with_capacity(self.indices.len() - 2 * self.arities.len());
        let mut corners = &self.indices[..];
        let mut arities = self.arities.iter();
        for run in lines.materials().runs() {
            for &arity in arities.by_ref().take(run.faces) {
                let (face, rest) = corners.split_at(arity as usize);
                corners = rest;
                repairs.triangulated += u64::from(arity > 3);
                cutter.cut(face, |i| DVec3::from_array(positions[i as usize]), &mut triangles);
            }
            materials.resize(triangles.len(), run.material);
        }
        (triangles, materials)
    }
}

#[cfg(test)]
mod tests;
