use super::*;
use crate::testing::TestRng;

/// Values over many magnitudes, also negative, also exactly representable ones.
fn values(n: usize, rng: &mut TestRng) -> Vec<f32> {
    (0..n).map(|_| (rng.f32() - 0.25) * 2f32.powi((rng.f32() * 60.0) as i32 - 40)).collect()
}

#[test]
fn fast_and_general_rounding_agree_with_the_definition() {
    let mut rng = TestRng::new(1);
    let mut all = values(20_000, &mut rng);
    let edge = (1u32 << SMALL_LIMIT_LOG2) as f32;
    all.extend([
        0.0,
        -0.0,
        1.0,
        f32::MIN_POSITIVE,
        2f32.powi(-25),
        3.0 * 2f32.powi(-25),
        edge,
        edge.next_down(),
        -edge,
    ]);
    for v in all {
        let expected = (f64::from(v) * STEPS_PER_UNIT).round_ties_even() as i64;
        assert_eq!(quantise([v]), Steps { steps: [expected], saturated: false }, "{v:e}");
    }
}

#[test]
fn values_beyond_the_limit_are_clamped_and_reported() {
    let limit = (f64::from(VALUE_LIMIT) * STEPS_PER_UNIT) as i64;
    assert_eq!(quantise([VALUE_LIMIT, 1.0]), Steps { steps: [limit, 1 << 24], saturated: false });
    assert_eq!(quantise([-1e30, 1.0]), Steps { steps: [-limit, 1 << 24], saturated: true });
    assert_eq!(quantise([f32::INFINITY]), Steps { steps: [limit], saturated: true });
}

#[test]
fn sums_do_not_depend_on_order_or_slicing() {
    let window = PixelRect::new(10, 20, 15, 23);
    let mut rng = TestRng::new(2);
    let mut samples: Vec<(u32, u32, [f32; 3])> = (0..3000)
        .map(|_| {
            let (x, y) = (10 + (rng.bits() % 5) as u32, 20 + (rng.bits() % 3) as u32);
            let v = values(3, &mut rng);
            (x, y, [v[0], v[1], v[2]])
        })
        .collect();
    let gather = |samples: &[(u32, u32, [f32; 3])], window| {
        let mut sums = Accumulator::new(window, 3);
        samples.iter().for_each(|&(x, y, v)| assert!(sums.add(x, y, v)));
        sums
    };
    let whole = gather(&samples, window);
    for _ in 0..5 {
        (1..samples.len()).rev().for_each(|i| samples.swap(i, (rng.bits() % (i as u64 + 1)) as usize));
        let cut = (rng.bits() % samples.len() as u64) as usize;
        let mut parts = gather(&samples[cut..], window);
        // The other part from a larger window, as a tile may reach over the edge of a film.
        parts.merge(&gather(&samples[..cut], PixelRect::of_size(40, 40)));
        assert_eq!(parts, whole);
    }
}

#[test]
fn mean_is_within_half_a_step() {
    let mut rng = TestRng::new(3);
    let mut sums = Accumulator::new(PixelRect::of_size(1, 1), 1);
    let samples: Vec<f32> = (0..1000).map(|_| rng.f32() * 1e-4).collect();
    samples.iter().for_each(|&v| assert!(sums.add(0, 0, [v])));
    let exact = samples.iter().map(|&v| f64::from(v)).sum::<f64>() / 1000.0;
    let mean = mean_of(sums.sums[0], 1000);
    // Each value moves by at most half a step; the f64 sums here err by 1e-16.
    assert!((mean - exact).abs() <= 0.5 / STEPS_PER_UNIT + 1e-15, "{mean} {exact}");
    assert_eq!(sums.mean(0, 0, 0), mean as f32);
}

#[test]
fn what_is_not_finite_is_left_out_and_clamping_is_counted() {
    let mut sums = Accumulator::new(PixelRect::of_size(2, 1), 2);
    assert!(!sums.add(0, 0, [1.0, f32::NAN]));
    assert!(!sums.add(0, 0, [f32::NEG_INFINITY, 1.0]));
    assert!(sums.add(0, 0, [2.0, 1e20]));
    assert_eq!((sums.count(0, 0), sums.count(1, 0), sums.saturated()), (1, 0, 1));
    assert_eq!((sums.mean(0, 0, 0), sums.mean(0, 0, 1), sums.mean(1, 0, 0)), (2.0, VALUE_LIMIT, 0.0));
}

#[test]
fn planes_take_the_given_names() {
    let mut sums = Accumulator::new(PixelRect::of_size(2, 2), 3);
    assert!(sums.add(1, 1, [1.0, 2.0, 3.0]));
    let mut picture = Picture::new(2, 2);
    sums.push_planes(&mut picture, &["normal.X", "normal.Y", "normal.Z"], SampleKind::Half);
    assert_eq!(picture.plane("normal.Z").expect("pushed").data, [0.0, 0.0, 0.0, 3.0]);
}
