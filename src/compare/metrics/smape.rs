//! Symmetric mean absolute relative error.

use super::{Better, Metric, pointwise};

/// The row of the table.
pub const METRIC: Metric = Metric {
    name: "smape",
    title: "SMAPE",
    doc: "Mean of |test - reference| / ((|test| + |reference|) / 2 + root of epsilon), in percent, at most 200: neither picture is taken \
          for the true one, and no outlier counts for more than 200 %.",
    better: Better::Lower,
    unit: "%",
    eval: |input| {
        let (epsilon, note) = input.epsilon();
        let floor = epsilon.sqrt();
        let error = move |r: f64, t: f64| 100.0 * (t - r).abs() / ((r.abs() + t.abs()) / 2.0 + floor);
        Ok(pointwise::outcome(input, note, error))
    },
};
