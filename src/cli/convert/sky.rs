//! Skies in other layouts.

use super::{Layout, PictureArgs, picture};
use crate::base::image_data::ImageData;
use crate::error::{Error, Result};
use crate::formats::sky_files::{ENDINGS, SkyFiles};
use crate::image::environment::{cube_of, equirectangular_of};
use crate::image::picture::{Picture, SampleKind};
use crate::image::read::read_image;
use crate::image::write::{check_writable, holds_radiance};
use crate::memory::{self, Room};
use std::path::{Path, PathBuf};

/// Names of files of faces, in the order +X -X +Y -Y +Z -Z; readers of skies know them.
const NAMES: [&str; 6] = ["px", "nx", "py", "ny", "pz", "nz"];

/// Widest face, and tallest picture.
const MOST: usize = 8_192;

/// Bytes a texel while sums are made: radiance and solid angle in double precision, and the result twice.
const BYTES: usize = 64;

enum Sky {
    Cube(Box<[ImageData; 6]>),
    Equirectangular(ImageData),
}

/// Writes the sky.
pub fn run(input: &Path, output: &Path, layout: Layout, args: &PictureArgs) -> Result<()> {
    let size = args.size.map(|s| s as usize);
    if let Some(size) = size.filter(|s| !(1..=MOST).contains(s)) {
        return Err(Error::Usage(format!("--size {size}: takes 1 to {} pixels", MOST)));
    }
    match layout {
        Layout::Cube => {
            let files = face_files(input, output)?;
            let faces = match (read(input, args)?, size) {
                (Sky::Equirectangular(sky), size) => {
                    let size = size.unwrap_or((sky.width / 4).max(1));
                    let _room = room(output, 6 * size * size)?;
                    cube_of(&sky, size)
                }
                (Sky::Cube(faces), None) => *faces,
                (Sky::Cube(_), Some(_)) => return Err(already(input, "a cube")),
            };
            std::fs::create_dir_all(output).map_err(|e| Error::file(output, "create", e))?;
            files.iter().zip(&faces).try_for_each(|(file, face)| write(face, file, args))
        }
        Layout::Equirectangular => {
            check_writable(output)?;
            let sky = match (read(input, args)?, size) {
                (Sky::Cube(faces), size) => {
                    let size = size.unwrap_or(2 * faces[0].width);
                    let _room = room(output, 2 * size * size)?;
                    equirectangular_of(&faces, size)
                }
                (Sky::Equirectangular(sky), None) => sky,
                (Sky::Equirectangular(_), Some(_)) => return Err(already(input, "equirectangular")),
            };
            write(&sky, output, args)
        }
    }
}

fn room(output: &Path, texels: usize) -> Result<Room> {
    memory::room((texels * BYTES) as u64, || format!("{}: a sky of {texels} texels", output.display()))
}

fn already(input: &Path, what: &str) -> Error {
    Error::Usage(format!(
        "{} is {what} already, and --size makes no new one of the same layout",
        input.display()
    ))
}

fn read(input: &Path, args: &PictureArgs) -> Result<Sky> {
    let files = SkyFiles::find(input)?;
    if let SkyFiles::Picture(file) = &files {
        let image = read_image(file, args.encoding())?;
        if image.width == 2 * image.height {
            return Ok(Sky::Equirectangular(image));
        }
    }
    files.faces(args.encoding()).map(|faces| Sky::Cube(Box::new(faces)))
}

/// The six files to write, of the kind of the input where that holds radiance, else EXR.
fn face_files(input: &Path, folder: &Path) -> Result<[PathBuf; 6]> {
    let ending = input.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let keeps = holds_radiance(input, None).unwrap_or(false);
    let ending = if keeps { &ending } else { "exr" };
    let names = NAMES.map(|name| format!("{name}.{ending}"));
    if folder.exists() {
        for entry in std::fs::read_dir(folder).map_err(|e| Error::file(folder, "open", e))? {
            let path = entry.map_err(|e| Error::file(folder, "read", e))?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let is_picture = ENDINGS.iter().any(|e| super::ends_in(&path, e));
            if is_picture && !names.contains(&name) {
                let message = format!("holds {name}, which would be taken for a face; choose another folder");
                return Err(Error::content(folder, message));
            }
        }
    }
    Ok(names.map(|name| folder.join(name)))
}

fn write(image: &ImageData, output: &Path, args: &PictureArgs) -> Result<()> {
    let mut picture = Picture::new(image.width, image.height);
    for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
        let texels = (0..image.width * image.height).map(|i| image.texel(i % image.width, i / image.width));
        picture.push(name, SampleKind::Float, texels.map(|t| t.to_array()[c]).collect());
    }
    picture::write(picture, output, args)
}
