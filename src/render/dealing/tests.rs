use super::*;
use crate::color::Rgb;
use crate::testing::TestRng;

const RECT: PixelRect = PixelRect::new(7, 4, 71, 52);

/// Notes of surfaces all over, which a rule makes.
fn notes(mut note: impl FnMut(u32, u32) -> Note) -> Notes {
    let mut notes = Notes::new(RECT);
    notes.list = RECT.pixels().map(|(x, y)| note(x, y)).collect();
    let pixels = RECT.area() as u64;
    notes.spent.plain = RayCounts { camera: 8 * pixels, scattered: 0, shadow: 16 * pixels };
    notes
}

/// Settings that want so many samples.
fn of(spp: u32) -> RenderSettings {
    RenderSettings { spp, ..RenderSettings::new([64, 48]) }
}

fn plain(mean: f32, variance: f32) -> Note {
    Note { mean, variance, alpha: 1.0, kind: Kind::Plain }
}

/// Noise comes and goes over some pixels, and varies from one to the next.
fn random(seed: u64) -> Notes {
    let mut rng = TestRng::new(seed);
    notes(|x, y| Note {
        kind: [Kind::Plain, Kind::Plain, Kind::Outline, Kind::Bare][(rng.bits() % 4) as usize],
        ..plain(0.5 + rng.f32(), rng.f32() * (5.0 * ((x + 2 * y) as f32 / 9.0).sin()).exp2())
    })
}

#[test]
fn a_pixel_has_no_say_in_its_own_number() {
    let usual = random(1);
    let before = usual.deal(8, &of(16), None);
    let mut changed = 0;
    for (at, (x, y)) in RECT.pixels().enumerate().step_by(37) {
        let mut other = Notes { rect: RECT, list: usual.list.clone(), spent: usual.spent };
        other.list[at].mean = 1e3;
        other.list[at].variance = 1e7;
        let after = other.deal(8, &of(16), None);
        assert_eq!(after.of(x, y), before.of(x, y), "{x} {y}");
        changed += RECT.pixels().filter(|&(i, j)| after.of(i, j) != before.of(i, j)).count();
    }
    assert!(changed > 100, "others go by it: {changed}");
}

#[test]
fn all_cost_what_was_asked_for() {
    let alike = |spp: u32, variance: &dyn Fn(f32) -> f32| {
        let row = |x: u32, y: u32| x as f32 + y as f32 / 64.0;
        let counts =
            notes(|x, y| plain(1.0, variance(row(x, y) / 72.0))).deal(first_samples(spp), &of(spp), None);
        let numbers = || RECT.pixels().map(|(x, y)| counts.of(x, y));
        let mean = numbers().map(f64::from).sum::<f64>() / RECT.area() as f64;
        (numbers().min().unwrap(), mean, numbers().max().unwrap())
    };
    for spp in [4, 5, 8, 16, 100, 1024] {
        // Where pixels want their shares of what is left, numbers are powers of two, as the sum comes out. By far the most
        // pixels differ in their worth, so that a step of the scale moves few of them.
        let (least, mean, most) = alike(spp, &|u| u.powi(6));
        // Bins of the histogram are 1/64 of an octave, and not all pixels lie within one octave: half of a bin that is
        // doubled by mistake is less than a hundredth of them.
        assert!(mean <= 1.01 * f64::from(spp) && mean > 0.95 * f64::from(spp), "{spp}: {mean}");
        assert!(least == first_samples(spp) && most > spp && most <= 16 * spp, "{least} {most}");
        // No noise at all: nothing is to be gained.
        assert_eq!(
            alike(spp, &|_| 0.0),
            (first_samples(spp), f64::from(first_samples(spp)), first_samples(spp))
        );
    }
}

#[test]
fn numbers_go_by_noise_and_cost() {
    // Variances of eight octaves from the first row to the last, so that rounding to powers of two is evened out; and away
    // from the border between the halves, as the right one differs.
    let variance = |y: u32| (8.0 * y as f32 / 52.0).exp2();
    let doublings = |note: &dyn Fn(bool, f32) -> Note| {
        let counts = notes(|x, y| note(x >= 40, variance(y))).deal(1, &of(64), None);
        let mean = |columns: std::ops::Range<u32>| {
            let numbers = columns.flat_map(|x| (8..48).map(move |y| (x, y)));
            let logs: Vec<f64> = numbers.map(|(x, y)| f64::from(counts.of(x, y)).log2()).collect();
            logs.iter().sum::<f64>() / logs.len() as f64
        };
        mean(43..68) - mean(10..37)
    };
    // 32 times the variance, to the power 0.4, is two doublings. A row in forty has one number for all of a half, and a step
    // of a doubling somewhere else than the other half: within two rows.
    let noisy = doublings(&|right, variance| plain(1.0, if right { 32.0 } else { 1.0 } * variance));
    assert!((noisy - 2.0).abs() < 0.05, "{noisy}");
    // The same noise of a pixel 2^1.25 times as dark counts 2^2.5 times as much: to the power 0.4 that is one doubling, or
    // 1 % less by what is added to dark pixels' squares.
    let dark = doublings(&|right, variance| plain(if right { 1.0 } else { 1.25f32.exp2() }, variance));
    assert!((dark - 0.99).abs() < 0.05, "{dark}");
    // Samples that mostly meet nothing are cheap.
    let cheap =
        doublings(&|right, variance| Note { alpha: if right { 0.01 } else { 1.0 }, ..plain(1.0, variance) });
    assert!(cheap > 1.0, "{cheap}");
}

#[test]
fn what_neighbours_do_not_foretell_is_not_gone_by() {
    // Variances of sixteen octaves, each pixel's its own: in truth as many samples everywhere are best.
    let mut rng = TestRng::new(10);
    let mut chance = |_: u32, _: u32| plain(1.0, (16.0 * rng.f32()).exp2());
    for spp in [4, 16, 50] {
        let counts = notes(&mut chance).deal(first_samples(spp), &of(spp), None);
        assert!(RECT.pixels().all(|(x, y)| counts.of(x, y) == spp), "{spp}");
    }
    // Unless that is wanted.
    let blindly = RenderSettings { dealing: Dealing::ByGuess, ..of(16) };
    let counts = notes(&mut chance).deal(8, &blindly, None);
    assert!(RECT.pixels().any(|(x, y)| counts.of(x, y) > 16));
    // One colour of the chessboard shows where noise is, the other is alike all over: only the former is believed, which is
    // what the other's numbers go by.
    let variance = |y: u32| (12.0 * y as f32 / 52.0).exp2();
    let counts =
        notes(|x, y| plain(1.0, if colour(x, y) == 0 { variance(y) } else { 1.0 })).deal(8, &of(16), None);
    let numbers = |wanted: usize| {
        let mut all: Vec<u32> =
            RECT.pixels().filter(|p| colour(p.0, p.1) == wanted).map(|(x, y)| counts.of(x, y)).collect();
        all.sort_unstable();
        all.dedup();
        all
    };
    assert_eq!(numbers(0), [16]);
    assert!(numbers(1).len() > 1, "{:?}", numbers(1));
}

#[test]
fn what_stands_gets_no_more_and_outlines_no_less() {
    let usual = random(2);
    let counts = usual.deal(8, &of(16), None);
    for ((x, y), note) in RECT.pixels().zip(&usual.list) {
        let n = counts.of(x, y);
        match note.kind {
            Kind::Bare => assert_eq!(n, 0),
            Kind::Plain => assert!(n.is_power_of_two() && (8..=256).contains(&n)),
            Kind::Outline => assert!(n.is_power_of_two() && (16..=256).contains(&n)),
        }
    }
}

#[test]
fn a_note_tells_the_spread_of_what_stratification_leaves() {
    let gray = |values: &[f32]| values.iter().map(|v| Rgb::new(*v, *v, *v)).collect::<Vec<_>>();
    let note = |values: &[f32]| Note::of(&gray(values), &vec![1.0; values.len()], Kind::Plain);
    let same = note(&[0.5; 8]);
    assert_eq!((same.mean, same.variance, same.alpha), (0.5, 0.0, 1.0));
    // Two by two they are alike: nothing is left. One by one of two: all is.
    assert_eq!(note(&[0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0]).variance, 0.0);
    assert!((note(&[0.0, 1.0]).variance - 0.5).abs() < 1e-6);
    // Independent samples: that of one, whatever the groups. 2,000 notes of 16 with 3 degrees of freedom each have 2 % of it.
    let mut rng = TestRng::new(3);
    let mean = (0..2000)
        .map(|_| f64::from(note(&std::array::from_fn::<f32, 16, _>(|_| rng.f32())).variance))
        .sum::<f64>()
        / 2000.0;
    assert!((mean * 12.0 - 1.0).abs() < 0.08, "{mean}");
    assert_eq!(note(&[f32::NAN, 1.0]).mean, 1.0, "what is no number is left out, as in the film");
    assert_eq!([4, 7, 15, 63, 64, 100].map(first_samples), [2, 4, 8, 32, 32, 64]);
}
