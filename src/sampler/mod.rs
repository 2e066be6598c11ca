//! L0: stateless sample points: a pure function of (seed, pixel, sample, dimension).

pub mod dims;
pub mod hash;
pub mod independent;
pub mod owen_sobol;

use std::str::FromStr;

pub use dims::{Dim, Slot};
pub use hash::{SHADOW_KEY, ray_key};

use crate::error::{Error, Result, unknown_name};
use crate::math::simd::{Kernel, dispatch};

/// The kinds of sample points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Sampler {
    /// Owen-scrambled Sobol' pairs, see [`owen_sobol`]: error on smooth light falls faster than 1/sqrt(n).
    #[default]
    OwenSobol,
    /// Independent uniform numbers, for comparison and for statistics that assume them.
    Independent,
}

impl Sampler {
    /// Names as the command line and scene files spell them, each with its kind.
    pub const NAMES: [(&'static str, Sampler); 2] =
        [("owen-sobol", Sampler::OwenSobol), ("independent", Sampler::Independent)];

    /// The name of this kind.
    pub fn name(self) -> &'static str {
        match self {
            Sampler::OwenSobol => "owen-sobol",
            Sampler::Independent => "independent",
        }
    }

    /// One line for people.
    pub fn doc(self) -> &'static str {
        match self {
            Sampler::OwenSobol => {
                "Owen-scrambled Sobol' pairs: error on smooth light falls faster than 1/sqrt(n)"
            }
            Sampler::Independent => "independent uniform numbers, for comparison and statistics",
        }
    }

    /// The points of one pixel; see [`PixelSampler::new`].
    pub fn pixel(self, seed: u64, x: u32, y: u32, replicate: u32) -> PixelSampler {
        PixelSampler::new(seed, x, y, replicate).of_kind(self)
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
    /// Hash of seed, pixel and replicate; the last bit of the second half tells the kind (1: independent).
    key: [u32; 2],
}

impl PixelSampler {
    /// Owen-scrambled points of pixel (x, y). Another `replicate` gives an independent randomisation of the same
    /// pixel: the variance between replicates is an unbiased estimate of that of the mean of one.
    pub fn new(seed: u64, x: u32, y: u32, replicate: u32) -> Self {
        let pixel = (u64::from(y) << 32) | u64::from(x);
        let h = hash::mix64(hash::mix64(hash::mix64(seed) ^ pixel).wrapping_add(u64::from(replicate)));
        PixelSampler { key: [h as u32, (h >> 32) as u32] }.of_kind(Sampler::OwenSobol)
    }

    fn of_kind(self, kind: Sampler) -> Self {
        let bit = u32::from(kind == Sampler::Independent);
        PixelSampler { key: [self.key[0], (self.key[1] & !1) | bit] }
    }

    /// The kind of points it gives.
    #[inline(always)]
    pub fn kind(&self) -> Sampler {
        if self.key[1] & 1 == 0 { Sampler::OwenSobol } else { Sampler::Independent }
    }

    /// Two numbers in [0, 1) as 32-bit fractions.
    #[inline(always)]
    pub fn bits_2d(&self, index: u32, dim: Dim) -> [u32; 2] {
        match self.kind() {
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
            Sampler::OwenSobol => owen_sobol::Pair::new(self.key, dim).first(index),
            Sampler::Independent => independent::point(self.key, dim, index)[0],
        })
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
