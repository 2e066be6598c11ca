use super::*;
use crate::testing::{Bins, ChiSquare, TestRng, chi_square_sphere};

/// Whether the ray from `p` along `w` meets the triangle (signs of the three volumes).
fn in_triangle(p: Vec3, v: [Vec3; 3], w: Vec3) -> bool {
    let [a, b, c] = v.map(|v| (v - p).as_dvec3());
    let w = w.as_dvec3();
    let s = [a.cross(b).dot(w), b.cross(c).dot(w), c.cross(a).dot(w)];
    let o = a.cross(b).dot(c).signum();
    s.iter().all(|x| x * o > 0.0)
}

fn triangles() -> Vec<(Vec3, [Vec3; 3])> {
    let v = |x, y, z| Vec3::new(x, y, z);
    vec![
        // An octant: pi / 2.
        (Vec3::ZERO, [Vec3::X, Vec3::Y * 3.0, Vec3::Z * 0.5]),
        // Nearly a half-space.
        (v(0.1, 0.2, 0.01), [v(-5.0, -4.0, 0.0), v(6.0, -4.0, 0.0), v(0.0, 7.0, 0.0)]),
        // The same from below, a sliver, and one of 1e-4 steradians far from the origin.
        (v(0.1, 0.2, -0.8), [v(-5.0, -4.0, 0.0), v(6.0, -4.0, 0.0), v(0.0, 7.0, 0.0)]),
        (Vec3::ZERO, [v(-2.0, 0.0, 1.0), v(2.0, 0.05, 1.0), v(1.0, 0.06, 1.0)]),
        (v(100.0, 0.0, 0.0), [v(100.0, 50.0, 0.0), v(100.0, 50.0, 0.7), v(100.7, 50.0, 0.0)]),
    ]
}

#[test]
fn triangles_are_sampled_uniformly_and_invert() {
    let mut rng = TestRng::new(3);
    for (i, (p, v)) in triangles().into_iter().enumerate() {
        let t = SphericalTriangle::new(p, v).unwrap();
        for _ in 0..2000 {
            let u = rng.vec2();
            let w = t.sample(u);
            // Directions next to an edge may be carried over it by rounding to f32: pull towards the middle.
            let middle = v.iter().map(|&v| (v - p).normalize()).sum::<Vec3>() / 3.0;
            assert!(in_triangle(p, v, w + (middle - w) * 2e-4), "{i} {u} {w}");
            // One f32 rounding of w, seen from a triangle of angle sqrt(area), magnified where u spreads it: near
            // corner b and for slivers.
            let tolerance = 1e-6 / (t.solid_angle() * u.y.max(1e-3));
            assert!((t.invert(w) - u).length() < tolerance, "{i} {u} {}", t.invert(w));
        }
        let axis = t.sample(Vec2::new(0.5, 0.7));
        let cap = f64::from(t.solid_angle() / std::f32::consts::TAU).min(2.0);
        let how =
            ChiSquare { bins: Bins { axis, cap, rows: 12, columns: 24 }, tests: 5, ..ChiSquare::default() };
        let pdf = |w: Vec3| if in_triangle(p, v, w) { t.pdf() } else { 0.0 };
        chi_square_sphere(&format!("triangle {i}"), &how, |rng| Some(t.sample(rng.vec2())), pdf);
    }
    let (p, v) = triangles()[0];
    assert!((SphericalTriangle::new(p, v).unwrap().solid_angle() - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
}

fn rectangles() -> Vec<(Vec3, Rectangle)> {
    let rectangle = |corner: Vec3, ex: Vec3, ey: Vec3| {
        Rectangle::new(corner.as_dvec3(), [ex, ey].map(|e| e.as_dvec3())).expect("it spans something")
    };
    let (x, y, z) = (Vec3::X, Vec3::Y, Vec3::Z);
    vec![
        // A face of the cube about the point: 2 pi / 3.
        (Vec3::ZERO, rectangle(Vec3::new(-1.0, -1.0, 1.0), x * 2.0, y * 2.0)),
        // Off to the side, close to its plane, and on the other side of it.
        (Vec3::new(3.0, -2.0, 0.05), rectangle(Vec3::ZERO, x, z * 2.0)),
        (Vec3::new(0.3, 0.4, -0.02), rectangle(Vec3::ZERO, x, y)),
        // Small, and turned.
        (
            Vec3::new(0.0, 0.0, 9.0),
            rectangle(Vec3::ONE, Vec3::new(0.06, 0.08, 0.0), Vec3::new(-0.08, 0.06, 0.0)),
        ),
    ]
}

#[test]
fn rectangles_are_sampled_uniformly_and_invert() {
    let mut rng = TestRng::new(4);
    for (i, (p, r)) in rectangles().into_iter().enumerate() {
        let s = SphericalRectangle::new(p.as_dvec3(), &r).unwrap();
        let [x, y] = r.edges();
        let corners = [DVec3::ZERO, x, x + y, y].map(|e| (r.corner() + e).as_vec3());
        let halves = [[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]];
        let area: f32 = halves.iter().map(|&v| SphericalTriangle::new(p, v).unwrap().solid_angle()).sum();
        assert!((s.solid_angle() / area - 1.0).abs() < 1e-5, "{i}: {} {area}", s.solid_angle());
        for _ in 0..2000 {
            let u = rng.vec2();
            let back = s.invert(s.sample(u));
            // One f32 rounding of the direction, magnified by one over the rectangle's angular sides.
            assert!((back - u).length() < 2e-6 / s.solid_angle(), "{i} {u} {back}");
        }
        let axis = s.sample(Vec2::splat(0.5));
        let cap = f64::from(s.solid_angle() / std::f32::consts::TAU).min(2.0);
        let how =
            ChiSquare { bins: Bins { axis, cap, rows: 12, columns: 24 }, tests: 4, ..ChiSquare::default() };
        // The diagonal is of measure zero, but for tests of w on it: count it to one half.
        let inside = |w: Vec3| {
            in_triangle(p, halves[0], w) || !in_triangle(p, halves[0], w) && in_triangle(p, halves[1], w)
        };
        let pdf = |w: Vec3| if inside(w) { s.pdf() } else { 0.0 };
        chi_square_sphere(&format!("rectangle {i}"), &how, |rng| Some(s.sample(rng.vec2())), pdf);
    }
    let (p, r) = rectangles()[0];
    let face = SphericalRectangle::new(p.as_dvec3(), &r).unwrap().solid_angle();
    assert!((face - std::f32::consts::TAU / 3.0).abs() < 1e-6);
}

#[test]
fn tiny_and_broken_targets_are_refused() {
    let v = [Vec3::new(1e5, 0.0, 0.0), Vec3::new(1e5, 1.0, 0.0), Vec3::new(1e5, 0.0, 1.0)];
    assert!(SphericalTriangle::new(Vec3::ZERO, v).is_none());
    assert!(SphericalTriangle::new(v[0], v).is_none());
    assert!(SphericalTriangle::new(Vec3::NAN, v).is_none());
    assert!(SphericalTriangle::new(Vec3::ZERO, [Vec3::X; 3]).is_none());
    let r = Rectangle::new(DVec3::ZERO, [DVec3::X, DVec3::Y]).unwrap();
    assert!(SphericalRectangle::new(DVec3::new(0.5, 0.5, 0.0), &r).is_none());
    assert!(SphericalRectangle::new(DVec3::new(0.0, 0.0, 1e6), &r).is_none());
    assert!(SphericalRectangle::new(DVec3::INFINITY, &r).is_none());
    assert!(Rectangle::new(DVec3::ZERO, [DVec3::ZERO, DVec3::Y]).is_none());
    // Every corner of the square gives a unit vector.
    for (p, v) in triangles() {
        let t = SphericalTriangle::new(p, v).unwrap();
        for u in [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0], [1.0, 0.0], [0.5, 0.0], [1e-30, 1e-30]] {
            let w = t.sample(Vec2::from_array(u));
            assert!((w.length() - 1.0).abs() < 1e-6, "{u:?} {w}");
            assert!(t.invert(w).is_finite());
        }
    }
    for (p, r) in rectangles() {
        let s = SphericalRectangle::new(p.as_dvec3(), &r).unwrap();
        for u in [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0], [1.0, 0.0], [0.5, 0.0], [1e-30, 1e-30]] {
            assert!((s.sample(Vec2::from_array(u)).length() - 1.0).abs() < 1e-6);
        }
    }
}
