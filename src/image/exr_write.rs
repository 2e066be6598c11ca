//! Writes OpenEXR pictures: one scan-line part, ZIP-compressed in blocks of 16 lines on all threads. Written from
//! the "OpenEXR File Layout" document, rather than through a library, for two reasons: the blocks then go through
//! the fast encoder of [`super::deflate`], and the same picture always gives the same bytes.

use super::deflate;
use super::picture::{Picture, Plane, SampleKind};
use half::f16;
use half::slice::HalfFloatSliceExt;
use rayon::prelude::*;
use std::io::{self, Write};
use std::sync::atomic::{AtomicU64, Ordering};

const LINES_PER_BLOCK: usize = 16;

/// Version 2, scan lines, one part; with this bit set where names exceed 31 bytes.
const LONG_NAMES: u32 = 1 << 10;

/// Writes the file. Values beyond the range of a half (65504) are clamped where a plane is stored so; the answer
/// is how many.
pub(super) fn write(out: &mut impl Write, picture: &Picture) -> io::Result<u64> {
    let mut planes: Vec<&Plane> = picture.planes.iter().collect();
    // The format wants channels in alphabetical order, and their lines likewise.
    planes.sort_by(|a, b| a.name.as_bytes().cmp(b.name.as_bytes()));
    let clamped = AtomicU64::new(0);
    let blocks: Vec<Block> = (0..picture.height)
        .step_by(LINES_PER_BLOCK)
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|first| {
            let block = compress(picture, &planes, first);
            clamped.fetch_add(block.clamped, Ordering::Relaxed);
            block
        })
        .collect();
    let header = header(picture, &planes);
    out.write_all(&header)?;
    let mut offset = (header.len() + 8 * blocks.len()) as u64;
    let mut table = Vec::with_capacity(8 * blocks.len());
    for block in &blocks {
        table.extend(offset.to_le_bytes());
        offset += 8 + block.bytes.len() as u64;
    }
    out.write_all(&table)?;
    for (i, block) in blocks.iter().enumerate() {
        let y = (picture.origin[1] + i * LINES_PER_BLOCK) as i32;
        out.write_all(&y.to_le_bytes())?;
        out.write_all(&(block.bytes.len() as i32).to_le_bytes())?;
        out.write_all(&block.bytes)?;
    }
    Ok(clamped.into_inner())
}

fn header(picture: &Picture, planes: &[&Plane]) -> Vec<u8> {
    let long =
        planes.iter().map(|p| &p.name).chain(picture.metadata.iter().map(|m| &m.0)).any(|n| n.len() > 31);
    let mut bytes = vec![0x76, 0x2f, 0x31, 0x01];
    bytes.extend((2 | if long { LONG_NAMES } else { 0 }).to_le_bytes());
    let mut attribute = |name: &str, kind: &str, value: &[u8]| {
        for text in [name, kind] {
            bytes.extend(text.as_bytes());
            bytes.push(0);
        }
        bytes.extend((value.len() as i32).to_le_bytes());
        bytes.extend(value);
    };
    let mut channels = Vec::new();
    for plane in planes {
        channels.extend(plane.name.as_bytes());
        channels.push(0);
        let kind: i32 = if plane.kind == SampleKind::Half { 1 } else { 2 };
        // Sample type; not "perceptually linear", and three reserved bytes; sampling of 1 in x and y.
        [kind, 0, 1, 1].iter().for_each(|v| channels.extend(v.to_le_bytes()));
    }
    channels.push(0);
    let window = |origin: [usize; 2], size: [usize; 2]| -> Vec<u8> {
        let corners = [origin[0], origin[1], origin[0] + size[0] - 1, origin[1] + size[1] - 1];
        corners.iter().flat_map(|&v| (v as i32).to_le_bytes()).collect()
    };
    attribute("channels", "chlist", &channels);
    attribute("compression", "compression", &[3]);
    attribute("dataWindow", "box2i", &window(picture.origin, [picture.width, picture.height]));
    attribute("displayWindow", "box2i", &window([0, 0], picture.frame));
    attribute("lineOrder", "lineOrder", &[0]);
    attribute("pixelAspectRatio", "float", &1f32.to_le_bytes());
    attribute("screenWindowCenter", "v2f", &[0; 8]);
    attribute("screenWindowWidth", "float", &1f32.to_le_bytes());
    for (key, value) in &picture.metadata {
        attribute(key, "string", value.as_bytes());
    }
    bytes.push(0);
    bytes
}

struct Block {
    bytes: Vec<u8>,
    clamped: u64,
}

/// Lines from `first` on: for each line each channel's samples; bytes at even places first, then those at odd
/// ones; each byte as its difference from the one before, plus 128; then zlib. As it was where that is not larger.
fn compress(picture: &Picture, planes: &[&Plane], first: usize) -> Block {
    let width = picture.width;
    let lines = first..picture.height.min(first + LINES_PER_BLOCK);
    let pairs_per_pixel: usize = planes.iter().map(|p| if p.kind == SampleKind::Half { 1 } else { 2 }).sum();
    let half = lines.len() * width * pairs_per_pixel;
    let mut sorted = vec![0u8; 2 * half];
    let (mut even, mut odd) = sorted.split_at_mut(half);
    let mut halfs = vec![f16::ZERO; width];
    let mut in_range = vec![0f32; width];
    let mut clamped = 0;
    for y in lines {
        for plane in planes {
            let line = &plane.data[y * width..(y + 1) * width];
            let pairs = if plane.kind == SampleKind::Half { width } else { 2 * width };
            let (even_line, odd_line);
            (even_line, even) = even.split_at_mut(pairs);
            (odd_line, odd) = odd.split_at_mut(pairs);
            if plane.kind == SampleKind::Float {
                let slots = even_line.chunks_exact_mut(2).zip(odd_line.chunks_exact_mut(2));
                for ((even, odd), value) in slots.zip(line) {
                    let bytes = value.to_le_bytes();
                    even.copy_from_slice(&[bytes[0], bytes[2]]);
                    odd.copy_from_slice(&[bytes[1], bytes[3]]);
                }
                continue;
            }
            let limit = f16::MAX.to_f32();
            in_range.iter_mut().zip(line).for_each(|(to, v)| *to = v.clamp(-limit, limit));
            clamped += line.iter().filter(|v| v.abs() > limit).count() as u64;
            halfs.convert_from_f32_slice(&in_range);
            for ((even, odd), value) in even_line.iter_mut().zip(odd_line).zip(&halfs) {
                [*even, *odd] = value.to_le_bytes();
            }
        }
    }
    let mut differences = sorted.clone();
    for (to, pair) in differences[1..].iter_mut().zip(sorted.windows(2)) {
        *to = pair[1].wrapping_sub(pair[0]).wrapping_add(128);
    }
    // Low and high bytes of the samples differ in nature.
    let mut bytes = deflate::zlib(&differences, &[half]);
    if bytes.len() >= sorted.len() {
        let (even, odd) = sorted.split_at(half);
        bytes = even.iter().zip(odd).flat_map(|(&a, &b)| [a, b]).collect();
    }
    Block { bytes, clamped }
}
