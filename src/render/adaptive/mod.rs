//! Rounds of samples: how many, where, and when the picture is good enough.
//!
//! # What is promised
//!
//! The *relative error* of a picture x against the truth r is the root of the mean, over pixels and channels, of
//! (x - r)^2 / (r^2 + 0.01 m^2), with m the mean luminance of r; that of a block is the same mean over its 16 x 16 pixels.
//! A render with a [`Target`] stops after the first round for which this error, *of the picture that it has made*, is at
//! most the target with the target's confidence, or when no pixel may have more samples; [`Reached`] says which.
//!
//! # From half-buffers to a bound
//!
//! A pixel's samples are dealt to two independent halves with means A and B. For equal halves, (A - B) / 2 has the
//! distribution of the error of (A + B) / 2, up to its sign, and is uncorrelated with it. So the mean of
//! ((A - B) / 2)^2 over pixels estimates the squared error without bias (Rousselle, Knaus and Zwicker 2012), stratified
//! points or not, and for normal errors estimate and squared error are independent with one degree of freedom a pixel
//! and channel. Sums of them have about f = 2 (mean)^2 / variance ([`ErrorSum::freedom`], from the spread over pixels:
//! channels may go together, and few pixels may outweigh all others). The true squared error over its estimate then
//! follows F(f, f), of which half the logarithm is close to normal with variance 1 / (f - 1) (Fisher 1924; for f = 10
//! the 95 % quantile is 2.99 instead of 2.98). Hence, with z the normal deviate of the confidence,
//!
//! > squared error <= estimate * exp(2 z / sqrt(f - 1)).
//!
//! A hundred thousand pixels alike make that 1 %. Where one pixel makes up the variance, f is 3 and the factor 10 to 16:
//! a sample that alone is a notable part of what is known says that the tail has not been seen, and the render goes on.
//!
//! # What has not been seen
//!
//! A lamp that one path in 10,000 finds is not in the variance of those that have not found it. If M paths did not, then
//! with confidence 1 - a it is found by less than ln(1 / a) / M of them (the rule of three: 3 / M at 95 %). No stop is
//! considered before M = ln(2 / a) / [`RAREST`], a one less the confidence: half of what may go wrong is spent here and
//! half on the bound above. M counts the paths of the whole picture, or of 3 x 3 blocks where blocks are promised. Once
//! seen, rare samples count fully, as a pixel's error is relative to its darker half
//! ([`estimate::pixel_errors`]); and as long as they are in few pixels, estimate and error are made of the same samples.
//! What is rarer than [`RAREST`] can be missed by any rule that looks at samples alone.
//!
//! # Rounds
//!
//! All pixels first get 8 samples, 16, and so on to the first look. Then each round doubles the tiles where a ray gains
//! most ([`allocate`]), so that a pixel's total stays a power of two, where points are best, and few looks are taken: one
//! that is taken long before the target would have to err by half of the squared error to stop there. With a target for
//! the picture, the last round takes no more tiles than the bound is expected to need, the last of them in quarters of
//! what it has. (Chow and Robbins 1965: to stop when the estimated width is small enough keeps the confidence as the
//! width goes to 0.)
//!
//! # What it does not change
//!
//! Each decision depends on the film and on counted rays, both exact, hence on scene, settings and rounds run: never on
//! clock, threads or order. A mean whose number of samples depends on them is biased by half the covariance of the
//! decision and the mean (Kirk and Arvo 1991). Decisions are taken on hundreds of pixels, and surprises are shared out,
//! so that one pixel's samples have hardly a say in its tile's; `tests/it/adaptive.rs` holds means against those of
//! fixed numbers of samples.

pub mod allocate;
pub mod estimate;

use super::film::{Film, TILE_SIDE};
use super::settings::RenderSettings;
use crate::base::pixel_rect::PixelRect;
use crate::error::{Error, Result};
use allocate::{Need, Tile, needs, worth_doubling};
use estimate::{ErrorSum, floor_of, normal_deviate};
use std::ops::Range;

/// Share of paths below which a rare event may be missed by a render that stops.
pub const RAREST: f64 = 1e-4;

/// Samples of a pixel in the first round; each later one doubles.
const FIRST_SPP: u32 = 8;

/// Samples of a pixel before samples are dealt by need.
const EVEN_SPP: u32 = 16;

/// The last round aims so far below the target's square, lest another be needed for a hair.
const AIM: f64 = 0.97;

/// Of what a target speaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The whole picture.
    Picture,
    /// Each block of 16 x 16 pixels: the confidence is that none is worse.
    Block,
}

impl Part {
    /// As the command line spells it.
    pub fn name(self) -> &'static str {
        match self {
            Part::Picture => "picture",
            Part::Block => "block",
        }
    }
}

/// When a picture is good enough.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// The relative error that is asked for, 0 to 1.
    pub error: f64,
    /// How sure it shall be, at least 0.5 and below 1.
    pub confidence: f64,
    /// Of what.
    pub part: Part,
}

impl Target {
    /// Checks the ranges.
    pub fn check(&self) -> Result<()> {
        if !(0.0..=1.0).contains(&self.error) {
            return Err(Error::Usage("a target error lies between 0 and 100 %".into()));
        }
        if !(0.5..1.0).contains(&self.confidence) {
            return Err(Error::Usage("a confidence lies between 50 % and less than 100 %".into()));
        }
        Ok(())
    }

    /// What may go wrong in either of two ways.
    fn risk(&self) -> f64 {
        (1.0 - self.confidence) / 2.0
    }
}

/// How good a picture is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reached {
    /// Estimated relative error of the picture, or of the block with the largest.
    pub error: f64,
    /// What the true one is below, with the target's confidence.
    pub at_most: f64,
    /// Whether that is the target or less, and enough paths were traced to say so.
    pub met: bool,
}

/// Samples that a tile gets in a round.
#[derive(Debug, Clone, PartialEq)]
pub struct Task {
    /// Number of the tile, in the order of [`Film::tiles`].
    pub tile: usize,
    /// Its pixels.
    pub rect: PixelRect,
    /// Which samples of each pixel.
    pub samples: Range<u32>,
}

/// The rounds of a render.
pub struct Schedule {
    tiles: Vec<Tile>,
    rects: Vec<PixelRect>,
    limit: u32,
    /// Whether there is more than one round.
    in_rounds: bool,
    target: Option<Target>,
    /// Pixels whose samples are traced: those that see no geometry have no path that might miss anything.
    traced: f64,
    /// Rounds begun.
    pub rounds: u32,
    /// After the last look.
    pub reached: Option<Reached>,
}

impl Schedule {
    /// For an empty film of which so many pixels need no paths.
    pub fn new(settings: &RenderSettings, film: &Film, free: u64) -> Self {
        let rects: Vec<PixelRect> = film.tiles().collect();
        let window = film.window();
        let place = |r: &PixelRect| [r.x0 - window.x0, r.y0 - window.y0].map(|v| (v / TILE_SIDE) as usize);
        let tile = |r: &PixelRect| Tile { place: place(r), area: r.area() as f64, spp: 0, rays: 0 };
        Schedule {
            tiles: rects.iter().map(tile).collect(),
            rects,
            limit: settings.spp,
            in_rounds: settings.time.is_some() || settings.target.is_some(),
            target: settings.target,
            traced: film.window().area() as f64 - free as f64,
            rounds: 0,
            reached: None,
        }
    }

    /// The next round, given what has been gathered; empty when the render is done.
    pub fn next(&mut self, film: &Film) -> Vec<Task> {
        let tasks = self.plan(film);
        self.rounds += u32::from(!tasks.is_empty());
        tasks
    }

    fn plan(&mut self, film: &Film) -> Vec<Task> {
        let least = self.spp_range()[0];
        if least >= self.limit {
            return Vec::new();
        }
        let all = |tiles: Vec<usize>| tiles.into_iter().map(|tile| self.doubled(tile)).collect();
        if least < self.first_look().min(self.limit) {
            return all((0..self.tiles.len()).collect());
        }
        let needs = needs(film, &self.tiles, floor_of(film));
        let Some(target) = self.target else {
            return all(worth_doubling(&self.tiles, &needs, self.limit));
        };
        let reached = self.judge(&target, &needs);
        let tasks = match target.part {
            _ if reached.met => Vec::new(),
            Part::Picture => self.for_picture(&target, &needs),
            Part::Block => all(self.failing_blocks(&target, &needs)),
        };
        self.reached = Some(reached);
        tasks
    }

    /// On to the next power of two.
    fn doubled(&self, tile: usize) -> Task {
        let done = self.tiles[tile].spp;
        let end = if self.in_rounds { (done.saturating_add(1)).checked_next_power_of_two() } else { None };
        self.task(tile, end.unwrap_or(self.limit).max(FIRST_SPP) - done)
    }

    fn task(&self, tile: usize, more: u32) -> Task {
        let done = self.tiles[tile].spp;
        Task { tile, rect: self.rects[tile], samples: done..done.saturating_add(more).min(self.limit) }
    }

    /// Samples of each pixel before which tiles are treated alike, and none is final.
    fn first_look(&self) -> u32 {
        if !self.in_rounds {
            return self.limit;
        }
        let Some(target) = self.target else { return EVEN_SPP };
        let paths = -target.risk().ln() / RAREST;
        let pool = match target.part {
            Part::Picture => self.traced,
            Part::Block => self.traced.min(9.0 * f64::from(TILE_SIDE * TILE_SIDE)),
        };
        if pool <= 0.0 {
            return EVEN_SPP;
        }
        EVEN_SPP.max((paths / pool).ceil() as u32)
    }

    /// A round is over: what it brought to each of its tiles.
    pub fn done(&mut self, task: &Task, rays: u64) {
        self.tiles[task.tile].spp = task.samples.end;
        self.tiles[task.tile].rays += rays;
    }

    /// Looks once more, where the rounds were ended by a clock or an interrupt.
    pub fn look(&mut self, film: &Film) {
        if let Some(target) = self.target {
            let needs = needs(film, &self.tiles, floor_of(film));
            self.reached = Some(self.judge(&target, &needs));
        }
    }

    /// The fewest and the most samples of a pixel.
    pub fn spp_range(&self) -> [u32; 2] {
        let spp = || self.tiles.iter().map(|t| t.spp);
        [spp().min().unwrap_or(0), spp().max().unwrap_or(0)]
    }

    /// The mean over pixels.
    pub fn spp_mean(&self) -> f64 {
        let sum = |of: fn(&Tile) -> f64| self.tiles.iter().map(of).sum::<f64>();
        sum(|t| t.area * f64::from(t.spp)) / sum(|t| t.area).max(1.0)
    }

    fn judge(&self, target: &Target, needs: &[Need]) -> Reached {
        let [square, bound] = match target.part {
            Part::Picture => {
                let all = self.whole(needs);
                [all.mean(), all.bound(normal_deviate(target.risk()))]
            }
            Part::Block => (self.tiles.iter().zip(needs))
                .map(|(tile, need)| block_error(tile, need, self.deviate_of_blocks(target)))
                .fold([0.0; 2], |worst, b| [0, 1].map(|i| b[i].max(worst[i]))),
        };
        let enough = self.spp_range()[0] >= self.first_look();
        let [error, at_most] = [square, bound].map(f64::sqrt);
        // Without a pixel that has samples in both halves there is no estimate.
        let known = needs.iter().any(|n| n.own.pixels > 0.0);
        Reached { error, at_most, met: enough && known && at_most <= target.error }
    }

    fn whole(&self, needs: &[Need]) -> ErrorSum {
        let mut all = ErrorSum::default();
        needs.iter().for_each(|n| all.add(&n.own));
        all
    }

    /// Tiles worth a round, no more than are expected to bring the bound to the target; the last of them in quarters, so
    /// that a picture of few tiles does not get twice what it needs.
    fn for_picture(&self, target: &Target, needs: &[Need]) -> Vec<Task> {
        let all = self.whole(needs);
        let goal = AIM * target.error.powi(2) * all.sum / all.bound(normal_deviate(target.risk()));
        let mut excess = all.sum - goal;
        let mut tasks = Vec::new();
        for tile in worth_doubling(&self.tiles, needs, self.limit) {
            let own = needs[tile].own.sum;
            if excess <= 0.5 * own {
                let quarters = (4.0 * excess / (own - excess)).ceil().clamp(1.0, 4.0) as u32;
                tasks.push(self.task(tile, (self.tiles[tile].spp.div_ceil(4)).saturating_mul(quarters)));
                break;
            }
            excess -= 0.5 * own;
            tasks.push(self.doubled(tile));
        }
        tasks
    }

    /// All blocks that are not good enough.
    fn failing_blocks(&self, target: &Target, needs: &[Need]) -> Vec<usize> {
        let z = self.deviate_of_blocks(target);
        let fails = |i: &usize| block_error(&self.tiles[*i], &needs[*i], z)[1].sqrt() > target.error;
        (0..self.tiles.len()).filter(|&i| self.tiles[i].spp < self.limit).filter(fails).collect()
    }

    /// None of so many blocks shall be worse: each has its share of the risk (Bonferroni).
    fn deviate_of_blocks(&self, target: &Target) -> f64 {
        normal_deviate(target.risk() / self.tiles.len().max(1) as f64)
    }
}

/// Squared error of a block, estimate and bound. A block that has had less of its neighbourhood's surprises than its
/// share is taken to be as bad as if it had had that.
fn block_error(tile: &Tile, need: &Need, z: f64) -> [f64; 2] {
    let own = need.own.mean();
    let shared = need.rate / (tile.area * f64::from(tile.spp.max(1)));
    let square = own.max(shared);
    let factor = if own > 0.0 { need.own.bound(z) / own } else { 1.0 };
    [square, square * factor]
}

#[cfg(test)]
mod tests;
