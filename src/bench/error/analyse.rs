//! What a record says: errors with confidence intervals, slopes, times to an error, and speed-ups at equal error.

use super::measure::PixelSet;
use super::record::{Point, ReferenceRecord, Run, Series};
use crate::sampler::hash::mix64;

/// Resamplings of the runs behind each interval.
const RESAMPLES: u64 = 2000;

/// A figure and the 95 % interval that it lies in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interval {
    /// The estimate.
    pub value: f64,
    /// The interval's ends.
    pub low: f64,
    /// See `low`.
    pub high: f64,
}

/// A point of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Samples a pixel.
    pub spp: u64,
    /// Median of the runs.
    pub seconds: f64,
    /// Mean squared error, the reference's noise taken off.
    pub mse: f64,
    /// Relative mean squared error, likewise.
    pub relmse: Interval,
    /// Mean over runs and pixels of luminance minus the reference's, over the reference's mean luminance.
    pub bias: Interval,
    /// 1 / (relmse seconds).
    pub efficiency: f64,
}

fn mean(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = values.clone().count() as f64;
    values.sum::<f64>() / n
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    (values[(n - 1) / 2] + values[n / 2]) / 2.0
}

/// What is at least a part of the measured error: a reference that is noisier than the picture says nothing more.
const LEAST: f64 = 1e-3;

fn without_noise(measured: f64, noise: f64) -> f64 {
    (measured - noise).max(LEAST * measured)
}

/// Quantile of Student's t at 97.5 %, by degrees of freedom (Abramowitz and Stegun, 26.7.5: expansion about the normal
/// quantile, within 1 % from 3 degrees on; tabulated below).
fn t_quantile(df: usize) -> f64 {
    const Z: f64 = 1.959_964;
    let n = df as f64;
    match df {
        0 => f64::INFINITY,
        1 => 12.706,
        2 => 4.303,
        _ => {
            let z3 = Z.powi(3);
            Z + (z3 + Z) / (4.0 * n) + (5.0 * Z.powi(5) + 16.0 * z3 + 3.0 * Z) / (96.0 * n * n)
        }
    }
}

/// The mean with its interval by Student's t.
fn by_student(values: &[f64]) -> Interval {
    let value = mean(values.iter().copied());
    let squares: f64 = values.iter().map(|v| (v - value).powi(2)).sum();
    let n = values.len() as f64;
    let half =
        if n > 1.0 { t_quantile(values.len() - 1) * (squares / (n - 1.0) / n).sqrt() } else { f64::INFINITY };
    Interval { value, low: value - half, high: value + half }
}

/// A curve of error against time.
pub struct Curve<'a> {
    series: &'a Series,
    reference: &'a ReferenceRecord,
    set: PixelSet,
}

impl<'a> Curve<'a> {
    /// Of one series, over one set of pixels.
    pub fn new(series: &'a Series, reference: &'a ReferenceRecord, set: PixelSet) -> Self {
        Curve { series, reference, set }
    }

    /// The figures of each sample count.
    pub fn estimates(&self) -> Vec<Estimate> {
        self.series.points.iter().map(|p| self.estimate(p)).collect()
    }

    fn estimate(&self, p: &Point) -> Estimate {
        let errors = |r: &Run| *r.errors.get(self.set);
        let noise = self.reference.noise.map(|n| *n.get(self.set)).unwrap_or_default();
        let relative = by_student(&p.runs.iter().map(|r| errors(r).relmse).collect::<Vec<_>>());
        let shift = |v: f64| without_noise(v, noise.relmse);
        let relmse =
            Interval { value: shift(relative.value), low: shift(relative.low), high: shift(relative.high) };
        let scale = 1.0 / self.reference.luminance.abs().max(f64::MIN_POSITIVE);
        let bias = by_student(&p.runs.iter().map(|r| errors(r).bias * scale).collect::<Vec<_>>());
        let seconds = median(p.runs.iter().map(|r| r.seconds).collect());
        Estimate {
            spp: p.spp,
            seconds,
            mse: without_noise(mean(p.runs.iter().map(|r| errors(r).mse)), noise.mse),
            relmse,
            bias,
            efficiency: 1.0 / (relmse.value * seconds),
        }
    }

    /// Seconds and relative squared error of each point, in logarithms, of all runs or of those drawn by `pick`.
    fn logs(&self, pick: impl Fn(usize, usize) -> usize) -> Vec<[f64; 2]> {
        let noise = self.reference.noise.map_or(0.0, |n| n.get(self.set).relmse);
        let point = |(k, p): (usize, &Point)| {
            let n = p.runs.len();
            let runs: Vec<&Run> = (0..n).map(|i| &p.runs[pick(k, i) % n]).collect();
            let error = mean(runs.iter().map(|r| r.errors.get(self.set).relmse));
            let seconds = median(runs.iter().map(|r| r.seconds).collect());
            [seconds.ln(), without_noise(error, noise).max(f64::MIN_POSITIVE).ln()]
        };
        self.series.points.iter().enumerate().map(point).collect()
    }

    /// Exponent with which the squared error falls with the number of samples: -1 for independent ones. By least squares
    /// over all points; NaN for fewer than two.
    pub fn slope(&self) -> f64 {
        let logs = self.logs(|_, i| i);
        let x: Vec<f64> = self.series.points.iter().map(|p| (p.spp as f64).ln()).collect();
        let (mx, my) = (mean(x.iter().copied()), mean(logs.iter().map(|l| l[1])));
        let above: f64 = x.iter().zip(&logs).map(|(x, l)| (x - mx) * (l[1] - my)).sum();
        above / x.iter().map(|x| (x - mx).powi(2)).sum::<f64>()
    }

    /// Seconds until the root of the relative squared error is `error`; between points by straight lines in logarithms,
    /// beyond them along the nearest, which [`Reach::beyond`] tells. None for fewer than two points.
    pub fn time_to(&self, error: f64) -> Option<Reach> {
        time_at(&self.logs(|_, i| i), 2.0 * error.ln())
    }
}

/// When a curve reaches an error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach {
    /// Seconds.
    pub seconds: f64,
    /// Whether no measured point lies on both sides of it.
    pub beyond: bool,
}

/// Along a curve of (ln seconds, ln error).
fn time_at(logs: &[[f64; 2]], level: f64) -> Option<Reach> {
    let last = logs.len().checked_sub(2)?;
    let crosses = |w: &&[[f64; 2]]| w[0][1] >= level && level >= w[1][1];
    let found = logs.windows(2).find(crosses);
    let beyond = found.is_none();
    let pair = found.unwrap_or_else(|| if level > logs[0][1] { &logs[..2] } else { &logs[last..] });
    let [[t0, e0], [t1, e1]] = [pair[0], pair[1]];
    // A curve that does not fall never gets there.
    let ln = if e1 < e0 { t0 + (level - e0) / (e1 - e0) * (t1 - t0) } else { f64::INFINITY };
    Some(Reach { seconds: ln.exp(), beyond })
}

/// How many times less time `fast` takes than `slow` to the same error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpeedUp {
    /// The ratio of times.
    pub ratio: Interval,
    /// The root of the relative squared error at which they are compared.
    pub error: f64,
    /// Whether one of the curves had to be continued to that error.
    pub beyond: bool,
}

/// At the error in the middle (in logarithms) of what both curves span; if they span nothing in common, in the middle
/// between. The interval is that of a bootstrap over the runs of each point (Efron and Tibshirani, "An Introduction to
/// the Bootstrap", 1993, ch. 13).
pub fn speed_up(slow: &Curve, fast: &Curve) -> Option<SpeedUp> {
    let all = |c: &Curve| c.logs(|_, i| i);
    let (a, b) = (all(slow), all(fast));
    let span = |c: &[[f64; 2]]| {
        let fold = |(lo, hi): (f64, f64), l: &[f64; 2]| (lo.min(l[1]), hi.max(l[1]));
        c.iter().fold((f64::INFINITY, f64::NEG_INFINITY), fold)
    };
    let ((a_low, a_high), (b_low, b_high)) = (span(&a), span(&b));
    let level = 0.5 * (a_low.max(b_low) + a_high.min(b_high));
    let ratio = |a: &[[f64; 2]], b: &[[f64; 2]]| {
        let (slow, fast) = (time_at(a, level)?, time_at(b, level)?);
        let ratio = slow.seconds / fast.seconds;
        (!ratio.is_nan()).then_some((ratio, slow.beyond || fast.beyond))
    };
    // Where errors grow with time, as a few bright pixels may make it look, a curve meets a level never or everywhere.
    let (value, beyond) = ratio(&a, &b).filter(|(ratio, _)| ratio.is_normal())?;
    let mut drawn: Vec<f64> = (0..RESAMPLES)
        .filter_map(|k| {
            let pick = |side: u64| {
                move |point: usize, i: usize| {
                    mix64(mix64(2 * k + side) ^ ((point as u64) << 32 | i as u64)) as usize >> 8
                }
            };
            ratio(&slow.logs(pick(0)), &fast.logs(pick(1))).map(|r| r.0)
        })
        .collect();
    drawn.sort_by(f64::total_cmp);
    let at = |q: f64| drawn[((drawn.len() - 1) as f64 * q).round() as usize];
    Some(SpeedUp {
        ratio: Interval { value, low: at(0.025), high: at(0.975) },
        error: (0.5 * level).exp(),
        beyond,
    })
}
