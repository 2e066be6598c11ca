//! Boxes, as twelve triangles.

use super::mesh::{MeshSource, Normals};
use crate::base::mesh_data::{MeshData, Positions, Repairs};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::shape::ShapeSource;
use glam::DVec3;
use std::sync::Arc;

/// The registry row.
pub const ROW: Row<dyn ShapeSource> = Row {
    kind: "box",
    doc: "a box with its sides along the axes of its object; each side has texture coordinates of its own",
    params: &[
        ParamSpec {
            name: "min",
            kind: ParamKind::Vector,
            default: Some("[-0.5, -0.5, -0.5]"),
            doc: "corner with the smallest coordinates, metres",
        },
        ParamSpec {
            name: "max",
            kind: ParamKind::Vector,
            default: Some("[0.5, 0.5, 0.5]"),
            doc: "corner with the largest coordinates, metres",
        },
    ],
    build: |p| {
        let min = DVec3::from_array(p.vector_or("min", [-0.5; 3])?);
        let max = DVec3::from_array(p.vector_or("max", [0.5; 3])?);
        if !min.cmplt(max).all() {
            return Err(p.error("max", "must lie above `min` in x, y and z"));
        }
        Ok(Arc::new(MeshSource::new(Arc::new(sides(min, max)), Normals::Flat)))
    },
    samples: || {
        let v = |x: f64, y: f64, z: f64| Value::Numbers(vec![x, y, z]);
        vec![Params::new(), Params::new().with("min", v(-3.0, 0.0, 1.0)).with("max", v(1.0, 0.25, 1.5))]
    },
};

/// Six sides with four vertices each, counter-clockwise from outside. On the upright sides v points up (+y).
fn sides(min: DVec3, max: DVec3) -> MeshData {
    // For each side: outward, along u, along v.
    let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
    let frames = [[x, -z, y], [-x, z, y], [y, x, -z], [-y, x, z], [z, x, y], [-z, -x, y]];
    let (center, half) = ((min + max) * 0.5, (max - min) * 0.5);
    let mut positions = Vec::with_capacity(24);
    for [n, u, v] in frames {
        for (a, b) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            positions.push((center + half * (n + u * a + v * b)).to_array());
        }
    }
    MeshData {
        positions: Positions::F64(positions),
        normals: Vec::new(),
        uvs: [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].repeat(6),
        indices: (0..6)
            .flat_map(|s| [[0, 1, 2], [0, 2, 3]].map(|t: [u32; 3]| t.map(|i| 4 * s + i)))
            .collect(),
        material_ids: Vec::new(),
        materials: Vec::new(),
        repairs: Repairs::default(),
    }
}
