//! A parallelogram by a corner and two edges, as lamps are often given.

use super::rectangle::parallelogram;
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::shape::ShapeSource;
use glam::DVec3;

/// The registry row.
pub const ROW: Row<dyn ShapeSource> = Row {
    kind: "quad",
    doc: "a parallelogram by a corner and two edges; its outer side is that of edge_a x edge_b",
    params: &[
        ParamSpec { name: "corner", kind: ParamKind::Vector, default: Some("[0, 0, 0]"), doc: "metres" },
        ParamSpec {
            name: "edge_a",
            kind: ParamKind::Vector,
            default: Some("[1, 0, 0]"),
            doc: "from the corner to the next, along which u grows from 0 to 1, metres",
        },
        ParamSpec {
            name: "edge_b",
            kind: ParamKind::Vector,
            default: Some("[0, 0, -1]"),
            doc: "from the corner to the other one beside it, along which v grows, metres",
        },
    ],
    build: |p| {
        let vector =
            |name: &str, default| Ok::<_, crate::error::Error>(DVec3::from(p.vector_or(name, default)?));
        let corner = vector("corner", [0.0; 3])?;
        let (a, b) = (vector("edge_a", [1.0, 0.0, 0.0])?, vector("edge_b", [0.0, 0.0, -1.0])?);
        parallelogram(corner, [a, b])
            .ok_or_else(|| p.error("edge_b", "and `edge_a` must not be zero or parallel"))
    },
    samples: || {
        let v = |x: f64, y: f64, z: f64| Value::Numbers(vec![x, y, z]);
        vec![
            Params::new(),
            Params::new()
                .with("corner", v(-1.0, 0.5, 0.0))
                .with("edge_a", v(3.0, 1.0, 0.0))
                .with("edge_b", v(1.0, 0.3, 1.0)),
        ]
    },
};
