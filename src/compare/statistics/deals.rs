//! How often halves, dealt anew, bring as much as was seen.
//!
//! All pixels are dealt at once and all regions judged as the true ones are: what one deal says of the whole, the tiles and
//! the objects goes together as in the pictures. The probability of a verdict, of a family and of a region is
//! (1 + k) / (1 + n) if k of n deals say as much, which is right for every kind of noise and for any way of making one
//! number of many (Dwass 1957; Phipson and Smyth 2010, "Permutation P-values Should Never Be Zero"). Where k is so small
//! that it says little, chi-square's may be smaller, and is careful ([`super::exchange`]).

use super::distributions::chi_square_tail;
use super::exchange::WAYS;
use super::families::Weights;
use super::pair::Pair;
use super::results::FamilyLine;
use super::{Found, Region};
use crate::sampler::hash::mix64;
use rayon::prelude::*;
use std::collections::HashMap;

/// Deals that are made together.
const LANES: usize = 16;

/// As many deals as say as much are wanted before their share counts for more than chi-square's probability.
const LEAST: usize = 10;

/// Where so many say as much, the verdict is clear; no further deals are made if there are ...
const ENOUGH: usize = 2 * LEAST;

/// ... so many of all; and that is what tiles' probabilities are told by.
const FEWEST: usize = 200;

/// Deals at most.
const MOST: usize = 10_000;

/// Verdicts that are below their level by this factor need no deals. By moments ([`super::exchange`]) no tail is longer than
/// Chernoff's bound for chi-square (x / p)^(p / 2) exp((p - x) / 2), with p = 3 32 times chi-square's own tail where that is
/// 1e-6, and 107 times at 1e-21: not the ten thousand that would be needed.
pub const SURE: f64 = 1e-4;

/// Probabilities that are apart by no more are the same but for rounding.
const TIE: f64 = 1e-5;

/// A pixel that is dealt.
struct Card {
    cell: u32,
    number: u32,
    contrasts: [[f32; 3]; WAYS],
}

/// Sums of the differences of some pixels, by channel and deal.
type Sums = [[f64; LANES]; 3];

/// The cards of a tile. Its cells are its pixels of the same regions.
#[derive(Default)]
struct Stack {
    cards: Vec<Card>,
    groups: Vec<u32>,
}

/// All cards.
struct Deck {
    stacks: Vec<Stack>,
    /// By group of pixels, the regions that it belongs to.
    groups: Vec<Vec<u32>>,
    signs_and_ways: u64,
    seed: u64,
}

/// Probabilities of all regions, by deal.
struct Round {
    whole: [f64; LANES],
    tiles: Vec<[f64; LANES]>,
    regions: Vec<[f64; LANES]>,
}

impl Round {
    /// Of one deal, by family: of regions that have noise.
    fn ps(&self, lane: usize, found: &Found) -> [Vec<f64>; 3] {
        let of = |all: &[[f64; LANES]], have: &[Region]| {
            all.iter().zip(have).filter(|(_, r)| r.p.is_some()).map(|(p, _)| p[lane]).collect()
        };
        [
            of(&[self.whole], std::slice::from_ref(&found.whole)),
            of(&self.tiles, &found.tiles),
            of(&self.regions, &found.regions),
        ]
    }
}

/// What deals say of one probability.
#[derive(Debug, Clone, Copy, Default)]
pub struct Standing {
    seen: f64,
    /// Deals that were made.
    pub deals: usize,
    less: usize,
    same: usize,
}

impl Standing {
    fn count(&mut self, dealt: f64) {
        self.deals += 1;
        if dealt < self.seen * (1.0 - TIE) {
            self.less += 1;
        } else if dealt <= self.seen * (1.0 + TIE) {
            self.same += 1;
        }
    }

    /// How often chance alone brings as much.
    pub fn p(&self) -> f64 {
        let as_much = self.less + self.same;
        let counted = (1 + as_much) as f64 / (1 + self.deals) as f64;
        if as_much < LEAST { counted.min(self.seen) } else { counted }
    }

    /// The same with a place among those that say the same by `lot`: uniform from 0 to 1 where nothing differs.
    pub fn place(&self, lot: f64) -> f64 {
        (self.less as f64 + lot * (1 + self.same) as f64) / (1 + self.deals) as f64
    }
}

/// What deals say.
pub struct Standings {
    /// Of the verdict.
    pub verdict: Standing,
    /// Of the families, as they are listed.
    pub families: Vec<Standing>,
    /// Of the whole, the tiles and the other regions; those without noise have no meaning.
    pub whole: Standing,
    /// See `whole`.
    pub tiles: Vec<Standing>,
    /// See `whole`.
    pub regions: Vec<Standing>,
    seed: u64,
}

/// Families and their combination.
type Said = (Vec<FamilyLine>, Option<f64>);

impl Standings {
    fn new(truth: &Round, says: &dyn Fn(&Round, usize) -> Said, seed: u64) -> Standings {
        let (families, verdict) = says(truth, 0);
        let start = |seen: f64| Standing { seen, ..Standing::default() };
        let of = |all: &[[f64; LANES]]| all.iter().map(|p| start(p[0])).collect();
        Standings {
            verdict: start(verdict.unwrap_or(1.0)),
            families: families.iter().map(|f| start(f.p)).collect(),
            whole: start(truth.whole[0]),
            tiles: of(&truth.tiles),
            regions: of(&truth.regions),
            seed,
        }
    }

    /// One more deal.
    fn count(&mut self, round: &Round, lane: usize, (families, verdict): Said) {
        self.verdict.count(verdict.unwrap_or(1.0));
        self.families.iter_mut().zip(families).for_each(|(s, f)| s.count(f.p));
        self.whole.count(round.whole[lane]);
        self.tiles.iter_mut().zip(&round.tiles).for_each(|(s, p)| s.count(p[lane]));
        self.regions.iter_mut().zip(&round.regions).for_each(|(s, p)| s.count(p[lane]));
    }

    /// A number in 0 to 1 for the place of a tile or region, the same whenever these pictures are compared.
    pub fn lot(&self, number: usize) -> f64 {
        (mix64(self.seed ^ mix64(!(number as u64))) >> 11) as f64 / (1u64 << 53) as f64
    }
}

impl Deck {
    /// `tiles` and `regions` are their pixels.
    fn new(pair: &Pair, tiles: &[Vec<u32>], regions: &[Vec<u32>]) -> Deck {
        let mut groups: Vec<Vec<u32>> = vec![Vec::new()];
        let mut group_of = vec![0u32; pair.pixels()];
        let mut known: HashMap<(u32, u32), u32> = HashMap::new();
        for (region, pixels) in (0..).zip(regions) {
            for &pixel in pixels {
                let group = &mut group_of[pixel as usize];
                *group = *known.entry((*group, region)).or_insert_with(|| {
                    let mut all = groups[*group as usize].clone();
                    all.push(region);
                    groups.push(all);
                    groups.len() as u32 - 1
                });
            }
        }
        let stacks: Vec<Stack> = tiles.par_iter().map(|t| Stack::new(pair, t, &group_of)).collect();
        // Other pictures are dealt in other ways, and the same always in the same.
        let cards = stacks.iter().flat_map(|s| &s.cards);
        let seed = cards.fold(0, |h, card| mix64(h ^ u64::from(card.contrasts[0][1].to_bits())));
        Deck { stacks, groups, signs_and_ways: 2 * pair.ways as u64, seed }
    }

    /// Sixteen deals; all of them the true one without a number.
    fn deal(&self, number: Option<u64>, found: &Found) -> Round {
        let key = number.map(|n| mix64(self.seed.wrapping_add(n)));
        let dealt: Vec<(Vec<Sums>, [f64; LANES])> = self
            .stacks
            .par_iter()
            .zip(&found.tiles)
            .map(|(stack, tile)| {
                let sums = stack.deal(key, self.signs_and_ways);
                let p = probabilities(&total(&sums), &tile.finding.white);
                (sums, p)
            })
            .collect();
        let mut by_group = vec![Sums::default(); self.groups.len()];
        for (stack, (sums, _)) in self.stacks.iter().zip(&dealt) {
            stack.groups.iter().zip(sums).for_each(|(group, sums)| add(&mut by_group[*group as usize], sums));
        }
        let mut by_region = vec![Sums::default(); found.regions.len()];
        for (regions, sums) in self.groups.iter().zip(&by_group) {
            regions.iter().for_each(|r| add(&mut by_region[*r as usize], sums));
        }
        let regions = by_region.iter().zip(&found.regions);
        Round {
            whole: probabilities(&total(&by_group), &found.whole.finding.white),
            tiles: dealt.into_iter().map(|(_, p)| p).collect(),
            regions: regions.map(|(sums, r)| probabilities(sums, &r.finding.white)).collect(),
        }
    }
}

impl Stack {
    fn new(pair: &Pair, pixels: &[u32], group_of: &[u32]) -> Stack {
        let (mut stack, mut items) = (Stack::default(), Vec::new());
        for &pixel in pixels {
            if !pair.varies(pixel as usize, &mut items) {
                continue;
            }
            let group = group_of[pixel as usize];
            let cell = stack.groups.iter().position(|g| *g == group).unwrap_or_else(|| {
                stack.groups.push(group);
                stack.groups.len() - 1
            });
            let contrasts = pair.contrasts(pixel as usize).map(|c| c.map(|v| v as f32));
            stack.cards.push(Card { cell: cell as u32, number: pixel, contrasts });
        }
        stack
    }

    /// Sums of the cells.
    fn deal(&self, key: Option<u64>, signs_and_ways: u64) -> Vec<Sums> {
        let mut sums = vec![Sums::default(); self.groups.len()];
        for card in &self.cards {
            let sum = &mut sums[card.cell as usize];
            let mut choices = [[0.0f32; 3]; 2 * WAYS];
            for (i, contrast) in card.contrasts.iter().enumerate() {
                choices[2 * i] = *contrast;
                choices[2 * i + 1] = contrast.map(|v| -v);
            }
            // Digits to the base of the number of choices, from the first behind the point on: 64 bits have far more than
            // these of them. The first choice is the truth.
            let mut fraction = key.map_or(0, |key| mix64(key ^ mix64(u64::from(card.number))));
            let [r, g, b] = sum;
            for ((r, g), b) in r.iter_mut().zip(g).zip(b) {
                let product = u128::from(fraction) * u128::from(signs_and_ways);
                fraction = product as u64;
                let choice = choices[(product >> 64) as usize].map(f64::from);
                *r += choice[0];
                *g += choice[1];
                *b += choice[2];
            }
        }
        sums
    }
}

fn add(to: &mut Sums, o: &Sums) {
    to.iter_mut().flatten().zip(o.iter().flatten()).for_each(|(a, b)| *a += b);
}

fn total(all: &[Sums]) -> Sums {
    let mut sum = Sums::default();
    all.iter().for_each(|s| add(&mut sum, s));
    sum
}

/// Chi-square's, of the squared distance that `white` makes of sums.
fn probabilities(sums: &Sums, white: &[[f64; 3]]) -> [f64; LANES] {
    std::array::from_fn(|lane| {
        let along = |w: &[f64; 3]| (0..3).map(|c| w[c] * sums[c][lane]).sum::<f64>();
        chi_square_tail(white.iter().map(|w| along(w).powi(2)).sum(), white.len())
    })
}

/// Deals the halves of a pair that has [ways](Pair::ways); `tiles` and `regions` are the pixels of what was found, `alpha`
/// the level of the verdict.
pub fn deal(
    pair: &Pair,
    found: &Found,
    [tiles, regions]: [&[Vec<u32>]; 2],
    weights: &Weights,
    alpha: f64,
) -> Standings {
    let deck = Deck::new(pair, tiles, regions);
    let says = |round: &Round, lane: usize| weights.verdict(round.ps(lane, found));
    let mut all = Standings::new(&deck.deal(None, found), &says, deck.seed);
    // So many that the level is reached where LEAST say as much, and not just below it. For levels below LEAST / MOST
    // chi-square's probability decides, where few deals say as much.
    let wanted = ((LEAST as f64 / alpha) as usize).clamp(FEWEST, MOST) - 1;
    for number in 0.. {
        let round = deck.deal(Some(number), found);
        let lanes = LANES.min(wanted - all.verdict.deals);
        let said: Vec<_> = (0..lanes).into_par_iter().map(|lane| says(&round, lane)).collect();
        said.into_iter().enumerate().for_each(|(lane, said)| all.count(&round, lane, said));
        let as_much = all.verdict.less + all.verdict.same;
        if all.verdict.deals >= wanted || (all.verdict.deals >= FEWEST && as_much >= ENOUGH) {
            break;
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::super::replicates::{Replicates, Spread};
    use super::super::{Question, compare};
    use super::*;

    /// Four pixels of grey values, with as many samples in the halves as these.
    fn picture(values: [[f32; 4]; 2], counts: [f32; 2]) -> Replicates {
        let half = |h: usize| (values[h].map(|v| [v; 3]).to_vec(), Some(vec![counts[h]; 4]));
        Replicates::of_values([2, 2], Spread::Pixels, vec![half(0), half(1)])
    }

    /// All deals of a pair, of which no two pixels have the same: luminance's differences.
    fn all_deals(pair: &Pair) -> Vec<f64> {
        let pixels: Vec<Vec<f64>> = (0..4)
            .map(|pixel| pair.contrasts(pixel)[..pair.ways].iter().flat_map(|c| [c[0], -c[0]]).collect())
            .collect();
        let mut sums = vec![0.0];
        for choices in &pixels {
            sums = sums.iter().flat_map(|s| choices.iter().map(move |c| s + c)).collect();
        }
        sums
    }

    #[test]
    fn shares_are_those_of_all_deals() {
        let a = [[1.0, 1.3, 0.7, 5.0], [1.1, 1.0, 0.9, 0.2]];
        let b = [[1.9, 1.2, 1.6, 3.9], [2.3, 1.7, 2.0, 0.1]];
        for (counts, deals) in [([8.0, 8.0], 6usize.pow(4)), ([3.0, 2.0], 4usize.pow(4))] {
            let [a, b] = [a, b].map(|values| picture(values, counts));
            let pair = Pair::new(&a, &b, None).unwrap();
            let sums = all_deals(&pair);
            assert_eq!(sums.len(), deals);
            // One test, of the whole: its share is the verdict's.
            let question = Question { alpha: 0.001, ..Question::default() };
            let result = compare(&a, &b, &question).unwrap();
            let seen: f64 = (0..4).map(|pixel| pair.contrasts(pixel)[0][0]).sum();
            let as_much = sums.iter().filter(|s| s.abs() >= seen.abs() * (1.0 - 1e-9)).count();
            let share = as_much as f64 / deals as f64;
            assert!(result.deals >= FEWEST && (0.05..0.7).contains(&share), "{} {share}", result.deals);
            // Five standard errors.
            let error = 5.0 * (share * (1.0 - share) / result.deals as f64).sqrt();
            assert!((result.p.unwrap() - share).abs() < error, "{:?} {share}", result.p);
            // The covariance over all deals, which makes the distance.
            let variance = sums.iter().map(|s| s * s).sum::<f64>() / deals as f64;
            let t2 = result.whole.finding.t2;
            assert!((t2 / (seen * seen / variance) - 1.0).abs() < 1e-5, "{t2}");
        }
    }

    #[test]
    fn halves_of_unlike_numbers_of_samples_are_not_dealt() {
        let values = [[1.0, 1.3, 0.7, 5.0], [1.1, 1.0, 0.9, 0.2]];
        let ways = |a: [f32; 2], b: [f32; 2]| {
            let [a, b] = [a, b].map(|counts| picture(values, counts));
            Pair::new(&a, &b, Some(super::super::pair::Design::Independent)).unwrap().ways
        };
        assert_eq!([ways([8.0; 2], [8.0; 2]), ways([3.0, 2.0], [3.0, 2.0])], [3, 2]);
        assert_eq!([ways([8.0; 2], [9.0; 2]), ways([3.0, 2.0], [2.0, 3.0])], [0, 0]);
    }
}
