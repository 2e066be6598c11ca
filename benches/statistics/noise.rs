//! Pictures of synthetic noise, of which the truth is known. Shared with `tests/it/statistics.rs`.

use skylit::compare::statistics::distributions::normal_quantile;
use skylit::compare::statistics::replicates::{Replicates, Spread};
use skylit::sampler::hash::mix64;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// Calls `f` with every number below `n`, on as many threads as there are processors, each of its own: a thread of a pool that
/// waits for a render takes up the next number meanwhile, and another in that, until its stack is full.
pub fn each<T: Send>(n: u64, f: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let next = AtomicU64::new(0);
    let done = Mutex::new(Vec::new());
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    if i >= n {
                        return;
                    }
                    let result = f(i);
                    done.lock().unwrap().push((i, result));
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap();
    done.sort_by_key(|(i, _)| *i);
    done.into_iter().map(|(_, result)| result).collect()
}

/// A stream of numbers.
pub struct Stream(u64);

impl Stream {
    pub fn new(seed: u64) -> Stream {
        Stream(mix64(seed))
    }

    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        ((mix64(self.0) >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }
}

/// Noise of one sample with mean 0 and variance 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Noise {
    Normal,
    /// Exponential, less its mean.
    Skewed,
    /// 50 in one of 2501 samples, else slightly less than 0.
    Firefly,
}

impl Noise {
    fn draw(self, s: &mut Stream) -> f64 {
        match self {
            Noise::Normal => normal_quantile(s.uniform()),
            Noise::Skewed => -s.uniform().ln() - 1.0,
            Noise::Firefly => {
                let p = 1.0 / 2501.0;
                if s.uniform() < p { 50.0 } else { -50.0 * p / (1.0 - p) }
            }
        }
    }
}

/// How channels go together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Colour {
    /// They are the same.
    Grey,
    /// Noise common to all, and some of their own.
    Mixed,
}

/// A picture of brightness 1 in halves of `spp` / 2 samples, or one more in the first. The noise of a sample has a deviation of 0.5 in every eleventh
/// column, of 0.02 to 0.032 in others, and of 0 in the sky at the top.
pub fn picture(side: usize, seed: u64, spp: usize, noise: Noise, colour: Colour) -> Replicates {
    let mut s = Stream::new(seed);
    let deviation = |x: usize, y: usize| match (x, y) {
        (_, y) if y < side / 5 => 0.0,
        (x, _) if x % 11 == 0 => 0.5,
        (x, y) => 0.02 + 0.002 * ((x + y) % 7) as f64,
    };
    let mut half = |samples: usize| {
        let count = samples as f64;
        let pixel = |i: usize| {
            let sigma = deviation(i % side, i / side);
            let mut sum = [0.0; 3];
            // The mean of normal samples is a normal one.
            let (draws, scale) = match noise {
                Noise::Normal => (1, 1.0 / count.sqrt()),
                _ => (samples, 1.0 / count),
            };
            for _ in 0..if sigma > 0.0 { draws } else { 0 } {
                let common = noise.draw(&mut s);
                for (sum, own) in sum.iter_mut().zip([0.1, 0.3, 0.5]) {
                    *sum += match colour {
                        Colour::Grey => common,
                        Colour::Mixed => 0.9 * common + own * noise.draw(&mut s),
                    };
                }
            }
            sum.map(|v| (1.0 + sigma * v * scale) as f32)
        };
        let means: Vec<[f32; 3]> = (0..side * side).map(pixel).collect();
        (means, Some(vec![count as f32; side * side]))
    };
    let parts = vec![half(spp.div_ceil(2)), half(spp / 2)];
    Replicates::of_values([side, side], Spread::Pixels, parts)
}
