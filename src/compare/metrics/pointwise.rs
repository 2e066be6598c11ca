//! What measures that look at one pixel at a time share.

use super::{Input, Outcome, mean};
use crate::compare::pair::{CHUNK, Pair};
use crate::math::exact_sum::ExactSum;
use rayon::prelude::*;

/// The mean over pixels that count.
pub fn mean_of(pair: &Pair, values: &[f32]) -> f64 {
    let sums = values.par_chunks(CHUNK).enumerate().map(|(i, part)| {
        let counted = part.iter().enumerate().filter(|(k, _)| pair.counts(i * CHUNK + k));
        counted.map(|(_, v)| f64::from(*v)).collect::<ExactSum>()
    });
    mean(total(sums), pair.count())
}

fn total(sums: impl ParallelIterator<Item = ExactSum>) -> ExactSum {
    sums.reduce(ExactSum::default, |mut a, b| {
        a.merge(b);
        a
    })
}

/// Means of `error(reference, test)` by channel.
pub fn means(pair: &Pair, error: impl Fn(f64, f64) -> f64 + Sync) -> Vec<f64> {
    let count = pair.count();
    let channel = |(r, t): (&Vec<f32>, &Vec<f32>)| {
        let chunks = r.par_chunks(CHUNK).zip(t.par_chunks(CHUNK)).enumerate();
        let sums = chunks.map(|(i, (r, t))| {
            let mut sum = ExactSum::default();
            for (k, (r, t)) in r.iter().zip(t).enumerate() {
                if pair.counts(i * CHUNK + k) {
                    sum.add(error(f64::from(*r), f64::from(*t)));
                }
            }
            sum
        });
        mean(total(sums), count)
    };
    pair.reference.iter().zip(&pair.test).map(channel).collect()
}

/// The mean of `error(reference, test)` over channels, for each pixel; 0 where it does not count.
pub fn map(pair: &Pair, error: impl Fn(f64, f64) -> f64 + Sync) -> Vec<f32> {
    let mut out = vec![0.0; pair.pixels()];
    out.par_chunks_mut(CHUNK).enumerate().for_each(|(i, out)| {
        for (k, out) in out.iter_mut().enumerate() {
            let at = i * CHUNK + k;
            if pair.counts(at) {
                let channels = pair.reference.iter().zip(&pair.test);
                let sum: f64 = channels.map(|(r, t)| error(f64::from(r[at]), f64::from(t[at]))).sum();
                *out = (sum / pair.channels.len() as f64) as f32;
            }
        }
    });
    out
}

/// Values of the pixels that count.
pub fn counted(pair: &Pair, map: Vec<f32>) -> Vec<f32> {
    match &pair.counted {
        None => map,
        Some(counted) => map.into_iter().zip(counted).filter(|(_, c)| **c).map(|(v, _)| v).collect(),
    }
}

/// How many values are below a limit, and their sum.
pub fn sum_below(values: &[f32], limit: f32) -> (usize, f64) {
    let parts = values.par_chunks(CHUNK).map(|part| {
        let below = part.iter().filter(|v| **v < limit);
        (below.clone().count(), below.map(|v| f64::from(*v)).collect::<ExactSum>())
    });
    let (count, sum) = parts.reduce(Default::default, |(n, mut a), (m, b)| {
        a.merge(b);
        (n + m, a)
    });
    (count, sum.value())
}

/// The usual figure: means by channel, and the mean of these.
pub fn outcome(input: &Input, note: String, error: impl Fn(f64, f64) -> f64 + Sync) -> Outcome {
    let channels = means(input.pair, &error);
    let value = channels.iter().sum::<f64>() / channels.len().max(1) as f64;
    Outcome { value, channels, note, map: input.maps.then(|| map(input.pair, error)) }
}
