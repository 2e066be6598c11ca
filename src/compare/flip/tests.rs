use super::summary::Summary;
use super::{DEFAULT_PPD, FlipMap, HdrFlipMap, HdrOptions, ToneMapper};
use crate::error::Result;

type Picture = Vec<[f32; 3]>;

/// Numbers in [0, 1), multiples of 2^-24, the same in any language: 32-bit integers, i counting channels first.
pub(in crate::compare) fn noise([width, height]: [usize; 2], salt: u32) -> Picture {
    let number = |i: usize| {
        let v = (i as u32).wrapping_mul(2_654_435_761).wrapping_add(salt * 40_503);
        let v = (v ^ (v >> 15)).wrapping_mul(2_246_822_519);
        ((v ^ (v >> 13)) >> 8) as f32 / 16_777_216.0
    };
    (0..width * height).map(|p| std::array::from_fn(|c| number(3 * p + c))).collect()
}

/// Both pictures' channels put together.
pub(in crate::compare) fn zip(a: &[[f32; 3]], b: &[[f32; 3]], f: impl Fn(f32, f32) -> f32) -> Picture {
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| f(a[c], b[c]))).collect()
}

fn planes(p: &[[f32; 3]]) -> [Vec<f32>; 3] {
    std::array::from_fn(|c| p.iter().map(|p| p[c]).collect())
}

fn ldr(size: [usize; 2], a: &[[f32; 3]], b: &[[f32; 3]], ppd: f32) -> Result<FlipMap> {
    let [a, b] = [planes(a), planes(b)];
    super::ldr(size, a.each_ref().map(|p| &p[..]), b.each_ref().map(|p| &p[..]), ppd)
}

fn hdr(size: [usize; 2], a: &[[f32; 3]], b: &[[f32; 3]], options: &HdrOptions) -> Result<HdrFlipMap> {
    let [a, b] = [planes(a), planes(b)];
    super::hdr(size, a.each_ref().map(|p| &p[..]), b.each_ref().map(|p| &p[..]), options)
}

/// First and last exposure.
fn ends(found: &HdrFlipMap) -> [f32; 2] {
    [found.exposures[0], found.exposures[found.exposures.len() - 1]]
}

fn ldr_usual(size: [usize; 2], a: &[[f32; 3]], b: &[[f32; 3]]) -> FlipMap {
    ldr(size, a, b, DEFAULT_PPD).unwrap()
}

/// The pair of radiances that the reference implementation was asked about.
fn radiance(size: [usize; 2]) -> [Picture; 2] {
    let reference = zip(&noise(size, 3), &noise(size, 3), |a, b| 40.0 * a * b * a);
    let test = zip(&reference, &noise(size, 4), |r, n| r * (0.75 + 0.5 * n));
    [reference, test]
}

/// Error of one colour of linear light beside another, everywhere: Andersson et al. 2020, sections 4.1 and 4.3, in f64.
fn constant_error(a: [f64; 3], b: [f64; 3]) -> f64 {
    let seen = |[r, g, b]: [f64; 3]| {
        let x = 0.412_386_56 * r + 0.357_591_49 * g + 0.180_450_52 * b;
        let y = 0.212_636_82 * r + 0.715_182_98 * g + 0.072_180_2 * b;
        let z = 0.019_330_62 * r + 0.119_197_16 * g + 0.950_372_59 * b;
        let f = |t: f64| {
            if t > (6.0f64 / 29.0).powi(3) { t.cbrt() } else { t * 841.0 / 108.0 + 4.0 / 29.0 }
        };
        let [x, y, z] = [f(x / 0.950_428_545), f(y), f(z / 1.088_900_371)];
        let l = 116.0 * y - 16.0;
        [l, 0.01 * l * 500.0 * (x - y), 0.01 * l * 200.0 * (y - z)]
    };
    let distance = |a, b| {
        let (a, b): ([f64; 3], [f64; 3]) = (seen(a), seen(b));
        ((a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])).powf(0.7)
    };
    let largest = distance([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let (knee, d) = (0.4 * largest, distance(a, b));
    if d < knee { 0.95 * d / knee } else { 0.95 + 0.05 * (d - knee) / (largest - knee) }
}

fn linear(v: f32) -> f64 {
    let v = f64::from(v);
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

#[test]
fn equal_pictures_have_no_error_at_all() {
    let size = [70, 40];
    let a = noise(size, 1);
    let found = ldr_usual(size, &a, &a);
    assert_eq!((found.mean, found.map), (0.0, vec![0.0; 70 * 40]));
    let found = hdr(size, &a, &a, &HdrOptions::default()).unwrap();
    assert_eq!((found.mean, found.map), (0.0, vec![0.0; 70 * 40]));
    assert_eq!(found.which, vec![0; 70 * 40]);
}

#[test]
fn constant_colours_have_the_error_of_their_distance() {
    let size = [33, 21];
    let colours = noise([30, 1], 9);
    let mut pairs: Vec<[[f32; 3]; 2]> = colours.chunks(2).map(|c| [c[0], c[1]]).collect();
    pairs.extend([[[0.0; 3], [1.0; 3]], [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [[0.5; 3], [0.6; 3]]]);
    for [a, b] in pairs {
        let found = ldr_usual(size, &[a; 33 * 21], &[b; 33 * 21]);
        let expected = constant_error(a.map(linear), b.map(linear));
        let worst = found.map.iter().map(|v| (f64::from(*v) - expected).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-5, "{a:?} {b:?}: {expected}, off by {worst:e}");
    }
}

#[test]
fn constant_radiance_is_shown_at_the_exposure_that_makes_it_bright() {
    let size = [20, 20];
    let found = hdr(size, &[[1.0; 3]; 400], &[[1.5; 3]; 400], &HdrOptions::default()).unwrap();
    // (2.51 x^2 + 0.03 x) / (2.43 x^2 + 0.59 x + 0.14) = 0.85 at x = 1.2712: of that, 0.6 is no longer exposure.
    let shown = |x: f64| x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14);
    let [start, stop] = ends(&found);
    let exposure = f64::from(start).exp2() * 0.6;
    assert!((shown(exposure) - 0.85).abs() < 1e-6);
    assert_eq!((start, found.exposures.len()), (stop, 2));
    let expected = constant_error([shown(exposure); 3], [shown(1.5 * exposure); 3]);
    assert!((found.mean - expected).abs() < 1e-5, "{} {expected}", found.mean);
}

#[test]
fn the_order_of_the_pictures_does_not_matter() {
    let size = [50, 30];
    let (a, b) = (noise(size, 1), noise(size, 2));
    assert_eq!(ldr_usual(size, &a, &b), ldr_usual(size, &b, &a));
}

#[test]
fn a_shift_of_both_pictures_shifts_the_map() {
    // Crops that start at different places of one picture; 10 pixels from the edges nothing of it is seen.
    let whole = [300, 220];
    let (a, b) = (noise(whole, 1), noise(whole, 2));
    let size = [250, 180];
    let crop = |p: &Picture, x: usize, y: usize| -> Picture {
        (y..y + size[1]).flat_map(|y| p[y * whole[0] + x..][..size[0]].to_vec()).collect()
    };
    let first = ldr_usual(size, &crop(&a, 0, 0), &crop(&b, 0, 0)).map;
    let (dx, dy) = (37, 21);
    let second = ldr_usual(size, &crop(&a, dx, dy), &crop(&b, dx, dy)).map;
    for y in 10..size[1] - 10 - dy {
        for x in 10..size[0] - 10 - dx {
            assert_eq!(first[(y + dy) * size[0] + x + dx], second[y * size[0] + x], "{x} {y}");
        }
    }
}

#[test]
fn more_noise_is_more_error() {
    let size = [90, 60];
    let smooth: Picture = (0..90 * 60).map(|i| [(i % 90) as f32 / 120.0 + 0.1, 0.4, 0.3]).collect();
    let [mut least, mut least_hdr] = [0.0; 2];
    for amount in [0.01, 0.03, 0.1, 0.3] {
        let test = zip(&smooth, &noise(size, 5), |s, n| s + amount * (n - 0.5));
        let found = ldr_usual(size, &smooth, &test).mean;
        assert!(found > least, "{amount}: {found}");
        let found_hdr = hdr(size, &smooth, &test, &HdrOptions::default()).unwrap().mean;
        assert!(found_hdr > least_hdr, "{amount}: {found_hdr}");
        (least, least_hdr) = (found, found_hdr);
    }
}

#[test]
fn threads_change_no_bit() {
    let size = [301, 203];
    let [a, b] = radiance(size);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| (hdr(size, &a, &b, &HdrOptions::default()).unwrap(), ldr_usual(size, &a, &b)))
    };
    let one = run(1);
    assert!(one == run(2) && one == run(5));
}

/// flip-evaluator 1.7, LDR: mean of its map in f64 for `noise(1)` and half of the sum of `noise(1)` and `noise(2)`.
#[test]
fn means_of_the_reference_implementation_displayed() {
    for (size, expected) in
        [([37, 23], 0.329_664_8), ([1, 40], 0.460_431_4), ([5, 3], 0.549_716_9), ([300, 110], 0.326_483_1)]
    {
        let a = noise(size, 1);
        let b = zip(&a, &noise(size, 2), |a, b| 0.5 * (a + b));
        let found = ldr_usual(size, &a, &b).mean;
        assert!((found - expected).abs() < 2e-6, "{size:?}: {found}, there {expected}");
    }
}

/// flip-evaluator 1.7, HDR, of [`radiance`]: mean of its map in f64, first and last exposure, and their number.
#[test]
fn means_of_the_reference_implementation_of_radiance() {
    let size = [61, 35];
    let [a, b] = radiance(size);
    let negative: Picture =
        b.iter().enumerate().map(|(i, p)| if (i % 61) % 7 == 3 { p.map(|v| v * -0.3) } else { *p }).collect();
    let black: Picture = a.iter().enumerate().map(|(i, p)| if i < 61 * 24 { [0.0; 3] } else { *p }).collect();
    let with = |tone_mapper| HdrOptions { tone_mapper, ..HdrOptions::default() };
    let usual = HdrOptions::default();
    let given = HdrOptions { start: Some(-3.0), stop: Some(2.0), exposures: Some(4), ..usual };
    let aces = (-4.159_99, -1.791_013, 3);
    let hable = (-3.598_162, -1.229_185, 3);
    let reinhard = (-2.740_787, -0.371_81, 3);
    for (reference, test, options, expected, (start, stop, count)) in [
        (&a, &b, usual, 0.078_405_8, aces),
        (&a, &b, with(ToneMapper::Hable), 0.079_184_5, hable),
        (&a, &b, with(ToneMapper::Reinhard), 0.090_159_0, reinhard),
        (&a, &negative, usual, 0.129_200_8, aces),
        (&a, &negative, with(ToneMapper::Hable), 0.276_725_8, hable),
        (&a, &negative, with(ToneMapper::Reinhard), 0.274_171_9, reinhard),
        (&black, &b, usual, 0.749_834_6, (-4.117_244, 24.083_298, 29)),
        (&a, &b, given, 0.069_540_2, (-3.0, 2.0, 4)),
        (&a, &b, HdrOptions { ppd: 20.0, ..usual }, 0.191_367_6, aces),
        (&a, &b, HdrOptions { ppd: 150.0, ..usual }, 0.047_774_3, aces),
    ] {
        let found = hdr(size, reference, test, &options).unwrap();
        assert!((found.mean - expected).abs() < 2e-6, "{options:?}: {}, there {expected}", found.mean);
        let [first, last] = ends(&found);
        assert!((first - start).abs() < 2e-6 && (last - stop).abs() < 2e-6, "{options:?}");
        assert_eq!(found.exposures.len(), count, "{options:?}");
    }
}

/// The authors' own code, of an earlier version that has LDR-FLIP alone, on pairs of many sizes.
#[test]
fn maps_of_the_authors_code() {
    for seed in 0..40 {
        let size = [1 + (seed * 37) % 90, 1 + (seed * 53) % 70];
        let (a, n) = (noise(size, 7 + seed as u32), noise(size, 300 + seed as u32));
        let strength = seed as f32 / 40.0;
        let round = |v: f32| (v * 255.0).round();
        let a = zip(&a, &a, |a, _| round(a));
        let b = zip(&a, &n, |a, n| round((a / 255.0 + strength * (n - 0.5)).clamp(0.0, 1.0)));
        let bytes = |p: &Picture| -> Vec<u8> { p.iter().flatten().map(|v| *v as u8).collect() };
        let theirs = |p| nv_flip::FlipImageRgb8::with_data(size[0] as u32, size[1] as u32, &bytes(p));
        let there = nv_flip::flip(theirs(&a), theirs(&b), DEFAULT_PPD).to_vec();
        let unit = |p: &Picture| zip(p, p, |v, _| v / 255.0);
        let here = ldr_usual(size, &unit(&a), &unit(&b));
        let mean = there.iter().map(|v| f64::from(*v)).sum::<f64>() / there.len() as f64;
        assert!((here.mean - mean).abs() < 1e-5, "{size:?}: {} {mean}", here.mean);
        // The root of a difference of features makes 1e-4 of what f32 rounds.
        let worst = here.map.iter().zip(&there).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(worst < 1e-3, "{size:?}: {worst}");
    }
}

#[test]
fn what_is_far_too_bright_is_white() {
    let size = [12, 12];
    let options = HdrOptions { start: Some(0.0), stop: Some(1.0), ..HdrOptions::default() };
    for tone_mapper in ToneMapper::ALL {
        let options = HdrOptions { tone_mapper, ..options };
        let found = hdr(size, &[[f32::MAX; 3]; 144], &[[1e30; 3]; 144], &options).unwrap();
        assert_eq!(found.mean, 0.0, "{tone_mapper:?}");
    }
}

#[test]
fn a_black_reference_has_exposures() {
    let found = hdr([8, 8], &[[0.0; 3]; 64], &[[0.1; 3]; 64], &HdrOptions::default()).unwrap();
    let [start, stop] = ends(&found);
    assert!(start == stop && start.is_finite());
    assert!(found.mean > 0.9);
}

#[test]
fn one_exposure_is_the_first() {
    let size = [20, 10];
    let [a, b] = radiance(size);
    let one = HdrOptions { start: Some(-2.0), stop: Some(3.0), exposures: Some(1), ..HdrOptions::default() };
    let same = HdrOptions { stop: Some(-2.0), ..one };
    assert_eq!(hdr(size, &a, &b, &one).unwrap().map, hdr(size, &a, &b, &same).unwrap().map);
}

#[test]
fn bad_input_is_an_error_and_says_what_is_possible() {
    let a = noise([4, 4], 1);
    let says = |found: Result<HdrFlipMap>, text: &str| {
        let message = found.unwrap_err().to_string();
        assert!(message.contains(text), "{message}");
    };
    let usual = HdrOptions::default();
    let run = |options: HdrOptions| hdr([4, 4], &a, &a, &options);
    for ppd in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e6] {
        says(run(HdrOptions { ppd, ..usual }), "at most 1000");
        assert!(ldr([4, 4], &a, &a, ppd).is_err());
    }
    says(run(HdrOptions { start: Some(2.0), stop: Some(1.0), ..usual }), "above its last");
    says(run(HdrOptions { start: Some(f32::NAN), ..usual }), "from -128 to 128");
    says(run(HdrOptions { exposures: Some(0), ..usual }), "from 1 to 1000");
    says(hdr([4, 5], &a, &a, &usual), "4x5, not of 16 and 16");
    says(hdr([0, 0], &[], &[], &usual), "0x0");
}

#[test]
fn quantiles_are_those_of_sorted_errors() {
    let mut map: Vec<f32> = noise([50, 41], 6).iter().map(|p| p[0] * p[1] * p[1]).collect();
    let found = Summary::new(&map);
    map.sort_unstable_by(f32::total_cmp);
    let total: f64 = map.iter().map(|v| f64::from(*v)).sum();
    let quantile = |part: f64| {
        let mut sum = 0.0;
        *map.iter()
            .find(|v| {
                sum += f64::from(**v);
                sum > part * total
            })
            .unwrap()
    };
    let expected = Summary {
        min: map[0],
        quartile1: quantile(0.25),
        median: quantile(0.5),
        quartile3: quantile(0.75),
        max: map[map.len() - 1],
    };
    assert_eq!(found, expected);
    let none = Summary { min: 0.0, quartile1: 0.0, median: 0.0, quartile3: 0.0, max: 0.0 };
    assert_eq!(Summary::new(&[0.0; 9]), none);
}

/// The pair of the test of crate nv-flip 0.1.2, and the values that it holds the authors' code to.
#[test]
fn published_values() {
    let Some(data) = crate::testing::data_dir() else {
        return;
    };
    let read = |name: &str| -> Picture {
        let picture = image::open(data.join("images/flip").join(name)).unwrap().into_rgb8();
        picture.pixels().map(|p| p.0.map(|v| f32::from(v) / 255.0)).collect()
    };
    let found = ldr_usual([640, 960], &read("tree-ref.png"), &read("tree-test.png"));
    let s = Summary::new(&found.map);
    assert!((found.mean - 0.133_285).abs() < 1e-4, "{}", found.mean);
    let there = [0.0, 0.184_924, 0.333_241, 0.503_441, 0.983_044];
    for (ours, there) in [s.min, s.quartile1, s.median, s.quartile3, s.max].into_iter().zip(there) {
        assert!((ours - there).abs() < 1e-4, "{s:?}");
    }
}
