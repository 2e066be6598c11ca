//! What a test for bias brings back.

use super::deals::Standing;
use super::distributions::{non_centrality, student_quantile};
use super::equivalence::Equivalence;
use super::families::Uniformity;
use super::pair::{Design, Reason};
use super::region::{Contrast, Finding};
use super::{CONFIDENCE, POWER};
use serde::Serialize;

/// A share with its interval of [`CONFIDENCE`], by the spread of replicates and Student's t: too narrow where a few pixels have
/// the noise and their halves agree by chance, which p is not.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Share {
    /// Difference over the reference; -0.01 is 1 % too dark.
    pub value: f64,
    /// From.
    pub low: f64,
    /// To.
    pub high: f64,
}

impl Share {
    pub(super) fn of(c: &Contrast) -> Option<Share> {
        if c.reference <= 0.0 {
            return None;
        }
        let reach =
            if c.error > 0.0 { student_quantile((1.0 - CONFIDENCE) / 2.0, c.freedom) * c.error } else { 0.0 };
        let [value, low, high] = [0.0, -reach, reach].map(|off| (c.difference + off) / c.reference);
        Some(Share { value, low, high })
    }
}

/// Which pixels.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Place {
    /// All.
    Whole,
    /// From x0 to x1 and from y0 to y1, the ends not counted, in pixels of the picture's window.
    Tile {
        /// Left.
        x0: usize,
        /// Top.
        y0: usize,
        /// Right.
        x1: usize,
        /// Bottom.
        y1: usize,
    },
    /// What one object covers.
    Object {
        /// From 1.
        number: u32,
        /// Its name, or its number again.
        name: String,
    },
    /// A mask.
    Mask {
        /// Its name.
        name: String,
    },
}

/// What was found in a region.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Region {
    /// Where.
    pub place: Place,
    /// How often chance alone brings as much; none where nothing varies.
    pub p: Option<f64>,
    /// Where it stands among deals of the same halves, ties by lot: uniform from 0 to 1 where nothing differs, whatever the
    /// noise. None where there were no deals.
    pub place_among_deals: Option<f64>,
    /// Whether it is rejected beside its like, or differs exactly.
    pub rejected: bool,
    /// Whether it differs where there is no noise.
    pub exact: bool,
    /// Difference of luminance as a share of the reference's; none where that is black.
    pub luminance: Option<Share>,
    /// The same of red, green and blue.
    pub channels: [Option<Share>; 3],
    /// The bias of all channels alike, as a share, that this test alone would have seen with [`POWER`]; not of tiles.
    pub detectable: Option<f64>,
    /// Within what share of the reference's luminance both are the same, with [`CONFIDENCE`].
    pub within: Option<f64>,
    /// Pixels that were used.
    pub pixels: usize,
    /// Degrees of freedom of the noise.
    pub freedom: f64,
    /// Mixtures of channels with noise.
    pub rank: usize,
    /// The sums behind it.
    #[serde(skip)]
    pub finding: Finding,
}

/// What was asked of a family of regions, and what it said.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FamilyLine {
    /// whole, tiles, objects.
    pub name: &'static str,
    /// Tests in it.
    pub tests: usize,
    /// Its share of the verdict.
    pub weight: f64,
    /// Its probability.
    pub p: f64,
}

/// The verdict in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// Every pixel has the same bits.
    Identical,
    /// Nothing was found.
    NoDifference,
    /// One is biased against the other.
    Different,
    /// Nothing varies, and nothing differs beyond rounding.
    Same,
}

/// What came out.
#[derive(Debug, Clone, Serialize)]
pub struct StatisticalResult {
    /// In one word.
    pub outcome: Outcome,
    /// In a sentence or two.
    pub sentence: String,
    /// How often chance alone brings as much; none where nothing varies.
    pub p: Option<f64>,
    /// The level of the verdict.
    pub alpha: f64,
    /// What is random in what.
    pub design: Design,
    /// Why that was taken.
    pub reason: Reason,
    /// Families that the verdict is made of.
    pub families: Vec<FamilyLine>,
    /// All pixels.
    pub whole: Region,
    /// Row by row.
    pub tiles: Vec<Region>,
    /// Objects of the reference, then masks.
    pub regions: Vec<Region>,
    /// Whether tiles' p-values are uniform.
    pub uniformity: Option<Uniformity>,
    /// The answer to the stronger question.
    pub equivalence: Option<Equivalence>,
    /// Pixels left out because a value is not finite.
    pub not_finite: usize,
    /// Pixels left out because less than two replicates have samples.
    pub no_spread: usize,
    /// Pixels without noise that are the same.
    pub quiet: usize,
    /// Replicates of the reference and of the test.
    pub replicates: [usize; 2],
    /// How often halves were dealt anew; 0 where that is not possible, or there is no need.
    pub deals: usize,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Side of a tile.
    pub tile: usize,
}

impl Region {
    /// What deals say, with a lot for its place among them.
    pub(super) fn set_standing(&mut self, standing: &Standing, lot: f64) {
        if self.p.is_some() {
            self.p = Some(standing.p());
            self.place_among_deals = Some(standing.place(lot));
        }
    }

    /// `level`: of this test alone; 0 where it does not matter what would have been seen.
    pub(super) fn new(place: Place, finding: Finding, level: f64) -> Region {
        let share = |k: usize| Share::of(&finding.contrasts[k]);
        let luminance = share(3);
        let (p, f) = (finding.rank as f64, finding.denominator());
        let detectable = (finding.rank > 0 && finding.strength > 0.0 && level > 0.0)
            .then(|| non_centrality(level, POWER, p, f))
            .map(|lambda| (lambda / finding.strength).sqrt())
            .filter(|b| b.is_finite());
        Region {
            p: finding.p(),
            place_among_deals: None,
            rejected: false,
            exact: finding.is_exact(),
            luminance,
            channels: [share(0), share(1), share(2)],
            detectable,
            within: luminance.map(|l| l.low.abs().max(l.high.abs())),
            pixels: finding.pixels,
            freedom: finding.freedom,
            rank: finding.rank,
            place,
            finding,
        }
    }
}
