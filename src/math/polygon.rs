//! Irradiance from flat polygons in closed form.

use glam::DVec3;

/// Irradiance at the origin of a surface with unit normal `n`, from a triangle that shines alike with a radiance of 1 in
/// all directions of both its sides, nothing in between: the part of it above the horizon, by Lambert's formula
/// 1/2 sum theta_i n.g_i over its edges, theta_i being the angle that edge i is seen under and g_i the unit normal of
/// the plane through it and the origin (Lambert, "Photometria", 1760; Arvo, "The Irradiance Jacobian for Partially
/// Occluded Polyhedral Sources", SIGGRAPH 1994, section 2). From 0 to pi.
pub fn triangle_irradiance(corners: [DVec3; 3], n: DVec3) -> f64 {
    // Scaled to its own size, so that no product over- or underflows.
    let size = corners.iter().fold(0.0f64, |a, c| a.max(c.abs().max_element()));
    if !(size > 0.0 && size.is_finite()) {
        return 0.0;
    }
    // A triangle cut by a plane has four corners at most.
    let mut visible = [DVec3::ZERO; 4];
    let mut count = 0;
    for i in 0..3 {
        let (a, b) = (corners[i] / size, corners[(i + 1) % 3] / size);
        let (ha, hb) = (a.dot(n), b.dot(n));
        if ha >= 0.0 {
            visible[count] = a;
            count += 1;
        }
        if (ha < 0.0 && hb > 0.0) || (ha > 0.0 && hb < 0.0) {
            visible[count] = a + (b - a) * (ha / (ha - hb));
            count += 1;
        }
    }
    let sum: f64 = (0..count).map(|i| edge(visible[i], visible[(i + 1) % count], n)).sum();
    (0.5 * sum).abs()
}

/// theta n.g of an edge; zero for one that is seen from its end, or as a point.
fn edge(a: DVec3, b: DVec3, n: DVec3) -> f64 {
    let cross = a.cross(b);
    let sine = cross.length();
    if sine == 0.0 { 0.0 } else { sine.atan2(a.dot(b)) * cross.dot(n) / sine }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// A square [-1, 1]^2 at height h, facing down onto the origin, as two triangles.
    fn square(h: f64) -> [[DVec3; 3]; 2] {
        let c = |x: f64, y: f64| DVec3::new(x, y, h);
        [[c(-1.0, -1.0), c(1.0, -1.0), c(1.0, 1.0)], [c(-1.0, -1.0), c(1.0, 1.0), c(-1.0, 1.0)]]
    }

    fn irradiance(parts: &[[DVec3; 3]], n: DVec3) -> f64 {
        parts.iter().map(|t| triangle_irradiance(*t, n)).sum()
    }

    #[test]
    fn a_square_overhead_is_the_textbook_form_factor() {
        for h in [0.01, 0.5, 1.0, 3.0, 1e4] {
            // Form factor of a square of side 2 from a point below its centre: four quarters of a b x b corner one,
            // F = 2 / pi * b / sqrt(b^2 + h^2) atan(b / sqrt(b^2 + h^2)) (Howell's catalogue, B-3, with a = b), times pi.
            let q = 1.0f64 / (1.0f64 + h * h).sqrt();
            let want = 4.0 * q * q.atan();
            let got = irradiance(&square(h), DVec3::Z);
            // Sums of angles near pi/2 whose rounding is 1e-16; far away they cancel down to 1 / h^2.
            assert!((got - want).abs() < 1e-14 + 1e-9 * want, "{h}: {got} {want}");
        }
    }

    #[test]
    fn an_infinite_ceiling_is_pi_and_half_of_it_from_a_wall() {
        let far: Vec<[DVec3; 3]> =
            square(1e-6).into_iter().map(|t| t.map(|c| DVec3::new(c.x * 1e3, c.y * 1e3, 1.0))).collect();
        // What lies beyond 1,000 heights is a millionth of it.
        assert!((irradiance(&far, DVec3::Z) - PI).abs() < 1e-5);
        // Cut by the horizon of a wall: the half of the ceiling in front of it.
        assert!((irradiance(&far, DVec3::X) - PI / 2.0).abs() < 2e-3);
    }

    #[test]
    fn it_is_the_integral_also_where_the_horizon_cuts() {
        let triangle = [DVec3::new(-1.0, 0.3, -0.7), DVec3::new(0.8, 0.1, 0.9), DVec3::new(0.2, 1.5, 0.6)];
        let ng = (triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]);
        let n = DVec3::new(0.2, 0.3, 1.0).normalize();
        let (mut sum, steps) = (0.0, 1500);
        for i in 0..steps {
            for j in 0..steps - i {
                // Both triangles of a cell of the barycentric grid.
                for (s, last) in [(1.0 / 3.0, false), (2.0 / 3.0, true)] {
                    if last && j == steps - i - 1 {
                        continue;
                    }
                    let (u, v) = ((i as f64 + s) / steps as f64, (j as f64 + s) / steps as f64);
                    let p = triangle[0] * (1.0 - u - v) + triangle[1] * u + triangle[2] * v;
                    let r2 = p.length_squared();
                    sum += n.dot(p).max(0.0) * ng.normalize().dot(p).abs() / (r2 * r2);
                }
            }
        }
        let want = sum * 0.5 * ng.length() / (steps * steps) as f64;
        let got = triangle_irradiance(triangle, n);
        // The midpoint rule over a kink at the horizon: of the order of a cell.
        assert!((got - want).abs() < 1e-5, "{got} {want}");
    }

    #[test]
    fn degenerate_triangles_and_points_on_them_are_finite() {
        let z = DVec3::ZERO;
        for t in [[z; 3], [DVec3::X, DVec3::X, DVec3::X], [z, DVec3::X, DVec3::Y], [DVec3::splat(1e300); 3]] {
            let e = triangle_irradiance(t, DVec3::Z);
            assert!((0.0..=PI + 1e-9).contains(&e), "{t:?}: {e}");
        }
    }
}
