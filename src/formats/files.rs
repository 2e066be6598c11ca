//! The files that a scene names: meshes are read once, several in parallel, pictures later and only if they are used;
//! whoever names the same file shares it.

use crate::base::deferred::Deferred;
use crate::base::image_data::{Encoding, ImageData, Texels};
use crate::base::mesh_data::{MeshData, Positions, Repairs};
use crate::error::{Error, Place, Result};
use crate::formats::sky_files::SkyFiles;
use crate::formats::{NamedFiles, load_mesh};
use crate::image::read::{check_kind, read_image};
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

/// Reading a scene goes in rounds: the text is read, the meshes it asks for are noted and given as placeholders; then
/// [`Files::read_noted`] reads them all, and the text is read again. So errors of the text come before any large file
/// is opened, and what a mesh names in turn (its pictures) is one round more. Of pictures only the first bytes are
/// looked at here: they are decoded when the scene is built, beside the kernel.
pub(crate) struct Files {
    /// Relative paths are relative to it; None where no file is to be opened.
    folder: Option<PathBuf>,
    meshes: HashMap<PathBuf, Arc<MeshData>>,
    noted: Vec<PathBuf>,
    is_noted: HashSet<PathBuf>,
    images: HashMap<(PathBuf, bool), Deferred<ImageData>>,
    faces: HashMap<(PathBuf, bool), Deferred<[ImageData; 6]>>,
    /// Pictures that one can do without and that cannot be used: the warning has been given.
    unusable: HashSet<PathBuf>,
}

static NO_MESH: LazyLock<Arc<MeshData>> = LazyLock::new(|| {
    Arc::new(MeshData {
        positions: Positions::F32(Vec::new()),
        normals: Vec::new(),
        uvs: Vec::new(),
        indices: Vec::new(),
        material_ids: Vec::new(),
        materials: Vec::new(),
        repairs: Repairs::default(),
    })
});

fn gray() -> ImageData {
    plain([0.5; 3])
}

fn plain(color: [f32; 3]) -> ImageData {
    ImageData { width: 1, height: 1, texels: Texels::F32(vec![color]) }
}

/// What stands in for a picture that one can do without.
const CONSEQUENCE: &str = "the plain colour is used instead";

impl Files {
    /// Those that the file at `path` names: relative paths are relative to its folder.
    pub fn of(path: &Path, named: NamedFiles) -> Self {
        let folder = path.parent().unwrap_or(Path::new(""));
        Files {
            folder: (named == NamedFiles::Read).then(|| folder.to_owned()),
            meshes: HashMap::new(),
            noted: Vec::new(),
            is_noted: HashSet::new(),
            images: HashMap::new(),
            faces: HashMap::new(),
            unusable: HashSet::new(),
        }
    }

    /// Whether files are opened; else there are placeholders only.
    pub fn are_read(&self) -> bool {
        self.folder.is_some()
    }

    /// A picture that `place` names.
    pub fn image(
        &mut self,
        path: &str,
        encoding: Option<Encoding>,
        place: &Place,
    ) -> Result<Deferred<ImageData>> {
        self.image_at(Path::new(path), encoding, place)
    }

    /// As [`Files::image`], by a path that need not be text.
    pub fn image_at(
        &mut self,
        path: &Path,
        encoding: Option<Encoding>,
        place: &Place,
    ) -> Result<Deferred<ImageData>> {
        let path = self.resolve(path, place)?;
        self.image_of(path, encoding)
    }

    /// The picture of a file at its one true path.
    fn image_of(&mut self, path: PathBuf, encoding: Option<Encoding>) -> Result<Deferred<ImageData>> {
        if !self.are_read() {
            return Ok(Deferred::ready(gray()));
        }
        let key = (path, encoding == Some(Encoding::Linear));
        if let Some(known) = self.images.get(&key) {
            return Ok(known.clone());
        }
        let path = key.0.clone();
        check_kind(&path)?;
        let image = Deferred::new(move || read_image(&path, encoding));
        self.images.insert(key, image.clone());
        Ok(image)
    }

    /// Six cube faces that `place` names.
    pub fn faces(
        &mut self,
        path: &str,
        encoding: Option<Encoding>,
        place: &Place,
    ) -> Result<Deferred<[ImageData; 6]>> {
        let key = (self.resolve(Path::new(path), place)?, encoding == Some(Encoding::Linear));
        if !self.are_read() {
            return Ok(Deferred::ready(std::array::from_fn(|_| gray())));
        }
        if let Some(known) = self.faces.get(&key) {
            return Ok(known.clone());
        }
        let files = SkyFiles::find(&key.0)?;
        let faces = Deferred::new(move || files.faces(encoding));
        self.faces.insert(key, faces.clone());
        Ok(faces)
    }

    /// A mesh that `place` names.
    pub fn mesh(&mut self, path: &str, place: &Place) -> Result<Arc<MeshData>> {
        self.mesh_at(Path::new(path), place)
    }

    /// As [`Files::mesh`], by a path that need not be text.
    pub fn mesh_at(&mut self, path: &Path, place: &Place) -> Result<Arc<MeshData>> {
        let path = self.resolve(path, place)?;
        if let Some(mesh) = self.meshes.get(&path) {
            return Ok(mesh.clone());
        }
        if self.is_noted.insert(path.clone()) {
            self.noted.push(path);
        }
        Ok(NO_MESH.clone())
    }

    /// A picture that a material library names, at a path already resolved. One that is missing costs a warning and is
    /// None; one that turns out to be damaged costs a warning and is `color` all over.
    pub fn optional_image(&mut self, path: &Path, color: [f32; 3]) -> Option<Deferred<ImageData>> {
        if self.unusable.contains(path) {
            return None;
        }
        let image = match self.are_read() {
            true => refuse_devices(path, "").and_then(|()| self.image_of(path.to_owned(), None)),
            false => Ok(Deferred::ready(gray())),
        };
        match image {
            Ok(image) => Some(image.or(plain(color), CONSEQUENCE)),
            Err(e) => {
                log::warn!("{e}; {CONSEQUENCE}");
                self.unusable.insert(path.to_owned());
                None
            }
        }
    }

    /// Reads all that was noted; false if nothing was.
    ///
    /// # Errors
    /// The first failure in the order in which the files were named.
    pub fn read_noted(&mut self) -> Result<bool> {
        self.is_noted.clear();
        let noted = std::mem::take(&mut self.noted);
        if !self.are_read() {
            return Ok(false);
        }
        let meshes: Vec<Result<MeshData>> = noted.par_iter().map(|path| load_mesh(path)).collect();
        let any = !noted.is_empty();
        for (path, mesh) in noted.into_iter().zip(meshes) {
            self.meshes.insert(path, Arc::new(mesh?));
        }
        Ok(any)
    }

    /// The file's one true path, so that two names of it are one file.
    fn resolve(&self, path: &Path, place: &Place) -> Result<PathBuf> {
        let Some(folder) = &self.folder else { return Ok(path.to_owned()) };
        let full = folder.join(path);
        let at = || if place.line > 0 { format!(" (named at {place})") } else { String::new() };
        let found = full.canonicalize().map_err(|e| {
            let hint = near_file(&full).map_or(String::new(), |n| format!("; did you mean \"{n}\"?"));
            Error::file(&full, "open", format!("{e}{}{hint}", at()))
        })?;
        refuse_devices(&found, &at())?;
        Ok(found)
    }
}

/// Names stand in files that may come from anywhere, and a device or a pipe may never end.
fn refuse_devices(path: &Path, at: &str) -> Result<()> {
    let about = path.metadata().map_err(|e| Error::file(path, "open", e))?;
    if about.is_file() || about.is_dir() {
        return Ok(());
    }
    Err(Error::file(path, "open", format!("it is neither a file nor a folder{at}")))
}

/// Names looked through for a hint in a folder that may hold millions.
const MAX_LOOKED_THROUGH: usize = 10_000;

/// The name in the same folder that is nearest to that of a missing file, if any is near.
fn near_file(path: &Path) -> Option<String> {
    let wanted = path.file_name()?.to_str()?;
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let names = std::fs::read_dir(folder).ok()?.take(MAX_LOOKED_THROUGH).flatten();
    let names: Vec<String> = names.filter_map(|e| e.file_name().into_string().ok()).collect();
    crate::error::nearest(wanted, names.iter().map(String::as_str)).map(str::to_owned)
}
