//! Which strategies trials speak for.

use super::scout::{Class, Seen};
use super::trial::{Cell, FREEDOM, SAMPLES, Tracing, Trial};
use crate::integrators::strategy::Strategy;
use crate::integrators::{BARE_COST, RayCounts};

/// Part of the squared mean that is added to a pixel's own, as in relMSE: what a dark pixel counts for.
const EPSILON: f64 = 0.01;
/// How steeply squared errors of outlines fall by themselves: what is smooth along them is stratified.
const OUTLINE_SLOPE: f64 = 1.5;
/// How steeply squared errors fall with the number of samples: the exponent at which cost counts against variance.
const SLOPE: f64 = 1.2;
/// How much better than a material's first candidate another has to look: so much is noise.
const MARGIN: f64 = 0.7;
/// The same of a block's against its material's, whose noise is accounted for.
const BLOCK_MARGIN: f64 = 0.95;
/// Most that a block's ratio of errors is away from 1, as its natural logarithm: beyond, a few samples have said nothing.
const MOST_RATIO: f64 = 4.0;
/// Pixels of a block that tell something of how blocks differ.
const TELLING: usize = 8;

/// Strategies, decided.
pub(super) struct Choice {
    /// By class.
    pub usual: Vec<Strategy>,
    /// By block and class, where it is another.
    pub elsewhere: Vec<((usize, usize), Strategy)>,
}

impl Choice {
    /// Those of all classes, block by block.
    pub fn rows(&self, blocks: usize) -> Vec<Strategy> {
        let mut rows = self.usual.repeat(blocks);
        for ((block, class), strategy) in &self.elsewhere {
            rows[block * self.usual.len() + class] = *strategy;
        }
        rows
    }
}

/// Pixels whose noise only more camera rays lower, which are dear where each carries many light samples: those without a
/// surface, whose noise is that of the sky's picture, and outlines.
#[derive(Default)]
pub(super) struct Bare {
    /// Sum over the lattice's pixels of their squared relative errors.
    error: f64,
    /// The same of their costs.
    cost: f64,
    /// Rays that were spent.
    pub rays: RayCounts,
}

impl Bare {
    /// By trying out so many at most.
    pub fn of(tracing: &Tracing, seen: &Seen, most: usize) -> Self {
        let mut bare = Bare::default();
        for (pixels, times) in [(&seen.bare, 1), (&seen.outlined, tracing.plan.outline_times)] {
            let every = pixels.len().div_ceil(most.max(1)).max(1);
            let tried: Vec<[u32; 2]> = pixels.iter().step_by(every).copied().collect();
            let trial = tracing.any(&tried);
            let mean = trial.pixels.iter().map(|p| p.mean).sum::<f64>() / tried.len().max(1) as f64;
            let error = |p: &super::trial::Shown| relative(p.variance, p.mean, mean);
            let (each, times) = (every as f64, f64::from(times));
            bare.error += each * trial.pixels.iter().map(error).sum::<f64>() / times.powf(OUTLINE_SLOPE);
            bare.cost += pixels.len() as f64 * times * f64::from(SAMPLES) * BARE_COST;
            bare.rays.add(&trial.rays);
        }
        bare
    }
}

/// A variance as a squared error in relMSE.
fn relative(variance: f64, of_pixel: f64, of_all: f64) -> f64 {
    if variance == 0.0 { 0.0 } else { variance / (of_pixel.powi(2) + EPSILON * of_all.powi(2)) }
}

/// What a candidate came to in a cell.
struct Score {
    /// Squared relative errors by pixel.
    errors: Vec<f64>,
    error: f64,
    cost: f64,
}

/// A cell's scores, by candidate.
struct Scored {
    block: usize,
    class: usize,
    scores: Vec<Score>,
}

impl Scored {
    /// Errors are relative to the mean of all trials, so that none is favoured by its own noise.
    fn new(cell: &Cell, mean: f64) -> Self {
        let trials = cell.trials.len() as f64;
        let of_pixel = |i: usize| cell.trials.iter().map(|t| t.pixels[i].mean).sum::<f64>() / trials;
        let score = |t: &Trial| {
            let error = |(i, p): (usize, &super::trial::Shown)| relative(p.variance, of_pixel(i), mean);
            let errors: Vec<f64> = t.pixels.iter().enumerate().map(error).collect();
            Score { error: errors.iter().sum(), errors, cost: t.cost }
        };
        Scored { block: cell.block, class: cell.class, scores: cell.trials.iter().map(score).collect() }
    }

    /// The logarithm of the ratio of a candidate's error to another's, and its variance; None where there is no error.
    fn ratio(&self, of: usize, to: usize) -> Option<(f64, f64)> {
        let (a, b) = (&self.scores[of], &self.scores[to]);
        if a.error == 0.0 && b.error == 0.0 {
            return None;
        }
        let ratio = (a.error / b.error).ln().clamp(-MOST_RATIO, MOST_RATIO);
        if a.error == 0.0 || b.error == 0.0 {
            return Some((ratio, MOST_RATIO.powi(2)));
        }
        // By the pixels' parts in both; and what so few of them cannot tell, were each as good as the next.
        let parts = a.errors.iter().zip(&b.errors).map(|(a_i, b_i)| (a_i / a.error - b_i / b.error).powi(2));
        let few = 4.0 / (f64::from(FREEDOM) * a.errors.len() as f64);
        Some((ratio, parts.sum::<f64>() + few))
    }
}

/// What blocks of a class have in common in a ratio's logarithm: its mean, and the variance from block to block.
#[derive(Clone, Copy)]
struct Prior {
    mean: f64,
    variance: f64,
}

impl Prior {
    /// From ratios and the variances of their noise.
    fn of(ratios: &[(f64, f64)]) -> Option<Self> {
        let n = ratios.len() as f64;
        let weight: f64 = ratios.iter().map(|(_, noise)| 1.0 / noise).sum();
        let mean = ratios.iter().map(|(x, noise)| x / noise).sum::<f64>() / weight;
        let beyond = ratios.iter().map(|(x, noise)| (x - mean).powi(2) - noise).sum::<f64>() / n;
        (n > 1.0).then_some(Prior { mean, variance: beyond.max(0.0) })
    }

    /// What a block's ratio is expected to be, going by what it showed as far as that tells more than noise (empirical Bayes:
    /// Efron and Morris 1973).
    fn expected(&self, shown: Option<(f64, f64)>) -> f64 {
        let Some((ratio, noise)) = shown else { return self.mean };
        self.mean + self.variance / (self.variance + noise) * (ratio - self.mean)
    }
}

/// Error and cost of the whole picture, in lattice pixels.
#[derive(Clone, Copy, Default)]
struct Total {
    error: f64,
    cost: f64,
}

impl Total {
    fn score(&self) -> f64 {
        self.error * self.cost.powf(SLOPE)
    }
}

/// What decides.
pub(super) struct Judge<'a> {
    pub classes: &'a [Class<'a>],
    pub bare: Bare,
    /// Pixels of the lattice for each that was tried.
    pub every: f64,
    /// Whether samples go where they are needed, so that the product of error and cost is what counts in each block, or
    /// evenly.
    pub by_need: bool,
}

impl Judge<'_> {
    /// The strategies with which the picture comes to the same error with the fewest rays.
    pub fn decide(&self, cells: Vec<Cell>, by_block: bool) -> Choice {
        let shown = cells.iter().flat_map(|c| &c.trials).flat_map(|t| &t.pixels);
        let (sum, n) = shown.fold((0.0, 0.0), |(sum, n), p| (sum + p.mean, n + 1.0));
        let scored: Vec<Scored> = cells.iter().map(|c| Scored::new(c, sum / f64::max(n, 1.0))).collect();
        drop(cells);
        let mut of_class: Vec<Vec<&Scored>> = self.classes.iter().map(|_| Vec::new()).collect();
        scored.iter().for_each(|s| of_class[s.class].push(s));
        let best: Vec<usize> = of_class.iter().map(|cells| self.best(cells)).collect();
        let usual = self.classes.iter().zip(&best).map(|(c, &k)| c.candidates.get(k).copied());
        let mut choice =
            Choice { usual: usual.map(Option::unwrap_or_default).collect(), elsewhere: Vec::new() };
        if by_block {
            let total = self.total(&scored, &best);
            for (class, cells) in of_class.iter().enumerate().filter(|(_, cells)| cells.len() > 1) {
                let candidates = &self.classes[class].candidates;
                let others = self.others(cells, best[class], candidates.len(), &total);
                let others = others.map(|(block, k)| ((block, class), candidates[k]));
                choice.elsewhere.extend(others);
            }
        }
        choice
    }

    /// Over all cells, with what is bare.
    fn total(&self, cells: &[Scored], best: &[usize]) -> Total {
        let bare = Total { error: self.bare.error, cost: self.bare.cost };
        cells.iter().fold(bare, |sum, cell| {
            let score = &cell.scores[best[cell.class]];
            Total { error: sum.error + self.every * score.error, cost: sum.cost + self.every * score.cost }
        })
    }

    /// The candidate that is best for a class on the whole.
    fn best(&self, cells: &[&Scored]) -> usize {
        let candidates = cells.first().map_or(0, |c| c.scores.len());
        let score = |k: usize| {
            let bare = Total { error: self.bare.error, cost: self.bare.cost };
            let total = cells.iter().fold(bare, |sum, c| Total {
                error: sum.error + self.every * c.scores[k].error,
                cost: sum.cost + self.every * c.scores[k].cost,
            });
            total.score() * if k == 0 { MARGIN } else { 1.0 }
        };
        let scores = (0..candidates).map(|k| (score(k), k));
        scores.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0, |s| s.1)
    }

    /// Blocks of a class in which another candidate than its `best` is better, and which.
    fn others<'b>(
        &'b self,
        cells: &'b [&Scored],
        best: usize,
        candidates: usize,
        total: &'b Total,
    ) -> impl Iterator<Item = (usize, usize)> + 'b {
        let prior = move |k: usize| {
            let telling = cells.iter().filter(|c| c.scores[k].errors.len() >= TELLING);
            Prior::of(&telling.filter_map(|c| c.ratio(k, best)).collect::<Vec<_>>())
        };
        let priors: Vec<Option<Prior>> = (0..candidates).map(prior).collect();
        cells.iter().filter_map(move |cell| {
            let now = &cell.scores[best];
            // The logarithm of what is left of the picture's error for its cost, if this block changes.
            let left = |k: usize| {
                let ratio = priors[k]?.expected(cell.ratio(k, best));
                let cost = cell.scores[k].cost / now.cost.max(1.0);
                if self.by_need {
                    return Some(ratio + SLOPE * cost.ln() - BLOCK_MARGIN.ln());
                }
                let (error, spent) =
                    (self.every * now.error / total.error, self.every * now.cost / total.cost);
                let change = error * (ratio.exp() - BLOCK_MARGIN) + SLOPE * spent * (cost - 1.0);
                change.is_finite().then_some(change)
            };
            let others = (0..candidates).filter(|k| *k != best).filter_map(|k| Some((left(k)?, k)));
            let found = others.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(left, _)| *left < 0.0);
            found.map(|(_, k)| (cell.block, k))
        })
    }
}
