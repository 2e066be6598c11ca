//! Relative mean squared error without the worst pixels.

use super::{Better, Metric, Outcome, mean, pointwise};
use crate::math::exact_sum::ExactSum;

/// The share of pixels that is left out.
const TRIMMED: f64 = 0.001;

/// The row of the table.
pub const METRIC: Metric = Metric {
    name: "relmse-trimmed",
    title: "relMSE, trimmed",
    doc: "relMSE without the 0.1 % of pixels that have the largest: what is left when a few outliers are forgiven. Far below relMSE \
          means that a few pixels make it.",
    better: Better::Lower,
    unit: "",
    eval: |input| {
        let (epsilon, note) = input.epsilon();
        let map = pointwise::map(input.pair, |r, t| (t - r).powi(2) / (r * r + epsilon));
        let counted = map.iter().enumerate().filter(|(i, _)| input.pair.counts(*i));
        let mut values: Vec<f32> = counted.map(|(_, v)| *v).collect();
        let trimmed = (values.len() as f64 * TRIMMED).ceil() as usize;
        // Of a handful of pixels none can be spared.
        let kept = if values.len() < 100 { values.len() } else { values.len() - trimmed };
        if kept < values.len() {
            values.select_nth_unstable_by(kept, f32::total_cmp);
        }
        let sum: ExactSum = values[..kept].iter().map(|v| f64::from(*v)).collect();
        let note = format!("{note}; {} pixels left out", values.len() - kept);
        Ok(Outcome { value: mean(sum, kept), channels: Vec::new(), note, map: None })
    },
};
