//! Pictures averaged down, for footprints wider than a texel.

use crate::base::image_data::{ImageData, Texels};
use crate::color::linear_to_srgb;
use std::sync::Arc;

/// A picture while it is being halved: linear floats.
struct Plane {
    width: usize,
    height: usize,
    texels: Vec<[f32; 3]>,
}

/// The levels below `image`, each half the size of the one before (rounded down, at least 1), down to one texel;
/// stored in the format of `image`, whose bytes `curve` decodes. Each is averaged from the unrounded one before.
pub(super) fn chain(image: &ImageData, curve: &[f32; 256]) -> Vec<Arc<ImageData>> {
    let encode = encoder(curve);
    let mut levels = Vec::new();
    let mut plane: Option<Plane> = None;
    let (mut width, mut height) = (image.width, image.height);
    while width > 1 || height > 1 {
        let next = match &plane {
            None => halve(width, height, |i| match &image.texels {
                Texels::Srgb8(t) | Texels::Linear8(t) => [0, 1, 2].map(|c| curve[t[i][c] as usize]),
                Texels::F32(t) => t[i],
            }),
            Some(p) => halve(width, height, |i| p.texels[i]),
        };
        (width, height) = (next.width, next.height);
        let bytes = || next.texels.iter().map(|t| [encode(t[0]), encode(t[1]), encode(t[2]), 255]).collect();
        let texels = match &image.texels {
            Texels::Srgb8(_) => Texels::Srgb8(bytes()),
            Texels::Linear8(_) => Texels::Linear8(bytes()),
            Texels::F32(_) => Texels::F32(next.texels.clone()),
        };
        levels.push(Arc::new(ImageData { width, height, texels }));
        plane = Some(next);
    }
    levels
}

/// The inverse of the decoding curve, to the nearest code.
fn encoder(curve: &[f32; 256]) -> impl Fn(f32) -> u8 + use<> {
    // The one code that the two curves there are tell apart best.
    let linear = (curve[128] - 128.0 / 255.0).abs() < 1e-3;
    move |v| {
        let e = if linear { v.clamp(0.0, 1.0) } else { linear_to_srgb(v) };
        (e * 255.0 + 0.5) as u8
    }
}

/// The source texels that a texel of the half-sized row covers, with their weights, which add up to 1: two, or
/// three if `n` is odd. Every source texel counts alike in the end, so that the mean is kept.
struct Span {
    first: usize,
    weights: [f32; 3],
}

fn spans(n: usize) -> Vec<Span> {
    let m = (n / 2).max(1);
    let step = n as f64 / m as f64;
    (0..m)
        .map(|i| {
            let (a, b) = (i as f64 * step, (i + 1) as f64 * step);
            let first = a as usize;
            let overlap = |k: usize| {
                let (lo, hi) = ((first + k) as f64, (first + k + 1) as f64);
                ((b.min(hi) - a.max(lo)).max(0.0) / step) as f32
            };
            Span { first, weights: [overlap(0), overlap(1), overlap(2)] }
        })
        .collect()
}

fn halve(width: usize, height: usize, texel: impl Fn(usize) -> [f32; 3]) -> Plane {
    let (columns, rows) = (spans(width), spans(height));
    let mut texels = Vec::with_capacity(columns.len() * rows.len());
    for row in &rows {
        for column in &columns {
            let mut sum = [0f32; 3];
            for (j, wy) in row.weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
                for (i, wx) in column.weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
                    // Rounding may give the texel past the end a sliver of weight.
                    let x = (column.first + i).min(width - 1);
                    let y = (row.first + j).min(height - 1);
                    let t = texel(y * width + x);
                    sum.iter_mut().zip(t).for_each(|(s, v)| *s += wx * wy * v);
                }
            }
            texels.push(sum);
        }
    }
    Plane { width: columns.len(), height: rows.len(), texels }
}
