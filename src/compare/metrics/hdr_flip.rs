use super::{Better, Metric, Skipped};
pub const METRIC: Metric = Metric {
    name: "hdr-flip",
    title: "hdr-flip",
    doc: "",
    better: Better::Lower,
    unit: "",
    eval: |_| Err(Skipped("not built yet".into())),
};
