//! Values over a surface.

use crate::color::Rgb;
use glam::Vec2;

/// A colour or number that may vary over a surface.
pub trait Texture: Send + Sync {
    /// Value at texture coordinates (v up), averaged over about `footprint` in uv units (0: a point).
    fn eval(&self, uv: Vec2, footprint: f32) -> Rgb;

    /// Whether [`Texture::eval`] looks at the footprint: where nothing does, none is computed.
    fn uses_footprint(&self) -> bool {
        false
    }

    /// The value if it is the same everywhere: then nothing else is ever asked.
    fn constant(&self) -> Option<Rgb> {
        None
    }

    /// Average over the unit square.
    fn mean(&self) -> Rgb;
}
