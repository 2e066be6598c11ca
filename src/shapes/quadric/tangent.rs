//! The directions that an ellipsoid fills as seen from outside: a cone with an elliptic outline, sampled nearly evenly.
//!
//! With A the map to the unit sphere and o the viewer there, a direction d meets the ellipsoid where
//! d . Q d >= 0, Q = v v^T - (o.o - 1) A^T A, v = A^T o. Q has one positive eigenvalue, along the middle of the cone,
//! and the tangents of its half angles are the roots of its ratios to the other two.
//!
//! Even sampling takes an elliptic integral of the third kind and a search (Guillen et al., "Area-preserving
//! parameterizations for spherical ellipses", Computer Graphics Forum 36(4), 2017). Here the angle about the middle is
//! drawn as area lies about the centre of an ellipse, whose semi-axes 2 sin(half angle / 2) are what the half angles are
//! in Lambert's equal-area projection; the angle from the middle then evenly up to the exact rim. The density follows
//! from both in closed form. It is even for round cones and small ones, and nowhere off by more than [`UNEVEN`].

use glam::{DMat3, DVec3, Vec2};
use std::f64::consts::TAU;

use crate::sampling::warp;

/// Most that the density is above or below its mean, as a factor (found by search over all half angles; the test looks
/// again).
#[cfg(test)]
const UNEVEN: f64 = 1.2;

/// An elliptic cone.
#[derive(Debug, Clone, Copy)]
pub struct TangentCone {
    /// Unit vectors: along the two half angles, and to the middle.
    axes: [DVec3; 3],
    /// Squared cotangents of the half angles.
    cot2: [f64; 2],
    /// 2 sin(half angle / 2).
    r: [f64; 2],
}

/// 1 - cos of the angle with this squared cotangent, without loss of digits for small angles.
#[inline]
fn one_minus_cos(cot2: f64) -> f64 {
    // 1 - cos = sin^2 / (1 + cos).
    1.0 / (1.0 + cot2 + (cot2 * (1.0 + cot2)).sqrt())
}

/// A viewer nearer than this, in radii of the unit sphere and squared, or eigenvalues further apart, leave too few
/// digits of f64: there is no cone then.
const LEAST: f64 = 1e-11;

impl TangentCone {
    /// Of the image of the unit sphere, `a` being the linear map back to it, and `o` the viewer in its space. None from
    /// inside, and where rounding hides the cone.
    pub fn new(a: &DMat3, o: DVec3) -> Option<TangentCone> {
        let s = o.length_squared() - 1.0;
        if s.is_nan() || s <= LEAST {
            return None;
        }
        let at = a.transpose();
        let v = at * o;
        let outer = DMat3::from_cols(v * v.x, v * v.y, v * v.z);
        let (values, vectors) = eigen(outer - at * *a * s);
        let middle = (0..3).max_by(|&i, &j| values[i].total_cmp(&values[j]))?;
        let [i, j] = [(middle + 1) % 3, (middle + 2) % 3];
        let (li, lj) = (-values[i], -values[j]);
        let largest = values[middle].max(li).max(lj);
        if !(li > LEAST * largest && lj > LEAST * largest && largest < f64::INFINITY) {
            return None;
        }
        // From the determinant, det(A)^2 s^2, as the eigenvalue itself cancels for small cones.
        let det = a.determinant() * s;
        let top = (det / li) * (det / lj);
        let cot2 = [li / top, lj / top];
        // The middle is off by the rounding of Q over the gap between eigenvalues: at most 1e-5 of a half angle.
        if cot2.iter().zip([li, lj]).any(|(c, l)| 4.0 * f64::EPSILON * largest / l > 1e-5 / (1.0 + c).sqrt())
        {
            return None;
        }
        let axis = vectors.col(middle);
        // Away from the viewer: to the sphere's middle.
        let axis = if axis.dot(v) < 0.0 { axis } else { -axis };
        let usable = cot2.iter().all(|c| *c > 0.0 && *c < 1e30) && axis.is_finite();
        usable.then(|| TangentCone {
            axes: [vectors.col(i), vectors.col(j), axis],
            cot2,
            r: cot2.map(|c| (2.0 * one_minus_cos(c)).sqrt()),
        })
    }

    /// 1 - cos of the rim, and the density per solid angle, at this angle about the middle.
    #[inline]
    fn at(&self, cos: f64, sin: f64) -> (f64, f64) {
        let (c2, s2) = (cos * cos, sin * sin);
        let rim = one_minus_cos(self.cot2[0] * c2 + self.cot2[1] * s2);
        let [a, b] = self.r;
        (rim, a * b / (TAU * (b * b * c2 + a * a * s2) * rim))
    }

    /// A unit direction in the cone and its density per solid angle.
    pub fn sample(&self, u: Vec2) -> (DVec3, f64) {
        let d = warp::disk(u).as_dvec2();
        let h = d.length_squared().min(1.0);
        let about = (d * glam::DVec2::from(self.r)).try_normalize().unwrap_or(glam::DVec2::X);
        let (rim, pdf) = self.at(about.x, about.y);
        let m = h * rim;
        let sin = (m * (2.0 - m)).sqrt();
        let [x, y, z] = self.axes;
        ((x * about.x + y * about.y) * sin + z * (1.0 - m), pdf)
    }

    /// The density per solid angle with which [`TangentCone::sample`] takes a direction inside.
    pub fn pdf(&self, w: DVec3) -> f64 {
        let about = glam::DVec2::new(w.dot(self.axes[0]), w.dot(self.axes[1]));
        let about = about.try_normalize().unwrap_or(glam::DVec2::X);
        self.at(about.x, about.y).1
    }
}

/// Eigenvalues and eigenvectors (columns) of a symmetric matrix by Jacobi's rotations (Golub and Van Loan, "Matrix
/// Computations", 4th ed., 8.5).
pub fn eigen(a: DMat3) -> ([f64; 3], DMat3) {
    let mut m = a.to_cols_array_2d();
    let mut v = DVec3::AXES;
    // Converges quadratically: a handful of sweeps suffices for any input.
    for _ in 0..10 {
        let mut rotated = false;
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = m[p][q];
            // Below this neither diagonal element changes.
            if off.is_nan() || off.abs() <= 1e-18 * (m[p][p].abs() + m[q][q].abs()) {
                continue;
            }
            rotated = true;
            let theta = (m[q][q] - m[p][p]) / (2.0 * off);
            let t = 1f64.copysign(theta) / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            let r = 3 - p - q;
            m[p][p] -= t * off;
            m[q][q] += t * off;
            let (rp, rq) = (m[r][p], m[r][q]);
            m[p][q] = 0.0;
            m[q][p] = 0.0;
            (m[r][p], m[r][q]) = (c * rp - s * rq, s * rp + c * rq);
            (m[p][r], m[q][r]) = (m[r][p], m[r][q]);
            (v[p], v[q]) = (v[p] * c - v[q] * s, v[p] * s + v[q] * c);
        }
        if !rotated {
            break;
        }
    }
    ([m[0][0], m[1][1], m[2][2]], DMat3::from_cols(v[0], v[1], v[2]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{TestRng, integrate_rect};

    /// An ellipsoid with these semi-axes, turned, and a viewer at `o` in the unit sphere's space.
    fn seen(axes: DVec3, o: DVec3) -> (DMat3, Option<TangentCone>) {
        let turn = DMat3::from_quat(glam::DQuat::from_scaled_axis(DVec3::new(0.3, -1.0, 0.7)));
        let a = (turn * DMat3::from_diagonal(axes)).inverse();
        (a, TangentCone::new(&a, o))
    }

    /// Round, flat, long, and all of it at aspect 1000; viewers far away, near, and a hair above the surface.
    fn all() -> Vec<(DVec3, DVec3)> {
        let shapes =
            [[1.0, 1.0, 1.0], [3.0, 2.0, 1.0], [1.0, 1.0, 1e-3], [1e-3, 1e-3, 1.0], [1.0, 0.03, 1e-3]];
        let directions = [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.5, -0.7, 0.4], [1e-3, 1.0, 0.02]];
        let mut all = Vec::new();
        for s in shapes {
            for d in directions {
                for r in [1e6, 30.0, 2.0, 1.1, 1.0 + 1e-3, 1.0 + 1e-7] {
                    all.push((DVec3::from(s), DVec3::from(d).normalize() * r));
                }
            }
        }
        all
    }

    /// As [`seen`], of what must have a cone: all but viewers in the last digits above a flat side, or far away.
    fn must_be_seen(axes: DVec3, o: DVec3) -> Option<(DMat3, TangentCone)> {
        let (a, cone) = seen(axes, o);
        let aspect = axes.max_element() / axes.min_element();
        let room = (o.length_squared() - 1.0) / (aspect * aspect);
        let far = aspect > 10.0 && o.length() > 1e5;
        assert!(cone.is_some() || room < 2.0 * LEAST || far, "{axes} from {o}");
        cone.map(|c| (a, c))
    }

    /// How far inside the unit sphere the line of sight comes: 1 - (distance from the centre)^2.
    fn depth(a: &DMat3, o: DVec3, d: DVec3) -> f64 {
        let d = (*a * d).normalize();
        assert!(o.dot(d) < 0.0, "looks away");
        1.0 - o.cross(d).length_squared()
    }

    #[test]
    fn eigenvectors_are_what_they_claim() {
        let mut rng = TestRng::new(1);
        for scale in [1.0, 1e-3, 1e-9] {
            for _ in 0..200 {
                let (x, y, z) = (rng.cube(), rng.cube() * scale, rng.cube());
                let m = DMat3::from_cols(x, y, z);
                let a = m.transpose() * m;
                let (values, v) = eigen(a);
                let size = a.to_cols_array().into_iter().fold(0f64, |m, x| m.max(x.abs()));
                for (i, value) in values.into_iter().enumerate() {
                    // Roundings of some thirty products.
                    assert!((a * v.col(i) - v.col(i) * value).length() < 1e-14 * size);
                }
                assert!((v.determinant().abs() - 1.0).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn samples_fill_the_outline_and_nothing_else() {
        let mut rng = TestRng::new(2);
        for (axes, o) in all() {
            let Some((a, cone)) = must_be_seen(axes, o) else { continue };
            for _ in 0..200 {
                let (d, pdf) = cone.sample(rng.vec2());
                assert!((d.length() - 1.0).abs() < 1e-14);
                // Off the rim by 1e-5 of the half angle at most, of which a depth takes twice.
                assert!(depth(&a, o, d) > -3e-5, "{axes} from {o}: {d} passes by");
                assert!((cone.pdf(d) / pdf - 1.0).abs() < 1e-6, "{axes} from {o}");
            }
            for k in 0..16 {
                let (sin, cos) = (TAU * f64::from(k) / 16.0).sin_cos();
                let (rim, _) = cone.at(cos, sin);
                let sine = (rim * (2.0 - rim)).sqrt();
                let d = (cone.axes[0] * cos + cone.axes[1] * sin) * sine + cone.axes[2] * (1.0 - rim);
                assert!(depth(&a, o, d).abs() < 3e-5, "{axes} from {o}: the rim {}", depth(&a, o, d));
            }
        }
    }

    #[test]
    fn densities_integrate_to_one_and_are_nearly_even() {
        for (axes, o) in all() {
            let Some((_, cone)) = must_be_seen(axes, o) else { continue };
            // Over the unit disc by which directions are drawn; about the middle exactly as the rim says.
            let [a, b] = cone.r;
            // About the middle by the angle of that disc, so that needles are resolved.
            let jacobian = |psi: f64| {
                let (s, c) = psi.sin_cos();
                let about = glam::DVec2::new(a * c, b * s);
                (about.normalize(), a * b / about.length_squared())
            };
            let strip = |psi: f64| {
                let (w, j) = jacobian(psi);
                let (rim, pdf) = cone.at(w.x, w.y);
                (rim, pdf, j)
            };
            let of = |f: &dyn Fn(f64, f64, f64) -> f64| {
                integrate_rect(
                    |_, psi| {
                        let (r, p, j) = strip(psi);
                        f(r, p, j)
                    },
                    [0.0, 1.0],
                    [0.0, TAU],
                    1e-9,
                )
            };
            let total = of(&|rim, pdf, j| rim * pdf * j);
            assert!((total - 1.0).abs() < 1e-6, "{axes} from {o}: {total}");
            let solid_angle = of(&|rim, _, j| rim * j);
            for k in 0..1000 {
                let even = strip(TAU * f64::from(k) / 1000.0).1 * solid_angle;
                assert!(even < UNEVEN && even > 1.0 / UNEVEN, "{axes} from {o}: {even}");
            }
        }
    }

    #[test]
    fn from_inside_there_is_no_cone() {
        for o in [DVec3::ZERO, DVec3::X, DVec3::splat(0.3), DVec3::splat(f64::NAN)] {
            assert!(seen(DVec3::new(3.0, 2.0, 1.0), o).1.is_none());
        }
    }
}
