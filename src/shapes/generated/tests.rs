use super::{DISPLACED_SPHERE, KNOT, TERRAIN};
use crate::base::registry::{Params, Row, Value};
use crate::base::shape::{Needs, ShapeSource};
use glam::{DAffine3, DVec3};
use std::collections::HashMap;
use std::sync::Arc;

fn rows() -> [Row<dyn ShapeSource>; 3] {
    [DISPLACED_SPHERE, KNOT, TERRAIN]
}

fn build(row: &Row<dyn ShapeSource>, triangles: f64) -> Arc<dyn ShapeSource> {
    (row.build)(&Params::new().with("triangles", Value::Number(triangles))).expect("builds")
}

#[test]
fn the_number_of_triangles_is_met_and_all_are_valid() {
    for row in rows() {
        for wanted in [300.0, 4_321.0, 100_000.0] {
            let placed = build(&row, wanted).place(&DAffine3::IDENTITY).expect("places");
            let got = f64::from(placed.shape.primitive_count());
            // Whole rows and columns: to half of one of each.
            let tolerance = 2.5 / (wanted / 12.0).sqrt();
            assert!((got / wanted - 1.0).abs() < tolerance, "{}: {got} for {wanted}", row.kind);
            assert_eq!(placed.dropped.total(), 0, "{}", row.kind);
        }
    }
}

#[test]
fn meshes_close_without_a_seam() {
    // Every edge is met once in each direction, by vertex positions to the bit (patches have vertices of their own).
    for row in [DISPLACED_SPHERE, KNOT] {
        let shape = build(&row, 3000.0).place(&DAffine3::IDENTITY).expect("places").shape;
        let mut edges = HashMap::new();
        for prim in 0..shape.primitive_count() {
            let c = shape.triangles().expect("a mesh").corners(prim).map(|v| v.to_array().map(f32::to_bits));
            for k in 0..3 {
                *edges.entry((c[k], c[(k + 1) % 3])).or_insert(0) += 1;
                *edges.entry((c[(k + 1) % 3], c[k])).or_insert(0) -= 1;
            }
        }
        assert!(edges.values().all(|n| *n == 0), "{}", row.kind);
    }
}

#[test]
fn normals_follow_the_surface() {
    for row in rows() {
        let shape = build(&row, 200_000.0).place(&DAffine3::IDENTITY).expect("places").shape;
        let mesh = shape.triangles().expect("a mesh");
        let (mut sum, mut worst, mut n) = (0.0, 1f64, 0);
        for prim in (0..shape.primitive_count()).step_by(37) {
            let c = mesh.corners(prim).map(|v| v.as_dvec3());
            let face = (c[1] - c[0]).cross(c[2] - c[0]).normalize();
            let ray = crate::base::shape::LocalRay {
                o: (c[0] + c[1] + c[2]) / 3.0 + face,
                d: -face,
                tnear: 0.0,
                tfar: f64::INFINITY,
            };
            let cos = shape.refine(&ray, prim, 1.0, Needs::default()).ns.normalize().dot(face);
            sum += cos;
            worst = worst.min(cos);
            n += 1;
        }
        // The finest waves span four cells, so faces and normals agree to some degrees; analytic slopes would not
        // agree at all if they were wrong.
        assert!(sum / f64::from(n) > 0.97 && worst > 0.0, "{}: {} {worst}", row.kind, sum / f64::from(n));
    }
}

#[test]
fn equal_parameters_make_equal_meshes_and_seeds_do_not() {
    let positions = |row: &Row<dyn ShapeSource>, seed: f64| {
        let params = Params::new().with("triangles", Value::Number(1000.0)).with("seed", Value::Number(seed));
        let shape = (row.build)(&params).expect("builds").place(&DAffine3::IDENTITY).expect("places").shape;
        shape.triangles().expect("a mesh").positions().to_vec()
    };
    for row in [DISPLACED_SPHERE, TERRAIN] {
        assert_eq!(positions(&row, 5.0), positions(&row, 5.0));
        assert_ne!(positions(&row, 5.0), positions(&row, 6.0));
    }
}

#[test]
fn a_knot_must_be_one() {
    let params = Params::new().with("turns", Value::Number(4.0)).with("coils", Value::Number(6.0));
    let error = (KNOT.build)(&params).err().expect("refused").to_string();
    assert!(error.contains("`coils`"), "{error}");
    // The rope keeps to its radius about the torus.
    let b = build(&KNOT, 20_000.0).bounds();
    assert!(b.max.x < 1.45 + 0.26 && b.max.x > 1.45 && b.center().length() < 0.2, "{b:?}");
    assert!((b.max - DVec3::new(b.max.x, 0.69, b.max.z)).length() < 0.05, "{b:?}");
}
