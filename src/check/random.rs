//! Random numbers for rays by the billion: a counter and a hash. Any batch of rays is a pure function of its number.

use crate::sampler::hash::mix64;
use crate::sampling::warp::uniform_sphere;
use glam::{Vec2, Vec3};

/// A stream of uniform numbers (SplitMix64).
#[derive(Debug, Clone)]
pub struct Stream(u64);

impl Stream {
    /// The stream of batch `batch` of a run with this seed.
    pub fn new(seed: u64, batch: u64) -> Self {
        Stream(mix64(mix64(seed) ^ batch))
    }

    /// 64 random bits.
    #[inline]
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix64(self.0)
    }

    /// Uniform in [0, 1), 53 bits.
    #[inline]
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform among 0 .. n; n is more than 0. By a product of 64 bits: biased by no more than n / 2^64.
    #[inline]
    pub fn below(&mut self, n: u64) -> u64 {
        ((u128::from(self.bits()) * u128::from(n)) >> 64) as u64
    }

    /// Uniform on the unit sphere.
    #[inline]
    pub fn direction(&mut self) -> Vec3 {
        let bits = self.bits();
        let unit = |b: u64| (b >> 40) as f32 / (1u32 << 24) as f32;
        uniform_sphere(Vec2::new(unit(bits), unit(bits << 32)))
    }

    /// Weights of a triangle's second and third corner, uniform over its area.
    #[inline]
    pub fn barycentrics(&mut self) -> [f64; 2] {
        let (a, b) = (self.unit(), self.unit());
        if a + b > 1.0 { [1.0 - a, 1.0 - b] } else { [a, b] }
    }
}
