//! Eight lanes of f32, by whichever instructions the processor has.
//!
//! Traversal is written once, over [`Simd`]. It only culls: every hit is decided in double precision by code that is the
//! same on all paths, so the paths may round differently and still find the same.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod portable;
#[cfg(target_arch = "x86_64")]
mod sse42;
#[cfg(test)]
mod tests;

pub(super) use portable::Portable;

use crate::error::{Error, Result};
use crate::math::simd::Level;
use bytemuck::{Pod, Zeroable};

/// Lanes of a vector.
pub(super) const LANES: usize = 8;

/// Eight numbers where vectors are loaded from and stored to.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C, align(32))]
pub(super) struct Lanes(pub(super) [f32; LANES]);

/// Operations on eight lanes. Implementations mark all of it `#[inline(always)]`, so that it is compiled for the
/// instructions of the [`enter`] it is reached by.
pub(super) trait Simd: Copy {
    /// Eight f32.
    type V: Copy;

    fn load(from: &Lanes) -> Self::V;
    fn store(v: Self::V) -> Lanes;
    fn splat(x: f32) -> Self::V;
    fn add(a: Self::V, b: Self::V) -> Self::V;
    fn sub(a: Self::V, b: Self::V) -> Self::V;
    fn mul(a: Self::V, b: Self::V) -> Self::V;
    fn div(a: Self::V, b: Self::V) -> Self::V;
    /// a b + c, rounded once or twice.
    fn mul_add(a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// a b - c, rounded once or twice.
    fn mul_sub(a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// c - a b, rounded once or twice.
    fn neg_mul_add(a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// The smaller one; `b` where either is NaN.
    fn min(a: Self::V, b: Self::V) -> Self::V;
    /// The larger one; `b` where either is NaN.
    fn max(a: Self::V, b: Self::V) -> Self::V;
    /// Bit i: whether a <= b in lane i.
    fn le(a: Self::V, b: Self::V) -> u32;
    /// All bits of lane i: whether a <= b there.
    fn le_bits(a: Self::V, b: Self::V) -> Self::V;
    fn and(a: Self::V, b: Self::V) -> Self::V;
    fn or(a: Self::V, b: Self::V) -> Self::V;
    fn xor(a: Self::V, b: Self::V) -> Self::V;
    /// `a` where the bits of the lane are set, else `b`.
    fn select(bits: Self::V, a: Self::V, b: Self::V) -> Self::V;
    /// Bit i: whether the topmost bit of lane i is set.
    fn bits(a: Self::V) -> u32;
    /// The smallest of the lanes, none of which is NaN.
    fn least(a: Self::V) -> f32;
    /// The lanes of a set, moved together to the front; what follows them means nothing.
    fn compress(a: Self::V, set: u32) -> Lanes;
    /// Asks for all cache lines of what will be read soon.
    fn prefetch<T>(it: &T);
}

/// By set, the lanes in it, moved to the front, a byte each.
static COMPRESSED: [[u8; LANES]; 1 << LANES] = {
    let mut table = [[0; LANES]; 1 << LANES];
    let mut set = 0;
    while set < 1 << LANES {
        let (mut lane, mut n) = (0, 0);
        while lane < LANES {
            if set >> lane & 1 == 1 {
                table[set][n] = lane as u8;
                n += 1;
            }
            lane += 1;
        }
        set += 1;
    }
    table
};

/// Work that is written over [`Simd`].
pub(super) trait Job {
    type Output;

    /// Does it; `#[inline(always)]`.
    fn run<S: Simd>(self) -> Self::Output;
}

/// A level that this processor has been seen to have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Available(Level);

impl Available {
    /// The level asked for, or the one chosen for the program. Errors where the processor lacks it.
    pub(super) fn new(asked: Option<Level>) -> Result<Self> {
        let level = asked.map_or_else(Level::chosen, Ok)?;
        if level.is_available() {
            return Ok(Available(level));
        }
        Err(Error::Usage(format!("this processor has no {}", level.name())))
    }

    pub(super) fn level(self) -> Level {
        self.0
    }
}

/// Runs a job by the instructions of a level.
#[inline(always)]
pub(super) fn enter<J: Job>(level: Available, job: J) -> J::Output {
    match level.0 {
        #[cfg(target_arch = "x86_64")]
        Level::Avx512 => avx2::enter_avx512(level, job),
        #[cfg(target_arch = "x86_64")]
        Level::Avx2 => avx2::enter(level, job),
        #[cfg(target_arch = "x86_64")]
        Level::Sse42 => sse42::enter(level, job),
        _ => job.run::<Portable>(),
    }
}
