//! Rectangles and parallelograms, as two triangles.

use super::mesh::{MeshSource, Normals};
use crate::base::mesh_data::{MeshData, Positions, Repairs};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::shape::ShapeSource;
use glam::DVec3;
use std::sync::Arc;

/// The registry row.
pub const ROW: Row<dyn ShapeSource> = Row {
    kind: "rectangle",
    doc: "a parallelogram; its outer side is that of edge_u x edge_v, by default upwards",
    params: &[
        ParamSpec { name: "center", kind: ParamKind::Vector, default: Some("[0, 0, 0]"), doc: "metres" },
        ParamSpec {
            name: "edge_u",
            kind: ParamKind::Vector,
            default: Some("[1, 0, 0]"),
            doc: "the side along which the texture coordinate u grows from 0 to 1, metres",
        },
        ParamSpec {
            name: "edge_v",
            kind: ParamKind::Vector,
            default: Some("[0, 0, -1]"),
            doc: "the side along which v grows, metres",
        },
    ],
    build: |p| {
        let center = DVec3::from_array(p.vector_or("center", [0.0; 3])?);
        let u = DVec3::from_array(p.vector_or("edge_u", [1.0, 0.0, 0.0])?);
        let v = DVec3::from_array(p.vector_or("edge_v", [0.0, 0.0, -1.0])?);
        if u.cross(v).length() <= 1e-12 * u.length() * v.length() {
            return Err(p.error("edge_v", "and `edge_u` must not be zero or parallel"));
        }
        let corner = |a: f64, b: f64| (center + u * a + v * b).to_array();
        let positions = vec![corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5)];
        let data = MeshData {
            positions: Positions::F64(positions),
            normals: Vec::new(),
            uvs: vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
            indices: vec![[0, 1, 2], [0, 2, 3]],
            material_ids: Vec::new(),
            materials: Vec::new(),
            repairs: Repairs::default(),
        };
        Ok(Arc::new(MeshSource::new(Arc::new(data), Normals::Flat)))
    },
    samples: || {
        let v = |x: f64, y: f64, z: f64| Value::Numbers(vec![x, y, z]);
        vec![
            Params::new(),
            Params::new()
                .with("center", v(-1.0, 0.5, 0.0))
                .with("edge_u", v(3.0, 1.0, 0.0))
                .with("edge_v", v(0.0, 0.3, 1.0)),
        ]
    },
};
