//! Relative mean squared error without the worst pixels.

use super::{Better, Metric, Outcome, pointwise};
use crate::math::rank;

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
        let values = pointwise::counted(input.pair, map);
        let trimmed = (values.len() as f64 * TRIMMED).ceil() as usize;
        // Of a handful of pixels none can be spared.
        let kept = if values.len() < 100 { values.len() } else { values.len() - trimmed };
        let limit = if kept < values.len() { rank::nth(&values, kept) } else { f32::INFINITY };
        let (below, sum) = pointwise::sum_below(&values, limit);
        // Of several that are equal to the first left out, as many are kept as there is room for.
        let equal = if below < kept { (kept - below) as f64 * f64::from(limit) } else { 0.0 };
        let value = (sum + equal) / kept.max(1) as f64;
        let note = format!("{note}; {} pixels left out", values.len() - kept);
        Ok(Outcome { value, channels: Vec::new(), note, map: None })
    },
};
