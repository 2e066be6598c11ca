//! SSIM over one tile that fits a core's cache, channel by channel.

use super::Options;
use crate::compare::lanes::{LANES, Lanes, filtered, load, store};
use crate::math::simd::{Kernel, dispatch};

/// Tiles are this wide and high, if the picture is.
pub(super) const TILE: [usize; 2] = [128, 64];

/// Two pictures of one size and how they are compared.
pub(super) struct Pair<'a, T, const C: usize> {
    size: [usize; 2],
    /// Reference and test.
    pictures: [&'a [[T; C]]; 2],
    half: Vec<f64>,
    formula: Formula,
}

impl<'a, T, const C: usize> Pair<'a, T, C> {
    pub fn new(size: [usize; 2], pictures: [&'a [[T; C]]; 2], options: &Options) -> Self {
        let half = options.window.half();
        let pixels = (2 * half.len() - 1).pow(2) as f64;
        let formula = Formula {
            c1: (options.k1 * options.data_range).powi(2),
            c2: (options.k2 * options.data_range).powi(2),
            covariance: if options.sample_covariance { pixels / (pixels - 1.0) } else { 1.0 },
            share: 1.0 / C as f32,
        };
        Pair { size, pictures, half, formula }
    }
}

/// Wang et al. 2004, eq. 13.
#[derive(Debug, Clone, Copy)]
struct Formula {
    c1: f64,
    c2: f64,
    /// Of weighted moments to the covariance asked for.
    covariance: f64,
    /// Of a channel in the map.
    share: f32,
}

/// Similarity, and its factor of contrast and structure.
struct Similarity {
    whole: Lanes<f64>,
    contrast: Lanes<f64>,
}

impl Formula {
    /// From weighted means of a, b, a^2 + b^2 and ab. Equal pictures have exactly 1: both sides of each ratio are then the
    /// same number.
    #[inline(always)]
    fn similarity(&self, [a, b, squares, product]: [Lanes<f64>; 4]) -> Similarity {
        let (mut whole, mut contrast) = ([0.0; LANES], [0.0; LANES]);
        for i in 0..LANES {
            let (both, means) = (a[i] * b[i], a[i] * a[i] + b[i] * b[i]);
            let top = 2.0 * (self.covariance * (product[i] - both)) + self.c2;
            let bottom = self.covariance * (squares[i] - means) + self.c2;
            contrast[i] = top / bottom;
            whole[i] = (2.0 * both + self.c1) / (means + self.c1) * contrast[i];
        }
        Similarity { whole, contrast }
    }
}

/// Room for the work on one tile; a thread has one and uses it again.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    /// Columns of results: those of the tile, up to a multiple of [`LANES`].
    width: usize,
    /// With what is left and right of them.
    stride: usize,
    /// a, b, a^2 + b^2 and ab, of the tile and what surrounds it.
    stored: [Vec<f64>; 4],
    /// The same, filtered along rows.
    halfway: [Vec<f64>; 4],
    map: Vec<f32>,
}

impl Scratch {
    /// Columns of results.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Similarities, the mean of channels, in rows of [`Scratch::width`].
    pub fn map(&self) -> &[f32] {
        &self.map
    }

    /// Works on the tile whose left top pixel is at `at`. Hands back sums of similarity and contrast over the pixels whose
    /// window is within the picture, by channel.
    pub fn run<T, const C: usize>(&mut self, pair: &Pair<T, C>, at: [usize; 2]) -> [[f64; 2]; C]
    where
        T: Copy + Into<f64>,
    {
        let radius = pair.half.len() - 1;
        self.width = TILE[0].min(pair.size[0] - at[0]).next_multiple_of(LANES);
        let height = TILE[1].min(pair.size[1] - at[1]);
        self.stride = self.width + 2 * radius;
        self.map.clear();
        self.map.resize(self.width * height, 0.0);
        let rows = height + 2 * radius;
        let within = |d: usize| {
            let (from, to) = (radius.max(at[d]), (pair.size[d] - radius).min(at[d] + TILE[d]));
            [from - at[d], to.max(from) - at[d]]
        };
        std::array::from_fn(|c| {
            self.gather(pair, at, rows, c);
            dispatch(AlongRows {
                stored: &self.stored,
                stride: self.stride,
                half: &pair.half,
                width: self.width,
                out: &mut self.halfway,
            });
            dispatch(AlongColumns {
                halfway: &self.halfway,
                width: self.width,
                half: &pair.half,
                formula: pair.formula,
                within: [within(0), within(1)],
                map: &mut self.map,
            })
        })
    }

    /// One channel and its products; beyond its edges the picture is mirrored, the pixel at the edge twice.
    fn gather<T, const C: usize>(&mut self, pair: &Pair<T, C>, at: [usize; 2], rows: usize, c: usize)
    where
        T: Copy + Into<f64>,
    {
        let radius = pair.half.len() - 1;
        let (stride, len) = (self.stride, rows * self.stride);
        for (stored, halfway) in self.stored.iter_mut().zip(&mut self.halfway) {
            stored.resize(len, 0.0);
            halfway.resize(rows * self.width, 0.0);
        }
        let mirrored = |i: usize, d: usize| {
            let (i, n) = (i + at[d], pair.size[d]);
            let i = if i < radius { radius - 1 - i } else { i - radius };
            // Padding up to a whole vector may lie farther out; it is never shown.
            if i < n { i } else { (2 * n - 1).saturating_sub(i) }
        };
        for y in 0..rows {
            let from = mirrored(y, 1) * pair.size[0];
            let [first, second] = pair.pictures.map(|p| &p[from..][..pair.size[0]]);
            let [a, b, ..] = self.stored.each_mut().map(|p| &mut p[y * stride..][..stride]);
            for (x, (a, b)) in a.iter_mut().zip(b).enumerate() {
                let x = mirrored(x, 0);
                (*a, *b) = (first[x][c].into(), second[x][c].into());
            }
        }
        dispatch(Products { planes: &mut self.stored, len });
    }
}

/// Fills in the sum of squares and the product.
struct Products<'a> {
    planes: &'a mut [Vec<f64>; 4],
    len: usize,
}

impl Kernel for Products<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let [a, b, squares, product] = self.planes.each_mut().map(|p| &mut p[..self.len]);
        for i in 0..self.len {
            squares[i] = a[i] * a[i] + b[i] * b[i];
            product[i] = a[i] * b[i];
        }
    }
}

struct AlongRows<'a> {
    stored: &'a [Vec<f64>; 4],
    stride: usize,
    half: &'a [f64],
    width: usize,
    out: &'a mut [Vec<f64>; 4],
}

impl Kernel for AlongRows<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let radius = self.half.len() - 1;
        for (plane, out) in self.stored.iter().zip(self.out) {
            let rows = plane.chunks_exact(self.stride).zip(out.chunks_exact_mut(self.width));
            for (row, out) in rows {
                for x in (0..self.width).step_by(LANES) {
                    let [sum] = filtered(row, x + radius, 1, [self.half]);
                    store(out, x, sum);
                }
            }
        }
    }
}

struct AlongColumns<'a> {
    halfway: &'a [Vec<f64>; 4],
    width: usize,
    half: &'a [f64],
    formula: Formula,
    /// Columns and rows of the tile that count for the means: from, to.
    within: [[usize; 2]; 2],
    map: &'a mut [f32],
}

impl Kernel for AlongColumns<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    fn run(self) -> [f64; 2] {
        let radius = self.half.len() - 1;
        let [[left, right], [top, bottom]] = self.within;
        let mut sums = [[0.0f64; LANES]; 2];
        for (y, out) in self.map.chunks_exact_mut(self.width).enumerate() {
            for x in (0..self.width).step_by(LANES) {
                let middle = (y + radius) * self.width + x;
                let moments = self.halfway.each_ref().map(|p| {
                    let [sum] = filtered(p, middle, self.width, [self.half]);
                    sum
                });
                let s = self.formula.similarity(moments);
                let shown = load(out, x);
                store(out, x, std::array::from_fn(|i| shown[i] + s.whole[i] as f32 * self.formula.share));
                if !(top..bottom).contains(&y) {
                    continue;
                }
                for (sums, values) in sums.iter_mut().zip([s.whole, s.contrast]) {
                    for (i, (sum, v)) in sums.iter_mut().zip(values).enumerate() {
                        *sum += if x + i >= left && x + i < right { v } else { 0.0 };
                    }
                }
            }
        }
        sums.map(|lanes| lanes.iter().sum())
    }
}
