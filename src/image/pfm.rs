//! Portable float maps (P. Debevec, "PFM Portable FloatMap Image Format"): `Pf` gray, `PF` colour, and `PF4` with
//! alpha. Rows stand from the bottom up; the sign of the scale tells the byte order, and its size is a factor.

use super::raw::{Raw, Samples};
use super::read::{check_size, room_for};
use crate::error::{Error, Result};
use std::path::Path;

struct Header<'a> {
    width: usize,
    height: usize,
    channels: usize,
    /// Its sign: whether the low byte stands first. Its size: what values are multiplied by.
    scale: f32,
    data: &'a [u8],
}

/// Width and height, by the header.
pub(super) fn dimensions(path: &Path, bytes: &[u8]) -> Result<(usize, usize)> {
    header(path, bytes).map(|h| (h.width, h.height))
}

/// Decodes a whole file.
pub(super) fn decode(path: &Path, bytes: &[u8]) -> Result<Raw> {
    let Header { width, height, channels, scale, data } = header(path, bytes)?;
    let _room = room_for(path, (width, height), 4 * channels)?;
    let value = |b: &[u8]| {
        let b = [b[0], b[1], b[2], b[3]];
        let v = if scale < 0.0 { f32::from_le_bytes(b) } else { f32::from_be_bytes(b) };
        v * scale.abs()
    };
    let rows = data.chunks_exact(4 * width * channels).take(height).rev();
    let samples = rows.flat_map(|row| row.chunks_exact(4).map(value)).collect();
    Ok(Raw { width, height, channels, samples: Samples::F32(samples) })
}

fn header<'a>(path: &Path, bytes: &'a [u8]) -> Result<Header<'a>> {
    let fail = |message: &str| Error::content(path, format!("damaged PFM picture: {message}"));
    let mut rest = bytes;
    let mut word = || -> Option<&str> {
        let begin = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let end = begin + rest[begin..].iter().position(u8::is_ascii_whitespace)?;
        let word = std::str::from_utf8(&rest[begin..end]).ok();
        // One byte of white space ends the header; the next may already be a value.
        rest = &rest[end + 1..];
        word
    };
    let channels = match word() {
        Some("Pf") => 1,
        Some("PF") => 3,
        Some("PF4") => 4,
        _ => return Err(fail("the first line is neither PF nor Pf nor PF4")),
    };
    let mut side = || word().and_then(|w| w.parse::<u32>().ok());
    let (Some(width), Some(height)) = (side(), side()) else {
        return Err(fail("width and height do not stand behind the first line"));
    };
    let scale = word().and_then(|w| w.parse::<f32>().ok()).filter(|s| s.is_finite() && *s != 0.0);
    let scale = scale.ok_or_else(|| fail("no scale (1.0 or -1.0, by byte order) stands behind the size"))?;
    check_size(path, width.into(), height.into(), bytes.len(), 1)?;
    let (width, height) = (width as usize, height as usize);
    let needed = 4 * width * height * channels;
    if rest.len() < needed {
        return Err(fail(&format!(
            "the file ends early: {needed} bytes of values are due, {} stand",
            rest.len()
        )));
    }
    Ok(Header { width, height, channels, scale, data: rest })
}
