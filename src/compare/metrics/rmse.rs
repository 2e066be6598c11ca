//! Root mean squared error.

use super::{Better, Metric, Outcome};

/// The row of the table.
pub const METRIC: Metric = Metric {
    name: "rmse",
    title: "RMSE",
    doc: "Root of the MSE, in the unit of the pictures. Four times the samples halve it.",
    better: Better::Lower,
    unit: "",
    eval: |input| {
        let squares = input.squares();
        let value = (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt();
        Ok(Outcome {
            value,
            channels: squares.iter().copied().map(f64::sqrt).collect(),
            ..Outcome::default()
        })
    },
};
