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
//! are of the same, that is said of 1 % of pairs. Beside it, tiles and objects are marked by Benjamini and Hochberg, which
//! says where.
//!
//! # Whatever the noise
//!
//! Two renders with as many samples and seeds of their own could swap halves, and nobody would know: so halves are dealt
//! anew, some hundred times (`deals`), and all of the above is asked of each deal. The verdict's probability is the share of
//! deals that look as different. That is right for every kind of noise, fireflies too, and for however the families go
//! together. A fit of normal noise ([`region`]) is not: metal under a low sun, where both halves of a pixel may find a
//! firefly, was called different in 1.62 % of 10,000 pairs by it, noise of rare grey fireflies in 0.15 %. It stays, with
//! a bound ([`region::Finding::careful`]), for pictures that cannot be dealt: unlike numbers of samples, other programs'
//! pictures, common seeds.
//!
//! A region is a set of pixels that is chosen without a look at the samples. Objects are those at the pixels' centres
//! (layer `id`); by what a pixel's first sample met, pixels on outlines would be chosen by what makes them bright, and a disc of
//! 512 pixels was called different in two of four pairs.
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
//! A sample that outweighs all others is in the spread as in the mean: it is not significant until there are many of its
//! kind in one picture and not in the other. What is rare may be in neither picture. With unlike numbers of samples it may be
//! missing in the one with fewer, and so in its spread: that one's noise is then taken from the other
//! ([`region::Finding::borrowed`]).
//!
//! # The same seed
//!
//! Two renders of one seed make the same random choices; their noise goes together, and its variances do not add up. Then it
//! is differences of replicates that vary ([`pair::Design::Paired`]), which is taken where both files name one seed, or
//! where the noise of both goes together for whatever reason. It sees far smaller differences.

mod deals;
pub mod distributions;
pub mod equivalence;
mod exchange;
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
use families::{Weights, benjamini_hochberg, uniformity};
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
    let [tiles, regions] = [tiles(reference.size, question.tile), regions(reference, question)];
    let level = question.alpha * weights.regions / regions.pixels.len().max(1) as f64;
    let mut found = Found { whole, tiles: tiles.examine(&pair, 0.0), regions: regions.examine(&pair, level) };
    let (mut families, mut p) = weights.verdict(found.ps());
    let mut deals = 0;
    if pair.ways > 0 && p.is_some_and(|p| p > deals::SURE * question.alpha) {
        let standings =
            deals::deal(&pair, &found, [&tiles.pixels, &regions.pixels], &weights, question.alpha);
        families.iter_mut().zip(&standings.families).for_each(|(line, s)| line.p = s.p());
        p = Some(standings.verdict.p());
        deals = standings.verdict.deals;
        found.set_standings(&standings);
    }
    mark(&mut found.tiles, question.alpha);
    mark(&mut found.regions, question.alpha);
    let Found { whole, tiles, regions } = found;
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
    let ps: Vec<f64> = tiles.iter().filter_map(|t| t.place_among_deals.or(t.p)).collect();
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
        deals,
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

/// Regions, and what was found in them.
struct Found {
    whole: Region,
    tiles: Vec<Region>,
    regions: Vec<Region>,
}

impl Found {
    /// Probabilities by family, of regions that have noise.
    fn ps(&self) -> [Vec<f64>; 3] {
        let of = |all: &[Region]| all.iter().filter_map(|r| r.p).collect();
        [of(std::slice::from_ref(&self.whole)), of(&self.tiles), of(&self.regions)]
    }

    fn set_standings(&mut self, s: &deals::Standings) {
        self.whole.set_standing(&s.whole, 0.5);
        let each = |all: &mut [Region], standings: &[deals::Standing]| {
            for (i, (region, standing)) in all.iter_mut().zip(standings).enumerate() {
                region.set_standing(standing, s.lot(i));
            }
        };
        each(&mut self.tiles, &s.tiles);
        each(&mut self.regions, &s.regions);
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

/// Places of one kind with their pixels.
struct Places {
    places: Vec<Place>,
    pixels: Vec<Vec<u32>>,
}

impl Places {
    fn of(all: impl IntoIterator<Item = (Place, Vec<u32>)>) -> Places {
        let (places, pixels) = all.into_iter().unzip();
        Places { places, pixels }
    }

    fn examine(&self, pair: &Pair, level: f64) -> Vec<Region> {
        let of =
            |(place, pixels): (&Place, &Vec<u32>)| Region::new(place.clone(), examine(pair, pixels), level);
        self.places.par_iter().zip(&self.pixels).map(of).collect()
    }
}

fn tiles([width, height]: [usize; 2], side: usize) -> Places {
    let across = width.div_ceil(side);
    Places::of((0..across * height.div_ceil(side)).map(|i| {
        let (x0, y0) = ((i % across) * side, (i / across) * side);
        let (x1, y1) = ((x0 + side).min(width), (y0 + side).min(height));
        let pixels = (y0..y1).flat_map(|y| (x0..x1).map(move |x| (y * width + x) as u32)).collect();
        (Place::Tile { x0, y0, x1, y1 }, pixels)
    }))
}

fn regions(reference: &Replicates, question: &Question) -> Places {
    let mut all: Vec<(Place, Vec<u32>)> = Vec::new();
    if let Some(objects) = &reference.objects {
        let mut by_number = std::collections::BTreeMap::<u32, Vec<u32>>::new();
        for (pixel, number) in objects.iter().enumerate() {
            by_number.entry(*number).or_default().push(pixel as u32);
        }
        for (number, pixels) in by_number.into_iter().filter(|(_, p)| p.len() >= LEAST_PIXELS) {
            let known = number.checked_sub(1).and_then(|i| question.names.get(i as usize)).cloned();
            let usual = if number == 0 { "background".into() } else { format!("object {number}") };
            all.push((Place::Object { number, name: known.unwrap_or(usual) }, pixels));
        }
    }
    for (name, mask) in &question.masks {
        let pixels = mask.iter().enumerate().filter(|(_, m)| **m).map(|(i, _)| i as u32).collect();
        all.push((Place::Mask { name: name.clone() }, pixels));
    }
    Places::of(all)
}

fn is_identical(pair: &Pair) -> bool {
    let (a, b) = (pair.reference, pair.test);
    a.len() == b.len()
        && (0..a.len())
            .all(|part| (0..pair.pixels()).all(|pixel| a.value(part, pixel) == b.value(part, pixel)))
}
