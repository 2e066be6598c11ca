//! Where the samples of a fixed budget go: a first part is dealt evenly, and what it shows decides how many more each pixel
//! gets, so that the picture's relative error is least for what `spp` samples of every pixel would cost (Neyman 1934).
//!
//! A pixel's own samples must have no say in their number, or those that happen to agree end too soon (Kirk and Arvo 1991).
//! So the film is coloured like a chessboard: what white pixels need is read off the black ones around them, and what black
//! ones need off the white. Points of different pixels are independent where samples are dealt by need, hence numbers and
//! samples of a pixel are, and its mean is unbiased (but for what the two mean costs of a sample, which are counted over the
//! whole film, know of one pixel: of the order of one over the number of pixels). Totals are powers of two, of one sequence
//! of points from the first sample to the last.
//!
//! Tried: a quarter of the samples first (what no neighbour foretells, a twig or a far lamp, costs more than is gained); all
//! twelve neighbours alike (up to 1.2 times the error); the four nearest alone (8 times under the stars of `nebula`).

use super::fixed::VALUE_LIMIT;
use super::outlines::Outlines;
use crate::base::pixel_rect::PixelRect;
use crate::color::Rgb;
use crate::integrators::{BARE_COST, RayCounts};
use rayon::prelude::*;

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
/// Samples go as what they are worth to this power. Where squared errors fall as n^-a the best is 1 / (1 + a), the root for
/// independent samples; less where worth is a guess and numbers are powers of two.
const POWER: f64 = 0.4;
/// Steps of a histogram for each doubling of the number of samples.
const STEPS: f64 = 64.0;
/// Doublings that the histogram covers, half of them below one sample.
const DOUBLINGS: f64 = 128.0;

/// Bytes for each pixel of the film: what it showed, what its neighbours say, and its number.
pub const BYTES_PER_PIXEL: u64 = (size_of::<Note>() + size_of::<Guess>() + size_of::<u32>()) as u64;

/// The samples that every pixel gets first: the power of two that is next to half of all, in doublings.
pub fn first_samples(spp: u32) -> u32 {
    even_samples(spp) / FIRST
}

/// The power of two next to `spp`, in doublings.
fn even_samples(spp: u32) -> u32 {
    1 << f64::from(spp.max(FIRST)).log2().round().min(31.0) as u32
}

/// What kind of pixel; neighbours of other kinds say little of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Kind {
    /// Not sampled: bare sky that was integrated.
    #[default]
    Bare,
    /// As most.
    Plain,
    /// An outline runs through.
    Outline,
}

/// What the first samples of a pixel showed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Note {
    /// Mean luminance.
    mean: f32,
    /// Variance of a sample, such that the mean of n has one n-th of it.
    variance: f32,
    /// Part that met a surface.
    alpha: f32,
    kind: Kind,
}

impl Note {
    /// Of a pixel that needs no samples.
    pub fn bare(radiance: Rgb) -> Self {
        Note { mean: radiance.luminance(), ..Note::default() }
    }

    /// Of consecutive samples, a power of two of them from the first on. Points are stratified, so that the spread of single
    /// samples says too much: it is that of the means of groups, each of about the root of their number.
    pub fn of(li: &[Rgb], alpha: &[f32], kind: Kind) -> Self {
        let n = li.len().max(1);
        let group = 1usize << (n.ilog2() / 2);
        // As the film takes them: what is no number is left out, what is too large is cut.
        let luminance = |c: &Rgb| f64::from(c.luminance().min(VALUE_LIMIT));
        let mean_of = |g: &[Rgb]| {
            let (sum, n) =
                g.iter().filter(|c| c.is_finite()).fold((0.0, 0.0), |(s, n), c| (s + luminance(c), n + 1.0));
            (n > 0.0).then(|| sum / n)
        };
        let means = li.chunks(group).filter_map(mean_of);
        let (mut sum, mut squares, mut groups) = (0.0, 0.0, 0.0);
        for m in means {
            (sum, squares, groups) = (sum + m, squares + m * m, groups + 1.0);
        }
        let mean = sum / f64::max(groups, 1.0);
        let spread = (squares - sum * mean).max(0.0) / f64::max(groups - 1.0, 1.0);
        Note {
            mean: mean as f32,
            variance: (spread * group as f64) as f32,
            alpha: alpha.iter().sum::<f32>() / n as f32,
            kind,
        }
    }
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

/// What the other colour's pixels around say of one.
#[derive(Clone, Copy)]
struct Guess {
    /// The binary logarithm of how many samples it shall get, up to a constant.
    share: f64,
    /// What a sample costs.
    cost: f64,
    /// The fewest samples; 0 where none are needed.
    least: u32,
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

    /// How many samples each pixel gets in all, after `first` of each, for the cost of `spp` of each.
    pub fn deal(&self, first: u32, spp: u32, outlines: Option<&Outlines>) -> Counts {
        let times = outlines.map_or(1, Outlines::times);
        let plain = self.cost(Kind::Plain, &self.spent.plain, 1);
        let costs = [plain, self.cost(Kind::Outline, &self.spent.outlines, times)];
        let means = [0, 1].map(|colour| self.mean_of(1 - colour));
        let most = (spp.ilog2() + MOST_LOG2).min(u32::BITS - 1);
        let dealer = Dealer { first, spp, most, times: f64::from(times) };
        let width = self.rect.width() as usize;
        let place = |at: usize| (self.rect.x0 + (at % width) as u32, self.rect.y0 + (at / width) as u32);
        let guess = |at: usize| {
            let (x, y) = place(at);
            self.guess(x, y, means[colour(x, y)], costs, &dealer)
        };
        let guesses: Vec<Guess> =
            (0..self.list.len()).into_par_iter().with_min_len(1 << 12).map(guess).collect();
        let scale = |wanted: usize| {
            let rows = self.rect.pixels().zip(&guesses);
            dealer.scale(rows.filter(|((x, y), _)| colour(*x, *y) == wanted).map(|(_, g)| g))
        };
        let (white, black) = rayon::join(|| scale(0), || scale(1));
        let count = |at: usize| {
            let (x, y) = place(at);
            let g = &guesses[at];
            dealer.count(g.share + [white, black][colour(x, y)], g.least)
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

    /// From the pixels of the other colour and the same kind that are near, or of any kind where there is none.
    fn guess(&self, x: u32, y: u32, mean: f64, costs: [f64; 2], dealer: &Dealer) -> Guess {
        let own = self.list[self.rect.index(x, y)].kind;
        // What an outline hides, its neighbours do not show.
        let (hit, times, least) = match own {
            Kind::Bare => return Guess { share: 0.0, cost: 0.0, least: 0 },
            Kind::Plain => (costs[0], 1.0, dealer.first),
            Kind::Outline => (costs[1], dealer.times, even_samples(dealer.spp)),
        };
        let [n, luminance, variance, alpha] = self.around(x, y, own);
        if n == 0.0 {
            return Guess { share: f64::NEG_INFINITY, cost: hit, least: even_samples(dealer.spp) };
        }
        let scale = (luminance / n).powi(2) + EPSILON * mean * mean;
        // Of one sample, which of an outline is several.
        let error = if variance > 0.0 { variance / n / scale / times } else { 0.0 };
        let cost = (1.0 - alpha / n).max(0.0) * BARE_COST * times + alpha / n * hit;
        Guess { share: POWER * (error / cost).log2(), cost, least }
    }

    /// Sums over the neighbours that speak for a pixel of a kind, which are those of that kind or, where there is none, all:
    /// of their weights, and weighted of their means, variances, and parts that meet a surface.
    fn around(&self, x: u32, y: u32, kind: Kind) -> [f64; 4] {
        let [mut same, mut any] = [[0.0f32; 4]; 2];
        for (k, (dx, dy)) in NEAR.iter().enumerate() {
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

/// How numbers come from shares.
struct Dealer {
    first: u32,
    /// Whose cost may be spent.
    spp: u32,
    /// The binary logarithm of the most.
    most: u32,
    /// Camera rays of a sample of an outline.
    times: f64,
}

impl Dealer {
    /// The power of two that is nearest, where any are needed.
    fn count(&self, share: f64, least: u32) -> u32 {
        if least == 0 {
            return 0;
        }
        (1u32 << share.round().clamp(0.0, f64::from(self.most)) as u32).max(least)
    }

    /// What is to be added to shares so that samples cost what `spp` of each would; less where no noise was seen.
    fn scale<'a>(&self, guesses: impl Iterator<Item = &'a Guess>) -> f64 {
        // Costs by share, for either of two floors.
        let mut histogram = vec![[0.0; 2]; (DOUBLINGS * STEPS) as usize];
        let (mut budget, last) = (0.0, histogram.len() as f64 - 1.0);
        for g in guesses.filter(|g| g.least > 0) {
            budget += g.cost * f64::from(self.spp);
            if g.share == f64::NEG_INFINITY {
                budget -= g.cost * f64::from(g.least);
                continue;
            }
            let at = ((g.share + 0.5 * DOUBLINGS) * STEPS).clamp(0.0, last) as usize;
            histogram[at][usize::from(g.least > self.first)] += g.cost;
        }
        let floors = [self.first, even_samples(self.spp)];
        let bins: Vec<(f64, [f64; 2])> = (histogram.iter().enumerate())
            .filter(|(_, costs)| costs[0] + costs[1] > 0.0)
            .map(|(at, costs)| ((at as f64 + 0.5) / STEPS - 0.5 * DOUBLINGS, *costs))
            .collect();
        let of_bin = |share: f64, costs: &[f64; 2]| {
            (0..2).map(|i| costs[i] * f64::from(self.count(share, floors[i]))).sum::<f64>()
        };
        let spent = |scale: f64| bins.iter().map(|(share, costs)| of_bin(share + scale, costs)).sum::<f64>();
        let (mut low, mut high) = (-DOUBLINGS, DOUBLINGS);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if spent(middle) > budget { high = middle } else { low = middle }
        }
        low
    }
}

#[cfg(test)]
mod tests;
