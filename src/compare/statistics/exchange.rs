//! Halves dealt anew: what is known of a difference if both pictures are of the same, and nothing else.
//!
//! Where both pictures have the same samples and the same noise, whatever that is, the four halves of a pixel might as well
//! have been dealt to them in any other way. With the reference's a, a' and the test's b, b' the difference
//! (b + b' - a - a') / 2 is, given the four, one of three [contrasts](Pair::contrasts) with either sign, all six equally
//! likely (Pitman 1937, "Significance Tests Which May be Applied to Samples from Any Populations"), and independent of other
//! pixels. Halves with unlike numbers of samples are dealt only for their like: two contrasts.
//!
//! So the difference D of some pixels has, exactly, the mean 0 and the covariance U = sum of the mean outer products of each
//! pixel's contrasts, D itself among them. Where nothing differs that is what the halves' spread says of it, too, without
//! bias; but U knows of light that both halves of one picture found and neither of the other's, and V of
//! [`super::region`] does not.
//!
//! # Tails
//!
//! With contrasts a, b, c along any direction, (a^2k + b^2k + c^2k) / 3 <= (2k - 1)!! ((a^2 + b^2 + c^2) / 3)^k (equal for k = 2
//! where two of them are 0): moments are at most those of a normal variable of the same variance, and so are their sum's. As
//! E exp(s D' U^-1 D / 2) is the mean of E exp(sqrt(s) g' U^-1/2 D) over normal g, D' U^-1 D has no larger moments than
//! chi-square with as many degrees of freedom as U has directions: that one's probability is right for many pixels alike, and
//! careful where a few have the noise. How careful, [`super::deals`] finds out.

use super::lens::Lens;
use super::matrix::{Mat, dot, eigen};
use super::pair::{Design, Pair};
use super::replicates::{Replicates, Spread};

/// Contrasts of a pixel at most.
pub const WAYS: usize = 3;

impl Pair<'_> {
    /// How many contrasts a pixel has: 3, or 2; 0 if there is no dealing, as pictures do not have halves each, with as many
    /// samples as the other's, or noise of their own.
    pub(super) fn count_ways(&self) -> usize {
        let sides = [self.reference, self.test];
        let has_halves = sides.iter().all(|r| r.len().is_multiple_of(2) && r.spread == Spread::Pixels);
        if self.design != Design::Independent || !has_halves || sides[0].len() != sides[1].len() {
            return 0;
        }
        let mut ways = WAYS;
        for pixel in 0..self.pixels() {
            let [a, b] = sides.map(|r| [0, 1].map(|h| half(r, h, pixel).1));
            // A pixel that has no spread is left out.
            if a[0].min(a[1]).min(b[0]).min(b[1]) <= 0.0 {
                continue;
            }
            match (a == b, a[0] == a[1]) {
                (false, _) => return 0,
                (_, false) => ways = 2,
                _ => {}
            }
        }
        ways
    }

    /// The difference of a pixel as its halves are, and, but for signs, as they might have been dealt. The third is 0 where
    /// there are but two.
    pub(super) fn contrasts(&self, pixel: usize) -> [[f64; 3]; WAYS] {
        let [(a, m), (a2, n)] = [0, 1].map(|h| half(self.reference, h, pixel));
        let [(b, _), (b2, _)] = [0, 1].map(|h| half(self.test, h, pixel));
        let (m, n) = (m / (m + n), n / (m + n));
        let make = |f: &dyn Fn(usize) -> f64| [0, 1, 2].map(f);
        let across = |sign: f64| make(&|c| m * (b[c] - a[c]) + sign * n * (b2[c] - a2[c]));
        let within = || make(&|c| 0.5 * ((a[c] - a2[c]) + (b[c] - b2[c])));
        [across(1.0), across(-1.0), if self.ways == WAYS { within() } else { [0.0; 3] }]
    }
}

/// The mean of every other replicate, and its samples: of two, one or the other.
fn half(of: &Replicates, h: usize, pixel: usize) -> ([f64; 3], f64) {
    if of.len() == 2 {
        return of.value(h, pixel);
    }
    let (mut mean, mut count) = ([0.0; 3], 0.0);
    for (value, n) in (h..of.len()).step_by(2).map(|part| of.value(part, pixel)).filter(|(_, n)| *n > 0.0) {
        count += n;
        (0..3).for_each(|c| mean[c] += n / count * (value[c] - mean[c]));
    }
    (mean, count)
}

/// Rows that make U round, within the directions that have noise.
pub fn whiten(covariance: &Mat, lens: &Lens) -> Vec<[f64; 3]> {
    let mut inside: Mat = [[0.0; 3]; 3];
    for (i, a) in lens.white.iter().enumerate() {
        for (j, b) in lens.white.iter().enumerate() {
            inside[i][j] = dot(covariance.map(|row| dot(row, *b)), *a);
        }
    }
    let row = |v: [f64; 3], value: f64| {
        [0, 1, 2].map(|c| lens.white.iter().zip(v).map(|(a, v)| v * a[c]).sum::<f64>() / value.sqrt())
    };
    let with_noise = eigen(&inside).into_iter().take(lens.white.len()).filter(|e| e.value > 0.0);
    with_noise.map(|e| row(e.vector, e.value)).collect()
}
