//! L0: stateless sample points: a pure function of (seed, pixel, sample, dimension).

pub mod dims;
pub mod hash;
pub mod independent;
pub mod owen_sobol;
pub mod zsobol;

use std::str::FromStr;

pub use dims::{Dim, Slot};
pub use hash::{SHADOW_KEY, ray_key};

use crate::error::{Error, Result, unknown_name};
use crate::math::simd::{Kernel, dispatch};

/// The kinds of sample points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(u32)]
pub enum Sampler {
    /// Owen-scrambled Sobol' pairs whose errors differ from pixel to pixel like blue noise, see [`zsobol`].
    #[default]
    ZSobol,
    /// Owen-scrambled Sobol' pairs, independent from pixel to pixel, see [`owen_sobol`].
    OwenSobol,
    /// Independent uniform numbers, for comparison and for statistics that assume them.
    Independent,
}

impl Sampler {
    /// Names as the command line and scene files spell them, each with its kind.
    pub const NAMES: [(&'static str, Sampler); 3] = [
        ("zsobol", Sampler::ZSobol),
        ("owen-sobol", Sampler::OwenSobol),
        ("independent", Sampler::Independent),
    ];

    /// The name of this kind.
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|(_, kind)| *kind == self).map_or("", |(name, _)| name)
    }

    /// One line for people.
    pub fn doc(self) -> &'static str {
        match self {
            Sampler::ZSobol => {
                "Owen-scrambled Sobol' pairs along a curve through all pixels: errors of neighbours cancel (blue noise)"
            }
            Sampler::OwenSobol => {
                "Owen-scrambled Sobol' pairs: error on smooth light falls faster than 1/sqrt(n)"
            }
            Sampler::Independent => "independent uniform numbers, for comparison and statistics",
        }
    }

    /// The points of a picture whose pixels take `count` samples of each replicate, if that is known beforehand.
    /// [`Sampler::ZSobol`] needs to know; its points are else those of [`Sampler::OwenSobol`].
    pub fn points(self, seed: u64, count: Option<u32>) -> PointSet {
        let kind = match (self, count) {
            (Sampler::ZSobol, None) => Sampler::OwenSobol,
            (kind, _) => kind,
        };
        PointSet { kind, seed, bits: count.map_or(0, |n| u32::BITS - (n.max(1) - 1).leading_zeros()) }
    }
}

/// The sample points of all pixels and replicates of a picture.
#[derive(Debug, Clone, Copy)]
pub struct PointSet {
    kind: Sampler,
    seed: u64,
    /// Of [`Sampler::ZSobol`]: the binary logarithm of the samples of a pixel.
    bits: u32,
}

impl PointSet {
    /// Their kind.
    pub fn kind(&self) -> Sampler {
        self.kind
    }

    /// Those of pixel (x, y). Another `replicate` gives an independent randomisation of the same pixel: the variance
    /// between replicates is an unbiased estimate of that of the mean of one.
    pub fn pixel(&self, x: u32, y: u32, replicate: u32) -> PixelSampler {
        let seed = hash::mix64(self.seed);
        let [region, second] = match self.kind {
            Sampler::ZSobol => zsobol::place([x, y], self.bits).map(u64::from),
            _ => [(u64::from(y) << 32) | u64::from(x), 0],
        };
        let h = hash::mix64(hash::mix64(seed ^ region).wrapping_add(u64::from(replicate)));
        let second = if self.kind == Sampler::ZSobol { second as u32 } else { (h >> 32) as u32 };
        PixelSampler { key: [(h as u32 & !3) | self.kind as u32, second] }
    }
}

impl FromStr for Sampler {
    type Err = Error;

    fn from_str(s: &str) -> Result<Self> {
        let known = || Self::NAMES.iter().map(|(name, _)| *name);
        let found = Self::NAMES.iter().find(|(name, _)| *name == s);
        found.map(|(_, kind)| *kind).ok_or_else(|| Error::Usage(unknown_name("sampler", s, known())))
    }
}

/// The largest f32 below one.
pub const ONE_MINUS_EPSILON: f32 = 1.0 - f32::EPSILON / 2.0;

/// Top 24 bits as a number in [0, 1): every value is exact, and 1 is never reached.
#[inline(always)]
fn to_unit_f32(bits: u32) -> f32 {
    // By way of i32, for which alone SSE and AVX2 have a conversion.
    (bits >> 8) as i32 as f32 * (1.0 / 16_777_216.0)
}

/// All the points of one pixel (of one replicate): `get_*(index, dim)` is the point of sample `index` in dimension
/// `dim`. Dimensions are independent of each other; over the indices of one dimension (of a pair, in `get_2d`) the
/// points are stratified, best so over the first 2^k of them. Eight bytes: keep it in the path state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelSampler {
    /// Hash of seed, pixel and replicate, but that the last two bits of the first half tell the kind, and that the second
    /// half, of [`Sampler::ZSobol`], is the index of the pixel's first point.
    key: [u32; 2],
}

impl PixelSampler {
    /// The kind of points it gives.
    #[inline(always)]
    pub fn kind(&self) -> Sampler {
        match self.key[0] & 3 {
            0 => Sampler::ZSobol,
            1 => Sampler::OwenSobol,
            _ => Sampler::Independent,
        }
    }

    /// The points of this pixel where each of its samples takes `n`, from index `n * index` on.
    #[inline(always)]
    pub fn times(self, n: u32) -> Self {
        match self.kind() {
            Sampler::ZSobol => PixelSampler { key: [self.key[0], self.key[1].wrapping_mul(n)] },
            Sampler::OwenSobol | Sampler::Independent => self,
        }
    }

    /// Two numbers in [0, 1) as 32-bit fractions.
    #[inline(always)]
    pub fn bits_2d(&self, index: u32, dim: Dim) -> [u32; 2] {
        match self.kind() {
            Sampler::ZSobol => zsobol::pair(self.key, dim).point(zsobol::index(self.key, index)),
            Sampler::OwenSobol => owen_sobol::Pair::new(self.key, dim).point(index),
            Sampler::Independent => independent::point(self.key, dim, index),
        }
    }

    /// A point of the unit square, both in [0, 1) with 24 bits.
    #[inline(always)]
    pub fn get_2d(&self, index: u32, dim: Dim) -> [f32; 2] {
        self.bits_2d(index, dim).map(to_unit_f32)
    }

    /// A point of the unit square, both in [0, 1) with 52 bits: the 32 of the pattern and 20 random ones below, so
    /// that tables of many cells can still divide what is left of a number after choosing a cell.
    #[inline]
    pub fn get_2d_f64(&self, index: u32, dim: Dim) -> [f64; 2] {
        let bits = self.bits_2d(index, dim);
        let low = hash::mix32(bits[0] ^ hash::mix32(bits[1] ^ self.key[1]));
        let lows = [low >> 12, hash::mix32(low) >> 12];
        // 2^52 steps: exact in f64.
        std::array::from_fn(|i| {
            ((u64::from(bits[i]) << 20) | u64::from(lows[i])) as f64 / (1u64 << 52) as f64
        })
    }

    /// A number in [0, 1) with 24 bits: the first coordinate of `get_2d`, at half its cost.
    #[inline(always)]
    pub fn get_1d(&self, index: u32, dim: Dim) -> f32 {
        to_unit_f32(match self.kind() {
            Sampler::ZSobol => zsobol::pair(self.key, dim).first(zsobol::index(self.key, index)),
            Sampler::OwenSobol => owen_sobol::Pair::new(self.key, dim).first(index),
            Sampler::Independent => independent::point(self.key, dim, index)[0],
        })
    }

    /// `get_2d` of the eight samples from `first_index` on, as columns.
    pub fn few_2d(&self, first_index: u32, dim: Dim) -> [[f32; 8]; 2] {
        dispatch(Few { sampler: *self, first_index, dim })
    }

    /// `get_2d` for the samples `first_index ..` of this pixel, as many as the shorter slice takes.
    pub fn fill_2d(&self, first_index: u32, dim: Dim, out_x: &mut [f32], out_y: &mut [f32]) {
        dispatch(FillPixel { sampler: self, first_index, dim, out: [out_x, out_y] });
    }
}

/// `get_2d` for many paths at once: entry `i` is the point of sample `indices[i]` of `pixels[i]`. All slices should
/// have the same length; the shortest decides. All are taken to be of the kind of the first.
pub fn points_2d(pixels: &[PixelSampler], indices: &[u32], dim: Dim, out_x: &mut [f32], out_y: &mut [f32]) {
    dispatch(FillPaths { pixels, indices, dim, out: [out_x, out_y] });
}

struct FillPixel<'a> {
    sampler: &'a PixelSampler,
    first_index: u32,
    dim: Dim,
    out: [&'a mut [f32]; 2],
}

impl Kernel for FillPixel<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let PixelSampler { key } = *self.sampler;
        let [out_x, out_y] = self.out;
        let slots = out_x.iter_mut().zip(out_y.iter_mut()).zip(0u32..);
        let (dim, first) = (self.dim, self.first_index);
        match self.sampler.kind() {
            Sampler::ZSobol => {
                let pair = zsobol::pair(key, dim);
                for ((x, y), i) in slots {
                    let index = zsobol::index(key, first.wrapping_add(i));
                    [*x, *y] = pair.point(index).map(to_unit_f32);
                }
            }
            Sampler::OwenSobol => {
                let pair = owen_sobol::Pair::new(key, dim);
                for ((x, y), i) in slots {
                    [*x, *y] = pair.point(first.wrapping_add(i)).map(to_unit_f32);
                }
            }
            Sampler::Independent => {
                for ((x, y), i) in slots {
                    [*x, *y] = independent::point(key, dim, first.wrapping_add(i)).map(to_unit_f32);
                }
            }
        }
    }
}

struct Few {
    sampler: PixelSampler,
    first_index: u32,
    dim: Dim,
}

impl Kernel for Few {
    type Output = [[f32; 8]; 2];

    #[inline(always)]
    fn run(self) -> [[f32; 8]; 2] {
        let Few { sampler: PixelSampler { key }, first_index: first, dim } = self;
        match self.sampler.kind() {
            Sampler::ZSobol => {
                let pair = zsobol::pair(key, dim);
                few(|i| pair.point(zsobol::index(key, first.wrapping_add(i))))
            }
            Sampler::OwenSobol => {
                let pair = owen_sobol::Pair::new(key, dim);
                few(|i| pair.point(first.wrapping_add(i)))
            }
            Sampler::Independent => few(|i| independent::point(key, dim, first.wrapping_add(i))),
        }
    }
}

/// A loop of known length, which vectors do at once: they are wider than what [`FillPixel`] would leave over.
#[inline(always)]
fn few(point: impl Fn(u32) -> [u32; 2]) -> [[f32; 8]; 2] {
    let [mut x, mut y] = [[0.0; 8]; 2];
    for ((x, y), i) in x.iter_mut().zip(&mut y).zip(0..) {
        [*x, *y] = point(i).map(to_unit_f32);
    }
    [x, y]
}

struct FillPaths<'a> {
    pixels: &'a [PixelSampler],
    indices: &'a [u32],
    dim: Dim,
    out: [&'a mut [f32]; 2],
}

impl Kernel for FillPaths<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Some(first) = self.pixels.first() else { return };
        let [out_x, out_y] = self.out;
        let slots = out_x.iter_mut().zip(out_y.iter_mut()).zip(self.pixels).zip(self.indices);
        match first.kind() {
            Sampler::ZSobol => {
                for (((x, y), pixel), &index) in slots {
                    let index = zsobol::index(pixel.key, index);
                    [*x, *y] = zsobol::pair(pixel.key, self.dim).point(index).map(to_unit_f32);
                }
            }
            Sampler::OwenSobol => {
                for (((x, y), pixel), &index) in slots {
                    [*x, *y] = owen_sobol::Pair::new(pixel.key, self.dim).point(index).map(to_unit_f32);
                }
            }
            Sampler::Independent => {
                for (((x, y), pixel), &index) in slots {
                    [*x, *y] = independent::point(pixel.key, self.dim, index).map(to_unit_f32);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
