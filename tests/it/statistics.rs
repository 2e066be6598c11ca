//! The test for bias: how often it errs, on noise whose truth is known and on renders, and what it says. The long form is
//! `cargo bench --bench statistics`.

#[path = "../../benches/statistics/noise.rs"]
mod noise;
#[path = "../../benches/statistics/scenes.rs"]
mod scenes;

use noise::{Colour, Noise, Stream, each, picture};
use scenes::{Bias, CASES, Prepared};
use skylit::compare::statistics::equivalence::Answer;
use skylit::compare::statistics::families::uniformity;
use skylit::compare::statistics::pair::{Design, Reason};
use skylit::compare::statistics::replicates::{Origin, Replicates, Spread, Values};
use skylit::compare::statistics::{Outcome, Place, Question, Region, StatisticalResult, compare};
use skylit::image::picture::{Picture, SampleKind};
use skylit::image::read::read_planes;
use skylit::image::write::{WriteOptions, write_picture};
use skylit::render::film_layers;

fn ask(a: &Replicates, b: &Replicates) -> StatisticalResult {
    compare(a, b, &Question::default()).unwrap()
}

/// Few pairs tell more of a level of 20 % than of one of 1 %.
fn loosely() -> Question {
    Question { alpha: 0.2, ..Question::default() }
}

/// Whether `n` trials of probability `p` come to `k` more than once in a million times, by Bernstein's inequality.
fn is_likely(n: usize, k: usize, p: f64, two_sided: bool) -> bool {
    let (n, off) = (n as f64, k as f64 - n as f64 * p);
    let bound = (-off * off / (2.0 * (n * p * (1.0 - p) + off.abs() / 3.0))).exp();
    bound > 5e-7 || (off < 0.0 && !two_sided)
}

/// Verdicts of pairs that differ in their seeds alone, and where their tiles stand among deals.
fn alarms(pairs: u64, make: &(dyn Fn(u64) -> Replicates + Sync), question: &Question) -> (usize, Vec<f64>) {
    let of_pair = |i: u64| {
        let r = compare(&make(2 * i), &make(2 * i + 1), question).unwrap();
        let place = |t: &Region| t.place_among_deals.or(t.p);
        (r.outcome == Outcome::Different, r.tiles.iter().filter_map(place).collect::<Vec<_>>())
    };
    let all: Vec<(bool, Vec<f64>)> = each(pairs, of_pair);
    (all.iter().filter(|a| a.0).count(), all.into_iter().flat_map(|a| a.1).collect())
}

#[test]
fn false_alarms_are_as_many_as_is_said() {
    const PAIRS: u64 = 300;
    for (noise, colour, spp) in [
        (Noise::Normal, Colour::Mixed, 16),
        (Noise::Normal, Colour::Grey, 16),
        // Halves of 3 and 2 samples are dealt for their like alone.
        (Noise::Skewed, Colour::Mixed, 5),
        // Many tiles have no firefly, or one.
        (Noise::Firefly, Colour::Grey, 16),
        (Noise::Firefly, Colour::Mixed, 16),
    ] {
        let make = |seed| picture(48, seed, spp, noise, colour);
        let (different, tiles) = alarms(PAIRS, &make, &loosely());
        assert!(is_likely(PAIRS as usize, different, 0.2, true), "{noise:?} {colour:?}: {different}");
        let uniform = uniformity(&tiles).unwrap();
        assert!(uniform.p > 1e-6, "{noise:?} {colour:?}: {uniform:?}");
    }
}

#[test]
fn halves_of_several_pictures_are_dealt_too() {
    const PAIRS: u64 = 300;
    for (noise, colour) in [(Noise::Normal, Colour::Grey), (Noise::Firefly, Colour::Mixed)] {
        let one = |seed: u64| picture(48, seed, 8, noise, colour);
        let make = |seed: u64| twice(&one(2 * seed), &one(2 * seed + 1));
        let (different, tiles) = alarms(PAIRS, &make, &loosely());
        assert!(is_likely(PAIRS as usize, different, 0.2, true), "{noise:?}: {different}");
        let uniform = uniformity(&tiles).unwrap();
        assert!(uniform.p > 1e-6, "{noise:?}: {uniform:?}");
    }
}

/// Replicates of both.
fn twice(a: &Replicates, b: &Replicates) -> Replicates {
    let part = |of: &Replicates, half: usize| -> Values {
        let all = (0..of.size[0] * of.size[1]).map(|pixel| of.value(half, pixel));
        let (means, counts) = all.map(|(v, n)| (v.map(|v| v as f32), n as f32)).unzip();
        (means, Some(counts))
    };
    let parts = [a, b].iter().flat_map(|of| [part(of, 0), part(of, 1)]).collect();
    Replicates::of_values(a.size, Spread::Pixels, parts)
}

#[test]
fn what_a_pixel_shows_does_not_depend_on_its_samples() {
    // Or else pixels on an outline are chosen by what makes them bright, and their objects' means are off.
    let prepared = Prepared::new(&CASES[0], [48, 48], Bias::default());
    let [a, b] = [(1, 4), (2, 16)].map(|(seed, spp)| prepared.render(spp, seed, 2).objects.unwrap());
    assert!(a == b && (0..4).all(|object| a.contains(&object)));
}

#[test]
fn renders_of_two_seeds_are_the_same_but_for_chance() {
    const PAIRS: u64 = 60;
    for case in &CASES {
        let prepared = Prepared::new(case, [32, 32], Bias::default());
        let (different, _) = alarms(PAIRS, &|seed| prepared.render(16, seed, 1), &loosely());
        assert!(is_likely(PAIRS as usize, different, 0.2, true), "{}: {different} of {PAIRS}", case.name);
    }
}

#[test]
fn more_samples_in_one_picture_raise_no_alarm() {
    const PAIRS: u64 = 150;
    for (noise, colour) in [(Noise::Skewed, Colour::Grey), (Noise::Firefly, Colour::Mixed)] {
        let make = |seed: u64| picture(48, seed, if seed.is_multiple_of(2) { 16 } else { 64 }, noise, colour);
        let (different, _) = alarms(PAIRS, &make, &loosely());
        assert!(is_likely(PAIRS as usize, different, 0.2, false), "{noise:?}: {different}");
    }
}

/// The same with what `change` makes of a half's value in a pixel.
fn changed(of: &Replicates, change: impl Fn(usize, usize, f32) -> f32) -> Replicates {
    let half = |h: usize| -> Values {
        let all = (0..of.size[0] * of.size[1]).map(|pixel| (pixel, of.value(h, pixel)));
        let new =
            |(pixel, (v, n)): (usize, ([f64; 3], f64))| (v.map(|v| change(h, pixel, v as f32)), n as f32);
        let (means, counts) = all.map(new).unzip();
        (means, Some(counts))
    };
    Replicates::of_values(of.size, Spread::Pixels, vec![half(0), half(1)])
}

#[test]
fn suns_that_both_halves_find_are_no_difference() {
    // Points are spread so evenly that either half has as many of a sun's images in one pixel, but for the image's own noise.
    let sun = |of: &Replicates, images: f32| {
        changed(
            of,
            |half, pixel, v| if pixel == 48 * 30 + 30 { v + images * (2000.0 + half as f32) } else { v },
        )
    };
    for spp in [16, 64] {
        let [a, b] =
            [(1, 16), (2, spp)].map(|(seed, spp)| picture(48, seed, spp, Noise::Normal, Colour::Grey));
        assert_eq!(ask(&a, &b).outcome, Outcome::NoDifference, "{spp}");
        let r = ask(&sun(&a, 1.0), &sun(&b, 2.0));
        assert!(r.outcome == Outcome::NoDifference && r.p.is_some_and(|p| p > 0.05), "{spp}: {}", r.sentence);
    }
}

#[test]
fn noise_beside_a_very_bright_pixel_is_no_exact_difference() {
    // The rounding of 13,000 is coarser than the noise of all others together.
    let make = |seed: u64| {
        let mut s = Stream::new(seed);
        let mut half = || -> Values {
            let mut value = |at: f64, sigma: f64| (at + sigma * s.uniform()) as f32;
            // The bright one's own noise is grey.
            let pixel = |i: usize| match i {
                0 => [value(13_000.0, 0.05); 3],
                _ => [0; 3].map(|_| value(0.5, 4e-5)),
            };
            ((0..256).map(pixel).collect(), Some(vec![8.0; 256]))
        };
        let parts = vec![half(), half()];
        Replicates::of_values([16, 16], Spread::Pixels, parts)
    };
    let r = ask(&make(1), &make(2));
    assert!(!r.whole.exact && r.outcome == Outcome::NoDifference, "{}", r.sentence);
}

fn object(r: &StatisticalResult, wanted: u32) -> &Region {
    let is_it = |p: &Place| matches!(p, Place::Object { number, .. } if *number == wanted);
    r.regions.iter().find(|r| is_it(&r.place)).unwrap()
}

#[test]
fn half_a_percent_in_one_material_is_found() {
    let case = &CASES[0];
    let size = [256, 256];
    let plain = Prepared::new(case, size, Bias::default()).render(64, 1, 2);
    let again = Prepared::new(case, size, Bias::default()).render(64, 2, 2);
    assert_eq!(ask(&plain, &again).outcome, Outcome::NoDifference);
    for (bias, what) in [([0.005; 3], "brighter"), ([0.01, -0.0035, 0.005], "another hue")] {
        let changed = Prepared::new(case, size, Bias { by: bias }).render(64, 3, 2);
        let r = ask(&plain, &changed);
        let found = object(&r, case.object);
        assert!(r.outcome == Outcome::Different && found.rejected, "{what}: {}", r.sentence);
        for (share, by) in found.channels.iter().zip(bias) {
            let share = share.unwrap();
            // Four standard errors instead of two.
            let reach = share.high - share.low;
            assert!((share.value - by).abs() < reach, "{what}: {share:?}, not {by}");
        }
        assert!(r.sentence.contains("object 2"), "{}", r.sentence);
    }
    // What is said to be found is found, and what lies below is not promised.
    let promised = object(&ask(&plain, &again), case.object).detectable.unwrap();
    assert!(promised < 0.005, "{promised}");
}

#[test]
fn the_same_seed_makes_pairs() {
    let case = &CASES[2];
    let prepared = Prepared::new(case, [32, 32], Bias::default());
    let [a, b] = [1, 2].map(|seed| prepared.render(16, seed, 2));
    assert_eq!(ask(&a, &a).outcome, Outcome::Identical);
    let slightly = a.clone().scaled([1.0002; 3], |_| true);
    let r = ask(&a, &slightly);
    assert_eq!((r.design, r.reason, r.outcome), (Design::Paired, Reason::SameSeed, Outcome::Different));
    assert!(r.sentence.contains("same seed"), "{}", r.sentence);
    // Files that do not say so are found out by their noise.
    let mut nameless = slightly.clone();
    nameless.origin = Origin::default();
    let r = ask(&a, &nameless);
    assert_eq!((r.design, r.reason, r.outcome), (Design::Paired, Reason::SameNoise, Outcome::Different));
    let r = ask(&a, &b);
    assert_eq!((r.design, r.reason), (Design::Independent, Reason::Apart));
    let independent = Question { design: Some(Design::Independent), ..Question::default() };
    assert_eq!(compare(&a, &slightly, &independent).unwrap().outcome, Outcome::NoDifference);
}

#[test]
fn what_has_no_noise_is_exact() {
    let [a, b] = [1, 2].map(|seed| picture(48, seed, 16, Noise::Normal, Colour::Mixed));
    let r = ask(&a, &b);
    assert_eq!((r.outcome, r.quiet), (Outcome::NoDifference, 48 * 9));
    // Rounding of the sky is none of its business; a thousandth is. Rows 0 to 8 have no noise, so tiles of 8 see only those.
    let fine = Question { tile: 8, ..Question::default() };
    let by = |factor: f64| b.clone().scaled([factor; 3], |i| i < 48 * 8);
    assert_eq!(compare(&a, &by(1.0 + 1e-7), &fine).unwrap().outcome, Outcome::NoDifference);
    let r = compare(&a, &by(1.001), &fine).unwrap();
    assert!(r.outcome == Outcome::Different && r.sentence.contains("exact"), "{}", r.sentence);
    assert_eq!(r.tiles.iter().filter(|t| t.exact).count(), 6);
    let map = r.map();
    assert!(map[0] != 0.0 && map[48 * 40] == 0.0);
    // A tint of grey noise: there is hardly any noise of hue that could explain it.
    let grey = |seed| picture(48, seed, 16, Noise::Normal, Colour::Grey);
    assert_eq!(ask(&grey(1), &grey(2)).whole.rank, 1);
    let tinted = grey(2).scaled([1.0, 1.0, 1.001], |i| i >= 48 * 16);
    let r = ask(&grey(1), &tinted);
    assert!(r.outcome == Outcome::Different && r.p.is_some_and(|p| p < 1e-10), "{}", r.sentence);
    // And where there is none at all: light is added, of which the noise does not know.
    let mut parts: Vec<Values> = Vec::new();
    for half in 0..2 {
        let noisy = grey(2);
        let value = |i: usize| noisy.value(half, i).0.map(|v| v as f32);
        parts.push(((0..48 * 48).map(value).map(|[r, g, b]| [r, g, b + 0.01]).collect(), None));
    }
    let r = ask(&grey(1), &Replicates::of_values([48, 48], Spread::Pixels, parts));
    assert!(r.outcome == Outcome::Different && r.whole.exact, "{}", r.sentence);
}

/// Pictures of another program, which has a filter as wide as the picture: pixels are not independent.
fn foreign(seed: u64, scale: f32) -> Picture {
    let mut s = Stream::new(seed);
    let mut normal = || skylit::compare::statistics::distributions::normal_quantile(s.uniform()) as f32;
    let mut p = Picture::new(32, 32);
    let common = 0.02 * normal();
    let plane: Vec<f32> = (0..32 * 32).map(|_| scale * (1.0 + common + 0.02 * normal())).collect();
    for c in ["R", "G", "B"] {
        p.push(c, SampleKind::Float, plane.clone());
    }
    p
}

fn several(first: u64, count: u64, scale: f32) -> Vec<(String, Picture)> {
    (first..first + count).map(|seed| (format!("{seed}.exr"), foreign(seed, scale))).collect()
}

#[test]
fn foreign_pictures_are_replicates() {
    let make = |seed: u64| Replicates::of_pictures(&several(4 * seed, 4, 1.0)).unwrap();
    assert_eq!(make(0).spread, Spread::Pictures);
    // Pixels taken as independent would have found nearly all of these different.
    let (different, _) = alarms(300, &make, &loosely());
    assert!(is_likely(300, different, 0.2, false), "{different}");
    let brighter = Replicates::of_pictures(&several(1 << 20, 4, 1.2)).unwrap();
    let r = ask(&make(0), &brighter);
    assert_eq!(r.outcome, Outcome::Different, "{}", r.sentence);
}

#[test]
fn bad_replicates_are_refused() {
    let refuses = |pictures: &[(String, Picture)], words: &[&str]| {
        let e = Replicates::of_pictures(pictures).unwrap_err().to_string();
        words.iter().for_each(|w| assert!(e.contains(w), "{e}"));
    };
    refuses(&several(1, 1, 1.0), &["1.exr", "--aov halves", "--tiles"]);
    let twice = [several(1, 1, 1.0), several(1, 1, 1.0)].concat();
    refuses(&twice, &["same picture", "other seeds"]);
    let mut small = several(1, 2, 1.0);
    small[1].1 = Picture::new(3, 2);
    refuses(&small, &["2.exr is 3x2", "32x32"]);
    let mut depth = several(1, 2, 1.0);
    depth[1].1.planes.truncate(1);
    refuses(&depth, &["2.exr", "R, G and B"]);
    let [a, b] = [32, 48].map(|side| picture(side, 1, 4, Noise::Normal, Colour::Grey));
    assert!(compare(&a, &b, &Question::default()).unwrap_err().to_string().contains("same pixels"));
    for question in [
        Question { alpha: 0.0, ..Question::default() },
        Question { equivalent: Some(1.0), ..Question::default() },
        Question { masks: vec![("m".into(), vec![true])], ..Question::default() },
    ] {
        assert!(compare(&a, &a, &question).is_err());
    }
}

#[test]
fn pixels_that_cannot_be_used_are_counted() {
    let mut bad = foreign(9, 1.0);
    bad.planes[1].data[7] = f32::NAN;
    bad.planes[2].data[9] = f32::INFINITY;
    let test = Replicates::of_pictures(&[("bad".into(), bad), ("good".into(), foreign(8, 1.0))]).unwrap();
    let r = ask(&Replicates::of_pictures(&several(1, 2, 1.0)).unwrap(), &test);
    assert_eq!((r.not_finite, r.whole.pixels), (2, 32 * 32 - 2));
    assert!(r.sentence.contains("2 pixels are not finite"), "{}", r.sentence);
}

#[test]
fn margins_are_kept() {
    const PAIRS: u64 = 300;
    let margin = 0.002;
    let question = Question { equivalent: Some(margin), ..Question::default() };
    let answers = |apart: f64| -> Vec<Answer> {
        let of_pair = |i: u64| {
            let [a, b] = [2 * i, 2 * i + 1].map(|s| picture(48, s, 64, Noise::Normal, Colour::Mixed));
            let b = b.scaled([1.0 + apart * margin; 3], |_| true);
            compare(&a, &b, &question).unwrap().equivalence.unwrap().answer
        };
        each(PAIRS, of_pair)
    };
    let count = |all: &[Answer], wanted| all.iter().filter(|a| **a == wanted).count();
    for apart in [1.0, -1.0] {
        let all = answers(apart);
        assert!(is_likely(PAIRS as usize, count(&all, Answer::Equivalent), 0.05, false), "{apart}");
        assert!(is_likely(PAIRS as usize, count(&all, Answer::Different), 0.01, false), "{apart}");
    }
    assert!(count(&answers(0.0), Answer::Equivalent) > PAIRS as usize * 9 / 10);
    assert!(count(&answers(3.0), Answer::Different) > PAIRS as usize * 9 / 10);
    // Too few samples: as many as are asked for do.
    let pair = |spp: usize| [1, 2].map(|s| picture(48, s, spp, Noise::Normal, Colour::Mixed));
    let ask = |spp: usize, margin: f64| {
        let [a, b] = pair(spp);
        let question = Question { equivalent: Some(margin), ..Question::default() };
        compare(&a, &b, &question).unwrap().equivalence.unwrap()
    };
    let few = ask(16, 0.001);
    assert_eq!(few.answer, Answer::NotEnoughSamples, "{}", few.sentence);
    let more = few.more_samples.unwrap() as usize;
    assert!((50..1000).contains(&more), "{}", few.sentence);
    assert_eq!(ask((16 + 2 * more).next_multiple_of(2), 0.001).answer, Answer::Equivalent);
}

#[test]
fn halves_come_back_from_a_file() {
    let scene = crate::common::scene(
        "[film]\nsize = [20, 12]\n[sky]\ntype = \"gradient\"\n[camera]\ntype = \"perspective\"\neye = [0, 0, 5]\nlook_at = [0, 0, 0]\n\
         [[objects]]\nshape = { type = \"sphere\", radius = 1.0 }\n",
    );
    let rendered = crate::common::render(&scene, crate::common::integrator("path", &[("max_depth", 2.0)]), 5);
    let mut out = rendered.film.picture(SampleKind::Float);
    let layer = film_layers::REGISTRY.iter().find(|l| l.name == film_layers::HALVES).unwrap();
    assert!(layer.needs_moments && layer.needs_independence);
    (layer.push)(&rendered.film, &mut out);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("halves.exr");
    write_picture(&path, &out, &WriteOptions::default()).unwrap();
    let read = read_planes(&path).unwrap();
    let halves = Replicates::of_halves(&read).unwrap();
    assert_eq!(halves.size, [20, 12]);
    for (i, (x, y)) in rendered.film.window().pixels().enumerate() {
        let wanted = rendered.film.halves(x, y).unwrap();
        let got = [0, 1].map(|h| halves.value(h, i));
        for (half, (mean, n)) in wanted.iter().zip(got) {
            assert_eq!((mean, n), (half.mean.map(|v| f64::from(v as f32)), half.count as f64));
        }
        // The pixel is the mean of both, weighted.
        let [(a, m), (b, n)] = got;
        let pixel = rendered.film.mean(x, y);
        for (c, pixel) in [pixel.r, pixel.g, pixel.b].into_iter().enumerate() {
            let mean = (m * a[c] + n * b[c]) / (m + n);
            assert!((mean - f64::from(pixel)).abs() <= 2e-7 * mean.abs(), "{mean} {pixel}");
        }
    }
    assert!(Replicates::of_halves(&rendered.film.picture(SampleKind::Float)).is_none());
}
