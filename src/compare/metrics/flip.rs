//! FLIP of what a display shows.

use super::{Better, Input, Metric, Outcome, Skipped, pointwise};
use crate::compare::flip::ldr;
use crate::compare::pair::Side;

/// The row of the table.
pub const METRIC: Metric = Metric {
    name: "flip",
    title: "FLIP",
    doc: "How much of a difference a viewer sees who flips between the two on a display (Andersson et al. 2020): colours and edges, after \
          what eyes blur at that distance; mean over pixels from 0 (none) to 1. Radiance is cut off at a display's white: brighten or \
          darken by --exposure, or see HDR-FLIP.",
    better: Better::Lower,
    unit: "",
    eval: |input| {
        let [Some(reference), Some(test)] =
            [Side::Reference, Side::Test].map(|s| input.pair.display_colors(s))
        else {
            return Err(no_colors());
        };
        let ppd = input.options.pixels_per_degree;
        let found = ldr(input.pair.size, reference, test, ppd).map_err(|e| Skipped(e.to_string()))?;
        Ok(outcome(input, found.map, format!("{ppd:.2} pixels a degree, {}", on_display(input))))
    },
};

pub(super) fn no_colors() -> Skipped {
    Skipped("the channels are no colours".into())
}

fn on_display(input: &Input) -> &'static str {
    match input.pair.space {
        crate::compare::pair::Space::Linear => "sRGB-encoded, cut off at 1",
        crate::compare::pair::Space::Display => "as encoded",
    }
}

/// The mean of a map over pixels that count.
pub(super) fn outcome(input: &Input, map: Vec<f32>, note: String) -> Outcome {
    let value = pointwise::mean_of(input.pair, &map);
    Outcome { value, channels: Vec::new(), note, map: input.maps.then_some(map) }
}
