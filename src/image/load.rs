//! Pictures as they stand in their files: every channel layout and layer of EXR, and of other formats the stored values,
//! not yet decoded, with the word of how they were stored.

use super::kind::{Kind, sniff};
use super::picture::Picture;
use super::read::{decode_raw, guarded, read_bytes};
use super::{exr_read, hdr, pfm, tiff_read};
use crate::base::image_data::Encoding;
use crate::color::srgb_to_linear;
use crate::error::{Error, Result};
use image::ImageFormat;
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

impl Loaded {
    /// The picture in linear values: whole numbers decoded as their encoding says, colour multiplied by alpha.
    pub fn into_linear(self) -> Picture {
        let mut picture = self.picture;
        let Stored::Integer { encoding, .. } = self.stored else { return picture };
        let alpha = picture.plane("A").map(|p| p.data.clone());
        for plane in picture.planes.iter_mut().filter(|p| p.name != "A") {
            if encoding == Encoding::Srgb {
                plane.data.iter_mut().for_each(|v| *v = srgb_to_linear(*v));
            }
            if let Some(alpha) = &alpha {
                plane.data.iter_mut().zip(alpha).for_each(|(v, a)| *v *= a);
            }
        }
        picture
    }
}

/// Every channel of every part of an EXR file, by full names; of other files, what [`Loaded::into_linear`] gives.
///
/// # Errors
/// As [`load`]; parts that do not lie in one window.
pub fn load_whole(path: &Path, encoding: Option<Encoding>) -> Result<Picture> {
    let bytes = read_bytes(path)?;
    if sniff(path, &bytes)? == Kind::Exr {
        return guarded(path, || exr_read::decode_whole(path, &bytes));
    }
    decode(path, &bytes, &LoadOptions { encoding, ..LoadOptions::default() }).map(Loaded::into_linear)
}

/// Reads a picture. Alpha is kept where there is one: multiplied into the colour in EXR, beside it in whole numbers.
///
/// # Errors
/// As [`super::read::read_image`]; a layer that the file does not have.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Loaded> {
    decode(path, &read_bytes(path)?, options)
}

/// As [`load`], from the bytes of a file; `path` is for messages alone.
///
/// # Errors
/// As [`load`].
pub fn decode(path: &Path, bytes: &[u8], options: &LoadOptions) -> Result<Loaded> {
    let kind = sniff(path, bytes)?;
    if kind == Kind::Exr {
        let layer = options.layer.as_deref();
        let (picture, layer, layers) = guarded(path, || exr_read::decode_named(path, bytes, layer))?;
        let names = |(name, _): (String, usize)| name;
        let layers = layers.into_iter().map(|l| (l.name, l.channels.into_iter().map(names).collect()));
        return Ok(Loaded { picture, stored: Stored::Float, layer: layer.name, layers: layers.collect() });
    }
    if let Some(layer) = options.layer.as_deref().filter(|l| !l.is_empty()) {
        let message = format!("no layer \"{layer}\": this is no EXR picture, and only those have layers");
        return Err(Error::content(path, message));
    }
    let raw = guarded(path, || match kind {
        Kind::Png => decode_raw(path, bytes, ImageFormat::Png),
        Kind::Jpeg => decode_raw(path, bytes, ImageFormat::Jpeg),
        Kind::Hdr => hdr::decode(path, bytes),
        Kind::Tiff => tiff_read::decode(path, bytes),
        Kind::Pfm => pfm::decode(path, bytes),
        Kind::Exr => unreachable!("read above"),
    })?;
    let encoding = options.encoding.unwrap_or_default();
    let stored = raw.bits().map_or(Stored::Float, |bits| Stored::Integer { bits, encoding });
    let layers = vec![(String::new(), raw.names().iter().map(|n| (*n).to_owned()).collect())];
    Ok(Loaded { picture: raw.into_picture(), stored, layer: String::new(), layers })
}

#[cfg(test)]
mod tests;
