//! Figures against closed forms, and their independence of order and threads.

use super::*;
use crate::compare::pair::Planes;
use crate::sampler::hash::mix64;

fn gray(space: Space, reference: &[f32], test: &[f32]) -> Pair {
    let planes = [reference, test].map(|v| vec![v.to_vec()]);
    Pair::new([reference.len(), 1], vec!["Y".into()], space, planes, None)
}

fn value(name: &str, pair: &Pair, options: &MetricOptions) -> f64 {
    (named(name).unwrap().eval)(&Input::new(pair, options)).unwrap().value
}

/// `n` numbers from 0 to 1.
fn random(n: usize, seed: u64) -> Vec<f32> {
    (0..n as u64).map(|i| (mix64(i ^ seed << 40) >> 40) as f32 / (1u64 << 24) as f32).collect()
}

#[test]
fn figures_of_a_few_pixels_by_hand() {
    // Mean of the reference 1, so the usual epsilon is 0.01.
    let pair = gray(Space::Linear, &[0.5, 1.5, 0.0, 2.0], &[1.0, 1.5, 0.5, 0.0]);
    let usual = MetricOptions::default();
    let near = |name: &str, expected: f64| {
        let got = value(name, &pair, &usual);
        assert!((got - expected).abs() <= 1e-12 * expected.abs(), "{name}: {got}, not {expected}");
    };
    near("bias", -0.25);
    near("mae", 0.75);
    near("mse", 4.5 / 4.0);
    near("rmse", (4.5f64 / 4.0).sqrt());
    near("relmse", (0.25 / 0.26 + 0.25 / 0.01 + 4.0 / 4.01) / 4.0);
    near("mape", 25.0 * (0.5 / 0.6 + 0.5 / 0.1 + 2.0 / 2.1));
    near("smape", 25.0 * (0.5 / 0.85 + 0.5 / 0.35 + 2.0 / 1.1));
    near("psnr", 10.0 * (1.0f64 / (4.5 / 4.0)).log10());
    let fixed = MetricOptions { epsilon: Some(1.0), peak: Some(10.0), ..usual };
    assert!((value("relmse", &pair, &fixed) - (0.25 / 1.25 + 0.25 + 4.0 / 5.0) / 4.0).abs() < 1e-12);
    assert!((value("psnr", &pair, &fixed) - 10.0 * (100.0f64 / (4.5 / 4.0)).log10()).abs() < 1e-12);
}

#[test]
fn equal_pictures_have_no_error() {
    let values = random(4096, 1);
    let planes = || vec![values.clone(), values.clone(), values.clone()];
    let names = || ["R", "G", "B"].map(String::from).to_vec();
    for space in [Space::Linear, Space::Display] {
        let pair = Pair::new([64, 64], names(), space, [planes(), planes()], None);
        for metric in REGISTRY {
            let Ok(outcome) = (metric.eval)(&Input::new(&pair, &MetricOptions::default())) else { continue };
            let perfect = match metric.name {
                "psnr" => f64::INFINITY,
                _ if metric.better == Better::Higher => 1.0,
                _ => 0.0,
            };
            assert_eq!(outcome.value, perfect, "{}", metric.name);
        }
    }
}

#[test]
fn channels_are_told_apart_and_their_mean_is_the_figure() {
    let zero = vec![0.0; 16];
    let reference: Planes = vec![vec![1.0; 16], zero.clone(), zero.clone()];
    let test: Planes = vec![vec![1.5; 16], vec![0.25; 16], zero];
    let names = ["R", "G", "B"].map(String::from).to_vec();
    let pair = Pair::new([4, 4], names, Space::Linear, [reference, test], None);
    let options = MetricOptions::default();
    let input = Input::new(&pair, &options).with_maps(true);
    let outcome = (named("bias").unwrap().eval)(&input).unwrap();
    assert_eq!((outcome.channels, outcome.value), (vec![0.5, 0.25, 0.0], 0.25));
    assert_eq!(outcome.map.unwrap(), vec![0.25; 16]);
}

#[test]
fn pixels_that_do_not_count_have_no_part() {
    let mut pair = gray(Space::Linear, &[1.0, 2.0, 3.0, 4.0], &[1.5, 9.0, 3.5, 4.5]);
    pair.counted = Some(vec![true, false, true, true]);
    let usual = MetricOptions { epsilon: Some(0.5), ..MetricOptions::default() };
    assert_eq!(value("bias", &pair, &usual), 0.5);
    assert_eq!(value("rmse", &pair, &usual), 0.5);
    let without = gray(Space::Linear, &[1.0, 3.0, 4.0], &[1.5, 3.5, 4.5]);
    for name in ["relmse", "relmse-trimmed", "mape", "smape", "psnr"] {
        assert_eq!(value(name, &pair, &usual), value(name, &without, &usual), "{name}");
    }
}

#[test]
fn trimming_forgives_a_thousandth_of_the_pixels() {
    let n = 10_000;
    let reference = vec![1.0; n];
    let mut test = vec![1.1; n];
    test[..10].fill(1e4);
    let options = MetricOptions { epsilon: Some(1e-9), ..MetricOptions::default() };
    let pair = gray(Space::Linear, &reference, &test);
    assert!((value("relmse-trimmed", &pair, &options) - 0.01).abs() < 1e-8);
    test[10] = 1e4;
    let pair = gray(Space::Linear, &reference, &test);
    assert!(value("relmse-trimmed", &pair, &options) > 1e3, "one more is not forgiven");
}

#[test]
fn neither_order_nor_threads_change_a_bit() {
    let n = 100_000;
    let (reference, test) = (random(n, 1), random(n, 2));
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by_key(|i| mix64(*i as u64));
    let shuffled = |v: &[f32]| -> Vec<f32> { order.iter().map(|i| v[*i]).collect() };
    let pairs = [
        gray(Space::Linear, &reference, &test),
        gray(Space::Linear, &shuffled(&reference), &shuffled(&test)),
    ];
    let options = MetricOptions { epsilon: Some(0.01), ..MetricOptions::default() };
    for name in ["bias", "mae", "mse", "rmse", "relmse", "relmse-trimmed", "mape", "smape", "psnr"] {
        let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let one = pool(1).install(|| value(name, &pairs[0], &options));
        let three = pool(3).install(|| value(name, &pairs[1], &options));
        assert_eq!(one, three, "{name}");
    }
}

#[test]
fn names_are_found_and_unknown_ones_told() {
    let names = |list: &[&str]| list.iter().map(|s| s.to_string()).collect::<Vec<_>>();
    let found = find(&names(&["psnr", "bias", "psnr"])).unwrap();
    assert_eq!(found.iter().map(|m| m.name).collect::<Vec<_>>(), ["bias", "psnr"]);
    assert_eq!(find(&names(&["all"])).unwrap().len(), REGISTRY.len());
    let error = find(&names(&["pnsr"])).err().unwrap().to_string();
    assert!(error.contains("did you mean \"psnr\"?"), "{error}");
}
