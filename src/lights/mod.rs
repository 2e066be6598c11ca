//! L2: lights, one file a kind. Point, spot and directional lights have registry rows; area lights come from emitting
//! objects and the sky light from a skybox, so they have none.

pub mod area;
mod directional;
mod point;
mod rectangle;
pub mod sampler;
pub mod sky;
mod spot;
mod tree;

use crate::base::light::LightSource;
use crate::base::registry::Row;

/// Every kind of light that a scene may list.
pub static REGISTRY: &[Row<dyn LightSource>] = &[point::ROW, spot::ROW, directional::ROW];

#[cfg(test)]
mod tests;
