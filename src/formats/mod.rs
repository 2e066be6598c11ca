//! L4: files to plain scene data, one file a format.

mod commands;
pub mod cse168;
pub mod families;
mod files;
pub mod mesh_scene;
pub mod native;
pub mod obj;
pub mod ply;
pub mod seed;
pub mod sky_files;
pub mod source;
mod triangulate;

use crate::base::mesh_data::MeshData;
use crate::error::{Error, Result, unknown_name};
use crate::formats::families::Families;
use crate::formats::source::Source;
use crate::scene::desc::SceneDesc;
use std::path::Path;

/// One mesh format: the extension that names it, and its reader.
struct MeshFormat {
    extension: &'static str,
    /// Whether the first bytes of a file look like it; asked where the extension says nothing.
    recognise: fn(&[u8]) -> bool,
    read: fn(&Path, Source) -> Result<MeshData>,
}

const MESH_FORMATS: &[MeshFormat] = &[
    MeshFormat { extension: "obj", recognise: looks_like_obj, read: obj::read },
    MeshFormat { extension: "ply", recognise: |b| b.starts_with(b"ply"), read: ply::read },
];

/// Whether the first statement is one of OBJ's.
fn looks_like_obj(head: &[u8]) -> bool {
    const WORDS: &[&str] = &["v", "vn", "vt", "vp", "f", "o", "g", "s", "mtllib", "usemtl"];
    let text = String::from_utf8_lossy(head);
    let mut statements = text.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#'));
    statements.next().and_then(|l| l.split_whitespace().next()).is_some_and(|word| WORDS.contains(&word))
}

/// One format of scene files.
pub struct SceneFormat {
    /// The extension that names it.
    pub extension: &'static str,
    /// One line: what it is.
    pub doc: &'static str,
    /// How a file, or the beginning of one, looks to it. It is asked where the extension says nothing, or lies: where
    /// the content looks like another format and not like this one.
    recognise: fn(&[u8]) -> Fit,
    parse: fn(&SceneText, &LoadOptions) -> Result<SceneDesc>,
}

/// Every format of scene files.
pub static SCENE_FORMATS: &[SceneFormat] = &[native::FORMAT, cse168::FORMAT, seed::FORMAT];

/// How the content of a file looks to a format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Fit {
    /// As one of its own.
    Sure,
    /// As one of its own, or of another format: the extension decides.
    Possible,
    /// As none of its own.
    Foreign,
}

/// The content of a scene file.
pub struct SceneText<'a> {
    /// For messages, and for the files it names, which are relative to its folder.
    pub path: &'a Path,
    /// Unpacked.
    pub bytes: &'a [u8],
}

impl<'a> SceneText<'a> {
    /// The text, without a byte order mark.
    ///
    /// # Errors
    /// [`Error::Content`] with the line of the first byte that is no UTF-8.
    pub fn text(&self) -> Result<&'a str> {
        match std::str::from_utf8(self.bytes) {
            Ok(text) => Ok(text.strip_prefix('\u{feff}').unwrap_or(text)),
            Err(e) => {
                let line = 1 + self.bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count();
                Err(Error::content_at(self.path, line, 0, "this is not text in UTF-8"))
            }
        }
    }
}

/// Whose look a scene file of another program shall have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Compat {
    /// As its own program shows it, with all that is not physical about it.
    #[default]
    Exact,
    /// In radiometric units: the same things, lit as they would be.
    Physical,
}

/// What becomes of the files that a scene file names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NamedFiles {
    /// They are read.
    #[default]
    Read,
    /// None is looked for, and what a file holds is left empty: a mesh without a triangle, a gray picture, no sky. For
    /// looking at a text alone.
    LeftOut,
}

/// How scene files are read.
#[derive(Debug, Clone)]
pub struct LoadOptions {
    /// The kinds that scene files may name; for those of a program's own, [`Families::of`] its
    /// [`crate::scene::registry::Registry`].
    pub families: Families,
    /// For files of other programs.
    pub compat: Compat,
    /// What becomes of the files that a scene file names.
    pub named_files: NamedFiles,
}

impl Default for LoadOptions {
    fn default() -> Self {
        LoadOptions {
            families: Families::registered(),
            compat: Compat::default(),
            named_files: NamedFiles::default(),
        }
    }
}

/// The extensions of mesh files that [`load_mesh`] reads, without those of packing.
pub fn mesh_extensions() -> impl Iterator<Item = &'static str> {
    MESH_FORMATS.iter().map(|format| format.extension)
}

/// What a file turned out to be.
enum Kind {
    Scene(&'static SceneFormat),
    Mesh(&'static MeshFormat),
}

/// Loads a scene file, or a mesh alone as a scene. The extension tells which; where it says nothing, or its format is
/// not what the file holds, the content does.
///
/// # Errors
/// Those of [`load_with`].
pub fn load(path: &Path) -> Result<SceneDesc> {
    load_with(path, &LoadOptions::default())
}

/// As [`load`], by these options.
///
/// # Errors
/// [`Error::File`] if the file cannot be read; [`Error::Content`] if what stands in it cannot be used; an unknown
/// kind of file.
pub fn load_with(path: &Path, options: &LoadOptions) -> Result<SceneDesc> {
    if is_mesh_path(path) {
        return mesh_scene::load(path);
    }
    if path.is_dir() {
        return Err(Error::content(path, "is a folder, where a scene file or a mesh is wanted"));
    }
    let extension = source::content_extension(path);
    let named = SCENE_FORMATS.iter().find(|f| Some(f.extension) == extension.as_deref());
    if named.is_none() && !path.exists() {
        return Err(unknown_kind(path));
    }
    let bytes = source::read(path)?;
    match kind_of(path, &bytes, named)? {
        Kind::Mesh(_) => mesh_scene::load(path),
        Kind::Scene(format) => (format.parse)(&SceneText { path, bytes: &bytes }, options),
    }
}

/// As [`load_with`], from the bytes of a scene file, which may be packed; `path` is for messages, for the extension and
/// for the folder of the files that the scene names.
///
/// # Errors
/// [`Error::Content`] if what stands in it cannot be used, or is a mesh ([`parse_mesh`] reads those); [`Error::File`]
/// for files that it names.
pub fn parse(path: &Path, bytes: Vec<u8>, options: &LoadOptions) -> Result<SceneDesc> {
    let extension = source::content_extension(path);
    let named = SCENE_FORMATS.iter().find(|f| Some(f.extension) == extension.as_deref());
    let bytes = source::unpacked(path, &bytes)?;
    match kind_of(path, &bytes, named)? {
        Kind::Mesh(_) => Err(Error::content(path, "holds a mesh, where a scene is wanted")),
        Kind::Scene(format) => (format.parse)(&SceneText { path, bytes: &bytes }, options),
    }
}

/// The format that the extension names, unless the content says otherwise.
fn kind_of(path: &Path, bytes: &[u8], named: Option<&'static SceneFormat>) -> Result<Kind> {
    let head = &bytes[..bytes.len().min(HEAD)];
    if let Some(format) = named.filter(|f| (f.recognise)(head) != Fit::Foreign) {
        return Ok(Kind::Scene(format));
    }
    let find = |text, fit| SCENE_FORMATS.iter().find(|f| (f.recognise)(text) == fit);
    // What tells two formats apart may stand behind a million vertices.
    let unsure = || find(head, Fit::Possible).map(|guess| find(bytes, Fit::Sure).unwrap_or(guess));
    let scene = find(head, Fit::Sure).or_else(unsure).map(Kind::Scene);
    let found = scene.or_else(|| MESH_FORMATS.iter().find(|f| (f.recognise)(head)).map(Kind::Mesh));
    match (found, named) {
        (Some(found), None) => Ok(found),
        (Some(found), Some(named)) => {
            let what = match &found {
                Kind::Scene(f) => f.extension,
                Kind::Mesh(f) => f.extension,
            };
            log::warn!(
                "{}: is named .{}, but holds what a .{what} file does",
                path.display(),
                named.extension
            );
            Ok(found)
        }
        // Its own reader says best what is wrong with it.
        (None, Some(named)) => Ok(Kind::Scene(named)),
        (None, None) => Err(unknown_kind(path)),
    }
}

fn unknown_kind(path: &Path) -> Error {
    let known = || SCENE_FORMATS.iter().map(|f| f.extension).chain(mesh_extensions());
    let what = match source::content_extension(path) {
        Some(extension) => unknown_name("kind of scene file", &extension, known()),
        None => {
            let known = known().collect::<Vec<_>>().join(", ");
            format!("has no extension and no content that would tell the kind of file; known: {known}")
        }
    };
    Error::content(path, what)
}

/// As many bytes as a format is recognised by.
const HEAD: usize = 1 << 14;

/// Whether [`load_mesh`] knows the kind of file that `path` names.
pub fn is_mesh_path(path: &Path) -> bool {
    source::content_extension(path).is_some_and(|e| mesh_extensions().any(|known| known == e))
}

/// Loads the mesh file at `path`, its kind told by the extension in any case or else by the content, also packed
/// (`.gz`, `.zst`). What was
/// mended on the way is counted in the mesh and logged as one warning.
///
/// # Errors
/// [`Error::File`] if the file cannot be read; [`Error::Content`] if the extension is unknown, the content is damaged
/// or there is no surface in it.
pub fn load_mesh(path: &Path) -> Result<MeshData> {
    let format = named_mesh_format(path);
    if format.is_none() && !path.exists() {
        return Err(unknown_mesh(path));
    }
    read_mesh(path, Source::open(path)?, format)
}

/// As [`load_mesh`], from the bytes of a file; `path` is for messages, for the extension and for the folder of its
/// material libraries.
///
/// # Errors
/// As [`load_mesh`].
pub fn parse_mesh(path: &Path, bytes: &[u8]) -> Result<MeshData> {
    read_mesh(path, Source::of_file_bytes(path, bytes)?, named_mesh_format(path))
}

fn named_mesh_format(path: &Path) -> Option<&'static MeshFormat> {
    let extension = source::content_extension(path);
    MESH_FORMATS.iter().find(|format| Some(format.extension) == extension.as_deref())
}

fn unknown_mesh(path: &Path) -> Error {
    let extension = source::content_extension(path).unwrap_or_default();
    let what = unknown_name("kind of mesh file", &extension, mesh_extensions());
    Error::content(path, format!("{what} (each also packed as .gz or .zst)"))
}

fn read_mesh(path: &Path, mut source: Source, named: Option<&MeshFormat>) -> Result<MeshData> {
    let format = match named {
        Some(format) => format,
        None => {
            let head = source.head(HEAD)?;
            MESH_FORMATS.iter().find(|f| (f.recognise)(&head)).ok_or_else(|| unknown_mesh(path))?
        }
    };
    let mesh = (format.read)(path, source)?;
    if let Some(repairs) = mesh.repairs.describe() {
        log::warn!("{}: {repairs}", path.display());
    }
    Ok(mesh)
}

#[cfg(test)]
mod tests;
