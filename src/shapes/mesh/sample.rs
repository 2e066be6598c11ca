//! Points on a triangle as seen from elsewhere.

use super::refine::Triangle;
use crate::base::shape::{LocalRay, ShapeSample};
use crate::sampling::spherical::SphericalTriangle;
use crate::sampling::warp;
use glam::{DVec3, Vec2, Vec3};

/// A sampled point and where it lies in the triangle.
pub struct TriangleSample {
    /// The sample, without texture coordinates.
    pub sample: ShapeSample,
    /// Weights of the second and third corner.
    pub b: [f64; 2],
}

/// Below this ratio of twice the area to the squared distance of a corner a triangle is sampled by area, as it is where
/// the formulas of the spherical triangle end: seen from so far it is as good as flat, and most triangles of
/// a mesh are spared the trigonometry.
const FLAT: f64 = 1e-4;

/// The triangle as seen from a point; None where it is to be sampled by area.
#[inline]
fn seen(corners: [Vec3; 3], triangle: &Triangle, from: Vec3) -> Option<SphericalTriangle> {
    let distance2 = (triangle.v0 - from.as_dvec3()).length_squared();
    // Squares of both: no root. The longest edge is bounded too, or a needle might reach close to the viewer.
    let edges2 = triangle.e1.length_squared().max(triangle.e2.length_squared());
    if triangle.n.length_squared() < FLAT * FLAT * distance2 * distance2 && edges2 < 0.01 * distance2 {
        return None;
    }
    SphericalTriangle::new(from, corners)
}

/// Uniform over the solid angle, or, where that is small, over the area. None where the triangle is seen edge on.
pub fn sample(corners: [Vec3; 3], from: Vec3, u: [f32; 2]) -> Option<TriangleSample> {
    let triangle = Triangle::new(corners);
    sample_as(seen(corners, &triangle, from), &triangle, from, u)
}

/// By solid angle if `seen` says how, else by area.
#[inline]
fn sample_as(
    seen: Option<SphericalTriangle>,
    triangle: &Triangle,
    from: Vec3,
    u: [f32; 2],
) -> Option<TriangleSample> {
    let (n, o) = (triangle.n, from.as_dvec3());
    let (b, pdf) = match seen {
        Some(seen) => {
            let d = seen.sample(Vec2::from_array(u)).as_dvec3();
            let at = triangle.locate(&LocalRay { o, d, tnear: 0.0, tfar: f64::INFINITY });
            ([at.b1, at.b2], Some(seen.pdf()))
        }
        None => (warp::triangle(Vec2::from_array(u)).as_dvec2().to_array(), None),
    };
    let p = triangle.at(b[0], b[1]);
    let (wi, dist) = (p - o).normalize_and_length();
    let pdf = pdf.unwrap_or_else(|| area_pdf(n, p - o));
    (pdf > 0.0 && pdf.is_finite() && dist > 0.0).then(|| TriangleSample {
        sample: ShapeSample {
            p: p.as_vec3(),
            ng: n.normalize().as_vec3(),
            uv: Vec2::ZERO,
            wi: wi.as_vec3(),
            dist: dist as f32,
            pdf,
        },
        b,
    })
}

/// The density per solid angle with which [`sample`] takes the direction from `from` to `p` on the triangle.
pub fn pdf(corners: [Vec3; 3], from: Vec3, p: Vec3) -> f32 {
    let triangle = Triangle::new(corners);
    let pdf = match seen(corners, &triangle, from) {
        Some(seen) => seen.pdf(),
        None => area_pdf(triangle.n, p.as_dvec3() - from.as_dvec3()),
    };
    if pdf.is_finite() { pdf } else { 0.0 }
}

/// dist^2 / (cos area), with n = 2 area times the unit normal and d = dist times the unit direction.
fn area_pdf(n: DVec3, d: DVec3) -> f32 {
    (2.0 * d.length_squared() * d.length() / n.dot(d).abs()) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestRng;
    use std::hint::black_box;
    use std::time::Instant;

    /// The lamp of the Cornell box (half of its square) from points below it, both ways: what one sample of irradiance
    /// varies by, and what it costs. Prints; only the noise is a matter of passing.
    #[test]
    fn solid_angle_is_never_noisier_than_area() {
        let corners = [[343.0, 548.8, 227.0], [213.0, 548.8, 227.0], [213.0, 548.8, 332.0]].map(Vec3::from);
        for (name, from) in [
            ("floor", Vec3::new(278.0, 0.0, 279.0)),
            ("tall box", Vec3::new(368.0, 330.0, 351.0)),
            ("ceiling's height", Vec3::new(100.0, 540.0, 300.0)),
            ("20 below", Vec3::new(260.0, 528.8, 260.0)),
            ("2 below", Vec3::new(260.0, 546.8, 260.0)),
        ] {
            let triangle = Triangle::new(corners);
            let by_angle = seen(corners, &triangle, from);
            let mut relative = [0f64; 2];
            for (k, way) in [by_angle, None].into_iter().enumerate() {
                let mut rng = TestRng::new(1);
                let (mut sum, mut squares, n) = (0.0, 0.0, 20_000);
                for _ in 0..n {
                    let Some(s) = sample_as(way, &triangle, from, rng.vec2().to_array()) else { continue };
                    let e = f64::from(s.sample.wi.y.max(0.0) / s.sample.pdf);
                    (sum, squares) = (sum + e, squares + e * e);
                }
                let (mean, count) = (sum / f64::from(n), f64::from(n));
                relative[k] = squares / count / (mean * mean) - 1.0;
            }
            let time = |way: &mut dyn FnMut([f32; 2]) -> Option<TriangleSample>| {
                let (mut rng, start) = (TestRng::new(1), Instant::now());
                for _ in 0..100_000 {
                    black_box(way(rng.vec2().to_array()));
                }
                start.elapsed().as_nanos() as f64 / 1e5
            };
            let angle_ns = time(&mut |u| sample(black_box(corners), from, u));
            let area_ns = time(&mut |u| sample_as(None, &Triangle::new(black_box(corners)), from, u));
            println!(
                "{name}: relative variance {:.4} by solid angle, {:.4} by area; {angle_ns:.0} and {area_ns:.0} ns",
                relative[0], relative[1]
            );
            // Sampling error of a variance, and of cosines that vary where solid angles do not.
            assert!(relative[0] < 1.1 * relative[1] + 0.02, "{name}: {relative:?}");
        }
    }
}
