//! L4: how far a picture is from another, by many measures, and whether the difference is more than noise.

pub mod flip;
mod lanes;
pub mod ssim;
pub mod statistics;
