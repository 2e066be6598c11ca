//! FLIP of radiance.

use super::flip::{no_colors, outcome};
use super::{Better, Metric, Skipped};
use crate::compare::flip::{HdrOptions, hdr};
use crate::compare::pair::{Side, Space};

/// The row of the table.
pub const METRIC: Metric = Metric {
    name: "hdr-flip",
    title: "HDR-FLIP",
    doc: "FLIP of radiance: the largest difference that is seen at any exposure, from one that shows the brightest pixel to one that shows \
          the median (Andersson et al. 2021), under the ACES curve; mean over pixels from 0 to 1.",
    better: Better::Lower,
    unit: "",
    eval: |input| {
        if input.pair.space == Space::Display {
            return Err(Skipped("the values are encoded for a display: FLIP is for them".into()));
        }
        let [Some(reference), Some(test)] = [Side::Reference, Side::Test].map(|s| input.pair.colors(s))
        else {
            return Err(no_colors());
        };
        let options = HdrOptions { ppd: input.options.pixels_per_degree, ..HdrOptions::default() };
        let found = hdr(input.pair.size, reference, test, &options).map_err(|e| Skipped(e.to_string()))?;
        let (first, last) = (found.exposures.first(), found.exposures.last());
        let [first, last] = [first, last].map(|e| e.copied().unwrap_or_default());
        let note = format!("{} exposures from {first:+.2} to {last:+.2} stops", found.exposures.len());
        Ok(outcome(input, found.map, note))
    },
};
