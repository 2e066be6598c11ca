//! Structural similarity at several scales.

use super::ssim::Seen;
use super::{Better, Metric, Outcome, Skipped};
use crate::compare::ssim::{Options, ms_ssim};

/// The row of the table.
pub const METRIC: Metric = Metric {
    name: "ms-ssim",
    title: "MS-SSIM",
    doc: "Structural similarity at five scales, each of half the resolution of the one before (Wang et al. 2003): less strict about fine \
          noise than SSIM, as eyes are from afar. Below 176 pixels a side there are fewer scales.",
    better: Better::Higher,
    unit: "",
    eval: |input| {
        let seen = Seen::new(input);
        let options = Options::new(seen.range);
        let [w, h] = input.pair.size;
        let mut out = Outcome::default();
        let mut scales = 0;
        for (a, b) in seen.planes[0].iter().zip(seen.planes[1].iter()) {
            let small = || Skipped(format!("{w}x{h} pixels are less than its window of 11"));
            let found = ms_ssim([w, h], a, b, &options).ok_or_else(small)?;
            out.channels.push(found.value);
            scales = found.scales;
        }
        out.value = out.channels.iter().sum::<f64>() / out.channels.len().max(1) as f64;
        let unit = if scales == 1 { "scale" } else { "scales" };
        out.note = format!("{}, {scales} {unit}", seen.note);
        Ok(out)
    },
};
