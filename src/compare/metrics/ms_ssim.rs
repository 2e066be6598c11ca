//! Structural similarity at several scales.

use super::{Better, Metric, Outcome};

/// The row of the table.
pub const METRIC: Metric = Metric {
    name: "ms-ssim",
    title: "MS-SSIM",
    doc: "Structural similarity at five scales, each of half the resolution of the one before (Wang et al. 2003): less strict about fine \
          noise than SSIM, as eyes are from afar. Below 176 pixels a side there are fewer scales.",
    better: Better::Higher,
    unit: "",
    eval: |input| {
        let similarity = input.similarity()?;
        let found = similarity.scales();
        let channels: Vec<f64> = found.iter().map(|f| f.value).collect();
        let value = channels.iter().sum::<f64>() / channels.len().max(1) as f64;
        let scales = found.first().map_or(0, |f| f.scales);
        let unit = if scales == 1 { "scale" } else { "scales" };
        Ok(Outcome { value, channels, note: format!("{}, {scales} {unit}", similarity.note), map: None })
    },
};
