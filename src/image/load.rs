//! Pictures as they stand in their files: every channel layout and layer of EXR, and of other formats the stored values,
//! not yet decoded, with the word of how they were stored.

use super::picture::Picture;
use crate::base::image_data::Encoding;
use crate::error::{Error, Result};
use std::path::Path;

/// What to take from a file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LoadOptions {
    /// The layer, by name (`albedo`, `ViewLayer.Combined`); what is most likely the picture itself where there is none.
    pub layer: Option<String>,
    /// How whole numbers hold light: sRGB where it is not said. Floats are linear.
    pub encoding: Option<Encoding>,
}

/// How a file holds its values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stored {
    /// Floats of radiance, linear.
    Float,
    /// Whole numbers of so many bits; planes hold them divided by the largest, so from 0 to 1, still encoded.
    Integer {
        /// 8 or 16.
        bits: u32,
        /// What the values mean.
        encoding: Encoding,
    },
}

/// A picture from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded {
    /// Its planes by bare names: `R G B` (and `A`), `Y`, `X Y Z` of a normal, `V`: the layer's prefix is taken off. NaN and
    /// infinities stay.
    pub picture: Picture,
    /// How it was stored.
    pub stored: Stored,
    /// The layer that was taken; empty for unnamed channels.
    pub layer: String,
    /// Every layer of the file with its channels.
    pub layers: Vec<(String, Vec<String>)>,
}

/// Reads a picture.
///
/// # Errors
/// As [`super::read::read_image`]; a layer that the file does not have.
pub fn load(path: &Path, _options: &LoadOptions) -> Result<Loaded> {
    Err(Error::Internal(format!("{}: not built yet", path.display())))
}
