//! The kinds of picture files, told by their first bytes and never by their names.

use crate::error::{Error, Result};
use std::path::Path;

/// A kind of picture file that is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Png,
    Jpeg,
    Hdr,
    Exr,
    Tiff,
    Pfm,
}

impl Kind {
    /// As messages have it.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Png => "PNG",
            Kind::Jpeg => "JPEG",
            Kind::Hdr => "Radiance HDR",
            Kind::Exr => "EXR",
            Kind::Tiff => "TIFF",
            Kind::Pfm => "PFM",
        }
    }
}

/// Bytes that tell every kind.
pub(super) const LONGEST_MAGIC: u64 = 10;

pub(super) const PNG_MAGIC: &[u8] = b"\x89PNG\r\n\x1a\n";

/// What is read, as messages list it.
const KNOWN: &str = "PNG, JPEG, Radiance HDR, EXR, TIFF, PFM";

/// First bytes of each kind. TIFF and BigTIFF come in both byte orders (TIFF 6.0, section 2).
const MAGICS: [(&[u8], Kind); 14] = [
    (PNG_MAGIC, Kind::Png),
    (b"\xff\xd8\xff", Kind::Jpeg),
    (b"#?RADIANCE", Kind::Hdr),
    (b"#?RGBE", Kind::Hdr),
    (b"\x76\x2f\x31\x01", Kind::Exr),
    (b"II*\0", Kind::Tiff),
    (b"MM\0*", Kind::Tiff),
    (b"II+\0", Kind::Tiff),
    (b"MM\0+", Kind::Tiff),
    (b"PF4", Kind::Pfm),
    (b"PF\n", Kind::Pfm),
    (b"Pf\n", Kind::Pfm),
    (b"PF\r", Kind::Pfm),
    (b"Pf\r", Kind::Pfm),
];

/// The kind of a file that begins with `bytes`.
///
/// # Errors
/// An empty file; one that begins as no known kind does.
pub(super) fn sniff(path: &Path, bytes: &[u8]) -> Result<Kind> {
    MAGICS.iter().find(|(magic, _)| bytes.starts_with(magic)).map(|&(_, kind)| kind).ok_or_else(|| {
        let what = if bytes.is_empty() { "the file is empty" } else { "not a picture of a known format" };
        Error::content(path, format!("{what}; known: {KNOWN}"))
    })
}
