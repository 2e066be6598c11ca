//! How a sky is placed and sampled.

use crate::error::{Error, Result, unknown_name};
use std::str::FromStr;

/// How directions to the map of a sky are sampled; discs are sampled uniformly within their cones by all methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SkySampling {
    /// By the luminance times what the surface makes of it, from tables by the surface's direction. A constant sky is left
    /// to BSDF sampling. The best use of time under most skies (measured: benches/README.md).
    #[default]
    Product,
    /// The same without two refinements: what lies within a cell is drawn evenly, and suns have half of the light samples,
    /// however many a surface point takes. For comparison.
    ProductCells,
    /// By the luminance that rises above the average, where that pays: BSDF sampling finds the rest as well (Karlik et
    /// al. 2019). Under a constant sky nothing is left and there is no sample.
    Compensated,
    /// By luminance.
    Table,
    /// By the cosine to the receiver's shading normal.
    Cosine,
}

impl SkySampling {
    /// All methods with their names, as scene files spell them.
    pub const NAMES: [(&'static str, SkySampling); 5] = [
        ("product", SkySampling::Product),
        ("product-cells", SkySampling::ProductCells),
        ("compensated", SkySampling::Compensated),
        ("table", SkySampling::Table),
        ("cosine", SkySampling::Cosine),
    ];

    /// One line about it.
    pub const fn doc(self) -> &'static str {
        match self {
            SkySampling::Product => "by luminance times what the surface makes of it",
            SkySampling::ProductCells => "the same, evenly within cells, and half of the samples for suns",
            SkySampling::Compensated => {
                "by the luminance above the average; the rest is left to BSDF sampling"
            }
            SkySampling::Table => "by luminance",
            SkySampling::Cosine => "by the cosine at the receiver, whatever the sky shows",
        }
    }

    /// Whether surfaces are taken into account.
    pub fn is_product(self) -> bool {
        matches!(self, SkySampling::Product | SkySampling::ProductCells)
    }
}

impl FromStr for SkySampling {
    type Err = Error;

    fn from_str(s: &str) -> Result<Self> {
        let known = Self::NAMES.iter().map(|n| n.0);
        let found = Self::NAMES.iter().find(|n| n.0 == s);
        found.map(|n| n.1).ok_or_else(|| Error::Usage(unknown_name("sky sampling", s, known)))
    }
}

/// How a sky is placed and sampled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkyOptions {
    /// Scales its radiance; finite and at least 0.
    pub intensity: f64,
    /// Turns it about +y by the right-hand rule (counter-clockwise seen from above), degrees: 90 brings what was at
    /// +z to +x.
    pub rotate_y_deg: f64,
    /// How it is sampled.
    pub sampling: SkySampling,
}

impl Default for SkyOptions {
    fn default() -> Self {
        SkyOptions { intensity: 1.0, rotate_y_deg: 0.0, sampling: SkySampling::default() }
    }
}
