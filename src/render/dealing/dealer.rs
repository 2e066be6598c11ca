//! Numbers of samples from what they are worth, within a budget.

use super::even_samples;

/// Samples go as what they are worth to this power. Where squared errors fall as n^-a the best is 1 / (1 + a), the root for
/// independent samples; less where worth is a guess and numbers are powers of two.
const POWER: f64 = 0.4;
/// Steps of a histogram for each doubling of the number of samples.
const STEPS: f64 = 64.0;
/// Doublings that the histogram covers, half of them below one sample.
const DOUBLINGS: f64 = 128.0;

/// What is guessed of a pixel.
#[derive(Clone, Copy, Default)]
pub(super) struct Guess {
    /// The binary logarithm of what a sample is worth: the squared error that it takes away, over its cost. Infinitely little
    /// where no noise was seen, not even a pixel like it.
    pub worth: f32,
    /// What a sample costs.
    pub cost: f32,
    pub floor: Floor,
}

/// The fewest samples of a pixel.
#[derive(Clone, Copy, Default)]
pub(super) enum Floor {
    /// None are needed.
    #[default]
    None,
    /// Those of the first part.
    First,
    /// As if all had as many.
    Even,
}

/// How numbers come from guesses.
pub(super) struct Dealer {
    pub first: u32,
    /// Whose cost may be spent.
    pub spp: u32,
    /// The binary logarithm of the most.
    pub most: u32,
    /// Camera rays of a sample of an outline.
    pub times: f64,
}

/// What makes numbers of the guesses of some pixels.
#[derive(Clone, Copy)]
pub(super) struct Plan {
    /// How far guesses are believed: 0 for as many samples everywhere, 1 if they were the truth.
    trust: f64,
    /// What is added to the binary logarithms of numbers.
    scale: f64,
}

impl Plan {
    fn share(&self, guess: &Guess) -> f64 {
        POWER * self.trust * f64::from(guess.worth) + self.scale
    }
}

impl Dealer {
    /// How many samples a pixel gets: a power of two, but for plans without trust.
    pub fn count(&self, plan: &Plan, guess: &Guess) -> u32 {
        match guess.floor {
            Floor::None => 0,
            _ if plan.trust == 0.0 => self.spp,
            floor => self.nearest(plan.share(guess), self.least(floor)),
        }
    }

    fn least(&self, floor: Floor) -> u32 {
        match floor {
            Floor::None => 0,
            Floor::First => self.first,
            Floor::Even => even_samples(self.spp),
        }
    }

    fn nearest(&self, share: f64, least: u32) -> u32 {
        (1u32 << share.round().clamp(0.0, f64::from(self.most)) as u32).max(least)
    }

    /// Such that samples cost what `spp` of each would; less where no noise was seen.
    pub fn plan<'a>(&self, guesses: impl Iterator<Item = &'a Guess>, trust: f64) -> Plan {
        let unscaled = Plan { trust, scale: 0.0 };
        if trust == 0.0 {
            return unscaled;
        }
        // Costs by share, for either of two floors.
        let floors = [Floor::First, Floor::Even].map(|floor| self.least(floor));
        let mut histogram = vec![[0.0; 2]; (DOUBLINGS * STEPS) as usize];
        let (mut budget, last) = (0.0, histogram.len() as f64 - 1.0);
        for g in guesses {
            let (cost, which) = match g.floor {
                Floor::None => continue,
                Floor::First => (f64::from(g.cost), 0),
                Floor::Even => (f64::from(g.cost), 1),
            };
            budget += cost * f64::from(self.spp);
            if g.worth == f32::NEG_INFINITY {
                budget -= cost * f64::from(floors[which]);
                continue;
            }
            let at = ((unscaled.share(g) + 0.5 * DOUBLINGS) * STEPS).clamp(0.0, last) as usize;
            histogram[at][which] += cost;
        }
        let bins: Vec<(f64, [f64; 2])> = (histogram.iter().enumerate())
            .filter(|(_, costs)| costs[0] + costs[1] > 0.0)
            .map(|(at, costs)| ((at as f64 + 0.5) / STEPS - 0.5 * DOUBLINGS, *costs))
            .collect();
        let of_bin = |share: f64, costs: &[f64; 2]| {
            (0..2).map(|i| costs[i] * f64::from(self.nearest(share, floors[i]))).sum::<f64>()
        };
        let spent = |scale: f64| bins.iter().map(|(share, costs)| of_bin(share + scale, costs)).sum::<f64>();
        let (mut low, mut high) = (-DOUBLINGS, DOUBLINGS);
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if spent(middle) > budget { high = middle } else { low = middle }
        }
        // Half a bin less, so that no share of a bin is beyond what its middle was rounded to.
        Plan { trust, scale: low - 0.5 / STEPS }
    }
}
