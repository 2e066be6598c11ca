//! L0: warps and distributions.

pub mod mis;
pub mod warp;
