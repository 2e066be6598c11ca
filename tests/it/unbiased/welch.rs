//! Welch's t-test of two means whose variances differ, and what many of them say together.

use std::f64::consts::FRAC_PI_2;

/// The mean of some replicates and its squared standard error.
fn moments(values: &[f64]) -> [f64; 2] {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    [mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0) / n]
}

/// Two means of independent replicates against each other.
#[derive(Debug, Clone, Copy)]
pub struct Welch {
    /// The first less the second.
    pub difference: f64,
    /// Standard error of it.
    pub error: f64,
    /// Degrees of freedom by Welch and Satterthwaite.
    pub freedom: f64,
    /// The second mean, which says how large all this is.
    pub mean: f64,
    /// How far the first may be off by what it promises.
    pub allowed: f64,
}

impl Welch {
    /// Of at least two replicates each.
    pub fn new(ours: &[f64], plain: &[f64], allowed: f64) -> Self {
        let [[a, va], [b, vb]] = [ours, plain].map(moments);
        let degrees = |v: f64, n: usize| v * v / (n as f64 - 1.0);
        let freedom = (va + vb).powi(2) / (degrees(va, ours.len()) + degrees(vb, plain.len()));
        // Where neither spreads there is no test but of equality.
        let freedom = if va + vb > 0.0 { freedom } else { 1.0 };
        Welch { difference: a - b, error: (va + vb).sqrt(), freedom, mean: b, allowed }
    }

    /// By how many standard errors the difference is larger than may be.
    pub fn t(&self) -> f64 {
        let beyond = (self.difference.abs() - self.allowed).max(0.0);
        if beyond > 0.0 { (beyond / self.error).copysign(self.difference) } else { 0.0 }
    }

    /// How often chance alone brings as much, or more, on either side. With something allowed this is an upper bound.
    pub fn p(&self) -> f64 {
        student_two_sided(self.t(), self.freedom)
    }

    /// As [`Welch::p`], with nothing allowed.
    pub fn p_of_equal(&self) -> f64 {
        Welch { allowed: 0.0, ..*self }.p()
    }

    /// The least part of the mean that a bias must be worth to be found at level `p`, nine times in ten.
    pub fn detectable(&self, p: f64) -> f64 {
        // 1.28 is the normal's 90 % quantile, and Student's with these degrees of freedom hardly more.
        ((student_quantile(p, self.freedom) + 1.28) * self.error + 2.0 * self.allowed) / self.mean
    }
}

/// The probability that Student's t with so many degrees of freedom (1 or more) is at least `t` in magnitude.
pub fn student_two_sided(t: f64, freedom: f64) -> f64 {
    // With t = sqrt(f) tan(a) the density is that of a power of cos(a): a ratio of two integrals, no gamma function.
    let from = (t.abs() / freedom.sqrt()).atan();
    let integral = |from: f64| {
        // Simpson's rule: the steepest of the integrands that matter here fall by e in some twelve steps.
        const STEPS: usize = 1024;
        let step = (FRAC_PI_2 - from) / STEPS as f64;
        let weight = |i: usize| match i {
            0 | STEPS => 1.0,
            _ if i % 2 == 1 => 4.0,
            _ => 2.0,
        };
        let value = |i: usize| (from + step * i as f64).cos().max(0.0).powf(freedom - 1.0);
        (0..=STEPS).map(|i| weight(i) * value(i)).sum::<f64>() * step / 3.0
    };
    (integral(from) / integral(0.0)).min(1.0)
}

/// The magnitude that Student's t exceeds with this probability.
pub fn student_quantile(p: f64, freedom: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1e3);
    // Each halves what is left of it, down to 1e-9.
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        *(if student_two_sided(middle, freedom) > p { &mut low } else { &mut high }) = middle;
    }
    0.5 * (low + high)
}

/// Of these probabilities those that are too small for chance: Benjamini and Hochberg (1995). Where nothing is wrong any
/// of them is found with probability `level` (Simes 1986; parts of one picture go together, for which it holds as well).
pub fn too_small(ps: &[f64], level: f64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..ps.len()).collect();
    order.sort_by(|&a, &b| ps[a].total_cmp(&ps[b]));
    let fits = |k: &usize| ps[order[*k]] <= level * (*k + 1) as f64 / ps.len() as f64;
    order.truncate((0..ps.len()).rev().find(fits).map_or(0, |k| k + 1));
    order
}

/// How far the distribution of some probabilities is from a uniform one (Kolmogorov).
pub fn distance_from_uniform(ps: &[f64]) -> f64 {
    let mut sorted = ps.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = ps.len() as f64;
    let steps =
        (0..).zip(&sorted).map(|(i, p)| (p - f64::from(i) / n).abs().max((f64::from(i + 1) / n - p).abs()));
    steps.fold(0.0, f64::max)
}

#[test]
fn quantiles_are_those_of_tables() {
    // Two-sided, from tables of Student's t; the last is the normal's.
    for (p, freedom, t) in [
        (0.05, 1.0, 12.706),
        (0.05, 10.0, 2.2281),
        (0.001, 10.0, 4.5869),
        (0.001, 60.0, 3.4602),
        (0.5, 30.0, 0.6828),
        (0.05, 1e4, 1.9602),
    ] {
        assert!((student_quantile(p, freedom) / t - 1.0).abs() < 2e-4, "{p} {freedom}");
    }
    // Far out: 1 - t / sqrt(t^2 + 2) for two degrees of freedom.
    let exact = 1.0 - 50.0 / 2502f64.sqrt();
    assert!((student_two_sided(50.0, 2.0) / exact - 1.0).abs() < 1e-6);
}

#[test]
fn degrees_of_freedom_are_welchs() {
    // Equal spreads and numbers have those of the pooled test; a mean that is known leaves those of the other.
    let w = Welch::new(&[1.0, 2.0, 3.0], &[2.0, 3.0, 4.0], 0.0);
    assert!((w.freedom - 4.0).abs() < 1e-12 && (w.error - (2.0f64 / 3.0).sqrt()).abs() < 1e-12);
    assert!((Welch::new(&[1.0, 2.0, 3.0], &[2.0; 9], 0.0).freedom - 2.0).abs() < 1e-12);
    let same = Welch::new(&[1.0; 3], &[1.0; 3], 0.0);
    assert_eq!([same.p(), Welch::new(&[1.0; 3], &[1.1; 3], 0.0).p().round()], [1.0, 0.0]);
}

#[test]
fn what_is_too_small_depends_on_how_many_there_are() {
    assert!(too_small(&[0.5, 0.004, 0.9, 0.8], 0.01).is_empty());
    assert_eq!(too_small(&[0.5, 0.002, 0.9, 0.004], 0.01), [1, 3]);
}
