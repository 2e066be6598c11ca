//! Signed mean error.

use super::{Better, Metric, pointwise};

/// The row of the table.
pub const METRIC: Metric = Metric {
    name: "bias",
    title: "bias",
    doc: "Mean of test minus reference. Noise averages out of it, so what stays is light that one of the two has too much of: \
          --statistical tells whether it is more than noise.",
    better: Better::Zero,
    unit: "",
    eval: |input| Ok(pointwise::outcome(input, String::new(), |r, t| t - r)),
};
