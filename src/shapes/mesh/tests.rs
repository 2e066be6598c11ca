use super::ROW;
use crate::base::mesh_data::{MeshData, Positions, Repairs};
use crate::base::registry::{Params, Value};
use crate::base::shape::{LocalRay, Needs};
use glam::{DAffine3, DVec3, Vec2};
use std::sync::Arc;

/// One triangle without texture coordinates, placed by `by`; the uv at these weights of its second and third corner.
fn uv_at(missing_uv: Option<&str>, by: &[DAffine3], b: [f64; 2]) -> Vec2 {
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.2, 0.0], [0.3, 1.0, 0.5]];
    let data = MeshData {
        positions: Positions::F64(corners.to_vec()),
        normals: Vec::new(),
        uvs: Vec::new(),
        indices: vec![[0, 1, 2]],
        material_ids: Vec::new(),
        materials: Vec::new(),
        repairs: Repairs::default(),
    };
    let mut p = Params::new().with("path", Value::Mesh(Arc::new(data)));
    if let Some(word) = missing_uv {
        p = p.with("missing_uv", Value::Text(word.into()));
    }
    let mut shape = (ROW.build)(&p).expect("builds").place(&by[0]).expect("places").shape;
    let mut all = by[0];
    for m in &by[1..] {
        shape = shape.transformed(m).expect("places");
        all = *m * all;
    }
    let [v, e, f] = corners.map(DVec3::from);
    let p = all.transform_point3(v + (e - v) * b[0] + (f - v) * b[1]);
    let d = all.transform_vector3((e - v).cross(f - v));
    let ray = LocalRay { o: p - d, d, tnear: 0.0, tfar: f64::INFINITY };
    let at = shape.refine(&ray, 0, 1.0, Needs::ALL);
    let s = shape.sample_primitive(0, (p - d).as_vec3(), [0.3, 0.6]).expect("is seen");
    let seen = LocalRay { o: p - d, d: s.wi.as_dvec3(), tnear: 0.0, tfar: f64::INFINITY };
    assert!((shape.refine(&seen, 0, s.dist, Needs::ALL).uv - s.uv).length() < 1e-5, "a sample has it too");
    at.uv
}

#[test]
fn meshes_without_uv_take_what_was_asked_for() {
    let mirror = DAffine3::from_scale(DVec3::new(-2.0, 1.0, 1.0));
    let turn = DAffine3::from_rotation_y(0.4);
    let b = [0.2, 0.5];
    // Of f32 corners.
    let same = |a: Vec2, x: f32, y: f32| assert!((a - Vec2::new(x, y)).length() < 1e-6, "{a}");
    for by in [vec![turn], vec![mirror], vec![mirror, turn], vec![turn, mirror], vec![mirror, mirror]] {
        // A mirror exchanges corners, and their weights must not follow.
        same(uv_at(Some("barycentric"), &by, b), 0.2, 0.5);
    }
    same(uv_at(None, &[turn], b), 0.7, 0.5);
    same(uv_at(Some("square"), &[turn], b), 0.7, 0.5);
}
