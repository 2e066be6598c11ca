//! Writes pictures to EXR, PNG, JPEG, Radiance HDR, PFM and TIFF, whole or not at all: into a temporary file of the
//! same folder, flushed to the disk, then renamed.

mod radiance;
mod shown;

pub use shown::display_bytes;

use super::exr_write;
use super::picture::Picture;
use super::tonemap::Look;
use crate::error::{Error, Result};
use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// What a display format needs to know; EXR, HDR, PFM and TIFF of floats hold radiance and ignore the look.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct WriteOptions {
    /// Exposure and tone operator.
    pub look: Look,
    /// Whether PNG, PFM and TIFF get the plane `A`. Without it the picture stands on black.
    pub alpha: bool,
    /// Bits a sample where a format has a choice: 8 or 16 of PNG, 8, 16 or 32 (floats) of TIFF. What is usual (8, and 32
    /// of TIFF) where it is not said.
    pub bits: Option<u32>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Format {
    Png,
    Jpeg,
    Exr,
    Hdr,
    Pfm,
    Tiff,
}

/// Endings of picture files that are written; the first of each format is the usual one.
const ENDINGS: [(&str, Format); 8] = [
    ("png", Format::Png),
    ("jpg", Format::Jpeg),
    ("jpeg", Format::Jpeg),
    ("exr", Format::Exr),
    ("hdr", Format::Hdr),
    ("pfm", Format::Pfm),
    ("tiff", Format::Tiff),
    ("tif", Format::Tiff),
];

/// What is written, as messages list it.
pub const KNOWN: &str = "png, jpg, exr, hdr, pfm, tiff";

/// Finds out, without leaving a trace, whether a picture could be written there: before a render, not after.
///
/// # Errors
/// An unknown extension; a folder that does not exist or cannot be written to; a folder, a
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

/// Whether a path ends as pictures do that are written.
pub fn is_picture(path: &Path) -> bool {
    format_of(path).is_ok()
}

/// Whether a picture of this name and so many bits a sample holds radiance, so that no look is applied.
///
/// # Errors
/// An unknown extension; bits that the format does not have.
pub fn holds_radiance(path: &Path, bits: Option<u32>) -> Result<bool> {
    let format = format_of(path)?;
    check_bits(path, format, bits)?;
    Ok(match format {
        Format::Exr | Format::Hdr | Format::Pfm => true,
        Format::Tiff => bits.is_none_or(|b| b == 32),
        Format::Png | Format::Jpeg => false,
    })
}

/// Writes a picture; the extension of `path` says in which format. A file that stands there is replaced.
///
/// - `exr`: all planes, half or float as each says, ZIP compression, metadata as string attributes.
/// - `png`: `R G B` (or `Y` as gray values), 8 or 16 bits through the look and its curve, metadata as text; with
///   [`WriteOptions::alpha`] also `A`, and the colour divided by it, as the format has it.
/// - `jpg`: as `png`, without alpha and metadata.
/// - `hdr`: `R G B` (or `Y`) as mantissas of 8 bits with a shared exponent, metadata as comments.
/// - `pfm`: `R G B` or `Y` as 32-bit floats; with [`WriteOptions::alpha`] also `A`.
/// - `tiff`: as `pfm`, or of 8 or 16 bits as `png`; without metadata.
///
/// Values that a format cannot hold are counted in one warning.
///
/// # Errors
/// As [`check_writable`]; a disk that is full; bits that the format does not have; but for EXR, a picture without
/// `R G B` or `Y`.
pub fn write_picture(path: &Path, picture: &Picture, options: &WriteOptions) -> Result<()> {
    let format = format_of(path)?;
    check_bits(path, format, options.bits)?;
    check_picture(picture)?;
    let target = target_of(path)?;
    let mut file = temporary(path, &target)?;
    let fail = |e: io::Error| Error::file(path, "write", e);
    let out = file.as_file_mut();
    let (lost, what) = match format {
        // Unbuffered: blocks are large, and everything else is one write.
        Format::Exr => {
            (exr_write::write(out, picture), "values beyond the range of 16-bit floats became 65504")
        }
        Format::Png => (shown::write_png(out, picture, options), NO_NUMBERS),
        Format::Jpeg => (shown::write_jpeg(out, picture, options), NO_NUMBERS),
        Format::Tiff if options.bits.is_some_and(|b| b < 32) => {
            (shown::write_tiff(out, picture, options), NO_NUMBERS)
        }
        Format::Tiff => (radiance::write_tiff(out, picture, options).map(|()| 0), ""),
        Format::Pfm => (radiance::write_pfm(out, picture, options).map(|()| 0), ""),
        Format::Hdr => (
            radiance::write_hdr(out, picture),
            "values that are negative, not finite or beyond 1.7e38 became 0 or the largest",
        ),
    };
    let lost = lost.map_err(fail)?;
    if lost > 0 {
        log::warn!("{}: {lost} {what}", path.display());
    }
    out.sync_all().map_err(fail)?;
    file.persist(&target).map_err(|e| fail(e.error))?;
    Ok(())
}

const NO_NUMBERS: &str = "pixels had values that are no numbers, and are shown as 0";

fn format_of(path: &Path) -> Result<Format> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    if let Some((_, format)) = ENDINGS.iter().find(|(e, _)| *e == extension) {
        return Ok(*format);
    }
    let path = path.display();
    Err(Error::Usage(match extension.is_empty() {
        true => format!("{path}: has no extension; known: {KNOWN}"),
        false => format!("{path}: unknown extension \"{extension}\"; known: {KNOWN}"),
    }))
}

fn check_bits(path: &Path, format: Format, bits: Option<u32>) -> Result<()> {
    let (known, words): (&[u32], _) = match format {
        Format::Png => (&[8, 16], "8 or 16"),
        Format::Tiff => (&[8, 16, 32], "8, 16 or 32"),
        Format::Jpeg | Format::Hdr => (&[8], "8"),
        Format::Pfm => (&[32], "32"),
        // As each plane says.
        Format::Exr => (&[16, 32], "16 or 32"),
    };
    match bits.filter(|bits| !known.contains(bits)) {
        None => Ok(()),
        Some(bits) => {
            let path = path.display();
            Err(Error::Usage(format!("{path}: {bits} bits a sample are not possible there, but {words}")))
        }
    }
}

/// The planes `R G B`, or `Y` thrice.
fn colour_planes(picture: &Picture) -> io::Result<[&[f32]; 3]> {
    let plane = |name: &str| picture.plane(name).or_else(|| picture.plane("Y")).map(|p| &p.data[..]);
    match (plane("R"), plane("G"), plane("B")) {
        (Some(r), Some(g), Some(b)) => Ok([r, g, b]),
        _ => Err(io::Error::new(io::ErrorKind::InvalidInput, "the picture has no planes R, G, B or Y")),
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

#[cfg(test)]
mod tests;
