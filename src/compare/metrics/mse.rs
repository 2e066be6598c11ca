//! Mean squared error.

use super::{Better, Metric, pointwise};

/// The row of the table.
pub const METRIC: Metric = Metric {
    name: "mse",
    title: "MSE",
    doc: "Mean of (test - reference)^2: variance and squared bias together. Bright pixels rule it; relMSE weighs them by how bright \
          they should be.",
    better: Better::Lower,
    unit: "",
    eval: |input| Ok(pointwise::outcome(input, String::new(), |r, t| (t - r).powi(2))),
};
