//! Relative mean squared error.

use super::{Better, Metric, pointwise};

/// The row of the table.
pub const METRIC: Metric = Metric {
    name: "relmse",
    title: "relMSE",
    doc: "Mean of (test - reference)^2 / (reference^2 + epsilon): dark and bright pixels count alike (Rousselle et al. 2011). Its root is \
          the relative error that `render --target-error` promises. Epsilon is 0.01 of the reference's squared mean, so that exposure \
          does not change it.",
    better: Better::Lower,
    unit: "",
    eval: |input| {
        let (epsilon, note) = input.epsilon();
        Ok(pointwise::outcome(input, note, |r, t| (t - r).powi(2) / (r * r + epsilon)))
    },
};
