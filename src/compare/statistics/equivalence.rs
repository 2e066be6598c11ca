//! Are two pictures the same within a margin? Two one-sided tests (Schuirmann 1987) on the mean of each channel.
//!
//! *Equivalent* is said if both "the test is darker than (1 - m) times the reference" and "it is brighter than (1 + m) times"
//! are rejected at 5 %, in red, green and blue: as all must be, what is at the margin in one channel passes in at most 5 % of
//! pairs (Berger 1982). The reference is no constant; so the tests are of test - (1 - m) reference and test - (1 + m)
//! reference, with the variances of these, as Fieller (1954) has it. *Different* is said if a channel is beyond the margin
//! with the level of the verdict, shared out over the channels. What is neither needs more samples.

use super::distributions::{normal_quantile, student_tail};
use super::pair::Pair;
use super::region::{Contrast, Finding, examine};
use crate::error::{Error, Result};
use serde::Serialize;

/// How sure the answer shall be with as many more samples as are told.
const POWER: f64 = 0.9;

/// How often either answer may be wrong where the truth is at the margin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Levels {
    /// Of saying equivalent.
    pub equivalent: f64,
    /// Of saying different.
    pub different: f64,
}

/// In one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Answer {
    /// Within the margin.
    Equivalent,
    /// Beyond it.
    Different,
    /// It cannot be told.
    NotEnoughSamples,
}

/// One channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelAnswer {
    /// R, G or B.
    pub channel: &'static str,
    /// Difference over the reference.
    pub value: f64,
    /// Its standard error.
    pub error: f64,
    /// The larger p of the two tests: equivalent if it is small.
    pub p_equivalent: f64,
    /// The p of being within the margin: different if it is small.
    pub p_within: f64,
}

/// The answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Equivalence {
    /// In one word.
    pub answer: Answer,
    /// In a sentence.
    pub sentence: String,
    /// As a share.
    pub margin: f64,
    /// Channels that are not black.
    pub channels: Vec<ChannelAnswer>,
    /// How many times the samples there are would do, where these do not.
    pub samples_factor: Option<f64>,
    /// How many more samples a pixel that is, where their number is known.
    pub more_samples: Option<u64>,
}

const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// Asks it of these pixels; the margin is a share above 0 and below 1.
///
/// # Errors
/// A reference that is black.
pub fn ask(pair: &Pair, pixels: &[u32], margin: f64, levels: Levels) -> Result<Equivalence> {
    let at = |scale: f64| {
        let scaled = Pair { scale: pair.scale * scale, ways: 0, ..*pair };
        examine(&scaled, pixels)
    };
    let [low, middle, high] = [1.0 - margin, 1.0, 1.0 + margin].map(at);
    let channels: Vec<ChannelAnswer> = (0..3).filter_map(|c| channel(c, &low, &middle, &high)).collect();
    if channels.is_empty() {
        return Err(Error::Usage("a margin is a share of the reference's mean, and that is black".into()));
    }
    let count = channels.len() as f64;
    let answer = if channels.iter().all(|c| c.p_equivalent <= levels.equivalent) {
        Answer::Equivalent
    } else if channels.iter().any(|c| c.p_within <= levels.different / count) {
        Answer::Different
    } else {
        Answer::NotEnoughSamples
    };
    let factor = (answer == Answer::NotEnoughSamples)
        .then(|| channels.iter().map(|c| factor(c, margin, levels)).fold(1.0, f64::max));
    let spp = samples_per_pixel(pair, pixels.len());
    let more = factor.zip(spp).map(|(f, spp)| ((f - 1.0) * spp).ceil().max(1.0) as u64);
    let mut all = Equivalence {
        answer,
        sentence: String::new(),
        margin,
        channels,
        samples_factor: factor,
        more_samples: more,
    };
    all.sentence = all.text();
    Ok(all)
}

fn channel(c: usize, low: &Finding, middle: &Finding, high: &Finding) -> Option<ChannelAnswer> {
    let [low, middle, high] = [low, middle, high].map(|f| f.contrasts[c]);
    if middle.reference <= 0.0 {
        return None;
    }
    // How sure it is that the test is above the lower end, and below the upper one.
    let above = above(&low);
    let below = above_negative(&high);
    let beyond = above_negative(&low).min(self::above(&high));
    Some(ChannelAnswer {
        channel: CHANNELS[c],
        value: middle.difference / middle.reference,
        error: middle.error / middle.reference,
        p_equivalent: above.max(below),
        p_within: beyond,
    })
}

/// The p of "the difference is 0 or less".
fn above(c: &Contrast) -> f64 {
    if c.error > 0.0 {
        return student_tail(c.difference / c.error, c.freedom);
    }
    if c.difference > 0.0 { 0.0 } else { 1.0 }
}

/// The p of "the difference is 0 or more".
fn above_negative(c: &Contrast) -> f64 {
    above(&Contrast { difference: -c.difference, ..*c })
}

/// How many times the samples would do, if the difference is what it seems, or nothing where it does not show.
fn factor(c: &ChannelAnswer, margin: f64, levels: Levels) -> f64 {
    let seen = if c.value.abs() > 2.0 * c.error { c.value.abs() } else { 0.0 };
    let (level, power) = match seen <= margin {
        // Both tests must come out.
        true if seen == 0.0 => (levels.equivalent, 1.0 - (1.0 - POWER) / 2.0),
        true => (levels.equivalent, POWER),
        false => (levels.different / 3.0, POWER),
    };
    let room = (margin - seen).abs().max(0.05 * margin);
    let needed = normal_quantile(level) + normal_quantile(1.0 - power);
    (needed * c.error / room).powi(2)
}

/// Of the picture with fewer.
fn samples_per_pixel(pair: &Pair, pixels: usize) -> Option<f64> {
    let [a, b] = [pair.reference, pair.test].map(|r| r.samples());
    Some(a?.min(b?) / pixels.max(1) as f64)
}

impl Equivalence {
    fn text(&self) -> String {
        let margin = super::verdict::percent(self.margin);
        let worst = self.channels.iter().max_by(|a, b| a.p_equivalent.total_cmp(&b.p_equivalent));
        let Some(worst) = worst else { return String::new() };
        match self.answer {
            Answer::Equivalent => {
                // The largest reach at the level of the tests, for large degrees of freedom.
                let reach = |c: &ChannelAnswer| c.value.abs() + 1.645 * c.error;
                let most = self.channels.iter().map(reach).fold(0.0, f64::max);
                format!(
                    "equivalent: the means differ by less than {margin} (at most {} with 95 % confidence)",
                    { super::verdict::percent(most) }
                )
            }
            Answer::Different => {
                let far = self.channels.iter().min_by(|a, b| a.p_within.total_cmp(&b.p_within));
                let far = far.unwrap_or(worst);
                format!(
                    "different: {} is off by {}, which is more than {margin} (p {:.1e})",
                    colour(far.channel),
                    super::verdict::signed(far.value),
                    far.p_within
                )
            }
            Answer::NotEnoughSamples => {
                let more = match (self.more_samples, self.samples_factor) {
                    (Some(n), _) => format!("; about {n} more a pixel"),
                    (None, Some(f)) => format!("; about {f:.1} times as many pictures"),
                    _ => String::new(),
                };
                format!(
                    "not enough samples to tell {margin}{more} ({} is {} with a standard error of {})",
                    colour(worst.channel),
                    super::verdict::signed(worst.value),
                    super::verdict::percent(worst.error)
                )
            }
        }
    }
}

fn colour(channel: &str) -> &'static str {
    match channel {
        "R" => "red",
        "G" => "green",
        _ => "blue",
    }
}
