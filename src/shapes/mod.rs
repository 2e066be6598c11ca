//! Shapes: one file a kind, each with its registry row.

mod cuboid;
pub mod ellipsoid;
pub mod generated;
pub mod mesh;
mod quad;
pub mod quadric;
mod rectangle;
pub mod sphere;

use crate::base::registry::Row;
use crate::base::shape::ShapeSource;

/// Every kind of shape.
pub static REGISTRY: &[Row<dyn ShapeSource>] = &[
    mesh::ROW,
    sphere::ROW,
    ellipsoid::ROW,
    cuboid::ROW,
    rectangle::ROW,
    quad::ROW,
    generated::DISPLACED_SPHERE,
    generated::KNOT,
    generated::TERRAIN,
];

#[cfg(test)]
mod tests;
