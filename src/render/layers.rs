//! Further layers of a picture, summed as exactly as the film itself.

use super::aov::{AovRow, Combine};
use super::fixed::Accumulator;
use crate::base::pixel_rect::PixelRect;
use crate::image::picture::{Picture, SampleKind};
use crate::integrators::FirstHit;
use crate::scene::Scene;

/// Room for a layer's channels.
const CHANNELS: usize = 4;

/// Bytes of memory for a pixel of a layer: sums and counts, and the floats that are written.
pub const BYTES_PER_PIXEL: u64 = (8 + 4 + 4) * CHANNELS as u64;

/// Sums over a window: a thread's tile, or the whole picture.
pub struct Layers {
    layers: Vec<(&'static AovRow, Accumulator)>,
}

impl Layers {
    /// Empty sums.
    pub fn new(window: PixelRect, rows: &[&'static AovRow]) -> Self {
        Layers { layers: rows.iter().map(|&r| (r, Accumulator::new(window, CHANNELS))).collect() }
    }

    /// Empties them and moves them to another window.
    pub fn reset(&mut self, window: PixelRect) {
        self.layers.iter_mut().for_each(|(_, sums)| sums.reset(window));
    }

    /// Adds the surface that a sample, or the ray through the pixel's centre, meets to the layers that are made of these.
    pub fn add(&mut self, x: u32, y: u32, hit: &FirstHit, of: Combine, scene: &Scene) {
        for (row, sums) in self.layers.iter_mut().filter(|(row, _)| row.combine == of) {
            // A value that is not finite has no place in a mean; the picture's own samples are checked apart.
            sums.add::<CHANNELS>(x, y, (row.eval)(hit, scene));
        }
    }

    /// Whether there is a layer of that kind.
    pub fn has(&self, of: Combine) -> bool {
        self.layers.iter().any(|(row, _)| row.combine == of)
    }

    /// Adds a tile's sums.
    pub fn merge(&mut self, tile: &Layers) {
        for ((_, mine), (_, add)) in self.layers.iter_mut().zip(&tile.layers) {
            mine.merge(add);
        }
    }

    /// Appends the means as planes `NAME.CHANNEL`; 0 where nothing was hit.
    pub fn push_planes(&self, picture: &mut Picture) {
        for (row, sums) in &self.layers {
            let names: Vec<String> = row.channels.iter().map(|c| format!("{}.{c}", row.name)).collect();
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            let kind = if row.full_precision { SampleKind::Float } else { SampleKind::Half };
            sums.push_planes(picture, &names, kind);
        }
    }
}
