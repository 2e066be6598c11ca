//! L0: warps and distributions.

pub mod distribution;
pub mod mis;
pub mod warp;
