//! Against closed forms and against scikit-image.

use super::*;

/// A plane of a formula in double precision.
fn plane([w, h]: [usize; 2], f: impl Fn(f64, f64) -> f64) -> Vec<f32> {
    (0..w * h).map(|i| f((i % w) as f64, (i / w) as f64) as f32).collect()
}

fn waves(size: [usize; 2]) -> [Vec<f32>; 2] {
    let a =
        plane(size, |x, y| 0.5 + 0.4 * (0.31 * x + 0.17 * y).sin() + 0.1 * ((3.0 * x + 5.0 * y) % 7.0) / 7.0);
    let b = plane(size, |x, y| {
        0.48 + 0.35 * (0.31 * x + 0.17 * y + 0.2).sin() + 0.15 * ((2.0 * x + 7.0 * y) % 5.0) / 5.0
    });
    [a, b]
}

/// scikit-image 0.26.0, `structural_similarity` of these planes, rounded to float32 first: the agreement that is asked for is 1e-6;
/// what is left is the rounding of its window's weights.
/// The paper's, at several scales.
fn scales(size: [usize; 2], a: &[f32], b: &[f32]) -> Option<MsSsim> {
    let options = Options::new(1.0);
    ms_ssim(size, [a, b], &options, &ssim(size, a, b, &options, false)?)
}

#[test]
fn agrees_with_scikit_image() {
    let size = [61, 47];
    let [a, b] = waves(size);
    let cases = [
        (Options::new(1.0), 0.860_538_281_105_587_2),
        (
            Options { window: Window::Uniform(7), sample_covariance: true, ..Options::new(1.0) },
            0.896_782_534_581_618_3,
        ),
        (
            Options { window: Window::Uniform(9), k1: 0.02, k2: 0.05, ..Options::new(2.0) },
            0.935_769_061_691_969_3,
        ),
    ];
    for (options, expected) in cases {
        let got = ssim(size, &a, &b, &options, false).unwrap().mean;
        assert!((got - expected).abs() < 1e-9, "{options:?}: {got}, not {expected}");
    }
}

#[test]
fn constant_planes_have_the_similarity_of_their_means() {
    let size = [40, 33];
    let (a, b) = (0.25, 0.75);
    let planes = [a, b].map(|v| plane(size, |_, _| v));
    let c1 = 1e-4;
    let expected = (2.0 * a * b + c1) / (a * a + b * b + c1);
    let found = ssim(size, &planes[0], &planes[1], &Options::new(1.0), true).unwrap();
    assert!((found.mean - expected).abs() < 1e-12 && (found.structure - 1.0).abs() < 1e-12);
    assert!(found.map.iter().all(|v| (f64::from(*v) - expected).abs() < 1e-6));
    let several = scales(size, &planes[0], &planes[1]).unwrap();
    // Brightness counts at the coarsest scale alone: here the second, of which both sides have 11.
    assert_eq!(several.scales, 2);
    let weight = 0.2856 / (0.0448 + 0.2856);
    assert!((several.value - expected.powf(weight)).abs() < 1e-12, "{several:?}");
}

#[test]
fn equal_planes_are_wholly_alike_and_opposite_ones_are_not() {
    let size = [200, 190];
    let [a, _] = waves(size);
    assert_eq!(ssim(size, &a, &a, &Options::new(1.0), false).unwrap().mean, 1.0);
    assert_eq!(scales(size, &a, &a).unwrap(), MsSsim { value: 1.0, scales: 5 });
    let negative: Vec<f32> = a.iter().map(|v| 1.0 - v).collect();
    assert!(ssim(size, &a, &negative, &Options::new(1.0), false).unwrap().structure < -0.9);
    assert_eq!(scales(size, &a, &negative).unwrap().value, 0.0);
}

#[test]
fn small_differences_of_large_values_are_seen() {
    // Squares of 1,000 in single precision would lose what varies.
    let size = [64, 64];
    let bright =
        |shift: f64| plane(size, |x, y| 1000.0 + 0.25 * (0.5 * x + shift).sin() + 0.125 * (0.3 * y).cos());
    let options = Options { k1: 1e-9, k2: 1e-7, ..Options::new(1.0) };
    let dim = |shift: f64| plane(size, |x, y| 0.25 * (0.5 * x + shift).sin() + 0.125 * (0.3 * y).cos());
    let at_1000 = ssim(size, &bright(0.0), &bright(0.7), &options, false).unwrap().structure;
    let at_0 = ssim(size, &dim(0.0), &dim(0.7), &options, false).unwrap().structure;
    // Values near 1,000 have steps of 6e-5, of variances of 0.03.
    assert!((at_1000 - at_0).abs() < 1e-3, "{at_1000} {at_0}");
}

#[test]
fn tiles_and_threads_leave_no_trace() {
    // Wider and higher than a tile.
    let size = [700, 90];
    let [a, b] = waves(size);
    let of = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| ssim(size, &a, &b, &Options::new(1.0), true).unwrap())
    };
    let whole = of(1);
    assert_eq!(whole, of(3));
    // The same window without a border of tiles near.
    let part: [Vec<f32>; 2] =
        [&a, &b].map(|p| (0..90).flat_map(|y| p[y * 700 + 450..][..120].to_vec()).collect());
    let found = ssim([120, 90], &part[0], &part[1], &Options::new(1.0), true).unwrap();
    for y in 5..85 {
        for x in 5..115 {
            assert_eq!(found.map[y * 120 + x], whole.map[y * 700 + 450 + x], "{x} {y}");
        }
    }
}

#[test]
fn what_is_smaller_than_the_window_has_no_similarity() {
    let v = vec![0.5; 10 * 30];
    assert_eq!(ssim([10, 30], &v, &v, &Options::new(1.0), false), None);
    assert!(ssim([11, 11], &v[..121], &v[..121], &Options::new(1.0), false).is_some());
    let window = Options { window: Window::Uniform(7), ..Options::new(1.0) };
    assert!(ssim([10, 30], &v, &v, &window, false).is_some());
}
