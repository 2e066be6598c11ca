//! What the reference implementation prints about a map.

/// Statistics of a map of errors. Quantiles are weighted by the errors themselves: pixels above the weighted median hold
/// half of the whole error (Andersson et al. 2020, section 6).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summary {
    /// Smallest error.
    pub min: f32,
    /// First weighted quartile.
    pub quartile1: f32,
    /// Weighted median.
    pub median: f32,
    /// Third weighted quartile.
    pub quartile3: f32,
    /// Largest error.
    pub max: f32,
}

/// The upper half of a float's bits orders non-negative floats into so many classes.
const CLASSES: usize = 1 << 16;

impl Summary {
    /// Of a map that is not empty, of finite errors from 0. All zero where there is no error.
    pub fn new(map: &[f32]) -> Self {
        let (mut min, mut max) = (f32::INFINITY, 0.0f32);
        let mut sums = vec![0.0f64; CLASSES];
        for v in map {
            (min, max) = (min.min(*v), max.max(*v));
            sums[(v.to_bits() >> 16) as usize] += f64::from(*v);
        }
        let total: f64 = sums.iter().sum();
        let [quartile1, median, quartile3] = [0.25, 0.5, 0.75].map(|part| quantile(map, &sums, part * total));
        Summary { min, quartile1, median, quartile3, max }
    }
}

/// The error at which the running sum of all errors, in order of size, goes beyond `goal`.
fn quantile(map: &[f32], sums: &[f64], goal: f64) -> f32 {
    let mut below = 0.0;
    for (class, sum) in sums.iter().enumerate() {
        if below + sum > goal {
            let mut inside: Vec<f32> =
                map.iter().copied().filter(|v| (v.to_bits() >> 16) as usize == class).collect();
            inside.sort_unstable_by(f32::total_cmp);
            let last = inside[inside.len() - 1];
            return inside
                .into_iter()
                .find(|v| {
                    below += f64::from(*v);
                    below > goal
                })
                .unwrap_or(last);
        }
        below += sum;
    }
    0.0
}
