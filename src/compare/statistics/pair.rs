//! Two pictures with their replicates, pixel by pixel.

use super::matrix::dot;
use super::replicates::{Replicates, Spread};
use crate::error::{Error, Result};
use serde::Serialize;

/// Rec. 709 luminance weights.
pub const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Half of the film's step (see [`crate::render::fixed`]), and as much again: what values below it round to is chance.
const STEP: f64 = 1.2e-7;

/// Spreads of two pictures go together if pixels in which they have the same sign exceed the others by so many deviations ...
const DEPENDENT_DEVIATES: f64 = 8.0;
/// ... and by such a share of all.
const DEPENDENT_SHARE: f64 = 0.05;

/// Numbers of samples are unlike if they differ by this factor.
const UNLIKE: f64 = 1.5;

/// What is random in what.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Design {
    /// Both have random choices of their own: their variances add up.
    Independent,
    /// Both made the same choices, so that differences of replicates are what varies: common random numbers.
    Paired,
}

/// Why that design was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reason {
    /// Seeds differ, or are not known and nothing shows that they are the same.
    Apart,
    /// Both files name the same seed.
    SameSeed,
    /// The noise of both goes together.
    SameNoise,
    /// The caller said so.
    Told,
}

/// Two pictures under test.
pub struct Pair<'a> {
    /// The one that is held to be right.
    pub reference: &'a Replicates,
    /// The other.
    pub test: &'a Replicates,
    /// What is random in what.
    pub design: Design,
    /// Why.
    pub reason: Reason,
    /// What the reference's values are multiplied by before they are compared: 1 but for tests of a margin.
    pub scale: f64,
    /// What two numbers that are meant to be the same may differ by, relatively.
    pub(super) digits: f64,
    /// How many times the reference's samples the test has, where both are known and unlike.
    pub(super) ratio: Option<f64>,
    /// Contrasts of a pixel, see [`super::exchange`]; 0 if halves cannot be dealt anew.
    pub(super) ways: usize,
}

/// A pixel of both.
pub struct Visit {
    /// Mean of the reference.
    pub reference: [f64; 3],
    /// Mean of the other.
    pub test: [f64; 3],
    /// What differences of each channel rounding explains.
    pub tolerance: [f64; 3],
}

/// An independent random vector of mean 0 whose covariance adds to that of the difference: its outer product is an estimate
/// of that part with one degree of freedom.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Item {
    /// Linear RGB.
    pub value: [f64; 3],
    /// Whether it comes from the test, or else from the reference; paired ones from both, and count as the reference's.
    pub of_test: bool,
}

/// How a pixel can be used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// It has a mean and a spread in both.
    Good,
    /// A value is not finite.
    NotFinite,
    /// A picture has less than two replicates of it.
    NoSpread,
}

impl<'a> Pair<'a> {
    /// Decides the design by seeds and by the noise, unless it is told.
    ///
    /// # Errors
    /// Sizes that differ; a design of pairs of unlike numbers of replicates.
    pub fn new(reference: &'a Replicates, test: &'a Replicates, design: Option<Design>) -> Result<Self> {
        if reference.size != test.size {
            let [a, b] = [reference, test].map(|r| format!("{}x{}", r.size[0], r.size[1]));
            return Err(Error::Usage(format!(
                "the reference is {a} and the other picture {b}: a test for bias needs the same pixels"
            )));
        }
        let digits = f64::from(reference.digits.max(test.digits));
        let mut pair = Pair {
            reference,
            test,
            design: Design::Independent,
            reason: Reason::Apart,
            scale: 1.0,
            digits,
            ratio: None,
            ways: 0,
        };
        let alike = reference.len() == test.len() && reference.spread == test.spread;
        (pair.design, pair.reason) = match design {
            Some(Design::Paired) if !alike => {
                return Err(Error::Usage(format!(
                    "{} replicates and {} make no pairs",
                    reference.len(),
                    test.len()
                )));
            }
            Some(design) => (design, Reason::Told),
            None if alike && pair.same_seed() => (Design::Paired, Reason::SameSeed),
            None if alike && pair.share_noise() => (Design::Paired, Reason::SameNoise),
            None => (Design::Independent, Reason::Apart),
        };
        pair.ratio = pair.unlike_samples();
        pair.ways = pair.count_ways();
        Ok(pair)
    }

    fn unlike_samples(&self) -> Option<f64> {
        let samples = |r: &Replicates| if r.spread == Spread::Pixels { r.samples() } else { None };
        let (m, n) = (samples(self.reference)?, samples(self.test)?);
        let unlike = m.max(n) >= UNLIKE * m.min(n);
        (self.design == Design::Independent && unlike).then_some(n / m)
    }

    fn same_seed(&self) -> bool {
        let [a, b] = [self.reference, self.test].map(|r| &r.origin);
        a.seed.is_some() && a.seed == b.seed
    }

    /// Whether the spreads of both go together. Replicates of independent pictures are as often off to the same side as to
    /// opposite ones, whatever their distribution: a fair coin for each pixel.
    fn share_noise(&self) -> bool {
        let (mut together, mut all) = (0.0f64, 0.0f64);
        let [mut a, mut b] = [Vec::new(), Vec::new()];
        for pixel in 0..self.pixels() {
            a.clear();
            b.clear();
            if spread(self.reference, pixel, false, &mut a).is_none()
                || spread(self.test, pixel, true, &mut b).is_none()
            {
                continue;
            }
            for (a, b) in a.iter().zip(&b) {
                let product = dot(LUMINANCE, a.value) * dot(LUMINANCE, b.value);
                if product.is_finite() && product != 0.0 {
                    together += product.signum();
                    all += 1.0;
                }
            }
        }
        together > DEPENDENT_DEVIATES * all.sqrt() && together > DEPENDENT_SHARE * all
    }

    /// How many pixels.
    pub fn pixels(&self) -> usize {
        self.reference.size[0] * self.reference.size[1]
    }

    /// Whether both sides' pixels are independent.
    pub fn by_pixels(&self) -> bool {
        [self.reference, self.test].iter().all(|r| r.spread == Spread::Pixels)
    }

    /// The means of a pixel; its spread goes to `items`, which is emptied first.
    pub fn visit(&self, pixel: usize, items: &mut Vec<Item>) -> Result<Visit, Use> {
        items.clear();
        let visit = match self.design {
            Design::Independent => {
                let reference = spread(self.reference, pixel, false, items).ok_or(Use::NoSpread)?;
                items.iter_mut().for_each(|i| i.value = i.value.map(|v| v * self.scale));
                let test = spread(self.test, pixel, true, items).ok_or(Use::NoSpread)?;
                [reference.map(|v| v * self.scale), test]
            }
            Design::Paired => {
                let [reference, difference] = self.paired(pixel, items).ok_or(Use::NoSpread)?;
                [reference, [0, 1, 2].map(|c| reference[c] + difference[c])]
            }
        };
        let [reference, test] = visit;
        if !reference.iter().chain(&test).chain(items.iter().flat_map(|i| &i.value)).all(|v| v.is_finite()) {
            return Err(Use::NotFinite);
        }
        let tolerance = [0, 1, 2].map(|c| self.digits * reference[c].abs().max(test[c].abs()) + STEP);
        Ok(Visit { reference, test, tolerance })
    }

    /// Whether a pixel is used and has noise, or a difference beyond rounding; `items` is for its use.
    pub(super) fn varies(&self, pixel: usize, items: &mut Vec<Item>) -> bool {
        self.visit(pixel, items).is_ok_and(|visit| !visit.is_quiet(items))
    }

    /// Mean of the reference and of the differences of its replicates from those of the test.
    fn paired(&self, pixel: usize, items: &mut Vec<Item>) -> Option<[[f64; 3]; 2]> {
        let mut reference = Running::default();
        let mut difference = Running::default();
        for part in 0..self.reference.len() {
            let (x, m) = self.reference.value(part, pixel);
            let (y, n) = self.test.value(part, pixel);
            if m > 0.0 && n > 0.0 {
                // Variances fall as numbers of samples rise; those of both count.
                let weight = m * n / (m + n);
                let x = x.map(|v| v * self.scale);
                reference.add(x, weight);
                if let Some(value) = difference.add([0, 1, 2].map(|c| y[c] - x[c]), weight) {
                    items.push(Item { value, of_test: false });
                }
            }
        }
        difference.finish(items, 0)?;
        Some([reference.mean, difference.mean])
    }
}

/// The mean of a pixel's replicates; one item for each replicate but one goes to `items`. `None` if there are less than two.
///
/// With replicates a_r of n_r samples, N_r the sum of the first r of these and m_r the mean of the first r, the items are
/// (a_r - m_{r-1}) sqrt(n_r N_{r-1} / N_r) / sqrt((k - 1) N_k): independent of each other and of the mean for normal noise,
/// with a sum of squares of sum n_r (a_r - m_k)^2 / ((k - 1) N_k), the usual estimate of the mean's variance (Helmert's
/// contrasts, weighted).
fn spread(of: &Replicates, pixel: usize, of_test: bool, items: &mut Vec<Item>) -> Option<[f64; 3]> {
    let (mut running, from) = (Running::default(), items.len());
    for part in 0..of.len() {
        let (value, n) = of.value(part, pixel);
        if n > 0.0
            && let Some(value) = running.add(value, n)
        {
            items.push(Item { value, of_test });
        }
    }
    running.finish(items, from)?;
    Some(running.mean)
}

/// A weighted mean that grows.
#[derive(Default)]
pub(super) struct Running {
    pub mean: [f64; 3],
    weight: f64,
    values: usize,
}

impl Running {
    /// One more value; from the second on, its contrast with those before.
    pub fn add(&mut self, value: [f64; 3], weight: f64) -> Option<[f64; 3]> {
        let before = self.weight;
        self.weight += weight;
        self.values += 1;
        let off = [0, 1, 2].map(|c| value[c] - self.mean[c]);
        let share = weight / self.weight;
        (0..3).for_each(|c| self.mean[c] += share * off[c]);
        (self.values > 1).then(|| off.map(|v| v * (share * before).sqrt()))
    }

    /// Brings contrasts, from number `from` on, to the scale of the mean.
    pub fn finish(&self, items: &mut [Item], from: usize) -> Option<()> {
        if self.values < 2 {
            return None;
        }
        let scale = 1.0 / ((self.values - 1) as f64 * self.weight).sqrt();
        items[from..].iter_mut().for_each(|i| i.value = i.value.map(|v| v * scale));
        Some(())
    }
}

impl Visit {
    /// Test less reference.
    pub fn difference(&self) -> [f64; 3] {
        [0, 1, 2].map(|c| self.test[c] - self.reference[c])
    }

    /// Whether nothing varies, and nothing differs, beyond rounding.
    pub fn is_quiet(&self, items: &[Item]) -> bool {
        let is_still = |i: &Item| (0..3).all(|c| i.value[c].abs() <= self.tolerance[c]);
        items.iter().all(is_still) && self.is_within_tolerance()
    }

    /// Whether rounding explains the difference.
    pub fn is_within_tolerance(&self) -> bool {
        self.difference().iter().zip(self.tolerance).all(|(d, t)| d.abs() <= t)
    }
}

impl Pair<'_> {
    /// The value of one replicate of a side (0: the reference, scaled; 1: the test); of paired ones, the difference.
    pub fn part(&self, side: usize, part: usize, pixel: usize) -> [f64; 3] {
        let reference = || self.reference.value(part, pixel).0.map(|v| v * self.scale);
        match (self.design, side) {
            (Design::Independent, 0) => reference(),
            (Design::Independent, _) => self.test.value(part, pixel).0,
            (Design::Paired, _) => {
                let (a, b) = (reference(), self.test.value(part, pixel).0);
                [0, 1, 2].map(|c| b[c] - a[c])
            }
        }
    }
}
