//! Choosing among many by weight: built and summed in double, sampled by inversion, which is monotone and so keeps
//! the stratification of the numbers it is given (an alias table would break it).

mod chart;

pub use chart::{ChartCell, ChartDistribution};

/// Largest f64 below one.
const ONE_MINUS: f64 = 1.0 - f64::EPSILON / 2.0;

/// A cumulative distribution with its guide: entry i of `guide` is no later than the item at i / n, and almost always
/// that item itself, so a search from there takes about one step on average whatever the weights (Chen and Asau, "On
/// Generating Random Variates from an Empirical Distribution", 1974).
#[derive(Debug, Clone, Copy)]
struct Guided<'a> {
    /// n + 1 values from 0 to exactly 1, not falling.
    cdf: &'a [f64],
    guide: &'a [u32],
}

impl Guided<'_> {
    /// The item whose interval [cdf[i], cdf[i + 1]) holds `u`, for u in [0, ONE_MINUS].
    #[inline(always)]
    fn search(self, u: f64) -> Choice {
        let n = self.guide.len();
        let start = ((u * n as f64) as usize).min(n - 1);
        let mut index = self.guide[start] as usize;
        while self.cdf[index + 1] <= u {
            index += 1;
        }
        let (low, pmf) = (self.cdf[index], self.cdf[index + 1] - self.cdf[index]);
        Choice { index, pmf, du: ((u - low) / pmf).min(ONE_MINUS) }
    }
}

/// Turns `cdf[1..]` from weights (usable ones) into a cumulative distribution, and fills its guide. Returns the
/// weights' sum; where it is zero or overflows, everything is left zero.
fn accumulate(cdf: &mut [f64], guide: &mut [u32]) -> f64 {
    let mut total = 0.0;
    for c in cdf.iter_mut() {
        total += *c;
        *c = total;
    }
    if !(total > 0.0 && total < f64::INFINITY) {
        cdf.fill(0.0);
        return 0.0;
    }
    // From the last item with a weight on this gives 1: x / x is exact.
    cdf.iter_mut().for_each(|c| *c /= total);
    let n = guide.len() as f64;
    let mut item = 0;
    for (i, g) in guide.iter_mut().enumerate() {
        // Searches for u start at floor(u n), which rounding may have carried past u: start a little earlier.
        let at = i as f64 / n * (1.0 - 8.0 * f64::EPSILON);
        while cdf[item + 1] <= at {
            item += 1;
        }
        *g = item as u32;
    }
    total
}

/// A choice among `n` weighted items.
#[derive(Debug, Clone)]
pub struct Distribution1D {
    cdf: Vec<f64>,
    guide: Vec<u32>,
    total: f64,
}

/// An item chosen, and what is left of the number it was chosen by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// Which item.
    pub index: usize,
    /// Probability of the choice, more than 0.
    pub pmf: f64,
    /// The number rescaled to [0, 1) within the item, uniform again.
    pub du: f64,
}

/// A weight as it counts: what is not a positive finite number weighs nothing.
#[inline]
fn usable(w: f64) -> f64 {
    if w > 0.0 && w < f64::INFINITY { w } else { 0.0 }
}

impl Distribution1D {
    /// From weights; those that are negative or not finite count as zero. `None` if nothing is left, or if the sum
    /// overflows.
    pub fn new(weights: impl IntoIterator<Item = f64>) -> Option<Self> {
        let mut cdf = vec![0.0];
        cdf.extend(weights.into_iter().map(usable));
        let mut guide = vec![0; cdf.len() - 1];
        let total = accumulate(&mut cdf, &mut guide);
        (total > 0.0).then_some(Distribution1D { cdf, guide, total })
    }

    /// Number of items.
    pub fn len(&self) -> usize {
        self.guide.len()
    }

    /// Never true: a distribution has at least one item.
    pub fn is_empty(&self) -> bool {
        false
    }

    /// Sum of the weights.
    pub fn total(&self) -> f64 {
        self.total
    }

    /// Probability of item `index`: exactly the length of the interval that [`Distribution1D::sample`] maps to it.
    /// Zero beyond the last.
    #[inline]
    pub fn pmf(&self, index: usize) -> f64 {
        if index < self.len() { self.cdf[index + 1] - self.cdf[index] } else { 0.0 }
    }

    /// The item at `u` in [0, 1) (clamped to it).
    #[inline]
    pub fn sample(&self, u: f64) -> Choice {
        Guided { cdf: &self.cdf, guide: &self.guide }.search(u.clamp(0.0, ONE_MINUS))
    }

    /// The number that [`Distribution1D::sample`] maps to this item and remainder.
    #[inline]
    pub fn invert(&self, index: usize, du: f64) -> f64 {
        self.cdf[index] + du * self.pmf(index)
    }
}

#[cfg(test)]
mod tests;
