//! Renders to a target error: coverage, determinism, bias, and where there is no error at all.

mod cases;

use crate::common::{integrator, scene, settings};
use cases::{CASES, Prepared};
use skylit::render::adaptive::{Part, Target};
use skylit::render::settings::RenderSettings;
use skylit::render::{Rendered, Renderer, Silent};
use std::time::Duration;

const PICTURE: Target = Target { error: 0.1, confidence: 0.95, part: Part::Picture };

/// The short form of `cargo bench --bench coverage`: references of a sixteenth of the samples, whose own error is taken
/// off, and few renders.
#[test]
fn the_true_error_is_within_the_target() {
    const RENDERS: u64 = 6;
    let mut within = 0;
    for case in &CASES {
        let p = Prepared::new(case, 2, 16);
        for seed in 0..RENDERS {
            let r = p.to_target(seed, 2);
            let reached = r.stats.reached.unwrap();
            assert!(reached.met && reached.at_most <= case.target, "{}: {reached:?}", case.name);
            within += u32::from(p.error(&r.film).powi(2) - p.reference_error <= case.target.powi(2));
        }
    }
    // At 95 % each, fewer than 24 of 30 are within in 3 of 10,000 runs.
    assert!(within >= 24, "{within} of 30");
}

#[test]
fn threads_change_no_bit_of_a_render_to_a_target() {
    let p = Prepared::new(&CASES[0], 2, 256);
    for part in [Part::Picture, Part::Block] {
        let target = Some(Target { error: 0.03, part, ..PICTURE });
        let renders = [1, 2, 7].map(|threads| {
            p.render(RenderSettings { spp: 4096, target, threads, seed: 5, ..settings(&p.scene) })
        });
        let spp = |r: &Rendered| [r.stats.spp_least, r.stats.spp, r.stats.rounds];
        assert!(renders[0].stats.reached.unwrap().met);
        assert!(part == Part::Picture || spp(&renders[0])[0] < spp(&renders[0])[1], "all blocks alike");
        for r in &renders[1..] {
            assert!(r.film == renders[0].film && spp(r) == spp(&renders[0]));
            assert_eq!(r.stats.reached, renders[0].stats.reached);
        }
    }
}

/// A clock says how many rounds there are; where samples go, the rounds say.
#[test]
fn a_clock_sets_only_how_many_rounds_there_are() {
    let p = Prepared::new(&CASES[0], 2, 256);
    let timed = |threads, time| {
        p.render(RenderSettings { spp: 200, time: Some(time), threads, ..settings(&p.scene) })
    };
    let none = timed(2, Duration::ZERO);
    assert_eq!([none.stats.rounds, none.stats.spp_least, none.stats.spp], [1, 8, 8]);
    // Time enough: every pixel has all it may have, as with a number of samples.
    let long = timed(1, Duration::from_secs(3600));
    assert_eq!([long.stats.spp_least, long.stats.spp], [200, 200]);
    assert!(long.film == p.evenly(200, 0, 2).film);
}

/// Means of adaptive renders against those of fixed ones: Welch's test, a false alarm in 10,000.
#[test]
fn samples_by_need_do_not_change_the_mean() {
    const RENDERS: usize = 40;
    let p = Prepared::of_side(&CASES[3], 48, 2, 1024);
    let mean = |r: &Rendered| {
        let pixels = r.film.window().pixels();
        pixels.map(|(x, y)| f64::from(r.film.mean(x, y).luminance())).sum::<f64>() / 2304.0
    };
    let moments = |values: Vec<f64>| {
        let m = values.iter().sum::<f64>() / RENDERS as f64;
        let v = values.iter().map(|x| (x - m).powi(2)).sum::<f64>() / (RENDERS - 1) as f64;
        (m, v / RENDERS as f64)
    };
    let mut uneven = 0;
    let adaptive = (0..RENDERS as u64).map(|seed| {
        let target = Some(Target { error: 0.8, ..PICTURE });
        let r = p.render(RenderSettings { spp: 4096, target, seed, threads: 2, ..settings(&p.scene) });
        uneven += usize::from(r.stats.spp_least < r.stats.spp);
        mean(&r)
    });
    let (a, va) = moments(adaptive.collect());
    let (b, vb) = moments((0..RENDERS as u64).map(|s| mean(&p.evenly(64, 1 << 32 | s, 2))).collect());
    assert!(uneven > RENDERS / 2, "samples went by need in {uneven} of {RENDERS}");
    let t = (a - b) / (va + vb).sqrt();
    // Student's 1e-4 quantile on both sides for 60 degrees of freedom or more is 4.2.
    assert!(t.abs() < 4.2, "{a} +- {} adaptive, {b} +- {} fixed", va.sqrt(), vb.sqrt());
}

#[test]
fn pictures_without_error_stop_at_the_first_look() {
    for radiance in [1.0, 0.0] {
        for part in [Part::Picture, Part::Block] {
            let s =
                scene(&format!("[film]\nsize = [64, 48]\n[sky]\ntype = \"constant\"\nradiance = {radiance}"));
            let target = Some(Target { error: 0.0, confidence: 0.95, part });
            let settings = RenderSettings { spp: 4096, target, threads: 2, ..settings(&s) };
            let r = Renderer { integrator: integrator("path", &[]), settings }.render(&s, &Silent).unwrap();
            let reached = r.stats.reached.unwrap();
            assert!(reached.met && reached.error == 0.0 && reached.at_most == 0.0, "{reached:?}");
            // 36,889 paths of a picture of 3,072 pixels, or of 2,304 of 3 x 3 blocks: 16 samples, and 32.
            let most = if part == Part::Picture { 16 } else { 32 };
            assert!(r.stats.spp <= most, "{}", r.stats.spp);
        }
    }
}

#[test]
fn without_two_halves_there_is_nothing_to_say() {
    let s = scene("[film]\nsize = [20, 20]\n[sky]\ntype = \"constant\"");
    let settings = RenderSettings { spp: 1, target: Some(PICTURE), threads: 1, ..settings(&s) };
    let r = Renderer { integrator: integrator("path", &[]), settings }.render(&s, &Silent).unwrap();
    assert!(!r.stats.reached.unwrap().met);
}
