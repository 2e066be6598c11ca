//! TIFF pictures through the `tiff` crate: gray or colour, with alpha or without; whole numbers of 8 and 16 bits,
//! floats of 16, 32 and 64. Of several pages the first is read.

use super::raw::{Raw, Samples};
use super::read::{check_size, room_for};
use crate::error::{Error, Result};
use std::io::Cursor;
use std::path::Path;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::Tag;
use tiff::{ColorType, TiffError};

/// LZW codes of 12 bits stand for at most 3838 bytes each; nothing else that is unpacked here does better.
const BYTES_PER_BYTE: u64 = 2560;

/// Blocks of 64 pixels cost JPEG at least one bit.
const JPEG_PIXELS_PER_BYTE: u64 = 512;

struct Opened<'a> {
    decoder: Decoder<Cursor<&'a [u8]>>,
    size: (usize, usize),
    channels: usize,
    bytes_per_pixel: usize,
}

/// Width and height, by the tags.
pub(super) fn dimensions(path: &Path, bytes: &[u8]) -> Result<(usize, usize)> {
    open(path, bytes).map(|o| o.size)
}

/// Decodes the first page.
pub(super) fn decode(path: &Path, bytes: &[u8]) -> Result<Raw> {
    let Opened { decoder, size, channels, bytes_per_pixel } = open(path, bytes)?;
    let (width, height) = size;
    let _room = room_for(path, size, 2 * bytes_per_pixel + 4 * channels)?;
    let mut limits = Limits::default();
    // Strips and tiles may reach over the picture.
    let whole = width * height * bytes_per_pixel;
    limits.decoding_buffer_size = whole;
    limits.intermediate_buffer_size = whole.saturating_mul(2).max(1 << 22);
    limits.ifd_value_size = bytes.len();
    let mut decoder = decoder.with_limits(limits);
    if let Ok(Some(turn @ 2..)) = decoder.find_tag_unsigned::<u16>(Tag::Orientation) {
        log::warn!("{}: its orientation tag ({turn}) is not heeded", path.display());
    }
    let mut result = DecodingResult::U8(Vec::new());
    let layout = decoder.read_image_to_buffer(&mut result).map_err(|e| damaged(path, &e))?;
    let planar = layout.complete_len > layout.len;
    let samples = match result {
        DecodingResult::U8(v) => Samples::U8(v),
        DecodingResult::U16(v) => Samples::U16(v),
        DecodingResult::F16(v) => Samples::F32(v.iter().map(|v| v.to_f32()).collect()),
        DecodingResult::F32(v) => Samples::F32(v),
        DecodingResult::F64(v) => Samples::F32(v.iter().map(|&v| v as f32).collect()),
        _ => return Err(refused(path, "whole numbers with signs, or of more than 16 bits")),
    };
    let samples = match samples {
        Samples::U8(v) => Samples::U8(ordered(v, channels, planar)),
        Samples::U16(v) => Samples::U16(ordered(v, channels, planar)),
        Samples::F32(v) => Samples::F32(ordered(v, channels, planar)),
    };
    let raw = Raw { width, height, channels, samples };
    let count = match &raw.samples {
        Samples::U8(v) => v.len(),
        Samples::U16(v) => v.len(),
        Samples::F32(v) => v.len(),
    };
    if count != width * height * channels {
        return Err(refused(path, &format!("{count} samples for {channels} channels")));
    }
    Ok(raw)
}

/// Channels side by side, from planes one after the other where they stand so.
fn ordered<T: Copy>(values: Vec<T>, channels: usize, planar: bool) -> Vec<T> {
    if !planar {
        return values;
    }
    let pixels = values.len() / channels;
    (0..pixels * channels).map(|i| values[i % channels * pixels + i / channels]).collect()
}

fn open<'a>(path: &Path, bytes: &'a [u8]) -> Result<Opened<'a>> {
    let mut decoder = Decoder::new(Cursor::new(bytes)).map_err(|e| damaged(path, &e))?;
    let (width, height) = decoder.dimensions().map_err(|e| damaged(path, &e))?;
    let kind = decoder.colortype().map_err(|e| damaged(path, &e))?;
    let channels = match kind {
        ColorType::Gray(_) => 1,
        ColorType::GrayA(_) | ColorType::Multiband { num_samples: 2, .. } => 2,
        ColorType::RGB(_) => 3,
        ColorType::RGBA(_) => 4,
        other => return Err(refused(path, &format!("pixels of the kind {other:?}"))),
    };
    let bits = usize::from(kind.bit_depth());
    if ![8, 16, 32, 64].contains(&bits) {
        return Err(refused(path, &format!("samples of {bits} bits")));
    }
    let bytes_per_pixel = channels * bits / 8;
    let per_byte = BYTES_PER_BYTE.div_ceil(bytes_per_pixel as u64).max(JPEG_PIXELS_PER_BYTE);
    check_size(path, width.into(), height.into(), bytes.len(), per_byte)?;
    Ok(Opened { decoder, size: (width as usize, height as usize), channels, bytes_per_pixel })
}

fn refused(path: &Path, what: &str) -> Error {
    let known = "gray, RGB and RGBA of 8 or 16 bits or floats are";
    Error::content(path, format!("TIFF picture that is not supported: {what}; {known}"))
}

fn damaged(path: &Path, e: &TiffError) -> Error {
    Error::content(path, format!("TIFF picture that cannot be read: {e}"))
}
