//! Spheres.

use super::quadric::QuadricSource;
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::shape::ShapeSource;
use glam::DVec3;
use std::sync::Arc;

/// The registry row.
pub const ROW: Row<dyn ShapeSource> = Row {
    kind: "sphere",
    doc: "a sphere, solved in double precision",
    params: &[
        ParamSpec { name: "center", kind: ParamKind::Vector, default: Some("[0, 0, 0]"), doc: "metres" },
        ParamSpec {
            name: "radius",
            kind: ParamKind::Number { min: 1e-30, max: 1e30 },
            default: Some("1"),
            doc: "metres, more than 0",
        },
    ],
    build: |p| {
        let radius = p.number_or("radius", 1.0)?;
        if radius <= 0.0 {
            return Err(p.error("radius", format!("{radius} is not more than 0")));
        }
        let center = DVec3::from_array(p.vector_or("center", [0.0; 3])?);
        Ok(Arc::new(QuadricSource::new(center, DVec3::splat(radius))))
    },
    samples: || {
        vec![
            Params::new(),
            Params::new()
                .with("center", Value::Numbers(vec![1.0, -2.0, 0.5]))
                .with("radius", Value::Number(0.3)),
        ]
    },
};
