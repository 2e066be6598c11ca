use super::*;

fn dims() -> [Dim; 4] {
    [Dim::FILTER, Dim::at(1, Slot::LightUv), Dim::at(1, Slot::BsdfUv), Dim::at(7, Slot::LobeAndRoulette)]
}

#[test]
fn every_elementary_interval_of_aligned_blocks_holds_one_point() {
    for (x, y, replicate) in [(0, 0, 0), (17, 4, 0), (4000, 2999, 3)] {
        let p = Sampler::OwenSobol.points(1, None).pixel(x, y, replicate);
        for dim in dims() {
            for m in 0..=10u32 {
                for block in [0u32, 1, 5] {
                    for split in 0..=m {
                        let mut seen = vec![0u8; 1 << m];
                        for i in 0..1u32 << m {
                            let [u, v] = p.get_2d((block << m) + i, dim);
                            let (nx, ny) = ((1u32 << split) as f32, (1u32 << (m - split)) as f32);
                            seen[(u * nx) as usize * (1 << (m - split)) + (v * ny) as usize] += 1;
                        }
                        assert!(seen.iter().all(|&s| s == 1), "m {m} split {split} block {block}");
                    }
                }
            }
        }
    }
}

#[test]
fn batches_and_scalars_agree_to_the_bit() {
    for (_, kind) in Sampler::NAMES {
        let points = kind.points(9, Some(128));
        let p = points.pixel(5, 6, 0);
        assert_eq!(p.kind(), kind);
        let dim = Dim::LENS;
        let (mut xs, mut ys) = (vec![0.0; 77], vec![0.0; 77]);
        p.fill_2d(13, dim, &mut xs, &mut ys);
        for i in 0..77 {
            assert_eq!([xs[i], ys[i]], p.get_2d(13 + i as u32, dim));
            assert_eq!(xs[i], p.get_1d(13 + i as u32, dim));
            let fine = p.get_2d_f64(13 + i as u32, dim);
            let step = 1.0 / 16_777_216.0;
            assert!((0..2).all(|k| (0.0..step).contains(&(fine[k] - f64::from([xs[i], ys[i]][k])))));
        }
        let [few_x, few_y] = p.few_2d(13, dim);
        assert_eq!((&few_x[..], &few_y[..]), (&xs[..8], &ys[..8]));
        let pixels: Vec<_> = (0..77).map(|i| points.pixel(i, 2 * i, 0)).collect();
        let indices: Vec<u32> = (0..77).map(|i| i * i).collect();
        points_2d(&pixels, &indices, dim, &mut xs, &mut ys);
        for i in 0..77 {
            assert_eq!([xs[i], ys[i]], pixels[i].get_2d(indices[i], dim));
        }
    }
    points_2d(&[], &[], Dim::LENS, &mut [], &mut []);
}

#[test]
fn largest_bits_stay_below_one() {
    assert_eq!(to_unit_f32(u32::MAX), ONE_MINUS_EPSILON);
    assert_eq!(to_unit_f32(0), 0.0);
}

/// Covariances over pixels (or replicates, seeds) of what one sample draws: the randomisation must be uniform, and
/// independent between samples far apart, dimensions and neighbours.
#[test]
fn randomisation_is_uniform_and_independent() {
    let n = 40_000u32;
    for kind in [Sampler::OwenSobol, Sampler::Independent] {
        let draw =
            |i: u32, index: u32, dim: Dim| kind.points(3, None).pixel(i % 200, i / 200, 0).get_2d(index, dim);
        let other: [&dyn Fn(u32) -> [f32; 2]; 6] = [
            &|i| draw(i, 0, Dim::LENS),
            &|i| draw(i, 0, Dim::at(1, Slot::LightUv)),
            &|i| draw(i + 1, 0, Dim::FILTER),
            &|i| draw(i + 200, 0, Dim::FILTER),
            &|i| kind.points(4, None).pixel(i % 200, i / 200, 0).get_2d(0, Dim::FILTER),
            &|i| kind.points(3, None).pixel(i % 200, i / 200, 1).get_2d(0, Dim::FILTER),
        ];
        let mut sum = [0f64; 2];
        let mut square = [0f64; 2];
        let mut within = 0f64;
        let mut products = [[0f64; 4]; 6];
        for i in 0..n {
            let a = draw(i, 0, Dim::FILTER).map(|v| f64::from(v) - 0.5);
            within += a[0] * a[1];
            for k in 0..2 {
                sum[k] += a[k];
                square[k] += a[k] * a[k];
            }
            for (row, o) in products.iter_mut().zip(&other) {
                let b = o(i).map(|v| f64::from(v) - 0.5);
                (0..4).for_each(|k| row[k] += a[k & 1] * b[k >> 1]);
            }
        }
        let n = f64::from(n);
        // Five standard deviations of each mean: sqrt(1/12/n), sqrt(1/180/n), (1/12)/sqrt(n).
        for k in 0..2 {
            assert!((sum[k] / n).abs() < 5.0 * (1.0 / 12.0 / n).sqrt(), "{kind:?} mean {sum:?}");
            assert!(
                (square[k] / n - 1.0 / 12.0).abs() < 5.0 * (1.0 / 180.0 / n).sqrt(),
                "{kind:?} {square:?}"
            );
        }
        let limit = 5.0 / 12.0 / n.sqrt();
        assert!((within / n).abs() < limit, "{kind:?} {within}");
        assert!(products.iter().flatten().all(|p| (p / n).abs() < limit), "{kind:?} {products:?}");
    }
}

/// Mean squared error of the mean of `n` samples over many pixels.
fn mse(kind: Sampler, n: u32, f: &dyn Fn(&PixelSampler, u32) -> f64, exact: f64) -> f64 {
    let pixels = 256;
    let points = kind.points(11, Some(n));
    let total: f64 = (0..pixels)
        .map(|i| {
            let p = points.pixel(i, 3 * i, 0);
            let mean = (0..n).map(|s| f(&p, s)).sum::<f64>() / f64::from(n);
            (mean - exact).powi(2)
        })
        .sum();
    total / f64::from(pixels)
}

#[test]
fn error_falls_faster_than_random_and_is_never_worse() {
    let point = |p: &PixelSampler, s: u32, dim: Dim| p.get_2d(s, dim).map(f64::from);
    let smooth = |p: &PixelSampler, s: u32| {
        let [x, y] = point(p, s, Dim::FILTER);
        (-x * y).exp() * (1.0 + (3.0 * x).sin())
    };
    // By Simpson's rule on a 2000 x 2000 grid: exact far below the errors measured here.
    let exact = {
        let (m, mut sum) = (2000, 0.0);
        let weight = |i: i32| f64::from(if i == 0 || i == m { 1 } else { 2 + 2 * (i & 1) });
        for i in 0..=m {
            let x = f64::from(i) / f64::from(m);
            let inner: f64 = (0..=m).map(|j| weight(j) * (-x * f64::from(j) / f64::from(m)).exp()).sum();
            sum += weight(i) * inner * (1.0 + (3.0 * x).sin());
        }
        sum / (9.0 * f64::from(m) * f64::from(m))
    };
    let (small, large) =
        (mse(Sampler::OwenSobol, 16, &smooth, exact), mse(Sampler::OwenSobol, 1024, &smooth, exact));
    let slope = (large / small).log2() / 6.0;
    // Theory says MSE ~ n^-3 (with logarithms) for smooth integrands; -2.4 leaves room for those.
    assert!(slope < -2.4, "{slope}");
    // An edge: discontinuous along a slanted line (theory n^-1.5), and a four-dimensional product of two padded pairs
    // (at worst as random).
    let edge = |p: &PixelSampler, s: u32| {
        let [x, y] = point(p, s, Dim::LENS);
        f64::from(u8::from(x + 0.4 * y < 0.7))
    };
    let four = |p: &PixelSampler, s: u32| {
        let ([a, b], [c, d]) = (point(p, s, Dim::FILTER), point(p, s, Dim::at(1, Slot::BsdfUv)));
        16.0 * a * b * c * d
    };
    for (f, exact) in [(&edge as &dyn Fn(&PixelSampler, u32) -> f64, 0.5), (&four, 1.0)] {
        for n in [3, 4, 16, 100, 256] {
            let (owen, random) =
                (mse(Sampler::OwenSobol, n, f, exact), mse(Sampler::Independent, n, f, exact));
            // Both are estimates from 256 pixels, each good to 9 % or so.
            assert!(owen < 1.2 * random, "{n}: {owen} {random}");
        }
    }
    let slope =
        (mse(Sampler::OwenSobol, 1024, &edge, 0.5) / mse(Sampler::OwenSobol, 16, &edge, 0.5)).log2() / 6.0;
    assert!(slope < -1.2, "{slope}");
}

#[test]
fn names_parse_and_unknown_ones_are_explained() {
    for (name, kind) in Sampler::NAMES {
        assert_eq!(name.parse::<Sampler>().unwrap(), kind);
        assert_eq!(kind.name(), name);
    }
    let message = "sobol".parse::<Sampler>().unwrap_err().to_string();
    assert!(message.contains("owen-sobol") && message.contains("independent"), "{message}");
}
