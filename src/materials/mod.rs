//! L2: materials, one file a kind.

mod diffuse;
mod emissive;
mod mirror;
mod reflectance;

use crate::base::material::Material;
use crate::base::registry::Row;

/// Every kind of material.
pub static REGISTRY: &[Row<dyn Material>] = &[diffuse::ROW, mirror::ROW, emissive::ROW];

#[cfg(test)]
mod tests;
