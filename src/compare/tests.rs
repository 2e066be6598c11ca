//! Likely causes, places of errors, and how files come together.

use super::causes::likely;
use super::metrics::{Input, MetricOptions};
use super::open::{Crop, Mask, Opened, PairOptions, Source, open};
use super::pair::{Pair, Planes, Space};
use super::regions::worst;
use crate::base::image_data::Encoding;
use crate::color::{linear_to_srgb, srgb_to_linear};
use crate::image::load::{Loaded, Stored};
use crate::image::picture::{Picture, SampleKind};
use crate::sampler::hash::mix64;

const SIZE: [usize; 2] = [96, 64];

fn noise(i: usize, seed: u64) -> f32 {
    (mix64(i as u64 ^ seed << 32) >> 40) as f32 / (1u64 << 24) as f32
}

/// Something without symmetry: a slope, a disc, a bright spot, fine grain; colours differ.
fn scene([w, h]: [usize; 2]) -> Planes {
    let value = |x: usize, y: usize, c: usize| {
        let (u, v) = (x as f32 / w as f32, y as f32 / h as f32);
        let disc = if (u - 0.3).hypot(v - 0.6) < 0.2 { [0.8, 0.4, 0.1][c] } else { 0.0 };
        let spot = if (u - 0.8).hypot(v - 0.2) < 0.05 { 4.0 } else { 0.0 };
        0.05 + [0.6, 0.3, 0.2][c] * u * u + 0.3 * v + disc + spot + 0.05 * noise(y * w + x, 7)
    };
    (0..3).map(|c| (0..w * h).map(|i| value(i % w, i / w, c)).collect()).collect()
}

fn names() -> Vec<String> {
    ["R", "G", "B"].map(String::from).to_vec()
}

fn pair(size: [usize; 2], test: Planes) -> Pair {
    Pair::new(size, names(), Space::Linear, [scene(size), test], None)
}

/// The test picture made of the reference's values at other places.
fn moved([w, h]: [usize; 2], from: impl Fn(usize, usize) -> [usize; 2]) -> Planes {
    let pixel = |plane: &Vec<f32>, i: usize| {
        let [x, y] = from(i % w, i / w);
        plane[y.min(h - 1) * w + x.min(w - 1)]
    };
    scene([w, h]).iter().map(|p| (0..w * h).map(|i| pixel(p, i)).collect()).collect()
}

fn curved(f: impl Fn(usize, f32) -> f32) -> Planes {
    scene(SIZE).iter().enumerate().map(|(c, p)| p.iter().map(|v| f(c, *v)).collect()).collect()
}

/// A little noise over all, as no two renders are equal.
fn noisy(planes: Planes) -> Planes {
    let disturbed = |(c, p): (usize, Vec<f32>)| {
        p.iter().enumerate().map(|(i, v)| v * (1.0 + 0.02 * (noise(i, 11 + c as u64) - 0.5))).collect()
    };
    planes.into_iter().enumerate().map(disturbed).collect()
}

#[test]
fn the_usual_slips_are_named_through_noise() {
    let [w, h] = SIZE;
    let square = [64, 64];
    let scaled = |k: f32| curved(move |_, v| v * k);
    let swapped = || {
        let mut planes = scene(SIZE);
        planes.swap(0, 2);
        planes
    };
    let cases: Vec<([usize; 2], Planes, &str)> = vec![
        (SIZE, moved(SIZE, |x, y| [w - 1 - x, y]), "flipped left to right"),
        (SIZE, moved(SIZE, |x, y| [x, h - 1 - y]), "flipped upside down"),
        (SIZE, moved(SIZE, |x, y| [w - 1 - x, h - 1 - y]), "turned by 180"),
        (square, moved(square, |x, y| [y, x]), "rows and columns"),
        (square, moved(square, |x, y| [y, 63 - x]), "turned by 90 degrees to the right"),
        (SIZE, moved(SIZE, |x, y| [x.saturating_sub(1), y]), "shifted by 1 pixel to the right"),
        (SIZE, moved(SIZE, |x, y| [x + 2, y.saturating_sub(3)]), "2 pixels to the left and 3 pixels down"),
        (SIZE, scaled(std::f32::consts::FRAC_1_PI), "1/pi times"),
        (SIZE, scaled(255.0), "255 times"),
        (SIZE, scaled(0.25), "exposure is -2 stops"),
        (SIZE, scaled(1.37), "1.37"),
        (SIZE, curved(|c, v| v * [1.3, 1.0, 0.8][c]), "channels are scaled"),
        (SIZE, curved(|_, v| linear_to_srgb(v)), "the test is sRGB-encoded"),
        (SIZE, curved(|_, v| v.powf(1.0 / 2.2)), "encoded by gamma 2.2"),
        (SIZE, curved(|_, v| v.powf(0.8) * 1.1), "to the power 0.8"),
        (SIZE, curved(|_, v| v.min(1.0)), "cut off at 1"),
        (SIZE, curved(|_, v| v + 0.5), "a constant is added"),
        (SIZE, swapped(), "the order B G R"),
    ];
    for (size, test, expected) in cases {
        // What is cut off is little, and would drown.
        let test = if expected.contains("cut off") { test } else { noisy(test) };
        let cause = likely(&pair(size, test));
        let text = cause.as_ref().map_or("none", |c| c.text.as_str());
        assert!(text.contains(expected), "{expected}: {cause:?}");
    }
}

#[test]
fn noise_alone_has_no_cause() {
    assert_eq!(likely(&pair(SIZE, noisy(scene(SIZE)))), None);
    assert_eq!(likely(&pair(SIZE, scene(SIZE))), None);
    // As different as two scenes.
    let other = (0..3).map(|c| (0..SIZE[0] * SIZE[1]).map(|i| noise(i, c)).collect()).collect();
    assert_eq!(likely(&pair(SIZE, other)), None);
}

#[test]
fn the_worst_region_is_where_the_error_is() {
    let mut test = scene(SIZE);
    for (x, y) in (40..46).flat_map(|x| (20..24).map(move |y| (x, y))) {
        test[1][y * SIZE[0] + x] += 3.0;
    }
    let pair = pair(SIZE, test);
    let regions = worst(&Input::new(&pair, &MetricOptions::default()));
    let [x, y] = regions[0].at;
    assert!((x..x + 8).contains(&42) && (y..y + 8).contains(&22), "{regions:?}");
    assert!(regions.iter().map(|r| r.share).sum::<f64>() <= 1.0 + 1e-12);
}

fn source(name: &str, size: [usize; 2], planes: &[(&str, Vec<f32>)], stored: Stored) -> Source {
    let mut picture = Picture::new(size[0], size[1]);
    planes.iter().for_each(|(n, data)| picture.push(*n, SampleKind::Float, data.clone()));
    Source { path: name.into(), loaded: Loaded { picture, stored, layer: String::new(), layers: Vec::new() } }
}

fn colors(size: [usize; 2], v: f32) -> Vec<(&'static str, Vec<f32>)> {
    ["R", "G", "B"].map(|n| (n, vec![v; size[0] * size[1]])).to_vec()
}

const BYTES: Stored = Stored::Integer { bits: 8, encoding: Encoding::Srgb };

fn opened(reference: &Source, test: &Source, options: &PairOptions) -> Opened {
    open(reference, test, options).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn files_meet_in_one_space() {
    let size = [4, 2];
    let byte = 188.0 / 255.0;
    let bytes = source("a.png", size, &colors(size, byte), BYTES);
    let floats = source("a.exr", size, &colors(size, 0.25), Stored::Float);
    let usual = PairOptions::default();
    let of = |r: &Source, t: &Source, o: &PairOptions| {
        let p = opened(r, t, o).pair;
        (p.space, p.reference[1][3], p.test[1][3])
    };
    assert_eq!(of(&bytes, &bytes, &usual), (Space::Display, byte, byte), "bytes stay as they are");
    assert_eq!(of(&floats, &bytes, &usual), (Space::Linear, 0.25, srgb_to_linear(byte)));
    let display = PairOptions { space: Some(Space::Display), ..usual.clone() };
    assert_eq!(of(&floats, &bytes, &display), (Space::Display, linear_to_srgb(0.25), byte));
    let brighter = PairOptions { exposure: 1.0, ..usual };
    assert_eq!(of(&floats, &floats, &brighter), (Space::Linear, 0.5, 0.5));
    let got = of(&bytes, &bytes, &brighter);
    assert_eq!(got.1, linear_to_srgb(2.0 * srgb_to_linear(byte)), "exposure is one of light");
    let linear = Stored::Integer { bits: 8, encoding: Encoding::Linear };
    let linear = source("b.png", size, &colors(size, byte), linear);
    assert_eq!(of(&floats, &linear, &PairOptions::default()), (Space::Linear, 0.25, byte));
}

#[test]
fn pixels_that_are_no_numbers_are_left_out_and_told() {
    let size = [4, 3];
    let reference = source("a.exr", size, &colors(size, 1.0), Stored::Float);
    let mut planes = colors(size, 1.5);
    planes[0].1[5] = f32::NAN;
    planes[2].1[5] = f32::INFINITY;
    planes[1].1[11] = f32::NEG_INFINITY;
    let test = source("b.exr", size, &planes, Stored::Float);
    let done = opened(&reference, &test, &PairOptions::default());
    assert_eq!((done.pair.count(), done.invalid[0].count()), (10, 0));
    let text = done.invalid[1].describe().unwrap();
    assert_eq!(text, "pixels that are no numbers: 1 NaN, 1 infinite, at (1, 1), (3, 2)");
    assert!(done.pair.test.iter().flatten().all(|v| v.is_finite()));
    let nothing = source("c.exr", size, &colors(size, f32::NAN), Stored::Float);
    let error = open(&reference, &nothing, &PairOptions::default()).unwrap_err().to_string();
    assert!(error.contains("no pixel is left"), "{error}");
}

#[test]
fn what_cannot_be_compared_is_told_with_both_sizes_and_channels() {
    let size = [8, 4];
    let reference = source("a.exr", size, &colors(size, 1.0), Stored::Float);
    let refusal = |test: &Source| open(&reference, test, &PairOptions::default()).unwrap_err().to_string();
    let half = refusal(&source("b.exr", [4, 2], &colors([4, 2], 1.0), Stored::Float));
    assert!(
        half.contains("b.exr: is 4x2, and the reference a.exr is 8x4") && half.contains("0.500"),
        "{half}"
    );
    let turned = refusal(&source("b.exr", [4, 8], &colors([4, 8], 1.0), Stored::Float));
    assert!(turned.contains("a quarter"), "{turned}");
    let depth = refusal(&source("b.exr", size, &[("Z", vec![1.0; 32])], Stored::Float));
    assert!(depth.contains("has channels Z") && depth.contains("R, G, B"), "{depth}");
}

#[test]
fn gray_pictures_stand_for_colours_and_layers_for_themselves() {
    let size = [4, 4];
    let color = source("a.exr", size, &colors(size, 0.5), Stored::Float);
    let gray = source("b.exr", size, &[("Y", vec![0.5; 16])], Stored::Float);
    let done = opened(&color, &gray, &PairOptions::default());
    assert_eq!(done.pair.reference, done.pair.test);
    assert!(done.notes[0].contains("the test is gray"), "{:?}", done.notes);
    let normal = |v: f32| ["X", "Y", "Z"].map(|n| (n, vec![v; 16]));
    let normal = |v| source("n.exr", size, &normal(v), Stored::Float);
    let done = opened(&normal(1.0), &normal(-1.0), &PairOptions { exposure: 3.0, ..PairOptions::default() });
    assert_eq!((done.pair.is_color, done.pair.reference[2][0], done.pair.test[2][0]), (false, 1.0, -1.0));
}

#[test]
fn parts_of_pictures_are_those_that_were_asked_for() {
    let size = [8, 4];
    let ramp = |offset: f32| -> Vec<(&'static str, Vec<f32>)> {
        vec![("Y", (0..32).map(|i| i as f32 + offset).collect())]
    };
    let reference = source("a.exr", size, &ramp(0.0), Stored::Float);
    let test = source("b.exr", size, &ramp(0.5), Stored::Float);
    let cropped =
        |crop| opened(&reference, &test, &PairOptions { crop: Some(crop), ..PairOptions::default() }).pair;
    let pixels = cropped(Crop::Pixels([2, 1, 3, 2]));
    assert_eq!((pixels.origin, pixels.reference[0].clone()), ([2, 1], vec![10., 11., 12., 18., 19., 20.]));
    let fractions = cropped(Crop::Fractions([0.5, 1.0, 0.0, 0.5]));
    assert_eq!(fractions.reference[0], [4., 5., 6., 7., 12., 13., 14., 15.]);
    let beyond = PairOptions { crop: Some(Crop::Pixels([7, 0, 2, 1])), ..PairOptions::default() };
    assert!(open(&reference, &test, &beyond).is_err());
    let mask = Mask { size, counted: (0..32).map(|i| i % 8 < 2).collect() };
    let masked = opened(&reference, &test, &PairOptions { mask: Some(mask), ..PairOptions::default() }).pair;
    assert_eq!((masked.count(), masked.reference[0][2], masked.reference[0][9]), (8, 0.0, 9.0));
    let small = Mask { size: [2, 2], counted: vec![true; 4] };
    let error = open(&reference, &test, &PairOptions { mask: Some(small), ..PairOptions::default() });
    assert!(error.unwrap_err().to_string().contains("the mask is 2x2"));
    // A crop window of the same frame.
    let mut part = source("c.exr", [3, 2], &[("Y", vec![10.0, 11.0, 12.0, 18.0, 19.0, 20.0])], Stored::Float);
    part.loaded.picture.origin = [2, 1];
    part.loaded.picture.frame = size;
    let done = opened(&reference, &part, &PairOptions::default());
    assert_eq!(done.pair.reference, done.pair.test);
    assert!(done.notes[0].contains("different parts of one frame"));
}
