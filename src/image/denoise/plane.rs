//! Planes of floats: their padded form, which tiles read without asking where the picture ends, and box means.

use rayon::prelude::*;

/// Pixels side by side that are worked on at once; also the side of a tile.
pub(super) const LANES: usize = 16;

/// Values of neighbours in a row.
pub(super) type Lanes = [f32; LANES];

/// Room around the picture: the widest window (9) and half a patch (3) beside it, and the four that
/// [`super::weights`] reads to each side of a tile.
pub(super) const PAD: usize = 16;

/// Extent of a picture in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Size {
    pub width: usize,
    pub height: usize,
}

impl Size {
    pub fn area(self) -> usize {
        self.width * self.height
    }

    /// Left top pixels of the tiles, row by row.
    pub fn tiles(self) -> Vec<[usize; 2]> {
        let rows = (0..self.height).step_by(LANES);
        rows.flat_map(|y| (0..self.width).step_by(LANES).map(move |x| [x, y])).collect()
    }

    /// From one padded row to the next.
    pub fn stride(self) -> usize {
        self.width.next_multiple_of(LANES) + 2 * PAD
    }

    /// Where pixel (x, y) stands in a padded plane.
    pub fn padded_index(self, x: usize, y: usize) -> usize {
        (y + PAD) * self.stride() + x + PAD
    }

    /// A padded plane of `value(pixel)`; outside of the picture the nearest pixel is repeated.
    pub fn pad(self, value: impl Fn(usize) -> f32) -> Vec<f32> {
        self.padded(|x, y, _| value(y * self.width + x))
    }

    /// A padded plane of `value(pixel)`; outside of the picture it is 0.
    pub fn pad_with_zero(self, value: impl Fn(usize) -> f32) -> Vec<f32> {
        self.padded(|x, y, inside| if inside { value(y * self.width + x) } else { 0.0 })
    }

    fn padded(self, value: impl Fn(usize, usize, bool) -> f32) -> Vec<f32> {
        let rows = self.height.next_multiple_of(LANES) + 2 * PAD;
        let mut plane = Vec::with_capacity(rows * self.stride());
        for row in 0..rows {
            let y = row.saturating_sub(PAD).min(self.height - 1);
            for column in 0..self.stride() {
                let x = column.saturating_sub(PAD).min(self.width - 1);
                plane.push(value(x, y, x + PAD == column && y + PAD == row));
            }
        }
        plane
    }

    /// Means over the squares of side `2 radius + 1` around each pixel, of those pixels that `counts`; `None` where
    /// there is none. Every sum is taken afresh and in the same order: no rounding is carried along, and none
    /// depends on threads.
    pub fn box_means(self, radius: usize, values: &[f32], counts: &[bool]) -> Vec<Option<f32>> {
        let Size { width, height } = self;
        let around = |at: usize, end: usize| at.saturating_sub(radius)..(at + radius + 1).min(end);
        let across: Vec<(f32, u32)> = (0..self.area())
            .into_par_iter()
            .with_min_len(width)
            .map(|i| {
                let (x, row) = (i % width, i - i % width);
                let counted = around(x, width).map(|x| row + x).filter(|&j| counts[j]);
                counted.fold((0.0, 0), |(sum, n), j| (sum + values[j], n + 1))
            })
            .collect();
        (0..self.area())
            .into_par_iter()
            .with_min_len(width)
            .map(|i| {
                let column = around(i / width, height).map(|y| across[y * width + i % width]);
                let (sum, n) = column.fold((0.0, 0), |(sum, n), (s, m)| (sum + s, n + m));
                (n > 0).then(|| sum / n as f32)
            })
            .collect()
    }
}

/// The values from `at` on.
///
/// # Panics
/// If the plane ends before; padding is there so that it does not.
#[inline]
pub(super) fn span<const N: usize>(plane: &[f32], at: usize) -> &[f32; N] {
    plane[at..].first_chunk().expect("planes are padded")
}

/// The smaller of two numbers that are not NaN: one instruction, which `f32::min` is not.
#[inline]
pub(super) fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The larger of two numbers that are not NaN.
#[inline]
pub(super) fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// `sum += a * b`, lane by lane. All is read before anything is written, without which compilers do not make vectors
/// of it (a factor of seven, measured).
#[inline(always)]
pub(super) fn add_product(sum: &mut Lanes, a: &Lanes, b: &Lanes) {
    let mut out = *sum;
    for l in 0..LANES {
        out[l] += a[l] * b[l];
    }
    *sum = out;
}

/// `a * b`, lane by lane.
#[inline(always)]
pub(super) fn product(a: &Lanes, b: &Lanes) -> Lanes {
    let mut out = *a;
    for l in 0..LANES {
        out[l] *= b[l];
    }
    out
}
