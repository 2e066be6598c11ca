//! Mean squared error.

use super::{Better, Metric, Outcome};

/// The row of the table.
pub const METRIC: Metric = Metric {
    name: "mse",
    title: "MSE",
    doc: "Mean of (test - reference)^2: variance and squared bias together. Bright pixels rule it; relMSE weighs them by how bright \
          they should be.",
    better: Better::Lower,
    unit: "",
    eval: |input| {
        let squares = input.squares();
        let value = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
        Ok(Outcome { value, channels: squares.to_vec(), ..Outcome::default() })
    },
};
