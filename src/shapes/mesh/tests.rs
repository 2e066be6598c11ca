use super::{MeshShape, ROW};
use crate::base::hit::Hit;
use crate::base::lanes::{LANES, LocalRays, Surfaces};
use crate::base::mesh::TriangleMesh;
use crate::base::mesh_data::{MeshData, Positions, Repairs};
use crate::base::registry::{Params, Value};
use crate::base::shape::{LocalRay, Needs, Shape};
use crate::math::aabb::Aabb;
use crate::testing::TestRng;
use glam::{DAffine3, DVec3, Vec2, Vec3};
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

/// Triangles that no loader would let through among them: points, lines, slivers, and normals that cancel or look away.
fn odd_mesh(normals: Option<[[f32; 3]; 6]>) -> MeshShape {
    let positions = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.25],
        [0.5, 0.0, 0.0],
        [1e-20, 1e-20, 0.0],
        [0.25, 1e-7, 3e5],
    ];
    let indices = vec![[0, 1, 2], [2, 1, 0], [0, 0, 0], [0, 3, 1], [0, 4, 1], [1, 2, 5], [4, 5, 0]];
    let mut mesh = TriangleMesh::new(positions.to_vec(), indices);
    mesh.normals = normals.map_or(Vec::new(), |n| n.to_vec());
    MeshShape::new(mesh, Aabb::from_points(positions.map(Vec3::from)))
}

#[test]
fn odd_triangles_are_the_same_alone_and_together() {
    let (x, up) = ([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let smooth = [up, [0.0, 0.6, 0.8], up, up, up, x];
    let cancelling = [up, [0.0, 0.0, -1.0], up, up, [0.0; 3], x];
    let mut rng = TestRng::new(11);
    for normals in [None, Some(smooth), Some(cancelling)] {
        let shape = odd_mesh(normals);
        for needs in [Needs::default(), Needs::ALL] {
            for round in 0..500 {
                let n = 1 + round % LANES;
                let (mut rays, mut out) = (LocalRays::default(), Surfaces::default());
                let mut hits = [Hit::default(); LANES];
                for (lane, hit) in hits.iter_mut().enumerate().take(n) {
                    hit.prim = (rng.f64() * 7.0) as u32;
                    // Past the triangles, through corners and along planes, as well as through the middle.
                    let o = rng.direction().as_dvec3() * 3.0;
                    let to = [DVec3::ZERO, DVec3::new(0.5, 0.0, 0.0), DVec3::new(0.3, 0.3, 0.075)];
                    let d = if round % 5 == 0 { DVec3::X } else { to[lane % 3] - o };
                    rays.set(lane, &LocalRay { o, d, tnear: 0.0, tfar: f64::INFINITY });
                }
                shape.refine_batch(&rays, &hits[..n], needs, &mut out);
                for (lane, hit) in hits[..n].iter().enumerate() {
                    let alone = shape.refine(&rays.get(lane), hit.prim, hit.t, needs);
                    // As text, two NaN are the same, and two zeros of different sign are not.
                    assert_eq!(format!("{alone:?}"), format!("{:?}", out.get(lane)), "{hit:?}");
                }
            }
        }
    }
}
