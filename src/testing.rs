//! What the tests of every module share: a stream of random numbers, quadrature over the sphere, the chi-square test
//! of a sampler against its density, and the place of shared test data.

mod chi_square;
pub mod outside;
mod quadrature;
pub mod rows;

use std::path::PathBuf;

use glam::{DVec3, Vec2, Vec3};

pub use chi_square::{Bins, ChiSquare, chi_square_counts, chi_square_sphere};
pub use quadrature::{integrate_rect, integrate_sphere};

use crate::sampler::hash::mix64;

/// The folder of shared test data, from `SKYLIT_DATA` or `../shared/data`. Where it is absent, says so and returns
/// `None`, so that the test can return.
///
/// # Panics
/// Where it is absent and `SKYLIT_REQUIRE_DATA=1`, so that a machine that should have it cannot skip silently.
pub fn data_dir() -> Option<PathBuf> {
    let dir = std::env::var_os("SKYLIT_DATA")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    if dir.is_dir() {
        return Some(dir);
    }
    let required = std::env::var_os("SKYLIT_REQUIRE_DATA").is_some_and(|v| v == "1");
    assert!(!required, "SKYLIT_REQUIRE_DATA=1, but {} is no folder", dir.display());
    println!("skipped: no SKYLIT_DATA");
    None
}

/// A deterministic stream of uniform numbers (SplitMix64).
pub struct TestRng(u64);

impl TestRng {
    /// The stream of this seed.
    pub fn new(seed: u64) -> Self {
        TestRng(mix64(seed))
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix64(self.0)
    }

    /// Uniform in [0, 1), 53 bits.
    pub fn f64(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in [0, 1), 24 bits.
    pub fn f32(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / (1u32 << 24) as f32
    }

    /// Uniform in the unit square.
    pub fn vec2(&mut self) -> Vec2 {
        Vec2::new(self.f32(), self.f32())
    }

    /// Uniform in the cube [-1, 1]^3.
    pub fn cube(&mut self) -> DVec3 {
        DVec3::new(self.f64(), self.f64(), self.f64()) * 2.0 - DVec3::ONE
    }

    /// Uniform on the unit sphere.
    pub fn direction(&mut self) -> Vec3 {
        crate::sampling::warp::uniform_sphere(self.vec2())
    }
}
