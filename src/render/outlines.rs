//! Pixels that outlines run through: rays through the corners of pixels show where (Whitted 1980). What differs there
//! within a pixel only more camera rays find, however many samples of light each of them brings, so these pixels take
//! more camera rays, each with as many fewer samples of light.
//!
//! Which they are follows from the scene alone, never from the samples of the picture: so its mean is no other (deciding
//! by samples would bias it, Kirk and Arvo 1991).

use super::film::TILE_SIDE;
use crate::base::camera::FilmSamples;
use crate::base::hit::HitBatch;
use crate::base::pixel_rect::PixelRect;
use crate::base::ray::{Coherence, RayBatch};
use crate::scene::Scene;
use rayon::prelude::*;

/// Most of all samples of the picture that outlines take on top: in a picture that is all outlines, twigs or hair, all
/// pixels are alike.
const MOST_MORE: f64 = 0.25;

/// Bytes for each pixel of the picture: its mark, once by tile and once by row.
pub const BYTES_PER_PIXEL: u64 = 2;

/// Marks by pixel.
pub struct Outlines {
    rect: PixelRect,
    marks: Vec<bool>,
    /// How many samples a marked pixel takes for each of another; a power of two, more than 1.
    times: u32,
    /// Rays that were spent.
    pub rays: u64,
}

/// What a thread keeps from tile to tile.
#[derive(Default)]
struct Corners {
    x: Vec<f32>,
    y: Vec<f32>,
    rays: RayBatch,
    hits: HitBatch,
}

impl Outlines {
    /// Of the pixels `rect` of a scene's film, which take up to `most` times the samples of others; None where that is less
    /// than 2, where there is none, where twice their samples would be more than a quarter of all on top, or where a lens
    /// blurs them.
    pub fn of(scene: &Scene, rect: PixelRect, most: u32) -> Option<Self> {
        if most < 2 || scene.camera.has_lens() {
            return None;
        }
        let tiles: Vec<PixelRect> = rect.tiles(TILE_SIDE).collect();
        let parts: Vec<(Vec<bool>, u64)> =
            tiles.par_iter().map_init(Corners::default, |corners, tile| corners.marks(scene, tile)).collect();
        let mut outlines = Outlines { rect, marks: vec![false; rect.area()], times: 1, rays: 0 };
        for (tile, (marks, rays)) in tiles.iter().zip(parts) {
            for ((x, y), mark) in tile.pixels().zip(marks) {
                outlines.marks[rect.index(x, y)] = mark;
            }
            outlines.rays += rays;
        }
        let share = outlines.count() as f64 / rect.area() as f64;
        // More samples of these, and no more than so many of all; powers of two, as points are even for those.
        let affordable = (1.0 + MOST_MORE / share).min(f64::from(most));
        outlines.times = 1 << affordable.log2() as u32;
        (share > 0.0 && outlines.times > 1).then_some(outlines)
    }

    /// Whether an outline runs through a pixel.
    #[inline]
    pub fn contains(&self, x: u32, y: u32) -> bool {
        self.marks[self.rect.index(x, y)]
    }

    /// See [`Outlines`].
    pub fn times(&self) -> u32 {
        self.times
    }

    /// Pixels that are marked.
    pub fn count(&self) -> usize {
        self.marks.iter().filter(|m| **m).count()
    }
}

impl Corners {
    /// Those of a tile's pixels, row by row, and the rays that took.
    fn marks(&mut self, scene: &Scene, tile: &PixelRect) -> (Vec<bool>, u64) {
        let (width, height) = (tile.width() + 1, tile.height() + 1);
        self.x.clear();
        self.y.clear();
        for (x, y) in PixelRect::of_size(width, height).pixels() {
            self.x.push((tile.x0 + x) as f32);
            self.y.push((tile.y0 + y) as f32);
        }
        let samples = FilmSamples { x: &self.x, y: &self.y, lens_u: &[], lens_v: &[] };
        scene.camera.fill_rays(&samples, &mut self.rays);
        scene.kernel.intersect_batch(&self.rays, &mut self.hits, Coherence::Coherent);
        // Which object it is, if any.
        let object = |at: usize| self.hits.get(at).map(|hit| hit.path);
        let mark = |(x, y): (u32, u32)| {
            let at = ((y - tile.y0) * width + x - tile.x0) as usize;
            let below = at + width as usize;
            let first = object(at);
            [at + 1, below, below + 1].into_iter().any(|corner| object(corner) != first)
        };
        let marks =
            if self.hits.none() { vec![false; tile.area()] } else { tile.pixels().map(mark).collect() };
        (marks, self.x.len() as u64)
    }
}

#[cfg(test)]
mod tests;
