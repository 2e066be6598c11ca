//! Radiance RGBE pictures (G. Ward, "Real Pixels", Graphics Gems II, 1991; the run-length forms as in
//! Radiance's `filefmts.pdf`): flat, old and new run-length coding, all eight orientations.

use super::raw::{Raw, Samples};
use super::read::{check_size, room_for};
use crate::error::{Error, Result};
use std::path::Path;

/// New run-length coding needs two bytes for 127 values of one of four components: 16 pixels a byte. Old
/// coding can do better on constant pictures (up to 64 with one repeat record a pixel).
const PIXELS_PER_BYTE: u64 = 64;

struct Header<'a> {
    /// Pixels in a scan line as stored.
    run: usize,
    /// Stored scan lines.
    lines: usize,
    layout: Layout,
    data: &'a [u8],
}

/// Where stored pixels go: texel index = start + line * per_line + i * per_pixel.
struct Layout {
    width: usize,
    height: usize,
    start: isize,
    per_line: isize,
    per_pixel: isize,
}

/// Decodes a whole file. The `EXPOSURE` of the header is not undone (as other renderers do); it is logged.
pub(super) fn decode(path: &Path, bytes: &[u8]) -> Result<Raw> {
    let header = parse_header(path, bytes)?;
    let layout = &header.layout;
    let _room = room_for(path, (layout.width, layout.height), 12)?;
    let mut samples = vec![0f32; 3 * layout.width * layout.height];
    let (texels, _) = samples.as_chunks_mut::<3>();
    let scale: Vec<f32> = (0..256).map(exponent_scale).collect();
    let mut rows = RowReader { data: header.data, row: vec![[0; 4]; header.run] };
    for line in 0..header.lines {
        rows.next().map_err(|what| {
            Error::content(path, format!("damaged HDR picture: {what} in row {line} of {}", header.lines))
        })?;
        let first = layout.start + line as isize * layout.per_line;
        for (i, &[r, g, b, e]) in rows.row.iter().enumerate() {
            let s = scale[usize::from(e)];
            let at = first + i as isize * layout.per_pixel;
            texels[at as usize] = [f32::from(r) * s, f32::from(g) * s, f32::from(b) * s];
        }
    }
    Ok(Raw { width: layout.width, height: layout.height, channels: 3, samples: Samples::F32(samples) })
}

/// Width and height, by the header.
pub(super) fn dimensions(path: &Path, bytes: &[u8]) -> Result<(usize, usize)> {
    parse_header(path, bytes).map(|h| (h.layout.width, h.layout.height))
}

/// Value of one mantissa step: 2^(e - 128 - 8), 0 for e = 0.
fn exponent_scale(e: i32) -> f32 {
    if e == 0 { 0.0 } else { 2f64.powi(e - 136) as f32 }
}

fn parse_header<'a>(path: &Path, bytes: &'a [u8]) -> Result<Header<'a>> {
    let fail = |message: &str| Error::content(path, format!("damaged HDR picture: {message}"));
    let mut rest = bytes;
    loop {
        let line = take_line(&mut rest).ok_or_else(|| fail("the header has no end"))?;
        if line.is_empty() {
            break;
        }
        if line == b"FORMAT=32-bit_rle_xyze" {
            return Err(fail("XYZE colours are not supported, only RGBE"));
        }
        if let Some(exposure) = line.strip_prefix(b"EXPOSURE=") {
            log::info!(
                "{}: EXPOSURE={} not undone",
                path.display(),
                String::from_utf8_lossy(exposure).trim()
            );
        }
    }
    let line = take_line(&mut rest).ok_or_else(|| fail("no resolution line"))?;
    let bad = || fail("the resolution line is not of the form `-Y height +X width`");
    let line = std::str::from_utf8(line).map_err(|_| bad())?;
    let mut words = line.split_ascii_whitespace();
    let mut axis = || Some((words.next()?, words.next()?.parse::<u32>().ok()?));
    let (first, lines) = axis().ok_or_else(bad)?;
    let (second, run) = axis().ok_or_else(bad)?;
    check_size(path, run.into(), lines.into(), bytes.len(), PIXELS_PER_BYTE)?;
    let (lines, run) = (lines as usize, run as usize);
    let layout = layout(first, lines, second, run).ok_or_else(bad)?;
    Ok(Header { run, lines, layout, data: rest })
}

fn take_line<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let end = rest.iter().position(|&b| b == b'\n')?;
    let line = &rest[..end];
    *rest = &rest[end + 1..];
    Some(line.strip_suffix(b"\r").unwrap_or(line))
}

/// `-Y` runs from the top row down, `+X` from left to right; the first axis is the slow one.
fn layout(first: &str, lines: usize, second: &str, run: usize) -> Option<Layout> {
    let (width, height) = if first.ends_with('Y') { (run, lines) } else { (lines, run) };
    let mut start = 0;
    let mut step = |axis: &str| {
        let (count, stride, forward) = match axis {
            "-Y" => (height, width as isize, true),
            "+Y" => (height, width as isize, false),
            "+X" => (width, 1, true),
            "-X" => (width, 1, false),
            _ => return None,
        };
        if !forward {
            start += (count as isize - 1) * stride;
        }
        Some(if forward { stride } else { -stride })
    };
    let per_line = step(first)?;
    let per_pixel = step(second)?;
    (first[1..] != second[1..]).then_some(Layout { width, height, start, per_line, per_pixel })
}

struct RowReader<'a> {
    data: &'a [u8],
    row: Vec<[u8; 4]>,
}

type RowResult<T> = std::result::Result<T, &'static str>;

impl RowReader<'_> {
    fn take(&mut self, n: usize) -> RowResult<&[u8]> {
        let (head, tail) = self.data.split_at_checked(n).ok_or("the file ends early")?;
        self.data = tail;
        Ok(head)
    }

    fn pixel(&mut self) -> RowResult<[u8; 4]> {
        self.take(4).map(|p| [p[0], p[1], p[2], p[3]])
    }

    /// Decodes the next scan line into `row`.
    fn next(&mut self) -> RowResult<()> {
        let head = self.pixel()?;
        let is_new = head[0] == 2 && head[1] == 2 && head[2] < 128 && (8..32768).contains(&self.row.len());
        if !is_new {
            return self.old_row(head);
        }
        if usize::from(head[2]) << 8 | usize::from(head[3]) != self.row.len() {
            return Err("wrong scan line length");
        }
        (0..4).try_for_each(|component| self.component(component))
    }

    fn component(&mut self, c: usize) -> RowResult<()> {
        let mut x = 0;
        while x < self.row.len() {
            let code = usize::from(self.take(1)?[0]);
            let n = if code > 128 { code - 128 } else { code };
            if n == 0 || x + n > self.row.len() {
                return Err("bad run length");
            }
            let (head, tail) =
                self.data.split_at_checked(if code > 128 { 1 } else { n }).ok_or("the file ends early")?;
            self.data = tail;
            let target = &mut self.row[x..x + n];
            if code > 128 {
                target.iter_mut().for_each(|p| p[c] = head[0]);
            } else {
                target.iter_mut().zip(head).for_each(|(p, &v)| p[c] = v);
            }
            x += n;
        }
        Ok(())
    }

    /// Flat pixels; (1, 1, 1, n) repeats the pixel before n times, and such records in sequence form a number
    /// with the least significant byte first.
    fn old_row(&mut self, head: [u8; 4]) -> RowResult<()> {
        let mut pixel = head;
        let mut x = 0;
        let mut shift = 0;
        loop {
            if pixel[..3] == [1, 1, 1] {
                let n = usize::from(pixel[3]).checked_shl(shift).unwrap_or(usize::MAX);
                if x == 0 || n > self.row.len() - x {
                    return Err("bad run length");
                }
                let last = self.row[x - 1];
                self.row[x..x + n].fill(last);
                x += n;
                shift = (shift + 8).min(24);
            } else {
                self.row[x] = pixel;
                x += 1;
                shift = 0;
            }
            if x == self.row.len() {
                return Ok(());
            }
            pixel = self.pixel()?;
        }
    }
}
