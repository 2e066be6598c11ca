//! Writes pictures to EXR, PNG and JPEG, whole or not at all: into a temporary file of the same folder, flushed to
//! the disk, then renamed.

use super::picture::Picture;
use super::tonemap::Look;
use super::{exr_write, srgb8};
use crate::color::{Rgb, Transfer};
use crate::error::{Error, Result};
use rayon::prelude::*;
use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// What a display format needs to know; EXR holds radiance and ignores it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct WriteOptions {
    /// Exposure and tone operator.
    pub look: Look,
    /// Whether PNG gets the plane `A`. Without it the picture stands on black.
    pub alpha: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Png,
    Jpeg,
    Exr,
}

/// JPEG quality: no visible loss, about a sixth of the PNG.
const JPEG_QUALITY: u8 = 92;

/// Finds out, without leaving a trace, whether a picture could be written there: before a render, not after.
///
/// # Errors
/// An extension other than png, jpg, jpeg or exr; a folder that does not exist or cannot be written to; a folder, a
/// device or a write-protected file in the place of the picture.
pub fn check_writable(path: &Path) -> Result<()> {
    format_of(path)?;
    check_file(path)
}

/// As [`check_writable`], for a file of any kind.
///
/// # Errors
/// As [`check_writable`], whatever the extension.
pub fn check_file(path: &Path) -> Result<()> {
    let target = target_of(path)?;
    temporary(path, &target).map(drop)
}

/// Writes a file of any kind, whole or not at all. A file that stands there is replaced.
///
/// # Errors
/// As [`check_file`]; a disk that is full.
pub fn write_file(path: &Path, content: &[u8]) -> Result<()> {
    let target = target_of(path)?;
    let mut file = temporary(path, &target)?;
    let fail = |e: io::Error| Error::file(path, "write", e);
    file.write_all(content).and_then(|()| file.as_file().sync_all()).map_err(fail)?;
    file.persist(&target).map_err(|e| fail(e.error))?;
    Ok(())
}

/// Writes a picture; the extension of `path` says in which format. A file that stands there is replaced.
///
/// - `exr`: all planes, half or float as each says, ZIP compression, metadata as string attributes.
/// - `png`: `R G B` (or `Y` as gray values), 8 bits through the look and its curve, metadata as text; with
///   [`WriteOptions::alpha`] also `A`, and the colour divided by it, as the format has it.
/// - `jpg`: as `png`, without alpha and metadata.
///
/// # Errors
/// As [`check_writable`]; a disk that is full; for display formats, a picture without `R G B` or `Y`.
pub fn write_picture(path: &Path, picture: &Picture, options: &WriteOptions) -> Result<()> {
    let format = format_of(path)?;
    check_picture(picture)?;
    let target = target_of(path)?;
    let mut file = temporary(path, &target)?;
    let fail = |e: io::Error| Error::file(path, "write", e);
    let out = file.as_file_mut();
    match format {
        Format::Exr => write_exr(path, out, picture).map_err(fail)?,
        Format::Png => write_png(out, picture, options).map_err(fail)?,
        Format::Jpeg => write_jpeg(out, picture, options).map_err(fail)?,
    }
    out.sync_all().map_err(fail)?;
    file.persist(&target).map_err(|e| fail(e.error))?;
    Ok(())
}

fn format_of(path: &Path) -> Result<Format> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    match extension.as_str() {
        "png" => Ok(Format::Png),
        "jpg" | "jpeg" => Ok(Format::Jpeg),
        "exr" => Ok(Format::Exr),
        "" => Err(Error::Usage(format!("{}: has no extension; known: png, jpg, exr", path.display()))),
        _ => Err(Error::Usage(format!(
            "{}: unknown extension \"{extension}\"; known: png, jpg, exr",
            path.display()
        ))),
    }
}

/// What to replace: the file behind a symbolic link rather than the link.
fn target_of(path: &Path) -> Result<PathBuf> {
    let refuse = |reason: &str| Err(Error::file(path, "write", reason));
    let Ok(target) = path.canonicalize() else { return Ok(path.to_owned()) };
    let kind = target.metadata().map_err(|e| Error::file(path, "write", e))?.file_type();
    if kind.is_dir() {
        return refuse("it is a folder");
    }
    if !kind.is_file() {
        return refuse("it is not an ordinary file");
    }
    // Renaming over a write-protected file would work, and not be what its owner meant.
    match OpenOptions::new().write(true).open(&target) {
        Ok(_) => Ok(target),
        Err(e) => Err(Error::file(path, "write", e)),
    }
}

fn temporary(path: &Path, target: &Path) -> Result<tempfile::NamedTempFile> {
    let folder = match target.parent() {
        Some(p) if !p.as_os_str().is_empty() => p,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        let what = if folder.exists() { "is not a folder" } else { "does not exist" };
        return Err(Error::file(path, "write", format!("the folder {} {what}", folder.display())));
    }
    let mut builder = tempfile::Builder::new();
    builder.prefix(".skylit-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // Ordinary permissions, which the process' mask then narrows; a temporary file's own would shut others out.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder).map_err(|e| Error::file(path, "write", e))
}

fn check_picture(picture: &Picture) -> Result<()> {
    let pixels = picture.width * picture.height;
    if pixels == 0 || picture.planes.iter().any(|p| p.data.len() != pixels) {
        return Err(Error::Internal(format!(
            "a picture of {} x {} pixels with planes of another size",
            picture.width, picture.height
        )));
    }
    Ok(())
}

fn write_exr(path: &Path, out: &mut File, picture: &Picture) -> io::Result<()> {
    // Unbuffered: blocks are large, and everything else is one write.
    let clamped = exr_write::write(out, picture)?;
    if clamped > 0 {
        log::warn!("{}: {clamped} values beyond the range of 16-bit floats became 65504", path.display());
    }
    Ok(())
}

/// The byte nearest to the encoding of a linear value; NaN counts as 0.
fn encoder(transfer: Transfer) -> impl Fn(f32) -> u8 {
    move |v| match transfer {
        Transfer::Srgb => srgb8::encode(v),
        Transfer::Gamma(gamma) => {
            // A cast from NaN gives 0.
            (v.clamp(0.0, 1.0).powf(1.0 / gamma) * 255.0).round() as u8
        }
    }
}

/// What a picture of 8 bits shows of a radiance.
pub fn display_bytes(look: &Look, radiance: Rgb) -> [u8; 3] {
    look.apply(radiance).to_array().map(encoder(look.transfer))
}

/// Rows of 8-bit samples, `channels` (3 or 4) a pixel.
fn to_bytes(picture: &Picture, look: &Look, channels: usize) -> io::Result<Vec<u8>> {
    let plane = |name: &str| picture.plane(name).or_else(|| picture.plane("Y")).map(|p| &p.data);
    let (Some(r), Some(g), Some(b)) = (plane("R"), plane("G"), plane("B")) else {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "the picture has no planes R, G, B or Y"));
    };
    let alpha = picture.plane("A").map(|p| &p.data).filter(|_| channels == 4);
    let scale = look.exposure.exp2();
    let encode = encoder(look.transfer);
    let mut bytes = vec![0; picture.width * picture.height * channels];
    bytes.par_chunks_mut(picture.width * channels).enumerate().for_each(|(y, row)| {
        for (x, out) in row.chunks_exact_mut(channels).enumerate() {
            let at = y * picture.width + x;
            let a = alpha.map_or(1.0, |alpha| alpha[at].clamp(0.0, 1.0));
            // The format wants colour not multiplied by alpha.
            let factor = if a > 0.0 { scale / a } else { 0.0 };
            let shown = look.tonemap.apply(Rgb::new(r[at], g[at], b[at]) * factor);
            out[..3].copy_from_slice(&shown.to_array().map(&encode));
            if let Some(last) = out.get_mut(3) {
                *last = (a * 255.0).round() as u8;
            }
        }
    });
    Ok(bytes)
}

fn write_png(out: &mut File, picture: &Picture, options: &WriteOptions) -> io::Result<()> {
    let channels = if options.alpha && picture.plane("A").is_some() { 4 } else { 3 };
    let bytes = to_bytes(picture, &options.look, channels)?;
    let mut file = BufWriter::with_capacity(1 << 18, out);
    let mut encoder = png::Encoder::new(&mut file, picture.width as u32, picture.height as u32);
    encoder.set_color(if channels == 4 { png::ColorType::Rgba } else { png::ColorType::Rgb });
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    // Whoever asks for another curve wants the bytes that a program wrote which said nothing of its curve.
    if options.look.transfer == Transfer::Srgb {
        encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    }
    for (key, value) in &picture.metadata {
        // International text takes any value; only the keyword is restricted, to 79 Latin letters.
        let keyword: String = key.chars().filter(|c| c.is_ascii_graphic() || *c == ' ').take(79).collect();
        encoder.add_itxt_chunk(keyword, value.clone()).map_err(io::Error::other)?;
    }
    let mut writer = encoder.write_header().map_err(io::Error::other)?;
    writer.write_image_data(&bytes).map_err(io::Error::other)?;
    writer.finish().map_err(io::Error::other)?;
    file.flush()
}

fn write_jpeg(out: &mut File, picture: &Picture, options: &WriteOptions) -> io::Result<()> {
    let bytes = to_bytes(picture, &options.look, 3)?;
    let (Ok(width), Ok(height)) = (u16::try_from(picture.width), u16::try_from(picture.height)) else {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "JPEG holds at most 65535 pixels a side"));
    };
    let mut file = BufWriter::with_capacity(1 << 18, out);
    let mut encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(&mut file, JPEG_QUALITY);
    encoder
        .encode(&bytes, width.into(), height.into(), image::ExtendedColorType::Rgb8)
        .map_err(io::Error::other)?;
    file.flush()
}

#[cfg(test)]
mod tests;
