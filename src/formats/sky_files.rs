//! Skies from picture files: six faces in a folder, a cross, a strip, or one equirectangular picture.

use crate::base::deferred::Deferred;
use crate::base::image_data::{Encoding, ImageData, Texels};
use crate::base::registry::{Node, Params, Value};
use crate::error::{Error, Place, Result};
use crate::image::read::{decode_image, dimensions, read_bytes, read_image};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Endings of files that count as pictures in a folder.
pub(crate) const ENDINGS: [&str; 8] = ["png", "jpg", "jpeg", "hdr", "exr", "tif", "tiff", "pfm"];

/// Names of faces in messages, in their order.
const FACES: [&str; 6] = ["+X", "-X", "+Y", "-Y", "+Z", "-Z"];

const WHAT: &str = "a sky is a folder of six faces, or one picture: equirectangular (2:1), a cross (4:3 or 3:4) \
                    or a strip of six faces (6:1 or 1:6)";

/// The sky that a file or folder holds: a `cube` or `sphere` node, its pictures found and not yet decoded. `encoding`
/// says how 8-bit values are meant (sRGB when None).
///
/// # Errors
/// Nothing there; a shape or number of pictures that no layout has; a missing face. Pictures that are damaged, and faces
/// that are not square or not alike, are errors of the node's value.
pub fn load_sky(path: &Path, encoding: Option<Encoding>) -> Result<Node> {
    let files = SkyFiles::find(path)?;
    if let SkyFiles::Picture(file) = &files {
        let bytes = read_bytes(file)?;
        let (width, height) = dimensions(file, &bytes)?;
        if width == 2 * height {
            let file = file.clone();
            let image = Deferred::new(move || decode_image(&file, &bytes, encoding));
            return Ok(node(path, "sphere", Value::Image(image)));
        }
        layout(file, width, height)?;
    }
    Ok(node(path, "cube", Value::Faces(Deferred::new(move || files.faces(encoding)))))
}

fn node(path: &Path, kind: &str, value: Value) -> Node {
    let place = Place { path: path.to_owned(), ..Place::default() };
    let params = Params { place: place.clone(), ..Params::default() }.with("path", value);
    Node { kind: kind.to_owned(), params, place }
}

/// The files that hold a sky.
pub(crate) enum SkyFiles {
    /// One picture.
    Picture(PathBuf),
    /// Six, by face, in the order +X -X +Y -Y +Z -Z.
    Faces([PathBuf; 6]),
}

impl SkyFiles {
    /// Those at `path`, a file or a folder.
    pub fn find(path: &Path) -> Result<Self> {
        let about = std::fs::metadata(path).map_err(|e| Error::file(path, "open", e))?;
        if !about.is_dir() {
            return Ok(SkyFiles::Picture(path.to_owned()));
        }
        let mut files = pictures(path)?;
        match files.len() {
            0 => {
                let endings = ENDINGS.join(", ");
                Err(Error::content(path, format!("no picture (*.{endings}) in this folder; {WHAT}")))
            }
            1 => Ok(SkyFiles::Picture(files.remove(0))),
            _ => assign(path, files).map(SkyFiles::Faces),
        }
    }

    /// The six faces, in the order +X -X +Y -Y +Z -Z, that a folder, a cross or a strip holds.
    ///
    /// # Errors
    /// Pictures that cannot be read; an equirectangular one; faces that are not square or not alike.
    pub fn faces(&self, encoding: Option<Encoding>) -> Result<[ImageData; 6]> {
        match self {
            SkyFiles::Faces(files) => read_faces(files, encoding),
            SkyFiles::Picture(file) => {
                let image = read_image(file, encoding)?;
                if image.width == 2 * image.height {
                    let message = "is equirectangular: its type is \"sphere\", not \"cube\"";
                    return Err(Error::content(file, message));
                }
                cut(file, &image)
            }
        }
    }
}

/// The pictures of a folder in the order of their names.
fn pictures(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(|e| Error::file(folder, "open", e))? {
        let path = entry.map_err(|e| Error::file(folder, "read", e))?.path();
        let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        let hidden = path.file_name().is_none_or(|n| n.to_string_lossy().starts_with('.'));
        if !hidden && path.is_file() && ending.is_some_and(|e| ENDINGS.contains(&e.as_str())) {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// Which file is which face, by the first convention that names all six, or by the order of names.
fn assign(folder: &Path, files: Vec<PathBuf>) -> Result<[PathBuf; 6]> {
    let stems: Vec<String> =
        files.iter().map(|f| f.file_stem().unwrap_or_default().to_string_lossy().to_lowercase()).collect();
    let mut most: Option<[Option<usize>; 6]> = None;
    for convention in [by_signed_axis, by_axis_word, by_side] {
        let mut found = [None; 6];
        let mut twice = false;
        for (i, stem) in stems.iter().enumerate() {
            if let Some(face) = convention(stem) {
                twice |= found[face].replace(i).is_some();
            }
        }
        let known = |f: &[Option<usize>; 6]| f.iter().flatten().count();
        if known(&found) == 6 && !twice {
            return Ok(found.map(|i| files[i.unwrap_or_default()].clone()));
        }
        if most.is_none_or(|m| known(&found) > known(&m)) {
            most = Some(found);
        }
    }
    let list = || {
        let names = files.iter().map(|f| f.file_name().unwrap_or_default().to_string_lossy());
        names.take(8).collect::<Vec<_>>().join(", ")
    };
    if files.len() == 6 {
        // +Z -Z +X -X +Y -Y, as the folders of common sky collections sort.
        return Ok([2, 3, 4, 5, 0, 1].map(|i| files[i].clone()));
    }
    let missing: Vec<&str> =
        most.iter().flat_map(|m| m.iter().zip(FACES).filter(|(i, _)| i.is_none()).map(|(_, f)| f)).collect();
    let message = match missing.len() {
        1..=3 => format!("{} of the six faces is missing (found: {}); {WHAT}", missing.join(", "), list()),
        _ => format!("{} pictures in this folder ({}); {WHAT}", files.len(), list()),
    };
    Err(Error::content(folder, message))
}

/// `front+z`, `sky_-X`: an axis with its sign, which wins over any word beside it.
fn by_signed_axis(stem: &str) -> Option<usize> {
    let b = stem.as_bytes();
    (1..b.len()).rev().find_map(|i| {
        let axis = b"xyz".iter().position(|a| *a == b[i])?;
        let ends = b.get(i + 1).is_none_or(|c| !c.is_ascii_alphanumeric());
        match b[i - 1] {
            b'+' if ends => Some(2 * axis),
            b'-' if ends => Some(2 * axis + 1),
            _ => None,
        }
    })
}

/// `px`, `posx`, `x_pos`, `negative_x`, `nx` and the like.
fn by_axis_word(stem: &str) -> Option<usize> {
    const SIGNS: [(&str, usize); 9] = [
        ("positive", 0),
        ("negative", 1),
        ("plus", 0),
        ("minus", 1),
        ("pos", 0),
        ("neg", 1),
        ("p", 0),
        ("n", 1),
        ("m", 1),
    ];
    let words: Vec<&str> =
        stem.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty()).collect();
    let pairs = words.windows(2).map(|w| w.concat());
    // The last word that says it: names begin with the sky's own.
    let all: Vec<String> = words.iter().map(|w| (*w).to_owned()).chain(pairs).collect();
    all.iter().rev().find_map(|word| {
        SIGNS.iter().find_map(|(sign, odd)| {
            let axis = word.strip_prefix(sign).or_else(|| word.strip_suffix(sign))?;
            Some(2 * ["x", "y", "z"].iter().position(|a| *a == axis)? + odd)
        })
    })
}

/// `right`, `left`, `top`, `bottom`, `front`, `back`, and the two letters of game engines.
fn by_side(stem: &str) -> Option<usize> {
    const SIDES: [(&str, usize); 14] = [
        ("right", 0),
        ("left", 1),
        ("top", 2),
        ("up", 2),
        ("bottom", 3),
        ("down", 3),
        ("front", 4),
        ("back", 5),
        ("rt", 0),
        ("lf", 1),
        ("dn", 3),
        ("ft", 4),
        ("bk", 5),
        ("bt", 3),
    ];
    let letters = |s: &str| s.trim_end_matches(|c: char| !c.is_ascii_alphabetic()).to_owned();
    let stem = letters(stem);
    let last = stem.rsplit(|c: char| !c.is_ascii_alphabetic()).next()?;
    // A word of its own anywhere, or the end of the name.
    let whole = stem
        .split(|c: char| !c.is_ascii_alphabetic())
        .filter_map(|w| SIDES.iter().find(|s| s.0 == w))
        .next_back();
    whole.or_else(|| SIDES.iter().find(|s| last.ends_with(s.0))).map(|s| s.1)
}

/// Reads six files at once and checks that they go together.
fn read_faces(files: &[PathBuf; 6], encoding: Option<Encoding>) -> Result<[ImageData; 6]> {
    let images: Vec<ImageData> = files.par_iter().map(|f| read_image(f, encoding)).collect::<Result<_>>()?;
    let faces: [ImageData; 6] =
        images.try_into().map_err(|_| Error::Internal("six files gave other than six pictures".into()))?;
    let first = &faces[0];
    for (file, face) in files.iter().zip(&faces) {
        let (w, h) = (face.width, face.height);
        if w != h {
            return Err(Error::content(file, format!("is {w}x{h}; a cube face must be square")));
        }
        let other = files[0].file_name().unwrap_or_default().to_string_lossy();
        if w != first.width {
            let message =
                format!("is {w}x{w}, but {other} is {0}x{0}; cube faces must be of one size", first.width);
            return Err(Error::content(file, message));
        }
        if std::mem::discriminant(&face.texels) != std::mem::discriminant(&first.texels) {
            let message = format!("and {other} differ in pixel format: one is 8-bit, one is not");
            return Err(Error::content(file, message));
        }
    }
    Ok(faces)
}

/// A face within a picture: its column and row in units of faces, and whether it stands on its head.
type Cell = (usize, usize, bool);

/// The usual crosses, unfolded about +Z; the back of the vertical one hangs upside down below -Y.
const HORIZONTAL: [Cell; 6] =
    [(2, 1, false), (0, 1, false), (1, 0, false), (1, 2, false), (1, 1, false), (3, 1, false)];
const VERTICAL: [Cell; 6] =
    [(2, 1, false), (0, 1, false), (1, 0, false), (1, 2, false), (1, 1, false), (1, 3, true)];
const ROW: [Cell; 6] =
    [(0, 0, false), (1, 0, false), (2, 0, false), (3, 0, false), (4, 0, false), (5, 0, false)];
const COLUMN: [Cell; 6] =
    [(0, 0, false), (0, 1, false), (0, 2, false), (0, 3, false), (0, 4, false), (0, 5, false)];

/// The side of a face, and where in a picture of this size each face lies.
fn layout(file: &Path, w: usize, h: usize) -> Result<(usize, [Cell; 6])> {
    let layouts = [(4, 3, HORIZONTAL), (3, 4, VERTICAL), (6, 1, ROW), (1, 6, COLUMN)];
    let fits = |&(across, down, _): &(usize, usize, _)| {
        w.is_multiple_of(across) && h.is_multiple_of(down) && w / across == h / down
    };
    match layouts.into_iter().find(fits) {
        Some((across, _, cells)) => Ok((w / across, cells)),
        None => Err(Error::content(file, format!("is {w}x{h}; {WHAT}"))),
    }
}

/// The faces of a cross or strip.
fn cut(file: &Path, image: &ImageData) -> Result<[ImageData; 6]> {
    let (size, cells) = layout(file, image.width, image.height)?;
    Ok(cells.map(|c| crop(image, size, c)))
}

fn crop(image: &ImageData, size: usize, (column, row, turned): Cell) -> ImageData {
    let texels = match &image.texels {
        Texels::Srgb8(t) => Texels::Srgb8(crop_texels(t, image.width, size, (column, row, turned))),
        Texels::Linear8(t) => Texels::Linear8(crop_texels(t, image.width, size, (column, row, turned))),
        Texels::F32(t) => Texels::F32(crop_texels(t, image.width, size, (column, row, turned))),
    };
    ImageData { width: size, height: size, texels }
}

fn crop_texels<T: Copy>(texels: &[T], width: usize, size: usize, (column, row, turned): Cell) -> Vec<T> {
    let mut out = Vec::with_capacity(size * size);
    for y in 0..size {
        let start = (row * size + y) * width + column * size;
        out.extend_from_slice(&texels[start..start + size]);
    }
    if turned {
        out.reverse();
    }
    out
}

#[cfg(test)]
mod tests;
