//! L0: warps and distributions.

pub mod distribution;
pub mod filter;
pub mod mis;
pub mod spherical;
pub mod warp;
