use super::*;
use crate::testing::{Bins, ChiSquare, chi_square_sphere};

/// Midpoints of an n x n grid, and points at and next to corners and borders.
fn squares(n: u32) -> Vec<Vec2> {
    let mut all = Vec::new();
    for i in 0..n * n {
        all.push((Vec2::new((i % n) as f32, (i / n) as f32) + Vec2::splat(0.5)) / n as f32);
    }
    let ends = [0.0, 1e-30, 1e-7, 0.5, 1.0 - 6e-8];
    ends.iter().for_each(|&x| ends.iter().for_each(|&y| all.push(Vec2::new(x, y))));
    all
}

/// Every warp onto directions: name, sample, invert, density.
type Directional = (&'static str, fn(Vec2) -> Vec3, fn(Vec3) -> Vec2, fn(Vec3) -> f32);

const DIRECTIONAL: [Directional; 6] = [
    ("cosine", cosine_hemisphere, cosine_hemisphere_invert, |w| cosine_hemisphere_pdf(w.z)),
    ("hemisphere", uniform_hemisphere, uniform_hemisphere_invert, |_| UNIFORM_HEMISPHERE_PDF),
    ("sphere", uniform_sphere, uniform_sphere_invert, |_| UNIFORM_SPHERE_PDF),
    ("cone 1.7", |u| uniform_cone(u, 1.7), |w| uniform_cone_invert(w, 1.7), |_| uniform_cone_pdf(1.7)),
    ("cone 0.01", |u| uniform_cone(u, 0.01), |w| uniform_cone_invert(w, 0.01), |_| uniform_cone_pdf(0.01)),
    (
        "cone 1e-14",
        |u| uniform_cone(u, 1e-14),
        |w| uniform_cone_invert(w, 1e-14),
        |_| uniform_cone_pdf(1e-14),
    ),
];

#[test]
fn directions_are_unit_and_inverses_invert() {
    for (name, sample, invert, _) in DIRECTIONAL {
        for u in squares(40) {
            let w = sample(u);
            // A few f32 roundings.
            assert!((w.length() - 1.0).abs() < 4e-7, "{name} {u} {w}");
            let back = invert(w);
            // Where the map is singular (poles, rim) many u share a direction: compare directions there.
            let off = (back - u).length().min((sample(back) - w).length());
            assert!(off < 3e-6, "{name} {u} {back}");
        }
    }
}

#[test]
fn samples_follow_their_densities() {
    for (name, sample, _, pdf) in DIRECTIONAL {
        // Below 1e-12 a direction's x and y still have their digits, but its z has not: the narrowest cone is left out.
        let cap = if name == "cone 0.01" { 0.01 } else { 2.0 };
        if name == "cone 1e-14" {
            continue;
        }
        let border = if name.starts_with("cone") { name[5..].parse().unwrap() } else { 2.0 };
        let inside = |w: Vec3| one_minus_cos(w) <= border && (name != "hemisphere" || w.z > 0.0);
        let how = ChiSquare {
            bins: Bins { cap, rows: 10, columns: 20, ..Bins::default() },
            tests: 5,
            ..ChiSquare::default()
        };
        chi_square_sphere(
            name,
            &how,
            |rng| Some(sample(rng.vec2())),
            |w| if inside(w) { pdf(w) } else { 0.0 },
        );
    }
}

/// The density equals one over the map's Jacobian, the area on the sphere of the image of a small square, by central
/// differences.
#[test]
fn density_is_the_inverse_of_the_jacobian() {
    for (name, sample, _, pdf) in DIRECTIONAL {
        for u in squares(23).into_iter().take(23 * 23) {
            let h = 1e-2;
            let du = (sample(u + Vec2::new(h, 0.0)) - sample(u - Vec2::new(h, 0.0))).as_dvec3()
                / (2.0 * f64::from(h));
            let dv = (sample(u + Vec2::new(0.0, h)) - sample(u - Vec2::new(0.0, h))).as_dvec3()
                / (2.0 * f64::from(h));
            let area = du.cross(dv).length();
            let p = f64::from(pdf(sample(u)));
            // Interior points away from the diagonals of the concentric map, where derivatives jump.
            let q = 2.0 * u - Vec2::ONE;
            let kink = (q.x.abs() - q.y.abs()).abs() < 0.06 || q.abs().max_element() > 0.8;
            // Differences of second order: (h / distance to the singular point)^2.
            assert!(kink || (area * p - 1.0).abs() < 0.01, "{name} {u}: {}", area * p);
        }
    }
}

#[test]
fn tiny_cones_keep_their_radius() {
    for m in [1e-4f32, 1e-10, 1e-20, 1e-30] {
        for u in squares(16) {
            let w = uniform_cone(u, m);
            // sin of the border angle is sqrt(2 m) to first order; no sample may lie outside, most must not be on z.
            let r = w.truncate().length() / (2.0 * m).sqrt();
            assert!((r - disk(u).length()).abs() < 1e-6 + m, "{m} {u} {r}");
        }
    }
    // A unit sphere from 1e5 away.
    let m = one_minus_cos_from_sin2(1e-10);
    assert!((m / 0.5e-10 - 1.0).abs() < 1e-6);
    assert!((cone_solid_angle(m) * uniform_cone_pdf(m) - 1.0).abs() < 1e-6);
}

#[test]
fn flat_targets_are_area_preserving_and_invert() {
    for u in squares(50) {
        let (d, b) = (disk(u), triangle(u));
        assert!(d.length() <= 1.0 + 1e-6);
        assert!(b.min_element() >= 0.0 && b.x + b.y <= 1.0 + 1e-6, "{u} {b}");
        assert!((disk_invert(d) - u).length() < 1e-6, "{u} {}", disk_invert(d));
        assert!((triangle_invert(b) - u).length() < 1e-6);
        assert!((tent_invert(tent(u.x)) - u.x).abs() < 1e-6);
    }
    // Moments of the uniform disc and triangle and of the tent: E r^2 = 1/2, E b = 1/3, E b^2 = 1/6, E x^2 = 1/6.
    let grid: Vec<Vec2> = squares(256).into_iter().take(256 * 256).collect();
    let mean =
        |f: &dyn Fn(Vec2) -> f32| grid.iter().map(|&u| f64::from(f(u))).sum::<f64>() / grid.len() as f64;
    // The midpoint rule on 256 cells a side errs by about 256^-2 on smooth maps, 256^-1.5 = 2.4e-4 at the square
    // roots of the tent.
    let close = |got: f64, want: f64| assert!((got - want).abs() < 1e-4, "{got} {want}");
    close(mean(&|u| disk(u).length_squared()), 0.5);
    close(mean(&|u| disk(u).x * disk(u).x), 0.25);
    close(mean(&|u| triangle(u).x), 1.0 / 3.0);
    close(mean(&|u| triangle(u).y.powi(2)), 1.0 / 6.0);
    close(mean(&|u| (1.0 - triangle(u).element_sum()).powi(2)), 1.0 / 6.0);
    close(mean(&|u| tent(u.x).powi(2)), 1.0 / 6.0);
}
