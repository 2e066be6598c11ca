//! OpenEXR pictures through the `exr` crate's block interface: only the wanted layer's largest level is
//! decompressed, and only the wanted channels are kept.

use super::exr_layers::{self, Layer};
use super::picture::{Picture, SampleKind};
use super::read::{DEFLATE_RATIO, check_size, room_for};
use crate::base::image_data::{ImageData, Texels};
use crate::error::{Error, Result};
use exr::block::chunk::{Chunk, CompressedBlock};
use exr::block::reader::{ChunksReader, Reader};
use exr::block::{BlockIndex, UncompressedBlock};
use exr::compression::Compression;
use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, ChannelDescription, SampleType, Text};
use exr::meta::header::Header;
use half::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;
use std::io::Cursor;
use std::path::Path;

/// The colour of the layer that most likely is the picture (see [`exr_layers::main`]); `Y` alone is gray.
pub(super) fn decode_colour(path: &Path, bytes: &[u8]) -> Result<ImageData> {
    let reader = open(path, bytes)?;
    let choice = checked_colour(path, bytes, reader.headers())?;
    let size = reader.headers()[choice.layer].layer_size;
    let (width, height) = (size.x(), size.y());
    let _room = room_for(path, (width, height), 12)?;
    let mut texels = vec![[0f32; 3]; width * height];
    decode_layer(path, reader, choice.layer, |channel, at, values| {
        for (component, &wanted) in choice.channels.iter().enumerate() {
            if wanted == channel {
                texels[at..at + values.len()].iter_mut().zip(values).for_each(|(t, &v)| t[component] = v);
            }
        }
    })?;
    Ok(ImageData { width, height, texels: Texels::F32(texels) })
}

/// Width and height of what [`decode_colour`] makes, by the headers.
pub(super) fn dimensions(path: &Path, bytes: &[u8]) -> Result<(usize, usize)> {
    let reader = open(path, bytes)?;
    let size = reader.headers()[checked_colour(path, bytes, reader.headers())?.layer].layer_size;
    Ok((size.x(), size.y()))
}

fn checked_colour(path: &Path, bytes: &[u8], headers: &[Header]) -> Result<ColourChoice> {
    let layers = exr_layers::layers(headers);
    let choice = exr_layers::main(&layers)
        .and_then(|layer| layer.colour().map(|channels| ColourChoice { layer: layer.part, channels }))
        .ok_or_else(|| Error::content(path, format!("no channels R, G, B or Y; has: {}", names(headers))))?;
    check_layer(path, bytes, &headers[choice.layer])?;
    Ok(choice)
}

/// The layer of this name, or the one that most likely is the picture, by bare names, with text attributes as
/// metadata; its full name, and all layers.
pub(super) fn decode_named(
    path: &Path,
    bytes: &[u8],
    name: Option<&str>,
) -> Result<(Picture, Layer, Vec<Layer>)> {
    let reader = open(path, bytes)?;
    let layers = exr_layers::layers(reader.headers());
    let layer = match name {
        Some(name) => exr_layers::named(&layers, name).map_err(|message| Error::content(path, message))?,
        None => exr_layers::main(&layers).ok_or_else(|| damaged(path, "it has no channels"))?.clone(),
    };
    let picture = decode_channels(path, bytes, reader, layer.part, &layer.channels)?;
    Ok((picture, layer, layers))
}

/// Every channel of the first part, with text attributes as metadata.
pub(super) fn decode_planes(path: &Path, bytes: &[u8]) -> Result<Picture> {
    let reader = open(path, bytes)?;
    let list = &reader.headers()[0].channels.list;
    let channels: Vec<_> = list.iter().enumerate().map(|(i, c)| (c.name.to_string(), i)).collect();
    decode_channels(path, bytes, reader, 0, &channels)
}

/// Every channel of every part, by full names.
pub(super) fn decode_whole(path: &Path, bytes: &[u8]) -> Result<Picture> {
    let headers = open(path, bytes)?.headers().to_vec();
    let layers = exr_layers::layers(&headers);
    let mut whole: Option<Picture> = None;
    for part in 0..headers.len() {
        let channels: Vec<_> = layers
            .iter()
            .filter(|layer| layer.part == part)
            .flat_map(|layer| {
                let full = |bare: &str| match layer.name.is_empty() {
                    true => bare.to_owned(),
                    false => format!("{}.{bare}", layer.name),
                };
                layer.channels.iter().map(move |(bare, at)| (full(bare), *at))
            })
            .collect();
        let picture = decode_channels(path, bytes, open(path, bytes)?, part, &channels)?;
        let Some(whole) = &mut whole else {
            whole = Some(picture);
            continue;
        };
        let window = |p: &Picture| (p.width, p.height, p.origin, p.frame);
        if window(whole) != window(&picture) {
            return Err(Error::content(path, "its parts have different windows: choose one layer"));
        }
        whole.planes.extend(picture.planes);
    }
    whole.ok_or_else(|| damaged(path, "it has no parts"))
}

/// Channels of one part, each by the name that is given with its index.
fn decode_channels(
    path: &Path,
    bytes: &[u8],
    reader: Reader<Cursor<&[u8]>>,
    part: usize,
    channels: &[(String, usize)],
) -> Result<Picture> {
    let header = &reader.headers()[part];
    check_layer(path, bytes, header)?;
    let (width, height) = (header.layer_size.x(), header.layer_size.y());
    let _room = room_for(path, (width, height), 4 * channels.len())?;
    let mut picture = Picture::new(width, height);
    picture.set_frame_from(header);
    let mut plane_of = vec![None; header.channels.list.len()];
    for (name, index) in channels {
        if picture.plane(name).is_some() {
            return Err(damaged(path, format!("two channels are called {name}")));
        }
        let half = header.channels.list[*index].sample_type == SampleType::F16;
        let kind = if half { SampleKind::Half } else { SampleKind::Float };
        plane_of[*index] = Some(picture.planes.len());
        picture.push(name, kind, vec![0.0; width * height]);
    }
    decode_layer(path, reader, part, |channel, at, values| {
        if let Some(plane) = plane_of[channel] {
            picture.planes[plane].data[at..at + values.len()].copy_from_slice(values);
        }
    })?;
    Ok(picture)
}

impl Picture {
    fn set_frame_from(&mut self, header: &Header) {
        let display = header.shared_attributes.display_window;
        let position = header.own_attributes.layer_position;
        // Windows may lie at both ends of the range.
        let apart = |a: i32, b: i32| i64::from(a) - i64::from(b);
        let from = display.position;
        let offset = [apart(position.x(), from.x()), apart(position.y(), from.y())];
        let size = [self.width, self.height];
        for axis in 0..2 {
            // A data window that reaches over the display window keeps its pixels and becomes the frame.
            self.origin[axis] = usize::try_from(offset[axis]).unwrap_or(0);
            let shown = if axis == 0 { display.size.x() } else { display.size.y() };
            self.frame[axis] = shown.max(self.origin[axis] + size[axis]);
        }
        self.metadata = texts(header);
    }
}

/// Key and value of all text attributes, sorted.
pub(super) fn texts(header: &Header) -> Vec<(String, String)> {
    let mut all = Vec::new();
    let mut keep = |key: &str, text: &Text| {
        // Written as UTF-8 by this program and most others; the library would take the bytes for Latin 1.
        all.push((key.to_owned(), String::from_utf8_lossy(text.as_slice()).into_owned()));
    };
    let own = &header.own_attributes;
    let known = [("software", &own.software_name), ("comments", &own.comments), ("owner", &own.owner)];
    known.iter().for_each(|(key, text)| text.iter().for_each(|text| keep(key, text)));
    for (key, value) in own.other.iter().chain(&header.shared_attributes.other) {
        if let AttributeValue::Text(text) = value {
            keep(&key.to_string(), text);
        }
    }
    all.sort();
    all
}

pub(super) fn open<'a>(path: &Path, bytes: &'a [u8]) -> Result<Reader<Cursor<&'a [u8]>>> {
    exr::block::read(Cursor::new(bytes), false).map_err(|e| damaged(path, e))
}

fn damaged(path: &Path, e: impl std::fmt::Display) -> Error {
    Error::content(path, format!("EXR picture that cannot be read: {e}"))
}

fn names(headers: &[Header]) -> String {
    let all: Vec<String> =
        headers.iter().flat_map(|h| h.channels.list.iter()).take(20).map(|c| c.name.to_string()).collect();
    all.join(", ")
}

struct ColourChoice {
    layer: usize,
    /// Channel indices of red, green and blue.
    channels: [usize; 3],
}

fn check_layer(path: &Path, bytes: &[u8], header: &Header) -> Result<()> {
    let (width, height) = (header.layer_size.x() as u64, header.layer_size.y() as u64);
    let per_pixel = header.channels.bytes_per_pixel.max(1) as u64;
    check_size(path, width, height, bytes.len(), DEFLATE_RATIO.div_ceil(per_pixel))?;
    let subsampled = |c: &&ChannelDescription| c.sampling.x() != 1 || c.sampling.y() != 1;
    if let Some(channel) = header.channels.list.iter().find(subsampled) {
        return Err(damaged(
            path,
            format!("channel {} is subsampled (luminance-chroma files are not supported)", channel.name),
        ));
    }
    if header.shared_attributes.chromaticities.is_some_and(|c| !is_rec709(&c)) {
        log::warn!("{}: its primaries are not Rec. 709; its values are used as if they were", path.display());
    }
    Ok(())
}

fn is_rec709(c: &exr::meta::attribute::Chromaticities) -> bool {
    // ITU-R BT.709-6, items 1.3 and 1.4.
    let known = [(c.red, 0.64, 0.33), (c.green, 0.30, 0.60), (c.blue, 0.15, 0.06), (c.white, 0.3127, 0.3290)];
    known.iter().all(|(p, x, y)| (p.x() - x).abs() < 1e-3 && (p.y() - y).abs() < 1e-3)
}

/// Decompresses the largest level of one layer on all threads and hands `line` each run of samples: channel,
/// index of its first pixel in the picture, values.
fn decode_layer(
    path: &Path,
    reader: Reader<Cursor<&[u8]>>,
    layer: usize,
    mut line: impl FnMut(usize, usize, &[f32]),
) -> Result<()> {
    let wanted = |_: &MetaData, _, block: BlockIndex| {
        block.layer == layer && block.level.x() == 0 && block.level.y() == 0
    };
    let mut chunks = reader.filter_chunks(false, wanted).map_err(|e| damaged(path, e))?;
    let meta = chunks.meta_data().clone();
    let channels = &meta.headers[layer].channels;
    let width = meta.headers[layer].layer_size.x();
    let mut values = Vec::new();
    let batch_size = 4 * rayon::current_num_threads();
    loop {
        let batch: Vec<Chunk> = chunks
            .by_ref()
            .take(batch_size)
            .collect::<exr::error::Result<_>>()
            .map_err(|e| damaged(path, e))?;
        if batch.is_empty() {
            return Ok(());
        }
        let blocks: Vec<UncompressedBlock> = batch
            .into_par_iter()
            .map(|chunk| {
                check_chunk(&chunk, &meta.headers[layer]).map_err(|what| damaged(path, what))?;
                UncompressedBlock::decompress_chunk(chunk, &meta, false).map_err(|e| damaged(path, e))
            })
            .collect::<Result<_>>()?;
        for block in blocks {
            if block.index.layer != layer
                || block.data.len() < block.index.pixel_size.area() * channels.bytes_per_pixel
            {
                return Err(damaged(path, "a chunk is not where the offset table says"));
            }
            for run in block.lines(channels) {
                let at = run.location;
                to_floats(channels.list[at.channel].sample_type, run.value, &mut values);
                line(at.channel, at.position.y() * width + at.position.x(), &values);
            }
        }
    }
}

/// The decoder of DWAA and DWAB allocates what a chunk's counters ask for, and a failed allocation ends the
/// process; so they are compared with the chunk's pixels first.
fn check_chunk(chunk: &Chunk, header: &Header) -> std::result::Result<(), &'static str> {
    if !matches!(header.compression, Compression::DWAA(_) | Compression::DWAB(_)) {
        return Ok(());
    }
    let data = match &chunk.compressed_block {
        CompressedBlock::ScanLine(block) => &block.compressed_pixels_le,
        CompressedBlock::Tile(block) => &block.compressed_pixels_le,
        _ => return Err("deep data"),
    };
    // What packing would not make smaller stands as it is, and has no counters.
    if data.len() as u64 == unpacked_size(chunk, header) {
        return Ok(());
    }
    let size = header.max_block_pixel_size();
    // Whole 8 x 8 blocks of every channel, and four times that for run lengths that do not pay.
    let samples = (size.x() + 8) * (size.y() + 8) * header.channels.list.len();
    let most = 4 * 4 * samples as u64;
    // OpenEXR's internal_dwa_compressor.h: eleven counters, of which 1, 6, 7, 8 and 9 are unpacked sizes.
    let counter =
        |i: usize| data.get(8 * i..8 * i + 8).and_then(|b| b.try_into().ok()).map(u64::from_le_bytes);
    let sound = [1, 6, 7, 8, 9].into_iter().all(|i| counter(i).is_none_or(|n| n <= most));
    if sound { Ok(()) } else { Err("a chunk claims more than its pixels") }
}

/// Bytes of a chunk's pixels at the finest level; those at the borders of the picture have fewer.
fn unpacked_size(chunk: &Chunk, header: &Header) -> u64 {
    let (whole, picture) = (header.max_block_pixel_size(), header.layer_size);
    // Where the block begins, from the picture's first pixel; a damaged file may say anything.
    let begin = match &chunk.compressed_block {
        CompressedBlock::ScanLine(block) => {
            let first = header.own_attributes.layer_position.y();
            [0, i64::from(block.y_coordinate) - i64::from(first)]
        }
        CompressedBlock::Tile(block) => {
            let at = |index: usize, size: usize| index.checked_mul(size).map_or(-1, |n| n as i64);
            [at(block.coordinates.tile_index.x(), whole.x()), at(block.coordinates.tile_index.y(), whole.y())]
        }
        _ => return 0,
    };
    let side = |begin: i64, whole: usize, picture: usize| match u64::try_from(begin) {
        Ok(begin) => (whole as u64).min((picture as u64).saturating_sub(begin)),
        Err(_) => 0,
    };
    let pixels = side(begin[0], whole.x(), picture.x()) * side(begin[1], whole.y(), picture.y());
    pixels.saturating_mul(header.channels.bytes_per_pixel as u64)
}

/// Native-endian samples to floats.
fn to_floats(kind: SampleType, bytes: &[u8], out: &mut Vec<f32>) {
    out.clear();
    match kind {
        SampleType::F16 => {
            let halfs: Vec<f16> = bytes.chunks_exact(2).map(|b| f16::from_ne_bytes([b[0], b[1]])).collect();
            out.resize(halfs.len(), 0.0);
            halfs.convert_to_f32_slice(out);
        }
        SampleType::F32 => {
            out.extend(bytes.chunks_exact(4).map(|b| f32::from_ne_bytes([b[0], b[1], b[2], b[3]])))
        }
        SampleType::U32 => {
            out.extend(bytes.chunks_exact(4).map(|b| u32::from_ne_bytes([b[0], b[1], b[2], b[3]]) as f32));
        }
    }
}
