//! L4: pictures in and out.

mod exr_read;
mod hdr;
pub mod picture;
pub mod read;
