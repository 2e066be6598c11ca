//! Ellipsoids with axes along those of their object; turned by the object's transform.

use super::quadric::QuadricSource;
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::shape::ShapeSource;
use glam::DVec3;
use std::sync::Arc;

/// The registry row.
pub const ROW: Row<dyn ShapeSource> = Row {
    kind: "ellipsoid",
    doc: "an ellipsoid, solved in double precision",
    params: &[
        ParamSpec { name: "center", kind: ParamKind::Vector, default: Some("[0, 0, 0]"), doc: "metres" },
        ParamSpec {
            name: "semi_axes",
            kind: ParamKind::Vector,
            default: None,
            doc: "half of its extent along x, y and z, metres, more than 0",
        },
    ],
    build: |p| {
        let semi_axes = p.vector("semi_axes")?;
        if semi_axes.iter().any(|a| !(1e-30..=1e30).contains(a)) {
            return Err(p.error("semi_axes", "takes three lengths of more than 0"));
        }
        let center = DVec3::from_array(p.vector_or("center", [0.0; 3])?);
        Ok(Arc::new(QuadricSource::new(center, DVec3::from_array(semi_axes))))
    },
    samples: || {
        let v = |x: [f64; 3]| Value::Numbers(x.to_vec());
        vec![
            Params::new().with("semi_axes", v([1.0, 0.5, 2.0])),
            Params::new().with("semi_axes", v([0.05, 1.5, 1.0])).with("center", v([0.4, 0.0, -3.0])),
        ]
    },
};
