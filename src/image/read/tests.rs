use super::*;
use crate::base::image_data::Texels;
use crate::color::{Rgb, srgb_to_linear};
use crate::testing::data_dir;
use image::{GrayImage, ImageBuffer, Luma, Rgba, RgbaImage};
use std::path::PathBuf;

fn temp() -> tempfile::TempDir {
    tempfile::tempdir().expect("temporary folder")
}

fn encode(picture: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Vec::new();
    picture.into().write_to(&mut Cursor::new(&mut bytes), format).expect("encodes");
    bytes
}

fn decode(bytes: &[u8]) -> Result<ImageData> {
    decode_image(Path::new("test"), bytes, None)
}

fn mean(image: &ImageData) -> [f64; 3] {
    let mut sum = [0f64; 3];
    for y in 0..image.height {
        for x in 0..image.width {
            let t = image.texel(x, y).to_array();
            (0..3).for_each(|c| sum[c] += f64::from(t[c]));
        }
    }
    sum.map(|s| s / (image.width * image.height) as f64)
}

#[track_caller]
fn assert_mean(path: PathBuf, size: (usize, usize), expected: [f64; 3]) {
    let image = read_image(&path, None).expect("reads");
    assert_eq!((image.width, image.height), size, "{}", path.display());
    for (a, b) in mean(&image).iter().zip(expected) {
        // The index gives four decimals.
        assert!((a - b).abs() <= 6e-5, "{}: mean {a}, expected {b}", path.display());
    }
}

#[track_caller]
fn assert_raw_mean(path: PathBuf, expected: [f64; 3]) {
    let picture = read_planes(&path).expect("reads");
    for (name, expected) in ["R", "G", "B"].into_iter().zip(expected) {
        let data = &picture.plane(name).expect(name).data;
        let mean = data.iter().map(|&v| f64::from(v)).sum::<f64>() / data.len() as f64;
        // Four decimals, and the lossy decoder may differ in the last bit of a half (2^-11 relative).
        assert!((mean - expected).abs() <= 6e-5 + expected * 1e-4, "{}: {name} {mean}", path.display());
    }
}

#[test]
fn eight_bit_files_stay_eight_bit_and_keep_alpha() {
    let rgba = RgbaImage::from_fn(3, 2, |x, y| Rgba([x as u8 * 100, y as u8 * 200, 7, 9]));
    let png = encode(rgba.clone(), ImageFormat::Png);
    let image = decode(&png).unwrap();
    assert_eq!(image.texels, Texels::Srgb8(rgba.pixels().map(|p| p.0).collect()));
    let image = decode_image(Path::new("t"), &png, Some(Encoding::Linear)).unwrap();
    assert_eq!(image.texel(2, 1), Rgb::new(200.0 / 255.0, 200.0 / 255.0, 7.0 / 255.0));
}

#[test]
fn gray_becomes_three_equal_channels() {
    let gray = GrayImage::from_fn(4, 4, |x, y| Luma([(x * 16 + y) as u8]));
    for format in [ImageFormat::Png, ImageFormat::Jpeg] {
        let image = decode(&encode(gray.clone(), format)).unwrap();
        let t = image.texel(3, 3);
        assert!(t.r == t.g && t.g == t.b);
    }
}

#[test]
fn sixteen_bit_png_goes_through_the_curve_exactly() {
    let deep = ImageBuffer::<Luma<u16>, _>::from_fn(256, 256, |x, y| Luma([(y * 256 + x) as u16]));
    let image = decode(&encode(deep, ImageFormat::Png)).unwrap();
    for v in [0u16, 1, 255, 256, 2571, 40000, 65535] {
        let (x, y) = (usize::from(v % 256), usize::from(v / 256));
        assert_eq!(image.texel(x, y), Rgb::splat(srgb_to_linear(f32::from(v) / 65535.0)));
    }
    // 257 v is the 16-bit form of the 8-bit value v: both ways must agree.
    let v = 100u16 * 257;
    assert_eq!(image.texel(usize::from(v % 256), usize::from(v / 256)).r, srgb_to_linear(100.0 / 255.0));
}

#[test]
fn hdr_claim_of_sixty_thousand_squared_in_forty_bytes_is_refused() {
    let bytes = b"#?RADIANCE\n\n-Y 60000 +X 60000\n0123456789";
    let message = decode(bytes).unwrap_err().to_string();
    assert!(message.contains("60000 x 60000"), "{message}");
    // Within the absolute cap, still far more than the file can hold.
    let message = decode(b"#?RADIANCE\n\n-Y 9000 +X 9000\n0123456789").unwrap_err().to_string();
    assert!(message.contains("more than its"), "{message}");
    for claim in ["0", "4294967295", "99999999999999999999", "-5"] {
        let text = format!("#?RGBE\n\n-Y {claim} +X 4\n");
        assert!(matches!(decode(text.as_bytes()), Err(Error::Content { .. })), "{claim}");
    }
}

#[test]
fn hdr_row_codings_and_orientations() {
    // Mantissa 128 at exponent 129 is 1, by the definition 2^(e - 136) m.
    let flat = |size: &str, pixels: &[[u8; 4]]| {
        let mut file = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}\n").into_bytes();
        file.extend(pixels.iter().flatten());
        decode(&file).expect(size)
    };
    let pixels = [
        [128, 0, 0, 129],
        [0, 128, 0, 129],
        [0, 0, 128, 129],
        [0, 0, 0, 0],
        [128, 128, 128, 130],
        [64, 0, 0, 129],
    ];
    let values =
        [[1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [0., 0., 0.], [2., 2., 2.], [0.5, 0., 0.]].map(Rgb::from);
    // (line, i) of a stored value to (x, y), for 2 lines of 3.
    type Place = fn(usize, usize) -> (usize, usize);
    let cases: [(&str, Place); 8] = [
        ("-Y 2 +X 3", |l, i| (i, l)),
        ("-Y 2 -X 3", |l, i| (2 - i, l)),
        ("+Y 2 +X 3", |l, i| (i, 1 - l)),
        ("+Y 2 -X 3", |l, i| (2 - i, 1 - l)),
        ("+X 2 -Y 3", |l, i| (l, i)),
        ("+X 2 +Y 3", |l, i| (l, 2 - i)),
        ("-X 2 -Y 3", |l, i| (1 - l, i)),
        ("-X 2 +Y 3", |l, i| (1 - l, 2 - i)),
    ];
    for (size, place) in cases {
        let image = flat(size, &pixels);
        for (k, &value) in values.iter().enumerate() {
            let (x, y) = place(k / 3, k % 3);
            assert_eq!(image.texel(x, y), value, "{size}, stored value {k}");
        }
    }
    // Old coding: the pixel, then 1 + 256 repeats by two records.
    let image = flat("-Y 1 +X 258", &[[128, 0, 0, 129], [1, 1, 1, 1], [1, 1, 1, 1]]);
    assert_eq!(mean(&image), [1.0, 0.0, 0.0]);
    // New coding: runs of one value per component.
    let image = flat("-Y 1 +X 8", &[[2, 2, 0, 8], [136, 128, 136, 64], [136, 0, 136, 129]]);
    assert_eq!(mean(&image), [1.0, 0.5, 0.0]);
}

#[test]
fn what_is_no_picture_is_refused_with_the_known_formats() {
    for bytes in [&b""[..], b"hello", b"<svg>"] {
        let message = decode(bytes).unwrap_err().to_string();
        assert!(message.contains("PNG, JPEG, Radiance HDR, EXR, TIFF, PFM"), "{message}");
    }
    let missing = read_image(&temp().path().join("none.png"), None).unwrap_err();
    assert_eq!(missing.exit_code(), 3);
    assert_eq!(read_image(temp().path(), None).unwrap_err().exit_code(), 3);
}

#[test]
fn png_that_claims_more_than_it_holds_is_refused() {
    let mut png = encode(GrayImage::new(8, 8), ImageFormat::Png);
    png[16..24].copy_from_slice(&[0, 0, 0xff, 0xff, 0, 0, 0x10, 0]);
    let crc = {
        // CRC-32 of the header chunk (PNG specification, annex D).
        let mut c = u32::MAX;
        for &b in &png[12..29] {
            c ^= u32::from(b);
            (0..8).for_each(|_| c = if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 });
        }
        !c
    };
    png[29..33].copy_from_slice(&crc.to_be_bytes());
    let message = decode(&png).unwrap_err().to_string();
    assert!(message.contains("65535 x 4096") && message.contains("can hold"), "{message}");
}

#[test]
fn shared_hdr_and_exr_files_have_their_published_means() {
    let Some(dir) = data_dir() else { return };
    let env = dir.join("env");
    assert_mean(env.join("blouberg_sunrise_2_1k.hdr"), (1024, 512), [0.5354, 0.524, 0.5337]);
    assert_mean(env.join("moonless_golf_1k.hdr"), (1024, 512), [0.1389, 0.1205, 0.088]);
    assert_mean(env.join("rainbow.hdr"), (16, 16), [0.7595, 0.7284, 0.7284]);
    assert_mean(env.join("reference_cie.hdr"), (512, 512), [6.0164, 0.9146, 4.3438]);
    assert_mean(env.join("museum.exr"), (512, 256), [0.397, 0.3162, 0.2784]);
    assert_mean(env.join("reference_cie.exr"), (512, 512), [3.9376, 0.8943, 4.0072]);
    let exr = env.join("exr");
    assert_mean(exr.join("OrientationLatLong.exr"), (1024, 512), [0.877, 0.9148, 0.9577]);
    assert_mean(exr.join("Rec709.exr"), (610, 406), [0.3653, 0.2778, 0.1153]);
    assert_mean(exr.join("StageEnvLatLong.exr"), (1000, 500), [2.1864, 2.7637, 3.7541]);
    assert_mean(exr.join("WavyLinesLatLong.exr"), (1024, 512), [0.2021; 3]);
    assert_mean(exr.join("example_tiles.exr"), (512, 512), [0.4946; 3]);
    assert_mean(exr.join("example_zip.exr"), (800, 800), [0.1758; 3]);
    // Of the lossy DWAB files the index takes the mean of the raw values, negative ringing and all.
    assert_raw_mean(env.join("exr-dwab/city.exr"), [0.6823, 0.6718, 0.7881]);
    assert_raw_mean(env.join("exr-dwab/studio.exr"), [1.6372, 1.8835, 2.131]);
    assert_raw_mean(env.join("exr-dwab/sunset.exr"), [0.3864, 0.4027, 0.5303]);
}

#[test]
fn every_half_value_is_survived_and_repaired() {
    let Some(dir) = data_dir() else { return };
    let path = dir.join("env/exr/example_halfs.exr");
    let image = read_image(&path, None).unwrap();
    let Texels::F32(texels) = &image.texels else { panic!("EXR is float") };
    assert!(texels.as_flattened().iter().all(|v| v.is_finite() && *v >= 0.0));
    // The largest half; +infinity becomes it.
    assert_eq!(texels.as_flattened().iter().copied().fold(0.0, f32::max), 65504.0);
    let raw = read_planes(&path).unwrap();
    assert!(raw.planes.iter().any(|p| p.data.iter().any(|v| v.is_nan())));
    assert!(raw.planes.iter().any(|p| p.data.iter().any(|v| v.is_infinite())));
}

#[test]
fn exr_with_unsorted_channels_is_refused_clearly() {
    // The format wants them sorted, and readers differ about what such a file means.
    let Some(dir) = data_dir() else { return };
    let message = read_image(&dir.join("env/exr/example_rle.exr"), None).unwrap_err().to_string();
    assert!(message.contains("not sorted"), "{message}");
}

#[test]
fn palette_png_of_the_shared_data_reads_as_srgb() {
    let Some(dir) = data_dir() else { return };
    let image = read_image(&dir.join("images/cse168-TobeyPineda/direct9.png"), None).unwrap();
    assert_eq!((image.width, image.height), (640, 480));
    assert!(matches!(image.texels, Texels::Srgb8(_)));
}

#[test]
fn damaged_files_fail_cleanly() {
    let Some(dir) = data_dir() else { return };
    let files = [
        "env/rainbow.hdr",
        "env/exr/example_zip.exr",
        "env/exr/example_tiles.exr",
        "env/exr/example_halfs.exr",
        "env/exr-dwab/studio.exr",
        "images/cse168-TobeyPineda/analytic.png",
    ];
    for file in files {
        let good = std::fs::read(dir.join(file)).unwrap();
        let whole = decode(&good).unwrap();
        for step in 1..20 {
            let cut = &good[..good.len() * step / 20];
            // A mip-mapped file may end after its largest level; what is read is then the whole picture.
            match decode(cut) {
                Ok(image) => assert_eq!(image, whole, "{file} cut at {}", cut.len()),
                Err(e) => assert_eq!(e.exit_code(), 2),
            }
            // Damage anywhere may go unnoticed, but it must not panic or run away.
            let mut hurt = good.clone();
            hurt[good.len() * step / 20] ^= 0x55;
            let _ = decode(&hurt);
        }
    }
}

#[test]
fn dwab_chunks_cannot_ask_for_any_amount_of_memory() {
    let Some(dir) = data_dir() else { return };
    let good = std::fs::read(dir.join("env/exr-dwab/studio.exr")).unwrap();
    // A chunk's counters start with the version, 2; the unpacked sizes are counters 1 and 6 to 9.
    let version = 2u64.to_le_bytes();
    let start = good.windows(8).position(|w| w == version).expect("has a chunk");
    for counter in [1, 6, 7, 8, 9] {
        let mut hurt = good.clone();
        hurt[start + 8 * counter..][..8].copy_from_slice(&(1u64 << 56).to_le_bytes());
        let message = decode(&hurt).unwrap_err().to_string();
        assert!(message.contains("claims more"), "counter {counter}: {message}");
    }
}

/// 26 bytes of palette: the decoder would look for a third colour value beyond its end.
#[test]
fn a_png_whose_palette_is_cut_is_refused() {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 3, 1);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_palette((0..27).collect::<Vec<u8>>());
    encoder.write_header().unwrap().write_image_data(&[0, 1, 8]).unwrap();
    assert_eq!(decode(&bytes).unwrap().texel(2, 0).r, crate::color::srgb_to_linear(24.0 / 255.0));
    let at = bytes.windows(4).position(|w| w == b"PLTE").unwrap();
    bytes[at - 1] = 26;
    bytes.remove(at + 4 + 26);
    let e = decode(&bytes).unwrap_err().to_string();
    assert!(e.contains("26 bytes are no palette"), "{e}");
}

#[test]
fn what_a_decoder_does_not_expect_is_damage() {
    let e = guarded(Path::new("a.png"), || -> Result<()> { panic!("index out of bounds") }).unwrap_err();
    assert!(e.to_string().starts_with("a.png: damaged picture") && e.exit_code() == 2, "{e}");
}
