//! Surface area of an ellipsoid.

use super::tangent::eigen;
use glam::DMat3;
use std::f64::consts::PI;

/// The area of the image of the unit sphere under a map with this cofactor matrix (det M times M^-T), whose singular
/// values are ab, bc and ca for semi-axes a, b, c: 4 pi R_G(a^2 b^2, b^2 c^2, c^2 a^2) (Carlson, "Numerical
/// computation of real or complex elliptic integrals", 1995; DLMF 19.33.1). Good to about 1e-14.
pub fn ellipsoid(cofactor: &DMat3) -> f64 {
    let (mut e, _) = eigen(cofactor.transpose() * *cofactor);
    e.sort_by(f64::total_cmp);
    let largest = e[2];
    // Relative to the largest, so that nothing over- or underflows; a value lost to rounding counts as flat.
    let [x, z, y] = e.map(|v| (v / largest).max(1e-30));
    4.0 * PI * largest.sqrt() * carlson_rg(x, y, z)
}

/// R_G by DLMF 19.21.10 with `z` between `x` and `y`, so that every term is positive.
fn carlson_rg(x: f64, y: f64, z: f64) -> f64 {
    let first = z * carlson_rf(x, y, z);
    let second = (x - z) * (y - z) * carlson_rd(x, y, z) / 3.0;
    0.5 * (first - second + (x * y / z).sqrt())
}

/// Duplication until the arguments agree to this; the series' error is its sixth power.
const CLOSE: f64 = 2e-3;

/// R_F by duplication and DLMF 19.36.1.
fn carlson_rf(mut x: f64, mut y: f64, mut z: f64) -> f64 {
    loop {
        let mean = (x + y + z) / 3.0;
        let (dx, dy) = (1.0 - x / mean, 1.0 - y / mean);
        let dz = -(dx + dy);
        if dx.abs().max(dy.abs()).max(dz.abs()) < CLOSE {
            let (e2, e3) = (dx * dy - dz * dz, dx * dy * dz);
            let series = 1.0 - e2 / 10.0 + e3 / 14.0 + e2 * e2 / 24.0 - 3.0 * e2 * e3 / 44.0;
            return series / mean.sqrt();
        }
        let lambda = (x * y).sqrt() + (y * z).sqrt() + (z * x).sqrt();
        (x, y, z) = ((x + lambda) / 4.0, (y + lambda) / 4.0, (z + lambda) / 4.0);
    }
}

/// R_D by duplication and DLMF 19.36.2.
fn carlson_rd(mut x: f64, mut y: f64, mut z: f64) -> f64 {
    let (mut sum, mut factor) = (0.0, 1.0);
    loop {
        let mean = (x + y + 3.0 * z) / 5.0;
        let (dx, dy) = (1.0 - x / mean, 1.0 - y / mean);
        let dz = -(dx + dy) / 3.0;
        if dx.abs().max(dy.abs()).max(dz.abs()) < CLOSE {
            let xy = dx * dy;
            let z2 = dz * dz;
            let (e2, e3) = (xy - 6.0 * z2, (3.0 * xy - 8.0 * z2) * dz);
            let (e4, e5) = (3.0 * (xy - z2) * z2, xy * z2 * dz);
            let series = 1.0 - 3.0 * e2 / 14.0 + e3 / 6.0 + 9.0 * e2 * e2 / 88.0
                - 3.0 * e4 / 22.0
                - 9.0 * e2 * e3 / 52.0
                + 3.0 * e5 / 26.0;
            return 3.0 * sum + factor * series / (mean * mean.sqrt());
        }
        let lambda = (x * y).sqrt() + (y * z).sqrt() + (z * x).sqrt();
        sum += factor / (z.sqrt() * (z + lambda));
        factor /= 4.0;
        (x, y, z) = ((x + lambda) / 4.0, (y + lambda) / 4.0, (z + lambda) / 4.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, DVec3};

    fn area(a: f64, b: f64, c: f64) -> f64 {
        let turn = DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(0.3, -1.0, 0.7)));
        ellipsoid(&(turn * DMat3::from_diagonal(DVec3::new(b * c, c * a, a * b))))
    }

    #[test]
    fn area_agrees_with_the_forms_of_spheroids() {
        // Oblate a = b > c and prolate a = b < c: the elementary closed forms.
        let oblate = |a: f64, c: f64| {
            let e = (1.0 - c * c / (a * a)).sqrt();
            2.0 * PI * a * a * (1.0 + (1.0 - e * e) / e * e.atanh())
        };
        let prolate = |a: f64, c: f64| {
            let e = (1.0 - a * a / (c * c)).sqrt();
            2.0 * PI * a * a * (1.0 + c / (a * e) * e.asin())
        };
        for (a, c) in [(2.0, 1.0), (1.0, 0.1), (1e-3, 1e-4), (5e3, 1.0)] {
            // The oblate form itself loses some digits where e is near 1.
            assert!((area(a, a, c) / oblate(a, c) - 1.0).abs() < 1e-10, "{a} {c}");
            assert!((area(c, c, a) / prolate(c, a) - 1.0).abs() < 1e-10, "{a} {c}");
        }
        assert!((area(3.0, 3.0, 3.0) / (36.0 * PI) - 1.0).abs() < 1e-13);
        // Flat: both sides of an elliptic disc.
        assert!((area(2.0, 3.0, 1e-9) / (12.0 * PI) - 1.0).abs() < 1e-8);
    }

    #[test]
    fn area_of_three_different_axes_agrees_with_quadrature() {
        // Midpoints in z and in angle: the integrand |N w| is smooth and periodic.
        let (a, b, c) = (1.0, 2.0, 3.5);
        let n = 2000;
        let mut sum = 0.0;
        for i in 0..n {
            let z = -1.0 + 2.0 * (i as f64 + 0.5) / n as f64;
            let r = (1.0 - z * z).sqrt();
            for j in 0..64 {
                let phi = 2.0 * PI * (j as f64 + 0.5) / 64.0;
                sum += DVec3::new(b * c * r * phi.cos(), c * a * r * phi.sin(), a * b * z).length();
            }
        }
        let quadrature = 4.0 * PI * sum / (n * 64) as f64;
        // The midpoint rule's error in z, of order 1 / n^2.
        assert!((area(a, b, c) / quadrature - 1.0).abs() < 1e-6);
    }
}
