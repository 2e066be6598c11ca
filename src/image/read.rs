//! Reads PNG, JPEG, Radiance HDR, EXR, TIFF and PFM pictures. The format is told by content, not by file name.
//!
//! Every size is checked by header before anything of that size is allocated: against absolute caps, and
//! against what a file of that length can hold at the format's best compression.

use super::kind::{Kind, LONGEST_MAGIC, PNG_MAGIC, sniff};
use super::picture::{Picture, SampleKind};
use super::raw::{Raw, curve16, eight_bits};
use super::{exr_read, hdr, pfm, tiff_read};
use crate::base::image_data::{Encoding, ImageData, Texels};
use crate::error::{Error, Result};
use crate::memory::{self, Room};
use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, Limits};
use std::fs::File;
use std::io::{Cursor, Read};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Longest side that is read, in pixels.
pub const MAX_SIDE: u64 = 65_536;

/// Most pixels that are read from one file (a 32768 x 8192 sky).
pub const MAX_PIXELS: u64 = 1 << 28;

/// Deflate packs at most 1032 bytes into one (RFC 1951: a 258-byte match in two bits).
pub(super) const DEFLATE_RATIO: u64 = 1032;

/// A JPEG block of 64 pixels costs at least one bit (the DC difference of a progressive gray picture).
const JPEG_PIXELS_PER_BYTE: u64 = 512;

/// Reads a picture as linear Rec. 709 texels.
///
/// `encoding` says how 8-bit and 16-bit values are to be understood (sRGB when `None`); 8-bit files stay
/// 8-bit, 16-bit files become floats. HDR and EXR are linear whatever it says. Values that are not finite or
/// negative are repaired: NaN, negative values and -infinity become 0, +infinity the largest finite value of
/// the picture; a warning counts them. Alpha is kept for 8-bit files alone.
///
/// # Errors
/// A file that cannot be opened; that is no picture of a known format; that claims more pixels than its length
/// can hold, or more than [`MAX_PIXELS`] or [`MAX_SIDE`]; that is damaged or cut short.
pub fn read_image(path: &Path, encoding: Option<Encoding>) -> Result<ImageData> {
    decode_image(path, &read_bytes(path)?, encoding)
}

/// All bytes of a picture's file.
///
/// # Errors
/// A file that cannot be opened or read, or that is larger than the memory that may be used.
pub fn read_bytes(path: &Path) -> Result<Vec<u8>> {
    let fail = |e| Error::file(path, "open", e);
    let length = std::fs::metadata(path).map_err(fail)?.len();
    let _room = memory::room(length, || path.display().to_string())?;
    std::fs::read(path).map_err(fail)
}

/// Whether a file begins as a picture does; nothing else of it is read.
///
/// # Errors
/// A file that cannot be opened; that is no picture of a known format.
pub fn check_kind(path: &Path) -> Result<()> {
    let fail = |e| Error::file(path, "open", e);
    let mut head = Vec::new();
    File::open(path).map_err(fail)?.take(LONGEST_MAGIC).read_to_end(&mut head).map_err(fail)?;
    sniff(path, &head).map(drop)
}

/// Width and height of the picture that [`decode_image`] would make, by its header alone.
///
/// # Errors
/// As [`read_image`], but for damage after the header.
pub fn dimensions(path: &Path, bytes: &[u8]) -> Result<(usize, usize)> {
    let kind = sniff(path, bytes)?;
    guarded(path, || match kind {
        Kind::Png => image_decoder(path, bytes, ImageFormat::Png).map(|d| size_of(&d)),
        Kind::Jpeg => image_decoder(path, bytes, ImageFormat::Jpeg).map(|d| size_of(&d)),
        Kind::Hdr => hdr::dimensions(path, bytes),
        Kind::Exr => exr_read::dimensions(path, bytes),
        Kind::Tiff => tiff_read::dimensions(path, bytes),
        Kind::Pfm => pfm::dimensions(path, bytes),
    })
}

/// As [`read_image`], from the bytes of a file; `path` is for messages alone.
///
/// # Errors
/// As [`read_image`].
pub fn decode_image(path: &Path, bytes: &[u8], encoding: Option<Encoding>) -> Result<ImageData> {
    let encoding = encoding.unwrap_or_default();
    let kind = sniff(path, bytes)?;
    guarded(path, || match kind {
        Kind::Png => decode_with_image(path, bytes, ImageFormat::Png, encoding),
        Kind::Jpeg => decode_with_image(path, bytes, ImageFormat::Jpeg, encoding),
        Kind::Hdr => hdr::decode(path, bytes).map(|raw| raw.into_image(encoding)),
        Kind::Exr => exr_read::decode_colour(path, bytes).map(|image| finish(path, image)),
        Kind::Tiff => tiff_read::decode(path, bytes).map(|raw| finish(path, raw.into_image(encoding))),
        Kind::Pfm => pfm::decode(path, bytes).map(|raw| finish(path, raw.into_image(encoding))),
    })
}

/// Samples as a PNG or JPEG file holds them.
pub(super) fn decode_raw(path: &Path, bytes: &[u8], format: ImageFormat) -> Result<Raw> {
    let decoder = image_decoder(path, bytes, format)?;
    let channels = usize::from(decoder.color_type().channel_count());
    // Decoded, and then as planes of floats.
    let bytes_per_pixel = channels * (4 + if is_deep(&decoder) { 2 } else { 1 });
    let _room = room_for(path, size_of(&decoder), bytes_per_pixel)?;
    DynamicImage::from_decoder(decoder).map(Raw::from).map_err(|e| damaged(path, &e))
}

/// A fault of a library that decodes is damage of the picture: nothing of what it worked on is looked at again.
pub(super) fn guarded<T>(path: &Path, decode: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(decode)).unwrap_or_else(|_| {
        Err(Error::content(path, "damaged picture: its decoder came to a state it does not expect"))
    })
}

/// Reads a picture as named planes: all channels of the first layer of an EXR file, exactly as stored (NaN
/// and infinities too), or linear `R`, `G`, `B` of any other format.
///
/// # Errors
/// As [`read_image`].
pub fn read_planes(path: &Path) -> Result<Picture> {
    decode_planes(path, &read_bytes(path)?)
}

/// As [`read_planes`], from the bytes of a file; `path` is for messages alone.
///
/// # Errors
/// As [`read_image`].
pub fn decode_planes(path: &Path, bytes: &[u8]) -> Result<Picture> {
    if sniff(path, bytes)? == Kind::Exr {
        return guarded(path, || exr_read::decode_planes(path, bytes));
    }
    let image = decode_image(path, bytes, None)?;
    let mut picture = Picture::new(image.width, image.height);
    let texels: Vec<_> = (0..image.height)
        .flat_map(|y| (0..image.width).map(move |x| (x, y)))
        .map(|(x, y)| image.texel(x, y))
        .collect();
    picture.push("R", SampleKind::Float, texels.iter().map(|t| t.r).collect());
    picture.push("G", SampleKind::Float, texels.iter().map(|t| t.g).collect());
    picture.push("B", SampleKind::Float, texels.iter().map(|t| t.b).collect());
    Ok(picture)
}

/// Refuses sizes that are zero, above the caps, or more than `len` bytes can hold when the best the format can
/// do is `pixels_per_byte` (64 KiB are granted on top, so that no small honest file is refused).
pub(super) fn check_size(
    path: &Path,
    width: u64,
    height: u64,
    len: usize,
    pixels_per_byte: u64,
) -> Result<()> {
    let pixels = width.saturating_mul(height);
    let message = if pixels == 0 {
        "has no pixels".to_owned()
    } else if width > MAX_SIDE || height > MAX_SIDE || pixels > MAX_PIXELS {
        format!("the largest that is read is {MAX_SIDE} a side and {MAX_PIXELS} in all")
    } else if pixels > (1 << 16) + (len as u64).saturating_mul(pixels_per_byte) {
        format!("more than its {len} bytes can hold")
    } else {
        return Ok(());
    };
    Err(Error::content(path, format!("claims {width} x {height} pixels: {message}")))
}

/// A decoder whose picture's size was checked.
fn image_decoder<'a>(
    path: &Path,
    bytes: &'a [u8],
    format: ImageFormat,
) -> Result<impl ImageDecoder + use<'a>> {
    if format == ImageFormat::Png {
        check_palette(path, bytes)?;
    }
    let mut reader = image::ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    // The decoded picture (at most 8 bytes a pixel) and the decoder's own rows.
    limits.max_alloc = Some(MAX_PIXELS * 12);
    limits.max_image_width = None;
    limits.max_image_height = None;
    reader.limits(limits);
    let decoder = reader.into_decoder().map_err(|e| damaged(path, &e))?;
    let (width, height) = decoder.dimensions();
    let per_byte = match format {
        // One-bit pixels are the densest.
        ImageFormat::Png => DEFLATE_RATIO * 8,
        _ => JPEG_PIXELS_PER_BYTE,
    };
    check_size(path, width.into(), height.into(), bytes.len(), per_byte)?;
    Ok(decoder)
}

/// PNG's colours come in threes, at most 256 of them; the decoder (png 0.18.1) relies on it.
fn check_palette(path: &Path, bytes: &[u8]) -> Result<()> {
    let mut rest = &bytes[PNG_MAGIC.len()..];
    while let Some((head, body)) = rest.split_first_chunk::<8>() {
        let [l0, l1, l2, l3, kind @ ..] = *head;
        let length = u32::from_be_bytes([l0, l1, l2, l3]) as usize;
        if kind == *b"PLTE" && (!length.is_multiple_of(3) || length > 3 * 256) {
            let message = format!("damaged picture: {length} bytes are no palette of up to 256 colours");
            return Err(Error::content(path, message));
        }
        // The check sum of four bytes stands behind.
        rest = body.get(length.saturating_add(4)..).unwrap_or_default();
    }
    Ok(())
}

/// Whether values have 16 bits.
fn is_deep(decoder: &impl ImageDecoder) -> bool {
    matches!(decoder.color_type(), ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16)
}

/// Room for a picture while it is decoded.
pub(super) fn room_for(path: &Path, size: (usize, usize), bytes_per_pixel: usize) -> Result<Room> {
    let (width, height) = size;
    let what = || format!("{}: a picture of {width} x {height}", path.display());
    memory::room((width * height * bytes_per_pixel) as u64, what)
}

fn damaged(path: &Path, e: &image::ImageError) -> Error {
    Error::content(path, format!("damaged picture: {e}"))
}

fn size_of(decoder: &impl ImageDecoder) -> (usize, usize) {
    let (width, height) = decoder.dimensions();
    (width as usize, height as usize)
}

fn decode_with_image(
    path: &Path,
    bytes: &[u8],
    format: ImageFormat,
    encoding: Encoding,
) -> Result<ImageData> {
    let decoder = image_decoder(path, bytes, format)?;
    let (width, height) = size_of(&decoder);
    // Decoded, and turned into texels: bytes of three or four channels, or 16-bit values and floats.
    let _room = room_for(path, (width, height), if is_deep(&decoder) { 8 + 12 } else { 4 + 4 })?;
    let deep = is_deep(&decoder);
    let picture = DynamicImage::from_decoder(decoder).map_err(|e| damaged(path, &e))?;
    let texels = if deep { texels16(&picture, encoding) } else { texels8(picture, encoding) };
    Ok(ImageData { width, height, texels })
}

fn texels8(picture: DynamicImage, encoding: Encoding) -> Texels {
    let quads = match picture {
        // What most are. The library would write the copy twice, zeros first.
        DynamicImage::ImageRgb8(rgb) => rgb.pixels().map(|p| [p.0[0], p.0[1], p.0[2], u8::MAX]).collect(),
        other => {
            let bytes = other.into_rgba8().into_raw();
            // Reuses the allocation where its alignment allows (it always does: bytes to byte arrays).
            bytemuck::allocation::try_cast_vec::<u8, [u8; 4]>(bytes).unwrap_or_else(|(_, bytes)| {
                bytes.chunks_exact(4).map(|c| [c[0], c[1], c[2], c[3]]).collect()
            })
        }
    };
    eight_bits(quads, encoding)
}

fn texels16(picture: &DynamicImage, encoding: Encoding) -> Texels {
    let curve = curve16(encoding);
    let value = |v: u16| curve[usize::from(v)];
    let texels = match picture {
        DynamicImage::ImageLuma16(i) => i.pixels().map(|p| [value(p.0[0]); 3]).collect(),
        DynamicImage::ImageLumaA16(i) => i.pixels().map(|p| [value(p.0[0]); 3]).collect(),
        DynamicImage::ImageRgba16(i) => i.pixels().map(|p| [p.0[0], p.0[1], p.0[2]].map(value)).collect(),
        other => other.to_rgb16().pixels().map(|p| p.0.map(value)).collect(),
    };
    Texels::F32(texels)
}

/// Repairs values that are not finite or negative (see [`read_image`]) and says how many.
fn finish(path: &Path, mut image: ImageData) -> ImageData {
    let Texels::F32(texels) = &mut image.texels else { return image };
    let values = texels.as_flattened_mut();
    let bad = values.iter().filter(|v| !v.is_finite() || **v < 0.0).count();
    if bad == 0 {
        return image;
    }
    let largest = values.iter().copied().filter(|v| v.is_finite()).fold(0.0, f32::max);
    for v in values.iter_mut().filter(|v| !v.is_finite() || **v < 0.0) {
        *v = if *v == f32::INFINITY { largest } else { 0.0 };
    }
    log::warn!(
        "{}: {bad} of {} values were negative or not finite; +infinity became {largest}, the others 0",
        path.display(),
        values.len()
    );
    image
}

#[cfg(test)]
mod tests;
