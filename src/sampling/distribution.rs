//! Choosing among many by weight: built and summed in double, sampled by inversion, which is monotone and so keeps
//! the stratification of the numbers it is given (an alias table would break it).

mod chart;

pub use chart::{ChartCell, ChartDistribution};

/// Largest f64 below one.
const ONE_MINUS: f64 = 1.0 - f64::EPSILON / 2.0;

/// A choice among `n` weighted items.
#[derive(Debug, Clone)]
pub struct Distribution1D {
    /// n + 1 values from 0 to exactly 1, not falling.
    cdf: Vec<f64>,
    /// Entry i: the item at i / n, from where the search starts (Chen and Asau 1974, "cutpoints"): about one step of
    /// search for any weights, on average.
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
        let mut total = 0.0;
        for w in weights {
            total += usable(w);
            cdf.push(total);
        }
        if !(total > 0.0 && total < f64::INFINITY) {
            return None;
        }
        let n = cdf.len() - 1;
        cdf.iter_mut().for_each(|c| *c /= total);
        // Everything from the last item with a weight on is 1 by the division; x / x is exact.
        let mut guide = Vec::with_capacity(n);
        let mut item = 0;
        for i in 0..n {
            let at = i as f64 / n as f64;
            while cdf[item + 1] <= at {
                item += 1;
            }
            guide.push(item as u32);
        }
        Some(Distribution1D { cdf, guide, total })
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
        let u = u.clamp(0.0, ONE_MINUS);
        // u * n may round up to n, and i / n up to above u: the search then steps back.
        let start = ((u * self.len() as f64) as usize).min(self.len() - 1);
        let mut index = self.guide[start] as usize;
        while self.cdf[index] > u {
            index -= 1;
        }
        while self.cdf[index + 1] <= u {
            index += 1;
        }
        let (low, pmf) = (self.cdf[index], self.cdf[index + 1] - self.cdf[index]);
        Choice { index, pmf, du: ((u - low) / pmf).min(ONE_MINUS) }
    }

    /// The number that [`Distribution1D::sample`] maps to this item and remainder.
    #[inline]
    pub fn invert(&self, index: usize, du: f64) -> f64 {
        self.cdf[index] + du * self.pmf(index)
    }
}

#[cfg(test)]
mod tests;
