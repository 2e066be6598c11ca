//! Mean absolute relative error.

use super::{Better, Metric, pointwise};

/// The row of the table.
pub const METRIC: Metric = Metric {
    name: "mape",
    title: "MAPE",
    doc: "Mean of |test - reference| / (|reference| + root of epsilon), in percent: how far a pixel is off, as a part of itself.",
    better: Better::Lower,
    unit: "%",
    eval: |input| {
        let (epsilon, note) = input.epsilon();
        let floor = epsilon.sqrt();
        let error = move |r: f64, t: f64| 100.0 * (t - r).abs() / (r.abs() + floor);
        Ok(pointwise::outcome(input, note, error))
    },
};
