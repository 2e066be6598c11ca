//! Adaptive quadrature in f64, for integrands with jumps along curves.

use std::f64::consts::TAU;

use glam::DVec3;

/// Nodes and weights of Gauss and Legendre's three-point rule on [0, 1].
const NODES: [(f64, f64); 3] =
    [(0.112_701_665_379_258_31, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.887_298_334_620_741_7, 5.0 / 18.0)];

/// A rectangle of the plane.
#[derive(Clone, Copy)]
struct Cell {
    x: f64,
    y: f64,
    w: f64,
    h: f64,
}

impl Cell {
    fn rule(self, f: &impl Fn(f64, f64) -> f64) -> f64 {
        let mut sum = 0.0;
        for (x, wx) in NODES {
            for (y, wy) in NODES {
                sum += wx * wy * f(self.x + x * self.w, self.y + y * self.h);
            }
        }
        sum * self.w * self.h
    }

    fn quarters(self) -> [Cell; 4] {
        let (w, h) = (0.5 * self.w, 0.5 * self.h);
        [(0.0, 0.0), (w, 0.0), (0.0, h), (w, h)].map(|(dx, dy)| Cell { x: self.x + dx, y: self.y + dy, w, h })
    }

    fn refine(self, f: &impl Fn(f64, f64) -> f64, coarse: f64, tolerance: f64, depth: u32) -> f64 {
        let quarters = self.quarters();
        let parts = quarters.map(|q| q.rule(f));
        let sum: f64 = parts.iter().sum();
        if depth == 0 || (sum - coarse).abs() <= tolerance {
            return sum;
        }
        // A jump's curve crosses about two of the four quarters: half of the tolerance each.
        let refined = |(q, part): (Cell, f64)| q.refine(f, part, 0.5 * tolerance, depth - 1);
        quarters.into_iter().zip(parts).map(refined).sum()
    }
}

/// The integral of `f` over [x[0], x[1]] x [y[0], y[1]]; quarters cells until two levels agree to `tolerance`
/// (absolute, a share of it for each deeper cell), at most twelve times.
pub fn integrate_rect(f: impl Fn(f64, f64) -> f64, x: [f64; 2], y: [f64; 2], tolerance: f64) -> f64 {
    let cell = Cell { x: x[0], y: y[0], w: x[1] - x[0], h: y[1] - y[0] };
    // Two forced levels, so that a small feature is not overlooked by the first nine nodes.
    let parts = cell.quarters().map(|q| q.quarters().map(|s| s.refine(&f, s.rule(&f), tolerance / 16.0, 10)));
    parts.iter().flatten().sum()
}

/// The integral over the whole sphere, per solid angle, to `tolerance` (absolute) for smooth integrands, and to ten
/// times that across jumps, where two levels may agree by chance.
pub fn integrate_sphere(f: impl Fn(DVec3) -> f64, tolerance: f64) -> f64 {
    let (rows, columns) = (16, 32);
    let tolerance = tolerance / 512.0;
    let mut sum = 0.0;
    for row in 0..rows {
        for column in 0..columns {
            let z = [row, row + 1].map(|r| 1.0 - 2.0 * f64::from(r) / f64::from(rows));
            let phi = [column, column + 1].map(|c| TAU * f64::from(c) / f64::from(columns));
            sum += integrate_rect(|z, phi| f(polar(z, phi)), [z[1], z[0]], phi, tolerance);
        }
    }
    sum
}

/// The unit vector with this z and azimuth.
pub(super) fn polar(z: f64, phi: f64) -> DVec3 {
    let r = ((1.0 - z) * (1.0 + z)).max(0.0).sqrt();
    DVec3::new(r * phi.cos(), r * phi.sin(), z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn known_integrals() {
        let close = |got: f64, want: f64, tol: f64| assert!((got - want).abs() < tol, "{got} {want}");
        close(integrate_sphere(|_| 1.0, 1e-9), 4.0 * PI, 1e-12);
        close(integrate_sphere(|w| w.z.max(0.0), 1e-9), PI, 1e-9);
        close(integrate_sphere(|w| w.x * w.x, 1e-9), 4.0 * PI / 3.0, 1e-9);
        // A cap about a slanted axis: a jump along a circle.
        let axis = DVec3::new(1.0, 2.0, -0.5).normalize();
        let cap = |w: DVec3| f64::from(u8::from(w.dot(axis) > 0.9));
        close(integrate_sphere(cap, 1e-5), TAU * 0.1, 1e-4);
        // A narrow Gaussian off every node.
        let peak = |x: f64, y: f64| (-((x - 0.31).powi(2) + (y - 0.77).powi(2)) * 1e3).exp();
        close(integrate_rect(peak, [0.0, 1.0], [0.0, 1.0], 1e-10), PI / 1e3, 1e-9);
    }
}
