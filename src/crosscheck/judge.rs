//! The judgement on one ray that kernels do not agree on.

use super::crossing::Doubt;
use super::oracle::{Candidate, Possible};
use crate::base::hit::Hit;
use serde::Serialize;

/// What a kernel says of a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Answer {
    /// Asked for the closest hit.
    Closest(Option<Hit>),
    /// Asked whether anything is in the way.
    Any(bool),
}

impl Answer {
    /// The primitive it names.
    pub fn named(&self) -> Option<(u64, u32)> {
        match self {
            Answer::Closest(Some(h)) => Some((h.path, h.prim)),
            _ => None,
        }
    }

    /// Whether it says that something is met.
    pub fn meets(&self) -> bool {
        matches!(self, Answer::Closest(Some(_)) | Answer::Any(true))
    }
}

/// How answers to one ray differ; the worst first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Class {
    /// One misses, another hits.
    MissAgainstHit,
    /// Of any-hit queries: one is blocked, another is not.
    Occlusion,
    /// Another primitive.
    OtherPrimitive,
    /// The same primitive, its distance off by more than the bound.
    Distance,
    /// All name the same primitive, or none, where none can be.
    Agreed,
}

impl Class {
    /// All, in the order of listings.
    pub const ALL: [Class; 5] =
        [Class::MissAgainstHit, Class::Occlusion, Class::OtherPrimitive, Class::Distance, Class::Agreed];

    /// For people.
    pub fn text(self) -> &'static str {
        match self {
            Class::MissAgainstHit => "miss against hit",
            Class::Occlusion => "blocked against open",
            Class::OtherPrimitive => "another primitive",
            Class::Distance => "t beyond its bound",
            Class::Agreed => "agreed, and wrong",
        }
    }

    /// Of answers to the same question.
    pub fn of(answers: &[Answer], faults: bool) -> Self {
        let meets = answers.iter().filter(|a| a.meets()).count();
        let mixed = meets > 0 && meets < answers.len();
        let all_alike = answers.windows(2).all(|w| w[0].named() == w[1].named());
        match answers.first() {
            Some(Answer::Any(_)) if mixed => Class::Occlusion,
            _ if mixed => Class::MissAgainstHit,
            _ if !all_alike => Class::OtherPrimitive,
            _ if faults => Class::Agreed,
            _ => Class::Distance,
        }
    }
}

/// What is wrong with an answer that no careful kernel may give.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Fault {
    /// Misses what must be met.
    Misses,
    /// Meets something that cannot be met.
    MeetsNothing,
    /// Passes over a surface in front.
    PassesOver,
    /// The right primitive at a distance beyond the bound.
    Distance,
}

impl Fault {
    /// All, in the order of listings.
    pub const ALL: [Fault; 4] = [Fault::Misses, Fault::MeetsNothing, Fault::PassesOver, Fault::Distance];

    /// For people.
    pub fn text(self) -> &'static str {
        match self {
            Fault::Misses => "misses what must be met",
            Fault::MeetsNothing => "meets what cannot be met",
            Fault::PassesOver => "passes over what is in front",
            Fault::Distance => "t beyond its bound",
        }
    }
}

/// The oracle's word on an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(tag = "ruling", content = "why", rename_all = "snake_case")]
pub enum Ruling {
    /// The oracle's own answer.
    Right,
    /// Another, which rounding explains.
    Explained(Doubt),
    /// One that nothing explains.
    Wrong(Fault),
}

impl Ruling {
    /// For people.
    pub fn text(self) -> &'static str {
        match self {
            Ruling::Right => "right",
            Ruling::Explained(d) => d.text(),
            Ruling::Wrong(f) => f.text(),
        }
    }
}

/// See the module.
#[derive(Debug, Clone, PartialEq)]
pub struct Judgement {
    /// How the answers differ.
    pub class: Class,
    /// One an answer.
    pub rulings: Vec<Ruling>,
    /// What the oracle meets first.
    pub truth: Option<Candidate>,
    /// Whether the oracle looked at every primitive.
    pub complete: bool,
}

impl Judgement {
    /// Of all answers to one ray.
    pub fn new(answers: &[Answer], possible: &Possible) -> Self {
        let rulings: Vec<Ruling> = answers.iter().map(|a| rule(a, possible)).collect();
        let unheard = |r: &Ruling| matches!(r, Ruling::Wrong(f) if *f != Fault::Distance);
        let class = Class::of(answers, rulings.iter().any(unheard));
        Judgement { class, rulings, truth: possible.truth().copied(), complete: possible.complete }
    }

    /// Whether rounding explains every answer.
    pub fn is_explained(&self) -> bool {
        !self.rulings.iter().any(|r| matches!(r, Ruling::Wrong(_)))
    }

    /// The reason of the first answer that is not right.
    pub fn reason(&self) -> Ruling {
        let wrong = self.rulings.iter().find(|r| matches!(r, Ruling::Wrong(_)));
        wrong.or_else(|| self.rulings.iter().find(|r| **r != Ruling::Right)).copied().unwrap_or(Ruling::Right)
    }
}

/// An answer is explained if a careful kernel may give it: what it names may be met, and nothing that must be met lies
/// surely in front.
fn rule(answer: &Answer, possible: &Possible) -> Ruling {
    let truth = possible.truth();
    let doubt_of = |c: Option<&Candidate>| c.and_then(|c| c.crossing.doubt);
    match answer {
        Answer::Closest(Some(hit)) => rule_hit(hit, possible),
        Answer::Closest(None) | Answer::Any(false) => match (possible.nearest_sure(), truth) {
            (Some(_), _) => Ruling::Wrong(Fault::Misses),
            (None, None) => Ruling::Right,
            (None, truth) => Ruling::Explained(doubt_of(truth).unwrap_or(Doubt::Edge)),
        },
        Answer::Any(true) => match (truth, possible.candidates.first()) {
            (Some(_), _) => Ruling::Right,
            (None, None) => Ruling::Wrong(Fault::MeetsNothing),
            (None, some) => Ruling::Explained(doubt_of(some).unwrap_or(Doubt::Edge)),
        },
    }
}

fn rule_hit(hit: &Hit, possible: &Possible) -> Ruling {
    let Some(named) = possible.named_by(hit) else { return Ruling::Wrong(Fault::MeetsNothing) };
    let c = &named.crossing;
    let off = (f64::from(hit.t) - c.t).abs();
    // NaN is beyond any bound.
    if off.is_nan() || off > c.reach {
        return Ruling::Wrong(Fault::Distance);
    }
    if let Some(sure) = possible.nearest_sure()
        && c.t - c.reach > sure.crossing.t + sure.crossing.reach
    {
        return Ruling::Wrong(Fault::PassesOver);
    }
    match possible.truth() {
        Some(t) if (t.path, t.prim, t.crossing.t) == (named.path, named.prim, c.t) => Ruling::Right,
        truth => {
            let of_truth = truth.and_then(|t| t.crossing.doubt);
            Ruling::Explained(c.doubt.or(of_truth).unwrap_or(Doubt::Tie))
        }
    }
}
