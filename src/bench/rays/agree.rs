//! Whether answers agree: with those of another row, and with the oracle's.

use super::forms::Answers;
use super::record::Differences;
use super::sets::{Workload, count, oracle, placed_primitives};
use crate::base::hit::NO_PRIMITIVE;
use crate::base::intersectable::{Intersectable, QueryKind, Visits};
use crate::base::ray::{Ray, RayBatch};
use crate::scene::Scene;
use rayon::prelude::*;

/// Tests of a primitive that the oracle may take for a workload: about a second.
const ORACLE_TESTS: u64 = 100_000_000;
/// Rays that it is asked at least, where their tests are not [`ORACLE_LIMIT`] times too many.
const ORACLE_LEAST: u64 = 16;
/// Most rays that it is asked.
const ORACLE_MOST: u64 = 4096;
/// Scenes with more primitives, all placements counted, are not given to the oracle.
const ORACLE_LIMIT: u64 = 60_000_000;
/// Rays of a workload whose visits are counted.
const COUNTED: usize = 8192;

/// Compares two answers to the same rays.
pub fn compare(a: &Answers, b: &Answers) -> Differences {
    let mut d = Differences::default();
    let both = a.prim.iter().zip(&a.path).zip(b.prim.iter().zip(&b.path));
    for ((ap, a_path), (bp, b_path)) in both {
        if (*ap == NO_PRIMITIVE) != (*bp == NO_PRIMITIVE) {
            d.hit += 1;
        } else if *ap != NO_PRIMITIVE && (ap, a_path) != (bp, b_path) {
            d.primitive += 1;
        }
    }
    // An answer that is not there at all differs.
    d.hit += a.prim.len().abs_diff(b.prim.len()) as u64;
    d
}

/// So many rays of `n`, spread evenly.
pub fn sample(n: usize, wanted: usize) -> Vec<usize> {
    let wanted = wanted.min(n);
    (0..wanted).map(|i| (i as u128 * n as u128 / wanted as u128) as usize).collect()
}

/// Answers of the oracle to some rays of a workload.
pub struct Oracle {
    /// Which rays.
    pub rays: Vec<usize>,
    answers: Answers,
}

impl Oracle {
    /// Asks it for as many rays as about a second allows: none for scenes that are too large.
    pub fn ask(scene: &Scene, batches: &[RayBatch], work: &Workload) -> Oracle {
        let primitives = placed_primitives(&scene.geometry).max(1);
        let wanted = match primitives {
            n if n > ORACLE_LIMIT => 0,
            n => (ORACLE_TESTS / n).clamp(ORACLE_LEAST, ORACLE_MOST),
        };
        let rays = sample(count(batches), wanted as usize);
        let oracle = oracle(scene);
        let all: Vec<Ray> = pick(batches, &rays);
        let one = |r: &Ray| match work.query {
            QueryKind::Closest => oracle.intersect(r).map(|h| (h.prim, h.path)),
            QueryKind::Any => oracle.occluded(r).then_some((0, 0)),
        };
        let found: Vec<_> = all.par_iter().map(one).collect();
        let mut answers = Answers::default();
        found.into_iter().for_each(|a| answers.push(a));
        Oracle { rays, answers }
    }

    /// How the answers to all rays differ from it; none if it was not asked.
    pub fn compare(&self, answers: &Answers) -> Option<Differences> {
        let pick = |i: &usize| (answers.prim.get(*i).copied(), answers.path.get(*i).copied());
        let mut picked = Answers::default();
        for (prim, path) in self.rays.iter().map(pick) {
            picked.push(prim.zip(path).filter(|(p, _)| *p != NO_PRIMITIVE));
        }
        (!self.rays.is_empty()).then(|| compare(&picked, &self.answers))
    }
}

/// The rays with these numbers, which ascend.
fn pick(batches: &[RayBatch], numbers: &[usize]) -> Vec<Ray> {
    let mut out = Vec::with_capacity(numbers.len());
    let (mut first, mut numbers) = (0, numbers.iter().peekable());
    for b in batches {
        while let Some(i) = numbers.next_if(|i| **i < first + b.len()) {
            out.push(b.get(i - first));
        }
        first += b.len();
    }
    out
}

/// Mean visits a ray; none if the kernel cannot count, or there are no rays.
pub fn visits(kernel: &dyn Intersectable, batches: &[RayBatch], query: QueryKind) -> Option<[f64; 3]> {
    let rays = pick(batches, &sample(count(batches), COUNTED));
    let mut sum = Visits::default();
    for r in &rays {
        sum += kernel.visits(r, query)?;
    }
    let mean = |n: u64| n as f64 / rays.len() as f64;
    (!rays.is_empty()).then(|| [mean(sum.nodes), mean(sum.leaves), mean(sum.primitives)])
}
