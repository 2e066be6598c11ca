//! Formats that hold radiance beside EXR: Radiance HDR, PFM, and TIFF of floats.

use super::shown::put_tiff;
use super::{WriteOptions, colour_planes};
use crate::image::picture::Picture;
use rayon::prelude::*;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use tiff::encoder::colortype;
use tiff::tags::ExtraSamples;

/// Largest value that a pixel of shared exponent holds: 255 * 2^(255 - 136).
const MOST: f32 = 255.0 * (1u128 << 119) as f32;

/// Writes Radiance RGBE (G. Ward, "Real Pixels", Graphics Gems II, 1991) with run lengths by component; how many values
/// it cannot hold: negative ones and NaN become 0, larger ones the largest.
///
/// Mantissas are rounded to the nearest, for readers that take them as they stand, as nearly all do; Ward's own adds a
/// half, and cuts when writing.
pub(super) fn write_hdr(out: &mut File, picture: &Picture) -> io::Result<u64> {
    let [r, g, b] = colour_planes(picture)?;
    let (width, height) = (picture.width, picture.height);
    let rows: Vec<(Vec<u8>, u64)> = (0..height)
        .into_par_iter()
        .map(|y| {
            let mut lost = 0;
            let pixels: Vec<[u8; 4]> =
                (y * width..(y + 1) * width).map(|i| rgbe([r[i], g[i], b[i]], &mut lost)).collect();
            (row(&pixels), lost)
        })
        .collect();
    let mut file = BufWriter::with_capacity(1 << 18, out);
    file.write_all(b"#?RADIANCE\n")?;
    for (key, value) in &picture.metadata {
        // A comment: a variable of the same name would be heeded.
        let line: String = format!("{key}={value}").chars().filter(|c| !c.is_control()).collect();
        writeln!(file, "# {line}")?;
    }
    write!(file, "FORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n")?;
    rows.iter().try_for_each(|(bytes, _)| file.write_all(bytes))?;
    file.flush()?;
    Ok(rows.iter().map(|(_, lost)| lost).sum())
}

/// Three mantissas of one exponent: value = mantissa * 2^(exponent - 136).
fn rgbe(value: [f32; 3], lost: &mut u64) -> [u8; 4] {
    let held = value.map(|v| if v > 0.0 { v.min(MOST) } else { 0.0 });
    *lost += value.iter().zip(held).filter(|(v, held)| **v != *held).count() as u64;
    let largest = held[0].max(held[1]).max(held[2]);
    // Below half a step of the least exponent; subnormal numbers are further down.
    if largest < f32::MIN_POSITIVE {
        return [0; 4];
    }
    // largest = m * 2^e with m in [0.5, 1).
    let exponent = ((largest.to_bits() >> 23) as i32) - 126;
    let scaled = |exponent: i32| {
        let step = 2f64.powi(8 - exponent);
        held.map(|v| (f64::from(v) * step).round())
    };
    let (mut mantissas, mut exponent) = (scaled(exponent), exponent);
    if mantissas.iter().any(|m| *m > 255.0) {
        exponent += 1;
        mantissas = scaled(exponent);
    }
    match u8::try_from(exponent + 128) {
        Ok(e @ 1..) => {
            let [r, g, b] = mantissas.map(|m| m as u8);
            [r, g, b, e]
        }
        _ => [0; 4],
    }
}

/// One scan line: its length, then each component by runs; pixels as they are where the format has no runs.
fn row(pixels: &[[u8; 4]]) -> Vec<u8> {
    let width = pixels.len();
    if !(8..32768).contains(&width) {
        return pixels.concat();
    }
    let mut bytes = vec![2, 2, (width >> 8) as u8, width as u8];
    for component in 0..4 {
        let values: Vec<u8> = pixels.iter().map(|p| p[component]).collect();
        pack(&values, &mut bytes);
    }
    bytes
}

/// Runs of up to 127 equal bytes as 128 + count and the byte; others, up to 128, as their count and themselves.
fn pack(values: &[u8], out: &mut Vec<u8>) {
    /// Two bytes a run, and one to begin the next others.
    const WORTHWHILE: usize = 4;
    let run = |at: usize| values[at..].iter().take(127).take_while(|v| **v == values[at]).count();
    let mut at = 0;
    while at < values.len() {
        let begin = at;
        let mut length = run(at);
        while length < WORTHWHILE && at + length < values.len() {
            at += length;
            length = run(at);
        }
        let others = if length < WORTHWHILE { values.len() } else { at };
        for piece in values[begin..others].chunks(128) {
            out.push(piece.len() as u8);
            out.extend(piece);
        }
        at = others;
        if at < values.len() {
            out.extend([128 + length as u8, values[at]]);
            at += length;
        }
    }
}

/// Rows of the planes that a file of radiance gets, side by side: `Y`, or `R G B`, and `A` where it is wanted.
fn interleaved(picture: &Picture, options: &WriteOptions) -> io::Result<(usize, Vec<f32>)> {
    let gray = picture.plane("R").is_none();
    let mut planes = colour_planes(picture)?.to_vec();
    if gray {
        planes.truncate(1);
    }
    if options.alpha && !gray {
        planes.extend(picture.plane("A").map(|p| &p.data[..]));
    }
    let n = planes.len();
    let mut values = vec![0.0; n * picture.width * picture.height];
    values.par_chunks_mut(n).enumerate().for_each(|(i, pixel)| {
        pixel.iter_mut().zip(&planes).for_each(|(v, plane)| *v = plane[i]);
    });
    Ok((n, values))
}

/// Writes a portable float map, low bytes first: `Pf` of `Y`, `PF` of `R G B`, `PF4` with alpha.
pub(super) fn write_pfm(out: &mut File, picture: &Picture, options: &WriteOptions) -> io::Result<()> {
    let (channels, values) = interleaved(picture, options)?;
    let kind = ["Pf", "PF", "PF4"][channels.saturating_sub(2)];
    let mut file = BufWriter::with_capacity(1 << 18, out);
    write!(file, "{kind}\n{} {}\n-1.0\n", picture.width, picture.height)?;
    // The lowest row stands first.
    for row in values.chunks_exact(channels * picture.width).rev() {
        let bytes: Vec<u8> = row.iter().flat_map(|v| v.to_le_bytes()).collect();
        file.write_all(&bytes)?;
    }
    file.flush()
}

/// Writes a TIFF of 32-bit floats; alpha is multiplied into the colour.
pub(super) fn write_tiff(out: &mut File, picture: &Picture, options: &WriteOptions) -> io::Result<()> {
    let (channels, values) = interleaved(picture, options)?;
    match channels {
        1 => put_tiff::<colortype::Gray32Float>(out, picture, None, &values),
        3 => put_tiff::<colortype::RGB32Float>(out, picture, None, &values),
        _ => {
            let alpha = Some(ExtraSamples::AssociatedAlpha);
            put_tiff::<colortype::RGB32Float>(out, picture, alpha, &values)
        }
    }
}
