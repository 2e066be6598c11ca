//! Where a film's sums lie: columns, so that what no sample has gone to takes no room and no time. Memory comes zeroed
//! from the system, page by page when it is first written to, and a film of one replicate has no second half.

use super::PixelSums;
use std::ops::Range;

/// The sums of all pixels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Store {
    /// Red, green and blue of the even replicates, and alpha of all.
    first: Vec<[i64; 4]>,
    /// Samples of the even replicates.
    counts: Vec<u32>,
    /// Red, green and blue of the odd replicates; empty until there are any.
    second: Vec<[i64; 3]>,
    /// Their samples.
    second_counts: Vec<u32>,
}

impl Store {
    /// Sums of zero for `n` pixels.
    pub fn new(n: usize) -> Self {
        Store { first: vec![[0; 4]; n], counts: vec![0; n], second: Vec::new(), second_counts: Vec::new() }
    }

    pub fn len(&self) -> usize {
        self.first.len()
    }

    /// The sums of one pixel.
    #[inline]
    pub fn get(&self, at: usize) -> PixelSums {
        let [r, g, b, alpha] = self.first[at];
        let second = self.second.get(at).copied().unwrap_or_default();
        let count = self.second_counts.get(at).copied().unwrap_or_default();
        PixelSums { halves: [[r, g, b], second], alpha, counts: [self.counts[at], count] }
    }

    /// Of all pixels.
    pub fn iter(&self) -> impl Iterator<Item = PixelSums> {
        (0..self.len()).map(|at| self.get(at))
    }

    /// Room for the odd replicates.
    fn widen(&mut self) {
        self.second.resize(self.first.len(), [0; 3]);
        self.second_counts.resize(self.first.len(), 0);
    }

    /// Adds to the sums of a pixel.
    #[inline]
    pub fn add(&mut self, at: usize, more: &PixelSums) {
        let has_second = more.counts[1] > 0 || more.halves[1] != [0; 3];
        if has_second && self.second.is_empty() {
            self.widen();
        }
        let mut sums = self.get(at);
        sums.merge(more);
        let [[r, g, b], second] = sums.halves;
        self.first[at] = [r, g, b, sums.alpha];
        self.counts[at] = sums.counts[0];
        if !self.second.is_empty() {
            (self.second[at], self.second_counts[at]) = (second, sums.counts[1]);
        }
    }

    /// Adds to a row of pixels, by samples of even replicates alone. Where they are `fresh`, nothing is added up: memory that
    /// is read before it is written to costs the system a second visit.
    #[inline]
    pub fn add_first(&mut self, range: Range<usize>, sums: &[[i64; 4]], counts: &[u32], fresh: bool) {
        if fresh {
            self.first[range.clone()].copy_from_slice(sums);
            self.counts[range].copy_from_slice(counts);
            return;
        }
        for (mine, more) in self.first[range.clone()].iter_mut().zip(sums) {
            (0..4).for_each(|c| mine[c] = mine[c].saturating_add(more[c]));
        }
        for (mine, more) in self.counts[range].iter_mut().zip(counts) {
            *mine = mine.saturating_add(*more);
        }
    }

    /// Adds those of as many pixels.
    pub fn merge(&mut self, other: &Store) {
        for (at, sums) in other.iter().enumerate() {
            self.add(at, &sums);
        }
    }
}
