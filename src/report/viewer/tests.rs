//! What the page holds is what it was given, within what it says.

use super::pack::{Format, Shared, pack, pack_map};
use super::*;
use std::io::Read;

fn inflated(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    flate2::read::ZlibDecoder::new(bytes).read_to_end(&mut out).unwrap();
    out
}

#[test]
fn shared_exponents_are_within_a_step_of_their_largest_channel() {
    for exponent in -16..16 {
        for lead in 0..2048 {
            let largest = (1.0 + lead as f32 / 2048.0) * 2f32.powi(exponent);
            if largest > Shared::LARGEST {
                continue;
            }
            let rgb = [largest, 0.37 * largest, 0.011 * largest];
            let back = Shared::of(rgb).to_rgb();
            // Half a step of a mantissa of at least 256.
            let bound = largest / 512.0;
            assert!(rgb.iter().zip(back).all(|(a, b)| (a - b).abs() <= bound), "{rgb:?} {back:?}");
        }
    }
    assert_eq!(Shared::of([Shared::LARGEST; 3]).to_rgb(), [Shared::LARGEST; 3]);
    assert_eq!(Shared::of([1.0, 0.5, 0.25]).to_rgb(), [1.0, 0.5, 0.25]);
    assert_eq!(Shared::of([0.0; 3]).0, 0);
    let tiny = Shared::of([1e-30, 0.0, 0.0]).to_rgb();
    assert_eq!(tiny, [0.0; 3]);
}

#[test]
fn pictures_take_the_smallest_format_that_does() {
    let bytes = vec![[0.0, 1.0, 128.0 / 255.0]; 4];
    let packed = pack(&bytes, true, false);
    assert_eq!((packed.format, packed.error), (Format::Bytes, 0.0));
    assert_eq!(inflated(&packed.bytes), [0, 0, 0, 0, 255, 255, 255, 255, 128, 128, 128, 128]);
    let floats = vec![[0.1, 2.0, 300.0]; 4];
    let packed = pack(&floats, false, false);
    assert_eq!(packed.format, Format::Shared);
    assert!(packed.error > 0.0 && packed.error <= 1.0 / 512.0);
    assert_eq!(pack(&floats, false, true).format, Format::Float);
    assert_eq!(pack(&[[0.5, 2.0, 300.0]; 4], false, true).format, Format::Half);
}

#[test]
fn what_the_format_cannot_hold_is_kept_beside_it() {
    let odd = [[-1.0, 0.0, 2.0], [f32::NAN, 1.0, 1.0], [f32::INFINITY, 0.0, 0.0], [1e9, 0.0, 0.0]];
    let mut rgb = vec![[0.5; 3]; 10];
    rgb[3..7].copy_from_slice(&odd);
    let packed = pack(&rgb, false, false);
    assert_eq!(packed.format, Format::Shared);
    assert_eq!(packed.exceptions.iter().map(|e| e.0).collect::<Vec<_>>(), [3, 4, 5, 6]);
    assert!(packed.exceptions.iter().zip(odd).all(|(e, o)| e.1.map(f32::to_bits) == o.map(f32::to_bits)));
    // Where they are many, everything is kept as it is.
    let packed = pack(&vec![[-1.0; 3]; 5000], false, false);
    assert_eq!((packed.format, packed.exceptions.len()), (Format::Float, 0));
}

#[test]
fn maps_have_even_steps() {
    assert_eq!(inflated(&pack_map(&[0.0, 0.5, 1.0, 2.0, f32::NAN, -1.0], 1.0)), [0, 128, 255, 255, 0, 0]);
}

#[test]
fn names_cannot_end_the_script_that_holds_them() {
    let picture = |name: &str| Viewed { name: name.into(), rgb: vec![[0.5; 3]; 4], facts: Vec::new() };
    let viewer = Viewer {
        size: [2, 2],
        pictures: vec![picture("</script><b>"), picture("<!--")],
        ..Viewer::default()
    };
    let drawn = viewer.drawn().unwrap();
    assert!(!drawn.config.contains('<'));
    let config: serde_json::Value = serde_json::from_str(&drawn.config).unwrap();
    assert_eq!(config["pictures"][0]["name"], "</script><b>");
    let short = Viewer { size: [3, 2], ..viewer };
    assert!(short.drawn().is_err());
}
