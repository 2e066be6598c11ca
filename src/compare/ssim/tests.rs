use super::*;
use crate::compare::flip::tests::{noise, zip};

/// The pair that scikit-image was asked about.
fn pair(size: [usize; 2]) -> [Vec<[f32; 3]>; 2] {
    let a = noise(size, 1);
    let b = zip(&a, &noise(size, 2), |a, b| 0.5 * (a + b));
    [a, b]
}

#[test]
fn equal_pictures_are_exactly_alike() {
    let size = [200, 190];
    let [a, _] = pair(size);
    for options in [Options::default(), Options::scikit_image(1.0)] {
        let found = ssim(size, &a, &a, &options).unwrap();
        assert_eq!((found.channels, found.contrast, found.mean), ([1.0; 3], [1.0; 3], 1.0));
        // A third for each channel.
        assert!(found.map.iter().all(|v| (v - 1.0).abs() < 2e-7));
        let many = multi_scale(size, &a, &a, &options, Some(&found)).unwrap();
        assert_eq!((many.mean, many.scales), (1.0, 5));
    }
}

#[test]
fn constant_pictures_differ_in_luminance_alone() {
    let size = [180, 180];
    let options = Options::default();
    for (a, b) in [(0.2f32, 0.7f32), (0.0, 1.0), (0.5, 0.5001)] {
        let (x, y) = (f64::from(a), f64::from(b));
        // Wang et al. 2004, eq. 6.
        let luminance = (2.0 * x * y + 1e-4) / (x * x + y * y + 1e-4);
        let [p, q] = [a, b].map(|v| vec![[v]; 180 * 180]);
        let found = ssim(size, &p, &q, &options).unwrap();
        assert!((found.mean - luminance).abs() < 1e-10, "{a} {b}: {}", found.mean);
        assert!((found.contrast[0] - 1.0).abs() < 1e-10);
        let many = multi_scale(size, &p, &q, &options, None).unwrap();
        assert!((many.mean - luminance.powf(WEIGHTS[4])).abs() < 1e-9);
    }
}

#[test]
fn pictures_that_are_each_other_s_negative_are_unlike() {
    let size = [60, 60];
    let [a, _] = pair(size);
    let b = zip(&a, &a, |a, _| 1.0 - a);
    assert!(ssim(size, &a, &b, &Options::default()).unwrap().mean < -0.8);
    assert_eq!(multi_scale(size, &a, &b, &Options::default(), None).unwrap().mean, 0.0);
}

/// scikit-image 0.26, `structural_similarity` of f64 arrays with `channel_axis=-1`.
#[test]
fn means_of_scikit_image() {
    let wang = Options::default();
    let sample = Options { sample_covariance: true, ..wang };
    let plain = Options::scikit_image(1.0);
    let wide = Options { window: Window::Uniform { side: 11 }, k1: 0.02, k2: 0.05, ..plain };
    for (size, options, expected) in [
        ([37, 23], plain, 0.667_075_611_9),
        ([37, 23], wang, 0.661_216_852_8),
        ([37, 23], sample, 0.661_195_618_2),
        ([37, 23], wide, 0.674_590_317_7),
        ([300, 110], plain, 0.662_658_626_3),
        ([300, 110], wang, 0.658_748_493_3),
        ([300, 110], sample, 0.658_726_699_9),
        ([300, 110], wide, 0.670_484_103_2),
    ] {
        let [a, b] = pair(size);
        let found = ssim(size, &a, &b, &options).unwrap().mean;
        assert!((found - expected).abs() < 1e-9, "{size:?} {options:?}: {found}, there {expected}");
    }
    // Variances of a thousandth of the squares keep their digits.
    let [a, b] = pair([37, 23]).map(|p| zip(&p, &p, |v, _| (f64::from(v) * 1000.0 + 5e4) as f32));
    let found = ssim([37, 23], &a, &b, &Options::scikit_image(1000.0)).unwrap().mean;
    assert!((found - 0.668_080_644_1).abs() < 1e-8, "{found}");
}

/// The definition, window by window.
fn by_the_book(size: [usize; 2], a: &[f64], b: &[f64], options: &Options) -> [f64; 2] {
    let radius = options.window.radius() as isize;
    let half = options.window.half();
    let (c1, c2) = (options.k1.powi(2), options.k2.powi(2));
    let mut sums = [0.0; 2];
    let range = |n: usize| radius..n as isize - radius;
    for y in range(size[1]) {
        for x in range(size[0]) {
            let mut m = [0.0; 5];
            for dy in -radius..=radius {
                for dx in -radius..=radius {
                    let at = (y + dy) as usize * size[0] + (x + dx) as usize;
                    let w = half[dy.unsigned_abs()] * half[dx.unsigned_abs()];
                    let (p, q) = (a[at], b[at]);
                    for (m, v) in m.iter_mut().zip([p, q, p * p, q * q, p * q]) {
                        *m += w * v;
                    }
                }
            }
            let contrast = (2.0 * (m[4] - m[0] * m[1]) + c2) / (m[2] - m[0] * m[0] + m[3] - m[1] * m[1] + c2);
            sums[0] += contrast * (2.0 * m[0] * m[1] + c1) / (m[0] * m[0] + m[1] * m[1] + c1);
            sums[1] += contrast;
        }
    }
    sums.map(|s| s / (range(size[0]).len() * range(size[1]).len()) as f64)
}

#[test]
fn scales_are_by_the_book() {
    // Odd sides: their last row and column are left out. The fourth scale is 13 wide, the fifth would be too small.
    let mut size = [107, 113];
    let [a, b] = pair(size);
    let options = Options::default();
    let found = multi_scale(size, &a, &b, &options, None).unwrap();
    assert_eq!(found.scales, 4);
    let total: f64 = WEIGHTS[..4].iter().sum();
    let mut planes = [&a, &b].map(|p| p.iter().map(|v| f64::from(v[1])).collect::<Vec<f64>>());
    let mut expected = 1.0;
    for (i, weight) in WEIGHTS[..4].iter().enumerate() {
        let [whole, contrast] = by_the_book(size, &planes[0], &planes[1], &options);
        expected *= if i == 3 { whole } else { contrast }.powf(weight * 1.0001 / total);
        let next = size.map(|n| n / 2);
        planes = planes.map(|p| {
            let at = |x: usize, y: usize| p[y * size[0] + x];
            let block = |i: usize| {
                let (x, y) = (2 * (i % next[0]), 2 * (i / next[0]));
                (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1)) / 4.0
            };
            (0..next[0] * next[1]).map(block).collect()
        });
        size = next;
    }
    assert!((found.channels[1] - expected).abs() < 1e-10, "{} {expected}", found.channels[1]);
}

#[test]
fn threads_change_no_bit() {
    let size = [301, 203];
    let [a, b] = pair(size);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| ssim(size, &a, &b, &Options::default()).unwrap())
    };
    let one = run(1);
    assert!(one == run(2) && one == run(5));
}

#[test]
fn bad_input_is_an_error_and_says_what_is_possible() {
    let [a, b] = pair([40, 11]);
    let says = |size: [usize; 2], options: Options, text: &str| {
        let message = ssim(size, &a, &b, &options).unwrap_err().to_string();
        assert!(message.contains(text), "{message}");
    };
    let usual = Options::default();
    assert!(ssim([40, 11], &a, &b, &usual).is_ok());
    says([44, 10], usual, "11x11 pixels");
    says([440, 1], usual, "440x1 is too small");
    says([40, 12], usual, "not of 440 and 440");
    says([40, 11], Options { data_range: 0.0, ..usual }, "above zero");
    says([40, 11], Options { k1: f64::NAN, ..usual }, "above zero");
    says([40, 11], Options { window: Window::Uniform { side: 6 }, ..usual }, "an odd side");
    says(
        [40, 11],
        Options { window: Window::Gaussian { sigma: 1e9, truncate: 3.0 }, ..usual },
        "up to 100 pixels",
    );
}
