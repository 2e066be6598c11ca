//! What skies made of texels share: bilinear lookups, and sums of texels over the cells of a coarser grid.

use crate::base::image_data::{ImageData, LINEAR8_TO_LINEAR, SRGB8_TO_LINEAR, Texels};
use crate::base::skybox::ChartGrid;
use crate::color::Rgb;
use rayon::prelude::*;

/// A position among texels: that of the first of four, and how far towards the next ones.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tap {
    /// Column of the left texels; may be -1 or the last one.
    pub x: i32,
    /// Row of the upper texels; may be -1 or the last one.
    pub y: i32,
    /// Weight of the right texels.
    pub fx: f32,
    /// Weight of the lower texels.
    pub fy: f32,
}

impl Tap {
    /// From texel coordinates, of which texel i covers [i, i + 1).
    #[inline(always)]
    pub fn new(x: f32, y: f32) -> Self {
        // Both are at least 0, so that truncation is floor once half a texel is added.
        let (x, y) = (x + 0.5, y + 0.5);
        let (ix, iy) = (x as i32, y as i32);
        Tap { x: ix - 1, y: iy - 1, fx: x - ix as f32, fy: y - iy as f32 }
    }
}

/// The bilinear mix of four texels of one picture; the tap must be inside it.
#[inline(always)]
pub(super) fn bilinear(texels: &Texels, width: usize, t: Tap) -> Rgb {
    let i = t.y as usize * width + t.x as usize;
    match texels {
        Texels::Srgb8(v) => mix8(v, &SRGB8_TO_LINEAR, i, width, t),
        Texels::Linear8(v) => mix8(v, &LINEAR8_TO_LINEAR, i, width, t),
        Texels::F32(v) => {
            let (a, b) = (&v[i..i + 2], &v[i + width..i + width + 2]);
            mix([a[0], a[1], b[0], b[1]].map(Rgb::from), t)
        }
    }
}

#[inline(always)]
fn mix8(v: &[[u8; 4]], curve: &[f32; 256], i: usize, width: usize, t: Tap) -> Rgb {
    let (a, b) = (&v[i..i + 2], &v[i + width..i + width + 2]);
    let decode = |p: [u8; 4]| Rgb::new(curve[p[0] as usize], curve[p[1] as usize], curve[p[2] as usize]);
    mix([decode(a[0]), decode(a[1]), decode(b[0]), decode(b[1])], t)
}

/// The mix of the upper left, upper right, lower left and lower right value.
#[inline(always)]
pub(super) fn mix(v: [Rgb; 4], t: Tap) -> Rgb {
    let (gx, gy) = (1.0 - t.fx, 1.0 - t.fy);
    v[0] * (gx * gy) + v[1] * (t.fx * gy) + v[2] * (gx * t.fy) + v[3] * (t.fx * t.fy)
}

/// The largest grid at which a table of eight-bit texels is worth its memory: their range is too small for one texel
/// to matter, and sums over blocks of texels hold what a table can use.
pub(super) fn table_size(texels: &Texels, size: usize, largest: usize) -> usize {
    match texels {
        Texels::F32(_) => size,
        _ => size.min(largest),
    }
}

/// Bytes held by a picture.
pub(super) fn bytes(image: &ImageData) -> u64 {
    let size = if matches!(image.texels, Texels::F32(_)) { 12 } else { 4 };
    (image.width * image.height * size) as u64
}

/// A picture of floats by texel number.
pub(super) fn picture(width: usize, height: usize, texel: impl Fn(usize) -> [f32; 3]) -> ImageData {
    ImageData { width, height, texels: Texels::F32((0..width * height).map(texel).collect()) }
}

/// Luminances of a row of texels.
pub(super) fn luminances(texels: &Texels, range: std::ops::Range<usize>, out: &mut Vec<f32>) {
    match texels {
        Texels::Srgb8(v) => luminances8(&v[range], &SRGB8_TO_LINEAR, out),
        Texels::Linear8(v) => luminances8(&v[range], &LINEAR8_TO_LINEAR, out),
        Texels::F32(v) => out.extend(v[range].iter().map(|&t| Rgb::from(t).luminance())),
    }
}

fn luminances8(v: &[[u8; 4]], curve: &[f32; 256], out: &mut Vec<f32>) {
    out.extend(
        v.iter()
            .map(|p| Rgb::new(curve[p[0] as usize], curve[p[1] as usize], curve[p[2] as usize]).luminance()),
    );
}

/// How texels along one axis, blended linearly from the centre of each to that of the next, fall into cells.
pub(super) struct Spread {
    /// By cell: the first texel that reaches it (-1 is the one before the first) and the weights from there on.
    cells: Vec<(i64, Vec<f32>)>,
}

impl Spread {
    /// Texels of width 1 with one more beyond either end, all alike.
    pub fn even(texels: usize, cells: usize) -> Self {
        let nodes: Vec<f64> = (0..texels + 2).map(|i| i as f64 - 0.5).collect();
        Spread::new(&nodes, cells, |_| 1.0)
    }

    /// `nodes` are the positions of the values, from the one before the first texel to the one past the last; the
    /// cells share the axis from 0 to the number of texels, of which there are at least as many. The weight of a
    /// value is the integral of its share of the blend, times `measure`, over the cell.
    pub fn new(nodes: &[f64], cells: usize, measure: impl Fn(f64) -> f64) -> Self {
        let width = (nodes.len() - 2) as f64 / cells as f64;
        let cell = |c: usize| {
            let (lo, hi) = (c as f64 * width, (c + 1) as f64 * width);
            // Intervals between nodes that overlap the cell.
            let first = nodes.partition_point(|&p| p <= lo).saturating_sub(1);
            let last = nodes.partition_point(|&p| p < hi).min(nodes.len() - 1);
            let mut weights = vec![0f64; last - first + 1];
            for i in first..last {
                let (p, q) = (nodes[i], nodes[i + 1]);
                let (from, to) = (p.max(lo), q.min(hi));
                for (x, w) in GAUSS3 {
                    let t = from + x * (to - from);
                    let share = (t - p) / (q - p);
                    let w = w * (to - from) * measure(t);
                    weights[i - first] += w * (1.0 - share);
                    weights[i + 1 - first] += w * share;
                }
            }
            (first as i64 - 1, weights.into_iter().map(|w| w as f32).collect())
        };
        Spread { cells: (0..cells).map(cell).collect() }
    }

    /// Weighted sums of a row that starts with the texel before the first.
    #[inline(always)]
    fn gather(&self, row: &[f32], scale: f64, out: &mut [f64]) {
        for ((first, weights), out) in self.cells.iter().zip(out) {
            let start = (first + 1) as usize;
            let row = &row[start..start + weights.len()];
            // Four chains, so that the sum is not one of latencies.
            let mut sums = [0f32; 4];
            for (r, w) in row.chunks(4).zip(weights.chunks(4)) {
                for ((s, r), w) in sums.iter_mut().zip(r).zip(w) {
                    *s += r * w;
                }
            }
            *out += f64::from((sums[0] + sums[1]) + (sums[2] + sums[3])) * scale;
        }
    }
}

/// Abscissas and weights of the three-point Gauss rule on [0, 1].
const GAUSS3: [(f64, f64); 3] =
    [(0.112_701_665_379_258_31, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

/// The cells of one axis pair of spreads, and where rows come from.
pub(super) struct CellSums<'a> {
    /// The grid wanted.
    pub grid: ChartGrid,
    /// Columns into cells.
    pub across: &'a Spread,
    /// Rows into cells.
    pub along: &'a Spread,
}

impl CellSums<'_> {
    /// Integrals over all cells. `row(chart, y, out)` appends the luminances of texel row `y`, from -1 to one past
    /// the last, from the texel before the first to the one past the last, times what of the measure the two
    /// spreads do not hold.
    pub fn integrate(&self, row: impl Fn(u32, i64, &mut Vec<f32>) + Sync) -> Vec<f64> {
        let (w, h) = (self.grid.width as usize, self.grid.height as usize);
        let mut out = vec![0.0; self.grid.cells()];
        // Bands of cell rows: a texel row that two bands share is read twice, one that two rows of a band share
        // is not.
        const BAND: usize = 16;
        let bands: Vec<(usize, &mut [f64])> = out
            .chunks_mut(w * h)
            .enumerate()
            .flat_map(|(chart, cells)| {
                cells.chunks_mut(w * BAND).enumerate().map(move |(b, c)| (chart * h + b * BAND, c))
            })
            .collect();
        bands.into_par_iter().for_each(|(first, cells)| {
            let (chart, first) = ((first / h) as u32, first % h);
            let rows = &self.along.cells[first..first + cells.len() / w];
            let mut texels = Vec::new();
            let last = rows.last().map_or(0, |(f, weights)| f + weights.len() as i64);
            for y in rows.first().map_or(0, |r| r.0)..last {
                texels.clear();
                row(chart, y, &mut texels);
                for ((start, weights), out) in rows.iter().zip(cells.chunks_mut(w)) {
                    if let Some(&weight) = weights.get((y - start).max(-1) as usize) {
                        self.across.gather(&texels, f64::from(weight), out);
                    }
                }
            }
        });
        out
    }
}
