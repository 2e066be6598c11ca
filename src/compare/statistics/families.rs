//! What many probabilities say together.

use super::Question;
use super::distributions::kolmogorov_tail;
use super::replicates::Replicates;
use super::results::FamilyLine;
use std::f64::consts::PI;

/// The probability of Simes (1986): the least of n p_k / k over the sorted p_k. Uniform for independent p; for tests that go
/// together as parts of a picture do it is too large rather than too small. 1 for none.
pub fn simes(ps: &[f64]) -> f64 {
    let mut sorted = ps.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = ps.len() as f64;
    sorted.iter().enumerate().map(|(k, p)| n * p / (k + 1) as f64).fold(1.0, f64::min)
}

/// Those that are rejected while, of what is rejected, at most `level` is expected to be so by chance (Benjamini and Hochberg
/// 1995); in the order they were given.
pub fn benjamini_hochberg(ps: &[f64], level: f64) -> Vec<bool> {
    let mut sorted = ps.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = ps.len() as f64;
    let fits = |(k, p): (usize, &f64)| (*p <= level * (k + 1) as f64 / n).then_some(*p);
    let largest = sorted.iter().enumerate().filter_map(fits).next_back();
    ps.iter().map(|p| largest.is_some_and(|l| *p <= l)).collect()
}

/// One probability from several with weights that add up to 1: the tail of a Cauchy variable at the weighted sum of
/// tan((1/2 - p) pi) (Liu and Xie 2020). Exact for independent p and for p that are the same, and nearly so in the tail for
/// any that go together, where Bonferroni's sum would be too careful: the whole picture's p goes with its tiles'.
pub fn combined(ps: &[(f64, f64)]) -> f64 {
    // 1 / (p pi) is the tangent where p is so small that 1/2 - p forgets it.
    let term = |p: f64| if p < 1e-8 { 1.0 / (p.max(1e-300) * PI) } else { ((0.5 - p) * PI).tan() };
    // A p of exactly 1 would veto whatever the others say.
    let sum: f64 = ps.iter().map(|(weight, p)| weight * term(p.min(1.0 - 1e-4))).sum();
    if sum > 1e8 { 1.0 / (sum * PI) } else { 0.5 - sum.atan() / PI }
}

/// What each family counts for the verdict.
pub(super) struct Weights {
    pub whole: f64,
    pub tiles: f64,
    pub regions: f64,
}

impl Weights {
    /// Alike for those that there are.
    pub fn of(reference: &Replicates, question: &Question) -> Weights {
        let has_tiles = reference.size[0].max(reference.size[1]) > question.tile;
        let has_regions = reference.objects.is_some() || !question.masks.is_empty();
        let families = 1.0 + f64::from(u8::from(has_tiles)) + f64::from(u8::from(has_regions));
        let share = |has: bool| if has { 1.0 / families } else { 0.0 };
        Weights { whole: share(true), tiles: share(has_tiles), regions: share(has_regions) }
    }

    /// Those that have something to say, with their weights scaled to 1, and their combination; from the probabilities of
    /// the whole, the tiles and the other regions.
    pub fn verdict(&self, [whole, tiles, regions]: [Vec<f64>; 3]) -> (Vec<FamilyLine>, Option<f64>) {
        let named =
            [("whole", self.whole, whole), ("tiles", self.tiles, tiles), ("objects", self.regions, regions)];
        let mut lines: Vec<FamilyLine> = named
            .into_iter()
            .filter(|(_, weight, ps)| *weight > 0.0 && !ps.is_empty())
            .map(|(name, weight, ps)| FamilyLine { name, tests: ps.len(), weight, p: simes(&ps) })
            .collect();
        let sum: f64 = lines.iter().map(|l| l.weight).sum();
        lines.iter_mut().for_each(|l| l.weight /= sum);
        let terms: Vec<(f64, f64)> = lines.iter().map(|l| (l.weight, l.p)).collect();
        let p = (!terms.is_empty()).then(|| combined(&terms));
        (lines, p)
    }
}

/// How p-values of parts without a difference are spread over 0 to 1.
#[derive(Debug, Clone, PartialEq, Default, serde::Serialize)]
pub struct Uniformity {
    /// How many p-values.
    pub values: usize,
    /// Kolmogorov's distance from the uniform distribution.
    pub distance: f64,
    /// How often chance alone brings as much or more.
    pub p: f64,
    /// p-values by twentieths of 0 to 1.
    pub histogram: Vec<usize>,
}

/// Bars of a histogram.
pub const BINS: usize = 20;

/// Whether p-values are uniform; `None` for less than five, which could not show it.
pub fn uniformity(ps: &[f64]) -> Option<Uniformity> {
    if ps.len() < 5 {
        return None;
    }
    let mut sorted = ps.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = ps.len() as f64;
    let off = |(i, p): (usize, &f64)| (p - i as f64 / n).abs().max(((i + 1) as f64 / n - p).abs());
    let distance = sorted.iter().enumerate().map(off).fold(0.0, f64::max);
    let mut histogram = vec![0; BINS];
    ps.iter().for_each(|p| histogram[((p * BINS as f64) as usize).min(BINS - 1)] += 1);
    Some(Uniformity { values: ps.len(), distance, p: kolmogorov_tail(distance, ps.len()), histogram })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampler::hash::mix64;

    #[test]
    fn simes_and_benjamini_hochberg_agree() {
        // The example of Benjamini and Hochberg (1995), section 3.2: at 5 % the four smallest of fifteen.
        let ps = [
            0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459, 0.3240, 0.4262, 0.5719,
            0.6528, 0.7590, 1.0,
        ];
        assert_eq!(benjamini_hochberg(&ps, 0.05).iter().filter(|r| **r).count(), 4);
        assert!((simes(&ps) - 0.0015).abs() < 1e-12);
        assert_eq!((simes(&[]), benjamini_hochberg(&[], 0.05).len()), (1.0, 0));
        assert_eq!(benjamini_hochberg(&[0.5, 0.002, 0.9, 0.004], 0.01), [false, true, false, true]);
    }

    #[test]
    fn combinations_keep_the_level() {
        let uniform = |i: u64, k: u64| (mix64(mix64(i).wrapping_add(k)) >> 11) as f64 / (1u64 << 53) as f64;
        let weights = [0.5, 0.3, 0.2];
        let count = |p: &dyn Fn(u64) -> [f64; 3]| {
            let below =
                |i: &u64| combined(&std::array::from_fn::<_, 3, _>(|k| (weights[k], p(*i)[k]))) <= 0.01;
            (0..100_000).filter(below).count() as f64
        };
        // Independent, and the same: 1 % of 100,000, to four deviations.
        assert!((count(&|i| [0, 1, 2].map(|k| uniform(i, k))) - 1000.0).abs() < 126.0);
        assert!((count(&|i| [uniform(i, 0); 3]) - 1000.0).abs() < 126.0);
        assert!((combined(&[(0.5, 1e-30), (0.5, 0.7)]) / 2e-30 - 1.0).abs() < 1e-6);
        assert!(combined(&[(0.5, 0.0), (0.5, 1.0)]) < 1e-290);
    }

    #[test]
    fn what_is_not_uniform_is_seen() {
        let even: Vec<f64> = (0..200).map(|i| (f64::from(i) + 0.5) / 200.0).collect();
        let fine = uniformity(&even).unwrap();
        assert!(fine.p > 0.99 && fine.histogram.iter().all(|n| *n == 10));
        let bent: Vec<f64> = even.iter().map(|p| p * p).collect();
        assert!(uniformity(&bent).unwrap().p < 1e-6);
        assert!(uniformity(&even[..4]).is_none());
    }
}
