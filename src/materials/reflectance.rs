//! A parameter that several materials take: how much of the light a surface gives back.

use crate::base::registry::{Params, TextureOrColor};
use crate::base::shape::Needs;
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::error::Result;

/// A reflectance in [0, 1] per channel, the same everywhere or textured.
pub(super) struct Reflectance(TextureOrColor);

impl Reflectance {
    /// Parameter `name`, or `default`. A colour above 1 is an error: it would make light of nothing. A texture's
    /// values are clamped where they are read.
    pub fn from_params(p: &Params, name: &str, default: [f64; 3]) -> Result<Self> {
        let input = match p.texture_or(name, default)? {
            TextureOrColor::Texture(t) => {
                t.constant().map_or(TextureOrColor::Texture(t), TextureOrColor::Color)
            }
            color => color,
        };
        match input {
            TextureOrColor::Color(c) if c.max_component() > 1.0 => Err(p.error(
                name,
                "a reflectance takes values from 0 to 1: above, it would make light of nothing",
            )),
            input => Ok(Reflectance(input)),
        }
    }

    /// What [`Reflectance::at`] reads of a vertex.
    pub fn needs(&self) -> Needs {
        match &self.0 {
            TextureOrColor::Color(_) => Needs::default(),
            TextureOrColor::Texture(t) => Needs { uv: true, tangents: t.uses_footprint() },
        }
    }

    /// The value at a vertex.
    #[inline]
    pub fn at(&self, vertex: &Vertex) -> Rgb {
        match &self.0 {
            TextureOrColor::Color(c) => *c,
            TextureOrColor::Texture(t) => t.eval(vertex.uv, vertex.footprint).map(|v| v.min(1.0)),
        }
    }

    /// The value if it is the same everywhere.
    pub fn constant(&self) -> Option<Rgb> {
        match &self.0 {
            TextureOrColor::Color(c) => Some(*c),
            TextureOrColor::Texture(_) => None,
        }
    }

    /// Whether it is zero everywhere.
    pub fn is_black(&self) -> bool {
        self.constant().is_some_and(Rgb::is_black)
    }
}
