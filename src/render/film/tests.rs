use super::*;
use crate::render::fixed::{STEPS_PER_UNIT, VALUE_LIMIT};
use crate::testing::TestRng;

#[derive(Clone, Copy)]
struct Placed {
    x: u32,
    y: u32,
    replicate: usize,
    sample: FilmSample,
}

const WINDOW: PixelRect = PixelRect::new(5, 7, 45, 40);

fn sample(v: f32) -> FilmSample {
    FilmSample { radiance: Rgb::new(v, 0.5 * v, 2.0 * v), alpha: 1.0 }
}

fn random_samples(n: usize, rng: &mut TestRng) -> Vec<Placed> {
    (0..n)
        .map(|_| Placed {
            x: WINDOW.x0 + (rng.bits() % u64::from(WINDOW.width())) as u32,
            y: WINDOW.y0 + (rng.bits() % u64::from(WINDOW.height())) as u32,
            replicate: (rng.bits() % REPLICATES as u64) as usize,
            // From far below a step to far above the clamp.
            sample: sample(rng.f32() * 2f32.powi((rng.f32() * 70.0) as i32 - 35)),
        })
        .collect()
}

fn film() -> Film {
    Film::new(64, 48, WINDOW)
}

/// Tiles in an order given by the dice, samples in the order they come.
fn gather(samples: &[Placed], rng: &mut TestRng) -> Film {
    let mut film = film();
    let mut rects: Vec<PixelRect> = film.tiles().collect();
    (1..rects.len()).rev().for_each(|i| rects.swap(i, (rng.bits() % (i as u64 + 1)) as usize));
    let mut tile = FilmTile::new(rects[0]);
    for rect in rects {
        tile.reset(rect);
        for s in samples.iter().filter(|s| rect.contains(s.x, s.y)) {
            tile.add(s.x, s.y, s.replicate, s.sample);
        }
        film.add_tile(&tile);
    }
    film
}

#[test]
fn order_and_slicing_leave_no_trace() {
    let mut rng = TestRng::new(7);
    let mut samples = random_samples(4000, &mut rng);
    let whole = gather(&samples, &mut rng);
    assert!(whole.counts().saturated > 0, "the sample set should also try the clamp");
    for _ in 0..4 {
        (1..samples.len()).rev().for_each(|i| samples.swap(i, (rng.bits() % (i as u64 + 1)) as usize));
        assert_eq!(gather(&samples, &mut rng), whole);
        let (a, b) = samples.split_at((rng.bits() % samples.len() as u64) as usize);
        let mut merged = gather(b, &mut rng);
        merged.merge(&gather(a, &mut rng));
        assert_eq!(merged, whole);
    }
}

#[test]
fn a_run_is_its_samples() {
    let rect = PixelRect::of_size(16, 16);
    let mut rng = TestRng::new(8);
    // Blue reaches 1.2e6, beyond the fast path; so many samples need several flushes, and half the range of a sum.
    let samples: Vec<FilmSample> = (0..600_000).map(|_| sample(rng.f32() * 6e5)).collect();
    let (mut one, mut run) = (FilmTile::new(rect), FilmTile::new(rect));
    samples.iter().for_each(|&s| one.add(3, 4, 1, s));
    for s in samples.chunks(400_000) {
        let li: Vec<Rgb> = s.iter().map(|s| s.radiance).collect();
        let alpha: Vec<f32> = s.iter().map(|s| s.alpha).collect();
        assert_eq!(run.add_run(3, 4, 1, &li, &alpha), 0);
    }
    let (mut a, mut b) = (Film::new(16, 16, rect), Film::new(16, 16, rect));
    a.add_tile(&one);
    b.add_tile(&run);
    assert_eq!(a, b);
    assert_eq!(a.sample_count(3, 4), 600_000);
    let exact = samples.iter().map(|s| f64::from(s.radiance.b)).sum::<f64>() / 600_000.0;
    // Half a step, the rounding of an f32 mean (2^-24 of it), and 6e5 roundings of the f64 sum here.
    let tolerance = 0.5 / STEPS_PER_UNIT + exact * 2f64.powi(-24) + exact * 1e-10;
    assert!((f64::from(a.mean(3, 4).b) - exact).abs() <= tolerance);
}

#[test]
fn clamped_and_overflowing_values_are_counted() {
    let rect = PixelRect::of_size(2, 1);
    let mut film = Film::new(2, 1, rect);
    let mut tile = FilmTile::new(rect);
    tile.add(0, 0, 0, sample(1e30));
    // What is not finite is left out, counted, and told.
    assert_eq!(tile.add_run(0, 0, 0, &[Rgb::splat(f32::NAN)], &[1.0]), 1);
    film.add_tile(&tile);
    let counts = film.counts();
    assert_eq!((counts.samples, counts.dropped, counts.saturated, counts.overflowed_pixels), (1, 1, 1, 0));
    assert_eq!(film.mean(0, 0), Rgb::splat(VALUE_LIMIT));
    // The range of a sum is 2^39, 128 samples at the limit of 2^32; half of that lies in each direction of a merge.
    for _ in 0..8 {
        let other = film.clone();
        film.merge(&other);
    }
    assert_eq!(film.counts().overflowed_pixels, 1);
}

#[test]
fn picture_has_the_means_the_window_and_the_frame() {
    let mut film = film();
    let rect = film.tiles().last().expect("has tiles");
    assert_eq!(rect, PixelRect::new(37, 39, 45, 40));
    let mut tile = FilmTile::new(rect);
    tile.add(44, 39, 0, sample(1.0));
    tile.add(44, 39, 1, FilmSample { radiance: Rgb::BLACK, alpha: 0.0 });
    film.add_tile(&tile);
    let picture = film.picture(SampleKind::Half);
    assert_eq!((picture.width, picture.height), (40, 33));
    assert_eq!((picture.origin, picture.frame), ([5, 7], [64, 48]));
    let last = |name: &str| *picture.plane(name).expect(name).data.last().expect("not empty");
    assert_eq!(["R", "G", "B", "A"].map(last), [0.5, 0.25, 1.0, 0.5]);
    assert_eq!(film.alpha(44, 39), 0.5);
}

#[test]
fn variance_estimates_are_unbiased() {
    // 16 x 16 pixels, each the mean of 3 + 5 uniform samples: the variance of that mean is (1/12) / 8, of the
    // tile's mean luminance 256 times less. Averaged over many tiles the estimates must agree with both.
    let rect = PixelRect::of_size(16, 16);
    let (mut pixel, mut tiles) = (0.0, 0.0);
    let mut rng = TestRng::new(9);
    let trials = 800;
    for _ in 0..trials {
        let mut tile = FilmTile::new(rect);
        for (x, y) in rect.pixels() {
            for replicate in [0, 0, 0, 1, 1, 1, 1, 1] {
                let v = rng.f32();
                tile.add(x, y, replicate, FilmSample { radiance: Rgb::splat(v), alpha: 1.0 });
            }
        }
        let mut film = Film::new(16, 16, rect);
        film.add_tile(&tile);
        let [r, ..] = film.variance(0).expect("both halves");
        pixel += r.iter().map(|&v| f64::from(v)).sum::<f64>() / 256.0 / f64::from(trials);
        let estimate = film.tile_estimate(3, 9).expect("two replicates");
        assert!((estimate.mean - 0.5).abs() < 0.05);
        tiles += estimate.variance / f64::from(trials);
    }
    // Relative deviation of a mean of k estimates of one degree of freedom is sqrt(2 / k): 0.3 % for 204800 pixels, 5 %
    // for 800 tiles. Four of each.
    let expected = 1.0 / 12.0 / 8.0;
    assert!((pixel / expected - 1.0).abs() < 0.0125, "{}", pixel / expected);
    assert!((tiles * 256.0 / expected - 1.0).abs() < 0.2, "{}", tiles * 256.0 / expected);
}

#[test]
fn variance_is_pooled_over_the_neighbours_and_needs_both_halves() {
    let rect = PixelRect::of_size(5, 1);
    let mut film = Film::new(5, 1, rect);
    assert!(film.variance(1).is_none() && film.tile_estimate(0, 0).is_none());
    let mut tile = FilmTile::new(rect);
    // Halves 1 and 0 in pixel 0: (1 - 0)^2 / 4; equal halves in pixel 1; one half only in pixel 4.
    tile.add(0, 0, 0, sample(1.0));
    tile.add(0, 0, 1, sample(0.0));
    tile.add(1, 0, 0, sample(1.0));
    tile.add(1, 0, 1, sample(1.0));
    tile.add(4, 0, 0, sample(1.0));
    film.add_tile(&tile);
    let [raw, ..] = film.variance(0).expect("some");
    // A pixel without an estimate takes the mean of those that have one.
    assert_eq!(raw, [0.25, 0.0, 0.125, 0.125, 0.125]);
    let [pooled, ..] = film.variance(1).expect("some");
    assert_eq!(pooled, [0.125, 0.125, 0.0, 0.125, 0.125]);
}
