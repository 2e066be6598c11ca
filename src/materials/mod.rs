//! L2: materials, one file a kind.

mod beckmann;
mod blinn_phong;
mod conductor;
mod dielectric;
mod diffuse;
mod emissive;
mod ggx;
mod glossy;
mod metal;
mod microfacet;
mod mirror;
mod multiscatter;
mod phong;
mod reflectance;

use crate::base::material::Material;
use crate::base::registry::Row;

/// Every kind of material.
pub static REGISTRY: &[Row<dyn Material>] = &[
    diffuse::ROW,
    mirror::ROW,
    metal::ROW,
    beckmann::ROW,
    dielectric::ROW,
    emissive::ROW,
    blinn_phong::ROW,
    phong::ROW,
    ggx::ROW,
];

#[cfg(test)]
mod tests;
