//! The film: exact sums of filtered samples (see [`super::fixed`] for step and ranges), with what later error
//! estimates need: two half-buffers a pixel, and per tile the luminance of a few independent replicates.
//!
//! A pixel takes 36 bytes, or 64 where both halves have samples. Threads accumulate into a [`FilmTile`] of their own,
//! without locks, and add it to the [`Film`] when it is done; as only integers are added, the order in which that happens
//! leaves no trace.

mod store;
mod tile;

pub use tile::{FilmSample, FilmTile};

use super::fixed::{mean_of, mean_of_both, mean_of_many};
use crate::base::pixel_rect::PixelRect;
use crate::color::Rgb;
use crate::image::picture::{Picture, SampleKind};
use rayon::prelude::*;
use store::Store;

/// Side of a film tile in pixels.
pub const TILE_SIDE: u32 = 16;

/// Most independent replicates of a pixel's point set; those of number `r` go to half-buffer `r % 2`. A film that shall know
/// its error needs two halves, and more would cost too much: the error of smooth light falls faster than 1/sqrt(n) only
/// within a replicate. Measured against one replicate (benches/README.md), two have 1.14 to 1.30 times its mean square error
/// (1.16 to 1.95 where all light is soft), four had 1.29 to 1.60.
pub const REPLICATES: usize = 2;

/// Bytes of memory for a pixel: sums, and the layers of a picture that is written (four floats, and four halves).
pub const BYTES_PER_PIXEL: u64 = 64 + 24;

/// Sums of one pixel, in steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct PixelSums {
    /// Red, green and blue of the even and of the odd replicates.
    halves: [[i64; 3]; 2],
    alpha: i64,
    counts: [u32; 2],
}

impl PixelSums {
    /// From red, green, blue and alpha of each half.
    #[inline]
    fn from_lanes(halves: &[[i64; 4]; 2], counts: [u32; 2]) -> Self {
        let [[r, g, b, a], [s, h, c, alpha]] = *halves;
        PixelSums { halves: [[r, g, b], [s, h, c]], alpha: a.saturating_add(alpha), counts }
    }

    #[inline]
    fn merge(&mut self, other: &PixelSums) {
        for h in 0..2 {
            for c in 0..3 {
                self.halves[h][c] = self.halves[h][c].saturating_add(other.halves[h][c]);
            }
            self.counts[h] = self.counts[h].saturating_add(other.counts[h]);
        }
        self.alpha = self.alpha.saturating_add(other.alpha);
    }

    fn count(&self) -> u64 {
        u64::from(self.counts[0]) + u64::from(self.counts[1])
    }

    fn mean(&self) -> [f64; 3] {
        let n = self.count();
        std::array::from_fn(|c| mean_of_both([self.halves[0][c], self.halves[1][c]], n))
    }

    fn alpha(&self) -> f32 {
        mean_of(self.alpha, self.count()) as f32
    }

    /// See [`Film::variance`]; `None` where one half has no sample.
    fn variance(&self) -> Option<[f64; 3]> {
        let [a, b] = self.counts.map(u64::from);
        if a == 0 || b == 0 {
            return None;
        }
        let n = (a + b) as f64;
        let weight = (a as f64 / n) * (b as f64 / n);
        Some(std::array::from_fn(|c| {
            let d = mean_of(self.halves[0][c], a) - mean_of(self.halves[1][c], b);
            weight * d * d
        }))
    }

    fn at_limit(&self) -> bool {
        let limit = |v: i64| v == i64::MAX || v == i64::MIN;
        self.halves.iter().flatten().any(|&v| limit(v)) || limit(self.alpha)
    }
}

/// Rec. 709 luminance weights times 10^4 (see [`Rgb::luminance`]).
const LUMINANCE_WEIGHTS: [i64; 3] = [2126, 7152, 722];

/// Luminance of one replicate, summed over the pixels of a tile, in steps of 10^-4 2^-24. 128 bits cannot
/// overflow: 2^57 samples at the limit would be needed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct ReplicateSum {
    luminance: i128,
    count: u64,
}

impl ReplicateSum {
    fn merge(&mut self, other: &ReplicateSum) {
        self.luminance += other.luminance;
        self.count += other.count;
    }

    /// Adds sums of red, green and blue (the fourth lane is alpha and not wanted). The integer weights make the
    /// luminance of a sum the sum of luminances, whatever was summed first.
    fn add(&mut self, steps: [i64; 4], count: u64) {
        let terms = steps.iter().zip(LUMINANCE_WEIGHTS).map(|(&s, w)| i128::from(s) * i128::from(w));
        self.luminance += terms.sum::<i128>();
        self.count += count;
    }

    fn mean(&self) -> f64 {
        mean_of_many(self.luminance, self.count) / LUMINANCE_WEIGHTS.iter().sum::<i64>() as f64
    }
}

/// What the replicates of a tile say about its mean luminance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TileEstimate {
    /// Mean luminance over the tile's samples.
    pub mean: f64,
    /// Unbiased estimate of the variance of `mean`, from the spread of the replicates' means (degrees of
    /// freedom: one less than the replicates that have samples).
    pub variance: f64,
}

/// Half of a pixel's samples: the even or the odd replicates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Half {
    /// Mean radiance by channel.
    pub mean: [f64; 3],
    /// Samples, at least 1.
    pub count: u64,
}

/// What happened to samples on the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct FilmCounts {
    /// Samples that went in.
    pub samples: u64,
    /// Samples that were not finite and were left out.
    pub dropped: u64,
    /// Samples with a value that was clamped to [`super::fixed::VALUE_LIMIT`].
    pub saturated: u64,
    /// Pixels with a sum at the end of its range: their means are too small.
    pub overflowed_pixels: u64,
}

/// Exact sums over a window of the frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Film {
    frame: [u32; 2],
    window: PixelRect,
    pixels: Store,
    tiles: Vec<[ReplicateSum; REPLICATES]>,
    dropped: u64,
    saturated: u64,
}

impl Film {
    /// An empty film for the part of `window` (a crop, or all) that lies inside a frame of this many pixels.
    pub fn new(width: u32, height: u32, window: PixelRect) -> Self {
        let window = window.intersection(&PixelRect::of_size(width, height));
        Film {
            frame: [width, height],
            window,
            pixels: Store::new(window.area()),
            tiles: vec![Default::default(); window.tiles(TILE_SIDE).count()],
            dropped: 0,
            saturated: 0,
        }
    }

    /// The pixels it covers, in frame coordinates.
    pub fn window(&self) -> PixelRect {
        self.window
    }

    /// The rectangles a [`FilmTile`] may have: at most [`TILE_SIDE`] a side, row by row from the window's left top.
    pub fn tiles(&self) -> impl Iterator<Item = PixelRect> + use<> {
        self.window.tiles(TILE_SIDE)
    }

    fn tile_index(&self, x: u32, y: u32) -> usize {
        let across = self.window.width().div_ceil(TILE_SIDE);
        (((y - self.window.y0) / TILE_SIDE) * across + (x - self.window.x0) / TILE_SIDE) as usize
    }

    /// Adds what a thread has gathered.
    ///
    /// # Panics
    /// If the tile's rectangle is not one of [`Film::tiles`].
    pub fn add_tile(&mut self, tile: &FilmTile) {
        let rect = tile.rect();
        let aligned = rect.intersection(&self.window) == rect
            && (rect.x0 - self.window.x0).is_multiple_of(TILE_SIDE)
            && (rect.y0 - self.window.y0).is_multiple_of(TILE_SIDE);
        assert!(aligned && rect.area() > 0, "{rect:?} is no tile of {:?}", self.window);
        let index = self.tile_index(rect.x0, rect.y0);
        let fresh = self.tiles[index].iter().all(|r| r.count == 0);
        for y in rect.y0..rect.y1 {
            let at = self.window.index(rect.x0, y);
            tile.add_row_to(y, &mut self.pixels, at..at + rect.width() as usize, fresh);
        }
        self.tiles[index].iter_mut().zip(&tile.replicates()).for_each(|(mine, add)| mine.merge(add));
        self.dropped += tile.dropped;
        self.saturated += tile.saturated;
    }

    /// Adds another film of the same frame and window: slices of samples, parts of a farm, checkpoints.
    ///
    /// # Panics
    /// If frame or window differ.
    pub fn merge(&mut self, other: &Film) {
        assert_eq!((self.frame, self.window), (other.frame, other.window), "films of different windows");
        self.pixels.merge(&other.pixels);
        let mine = self.tiles.as_flattened_mut().iter_mut();
        mine.zip(other.tiles.as_flattened()).for_each(|(mine, add)| mine.merge(add));
        self.dropped += other.dropped;
        self.saturated += other.saturated;
    }

    /// Samples in, dropped, clamped; pixels out of range.
    pub fn counts(&self) -> FilmCounts {
        FilmCounts {
            samples: self.pixels.iter().map(|p| p.count()).sum(),
            dropped: self.dropped,
            saturated: self.saturated,
            overflowed_pixels: self.pixels.iter().filter(|p| p.at_limit()).count() as u64,
        }
    }

    fn sums(&self, x: u32, y: u32) -> PixelSums {
        self.pixels.get(self.window.index(x, y))
    }

    /// Mean radiance of a pixel in the window; black where there is no sample. Colour is associated with alpha:
    /// it is not to be multiplied by it again.
    pub fn mean(&self, x: u32, y: u32) -> Rgb {
        Rgb::from(self.sums(x, y).mean().map(|v| v as f32))
    }

    /// Mean alpha of a pixel in the window.
    pub fn alpha(&self, x: u32, y: u32) -> f32 {
        self.sums(x, y).alpha()
    }

    /// Samples of a pixel in the window.
    pub fn sample_count(&self, x: u32, y: u32) -> u64 {
        self.sums(x, y).count()
    }

    /// A pixel's two half-buffers, which are independent of each other; `None` where one has no sample.
    pub fn halves(&self, x: u32, y: u32) -> Option<[Half; 2]> {
        let pixel = self.sums(x, y);
        let half = |h: usize| {
            let count = u64::from(pixel.counts[h]);
            Half { mean: pixel.halves[h].map(|sum| mean_of(sum, count)), count }
        };
        pixel.counts.iter().all(|&n| n > 0).then(|| [half(0), half(1)])
    }

    /// Means of some pixels in the window, row by row: red, green, blue and alpha, as [`Film::picture`] has them.
    pub fn means(&self, rect: PixelRect) -> Vec<[f32; 4]> {
        let mean = |(x, y)| {
            let sums = self.sums(x, y);
            let [r, g, b] = sums.mean().map(|v| v as f32);
            [r, g, b, sums.alpha()]
        };
        rect.pixels().map(mean).collect()
    }

    /// The means as planes `R G B A`, without metadata.
    pub fn picture(&self, kind: SampleKind) -> Picture {
        let mut picture = Picture::new(self.window.width() as usize, self.window.height() as usize);
        picture.origin = [self.window.x0 as usize, self.window.y0 as usize];
        picture.frame = self.frame.map(|v| v as usize);
        let mut planes: [Vec<f32>; 4] = std::array::from_fn(|_| vec![0.0; self.pixels.len()]);
        let row = self.window.width().max(1) as usize;
        let [r, g, b, a] = planes.each_mut().map(|plane| plane.par_chunks_mut(row));
        (r, g, b, a).into_par_iter().enumerate().for_each(|(y, (r, g, b, a))| {
            for i in 0..r.len() {
                let pixel = self.pixels.get(y * row + i);
                [r[i], g[i], b[i]] = pixel.mean().map(|v| v as f32);
                a[i] = pixel.alpha();
            }
        });
        for (name, plane) in ["R", "G", "B", "A"].into_iter().zip(planes) {
            picture.push(name, kind, plane);
        }
        picture
    }

    /// Estimated variance of each pixel's mean, per channel.
    ///
    /// With half-buffer means A of a samples and B of b samples, n = a + b, the estimate is
    /// (a b / n^2) (A - B)^2, which is (A - B)^2 / 4 for equal halves: unbiased, as
    /// E (A - B)^2 = s^2 (1/a + 1/b) where the mean's variance is s^2 / n. The halves must come from
    /// independent replicates of the point set; then this holds for stratified points as well (for s^2 then
    /// read a times the variance of A). One degree of freedom a pixel is noisy, so the estimates are pooled:
    /// the mean over the pixels within `radius` in x and y, inside the window. A pixel whose neighbourhood has
    /// no estimate takes the mean of all.
    ///
    /// `None` where no pixel has samples in both halves.
    pub fn variance(&self, radius: u32) -> Option<[Vec<f32>; 3]> {
        let raw: Vec<Option<[f64; 3]>> = self.pixels.iter().map(|p| p.variance()).collect();
        let all = Pool::of(raw.iter().flatten());
        if all.count == 0.0 {
            return None;
        }
        let mut planes: [Vec<f32>; 3] = std::array::from_fn(|_| Vec::with_capacity(raw.len()));
        let w = self.window;
        for (x, y) in w.pixels() {
            let near = PixelRect::new(
                x.saturating_sub(radius),
                y.saturating_sub(radius),
                x.saturating_add(radius).saturating_add(1),
                y.saturating_add(radius).saturating_add(1),
            );
            let local =
                Pool::of(near.intersection(&w).pixels().filter_map(|(x, y)| raw[w.index(x, y)].as_ref()));
            let pool = if local.count > 0.0 { &local } else { &all };
            planes.iter_mut().zip(pool.sum).for_each(|(plane, sum)| plane.push((sum / pool.count) as f32));
        }
        Some(planes)
    }

    /// What the replicates of the tile with this pixel say; `None` unless two replicates have samples.
    ///
    /// With replicate means `m_r` over `n_r` samples and their weighted mean m, the variance of m is estimated
    /// as the sum of n_r (m_r - m)^2 over (k - 1) n, for k replicates with n samples in all. One degree of freedom for two
    /// replicates: pool the estimates of several tiles.
    pub fn tile_estimate(&self, x: u32, y: u32) -> Option<TileEstimate> {
        debug_assert!(self.window.contains(x, y));
        let used: Vec<&ReplicateSum> =
            self.tiles[self.tile_index(x, y)].iter().filter(|r| r.count > 0).collect();
        if used.len() < 2 {
            return None;
        }
        let mut all = ReplicateSum::default();
        used.iter().for_each(|r| all.merge(r));
        let (mean, n) = (all.mean(), all.count);
        let spread: f64 = used.iter().map(|r| r.count as f64 * (r.mean() - mean).powi(2)).sum();
        Some(TileEstimate { mean, variance: spread / ((used.len() - 1) as f64 * n as f64) })
    }
}

#[derive(Default)]
struct Pool {
    sum: [f64; 3],
    count: f64,
}

impl Pool {
    fn of<'a>(values: impl Iterator<Item = &'a [f64; 3]>) -> Pool {
        values.fold(Pool::default(), |mut pool, v| {
            (0..3).for_each(|c| pool.sum[c] += v[c]);
            pool.count += 1.0;
            pool
        })
    }
}

#[cfg(test)]
mod tests;
