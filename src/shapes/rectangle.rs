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
        parallelogram(center - 0.5 * (u + v), [u, v])
            .ok_or_else(|| p.error("edge_v", "and `edge_u` must not be zero or parallel"))
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

/// Two triangles with texture coordinates along both edges; None where these are zero or parallel.
pub(super) fn parallelogram(corner: DVec3, [u, v]: [DVec3; 2]) -> Option<Arc<dyn ShapeSource>> {
    // Scaled first: products of very long or short edges over- or underflow. What is not a number is not more.
    let size = u.abs().max_element().max(v.abs().max_element());
    let (unit_u, unit_v) = (u / size, v / size);
    let spanned = unit_u.cross(unit_v).length() > 1e-12 * unit_u.length() * unit_v.length();
    let positions = [corner, corner + u, corner + u + v, corner + v].map(|p| p.to_array());
    let data = MeshData {
        positions: Positions::F64(positions.into()),
        normals: Vec::new(),
        uvs: vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
        indices: vec![[0, 1, 2], [0, 2, 3]],
        material_ids: Vec::new(),
        materials: Vec::new(),
        repairs: Repairs::default(),
    };
    spanned.then(|| Arc::new(MeshSource::new(Arc::new(data), Normals::Flat)) as Arc<dyn ShapeSource>)
}
