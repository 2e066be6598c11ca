//! Measures of how far a picture is from another, one file each, each ending in its row of the table.
//!
//! Sums are exact ([`ExactSum`]), so a figure depends on the values alone: not on their order, nor on the threads.

mod bias;
mod flip;
mod hdr_flip;
mod mae;
mod mape;
mod ms_ssim;
mod mse;
pub mod pointwise;
mod psnr;
mod relmse;
mod relmse_trimmed;
mod rmse;
mod similarity;
mod smape;
mod ssim;
#[cfg(test)]
mod tests;

use super::pair::{Pair, Side, Space};
use crate::error::{Error, Result, unknown_name};
use crate::math::exact_sum::ExactSum;
use similarity::Similarity;
use std::sync::OnceLock;

/// Which way a figure is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Better {
    /// 0 is no difference.
    Lower,
    /// More is nearer.
    Higher,
    /// The nearer to 0 from either side.
    Zero,
}

/// A registered measure.
pub struct Metric {
    /// On the command line and in records.
    pub name: &'static str,
    /// In tables.
    pub title: &'static str,
    /// What it is, how to read it, and its source.
    pub doc: &'static str,
    /// Which way it is better.
    pub better: Better,
    /// Behind the figure; may be empty.
    pub unit: &'static str,
    /// Works it out; none, with the reason, where the pair has no such thing.
    pub eval: fn(&Input) -> Result<Outcome, Skipped>,
}

/// Why a figure is not there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Skipped(pub String);

/// A figure.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Outcome {
    /// Over all channels.
    pub value: f64,
    /// By channel, where it has channels.
    pub channels: Vec<f64>,
    /// What was chosen: the epsilon, the peak, the space.
    pub note: String,
    /// Where it comes from, pixel by pixel, where that is of use.
    pub map: Option<Vec<f32>>,
}

/// What figures are made of.
pub struct Input<'a> {
    /// The pictures.
    pub pair: &'a Pair,
    /// Choices.
    pub options: &'a MetricOptions,
    /// Whether maps are wanted, which take time and memory.
    maps: bool,
    level: OnceLock<f64>,
    squares: OnceLock<Vec<f64>>,
    similarity: OnceLock<Result<Similarity<'a>, Skipped>>,
}

/// Choices of the measures.
#[derive(Debug, Clone, PartialEq)]
pub struct MetricOptions {
    /// Added to squares of the reference by relative measures; none is [`EPSILON`] times its squared mean luminance.
    pub epsilon: Option<f64>,
    /// The value that PSNR and SSIM take for the largest possible; none is 1 for colours, else the reference's largest.
    pub peak: Option<f64>,
    /// Pixels that one degree of the viewer's field holds, for FLIP.
    pub pixels_per_degree: f32,
    /// Whether PSNR and SSIM of radiance work on radiance, and not on what a display shows of it.
    pub keep_space: bool,
}

/// Part of the squared mean luminance that relative measures add to the reference's square, as `bench error` and
/// `--target-error` do: a tenth of the mean is as dark as it gets.
pub const EPSILON: f64 = 0.01;

/// 0.7 m from a display 0.7 m wide with 3840 pixels (Andersson et al. 2020).
pub const PIXELS_PER_DEGREE: f32 = 67.020_64;

impl Default for MetricOptions {
    fn default() -> Self {
        let pixels_per_degree = PIXELS_PER_DEGREE;
        MetricOptions { epsilon: None, peak: None, pixels_per_degree, keep_space: false }
    }
}

impl<'a> Input<'a> {
    /// For [`Metric::eval`].
    pub fn new(pair: &'a Pair, options: &'a MetricOptions) -> Self {
        let (level, squares, similarity) = Default::default();
        Input { pair, options, maps: false, level, squares, similarity }
    }

    /// With maps, or without.
    pub fn with_maps(self, maps: bool) -> Self {
        Input { maps, ..self }
    }

    /// Mean squared errors by channel.
    pub fn squares(&self) -> &[f64] {
        self.squares.get_or_init(|| pointwise::means(self.pair, |r, t| (t - r).powi(2)))
    }

    /// Structural similarity at full resolution; none where the picture is too small.
    fn similarity(&self) -> Result<&Similarity<'a>, Skipped> {
        self.similarity.get_or_init(|| Similarity::new(self)).as_ref().map_err(Clone::clone)
    }

    /// The reference's mean luminance.
    pub fn level(&self) -> f64 {
        *self.level.get_or_init(|| pointwise::mean_of(self.pair, self.pair.gray(Side::Reference)))
    }

    /// What relative measures add to squares, and words for it.
    pub fn epsilon(&self) -> (f64, String) {
        match self.options.epsilon {
            Some(e) => (e, format!("epsilon {e}")),
            None => {
                // A black reference has no scale; any positive number avoids 0 / 0.
                let e = (EPSILON * self.level().powi(2)).max(f64::MIN_POSITIVE);
                (e, format!("epsilon {e:.3e}, {EPSILON} of the squared mean"))
            }
        }
    }

    /// The largest possible value of a pair in its own space, and words for it.
    pub fn peak(&self) -> (f64, String) {
        if let Some(p) = self.options.peak {
            return (p, format!("peak {p}"));
        }
        match self.pair.space {
            Space::Display => return (1.0, "peak 1, on encoded values".into()),
            // The largest value would be that of the one pixel that met the sun.
            Space::Linear if self.pair.is_color => return (1.0, "peak 1, a display's white".into()),
            Space::Linear => {}
        }
        let values = self.pair.reference.iter().flatten();
        let largest = f64::from(values.fold(0f32, |a, v| a.max(v.abs())));
        (largest, format!("peak {largest:.4}, the reference's largest"))
    }
}

/// All of them, in the order of tables.
pub static REGISTRY: &[Metric] = &[
    bias::METRIC,
    mae::METRIC,
    mse::METRIC,
    rmse::METRIC,
    relmse::METRIC,
    relmse_trimmed::METRIC,
    mape::METRIC,
    smape::METRIC,
    psnr::METRIC,
    ssim::METRIC,
    ms_ssim::METRIC,
    flip::METRIC,
    hdr_flip::METRIC,
];

/// Finds measures by their names, each once, in the order of the table; `all` is all of them.
///
/// # Errors
/// A name that none has.
pub fn find(names: &[String]) -> Result<Vec<&'static Metric>> {
    let known = || REGISTRY.iter().map(|m| m.name).chain(["all"]);
    let unknown = names.iter().find(|n| !known().any(|k| k == n.as_str()));
    if let Some(name) = unknown {
        return Err(Error::Usage(unknown_name("metric", name, known())));
    }
    let all = names.iter().any(|n| n == "all");
    Ok(REGISTRY.iter().filter(|m| all || names.iter().any(|n| n == m.name)).collect())
}

/// The measure of exactly this name.
///
/// # Errors
/// A name that none has.
pub fn named(name: &str) -> Result<&'static Metric> {
    let known = REGISTRY.iter().map(|m| m.name);
    let found = REGISTRY.iter().find(|m| m.name == name);
    found.ok_or_else(|| Error::Usage(unknown_name("metric", name, known)))
}

/// The sum's mean over so many terms; 0 of none.
fn mean(sum: ExactSum, terms: usize) -> f64 {
    if terms == 0 { 0.0 } else { sum.value() / terms as f64 }
}
