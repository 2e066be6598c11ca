//! Counts of judgements.

use super::crossing::Doubt;
use super::judge::{Class, Fault, Judgement, Ruling};
use serde::Serialize;

/// How the answers of one kernel, asked in one style, were judged, over the rays that were not agreed on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Score {
    /// The oracle's own answer.
    pub right: u64,
    /// By reason, in the order of [`Doubt::ALL`].
    pub explained: [u64; 4],
    /// By fault, in the order of [`Fault::ALL`].
    pub wrong: [u64; 4],
}

impl Score {
    /// Answers other than the oracle's that rounding explains.
    pub fn explained_total(&self) -> u64 {
        self.explained.iter().sum()
    }

    /// Answers that nothing explains.
    pub fn wrong_total(&self) -> u64 {
        self.wrong.iter().sum()
    }

    fn cell(&mut self, ruling: Ruling) -> &mut u64 {
        fn at<T: PartialEq>(all: [T; 4], one: T) -> usize {
            all.iter().position(|x| *x == one).unwrap_or(0)
        }
        match ruling {
            Ruling::Right => &mut self.right,
            Ruling::Explained(d) => &mut self.explained[at(Doubt::ALL, d)],
            Ruling::Wrong(f) => &mut self.wrong[at(Fault::ALL, f)],
        }
    }
}

/// See the module.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Tally {
    /// Differences by class, in the order of [`Class::ALL`]: explained, unexplained.
    pub classes: [[u64; 2]; 5],
    /// One a kernel and style: single and batch of the first kernel, of the second, ...
    pub scores: Vec<Score>,
    /// Differences for which the oracle looked at every primitive.
    pub complete: u64,
    /// Differences that were only counted because there were too many of them.
    pub lost: u64,
}

impl Tally {
    /// For so many kernels.
    pub fn new(kernels: usize) -> Self {
        Tally { scores: vec![Score::default(); 2 * kernels], ..Tally::default() }
    }

    /// Counts a judgement.
    pub fn add(&mut self, j: &Judgement) {
        self.count(j, |n| *n += 1);
    }

    /// Takes back a judgement that was counted.
    pub fn take_back(&mut self, j: &Judgement) {
        self.count(j, |n| *n = n.saturating_sub(1));
    }

    fn count(&mut self, j: &Judgement, step: impl Fn(&mut u64)) {
        let class = Class::ALL.iter().position(|c| *c == j.class).unwrap_or(0);
        step(&mut self.classes[class][usize::from(!j.is_explained())]);
        for (score, ruling) in self.scores.iter_mut().zip(&j.rulings) {
            step(score.cell(*ruling));
        }
        if j.complete {
            step(&mut self.complete);
        }
    }

    /// Adds another tally of the same kernels.
    pub fn merge(&mut self, o: &Tally) {
        let add = |a: &mut [u64], b: &[u64]| a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        add(self.classes.as_flattened_mut(), o.classes.as_flattened());
        for (a, b) in self.scores.iter_mut().zip(&o.scores) {
            a.right += b.right;
            add(&mut a.explained, &b.explained);
            add(&mut a.wrong, &b.wrong);
        }
        self.complete += o.complete;
        self.lost += o.lost;
    }

    /// All differences that were judged.
    pub fn differences(&self) -> u64 {
        self.classes.as_flattened().iter().sum()
    }

    /// Those that nothing explains.
    pub fn unexplained(&self) -> u64 {
        self.classes.iter().map(|c| c[1]).sum()
    }
}
