//! No way of sampling and no ray that is spared changes a mean: each against the plain estimator, by Welch's t-test over
//! independent renders of ten scenes. `cargo test --release --test it unbiased -- --nocapture` prints what was found;
//! `SKYLIT_UNBIASED_TIMES=10` before it takes ten times the renders and sees biases of a third.

mod cases;
mod welch;

use cases::{Case, Plan, SIDE, Technique, cases, plain, techniques, too_short};
use skylit::render::{RenderStats, Renderer, Silent};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{LazyLock, Mutex};
use welch::{Welch, distance_from_uniform, student_two_sided, too_small};

/// Probability of a false alarm anywhere, of which there is one draw: seeds are fixed.
const LEVEL: f64 = 1e-3;

/// What `--sky-pixels integrate` promises of each pixel that it takes.
const SKY_PIXELS: f64 = 1e-3;

/// Biases that must be found: of a scene by itself, of all scenes together, and of a quarter that another makes up for. Less
/// is enough but where noise is largest (the room, by scattered rays alone or few samples); most scenes need a third of it.
const IN_ONE: f64 = 0.03;
const IN_ALL: f64 = 0.005;
const IN_QUARTER: f64 = 0.07;

/// Means that are compared. What is too bright in one part and too dark in another shows in the quarters.
const MEANS: [&str; 7] =
    ["luminance", "red", "blue", "upper left", "upper right", "lower left", "lower right"];

/// Means of the renders of one plan.
struct Renders {
    /// By mean, then render.
    means: [Vec<f64>; MEANS.len()],
    /// What pixels that came out the same in all renders bring to each mean, where sky may be integrated: no other can have
    /// been. Else 0.
    fixed: [f64; MEANS.len()],
    stats: Vec<RenderStats>,
}

impl Renders {
    /// `seed` holds scene and technique; no two renders of this file share one.
    fn new(case: &Case, plan: &Plan, seed: u64, renders: u64) -> Self {
        let scene = case.scene(plan.sampling);
        let mut out = Renders { means: Default::default(), fixed: [0.0; MEANS.len()], stats: Vec::new() };
        let mut same: Vec<Option<[f32; 3]>> = Vec::new();
        for k in 0..renders {
            let mut plan = plan.clone();
            plan.settings.seed = seed << 32 | k;
            let renderer = Renderer { integrator: plan.integrator(), settings: plan.settings };
            let rendered = renderer.render(scene, &Silent).unwrap();
            let film = &rendered.film;
            let pixels: Vec<[f32; 3]> =
                film.window().pixels().map(|(x, y)| film.mean(x, y).to_array()).collect();
            if k == 0 {
                same = pixels.iter().copied().map(Some).collect();
            }
            for (same, now) in same.iter_mut().zip(&pixels) {
                *same = same.filter(|s| s == now);
            }
            let now = means(pixels.into_iter());
            out.means.iter_mut().zip(now).for_each(|(all, now)| all.push(now));
            out.stats.push(rendered.stats);
        }
        if plan.settings.skip_background {
            out.fixed = means(same.into_iter().map(Option::unwrap_or_default));
        }
        out
    }

    /// Against those of the plain estimator.
    fn against(&self, plain: &Renders) -> [Welch; MEANS.len()] {
        std::array::from_fn(|m| Welch::new(&self.means[m], &plain.means[m], SKY_PIXELS * self.fixed[m]))
    }

    /// As if the pixels of each quarter were so many times as bright.
    fn scaled(&self, quarters: [f64; 4]) -> Renders {
        let mut means = self.means.clone();
        for (values, factor) in means[3..].iter_mut().zip(quarters) {
            values.iter_mut().for_each(|v| *v *= factor);
        }
        for k in 0..means[0].len() {
            let luminance = means[3..].iter().map(|quarter| 0.25 * quarter[k]).sum::<f64>();
            let factor = luminance / means[0][k];
            // Exact for luminance, and for colours where all factors are one.
            means[..3].iter_mut().for_each(|values| values[k] *= factor);
        }
        Renders { means, fixed: self.fixed, stats: Vec::new() }
    }
}

/// See [`MEANS`].
fn means(pixels: impl Iterator<Item = [f32; 3]>) -> [f64; MEANS.len()] {
    let mut sums = [0.0; MEANS.len()];
    let n = f64::from(SIDE * SIDE);
    for (i, [r, g, b]) in (0..).zip(pixels) {
        let luminance = f64::from(skylit::color::Rgb::new(r, g, b).luminance());
        let quarter = 3 + (i % SIDE * 2 / SIDE + 2 * (i / SIDE * 2 / SIDE)) as usize;
        sums[0] += luminance / n;
        sums[1] += f64::from(r) / n;
        sums[2] += f64::from(b) / n;
        sums[quarter] += 4.0 * luminance / n;
    }
    sums
}

/// Works on all cores, in any order.
fn each<T: Send>(n: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let (next, done) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, |n| n.get()) {
            scope.spawn(|| {
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    if i >= n {
                        break;
                    }
                    let result = work(i);
                    done.lock().unwrap().push((i, result));
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap();
    done.sort_by_key(|d| d.0);
    done.into_iter().map(|d| d.1).collect()
}

/// What was rendered.
struct Trial {
    cases: Vec<Case>,
    /// The plain estimator, all that is on trial, and a real bias.
    techniques: Vec<Technique>,
    /// By technique, then scene; None where it is not tried.
    renders: Vec<Vec<Option<Renders>>>,
}

static TRIAL: LazyLock<Trial> = LazyLock::new(|| {
    let start = std::time::Instant::now();
    let times = std::env::var("SKYLIT_UNBIASED_TIMES").map_or(1, |n| n.parse().expect("a number of times"));
    let cases = cases();
    let all = [vec![plain()], techniques(), vec![too_short()]];
    let techniques: Vec<Technique> = all.into_iter().flatten().collect();
    let n = cases.len();
    let mut flat = each(techniques.len() * n, |i| {
        let (technique, case) = (&techniques[i / n], &cases[i % n]);
        let mut plan = Plan::plain(case);
        (technique.change)(&mut plan);
        (technique.applies)(case).then(|| Renders::new(case, &plan, i as u64, times * technique.renders))
    })
    .into_iter();
    let renders = techniques.iter().map(|_| flat.by_ref().take(n).collect()).collect();
    println!("{:.1} s of renders", start.elapsed().as_secs_f64());
    Trial { cases, techniques, renders }
});

/// The tests of one technique.
struct Verdict<'a> {
    technique: &'a Technique,
    /// By scene in which it is tried.
    tests: Vec<(&'a Case, [Welch; MEANS.len()])>,
}

impl Trial {
    /// All that is on trial; `change` may bias what was rendered.
    fn verdicts(&self, change: impl Fn(&Renders) -> Renders) -> Vec<Verdict<'_>> {
        (1..self.techniques.len() - 1).map(|t| self.verdict(t, &change)).collect()
    }

    fn verdict(&self, t: usize, change: impl Fn(&Renders) -> Renders) -> Verdict<'_> {
        let tried = self.renders[t].iter().zip(&self.renders[0]).zip(&self.cases);
        let tests = tried.filter_map(|((ours, plain), case)| {
            let (ours, plain) = (change(ours.as_ref()?), plain.as_ref()?);
            Some((case, ours.against(plain)))
        });
        Verdict { technique: &self.techniques[t], tests: tests.collect() }
    }
}

/// As it was rendered.
fn unchanged(renders: &Renders) -> Renders {
    renders.scaled([1.0; 4])
}

impl Verdict<'_> {
    /// All scenes together: a bias that is everywhere the same shows first in the sum of what they are off, of which each
    /// has the variance of Student's t.
    fn together(&self) -> f64 {
        let lumas = || self.tests.iter().map(|(_, means)| &means[0]);
        let variance = lumas().map(|w| w.freedom / (w.freedom - 2.0)).sum::<f64>();
        let t = lumas().map(Welch::t).sum::<f64>() / variance.sqrt();
        student_two_sided(t, lumas().map(|w| w.freedom).sum())
    }

    /// All probabilities: by scene and mean, and at last that of all scenes together.
    fn ps(&self) -> Vec<f64> {
        self.tests.iter().flat_map(|(_, means)| means.iter().map(Welch::p)).chain([self.together()]).collect()
    }

    /// Which of them that is.
    fn name(&self, i: usize) -> String {
        match self.tests.get(i / MEANS.len()) {
            Some((case, w)) => {
                let m = i % MEANS.len();
                format!("{}, {}, {}: {:?}, p {:e}", self.technique.name, case.name, MEANS[m], w[m], w[m].p())
            }
            None => format!("{}, all scenes together: p {:e}", self.technique.name, self.together()),
        }
    }
}

/// A single probability so small is too small for chance, however many there are.
fn surely(verdicts: &[Verdict]) -> f64 {
    LEVEL / verdicts.iter().map(|v| v.ps().len()).sum::<usize>() as f64
}

#[test]
fn no_technique_changes_a_mean() {
    let verdicts = TRIAL.verdicts(unchanged);
    print_summary(&verdicts);
    let ps: Vec<f64> = verdicts.iter().flat_map(Verdict::ps).collect();
    let names: Vec<String> = verdicts.iter().flat_map(|v| (0..v.ps().len()).map(|i| v.name(i))).collect();
    let wrong: Vec<&String> = too_small(&ps, LEVEL).into_iter().map(|i| &names[i]).collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// For people: whether probabilities are spread evenly, and what a bias would have to be to be found.
fn print_summary(verdicts: &[Verdict]) {
    let level = surely(verdicts);
    let share =
        |ps: &[f64], below: f64| 100.0 * ps.iter().filter(|p| **p < below).count() as f64 / ps.len() as f64;
    let line = |name: &str, ps: &[f64]| {
        let least = ps.iter().copied().fold(1.0, f64::min);
        let shares = [0.01, 0.1, 0.5].map(|below| share(ps, below));
        let distance = distance_from_uniform(ps) * (ps.len() as f64).sqrt();
        let [a, b, c] = shares;
        print!(
            "{name:24} {:4} least {least:.1e}, below 0.01 {a:3.1} %, 0.1 {b:4.1} %, 0.5 {c:4.1} %, ",
            ps.len()
        );
        println!("sqrt(n) D {distance:.2}");
    };
    let equal = |v: &Verdict| -> Vec<f64> {
        v.tests.iter().flat_map(|(_, means)| means.iter().map(Welch::p_of_equal)).collect()
    };
    for v in verdicts {
        line(v.technique.name, &equal(v));
        let found = |(case, means): &(&Case, [Welch; MEANS.len()])| {
            let w = &means[0];
            let [off, error] = [w.difference, w.error].map(|x| 100.0 * x / w.mean);
            format!("{} {off:+.2}+-{error:.2}/{:.1}", case.name, 100.0 * w.detectable(level))
        };
        let off: Vec<String> = v.tests.iter().map(found).collect();
        println!("  together {:.3}; off by +- / found if (%): {}", v.together(), off.join(", "));
    }
    line("all, nothing allowed", &verdicts.iter().flat_map(equal).collect::<Vec<f64>>());
}

#[test]
fn each_technique_had_a_say() {
    for (technique, scenes) in TRIAL.techniques.iter().zip(&TRIAL.renders) {
        let acts = |r: &&Renders| r.stats.iter().any(technique.acts);
        let scenes: Vec<bool> = scenes.iter().flatten().map(|r| acts(&r)).collect();
        let count = scenes.iter().filter(|acts| **acts).count();
        assert!(count >= technique.least, "{}: {scenes:?}", technique.name);
    }
}

/// A green test says something: biases are found, in each scene, in parts of the picture, in all scenes together.
#[test]
fn small_biases_are_found() {
    let level = surely(&TRIAL.verdicts(unchanged));
    // Twice the largest that [`Welch::detectable`] finds.
    let brighter = TRIAL.verdicts(|r| r.scaled([1.0 + IN_ONE; 4]));
    for v in &brighter {
        for (case, means) in &v.tests {
            assert!(means[0].p() < level, "{}, {}: {:?}", v.technique.name, case.name, means[0]);
        }
    }
    for v in TRIAL.verdicts(|r| r.scaled([1.0 + IN_ALL; 4])) {
        assert!(v.together() < level, "{}: {}", v.technique.name, v.together());
    }
    // As much light as is missing below on the left is too much below on the right.
    let moved = TRIAL.verdicts(|r| {
        let [left, right] = [5, 6].map(|m| r.means[m].iter().sum::<f64>());
        r.scaled([1.0, 1.0, 1.0 - IN_QUARTER, 1.0 + IN_QUARTER * left / right])
    });
    for v in &moved {
        for (case, means) in &v.tests {
            let least = means[3..].iter().map(Welch::p).fold(1.0, f64::min);
            assert!(least < level, "{}, {}: {:?}", v.technique.name, case.name, &means[3..]);
        }
    }
    // And one that a renderer may have: 1 % in most of them, 9 % where light comes by many ways.
    let short = TRIAL.verdict(TRIAL.techniques.len() - 1, unchanged);
    let found = short.tests.iter().filter(|(_, means)| means[0].p() < level).count();
    assert!(found >= 8 && short.together() < level, "{found}, {}", short.together());
}
