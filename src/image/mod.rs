//! L4: pictures in and out.

mod deflate;
pub mod denoise;
mod exr_read;
mod exr_write;
mod hdr;
pub mod load;
pub mod picture;
pub mod read;
mod srgb8;
pub mod tonemap;
pub mod write;
