//! Rounding-error bounds, in the manner of Higham, "Accuracy and Stability of Numerical Algorithms" (2002), ch. 3.
//!
//! The error of one correctly rounded operation is at most `u` = half a unit in the last place, relative; `n` of
//! them in a row cost at most [`gamma`]`(n)`. (For the neighbours of a number, see `f32::next_up` of the standard
//! library.)

use std::ops::{Add, Mul, Neg, Sub};

use glam::{DAffine3, DMat3, DVec3, Vec3};

/// Unit roundoff of f32: 2^-24.
pub const U32: f32 = f32::EPSILON * 0.5;
/// Unit roundoff of f64: 2^-53.
pub const U64: f64 = f64::EPSILON * 0.5;

/// The smallest normal f32. Below it the analysis by relative errors ends: a result is off by up to 2^-150 where numbers
/// are allowed to grow small, and by as much as this where they are flushed to zero, which bounds both.
pub const UNDERFLOW: f64 = f32::MIN_POSITIVE as f64;

/// Relative error bound of `n` f32 roundings: n u / (1 - n u), with u = 2^-24. Higham 2002, lemma 3.1.
#[inline]
pub const fn gamma(n: u32) -> f32 {
    let nu = n as f32 * U32;
    nu / (1.0 - nu)
}

/// Relative error bound of `n` f64 roundings: n u / (1 - n u), with u = 2^-53.
#[inline]
pub const fn gamma64(n: u32) -> f64 {
    let nu = n as f64 * U64;
    nu / (1.0 - nu)
}

/// |M| |v|: bounds, component by component, of any product M w with |w_i| <= |v_i|. With `v` an error bound of a
/// vector, this is the bound of that error after M.
#[inline]
pub fn abs_mul(m: &DMat3, v: DVec3) -> DVec3 {
    m.x_axis.abs() * v.x.abs() + m.y_axis.abs() * v.y.abs() + m.z_axis.abs() * v.z.abs()
}

/// Bound of the error that f32 evaluation of the affine `m` at a point adds: gamma(4) (|M| |p| + |t|), for matrix
/// entries rounded to f32 once (one rounding), three products and three sums (three on the longest chain).
/// `error` is the bound already on `p`; the result covers both. Pharr, Jakob, Humphreys,
/// "Physically Based Rendering" 4e, 6.8.
#[inline]
pub fn transformed_point_error(m: &DAffine3, p: Vec3, error: Vec3) -> Vec3 {
    let (p, error) = (p.as_dvec3().abs(), error.as_dvec3());
    let rounding = (abs_mul(&m.matrix3, p + error) + m.translation.abs()) * f64::from(gamma(5));
    let carried = abs_mul(&m.matrix3, error);
    // The bound itself is computed in f64 and rounded to f32: a relative 1e-6 on top covers both.
    ((rounding + carried) * (1.0 + 1e-6)).as_vec3()
}

/// A number and a bound on its absolute error, carried along through a computation (running error analysis,
/// Higham 2002, 3.3). Each operation adds its own rounding and the operands' carried errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Running {
    /// The computed value.
    pub value: f32,
    /// No less than |computed - exact|.
    pub error: f32,
}

/// Each update of a bound is itself rounded a few times; this keeps it a bound.
const SLACK: f32 = 1.0 + 8.0 * U32;

impl Running {
    /// A value known exactly.
    #[inline]
    pub const fn exact(value: f32) -> Self {
        Running { value, error: 0.0 }
    }

    /// A value with a known error bound.
    #[inline]
    pub const fn new(value: f32, error: f32) -> Self {
        Running { value, error }
    }

    #[inline]
    fn rounded(value: f32, carried: f32) -> Self {
        // Half an ulp of the result, and the smallest number there is for results below the normal range.
        let own = value.abs() * U32 + f32::from_bits(1);
        Running { value, error: (carried + own) * SLACK }
    }

    /// Square root; of a value that may be zero or less within its error, the bound is that of the whole
    /// interval [0, sqrt(value + error)].
    #[inline]
    pub fn sqrt(self) -> Self {
        let value = self.value.max(0.0).sqrt();
        let low = self.value - self.error;
        let carried = if low > 0.0 {
            self.error / (value + low.sqrt())
        } else {
            (self.value.max(0.0) + self.error).sqrt()
        };
        Self::rounded(value, carried)
    }

    /// Quotient; the bound is infinite where the divisor may be zero.
    #[inline]
    pub fn over(self, o: Running) -> Self {
        let value = self.value / o.value;
        let low = o.value.abs() - o.error;
        let carried = if low > 0.0 { (self.error + value.abs() * o.error) / low } else { f32::INFINITY };
        // `value` inside `carried` is itself rounded once more.
        Self::rounded(value, carried * SLACK)
    }
}

impl Add for Running {
    type Output = Running;
    #[inline]
    fn add(self, o: Running) -> Running {
        Running::rounded(self.value + o.value, self.error + o.error)
    }
}

impl Sub for Running {
    type Output = Running;
    #[inline]
    fn sub(self, o: Running) -> Running {
        Running::rounded(self.value - o.value, self.error + o.error)
    }
}

impl Mul for Running {
    type Output = Running;
    #[inline]
    fn mul(self, o: Running) -> Running {
        let carried = self.value.abs() * o.error + o.value.abs() * self.error + self.error * o.error;
        Running::rounded(self.value * o.value, carried)
    }
}

impl Neg for Running {
    type Output = Running;
    #[inline]
    fn neg(self) -> Running {
        Running { value: -self.value, error: self.error }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A small deterministic stream of f32 in [-scale, scale].
    fn stream(scale: f32) -> impl FnMut() -> f32 {
        let mut state = 1u32;
        move || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            ((state >> 8) as f32 / 8_388_608.0 - 1.0) * scale
        }
    }

    #[test]
    fn gamma_bounds_a_sum_of_products() {
        let mut next = stream(3.0);
        for _ in 0..10_000 {
            let v: [f32; 6] = std::array::from_fn(|_| next());
            let f = v[0] * v[1] + v[2] * v[3] + v[4] * v[5];
            let d = |i: usize| f64::from(v[i]);
            let exact = d(0) * d(1) + d(2) * d(3) + d(4) * d(5);
            let size = (d(0) * d(1)).abs() + (d(2) * d(3)).abs() + (d(4) * d(5)).abs();
            assert!((f64::from(f) - exact).abs() <= f64::from(gamma(3)) * size);
        }
        assert!(gamma(1) > U32 && gamma64(3) > 3.0 * U64);
    }

    #[test]
    fn running_error_holds_and_is_not_idle() {
        let mut next = stream(2.0);
        let (mut worst, mut used) = (0f64, 0f64);
        for _ in 0..20_000 {
            let [a, b, c] = [next(), next(), next()];
            let r = |v| Running::exact(v);
            let got = ((r(a) * r(b) - r(c) * r(c)).over(r(a) + r(3.0)) + -r(b)) * r(c);
            let root = (r(a) * r(a) + r(b) * r(b)).sqrt();
            let (a, b, c) = (f64::from(a), f64::from(b), f64::from(c));
            let exact = ((a * b - c * c) / (a + 3.0) - b) * c;
            let exact_root = (a * a + b * b).sqrt();
            for (g, e) in [(got, exact), (root, exact_root)] {
                let actual = (f64::from(g.value) - e).abs();
                assert!(actual <= f64::from(g.error), "{g:?} {e}");
                worst = worst.max(actual / f64::from(g.error));
                used += f64::from(g.error);
            }
        }
        // A bound that is never approached within a factor of 5 would mean a needlessly large offset.
        assert!(worst > 0.2 && used.is_finite(), "{worst}");
        assert_eq!(Running::exact(1.0).over(Running::new(0.0, 1e-9)).error, f32::INFINITY);
    }

    #[test]
    fn transformed_point_error_covers_f32_evaluation() {
        let mut next = stream(50.0);
        for _ in 0..5_000 {
            let mut v = || DVec3::new(next().into(), next().into(), next().into());
            let m = DAffine3::from_cols(v(), v(), v(), v());
            let exact = v() * 1.000_000_03;
            let p = exact.as_vec3();
            let error = (exact - p.as_dvec3()).abs().as_vec3() * 1.000_001;
            let (x, y, z) =
                (m.matrix3.x_axis.as_vec3(), m.matrix3.y_axis.as_vec3(), m.matrix3.z_axis.as_vec3());
            let q = x * p.x + (y * p.y + (z * p.z + m.translation.as_vec3()));
            let off = (q.as_dvec3() - m.transform_point3(exact)).abs();
            let bound = transformed_point_error(&m, p, error).as_dvec3();
            assert!(off.cmple(bound).all(), "{off} {bound}");
        }
    }
}
