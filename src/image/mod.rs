//! L4: pictures in and out.

pub mod about;
mod deflate;
pub mod denoise;
pub mod environment;
mod exr_layers;
mod exr_read;
mod exr_write;
pub mod false_color;
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
