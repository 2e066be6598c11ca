//! The files that a scene names: each is read once, several in parallel, and whoever names the same file shares it.

use crate::base::image_data::{Encoding, ImageData, Texels};
use crate::base::mesh_data::{MeshData, Positions, Repairs};
use crate::error::{Error, Place, Result};
use crate::formats::{NamedFiles, load_mesh, sky_files};
use crate::image::read::read_image;
use rayon::prelude::*;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock};

/// Reading a scene goes in rounds: the text is read, the files it asks for are noted and given as placeholders; then
/// [`Files::read_noted`] reads them all, and the text is read again. So errors of the text come before any large file
/// is opened, and what a file names in turn (a mesh its pictures) is one round more.
pub(crate) struct Files {
    /// Relative paths are relative to it; None where no file is to be opened.
    folder: Option<PathBuf>,
    read: HashMap<Request, Content>,
    noted: Vec<(Request, bool)>,
    number_of: HashMap<Request, usize>,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash)]
enum Request {
    Image(PathBuf, bool),
    Faces(PathBuf, bool),
    Mesh(PathBuf),
}

#[derive(Clone)]
enum Content {
    Image(Arc<ImageData>),
    Faces(Arc<[ImageData; 6]>),
    Mesh(Arc<MeshData>),
    /// A file one can do without that cannot be used; the warning has been given.
    Unusable,
}

static NO_IMAGE: LazyLock<Arc<ImageData>> = LazyLock::new(|| Arc::new(gray()));
static NO_FACES: LazyLock<Arc<[ImageData; 6]>> = LazyLock::new(|| Arc::new(std::array::from_fn(|_| gray())));
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
    ImageData { width: 1, height: 1, texels: Texels::F32(vec![[0.5; 3]]) }
}

impl Files {
    /// Those that the file at `path` names: relative paths are relative to its folder.
    pub fn of(path: &Path, named: NamedFiles) -> Self {
        let folder = path.parent().unwrap_or(Path::new(""));
        Files {
            folder: (named == NamedFiles::Read).then(|| folder.to_owned()),
            read: HashMap::new(),
            noted: Vec::new(),
            number_of: HashMap::new(),
        }
    }

    /// Whether files are opened; else there are placeholders only.
    pub fn are_read(&self) -> bool {
        self.folder.is_some()
    }

    /// A picture that `place` names.
    pub fn image(&mut self, path: &str, encoding: Option<Encoding>, place: &Place) -> Result<Arc<ImageData>> {
        self.image_at(Path::new(path), encoding, place)
    }

    /// As [`Files::image`], by a path that need not be text.
    pub fn image_at(
        &mut self,
        path: &Path,
        encoding: Option<Encoding>,
        place: &Place,
    ) -> Result<Arc<ImageData>> {
        let request = Request::Image(self.resolve(path, place)?, encoding == Some(Encoding::Linear));
        match self.ask(request, true) {
            Some(Content::Image(image)) => Ok(image),
            _ => Ok(NO_IMAGE.clone()),
        }
    }

    /// Six cube faces that `place` names.
    pub fn faces(
        &mut self,
        path: &str,
        encoding: Option<Encoding>,
        place: &Place,
    ) -> Result<Arc<[ImageData; 6]>> {
        let request =
            Request::Faces(self.resolve(Path::new(path), place)?, encoding == Some(Encoding::Linear));
        match self.ask(request, true) {
            Some(Content::Faces(faces)) => Ok(faces),
            _ => Ok(NO_FACES.clone()),
        }
    }

    /// A mesh that `place` names.
    pub fn mesh(&mut self, path: &str, place: &Place) -> Result<Arc<MeshData>> {
        self.mesh_at(Path::new(path), place)
    }

    /// As [`Files::mesh`], by a path that need not be text.
    pub fn mesh_at(&mut self, path: &Path, place: &Place) -> Result<Arc<MeshData>> {
        let request = Request::Mesh(self.resolve(path, place)?);
        match self.ask(request, true) {
            Some(Content::Mesh(mesh)) => Ok(mesh),
            _ => Ok(NO_MESH.clone()),
        }
    }

    /// A picture that a material library names, at a path already resolved. One that is missing or damaged costs a
    /// warning and is None.
    pub fn optional_image(&mut self, path: &Path) -> Option<Arc<ImageData>> {
        match self.ask(Request::Image(path.to_owned(), false), false) {
            Some(Content::Image(image)) => Some(image),
            Some(_) => None,
            None => Some(NO_IMAGE.clone()),
        }
    }

    fn ask(&mut self, request: Request, required: bool) -> Option<Content> {
        if let Some(found) = self.read.get(&request) {
            return Some(found.clone());
        }
        match self.number_of.get(&request) {
            Some(&i) => self.noted[i].1 |= required,
            None => {
                self.number_of.insert(request.clone(), self.noted.len());
                self.noted.push((request, required));
            }
        }
        None
    }

    /// Reads all that was noted; false if nothing was.
    ///
    /// # Errors
    /// The first failure in the order in which the files were named.
    pub fn read_noted(&mut self) -> Result<bool> {
        self.number_of.clear();
        let noted = std::mem::take(&mut self.noted);
        if !self.are_read() {
            return Ok(false);
        }
        let contents: Vec<Result<Content>> = noted.par_iter().map(|(r, _)| r.read()).collect();
        let any = !noted.is_empty();
        for ((request, required), content) in noted.into_iter().zip(contents) {
            let content = match content {
                Err(e) if !required => {
                    log::warn!("{e}; the plain colour is used instead");
                    Content::Unusable
                }
                other => other?,
            };
            self.read.insert(request, content);
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

impl Request {
    fn read(&self) -> Result<Content> {
        let (Request::Image(path, _) | Request::Faces(path, _) | Request::Mesh(path)) = self;
        refuse_devices(path, "")?;
        let encoding = |linear: &bool| linear.then_some(Encoding::Linear);
        Ok(match self {
            Request::Image(path, linear) => Content::Image(Arc::new(read_image(path, encoding(linear))?)),
            Request::Faces(path, linear) => {
                Content::Faces(Arc::new(sky_files::cube_faces(path, encoding(linear))?))
            }
            Request::Mesh(path) => Content::Mesh(Arc::new(load_mesh(path)?)),
        })
    }
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
