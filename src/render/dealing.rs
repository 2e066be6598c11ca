//! Where the samples of a fixed budget go: a first part is dealt evenly, and what it shows decides how many more each pixel
//! gets, so that the picture's relative error is least for what `spp` samples of every pixel would cost (Neyman 1934).
//!
//! A pixel's own samples must have no say in their number, or those that happen to agree end too soon (Kirk and Arvo 1991).
//! So the film is coloured like a chessboard: what white pixels need is read off the black ones around them, and what black
//! ones need off the white. Points of different pixels are independent where samples are dealt by need, hence numbers and
//! samples of a pixel are, and its mean is unbiased (but for what the two mean costs of a sample, which are counted over the
//! whole film, know of one pixel: of the order of one over the number of pixels). How far neighbours are believed, the other
//! colour says, too (`trust`). Totals are powers of two, or `spp` where neighbours are not believed, of one sequence of points
//! from the first sample to the last.
//!
//! Tried: a quarter of the samples first (what no neighbour foretells, a twig or a far lamp, costs more than is gained); all
//! twelve neighbours alike (up to 1.2 times the error); the four nearest alone (8 times under the stars of `nebula`).

mod dealer;
mod note;
mod trust;

pub use note::{Kind, Note};

use super::outlines::Outlines;
use super::settings::RenderSettings;
use crate::base::pixel_rect::PixelRect;
use crate::error::{Error, Result, unknown_name};
use crate::integrators::{BARE_COST, RayCounts};
use dealer::{Dealer, Floor, Guess};
use rayon::prelude::*;
use std::str::FromStr;

/// How a fixed number of samples is dealt to the pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Dealing {
    /// As many to each.
    Even,
    /// By what pixels need, believed as far as it was foretold for others, down to not at all.
    #[default]
    ByNeed,
    /// By what they seem to need, as if that were certain.
    ByGuess,
}

impl Dealing {
    /// All of them with their names.
    pub const NAMES: [(&'static str, Dealing); 3] =
        [("by-need", Dealing::ByNeed), ("by-guess", Dealing::ByGuess), ("even", Dealing::Even)];

    /// Its name.
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|n| n.1 == self).map_or("", |n| n.0)
    }
}

impl FromStr for Dealing {
    type Err = Error;

    fn from_str(s: &str) -> Result<Self> {
        let found = Self::NAMES.iter().find(|n| n.0 == s).map(|n| n.1);
        found.ok_or_else(|| Error::Usage(unknown_name("dealing", s, Self::NAMES.iter().map(|n| n.0))))
    }
}

/// Samples a pixel below which all get the same: half of fewer have no spread.
pub const LEAST_SPP: u32 = 4;
/// Part of all samples that every pixel gets first: one in so many.
const FIRST: u32 = 2;
/// Most samples of a pixel for each of `spp`, as a power of two.
const MOST_LOG2: u32 = 4;
/// Part of the squared mean that is added to a pixel's own, as in relMSE: what a dark pixel counts for.
const EPSILON: f64 = 0.01;
/// Pixels of the other colour within two rows and columns, those first that share an edge.
const NEAR: [(i32, i32); 12] = [
    (0, -1),
    (-1, 0),
    (1, 0),
    (0, 1),
    (-1, -2),
    (1, -2),
    (-2, -1),
    (2, -1),
    (-2, 1),
    (2, 1),
    (-1, 2),
    (1, 2),
];
/// How many of them share an edge.
const NEAREST: usize = 4;
/// What the others count: little, as need changes from pixel to pixel, but enough for one of very large variance, a star, to
/// be noticed.
const FAR: f32 = 1.0 / 32.0;
/// Bytes for each pixel of the film: what it showed, what its neighbours say, and its number.
pub const BYTES_PER_PIXEL: u64 = (size_of::<Note>() + size_of::<Guess>() + size_of::<u32>()) as u64;

/// The samples that every pixel gets first: the power of two that is next to half of all, in doublings.
pub fn first_samples(spp: u32) -> u32 {
    even_samples(spp) / FIRST
}

/// The binary logarithm of the most samples of a pixel.
fn most_log2(spp: u32) -> u32 {
    (spp.ilog2() + MOST_LOG2).min(u32::BITS - 1)
}

/// The most samples that a pixel may get.
pub fn most_samples(spp: u32) -> u64 {
    1 << most_log2(spp).max(even_samples(spp).ilog2())
}

/// The power of two next to `spp`, in doublings.
fn even_samples(spp: u32) -> u32 {
    1 << f64::from(spp.max(FIRST)).log2().round().min(31.0) as u32
}

/// What was spent on pixels of one kind in the first part.
#[derive(Debug, Clone, Copy, Default)]
pub struct Spent {
    /// Rays of plain pixels.
    pub plain: RayCounts,
    /// Rays of outlines.
    pub outlines: RayCounts,
}

impl Spent {
    /// Adds another.
    pub fn add(&mut self, o: &Spent) {
        self.plain.add(&o.plain);
        self.outlines.add(&o.outlines);
    }
}

/// What the first part showed, by pixel.
pub struct Notes {
    rect: PixelRect,
    list: Vec<Note>,
    /// What it took.
    pub spent: Spent,
}

/// Samples that are traced by pixel, the first ones among them; for outlines, so many times what the film's outlines take.
pub struct Counts {
    rect: PixelRect,
    list: Vec<u32>,
    /// What pixels have where nothing is traced.
    bare: u32,
}

impl Counts {
    /// Of a pixel; 0 where nothing is traced.
    #[inline]
    pub fn of(&self, x: u32, y: u32) -> u32 {
        self.list[self.rect.index(x, y)]
    }

    /// Of a pixel, with what stands for samples where nothing is traced.
    pub fn with_bare(&self, x: u32, y: u32) -> u32 {
        match self.of(x, y) {
            0 => self.bare,
            n => n,
        }
    }

    /// The most of all that are traced.
    pub fn most(&self) -> u32 {
        self.list.iter().copied().max().unwrap_or(0)
    }
}

impl Notes {
    /// Of a film, still empty.
    pub fn new(rect: PixelRect) -> Self {
        Notes { rect, list: vec![Note::default(); rect.area()], spent: Spent::default() }
    }

    /// A tile's, row by row.
    pub fn add_tile(&mut self, tile: &PixelRect, notes: &[Note], spent: &Spent) {
        for ((x, y), note) in tile.pixels().zip(notes) {
            self.list[self.rect.index(x, y)] = *note;
        }
        self.spent.add(spent);
    }

    /// How many samples each pixel gets in all, after `first` of each, for the cost of as many of each as the settings say.
    pub fn deal(&self, first: u32, settings: &RenderSettings, outlines: Option<&Outlines>) -> Counts {
        let spp = settings.spp;
        let times = outlines.map_or(1, Outlines::times);
        let plain = self.cost(Kind::Plain, &self.spent.plain, 1);
        let costs = [plain, self.cost(Kind::Outline, &self.spent.outlines, times)];
        let means = [0, 1].map(|colour| self.mean_of(1 - colour));
        let most = most_log2(spp);
        let dealer = Dealer { first, spp, most, times: f64::from(times) };
        let width = self.rect.width() as usize;
        let place = |at: usize| (self.rect.x0 + (at % width) as u32, self.rect.y0 + (at / width) as u32);
        let guess = |at: usize| {
            let (x, y) = place(at);
            self.guess((x, y), &NEAR, means[colour(x, y)], costs, &dealer).0
        };
        let guesses: Vec<Guess> =
            (0..self.list.len()).into_par_iter().with_min_len(1 << 12).map(guess).collect();
        let plan = |wanted: usize| {
            let rows = self.rect.pixels().zip(&guesses);
            let trust = match settings.dealing {
                Dealing::ByGuess => 1.0,
                Dealing::ByNeed | Dealing::Even => self.trust(1 - wanted, costs, &dealer),
            };
            dealer.plan(rows.filter(|((x, y), _)| colour(*x, *y) == wanted).map(|(_, g)| g), trust)
        };
        let (white, black) = rayon::join(|| plan(0), || plan(1));
        let count = |at: usize| {
            let (x, y) = place(at);
            dealer.count(&[white, black][colour(x, y)], &guesses[at])
        };
        let list = (0..guesses.len()).into_par_iter().with_min_len(1 << 12).map(count).collect();
        Counts { rect: self.rect, list, bare: spp }
    }

    /// What a sample costs that meets a surface.
    fn cost(&self, kind: Kind, rays: &RayCounts, times: u32) -> f64 {
        let hits: f64 = self.list.iter().filter(|n| n.kind == kind).map(|n| f64::from(n.alpha)).sum();
        let pixels = self.list.iter().filter(|n| n.kind == kind).count() as f64;
        let met = rays.camera as f64 * hits / pixels.max(1.0);
        f64::from(times) * (rays.cost() - (rays.camera as f64 - met) * BARE_COST).max(1.0) / met.max(1.0)
    }

    /// Mean luminance of the pixels of a colour.
    fn mean_of(&self, wanted: usize) -> f64 {
        let of_colour = self.rect.pixels().zip(&self.list).filter(|(p, _)| colour(p.0, p.1) == wanted);
        let (sum, n) = of_colour.fold((0.0, 0.0), |(s, n), (_, note)| (s + f64::from(note.mean), n + 1.0));
        sum / f64::max(n, 1.0)
    }

    /// From the pixels of the same kind at some places around, or of any kind where there is none; and what makes a variance
    /// that pixel's error.
    fn guess(
        &self,
        (x, y): (u32, u32),
        near: &[(i32, i32)],
        mean: f64,
        costs: [f64; 2],
        dealer: &Dealer,
    ) -> (Guess, f64) {
        let own = self.list[self.rect.index(x, y)].kind;
        // What an outline hides, its neighbours do not show.
        let (hit, times, floor) = match own {
            Kind::Bare => return (Guess::default(), 0.0),
            Kind::Plain => (costs[0], 1.0, Floor::First),
            Kind::Outline => (costs[1], dealer.times, Floor::Even),
        };
        let [n, luminance, variance, alpha] = self.around((x, y), near, own);
        if n == 0.0 {
            return (Guess { worth: f32::NEG_INFINITY, cost: hit as f32, floor: Floor::Even }, 0.0);
        }
        // Of one sample, which of an outline is several.
        let unit = 1.0 / (((luminance / n).powi(2) + EPSILON * mean * mean) * times);
        let error = if variance > 0.0 { variance / n * unit } else { 0.0 };
        let cost = (1.0 - alpha / n).max(0.0) * BARE_COST * times + alpha / n * hit;
        (Guess { worth: (error / cost).log2() as f32, cost: cost as f32, floor }, unit)
    }

    /// Sums over the neighbours that speak for a pixel of a kind, which are those of that kind or, where there is none, all:
    /// of their weights, and weighted of their means, variances, and parts that meet a surface.
    fn around(&self, (x, y): (u32, u32), near: &[(i32, i32)], kind: Kind) -> [f64; 4] {
        let [mut same, mut any] = [[0.0f32; 4]; 2];
        for (k, (dx, dy)) in near.iter().enumerate() {
            let (i, j) = (x.wrapping_add_signed(*dx), y.wrapping_add_signed(*dy));
            if !self.rect.contains(i, j) {
                continue;
            }
            let note = &self.list[self.rect.index(i, j)];
            let weight = if k < NEAREST { 1.0 } else { FAR };
            let values = [1.0, note.mean, note.variance, note.alpha].map(|v| weight * v);
            let sums = match note.kind {
                Kind::Bare => continue,
                of if of == kind => &mut same,
                _ => &mut any,
            };
            sums.iter_mut().zip(values).for_each(|(sum, v)| *sum += v);
        }
        if same[0] > 0.0 { same } else { any }.map(f64::from)
    }
}

/// White or black.
fn colour(x: u32, y: u32) -> usize {
    ((x ^ y) & 1) as usize
}

#[cfg(test)]
mod tests;
