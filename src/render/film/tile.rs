//! A thread's own piece of film.

use super::store::Store;
use super::{PixelSums, REPLICATES, ReplicateSum, TILE_SIDE};
use crate::base::pixel_rect::PixelRect;
use crate::color::Rgb;
use crate::render::fixed::{SMALL_LIMIT_LOG2, STEPS_LOG2, quantise, quantise_small};
use std::ops::Range;

const SIDE: usize = TILE_SIDE as usize;

/// Samples between two flushes. So many of the fast path cannot overflow 64 bits, whichever sum they go to.
const FLUSH_AFTER: usize = 1 << (62 - SMALL_LIMIT_LOG2 - STEPS_LOG2);

/// One filtered sample of a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Default, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct FilmSample {
    /// Radiance, associated with alpha.
    pub radiance: Rgb,
    /// 1 where the ray hit something (or the background shows), 0 where nothing is.
    pub alpha: f32,
}

impl FilmSample {
    #[inline]
    fn to_array(self) -> [f32; 4] {
        let Rgb { r, g, b } = self.radiance;
        [r, g, b, self.alpha]
    }

    /// Whether it can be added: no channel is NaN or infinite.
    #[inline]
    pub fn is_finite(&self) -> bool {
        self.radiance.is_finite() && self.alpha.is_finite()
    }
}

/// Red, green, blue and alpha in steps; four lanes, so that a sample is two vector additions.
type Lanes = [i64; 4];

#[inline]
fn accumulate(sum: &mut Lanes, steps: Lanes) {
    (0..4).for_each(|c| sum[c] = sum[c].wrapping_add(steps[c]));
}

/// Sums over one of [`super::Film::tiles`], 18 KiB, for one thread.
#[derive(Debug, Clone)]
pub struct FilmTile {
    rect: PixelRect,
    /// By half, then by pixel ([`TILE_SIDE`] a row, whatever the width of `rect`).
    halves: [Sums; 2],
    by_replicate: [Lanes; REPLICATES],
    replicate_counts: [u64; REPLICATES],
    /// Samples since the last flush; below [`FLUSH_AFTER`].
    pending: usize,
    /// Where sums go that may not fit: large samples, and all sums at a flush. Made when first needed.
    wide: Option<Box<[PixelSums]>>,
    wide_replicates: [ReplicateSum; REPLICATES],
    pub(super) dropped: u64,
    pub(super) saturated: u64,
}

/// Sums of one half.
#[derive(Debug, Clone)]
struct Sums {
    sums: Box<[Lanes; SIDE * SIDE]>,
    counts: Box<[u32; SIDE * SIDE]>,
    /// Whether anything was added: most tiles have samples of one half alone, or none.
    used: bool,
}

impl Sums {
    fn new() -> Self {
        Sums { sums: Box::new([[0; 4]; SIDE * SIDE]), counts: Box::new([0; SIDE * SIDE]), used: false }
    }

    fn clear(&mut self) {
        if self.used {
            self.sums.fill([0; 4]);
            self.counts.fill(0);
            self.used = false;
        }
    }
}

impl FilmTile {
    /// An empty tile.
    ///
    /// # Panics
    /// If a side of `rect` is longer than [`TILE_SIDE`].
    pub fn new(rect: PixelRect) -> Self {
        let mut tile = FilmTile {
            rect,
            halves: [Sums::new(), Sums::new()],
            by_replicate: Default::default(),
            replicate_counts: Default::default(),
            pending: 0,
            wide: None,
            wide_replicates: Default::default(),
            dropped: 0,
            saturated: 0,
        };
        tile.reset(rect);
        tile
    }

    /// Empties it and moves it to another rectangle.
    ///
    /// # Panics
    /// As [`FilmTile::new`].
    pub fn reset(&mut self, rect: PixelRect) {
        assert!(
            rect.width() <= TILE_SIDE && rect.height() <= TILE_SIDE,
            "{rect:?} is larger than a film tile"
        );
        self.rect = rect;
        self.halves.iter_mut().for_each(Sums::clear);
        self.by_replicate = Default::default();
        self.replicate_counts = Default::default();
        self.pending = 0;
        self.wide = None;
        self.wide_replicates = Default::default();
        self.dropped = 0;
        self.saturated = 0;
    }

    /// The pixels it covers, in frame coordinates.
    pub fn rect(&self) -> PixelRect {
        self.rect
    }

    #[inline]
    fn index(&self, x: u32, y: u32) -> usize {
        debug_assert!(self.rect.contains(x, y), "({x}, {y}) outside {:?}", self.rect);
        (y.wrapping_sub(self.rect.y0) * TILE_SIDE + x.wrapping_sub(self.rect.x0)) as usize
    }

    /// Adds one sample of replicate `replicate` (below [`REPLICATES`]) to a pixel inside; it must be finite
    /// ([`FilmSample::is_finite`]).
    #[inline]
    pub fn add(&mut self, x: u32, y: u32, replicate: usize, sample: FilmSample) {
        debug_assert!(sample.is_finite(), "non-finite sample at ({x}, {y})");
        let at = self.index(x, y);
        if self.pending >= FLUSH_AFTER {
            self.flush();
        }
        match quantise_small(sample.to_array()) {
            Some(steps) => self.add_steps(at, replicate, steps),
            None => self.add_large(at, replicate, &sample),
        }
        self.count(at, replicate, 1);
    }

    /// Adds samples of one pixel and one replicate, as [`FilmTile::add`] for each, but summed in registers. Those that
    /// are not finite are left out, counted as dropped, and their number is returned. Both slices are of one length.
    #[inline]
    pub fn add_run(&mut self, x: u32, y: u32, replicate: usize, li: &[Rgb], alpha: &[f32]) -> usize {
        let at = self.index(x, y);
        let mut dropped = 0;
        for (li, alpha) in li.chunks(FLUSH_AFTER).zip(alpha.chunks(FLUSH_AFTER)) {
            if self.pending + li.len() > FLUSH_AFTER {
                self.flush();
            }
            let (mut sum, mut left_out) = ([0; 4], 0);
            for (&radiance, &alpha) in li.iter().zip(alpha) {
                let sample = FilmSample { radiance, alpha };
                match quantise_small(sample.to_array()) {
                    Some(steps) => accumulate(&mut sum, steps),
                    None if sample.is_finite() => self.add_large(at, replicate, &sample),
                    None => left_out += 1,
                }
            }
            self.add_steps(at, replicate, sum);
            self.count(at, replicate, li.len() - left_out);
            dropped += left_out;
        }
        self.dropped += dropped as u64;
        dropped
    }

    /// Adds `n` samples of one pixel and one replicate that are all the same and transparent; false, and nothing is
    /// added, if they are too large for the fast sums or not finite.
    pub fn add_same(&mut self, x: u32, y: u32, replicate: usize, radiance: Rgb, n: usize) -> bool {
        let at = self.index(x, y);
        let sample = FilmSample { radiance, alpha: 0.0 };
        let Some(steps) = quantise_small(sample.to_array()) else { return false };
        let mut left = n;
        while left > 0 {
            let now = left.min(FLUSH_AFTER);
            if self.pending + now > FLUSH_AFTER {
                self.flush();
            }
            self.add_steps(at, replicate, steps.map(|s| s.wrapping_mul(now as i64)));
            self.count(at, replicate, now);
            left -= now;
        }
        true
    }

    #[inline]
    fn add_steps(&mut self, at: usize, replicate: usize, steps: Lanes) {
        let half = &mut self.halves[replicate & 1];
        half.used = true;
        accumulate(&mut half.sums[at], steps);
        accumulate(&mut self.by_replicate[replicate], steps);
    }

    #[inline]
    fn count(&mut self, at: usize, replicate: usize, n: usize) {
        let half = &mut self.halves[replicate & 1];
        half.used = true;
        half.counts[at] += n as u32;
        self.replicate_counts[replicate] += n as u64;
        self.pending += n;
    }

    #[cold]
    #[inline(never)]
    fn add_large(&mut self, at: usize, replicate: usize, sample: &FilmSample) {
        let quantised = quantise(sample.to_array());
        self.saturated += u64::from(quantised.saturated);
        let mut halves = [[0; 4]; 2];
        halves[replicate & 1] = quantised.steps;
        wide_of(&mut self.wide)[at].merge(&PixelSums::from_lanes(&halves, [0; 2]));
        self.wide_replicates[replicate].add(quantised.steps, 0);
    }

    /// Moves all sums to where they cannot overflow unnoticed.
    #[cold]
    #[inline(never)]
    fn flush(&mut self) {
        let wide = wide_of(&mut self.wide);
        for (at, to) in wide.iter_mut().enumerate() {
            to.merge(&sums_at(&self.halves, at));
        }
        self.halves.iter_mut().for_each(Sums::clear);
        self.wide_replicates = self.replicates();
        self.by_replicate = Default::default();
        self.replicate_counts = Default::default();
        self.pending = 0;
    }

    pub(super) fn replicates(&self) -> [ReplicateSum; REPLICATES] {
        let mut all = self.wide_replicates;
        for (r, sum) in all.iter_mut().enumerate() {
            sum.add(self.by_replicate[r], self.replicate_counts[r]);
        }
        all
    }

    /// Adds row `y` to the film's pixels of the same place, which are zero if `fresh`.
    pub(super) fn add_row_to(&self, y: u32, film: &mut Store, row: Range<usize>, fresh: bool) {
        let first = (y - self.rect.y0) as usize * SIDE;
        if let (None, [even, Sums { used: false, .. }]) = (&self.wide, &self.halves) {
            let mine = first..first + row.len();
            return film.add_first(row, &even.sums[mine.clone()], &even.counts[mine], fresh);
        }
        for (at, pixel) in (first..first + SIDE).zip(row) {
            if let Some(wide) = &self.wide {
                film.add(pixel, &wide[at]);
            }
            film.add(pixel, &sums_at(&self.halves, at));
        }
    }
}

#[inline]
fn sums_at(halves: &[Sums; 2], at: usize) -> PixelSums {
    let [a, b] = halves;
    PixelSums::from_lanes(&[a.sums[at], b.sums[at]], [a.counts[at], b.counts[at]])
}

fn wide_of(wide: &mut Option<Box<[PixelSums]>>) -> &mut [PixelSums] {
    wide.get_or_insert_with(|| vec![PixelSums::default(); SIDE * SIDE].into())
}
