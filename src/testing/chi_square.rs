//! Pearson's chi-square test of goodness of fit for samplers of directions.

use glam::Vec3;

use super::TestRng;
use super::quadrature::{integrate_rect, polar};
use crate::math::Frame;

/// How directions are counted: rows of equal 1 - cos about `axis`, out to `cap`, by columns of equal azimuth, and one
/// bin for all the rest of the sphere.
#[derive(Debug, Clone, Copy)]
pub struct Bins {
    /// Unit axis.
    pub axis: Vec3,
    /// 1 - cos at the border of the last row, in (0, 2]; small for narrow lobes about `axis`.
    pub cap: f64,
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub columns: usize,
}

impl Default for Bins {
    fn default() -> Self {
        Bins { axis: Vec3::Z, cap: 2.0, rows: 20, columns: 40 }
    }
}

/// How a test is run.
#[derive(Debug, Clone, Copy)]
pub struct ChiSquare {
    /// Where counts go.
    pub bins: Bins,
    /// How many samples are drawn.
    pub samples: u32,
    /// Seed of the stream they are drawn from.
    pub seed: u64,
    /// How many tests are made of one kind: the level of each is lowered so that all together reject a correct
    /// sampler with probability 1 % (Sidak 1967).
    pub tests: u32,
}

impl Default for ChiSquare {
    fn default() -> Self {
        ChiSquare { bins: Bins::default(), samples: 200_000, seed: 1, tests: 1 }
    }
}

/// Draws from `sample` (`None` counts as lost) and compares the counts with the integrals of `pdf` (per solid angle)
/// over the bins; what `pdf` lacks to 1 is expected to be lost. Panics with an account of it where they disagree.
pub fn chi_square_sphere(
    what: &str,
    how: &ChiSquare,
    mut sample: impl FnMut(&mut TestRng) -> Option<Vec3>,
    pdf: impl Fn(Vec3) -> f32,
) {
    let Bins { axis, cap, rows, columns } = how.bins;
    let frame = Frame::from_z(axis);
    let mut rng = TestRng::new(how.seed);
    let mut counts = vec![0f64; rows * columns + 1];
    let rest = rows * columns;
    for _ in 0..how.samples {
        let Some(w) = sample(&mut rng) else {
            counts[rest] += 1.0;
            continue;
        };
        assert!((w.length() - 1.0).abs() < 1e-5, "{what}: {w} is not a unit vector");
        counts[bin_of(&how.bins, frame.to_local(w)).unwrap_or(rest)] += 1.0;
    }
    let n = f64::from(how.samples);
    let density = |z: f64, phi: f64| f64::from(pdf(frame.to_world(polar(z, phi).as_vec3())));
    let mut expected: Vec<f64> = (0..rest)
        .map(|i| {
            let z = [0, 1].map(|k| 1.0 - cap * (i / columns + k) as f64 / rows as f64);
            let phi = [0, 1].map(|k| std::f64::consts::TAU * (i % columns + k) as f64 / columns as f64);
            // A tenth of a sample per bin: (1/10)^2 / 5 is nothing in the statistic.
            n * integrate_rect(density, [z[1], z[0]], phi, 0.1 / n)
        })
        .collect();
    let inside: f64 = expected.iter().sum();
    assert!(inside < n * (1.0 + 1e-3), "{what}: the density integrates to {}", inside / n);
    expected.push((n - inside).max(0.0));
    chi_square_counts(&format!("{what}, {rows}x{columns} bins"), how.tests, &counts, &expected);
}

/// Compares counts of samples in bins of any kind with what a density expects there; `tests` as in [`ChiSquare`]. Panics
/// with an account of it where they disagree.
pub fn chi_square_counts(what: &str, tests: u32, counts: &[f64], expected: &[f64]) {
    // Sidak: 1 - (1 - 0.01)^(1 / tests).
    let level = -(0.99f64.ln() / f64::from(tests)).exp_m1();
    match compare(counts, expected) {
        Err(i) => panic!("{what}: bin {i} drew {}, expected {:.3e}", counts[i], expected[i]),
        Ok(p) if p < level => panic!("{what}: p = {p:.3e} < {level:.3e}; {}", worst(counts, expected)),
        Ok(_) => {}
    }
}

/// The bin of a local direction; `None` outside the cap.
fn bin_of(bins: &Bins, w: Vec3) -> Option<usize> {
    let row = f64::from(crate::sampling::warp::one_minus_cos(w)) / bins.cap * bins.rows as f64;
    let turn = (f64::from(w.y).atan2(f64::from(w.x)) / std::f64::consts::TAU).rem_euclid(1.0);
    let column = ((turn * bins.columns as f64) as usize).min(bins.columns - 1);
    let last = bins.rows - 1;
    // Rounding may carry the very pole past the last row of the whole sphere.
    let row = if bins.cap >= 2.0 { (row as usize).min(last) } else { row as usize };
    (row <= last).then_some(row * bins.columns + column)
}

/// The p-value, or the index of a bin that drew what it cannot have drawn.
fn compare(counts: &[f64], expected: &[f64]) -> Result<f64, usize> {
    let mut order: Vec<usize> = (0..counts.len()).collect();
    order.sort_by(|&a, &b| expected[a].total_cmp(&expected[b]));
    let (mut statistic, mut cells) = (0.0, 0);
    let (mut pooled_count, mut pooled) = (0.0, 0.0);
    for i in order {
        // Quadrature has its error, and directions on a border their rounding; several samples in nothing are a fault.
        if expected[i] < 0.02 && counts[i] > 4.0 {
            return Err(i);
        }
        pooled_count += counts[i];
        pooled += expected[i];
        // The usual rule for the statistic to follow its distribution: at least five expected per cell.
        if pooled >= 5.0 {
            statistic += (pooled_count - pooled).powi(2) / pooled;
            cells += 1;
            (pooled_count, pooled) = (0.0, 0.0);
        }
    }
    Ok(if cells < 2 { 1.0 } else { upper_gamma(0.5 * f64::from(cells - 1), 0.5 * statistic) })
}

fn worst(counts: &[f64], expected: &[f64]) -> String {
    let score = |i: usize| (counts[i] - expected[i]).abs() / expected[i].max(1.0).sqrt();
    let mut order: Vec<usize> = (0..counts.len()).collect();
    order.sort_by(|&a, &b| score(b).total_cmp(&score(a)));
    let line = |&i: &usize| format!("bin {i}: {} of {:.1}", counts[i], expected[i]);
    order.iter().take(4).map(line).collect::<Vec<_>>().join(", ")
}

/// ln of the gamma function for a > 0: Stirling's series (DLMF 5.11.1) after shifting a above 10.
fn ln_gamma(mut a: f64) -> f64 {
    let mut shift = 0.0;
    while a < 10.0 {
        shift -= a.ln();
        a += 1.0;
    }
    let r = 1.0 / (a * a);
    let series = (1.0 / 12.0 - r * (1.0 / 360.0 - r * (1.0 / 1260.0 - r / 1680.0))) / a;
    shift + (a - 0.5) * a.ln() - a + 0.5 * std::f64::consts::TAU.ln() + series
}

/// Regularised upper incomplete gamma function Q(a, x): by the series DLMF 8.11.4 for x < a + 1, by the continued
/// fraction DLMF 8.9.2 (modified Lentz) above.
fn upper_gamma(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut k) = (1.0 / a, 1.0 / a, a);
        while term > sum * 1e-16 {
            k += 1.0;
            term *= x / k;
            sum += term;
        }
        return 1.0 - front * sum;
    }
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1e300, 1.0 / b);
    let mut h = d;
    for i in 1..10_000 {
        let an = -f64::from(i) * (f64::from(i) - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        h *= d * c;
        if (d * c - 1.0).abs() < 1e-15 {
            break;
        }
    }
    front * h
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::warp;

    #[test]
    fn incomplete_gamma_has_its_closed_forms() {
        for x in [0.01, 0.5, 1.0, 3.0, 10.0, 40.0] {
            let close = |got: f64, want: f64| assert!((got - want).abs() < 1e-12, "{x}: {got} {want}");
            close(upper_gamma(1.0, x), (-x).exp());
            // For whole a it is the chance of fewer than a events of a Poisson variable.
            let poisson: f64 =
                (0..7).scan(1.0, |t, k| Some(std::mem::replace(t, *t * x / f64::from(k + 1)))).sum();
            close(upper_gamma(7.0, x), poisson * (-x).exp());
        }
        // Median and tail of chi-square tables: 199 and 10 degrees of freedom.
        assert!((upper_gamma(99.5, 0.5 * 232.912) - 0.05).abs() < 1e-5);
        assert!((upper_gamma(5.0, 0.5 * 18.307) - 0.05).abs() < 1e-5);
    }

    #[test]
    fn right_densities_pass() {
        let how = ChiSquare { tests: 3, ..ChiSquare::default() };
        let cosine = |rng: &mut TestRng| Some(warp::cosine_hemisphere(rng.vec2()));
        chi_square_sphere("cosine", &how, cosine, |w| warp::cosine_hemisphere_pdf(w.z));
        // A third of the samples lost, and a density that says so.
        let lossy = |rng: &mut TestRng| (rng.f32() > 1.0 / 3.0).then(|| warp::uniform_sphere(rng.vec2()));
        chi_square_sphere("lossy", &how, lossy, |_| warp::UNIFORM_SPHERE_PDF * 2.0 / 3.0);
        let axis = Vec3::new(0.6, -0.64, 0.48);
        let narrow = ChiSquare { bins: Bins { axis, cap: 3e-4, ..Bins::default() }, ..how };
        let cone =
            |rng: &mut TestRng| Some(Frame::from_z(axis).to_world(warp::uniform_cone(rng.vec2(), 2e-4)));
        let inside = |w: Vec3| {
            let local = Frame::from_z(axis).to_local(w);
            if warp::one_minus_cos(local) < 2e-4 { warp::uniform_cone_pdf(2e-4) } else { 0.0 }
        };
        chi_square_sphere("cone", &narrow, cone, inside);
    }

    #[test]
    fn wrong_densities_fail() {
        let fails = |pdf: fn(Vec3) -> f32| {
            let run = move || {
                let cosine = |rng: &mut TestRng| Some(warp::cosine_hemisphere(rng.vec2()));
                chi_square_sphere("cosine", &ChiSquare::default(), cosine, pdf);
            };
            std::panic::catch_unwind(run).is_err()
        };
        assert!(fails(|w| if w.z > 0.0 { warp::UNIFORM_HEMISPHERE_PDF } else { 0.0 }));
        // Two per cent of slope in azimuth.
        assert!(fails(|w| warp::cosine_hemisphere_pdf(w.z) * (1.0 + 0.02 * w.x.signum())));
        // One per cent of the whole missing.
        assert!(fails(|w| warp::cosine_hemisphere_pdf(w.z) * 0.99));
        // Samples where the density is zero.
        assert!(fails(|w| if w.z > 0.05 { warp::cosine_hemisphere_pdf(w.z) * 1.0025 } else { 0.0 }));
    }
}
