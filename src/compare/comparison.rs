//! Everything that is worked out of one pair of pictures.

use super::causes::{Cause, likely};
use super::invalid::Invalid;
use super::metrics::{Input, Metric, MetricOptions, Skipped};
use super::open::{Opened, PairOptions, Source, open};
use super::pair::Pair;
use super::regions::{Region, worst};
use crate::error::Result;
use serde::Serialize;

/// A figure of a pair.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figure {
    /// The measure's name.
    pub metric: &'static str,
    /// Over all channels; none where the pair has no such figure, or it is infinite.
    pub value: Option<f64>,
    /// Whether it is infinite (the PSNR of equal pictures).
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub infinite: bool,
    /// Behind the figure.
    #[serde(skip_serializing_if = "str::is_empty")]
    pub unit: &'static str,
    /// By channel, in the order of [`Comparison::channels`].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub channels: Vec<f64>,
    /// What was chosen, or why there is no figure.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub note: String,
    /// Pixel by pixel.
    #[serde(skip)]
    pub map: Option<Vec<f32>>,
}

/// What two pictures come to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// File of the reference.
    pub reference: String,
    /// File of the test.
    pub test: String,
    /// Width and height of what was compared, pixels.
    pub size: [usize; 2],
    /// Its left top pixel in the pictures.
    pub origin: [usize; 2],
    /// Pixels that counted.
    pub pixels: usize,
    /// Where figures were taken: `linear` or `display`.
    pub space: &'static str,
    /// Names of the channels.
    pub channels: Vec<String>,
    /// Whether all values that count are equal.
    pub identical: bool,
    /// Pixels of the reference and the test that are no numbers.
    pub invalid: [Invalid; 2],
    /// What the reader should know.
    pub notes: Vec<String>,
    /// In the order of the registry.
    pub figures: Vec<Figure>,
    /// A slip that explains most of the difference.
    pub cause: Option<Cause>,
    /// Where the error is.
    pub worst: Vec<Region>,
}

/// How to compare.
pub struct CompareOptions {
    /// Which part, in which space.
    pub pair: PairOptions,
    /// Which measures.
    pub metrics: Vec<&'static Metric>,
    /// Their choices.
    pub choices: MetricOptions,
    /// Whether figures bring maps along.
    pub maps: bool,
}

/// Compares two pictures; the pair comes along for maps and reports.
///
/// # Errors
/// See [`open`].
pub fn compare(reference: &Source, test: &Source, options: &CompareOptions) -> Result<(Comparison, Pair)> {
    let Opened { pair, invalid, mut notes } = open(reference, test, &options.pair)?;
    let same_file = || Some(reference.path.canonicalize().ok()? == test.path.canonicalize().ok()?);
    let identical = pair.reference == pair.test;
    if same_file() == Some(true) {
        notes.push("reference and test are the same file".into());
    }
    for (which, invalid) in ["reference", "test"].into_iter().zip(&invalid) {
        notes
            .extend(invalid.describe().map(|what| format!("left out of all figures: {what} of the {which}")));
    }
    let input = Input::new(&pair, &options.choices).with_maps(options.maps);
    let figures = options.metrics.iter().map(|m| figure(m, &input)).collect();
    let comparison = Comparison {
        reference: reference.path.display().to_string(),
        test: test.path.display().to_string(),
        size: pair.size,
        origin: pair.origin,
        pixels: pair.count(),
        space: pair.space.name(),
        channels: pair.channels.clone(),
        identical,
        invalid,
        notes,
        figures,
        cause: if identical { None } else { likely(&pair) },
        worst: worst(&input),
    };
    Ok((comparison, pair))
}

fn figure(metric: &Metric, input: &Input) -> Figure {
    let empty = Figure {
        metric: metric.name,
        value: None,
        infinite: false,
        unit: metric.unit,
        channels: Vec::new(),
        note: String::new(),
        map: None,
    };
    match (metric.eval)(input) {
        Ok(o) => {
            // Records have no infinity.
            let channels = if o.channels.iter().all(|c| c.is_finite()) { o.channels } else { Vec::new() };
            let finite = o.value.is_finite().then_some(o.value);
            Figure {
                value: finite,
                infinite: o.value.is_infinite(),
                channels,
                note: o.note,
                map: o.map,
                ..empty
            }
        }
        Err(Skipped(why)) => Figure { note: why, ..empty },
    }
}

impl Comparison {
    /// The figure of a measure, infinite ones included; none where it was not taken or is not there.
    pub fn value(&self, metric: &str) -> Option<f64> {
        let figure = self.figures.iter().find(|f| f.metric == metric)?;
        if figure.infinite { Some(f64::INFINITY) } else { figure.value }
    }
}
