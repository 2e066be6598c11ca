//! What a picture file says of itself.

use super::exr_read;
use super::kind::{Kind, sniff};
use super::load::{LoadOptions, Stored, decode};
use super::read::{guarded, read_bytes};
use crate::error::Result;
use exr::meta::BlockDescription;
use exr::meta::attribute::SampleType;
use exr::meta::header::Header;
use std::path::Path;

/// One part of a file; files of other kinds than EXR have one.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// Empty where it has none.
    pub name: String,
    /// Width and height of the pixels that are stored.
    pub size: [usize; 2],
    /// Where the left top one stands.
    pub origin: [i64; 2],
    /// Where the frame begins.
    pub frame_origin: [i64; 2],
    /// Width and height of the frame.
    pub frame: [usize; 2],
    /// As the file has it, with lines or tiles.
    pub compression: String,
    /// Full name and precision.
    pub channels: Vec<(String, String)>,
    /// Key and value of text attributes.
    pub metadata: Vec<(String, String)>,
}

/// Reads the headers of an EXR file, or all of another one.
///
/// # Errors
/// As [`super::load::load`].
pub fn parts(path: &Path) -> Result<(String, Vec<Part>)> {
    let bytes = read_bytes(path)?;
    let kind = sniff(path, &bytes)?;
    if kind == Kind::Exr {
        let headers = guarded(path, || exr_read::open(path, &bytes).map(|r| r.headers().to_vec()))?;
        return Ok(("EXR".to_owned(), headers.iter().map(part).collect()));
    }
    let loaded = decode(path, &bytes, &LoadOptions::default())?;
    let precision = match loaded.stored {
        Stored::Float if kind == Kind::Hdr => "8 bits and an exponent".to_owned(),
        Stored::Float => "float".to_owned(),
        Stored::Integer { bits, .. } => format!("{bits} bits"),
    };
    let picture = &loaded.picture;
    let size = [picture.width, picture.height];
    let part = Part {
        name: String::new(),
        size,
        origin: [0; 2],
        frame_origin: [0; 2],
        frame: size,
        compression: String::new(),
        channels: picture.planes.iter().map(|p| (p.name.clone(), precision.clone())).collect(),
        metadata: Vec::new(),
    };
    Ok((kind.name().to_owned(), vec![part]))
}

fn part(header: &Header) -> Part {
    let own = &header.own_attributes;
    let display = header.shared_attributes.display_window;
    let blocks = match header.blocks {
        BlockDescription::ScanLines => "scan lines".to_owned(),
        BlockDescription::Tiles(t) => format!("tiles of {}x{}", t.tile_size.x(), t.tile_size.y()),
    };
    let precision = |kind: SampleType| match kind {
        SampleType::F16 => "half",
        SampleType::F32 => "float",
        SampleType::U32 => "whole",
    };
    let channels = header.channels.list.iter();
    Part {
        name: own.layer_name.as_ref().map(ToString::to_string).unwrap_or_default(),
        size: [header.layer_size.x(), header.layer_size.y()],
        origin: [own.layer_position.x().into(), own.layer_position.y().into()],
        frame_origin: [display.position.x().into(), display.position.y().into()],
        frame: [display.size.x(), display.size.y()],
        compression: format!("{}, {blocks}", header.compression),
        channels: channels.map(|c| (c.name.to_string(), precision(c.sample_type).to_owned())).collect(),
        metadata: exr_read::texts(header),
    }
}
