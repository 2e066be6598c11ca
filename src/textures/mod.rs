//! L2: textures, one file a kind.

mod checker;
mod constant;
mod image;
mod mip;

use crate::base::registry::Row;
use crate::base::texture::Texture;

/// Every kind of texture.
pub static REGISTRY: &[Row<dyn Texture>] = &[constant::ROW, checker::ROW, image::ROW];

#[cfg(test)]
mod tests;
