//! On synthetic noise, of which the truth is known: rates of false alarms, of finds, and what stands in the sentences.

use super::pair::{Design, Reason};
use super::replicates::{Replicates, Spread};
use super::{Outcome, Place, Question, StatisticalResult, compare, families};
use crate::sampler::hash::mix64;
use rayon::prelude::*;

const SIDE: usize = 48;

/// A stream of numbers.
struct Stream(u64);

impl Stream {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        ((mix64(self.0) >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        super::distributions::normal_quantile(self.uniform())
    }
}

/// Noise of one sample with mean 0 and variance 1.
#[derive(Debug, Clone, Copy)]
enum Noise {
    Normal,
    /// Exponential, less its mean.
    Skewed,
    /// 50 in one of 2501 samples, else slightly less than 0.
    Firefly,
}

impl Noise {
    fn draw(self, s: &mut Stream) -> f64 {
        match self {
            Noise::Normal => s.normal(),
            Noise::Skewed => -s.uniform().ln() - 1.0,
            Noise::Firefly => {
                let p = 1.0 / 2501.0;
                if s.uniform() < p { 50.0 } else { -50.0 * p / (1.0 - p) }
            }
        }
    }
}

/// Colours of light whose noise is drawn.
#[derive(Debug, Clone, Copy)]
enum Colour {
    Grey,
    /// Noise common to all channels, and some of their own.
    Mixed,
}

/// A picture of brightness 1, or thereabouts, in halves of `spp` / 2 samples. The noise of a sample has a deviation of 0.02
/// in some columns, of 0.5 in others, and of 0 in the sky at the top.
fn picture(seed: u64, spp: usize, noise: Noise, colour: Colour) -> Replicates {
    let mut s = Stream(mix64(seed));
    let deviation = |x: usize, y: usize| match (x, y) {
        (_, y) if y < 10 => 0.0,
        (x, _) if x % 11 == 0 => 0.5,
        (x, y) => 0.02 + 0.002 * ((x + y) % 7) as f64,
    };
    let mut half = || {
        let pixel = |i: usize| {
            let (x, y) = (i % SIDE, i / SIDE);
            let sigma = deviation(x, y);
            let mut sum = [0.0; 3];
            for _ in 0..if sigma > 0.0 { spp / 2 } else { 0 } {
                let common = noise.draw(&mut s);
                for (c, sum) in sum.iter_mut().enumerate() {
                    *sum += match colour {
                        Colour::Grey => common,
                        Colour::Mixed => 0.9 * common + [0.1, 0.3, 0.5][c] * noise.draw(&mut s),
                    };
                }
            }
            sum.map(|v| (1.0 + sigma * v / (spp as f64 / 2.0)) as f32)
        };
        let means: Vec<[f32; 3]> = (0..SIDE * SIDE).map(pixel).collect();
        (means, Some(vec![spp as f32 / 2.0; SIDE * SIDE]))
    };
    let parts = vec![half(), half()];
    Replicates::of_values([SIDE, SIDE], Spread::Pixels, parts)
}

fn ask(a: &Replicates, b: &Replicates) -> StatisticalResult {
    compare(a, b, &Question::default()).unwrap()
}

/// Both ends of what `n` trials of probability `p` give but for one case in a hundred million.
fn bounds(n: usize, p: f64) -> [f64; 2] {
    let (n, reach) = (n as f64, 5.7);
    [n * p - reach * (n * p).sqrt(), n * p + reach * (n * p).sqrt() + 4.0]
}

#[test]
fn experiment() {
    for noise in [Noise::Normal, Noise::Skewed, Noise::Firefly] {
        for colour in [Colour::Grey, Colour::Mixed] {
            for spp in [[16, 16], [8, 64]] {
                let n: u64 = 4000;
                let all: Vec<(f64, f64, Vec<f64>)> = (0..n)
                    .into_par_iter()
                    .map(|i| {
                        let [a, b] = [0, 1].map(|k| {
                            picture(2 * i + k + 1000 * spp[0] as u64, spp[k as usize], noise, colour)
                        });
                        let r = ask(&a, &b);
                        (r.p.unwrap(), r.whole.p.unwrap(), r.tiles.iter().filter_map(|t| t.p).collect())
                    })
                    .collect();
                let rate = |f: &dyn Fn(&(f64, f64, Vec<f64>)) -> bool| {
                    all.iter().filter(|a| f(a)).count() as f64 / n as f64
                };
                let tiles: Vec<f64> = all.iter().flat_map(|a| a.2.clone()).collect();
                let u = families::uniformity(&tiles).unwrap();
                println!(
                    "{noise:?} {colour:?} {spp:?}: verdict 1% {:.4} 5% {:.4}; whole {:.4}; simes {:.4}, tiles<.01 {:.4} <.001 {:.5} KS d {:.4} p {:.1e}",
                    rate(&|a| a.0 <= 0.01),
                    rate(&|a| a.0 <= 0.05),
                    rate(&|a| a.1 <= 0.01),
                    rate(&|a| families::simes(&a.2) <= 0.01),
                    tiles.iter().filter(|p| **p <= 0.01).count() as f64 / tiles.len() as f64,
                    tiles.iter().filter(|p| **p <= 0.001).count() as f64 / tiles.len() as f64,
                    u.distance,
                    u.p
                );
            }
        }
    }
}
