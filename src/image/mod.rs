//! L4: pictures in and out.

mod deflate;
pub mod denoise;
mod exr_layers;
mod exr_read;
mod exr_write;
mod hdr;
mod kind;
pub mod load;
mod pfm;
pub mod picture;
mod raw;
pub mod read;
mod srgb8;
mod tiff_read;
pub mod tonemap;
pub mod write;
