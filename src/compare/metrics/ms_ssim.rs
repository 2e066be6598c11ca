use super::{Better, Metric, Skipped};
pub const METRIC: Metric = Metric {
    name: "ms-ssim",
    title: "ms-ssim",
    doc: "",
    better: Better::Lower,
    unit: "",
    eval: |_| Err(Skipped("not built yet".into())),
};
