//! From candidates to a picture: how wrong each candidate is, which to take, and how wrong the result is.

use super::plane::Size;
use super::prepare::{Prepared, State};
use super::regress::Predictions;
use super::{Denoised, Halves};

/// The input as it is, then fits with `k` = 0.5 and with `k` = 1.
const CANDIDATES: usize = 3;

/// Over so many pixels to each side a candidate's errors are pooled before they are compared.
const COMPARE_RADIUS: usize = 3;

/// Over so many pixels to each side candidates are blended, as Rousselle et al. 2012 smooth their maps.
const BLEND_RADIUS: usize = 2;

/// Over so many pixels to each side the result's errors are pooled: what is left of the noise is alike over a
/// window of the fits, so that less would hold one draw only.
const REPORT_RADIUS: usize = 8;

/// Bias is seen where it is so many times its standard error.
const SIGNIFICANT: f32 = 2.0;

/// Two halves of a candidate, in units.
type Pair = [[f32; 3]; 2];

/// Estimate of the squared error of `(f[0] + f[1]) / 2`, by channel, where `f[h]` is what was made of `raw[h]`.
///
/// `f[0]` knows nothing of the noise of `raw[1]`, so `(f[0] - raw[1])^2` is its error and the variance of `raw[1]`,
/// and half of `(raw[0] - raw[1])^2` estimates that; the error of a mean of two is the mean of their errors less a
/// quarter of their distance squared. There is no bias in it, but much noise: it has a meaning only when pooled.
fn squared_error(f: &Pair, raw: &Pair) -> [f32; 3] {
    let square = |v: f32| v * v;
    std::array::from_fn(|c| {
        let across =
            square(f[0][c] - raw[1][c]) + square(f[1][c] - raw[0][c]) - square(raw[0][c] - raw[1][c]);
        across / 2.0 - square(f[0][c] - f[1][c]) / 4.0
    })
}

/// Shares of the candidates, which sum to 1.
type Shares = [f32; CANDIDATES];

struct Selection<'a> {
    prepared: &'a Prepared,
    predictions: &'a Predictions,
}

/// The denoised picture.
pub(super) fn select(input: &Halves, prepared: &Prepared, predictions: &Predictions) -> Denoised {
    let selection = Selection { prepared, predictions };
    let size = prepared.size;
    let shares = blend(size, &selection.best(), &prepared.sound);
    let blended: Vec<Option<Pair>> = (0..size.area()).map(|i| selection.blended(i, &shares[i])).collect();
    let errors = selection.errors(&blended);

    let unit = prepared.unit;
    let mut out = Denoised { color: Vec::new(), error: Vec::new(), outliers: 0, filled: 0 };
    for i in 0..size.area() {
        let plain = input.plain(i);
        let state = prepared.states[i];
        out.outliers += usize::from(state == State::Outlier);
        let keeps = match state {
            State::Sound => shares[i][0] == 1.0,
            State::Outlier => true,
            State::Broken => false,
        };
        let (color, error) = match (blended[i], plain) {
            (Some(pair), _) if !keeps => {
                out.filled += usize::from(state == State::Broken);
                (mean(&pair).map(|v| bounded(f64::from(v) * f64::from(unit))), errors[i])
            }
            (_, Some(plain)) => (plain, errors[i]),
            (_, None) => ([0.0; 3], errors[i]),
        };
        out.color.push(color);
        out.error.push(if keeps && state == State::Outlier {
            std::array::from_fn(|c| own_error(input.color[0][i][c], input.color[1][i][c]))
        } else {
            error.map(|e| bounded(f64::from(e) * f64::from(unit) * f64::from(unit)))
        });
    }
    out
}

/// Within `f32`, whatever the units.
fn bounded(v: f64) -> f32 {
    v.clamp(f64::from(-f32::MAX), f64::from(f32::MAX)) as f32
}

/// Of a pixel that is left as it is and cannot be pooled with others: the variance of its mean.
fn own_error(a: f32, b: f32) -> f32 {
    let d = f64::from(a) - f64::from(b);
    bounded(d * d / 4.0)
}

/// Mean of the halves.
fn mean(pair: &Pair) -> [f32; 3] {
    std::array::from_fn(|c| 0.5 * (pair[0][c] + pair[1][c]))
}

impl Selection<'_> {
    fn raw(&self, i: usize) -> Pair {
        self.prepared.halves.each_ref().map(|half| half[i])
    }

    /// A candidate; `None` where no pixel is like this one.
    fn candidate(&self, number: usize, i: usize) -> Option<Pair> {
        let bandwidth = match number {
            0 => return self.prepared.sound[i].then(|| self.raw(i)),
            1 => 1,
            _ => 0,
        };
        let raw = self.raw(i);
        let fit = |half: usize| {
            let color = self.predictions.color(2 * half + bandwidth, i)?;
            // Slopes may overshoot where it is dark. Light is not negative, unless the film's filter has made it so.
            let negative = self.prepared.sound[i] && raw.iter().flatten().any(|&v| v < 0.0);
            Some(if negative { color } else { color.map(|v| v.max(0.0)) })
        };
        Some([fit(0)?, fit(1)?])
    }

    /// The candidate of least pooled error for each pixel; of equals the one that does less. Errors are shares of the
    /// brightness, lest a bright pixel decides for dark neighbours.
    fn best(&self) -> Vec<usize> {
        let Prepared { size, sound, scale, .. } = self.prepared;
        let pooled: [Vec<Option<f32>>; CANDIDATES] = std::array::from_fn(|number| {
            let error = |i: usize| {
                let pair = self.candidate(number, i).filter(|_| sound[i])?;
                Some(squared_error(&pair, &self.raw(i)).iter().sum::<f32>() / (scale[i] * scale[i]))
            };
            let errors: Vec<f32> = (0..size.area()).map(|i| error(i).unwrap_or(0.0)).collect();
            size.box_means(COMPARE_RADIUS, &errors, sound)
        });
        let best = |i: usize| {
            let error = |number: usize| pooled[number][i].unwrap_or(0.0);
            (1..CANDIDATES).fold(0, |best, number| if error(number) < error(best) { number } else { best })
        };
        (0..size.area()).map(best).collect()
    }

    /// `None` for a pixel about which nothing is known.
    fn blended(&self, i: usize, shares: &Shares) -> Option<Pair> {
        if !self.prepared.sound[i] {
            return self.candidate(2, i);
        }
        let mut sum = [[0.0; 3]; 2];
        for (number, &share) in shares.iter().enumerate().filter(|(_, share)| **share > 0.0) {
            let pair = self.candidate(number, i).unwrap_or_else(|| self.raw(i));
            for (sum, v) in sum.as_flattened_mut().iter_mut().zip(pair.as_flattened()) {
                *sum += share * v;
            }
        }
        Some(sum)
    }

    /// Squared errors of what was blended, pooled, in units squared, and the whole brightness where nothing is known.
    ///
    /// The variance that is left shows in the difference of the halves, and is known well. The estimate of the
    /// whole error has the noise of the input in it, which is far larger than the error. So what it has beyond the
    /// variance, the bias, is believed pixel by pixel only where it stands out from that noise; elsewhere, bias is
    /// the share of variance that it is over all such pixels together.
    fn errors(&self, blended: &[Option<Pair>]) -> Vec<[f32; 3]> {
        let Prepared { size, sound, scale, .. } = self.prepared;
        let mut out = vec![[0.0; 3]; size.area()];
        for c in 0..3 {
            let pool = |of: &dyn Fn(f32, f32) -> f32| {
                let value = |i: usize| {
                    let Some(pair) = blended[i] else { return 0.0 };
                    let d = pair[0][c] - pair[1][c];
                    let variance = d * d / 4.0;
                    let excess = squared_error(&pair, &self.raw(i))[c] - variance;
                    of(variance / (scale[i] * scale[i]), excess / (scale[i] * scale[i]))
                };
                size.box_means(REPORT_RADIUS, &(0..size.area()).map(value).collect::<Vec<f32>>(), sound)
            };
            let variances = pool(&|variance, _| variance);
            let excesses = pool(&|_, excess| excess);
            let squares = pool(&|_, excess| excess * excess);
            // Standard error of a mean over a full square; near the border it is larger by at most a factor of two.
            let side = (2 * REPORT_RADIUS + 1) as f32;
            let stands_out = |i: usize| {
                let (mean, square) = (excesses[i].unwrap_or(0.0), squares[i].unwrap_or(0.0));
                mean > SIGNIFICANT * (square - mean * mean).max(0.0).sqrt() / side
            };
            let hidden = (0..size.area()).filter(|&i| sound[i] && !stands_out(i));
            let (excess, variance) = hidden.fold((0.0, 0.0), |(e, v), i| {
                (e + f64::from(excesses[i].unwrap_or(0.0)), v + f64::from(variances[i].unwrap_or(0.0)))
            });
            let hidden_share = if variance > 0.0 { (excess / variance).max(0.0) as f32 } else { 0.0 };
            for i in 0..size.area() {
                let share = variances[i].map_or(1.0, |variance| match stands_out(i) {
                    true => variance + excesses[i].unwrap_or(0.0),
                    false => variance * (1.0 + hidden_share),
                });
                out[i][c] = share * scale[i] * scale[i];
            }
        }
        out
    }
}

/// Shares of the candidates around each pixel. Their sums are whole numbers, so that a share of one is exactly one.
fn blend(size: Size, best: &[usize], sound: &[bool]) -> Vec<Shares> {
    let mut shares = vec![[0.0; CANDIDATES]; size.area()];
    for number in 0..CANDIDATES {
        let map: Vec<f32> = best.iter().map(|&b| f32::from(u8::from(b == number))).collect();
        for (shares, mean) in shares.iter_mut().zip(size.box_means(BLEND_RADIUS, &map, sound)) {
            shares[number] = mean.unwrap_or(0.0);
        }
    }
    shares
}
