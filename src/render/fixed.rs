//! Exact sums: each value is rounded once to fixed point, and from there on only integers are added, so that
//! a sum has the same bits whatever the order, the slicing or the number of threads.
//!
//! - Step: 2^-24 (6e-8). A mean is within half a step of the mean of the values that went in.
//! - Range of one value: +-2^32; a larger one is clamped and counted as saturated.
//! - Range of a sum: +-2^39 (5.5e11); a sum that leaves it stays at the end of the range. For values that are
//!   not negative that, too, does not depend on order.

use crate::base::pixel_rect::PixelRect;
use crate::image::picture::{Picture, SampleKind};

/// Steps of the fixed point in 1.0.
pub const STEPS_PER_UNIT: f64 = (1u32 << STEPS_LOG2) as f64;

/// Base-2 logarithm of [`STEPS_PER_UNIT`].
pub(super) const STEPS_LOG2: u32 = 24;

/// Base-2 logarithm of the magnitude below which [`quantise_small`] works.
pub(super) const SMALL_LIMIT_LOG2: u32 = 20;

/// Largest magnitude of one value; beyond it is clamped.
pub const VALUE_LIMIT: f32 = 4_294_967_296.0;

/// Values rounded to steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Steps<const N: usize> {
    /// Multiples of 2^-24.
    pub steps: [i64; N],
    /// Whether a value was clamped to [`VALUE_LIMIT`].
    pub saturated: bool,
}

/// Rounds values to the nearest step (ties to even). The values must not be NaN; an infinity is clamped.
#[inline]
pub fn quantise<const N: usize>(values: [f32; N]) -> Steps<N> {
    if let Some(steps) = quantise_small(values) {
        return Steps { steps, saturated: false };
    }
    let saturated = values.iter().any(|v| v.abs() > VALUE_LIMIT);
    let steps = values.map(|v| {
        let clamped = f64::from(v.clamp(-VALUE_LIMIT, VALUE_LIMIT));
        (clamped * STEPS_PER_UNIT).round_ties_even() as i64
    });
    Steps { steps, saturated }
}

/// The fast case of [`quantise`]: `None` unless all values are below 2^20 in magnitude.
///
/// A value in steps is then below 2^44, and adding 1.5 * 2^52 leaves the rounded integer in the low bits of the
/// sum: additions that every SIMD set has, where a vector conversion to i64 needs AVX-512.
#[inline(always)]
pub(super) fn quantise_small<const N: usize>(values: [f32; N]) -> Option<[i64; N]> {
    const LIMIT: u32 = ((1u32 << SMALL_LIMIT_LOG2) as f32).to_bits();
    const MAGIC: f64 = 6_755_399_441_055_744.0;
    let small = values.iter().fold(true, |small, v| small & (v.to_bits() & 0x7fff_ffff < LIMIT));
    small.then(|| {
        values.map(|v| {
            // The product is exact: a power of two, far from overflow.
            let shifted = f64::from(v * STEPS_PER_UNIT as f32) + MAGIC;
            (shifted.to_bits() as i64).wrapping_sub(MAGIC.to_bits() as i64)
        })
    })
}

/// `steps / (2^24 count)`; 0 where nothing was counted.
#[inline]
pub fn mean_of(steps: i64, count: u64) -> f64 {
    mean(steps as f64, count)
}

/// As [`mean_of`], of a sum of two. A conversion from 128 bits is a library call, ten times slower than one from 64, so
/// it is kept for sums that need it.
#[inline]
pub fn mean_of_both([a, b]: [i64; 2], count: u64) -> f64 {
    match a.checked_add(b) {
        Some(sum) => mean(sum as f64, count),
        None => mean_of_many(i128::from(a) + i128::from(b), count),
    }
}

/// As [`mean_of`], of a sum of any size.
#[cold]
#[inline(never)]
pub fn mean_of_many(steps: i128, count: u64) -> f64 {
    mean(steps as f64, count)
}

#[inline]
fn mean(sum: f64, count: u64) -> f64 {
    if count == 0 { 0.0 } else { sum / (STEPS_PER_UNIT * count as f64) }
}

/// Exact sums of `channels` values a pixel, with one count a pixel: the store of an extra plane such as
/// albedo, normal or depth. A plane that not every sample has (depth on a miss) is simply not added there:
/// its mean is over the samples that had it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Accumulator {
    window: PixelRect,
    channels: usize,
    /// `channels` sums a pixel, row-major.
    sums: Vec<i64>,
    counts: Vec<u32>,
    saturated: u64,
}

impl Accumulator {
    /// Sums of zero for `channels` values in each pixel of `window`.
    pub fn new(window: PixelRect, channels: usize) -> Self {
        let sums = vec![0; window.area() * channels];
        Accumulator { window, channels, sums, counts: vec![0; window.area()], saturated: 0 }
    }

    /// The pixels it covers.
    pub fn window(&self) -> PixelRect {
        self.window
    }

    /// Empties it and moves it to another window, keeping its allocation: for a per-thread tile.
    pub fn reset(&mut self, window: PixelRect) {
        self.window = window;
        self.sums.clear();
        self.sums.resize(window.area() * self.channels, 0);
        self.counts.clear();
        self.counts.resize(window.area(), 0);
        self.saturated = 0;
    }

    /// Adds one sample of a pixel inside the window. A sample with a value that is not finite is not added;
    /// the answer is `false` then.
    ///
    /// # Panics
    /// If `N` is not the number of channels, or the pixel is outside.
    #[inline]
    pub fn add<const N: usize>(&mut self, x: u32, y: u32, values: [f32; N]) -> bool {
        assert_eq!(N, self.channels, "values a sample");
        if !values.iter().all(|v| v.is_finite()) {
            return false;
        }
        let at = self.window.index(x, y);
        let quantised = quantise(values);
        self.saturated += u64::from(quantised.saturated);
        for (sum, step) in self.sums[at * N..][..N].iter_mut().zip(quantised.steps) {
            *sum = sum.saturating_add(step);
        }
        self.counts[at] += 1;
        true
    }

    /// Adds the sums of another accumulator where the windows meet; any order gives the same bits.
    ///
    /// # Panics
    /// If the channels differ in number.
    pub fn merge(&mut self, other: &Accumulator) {
        assert_eq!(self.channels, other.channels, "channels");
        let common = self.window.intersection(&other.window);
        let n = common.width() as usize;
        for y in common.y0..common.y1 {
            let (a, b) = (self.window.index(common.x0, y), other.window.index(common.x0, y));
            let mine = &mut self.sums[a * self.channels..][..n * self.channels];
            for (sum, add) in mine.iter_mut().zip(&other.sums[b * self.channels..]) {
                *sum = sum.saturating_add(*add);
            }
            for (count, add) in self.counts[a..a + n].iter_mut().zip(&other.counts[b..]) {
                *count = count.saturating_add(*add);
            }
        }
        self.saturated += other.saturated;
    }

    /// How many samples had a value beyond [`VALUE_LIMIT`], which was clamped.
    pub fn saturated(&self) -> u64 {
        self.saturated
    }

    /// Number of samples that were added to a pixel inside the window.
    pub fn count(&self, x: u32, y: u32) -> u32 {
        self.counts[self.window.index(x, y)]
    }

    /// Mean of one channel over the samples that were added to the pixel; 0 where there were none.
    pub fn mean(&self, x: u32, y: u32, channel: usize) -> f32 {
        self.mean_at(self.window.index(x, y), channel)
    }

    fn mean_at(&self, at: usize, channel: usize) -> f32 {
        mean_of(self.sums[at * self.channels + channel], u64::from(self.counts[at])) as f32
    }

    /// Appends its means to a picture of the window's size, one plane for each name.
    ///
    /// # Panics
    /// If there are more names than channels.
    pub fn push_planes(&self, picture: &mut Picture, names: &[&str], kind: SampleKind) {
        assert!(names.len() <= self.channels, "one channel a name");
        for (channel, name) in names.iter().enumerate() {
            let data = (0..self.counts.len()).map(|at| self.mean_at(at, channel)).collect();
            picture.push(*name, kind, data);
        }
    }
}

#[cfg(test)]
mod tests;
