//! Is one of two pictures biased? Tests over tiles, objects and the whole, from what replicates say of the noise.
//!
//! A picture with noise comes with replicates ([`replicates::Replicates`]): two independent halves of its samples (layer
//! `halves` of our EXR files), or several pictures of the same scene. Their spread is the noise of the mean, whatever points
//! the samples are. Over each tile, each object and the whole, the difference of both pictures is then held against it
//! ([`region`]), in all channels at once.
//!
//! # The verdict
//!
//! Three families are asked: the whole picture, its tiles, its objects (or other regions that are given), each for one
//! probability (Simes' for many), and these are combined by weights ([`families::combined`]): a third each, or a half each
//! where there are no objects. *Different* means that the combination is at most `alpha`, 1 % by default: where the pictures
//! are of the same, that is said of 1 % of pairs, but where fireflies rule (below). Beside it, tiles and objects are marked by
//! Benjamini and Hochberg, which says where.
//!
//! # What has no noise
//!
//! Pixels whose replicates are the same, in both pictures, and that are the same but for rounding, are left out: they are
//! certain, and say nothing of the others. Where at least [`region::STILL`] pixels of a tile have no noise, nor has what is
//! around them in that tile, and differ by more than rounding explains, the difference is *exact*: the verdict is *different*
//! without a probability. The same for colours: a grey scene has no noise of hue, so that any tint is exact.
//!
//! # Fireflies
//!
//! A sample that outweighs all others is in the spread as in the mean: |T| is then about 1, and the degrees of freedom fall to
//! those of the few pixels that matter, so that it is not significant until there are many of its kind in one picture and
//! not in the other. What is rare may be in neither picture. With unlike numbers of samples it may be missing in the one
//! with fewer, and so in its spread: that one's noise is then taken from the other ([`region::Finding::borrowed`]).
//!
//! Where a few pixels have most of a tile's noise, both halves of one of them may have found as many fireflies: metal under a
//! low sun, at 16 samples a pixel, is said to differ in 1.6 % of pairs of the same (10,000 pairs, `benches/statistics`), not in
//! 1 %; at 64 samples in 0.7 % (1,000 pairs). What was tried against it deals the halves anew: given the four of a pixel, the
//! difference is one of three contrasts that are equally likely, with either sign. Their covariance and chi-square, the larger
//! p of that and of F: 0.10 % of 3,000 pairs on that metal, none where fireflies are rarer, too careful. A fit of two moments
//! (Pitman 1937) instead: 4.8 %, and 50 % where one firefly has a tile; the same with no tail that is much lighter than
//! chi-square's: 1.85 % of 2,000.
//!
//! # The same seed
//!
//! Two renders of one seed make the same random choices; their noise goes together, and its variances do not add up. Then it
//! is differences of replicates that vary ([`pair::Design::Paired`]), which is taken where both files name one seed, or
//! where the noise of both goes together for whatever reason. It sees far smaller differences.

pub mod distributions;
pub mod equivalence;
pub mod families;
pub mod lens;
pub mod matrix;
pub mod pair;
pub mod present;
pub mod region;
pub mod replicates;
pub mod results;
pub mod verdict;

use crate::error::{Error, Result};
use families::{benjamini_hochberg, combined, simes, uniformity};
use pair::{Design, Pair};
use rayon::prelude::*;
use region::examine;
use replicates::Replicates;
pub use results::{FamilyLine, Outcome, Place, Region, Share, StatisticalResult};

/// What is asked.
#[derive(Debug, Clone)]
pub struct Question {
    /// How often, of pairs without a difference, one may be found: above 0, at most 0.5.
    pub alpha: f64,
    /// Side of a tile in pixels, at least 1.
    pub tile: usize,
    /// Margin for the stronger question, as a share of the mean.
    pub equivalent: Option<f64>,
    /// Further regions: name, and for every pixel whether it belongs to it.
    pub masks: Vec<(String, Vec<bool>)>,
    /// What is random in what; decided by seeds and noise if it is not said.
    pub design: Option<Design>,
    /// Names of objects by number, from 1; numbers are shown for others.
    pub names: Vec<String>,
}

impl Default for Question {
    fn default() -> Self {
        Question {
            alpha: 0.01,
            tile: 16,
            equivalent: None,
            masks: Vec::new(),
            design: None,
            names: Vec::new(),
        }
    }
}

/// Confidence of the intervals that are told.
pub const CONFIDENCE: f64 = 0.95;

/// How sure a bias of the size that is told would have been seen.
pub const POWER: f64 = 0.95;

/// Objects with fewer pixels have no line of their own.
const LEAST_PIXELS: usize = 4;

/// Tests `test` against `reference`.
///
/// # Errors
/// Bad levels, tiles, masks; sizes that differ; no pixel that both know the spread of.
pub fn compare(reference: &Replicates, test: &Replicates, question: &Question) -> Result<StatisticalResult> {
    question.check(reference)?;
    let pair = Pair::new(reference, test, question.design)?;
    let weights = Weights::of(reference, question);
    let all: Vec<u32> = (0..pair.pixels() as u32).collect();
    let whole = Region::new(Place::Whole, examine(&pair, &all), question.alpha * weights.whole);
    if whole.pixels == 0 {
        return Err(Error::Usage(format!(
            "no pixel has two replicates in both pictures: {} have less, {} are not finite",
            whole.finding.no_spread, whole.finding.not_finite
        )));
    }
    let tiles = tiles(&pair, question);
    let regions = regions(&pair, question, weights.regions);
    let (families, p) = weights.verdict(&whole, &tiles, &regions);
    let exact = tiles.iter().chain(&regions).any(|r| r.exact) || whole.exact;
    let identical = is_identical(&pair);
    let outcome = match p {
        _ if identical => Outcome::Identical,
        _ if exact => Outcome::Different,
        Some(p) if p <= question.alpha => Outcome::Different,
        Some(_) => Outcome::NoDifference,
        None => Outcome::Same,
    };
    let equivalence = question.equivalent.map(|margin| {
        let levels = equivalence::Levels { equivalent: 0.05, different: question.alpha };
        equivalence::ask(&pair, &all, margin, levels)
    });
    let ps: Vec<f64> = tiles.iter().filter_map(|t| t.p).collect();
    let mut result = StatisticalResult {
        outcome,
        sentence: String::new(),
        p: p.filter(|_| !identical),
        alpha: question.alpha,
        design: pair.design,
        reason: pair.reason,
        families,
        uniformity: uniformity(&ps),
        equivalence: equivalence.transpose()?,
        not_finite: whole.finding.not_finite,
        no_spread: whole.finding.no_spread,
        quiet: whole.finding.quiet,
        replicates: [reference.len(), test.len()],
        size: reference.size,
        tile: question.tile,
        whole,
        tiles,
        regions,
    };
    result.sentence = verdict::sentence(&result);
    Ok(result)
}

impl Question {
    fn check(&self, reference: &Replicates) -> Result<()> {
        if !(self.alpha > 0.0 && self.alpha <= 0.5) {
            return Err(Error::Usage(
                "the rate of false alarms (--alpha) lies above 0 and is at most 50 %".into(),
            ));
        }
        if self.tile == 0 {
            return Err(Error::Usage("a tile has at least one pixel a side".into()));
        }
        if self.equivalent.is_some_and(|m| !(m > 0.0 && m < 1.0)) {
            return Err(Error::Usage("a margin (--equivalent) lies above 0 and below 100 %".into()));
        }
        let pixels = reference.size[0] * reference.size[1];
        if let Some((name, mask)) = self.masks.iter().find(|(_, mask)| mask.len() != pixels) {
            return Err(Error::Usage(format!(
                "mask {name} has {} pixels, the pictures have {pixels}",
                mask.len()
            )));
        }
        Ok(())
    }
}

/// What each family counts.
struct Weights {
    whole: f64,
    tiles: f64,
    regions: f64,
}

impl Weights {
    fn of(reference: &Replicates, question: &Question) -> Weights {
        let has_tiles = reference.size[0].max(reference.size[1]) > question.tile;
        let has_regions = reference.objects.is_some() || !question.masks.is_empty();
        let families = 1.0 + f64::from(u8::from(has_tiles)) + f64::from(u8::from(has_regions));
        let share = |has: bool| if has { 1.0 / families } else { 0.0 };
        Weights { whole: share(true), tiles: share(has_tiles), regions: share(has_regions) }
    }

    /// The families that have something to say, with their weights scaled to 1, and their combination.
    fn verdict(
        &self,
        whole: &Region,
        tiles: &[Region],
        regions: &[Region],
    ) -> (Vec<FamilyLine>, Option<f64>) {
        let of = |all: &[Region]| -> Vec<f64> { all.iter().filter_map(|r| r.p).collect() };
        let whole = std::slice::from_ref(whole);
        let named = [
            ("whole", self.whole, of(whole)),
            ("tiles", self.tiles, of(tiles)),
            ("objects", self.regions, of(regions)),
        ];
        let mut lines: Vec<FamilyLine> = named
            .into_iter()
            .filter(|(_, weight, ps)| *weight > 0.0 && !ps.is_empty())
            .map(|(name, weight, ps)| FamilyLine { name, tests: ps.len(), weight, p: simes(&ps) })
            .collect();
        let sum: f64 = lines.iter().map(|l| l.weight).sum();
        lines.iter_mut().for_each(|l| l.weight /= sum);
        let terms: Vec<(f64, f64)> = lines.iter().map(|l| (l.weight, l.p)).collect();
        let p = (!terms.is_empty()).then(|| combined(&terms));
        (lines, p)
    }
}

/// Marks those that are rejected among their like.
fn mark(regions: &mut [Region], alpha: f64) {
    let known: Vec<usize> = (0..regions.len()).filter(|i| regions[*i].p.is_some()).collect();
    let ps: Vec<f64> = known.iter().filter_map(|i| regions[*i].p).collect();
    for (i, rejected) in known.into_iter().zip(benjamini_hochberg(&ps, alpha)) {
        regions[i].rejected = rejected;
    }
    regions.iter_mut().for_each(|r| r.rejected |= r.exact);
}

fn tiles(pair: &Pair, question: &Question) -> Vec<Region> {
    let [width, height] = pair.reference.size;
    let side = question.tile;
    let across = width.div_ceil(side);
    let count = across * height.div_ceil(side);
    let mut all: Vec<Region> = (0..count)
        .into_par_iter()
        .map(|i| {
            let (x0, y0) = ((i % across) * side, (i / across) * side);
            let (x1, y1) = ((x0 + side).min(width), (y0 + side).min(height));
            let pixels: Vec<u32> =
                (y0..y1).flat_map(|y| (x0..x1).map(move |x| (y * width + x) as u32)).collect();
            Region::new(Place::Tile { x0, y0, x1, y1 }, examine(pair, &pixels), 0.0)
        })
        .collect();
    mark(&mut all, question.alpha);
    all
}

fn regions(pair: &Pair, question: &Question, weight: f64) -> Vec<Region> {
    let mut lists: Vec<(Place, Vec<u32>)> = Vec::new();
    if let Some(objects) = &pair.reference.objects {
        let mut by_number = std::collections::BTreeMap::<u32, Vec<u32>>::new();
        for (pixel, number) in objects.iter().enumerate() {
            by_number.entry(*number).or_default().push(pixel as u32);
        }
        for (number, pixels) in by_number.into_iter().filter(|(_, p)| p.len() >= LEAST_PIXELS) {
            let known = number.checked_sub(1).and_then(|i| question.names.get(i as usize)).cloned();
            let usual = if number == 0 { "background".into() } else { format!("object {number}") };
            lists.push((Place::Object { number, name: known.unwrap_or(usual) }, pixels));
        }
    }
    for (name, mask) in &question.masks {
        let pixels = mask.iter().enumerate().filter(|(_, m)| **m).map(|(i, _)| i as u32).collect();
        lists.push((Place::Mask { name: name.clone() }, pixels));
    }
    let level = question.alpha * weight / lists.len().max(1) as f64;
    let found = lists.into_iter().map(|(place, pixels)| Region::new(place, examine(pair, &pixels), level));
    let mut all: Vec<Region> = found.collect();
    mark(&mut all, question.alpha);
    all
}

fn is_identical(pair: &Pair) -> bool {
    let (a, b) = (pair.reference, pair.test);
    a.len() == b.len()
        && (0..a.len())
            .all(|part| (0..pair.pixels()).all(|pixel| a.value(part, pixel) == b.value(part, pixel)))
}
