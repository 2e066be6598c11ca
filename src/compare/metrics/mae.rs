//! Mean absolute error.

use super::{Better, Metric, pointwise};

/// The row of the table.
pub const METRIC: Metric = Metric {
    name: "mae",
    title: "MAE",
    doc: "Mean of |test - reference|. Single bright pixels weigh as much as their error, not as its square.",
    better: Better::Lower,
    unit: "",
    eval: |input| Ok(pointwise::outcome(input, String::new(), |r, t| (t - r).abs())),
};
