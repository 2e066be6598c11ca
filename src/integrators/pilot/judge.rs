//! Which strategy trials speak for.

use super::scout::Seen;
use super::thinned;
use super::trial::{SAMPLES, Tracing, Trial};
use crate::integrators::{BARE_COST, RayCounts};

/// Part of the squared mean that is added to a pixel's own, as in relMSE: what a dark pixel counts for.
const EPSILON: f64 = 0.01;
/// How steeply squared errors of outlines fall by themselves: what is smooth along them is stratified.
const OUTLINE_SLOPE: f64 = 1.5;
/// How steeply squared errors fall with the number of samples: the exponent at which cost counts against variance.
const SLOPE: f64 = 1.2;
/// How much better than the first candidate another has to look: so much is noise.
const MARGIN: f64 = 0.7;

/// Pixels whose noise only more camera rays lower, which are dear where each carries many light samples: those without a
/// surface, whose noise is that of the sky's picture, and outlines.
#[derive(Default)]
pub(super) struct Bare {
    /// Sum over the lattice's pixels of their squared relative errors.
    error: f64,
    /// The same of their costs.
    cost: f64,
    /// Rays that were spent.
    pub rays: RayCounts,
}

impl Bare {
    /// By trying out so many of each at most.
    pub fn of(tracing: &Tracing, seen: &Seen, most: usize) -> Self {
        let mut bare = Bare::default();
        for (pixels, times) in [(&seen.bare, 1), (&seen.outlined, tracing.plan.outline_times)] {
            if pixels.is_empty() {
                continue;
            }
            let trial = tracing.of_any(&thinned(pixels, most));
            let (area, times) = (pixels.len() as f64, f64::from(times));
            bare.error +=
                area * error(&trial, &means(std::slice::from_ref(&trial))) / times.powf(OUTLINE_SLOPE);
            bare.cost += area * times * f64::from(SAMPLES) * BARE_COST;
            bare.rays.add(&trial.rays);
        }
        bare
    }
}

/// The means of all trials, by pixel.
pub(super) fn means(trials: &[Trial]) -> Vec<f64> {
    let pixels = trials.first().map_or(0, |t| t.pixels.len());
    let sum = |i: usize| trials.iter().map(|t| t.pixels[i].mean).sum::<f64>();
    (0..pixels).map(|i| sum(i) / trials.len() as f64).collect()
}

/// The mean over pixels of their squared errors, relative to their `means` as in relMSE.
pub(super) fn error(trial: &Trial, means: &[f64]) -> f64 {
    let pixels = means.len().max(1) as f64;
    let mean = means.iter().sum::<f64>() / pixels;
    let squares = trial.pixels.iter().zip(means).map(|(p, m)| {
        // Of what is black altogether there is no relative error.
        if p.variance == 0.0 { 0.0 } else { p.variance / (m * m + EPSILON * mean * mean) }
    });
    squares.sum::<f64>() / pixels
}

/// The number of the trial by whose strategy a picture of `area` such pixels and the bare ones comes to the same error with
/// the fewest rays. Variances are weighed as relative errors are, by a mean over all trials, so that no trial is favoured by
/// its own noise.
pub(super) fn best(trials: &[Trial], area: f64, bare: &Bare) -> usize {
    let means = means(trials);
    let pixels = means.len().max(1) as f64;
    let score = |t: &Trial| {
        let error = area * error(t, &means) + bare.error;
        error * (area * t.cost / pixels + bare.cost).powf(SLOPE)
    };
    let scores = (0..).zip(trials).map(|(i, t)| (score(t) * if i == 0 { MARGIN } else { 1.0 }, i));
    scores.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0, |s| s.1)
}
