//! Rays against the unit sphere, in f64: spheres and ellipsoids are its images under an affine map.

use glam::DVec3;

/// Both ray parameters, in growing order, where `o + t d` lies on the unit sphere about the origin; `None` where
/// the line misses it, or where `d` is zero or anything is not finite. A tangent gives two equal roots.
///
/// Haines et al., "Precision Improvements for Ray/Sphere Intersection", Ray Tracing Gems (2019), ch. 7: the
/// discriminant is taken from the line's closest approach, not from b^2 - 4ac, and the root that would cancel is
/// had from the product of the roots. Going beyond it, the closest approach is |o x d| / |d|: with inputs of f32
/// precision each product in it is exact in f64, so that a far origin costs no digits.
///
/// `d` needs no normalisation: |d|, |o| and |o| |d| may be anything from 1e-150 to 1e150 (|o| also less).
#[inline]
pub fn unit_sphere_roots(o: DVec3, d: DVec3) -> Option<[f64; 2]> {
    let a = d.length_squared();
    let c = o.cross(d).length_squared();
    // (a - c) / a is 1 - |closest approach|^2, the squared half chord. NaN compares false and ends here too.
    if !(a >= c && a > 0.0) {
        return None;
    }
    let mid = -o.dot(d) / a;
    // The larger root in size is had without cancellation, the other from t0 t1 = (|o|^2 - 1) / |d|^2.
    let far = mid + ((a - c).sqrt() / a).copysign(mid);
    let near = if far == 0.0 { 0.0 } else { (o.length_squared() - 1.0) / (a * far) };
    let roots = if near <= far { [near, far] } else { [far, near] };
    (roots[0].is_finite() && roots[1].is_finite()).then_some(roots)
}

/// The first of the growing `roots` inside the open interval (`tnear`, `tfar`).
#[inline]
pub fn first_root_in(roots: [f64; 2], tnear: f64, tfar: f64) -> Option<f64> {
    roots.into_iter().find(|&t| t > tnear && t < tfar)
}

/// The point of the unit sphere nearest to `p` (any `p` but the origin): what is left of a hit point's error
/// after it lies along the surface, to 3 roundings of f64.
#[inline]
pub fn project_to_unit_sphere(p: DVec3) -> DVec3 {
    p / p.length()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Far origins with f32 inputs, as kernels have them: the residual of both hits stays at f64 rounding of t.
    #[test]
    fn far_origins_keep_their_digits() {
        for distance in [2.0f32, 1e2, 1e5, 1e7] {
            for i in 0..2000 {
                let u = i as f32 / 2000.0;
                // Aims across the whole disc and just past its rim.
                let target = DVec3::new(f64::from(1.02 * u), f64::from(0.1 * u), 0.0);
                let o = DVec3::new(f64::from(0.3f32), f64::from(-0.7f32), f64::from(distance));
                let d = (target - o).normalize().as_vec3().as_dvec3();
                // Reference for whether it hits: the cross product in exact integers scaled from f32 would be
                // overkill; products of f32 values are exact in f64 and their difference has one rounding.
                let miss = o.cross(d).length() / d.length();
                match unit_sphere_roots(o, d) {
                    Some(roots) => {
                        assert!(miss <= 1.0 + 1e-12);
                        for t in roots {
                            let p = o + d * t;
                            // The point itself is rounded at eps |o|; a few of those.
                            let tol = 4.0 * f64::EPSILON * f64::from(distance) + 1e-15;
                            assert!((p.length() - 1.0).abs() < tol, "{distance} {u}: {}", p.length() - 1.0);
                            assert!((project_to_unit_sphere(p).length() - 1.0).abs() < 1e-15);
                        }
                    }
                    None => assert!(miss >= 1.0 - 1e-12),
                }
            }
        }
    }

    #[test]
    fn scale_of_the_direction_does_not_matter() {
        let o = DVec3::new(0.2, 0.1, 3.0);
        let d = DVec3::new(0.05, -0.1, -1.0);
        let want = unit_sphere_roots(o, d).unwrap();
        for s in [1e-140, 1e-30, 1e30, 1e140] {
            let got = unit_sphere_roots(o, d * s).unwrap();
            for k in 0..2 {
                assert!((got[k] * s / want[k] - 1.0).abs() < 1e-13, "{s}: {got:?} {want:?}");
            }
        }
    }

    #[test]
    fn grazing_inside_surface_and_degenerate() {
        let tangent = unit_sphere_roots(DVec3::new(1.0, 0.0, -5.0), DVec3::Z).unwrap();
        assert_eq!(tangent, [5.0, 5.0]);
        let just_missed = DVec3::new(1.0 + 1e-15, 0.0, -5.0);
        assert_eq!(unit_sphere_roots(just_missed, DVec3::Z), None);
        let inside = unit_sphere_roots(DVec3::ZERO, DVec3::X * 2.0).unwrap();
        assert_eq!(inside, [-0.5, 0.5]);
        // On the surface, one root is zero to rounding and the other is the chord.
        let on = unit_sphere_roots(DVec3::Z, DVec3::new(0.6, 0.0, -0.8)).unwrap();
        assert!(on[0].abs() < 1e-16 && (on[1] - 1.6).abs() < 1e-15, "{on:?}");
        assert_eq!(first_root_in(on, 1e-9, f64::INFINITY), Some(on[1]));
        assert_eq!(first_root_in(on, 2.0, f64::INFINITY), None);
        for bad in [DVec3::ZERO, DVec3::NAN, DVec3::INFINITY] {
            assert_eq!(unit_sphere_roots(DVec3::ZERO, bad), None);
        }
        assert_eq!(unit_sphere_roots(DVec3::NAN, DVec3::X), None);
        assert_eq!(unit_sphere_roots(DVec3::INFINITY, DVec3::X), None);
    }
}
