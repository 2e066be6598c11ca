//! Probabilities of the test statistics. Tails are worked out as tails, so that 1e-12 has digits, too.

use statrs::function::beta::beta_reg;
use statrs::function::erf::{erfc, erfc_inv};
use std::f64::consts::{PI, SQRT_2};

/// Beyond so many degrees of freedom a variance counts as known to that many: probabilities change by less than 1e-5 of
/// themselves where they matter, and the continued fraction behind them still converges.
const MOST_FREEDOM: f64 = 1e6;

/// Halvings of an interval in the searches below: to the last bit of a double.
const HALVINGS: usize = 200;

/// The probability that a standard normal deviate is at least `z`.
pub fn normal_tail(z: f64) -> f64 {
    0.5 * erfc(z / SQRT_2)
}

/// The standard normal deviate that is exceeded with probability `p` in (0, 1).
pub fn normal_quantile(p: f64) -> f64 {
    SQRT_2 * erfc_inv(2.0 * p)
}

/// The probability that chi-square with `k` of 1 to 3 degrees of freedom is at least `x`; 1 for 0.
pub fn chi_square_tail(x: f64, k: usize) -> f64 {
    let half = 0.5 * x.max(0.0);
    match k {
        0 => 1.0,
        1 => erfc(half.sqrt()),
        2 => (-half).exp(),
        _ => erfc(half.sqrt()) + 2.0 * (half / PI).sqrt() * (-half).exp(),
    }
}

/// The probability that F with `k` and `f` degrees of freedom, both above 0, is at least `x`.
pub fn f_tail(x: f64, k: f64, f: f64) -> f64 {
    // Abramowitz and Stegun, "Handbook of Mathematical Functions", 26.6.2.
    let f = f.min(MOST_FREEDOM);
    match x {
        x if x.is_nan() || x <= 0.0 => 1.0,
        x if x.is_infinite() => 0.0,
        x => beta_reg(0.5 * f, 0.5 * k, f / (f + k * x)),
    }
}

/// What F with `k` and `f` degrees of freedom exceeds with probability `p` in (0, 1).
pub fn f_quantile(p: f64, k: f64, f: f64) -> f64 {
    above(|x| f_tail(x, k, f) <= p)
}

/// The probability that Student's t with `f` degrees of freedom, above 0, is at least `t`.
pub fn student_tail(t: f64, f: f64) -> f64 {
    let half = 0.5 * f_tail(t * t, 1.0, f);
    if t >= 0.0 { half } else { 1.0 - half }
}

/// What Student's t with `f` degrees of freedom exceeds with probability `p` in (0, 0.5].
pub fn student_quantile(p: f64, f: f64) -> f64 {
    above(|t| student_tail(t, f) <= p)
}

/// The probability that F with `k` and `f` degrees of freedom and non-centrality `lambda` is at least `x`: the mixture by a
/// Poisson variable of mean `lambda` / 2 (Johnson, Kotz and Balakrishnan, "Continuous Univariate Distributions" 2, 30.1).
pub fn f_tail_off_centre(x: f64, k: f64, f: f64, lambda: f64) -> f64 {
    if lambda <= 0.0 || x <= 0.0 {
        return f_tail(x, k, f);
    }
    let f = f.min(MOST_FREEDOM);
    let mean = 0.5 * lambda;
    let at = f / (f + k * x);
    // Ten deviations of the Poisson variable, and then some.
    let reach = 10.0 * mean.sqrt() + 40.0;
    let (first, last) = ((mean - reach).max(0.0).floor() as u64, (mean + reach) as u64);
    let weight = |j: u64| {
        let j = j as f64;
        (j * mean.ln() - mean - statrs::function::gamma::ln_gamma(j + 1.0)).exp()
    };
    (first..=last).map(|j| weight(j) * beta_reg(0.5 * f, 0.5 * k + j as f64, at)).sum::<f64>().min(1.0)
}

/// The non-centrality with which F exceeds its quantile of probability `level` with probability `power`.
pub fn non_centrality(level: f64, power: f64, k: f64, f: f64) -> f64 {
    let critical = f_quantile(level, k, f);
    if !critical.is_finite() {
        return f64::INFINITY;
    }
    // Few degrees of freedom may want a non-centrality that no sum over a Poisson variable reaches.
    let most = 1e5;
    if f_tail_off_centre(critical, k, f, most) < power {
        return f64::INFINITY;
    }
    let (mut low, mut high) = (0.0, most);
    for _ in 0..50 {
        // Small ones are what is wanted with care: a mean of roots halves the relative error.
        let middle = (0.5 * (f64::sqrt(low) + f64::sqrt(high))).powi(2);
        *(if f_tail_off_centre(critical, k, f, middle) < power { &mut low } else { &mut high }) = middle;
    }
    high
}

/// The probability that the largest distance between `n` uniform numbers' distribution and the uniform one is `d` or more:
/// Kolmogorov's series with the correction of Stephens (1970), which is right to 1e-3 from five numbers on.
pub fn kolmogorov_tail(d: f64, n: usize) -> f64 {
    let root = (n as f64).sqrt();
    let x = (root + 0.12 + 0.11 / root) * d;
    if x < 0.2 {
        return 1.0;
    }
    let term = |j: i32| {
        let sign = if j % 2 == 1 { 2.0 } else { -2.0 };
        sign * (-2.0 * f64::from(j * j) * x * x).exp()
    };
    (1..=100).map(term).sum::<f64>().clamp(0.0, 1.0)
}

/// The least x of 0 and more for which `holds`, which does from there on.
fn above(holds: impl Fn(f64) -> bool) -> f64 {
    let mut high = 1.0;
    while !holds(high) {
        high *= 2.0;
        if high > 1e300 {
            return f64::INFINITY;
        }
    }
    let mut low = 0.0;
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        *(if holds(middle) { &mut high } else { &mut low }) = middle;
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(got: f64, want: f64, error: f64) {
        assert!((got / want - 1.0).abs() < error, "{got}, not {want}");
    }

    #[test]
    fn quantiles_are_those_of_tables() {
        // Abramowitz and Stegun, table 26.10 (t), 26.9 (F, upper 5 %, 1 % and 0.1 %), 26.5 (normal).
        for (p, f, t) in [
            (0.25, 1.0, 1.000),
            (0.05, 1.0, 6.314),
            (0.005, 1.0, 63.657),
            (0.025, 4.0, 2.776),
            (0.005, 10.0, 3.169),
            (0.0005, 20.0, 3.850),
            (0.025, 120.0, 1.980),
        ] {
            close(student_quantile(p, f), t, 3e-4);
        }
        for (p, k, f, x) in [
            (0.05, 3.0, 10.0, 3.71),
            (0.01, 3.0, 1.0, 5403.0),
            (0.01, 3.0, 60.0, 4.13),
            (0.001, 2.0, 30.0, 8.77),
            (0.05, 1.0, 120.0, 3.92),
        ] {
            close(f_quantile(p, k, f), x, 2e-3);
        }
        for (p, z) in [(0.5f64, 0.0), (0.025, 1.959964), (0.01, 2.326348), (1e-9, 5.997807)] {
            assert!((normal_quantile(p) - z).abs() < 1e-6 && (normal_tail(z) - p).abs() < 1e-6 * p.max(1e-3));
        }
    }

    #[test]
    fn tails_have_their_closed_forms() {
        for t in [0.1, 1.0, 7.0, 50.0, 1e4] {
            close(student_tail(t, 1.0), f64::atan2(1.0, t) / PI, 1e-9);
            // 1/2 - t / (2 sqrt(2 + t^2)), as a sum that loses nothing.
            let root = (2.0 + t * t).sqrt();
            close(student_tail(t, 2.0), 1.0 / (root * (root + t)), 1e-9);
        }
        // F with 2 and f: (1 + 2 x / f)^(-f / 2).
        for (x, f) in [(0.3f64, 3.0f64), (5.0, 10.0), (20.0, 400.0), (12.0, 1e5)] {
            close(f_tail(x, 2.0, f), (-0.5 * f * (2.0 * x / f).ln_1p()).exp(), 1e-7);
        }
        // SciPy 1.16, scipy.stats.f.sf.
        for (x, k, f, p) in [
            (5.0, 3.0, 1e5, 0.001817546393487503),
            (5.0, 3.0, 1e6, 0.0018167386976020291),
            (12.0, 3.0, 509.0, 1.3311015622129918e-07),
            (30.0, 3.0, 7.0, 0.00022835508825303635),
        ] {
            close(f_tail(x, k, f), p, 1e-9);
        }
        // With as good as known variances: the normal's and chi-square's tails.
        close(student_tail(3.0, 1e6), normal_tail(3.0), 5e-5);
        // SciPy 1.16, scipy.stats.chi2.sf.
        for (x, k, p) in [
            (12.0, 1, 0.0005320055051392497),
            (12.0, 2, 0.0024787521766663585),
            (12.0, 3, 0.007383160505359769),
            (120.0, 3, 7.716790355634162e-26),
        ] {
            close(chi_square_tail(x, k), p, 1e-9);
        }
        assert_eq!([chi_square_tail(-1e-20, 3), chi_square_tail(9.0, 0)], [1.0; 2]);
        let x = 6.0f64;
        let chi = chi_square_tail(2.0 * x, 3);
        // A million degrees of freedom stand for more: the tail is longer by about (2 x)^2 / (4 f) of itself, 3.6e-5.
        close(f_tail(2.0 * x / 3.0, 3.0, 1e9), chi, 4e-5);
        assert_eq!(
            [f_tail(0.0, 3.0, 5.0), f_tail(f64::INFINITY, 3.0, 5.0), student_tail(0.0, 7.0)],
            [1.0, 0.0, 0.5]
        );
    }

    #[test]
    fn power_off_centre() {
        // One known variance: the power of a two-sided normal test, 1 - Phi(z - d) + Phi(-z - d).
        for d in [0.5, 2.0, 5.0] {
            let z = normal_quantile(0.005);
            let power = normal_tail(z - d) + normal_tail(z + d);
            close(f_tail_off_centre(z * z, 1.0, 1e9, d * d), power, 1e-4);
        }
        // SciPy 1.16, scipy.stats.ncf.sf(f.isf(p, k, f), k, f, lambda).
        for (p, k, f, lambda, power) in
            [(0.05, 2.0, 20.0, 12.0, 0.8268212995946691), (0.01, 3.0, 300.0, 20.0, 0.9070747749631687)]
        {
            close(f_tail_off_centre(f_quantile(p, k, f), k, f, lambda), power, 1e-9);
        }
        for (k, f) in [(1.0, 5.0), (3.0, 300.0), (3.0, 1e5)] {
            let lambda = non_centrality(0.01, 0.95, k, f);
            close(f_tail_off_centre(f_quantile(0.01, k, f), k, f, lambda), 0.95, 1e-6);
        }
        close(non_centrality(0.05, 0.95, 1.0, 1e9).sqrt(), 1.959964 + 1.644854, 1e-4);
    }

    #[test]
    fn kolmogorovs_critical_values() {
        // Critical distances for n = 10, 20 (Birnbaum 1952) and the limit 1.3581, 1.6276 over sqrt n.
        for (d, n, p) in [(0.409, 10, 0.05), (0.490, 10, 0.01), (0.294, 20, 0.05), (0.0135810, 10000, 0.05)] {
            assert!((kolmogorov_tail(d, n) - p).abs() < 0.003, "{n}: {}", kolmogorov_tail(d, n));
        }
        assert_eq!(kolmogorov_tail(0.0, 10), 1.0);
    }
}
