//! Is the error that `--target-error` promises the one that is reached?
//!
//!     cargo bench --bench coverage [-- FILTER] [--renders N] [--json FILE]
//!
//! Renders each of five scenes (`tests/it/adaptive/cases.rs`) N times (1,000) with other seeds to its target at 95 %, and
//! counts those whose true error, against a reference, is at most the target, and at most the bound that the render gave. A
//! scene passes unless a one-sided binomial test rejects, at 1 %, that either has a probability of at least 95 %. Exit code
//! 1 if one does not pass.

#[path = "../../tests/it/adaptive/cases.rs"]
mod cases;
// The tests use more of it than this program does.
#[expect(dead_code)]
#[path = "../../tests/it/common.rs"]
mod common;

use cases::{CASES, Prepared};
use rayon::prelude::*;
use serde::Serialize;
use skylit::report::machine::Machine;
use std::process::ExitCode;
use std::time::Instant;

/// One render.
#[derive(Serialize)]
struct Run {
    /// Against the reference.
    error: f64,
    /// What the render said.
    estimate: f64,
    /// What it said its error is below.
    at_most: f64,
    samples: u64,
    rounds: u32,
}

/// One scene.
#[derive(Serialize)]
struct Row {
    scene: &'static str,
    side: u32,
    target: f64,
    reference_error: f64,
    renders: usize,
    within: usize,
    /// Renders whose error is at most what they said it is below: without what the last round brought beyond need.
    within_bound: usize,
    passes: bool,
    /// Mean samples over those that as many samples everywhere would need on average for the target, which nobody knows
    /// beforehand.
    samples_over_even: f64,
    seconds: f64,
    runs: Vec<Run>,
}

#[derive(Serialize)]
struct Record {
    machine: Machine,
    confidence: f64,
    rows: Vec<Row>,
}

fn main() -> ExitCode {
    let (mut filter, mut renders, mut json) = (String::new(), 1000usize, None);
    let mut args = std::env::args().skip(1).filter(|a| a != "--bench");
    while let Some(a) = args.next() {
        match a.as_str() {
            "--renders" => {
                renders = args.next().and_then(|v| v.parse().ok()).expect("--renders takes a number")
            }
            "--json" => json = Some(args.next().expect("--json takes a file")),
            _ => filter = a,
        }
    }
    println!(
        "scene     target   within  within bound   RMS error  samples a pixel  of even  rounds  seconds"
    );
    let rows: Vec<Row> =
        CASES.iter().filter(|c| c.name.contains(&filter)).map(|c| measure(c, renders)).collect();
    let fine = rows.iter().all(|r| r.passes);
    let record = Record { machine: Machine::here(), confidence: 0.95, rows };
    if let Some(path) = json {
        let text = serde_json::to_string(&record).expect("figures are text");
        std::fs::write(&path, text + "\n").expect("the record can be written");
    }
    if fine { ExitCode::SUCCESS } else { ExitCode::from(1) }
}

fn measure(case: &'static cases::Case, renders: usize) -> Row {
    let start = Instant::now();
    let threads = rayon::current_num_threads();
    let prepared = Prepared::new(case, threads, 1);
    // Small pictures: a render a thread.
    let runs: Vec<Run> = (0..renders as u64)
        .into_par_iter()
        .map(|seed| {
            let r = prepared.to_target(seed, 1);
            let reached = r.stats.reached.expect("there was a target");
            assert!(reached.met, "{}: more samples are needed", case.name);
            Run {
                error: prepared.error(&r.film),
                estimate: reached.error,
                at_most: reached.at_most,
                samples: r.stats.samples,
                rounds: r.stats.rounds,
            }
        })
        .collect();
    let within = runs.iter().filter(|r| r.error <= case.target).count();
    let within_bound = runs.iter().filter(|r| r.error <= r.at_most).count();
    let samples = mean_of(&runs, |r| r.samples as f64);
    let samples_over_even = samples / samples_evenly(&prepared, samples);
    let row = Row {
        scene: case.name,
        side: case.side,
        target: case.target,
        reference_error: prepared.reference_error.sqrt(),
        renders,
        within,
        within_bound,
        passes: passes(renders, within) && passes(renders, within_bound),
        samples_over_even,
        seconds: start.elapsed().as_secs_f64(),
        runs,
    };
    let percent = 100.0 / renders as f64;
    println!(
        "{:9} {:4.1} % {:7.1} % {:14.1} % {:9.2} % {:17.0} {:8.2} {:7.1} {:8.0}{}",
        case.name,
        case.target * 100.0,
        within as f64 * percent,
        within_bound as f64 * percent,
        100.0 * mean_of(&row.runs, |r| r.error.powi(2)).sqrt(),
        samples / f64::from(case.side * case.side),
        samples_over_even,
        mean_of(&row.runs, |r| f64::from(r.rounds)),
        row.seconds,
        if row.passes { "" } else { "  too few" },
    );
    row
}

fn mean_of(runs: &[Run], value: impl Fn(&Run) -> f64) -> f64 {
    runs.iter().map(value).sum::<f64>() / runs.len() as f64
}

/// Samples with which even renders have, on average, the target's squared error: from renders of the two powers of two
/// around `guess` samples in all, between which the error is taken to be a power of the samples.
fn samples_evenly(prepared: &Prepared, guess: f64) -> f64 {
    let area = f64::from(prepared.case.side * prepared.case.side);
    let square = |spp: u32| {
        let errors =
            (0..16u64).into_par_iter().map(|s| prepared.error(&prepared.evenly(spp, 1 << 40 | s, 1).film));
        errors.map(|e| e * e).sum::<f64>() / 16.0
    };
    let low = (guess / area).log2().floor().max(2.0);
    let spp = [low, low + 1.0].map(|log| log.exp2() as u32);
    let [a, b] = spp.map(|n| square(n).log2());
    let wanted = 2.0 * prepared.case.target.log2();
    (low + (a - wanted) / (a - b)).exp2() * area
}

/// Whether a one-sided binomial test at 1 % leaves it possible that a render is within its target with 95 %.
fn passes(renders: usize, within: usize) -> bool {
    // P(at most `within`), summed from the most likely term's logarithm upwards.
    let (n, p) = (renders as f64, 0.95f64);
    let mut log_term = n * (1.0 - p).ln();
    let mut sum = log_term.exp();
    for k in 0..within {
        let k = k as f64;
        log_term += ((n - k) / (k + 1.0)).ln() + (p / (1.0 - p)).ln();
        sum += log_term.exp();
    }
    sum >= 0.01
}
