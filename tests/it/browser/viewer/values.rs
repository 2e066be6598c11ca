//! Numbers and colours are those of the pictures.

use super::{Page, SIZE, assert_colours, exact, picture, ramp};
use skylit::color::{Rgb, linear_to_srgb, srgb_to_linear};
use skylit::image::false_color::FalseColour;
use skylit::image::tonemap::{Look, ToneMap};
use skylit::report::viewer::{ErrorMap, Viewed, Viewer};

/// What the page shows of a pixel that has no colour.
const NO_COLOUR: [u8; 3] = [255, 0, 255];

fn bytes(display_linear: Rgb) -> [u8; 3] {
    display_linear.to_array().map(|v| (255.0 * linear_to_srgb(v)).round() as u8)
}

fn colour(rgb: [f32; 3], exposure: f32, tonemap: ToneMap) -> [u8; 3] {
    if !rgb.iter().all(|v| v.is_finite()) {
        return NO_COLOUR;
    }
    bytes(Look { exposure, tonemap, ..Look::default() }.apply(Rgb::from(rgb)))
}

fn at(picture: &Viewed, x: usize, y: usize) -> [f32; 3] {
    picture.rgb[y * SIZE[0] + x]
}

/// From 2^-17 to 2^13, channels apart, with what a page may meet in the first row.
fn wide(name: &str, turn: usize) -> Viewed {
    let odd = [
        [f32::NAN, 0.5, 0.5],
        [f32::INFINITY, 1.0, 0.0],
        [0.25, f32::NEG_INFINITY, 1.0],
        [-0.25, 0.5, 0.125],
        [1e6, 2.0, 3.0],
        [0.0; 3],
        [1e-40, 0.0, 3e-9],
        [65408.0, 1.0, 300.0],
        [-0.0, 1e-5, 1e-12],
    ];
    picture(name, |x, y| {
        if y == 0 && x < odd.len() {
            return odd[(x + turn) % odd.len()];
        }
        let power = |k: usize| ((x * 7 + y * 11 + k * 5 + turn * 3) % 31) as f32 - 17.0;
        // Five steps within an octave, so that mantissas differ.
        [0, 1, 2].map(|k| (power(k) + ((x + 2 * y + k) % 5) as f32 / 5.0).exp2())
    })
}

/// The largest difference of a held channel from the picture's, as RGB9E5 has it: half a step where the largest mantissa
/// is at least 256, a whole one where it rounds up to 512; of the smallest exponent 2^-25.
fn held_within(rgb: [f32; 3]) -> f64 {
    let shared = rgb.iter().all(|v| (0.0..=65408.0).contains(v));
    let largest = rgb.iter().copied().fold(0.0, f32::max);
    if shared { (f64::from(largest) / 511.5).max(2f64.powi(-25)) } else { 0.0 }
}

/// A number as it is written: to five digits, or four beside a power of ten.
#[track_caller]
fn assert_number(text: &str, value: f64, within: f64, what: &str) {
    let read: f64 = text.parse().unwrap_or_else(|_| panic!("{what}: {text:?} is no number"));
    if !value.is_finite() {
        assert!(
            read.to_bits() == value.to_bits() || read.is_nan() && value.is_nan(),
            "{what}: {text}, not {value}"
        );
        return;
    }
    let written = 5.1e-4 * read.abs();
    assert!((read - value).abs() <= within + written, "{what}: {text}, not {value} to {within}");
}

#[test]
fn the_pointer_reads_the_values_of_its_pixel() {
    let (a, b) = (wide("a", 0), wide("b", 1));
    for lossless in [false, true] {
        let viewer = Viewer { origin: [100, 2000], lossless, ..exact(vec![a.clone(), b.clone()]) };
        let Some(mut page) = Page::of(viewer) else { return };
        page.mode("flip");
        let pixels = page.pixels();
        let odd = (0..10).map(|x| (x, 0));
        let some = (0..12).map(|i| (i * 13 % SIZE[0], 1 + i * 5 % (SIZE[1] - 1)));
        for (x, y) in odd.chain(some).chain([(0, SIZE[1] - 1), (SIZE[0] - 1, SIZE[1] - 1)]) {
            page.tab.move_to(pixels.of(x, y));
            let told = page.readout();
            let what = format!("pixel {x}, {y}");
            assert_eq!(told[12], format!("pixel {}, {}", x + 100, y + 2000));
            let [va, vb] = [at(&a, x, y), at(&b, x, y)];
            let within = |v| if lossless { 0.0 } else { held_within(v) };
            for k in 0..3 {
                let [fa, fb] = [f64::from(va[k]), f64::from(vb[k])];
                assert_number(&told[1 + k], fa, within(va), &what);
                assert_number(&told[5 + k], fb, within(vb), &what);
                let rounding = 1e-7 * (fa.abs() + fb.abs());
                assert_number(
                    &told[9 + k],
                    fb - fa,
                    within(va) + within(vb) + rounding,
                    &format!("{what}, difference"),
                );
            }
        }
        page.tab.move_to([2.0, 2.0]);
        assert_eq!(page.readout()[12], "pixel –", "beside the stage");
        page.tab.assert_clean();
    }
}

#[test]
fn exposure_and_tone_maps_are_those_of_files() {
    let (a, b) = (ramp("a", 0.0), wide("b", 0));
    let Some(mut page) = Page::of(exact(vec![a.clone(), b.clone()])) else { return };
    page.mode("flip");
    let pixels = page.pixels();
    for tonemap in ToneMap::ALL {
        page.tab.choose("[data-tonemap]", tonemap.name());
        for exposure in [-3.0, 0.0, 2.25] {
            page.tab.slide("[data-exposure]", exposure);
            let shot = page.tab.shot();
            let wanted = |x, y| Some(colour(at(&b, x, y), exposure as f32, tonemap));
            assert_colours(&shot, &pixels, 0..SIZE[1], &format!("{tonemap}, {exposure}"), wanted, 1);
        }
    }
    assert_eq!(page.tab.text("document.querySelector('[data-stops]').textContent"), "+2.25 EV");
    page.tab.assert_clean();
}

#[test]
fn encoded_pictures_are_shown_as_they_are() {
    let byte = |x: usize, y: usize, k: usize| ((x * 13 + y * 7 + k * 85) % 256) as u8;
    let of = |x, y| [0, 1, 2].map(|k| f32::from(byte(x, y, k)) / 255.0);
    let dark = picture("a", |x, y| if (x, y) == (3, 3) { [f32::NAN; 3] } else { [0.0; 3] });
    let viewer = Viewer { encoded: true, ..exact(vec![dark, picture("b", of)]) };
    for lossless in [false, true] {
        let Some(mut page) = Page::of(Viewer { lossless, ..viewer.clone() }) else { return };
        page.mode("flip");
        let pixels = page.pixels();
        let shot = page.tab.shot();
        let wanted = |x, y| Some([0, 1, 2].map(|k| byte(x, y, k)));
        assert_colours(&shot, &pixels, 0..SIZE[1], "as stored", wanted, 0);
        page.tab.slide("[data-exposure]", 1.0);
        let shot = page.tab.shot();
        let brighter = |x, y| Some(bytes(Rgb::from(of(x, y).map(|v| 2.0 * srgb_to_linear(v)))));
        assert_colours(&shot, &pixels, 0..SIZE[1], "a stop more", brighter, 1);
        for exposure in [1.0, 0.0] {
            page.tab.slide("[data-exposure]", exposure);
            page.tab.click("[data-front]");
            let shot = page.tab.shot();
            let wanted = |x, y| Some(if (x, y) == (3, 3) { NO_COLOUR } else { [0; 3] });
            assert_colours(&shot, &pixels, 0..SIZE[1], "no number", wanted, 0);
            page.tab.click("[data-front]");
        }
        page.tab.assert_clean();
    }
}

#[test]
fn a_wipe_parts_the_reference_from_the_test() {
    let (a, b) = (ramp("a", 0.0), ramp("b", 0.25));
    let Some(mut page) = Page::of(exact(vec![a.clone(), b.clone()])) else { return };
    page.mode("wipe");
    let pixels = page.pixels();
    let [left, _, wide, _] = pixels.stage;
    // The first row and the last ones lie under names and the slider.
    let check = |page: &mut Page, part: f64| {
        let shot = page.tab.shot();
        let divider = left + part * wide;
        let wanted = |x, y| {
            let off = pixels.of(x, y)[0] - divider;
            let of = if off < 0.0 { &a } else { &b };
            // The divider itself is white.
            (off.abs() > 3.0).then(|| colour(at(of, x, y), 0.0, ToneMap::None))
        };
        assert_colours(&shot, &pixels, 2..SIZE[1] - 3, &format!("at {part}"), wanted, 1);
    };
    check(&mut page, 0.5);
    page.tab.move_to([pixels.middle[0] + 2.0, pixels.middle[1]]);
    page.tab.press();
    page.tab.move_to([left + 0.45 * wide, pixels.middle[1]]);
    page.tab.move_to([left + 0.42 * wide, pixels.middle[1]]);
    page.tab.release();
    let part = page.state("wipe");
    assert!((part - 0.42).abs() < 0.01, "{part}");
    check(&mut page, part);
    page.tab.key("]");
    page.tab.key("]");
    let moved = page.state("wipe");
    assert!((moved - part - 0.04).abs() < 1e-9, "{moved}");
    check(&mut page, moved);
    for (value, part) in [(0.0, 0.0), (100.0, 1.0), (60.0, 0.6)] {
        page.tab.slide("input[data-wipe]", value);
        check(&mut page, part);
    }
    page.tab.assert_clean();
}

#[test]
fn maps_have_the_colours_of_their_scale() {
    let (a, b) =
        (ramp("a", 0.25), picture("b", |x, y| [0.25 + y as f32 / 64.0 + (x as f32 - 9.5) / 64.0; 3]));
    let value = |x: usize, y: usize| if x == 3 { f32::NAN } else { (y * SIZE[0] + x) as f32 / 200.0 };
    let values: Vec<f32> = (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| value(x, y))).collect();
    let map = ErrorMap { metric: "probe".into(), help: "known".into(), test: 1, values, high: Some(2.5) };
    let viewer = Viewer { maps: vec![map], ..exact(vec![a.clone(), b.clone()]) };
    let Some(mut page) = Page::of(viewer) else { return };
    page.mode("map");
    page.tab.choose("[data-map]", "probe");
    let pixels = page.pixels();
    let shot = page.tab.shot();
    let wanted = |x, y| {
        let v = value(x, y);
        let share = (v / 2.5 * 255.0).round().clamp(0.0, 255.0) / 255.0;
        (!v.is_nan()).then(|| FalseColour::Inferno.at(share).map(|c| (255.0 * c).round() as u8))
    };
    assert_colours(&shot, &pixels, 0..SIZE[1] - 2, "probe", wanted, 1);
    let legend = "[...document.querySelectorAll('[data-legend] span')].map((s) => s.textContent)";
    assert_eq!(page.told(legend), serde_json::json!(["0", "2.5"]));
    let [x, y, w, h] = page.tab.place("[data-legend] canvas");
    let shot = page.tab.shot();
    let ends = [[x + 2.0, y + h / 2.0], [x + w - 2.0, y + h / 2.0]].map(|p| shot.at(p).map(u32::from));
    let sum = |c: [u32; 3]| c.iter().sum::<u32>();
    assert!(sum(ends[0]) < 90 && sum(ends[1]) > 450, "black to pale yellow: {ends:?}");
    page.tab.move_to(pixels.of(7, 9));
    let told = page.readout();
    let read = told[13].strip_prefix("probe ").expect("the map's value");
    // In steps of 1/255 of the range.
    assert_number(read, f64::from(value(7, 9)), 2.5 / 510.0 + 1e-6, "map");

    // Worked out by the page: blue where the test is darker, red where it is brighter.
    page.tab.choose("[data-map]", "signed");
    let shot = page.tab.shot();
    for (x, y) in [(0, 5), (1, 20), (18, 5), (19, 20)] {
        let apart: f32 = at(&b, x, y).iter().zip(at(&a, x, y)).map(|(b, a)| b - a).sum();
        let [red, _, blue] = shot.at(pixels.of(x, y)).map(i32::from);
        assert!(apart.abs() > 0.01 && (red > blue) == (apart > 0.0), "{x}, {y}: {apart}, {red}, {blue}");
    }
    for metric in ["absolute", "relative"] {
        page.tab.choose("[data-map]", metric);
        page.tab.move_to(pixels.of(5, 6));
        let [va, vb] = [at(&a, 5, 6), at(&b, 5, 6)].map(|v| v.map(f64::from));
        let light: f64 = a.rgb.iter().map(|v| f64::from(Rgb::from(*v).luminance())).sum();
        let epsilon = 0.01 * (light / a.rgb.len() as f64).powi(2);
        let off = |k: usize| (vb[k] - va[k]).abs();
        let wanted = match metric {
            "absolute" => off(0).max(off(1)).max(off(2)),
            _ => ((0..3).map(|k| off(k).powi(2) / (va[k].powi(2) + epsilon)).sum::<f64>() / 3.0).sqrt(),
        };
        let told = page.readout();
        let read = told[13].strip_prefix(metric).expect("the map's value").trim();
        assert_number(read, wanted, 1e-6, metric);
    }
    page.tab.assert_clean();
}
