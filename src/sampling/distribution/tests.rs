use super::*;
use crate::testing::TestRng;

#[test]
fn one_dimension_is_exact_monotone_and_inverts() {
    let mut rng = TestRng::new(5);
    let mut weights: Vec<f64> = (0..1000).map(|_| rng.f64().powi(8)).collect();
    for i in [0, 1, 500, 998, 999] {
        weights[i] = 0.0;
    }
    weights[333] = 1e7;
    weights[334] = f64::NAN;
    weights[335] = -1.0;
    weights[336] = f64::INFINITY;
    let d = Distribution1D::new(weights.iter().copied()).unwrap();
    assert_eq!(d.len(), 1000);
    let sum: f64 = (0..1000).map(|i| d.pmf(i)).sum();
    assert!((sum - 1.0).abs() < 1e-12);
    assert_eq!(
        (d.pmf(333) > 0.99, d.pmf(334), d.pmf(335), d.pmf(336), d.pmf(1000)),
        (true, 0.0, 0.0, 0.0, 0.0)
    );
    let mut last = 0;
    for i in 0..=100_000 {
        let u = (f64::from(i) / 100_000.0).min(ONE_MINUS);
        let c = d.sample(u);
        assert!(c.index >= last && c.pmf > 0.0 && c.pmf == d.pmf(c.index) && (0.0..1.0).contains(&c.du));
        assert!((d.invert(c.index, c.du) - u).abs() < 1e-15);
        last = c.index;
    }
    assert_eq!(d.sample(7.0).index, d.sample(ONE_MINUS).index);
    assert!(!d.sample(f64::NAN).pmf.is_nan());
    assert!(Distribution1D::new([]).is_none());
    assert!(Distribution1D::new([0.0, -3.0, f64::NAN]).is_none());
    assert!(Distribution1D::new([f64::MAX, f64::MAX]).is_none());
    assert_eq!(Distribution1D::new([3.0]).unwrap().sample(0.25), Choice { index: 0, pmf: 1.0, du: 0.25 });
}

/// Shapes of skies: lat-long, cube, a strip, one cell, sizes that are no power of anything.
const SHAPES: [(usize, usize, usize); 7] =
    [(1, 64, 32), (6, 16, 16), (6, 13, 13), (1, 37, 1), (1, 1, 1), (16, 3, 5), (2, 100, 7)];

fn weights(rng: &mut TestRng, n: usize) -> Vec<f64> {
    (0..n).map(|_| if rng.f64() < 0.2 { 0.0 } else { (rng.f64() * 20.0 - 10.0).exp() }).collect()
}

#[test]
fn cells_get_the_area_of_their_probability_and_invert() {
    let mut rng = TestRng::new(6);
    for (charts, w, h) in SHAPES {
        let mut weight = weights(&mut rng, charts * w * h);
        weight[0] = 1.0;
        let total: f64 = weight.iter().sum();
        let d = ChartDistribution::new(charts, w, h, &weight).unwrap();
        assert!((d.total() / total - 1.0).abs() < 1e-12);
        let mut sum = 0.0;
        for (i, &want) in weight.iter().enumerate() {
            let (chart, y, x) = ((i / (w * h)) as u32, (i / w % h) as u32, (i % w) as u32);
            let pmf = d.pmf(chart, x, y);
            sum += pmf;
            // One rounding to f32, and the sum of all such.
            assert!((pmf - want / total).abs() <= 1.2e-7 * want / total, "{pmf} {}", want / total);
            // The area of the cell's image in the unit square is the probability with which it is chosen.
            let corners = [0.0, 1.0].map(|v| d.invert(chart, x, y, [v, v]));
            let [Some(a), Some(b)] = corners else {
                assert_eq!(pmf, 0.0);
                continue;
            };
            let area = (b[0] - a[0]) * (b[1] - a[1]);
            // f32 sums, one rounding for each of the levels; and the f64 rounding of the numbers themselves.
            assert!(
                (area / pmf - 1.0).abs() < 1e-6 + 1e-15 / area.sqrt(),
                "{charts}x{w}x{h} {i}: {area} {pmf}"
            );
            let u = d.invert(chart, x, y, [0.3, 0.6]).unwrap();
            let c = d.sample(u);
            assert_eq!((c.chart, c.x, c.y, c.pmf), (chart, x, y, pmf));
            let tolerance = 1e-14 / (b[0] - a[0]).min(b[1] - a[1]);
            assert!((c.du[0] - 0.3).abs() < tolerance && (c.du[1] - 0.6).abs() < tolerance, "{c:?}");
        }
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
        assert_eq!(
            (d.pmf(charts as u32, 0, 0), d.pmf(0, w as u32, 0), d.pmf(0, 0, h as u32)),
            (0.0, 0.0, 0.0)
        );
        for u in [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0], [f64::NAN, 0.5], [-1.0, 2.0], [ONE_MINUS, ONE_MINUS]] {
            let c = d.sample(u);
            assert!(u[0].is_nan() || (c.pmf > 0.0 && c.pmf == d.pmf(c.chart, c.x, c.y)), "{u:?} {c:?}");
        }
    }
    assert!(ChartDistribution::new(1, 2, 2, &[0.0, -1.0, f64::NAN, f64::INFINITY]).is_none());
}

#[test]
fn a_sun_takes_nothing_from_its_neighbours() {
    // 4096 x 2048 cells of weight 1 with a sun of 1e6 in one of them: with f32 cumulative sums a fifth of them would
    // have probability 0.
    let (w, h) = (4096, 2048);
    let mut weight = vec![1.0; w * h];
    weight[777 * w + 1234] = 1e6;
    let d = ChartDistribution::new(1, w, h, &weight).unwrap();
    let total = (w * h - 1) as f64 + 1e6;
    assert!((d.pmf(0, 1234, 777) * total / 1e6 - 1.0).abs() < 1e-7);
    for (x, y) in [(1235, 777), (1234, 778), (1233, 776), (0, 0), (4095, 2047), (4095, 777)] {
        assert!((d.pmf(0, x, y) * total - 1.0).abs() < 1e-7);
        let (a, b) = (d.invert(0, x, y, [0.0; 2]).unwrap(), d.invert(0, x, y, [1.0; 2]).unwrap());
        let area = (b[0] - a[0]) * (b[1] - a[1]);
        // Edges of the image are numbers near 1 with errors of 1e-16, their distance in the sun's row is 1e-6.
        assert!((area * total - 1.0).abs() < 1e-7 + 1e-9, "{x} {y}: {}", area * total);
    }
    assert!(d.memory() as f64 <= 1.2 * 4.0 * (w * h) as f64);
    assert!(
        ChartDistribution::new(1, 3, 3, &[1.0; 8]).is_none()
            && ChartDistribution::new(0, 3, 3, &[]).is_none()
    );
}

#[test]
fn stratified_points_stay_stratified() {
    // 2^12 points of a (0,2)-sequence into 8 x 8 cells of smooth weights: counts differ from their expectation by a few,
    // where random ones would differ by sqrt(64) = 8 and up to 25.
    let weight: Vec<f64> = (0..64).map(|i| 1.0 + f64::from(i % 8) * 0.2 + f64::from(i / 8) * 0.1).collect();
    let d = ChartDistribution::new(1, 8, 8, &weight).unwrap();
    let p = crate::sampler::Sampler::OwenSobol.points(1, None).pixel(2, 3, 0);
    let mut counts = [0f64; 64];
    for i in 0..4096 {
        let c = d.sample(p.get_2d_f64(i, crate::sampler::Dim::FILTER));
        counts[(c.y * 8 + c.x) as usize] += 1.0;
    }
    for (i, c) in counts.iter().enumerate() {
        let want = 4096.0 * d.pmf(0, i as u32 % 8, i as u32 / 8);
        assert!((c - want).abs() < 6.0, "{i}: {c} {want}");
    }
}
