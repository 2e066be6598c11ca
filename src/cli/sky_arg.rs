//! `--sky`: the name of a kind, a picture, or a folder of faces. A name wins over a file of that name; `./night` is
//! the file.

use crate::base::image_data::Encoding;
use crate::base::registry::Node;
use crate::error::{Error, Result, unknown_name};
use crate::formats::families::{Families, Kind};
use crate::formats::sky_files::load_sky;
use clap::ValueEnum;
use std::path::Path;

/// How 8-bit pictures are meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum SkyEncoding {
    /// By the sRGB curve.
    Srgb,
    /// As they are.
    Linear,
}

impl From<SkyEncoding> for Encoding {
    fn from(e: SkyEncoding) -> Self {
        match e {
            SkyEncoding::Srgb => Encoding::Srgb,
            SkyEncoding::Linear => Encoding::Linear,
        }
    }
}

/// The sky that the word means.
pub fn load(word: &str, encoding: Option<SkyEncoding>) -> Result<Node> {
    let skies = Families::registered().skies;
    let stands_alone = |k: &Kind| k.params.iter().all(|p| p.default.is_some());
    if skies.find(word).is_some_and(stands_alone) {
        if encoding.is_some() {
            return Err(Error::Usage(format!(
                "--sky-encoding is for pictures, and the sky \"{word}\" has none"
            )));
        }
        return Ok(Node { kind: word.to_owned(), ..Node::default() });
    }
    let path = Path::new(word);
    let is_bare = path.components().count() <= 1 && path.extension().is_none() && !word.starts_with('.');
    if is_bare && !path.exists() {
        let known = skies.kinds.iter().filter(|k| stands_alone(k)).map(|k| k.name);
        return Err(Error::Usage(format!("{}, or a file or folder", unknown_name("sky", word, known))));
    }
    load_sky(path, encoding.map(Encoding::from))
}
