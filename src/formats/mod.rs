//! L4: files to plain scene data, one file a format.

pub mod families;
mod files;
pub mod mesh_scene;
pub mod native;
pub mod obj;
pub mod ply;
pub mod sky_files;
pub mod source;
mod triangulate;

use crate::base::mesh_data::MeshData;
use crate::error::{Error, Result, unknown_name};
use crate::formats::families::Families;
use crate::scene::desc::SceneDesc;
use std::path::Path;

/// One mesh format: the extension that names it, and its reader.
struct MeshFormat {
    extension: &'static str,
    parse: fn(&Path, &[u8]) -> Result<MeshData>,
}

const MESH_FORMATS: &[MeshFormat] =
    &[MeshFormat { extension: "obj", parse: obj::parse }, MeshFormat { extension: "ply", parse: ply::parse }];

/// The extensions of mesh files that [`load_mesh`] reads, without those of packing.
pub fn mesh_extensions() -> impl Iterator<Item = &'static str> {
    MESH_FORMATS.iter().map(|format| format.extension)
}

/// The extension of native scene files.
const NATIVE: &str = "toml";

/// Loads a scene file, or a mesh alone as a scene; the extension tells which.
///
/// # Errors
/// Those of [`load_with`].
pub fn load(path: &Path) -> Result<SceneDesc> {
    load_with(path, &Families::registered())
}

/// As [`load`], where scene files may name the kinds of `families`: with those of a program's own,
/// [`Families::of`] its [`crate::scene::registry::Registry`].
///
/// # Errors
/// Those of [`native::load`] and [`mesh_scene::load`]; an unknown extension.
pub fn load_with(path: &Path, families: &Families) -> Result<SceneDesc> {
    if is_mesh_path(path) {
        return mesh_scene::load(path);
    }
    let extension = source::content_extension(path);
    if extension.as_deref() == Some(NATIVE) {
        return native::load(path, families);
    }
    let known = || std::iter::once(NATIVE).chain(mesh_extensions());
    let what = match extension {
        _ if path.is_dir() => "is a folder, where a scene file or a mesh is wanted".to_owned(),
        Some(extension) => unknown_name("kind of scene file", &extension, known()),
        None => {
            let known = known().collect::<Vec<_>>().join(", ");
            format!("has no extension, which would tell the kind of file; known: {known}")
        }
    };
    Err(Error::content(path, what))
}

/// Whether [`load_mesh`] knows the kind of file that `path` names.
pub fn is_mesh_path(path: &Path) -> bool {
    source::content_extension(path).is_some_and(|e| mesh_extensions().any(|known| known == e))
}

/// Loads the mesh file at `path`, its kind told by the extension in any case, also packed (`.gz`, `.zst`). What was
/// mended on the way is counted in the mesh and logged as one warning.
///
/// # Errors
/// [`Error::File`] if the file cannot be read; [`Error::Content`] if the extension is unknown, the content is damaged
/// or there is no surface in it.
pub fn load_mesh(path: &Path) -> Result<MeshData> {
    let extension = source::content_extension(path);
    let known = MESH_FORMATS.iter().find(|format| Some(format.extension) == extension.as_deref());
    let Some(format) = known else {
        let name = extension.unwrap_or_default();
        let what = unknown_name("kind of mesh file", &name, mesh_extensions());
        return Err(Error::content(path, format!("{what} (each also packed as .gz or .zst)")));
    };
    let mesh = (format.parse)(path, &source::read(path)?)?;
    if let Some(repairs) = mesh.repairs.describe() {
        log::warn!("{}: {repairs}", path.display());
    }
    Ok(mesh)
}

#[cfg(test)]
mod tests;
