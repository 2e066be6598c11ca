//! L2: materials, one file a kind.

mod conductor;
mod diffuse;
mod emissive;
#[allow(dead_code)]
mod glossy;
mod metal;
mod microfacet;
mod mirror;
mod multiscatter;
mod reflectance;

use crate::base::material::Material;
use crate::base::registry::Row;

/// Every kind of material.
pub static REGISTRY: &[Row<dyn Material>] = &[diffuse::ROW, mirror::ROW, metal::ROW, emissive::ROW];

#[cfg(test)]
mod tests;
