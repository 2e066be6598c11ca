use super::*;
use crate::base::image_data::Texels;
use crate::color::{Rgb, linear_to_srgb, srgb_to_linear};
use crate::image::load::{Loaded, Stored, load};
use crate::image::picture::SampleKind;
use crate::image::read::{read_image, read_planes};
use crate::image::tonemap::ToneMap;
use crate::testing::TestRng;

/// A crop of a frame with every kind of plane, noise and flat parts.
fn picture(width: usize, height: usize) -> Picture {
    let mut rng = TestRng::new(11);
    let mut picture = Picture::new(width, height);
    picture.origin = [3, 5];
    picture.frame = [width + 10, height + 7];
    let mut noise = |scale: f32| (0..width * height).map(|_| rng.f32() * scale).collect::<Vec<_>>();
    picture.push("R", SampleKind::Half, noise(2.0));
    picture.push("G", SampleKind::Half, noise(0.01));
    picture.push("B", SampleKind::Half, noise(60000.0));
    picture.push("A", SampleKind::Half, vec![1.0; width * height]);
    picture.push("depth.Z", SampleKind::Float, noise(1e6));
    picture.push("albedo.R", SampleKind::Float, vec![0.1; width * height]);
    picture.metadata.push(("software".into(), "skylit 0.1".into()));
    picture.metadata.push(("a key that is longer than thirty-one bytes".into(), "Größe \"1\"".into()));
    picture
}

#[test]
fn exr_comes_back_bit_for_bit() {
    let dir = tempfile::tempdir().expect("folder");
    let path = dir.path().join("x.exr");
    // One line, partial and whole blocks, wide enough for several Huffman tables.
    for (width, height) in [(1, 1), (7, 16), (33, 17), (2000, 40)] {
        let out = picture(width, height);
        write_picture(&path, &out, &WriteOptions::default()).expect("writes");
        let back = read_planes(&path).expect("reads");
        assert_eq!(
            (back.width, back.height, back.origin, back.frame),
            (width, height, out.origin, out.frame)
        );
        let mut metadata = out.metadata.clone();
        metadata.sort();
        assert_eq!(back.metadata, metadata);
        assert_eq!(back.planes.len(), out.planes.len());
        for plane in &out.planes {
            let read = back.plane(&plane.name).expect("there");
            assert_eq!(read.kind, plane.kind);
            for (a, b) in read.data.iter().zip(&plane.data) {
                let stored =
                    if plane.kind == SampleKind::Half { half::f16::from_f32(*b).to_f32() } else { *b };
                assert_eq!(a.to_bits(), stored.to_bits(), "{}", plane.name);
            }
        }
    }
    assert_eq!(std::fs::read_dir(dir.path()).expect("lists").count(), 1, "a temporary file was left");
}

#[test]
fn the_same_picture_gives_the_same_file() {
    let dir = tempfile::tempdir().expect("folder");
    let files = ["a.exr", "b.exr"].map(|name| {
        let path = dir.path().join(name);
        write_picture(&path, &picture(50, 60), &WriteOptions::default()).expect("writes");
        std::fs::read(path).expect("reads")
    });
    assert_eq!(files[0], files[1]);
}

#[test]
fn values_beyond_a_half_become_its_largest() {
    let dir = tempfile::tempdir().expect("folder");
    let path = dir.path().join("x.exr");
    let mut out = Picture::new(2, 1);
    out.push("R", SampleKind::Half, vec![1e9, -1e9]);
    out.push("G", SampleKind::Float, vec![1e9, f32::INFINITY]);
    write_picture(&path, &out, &WriteOptions::default()).expect("writes");
    let back = read_planes(&path).expect("reads");
    assert_eq!(back.plane("R").expect("R").data, [65504.0, -65504.0]);
    assert_eq!(back.plane("G").expect("G").data, [1e9, f32::INFINITY]);
}

#[test]
fn png_holds_the_look_through_the_srgb_curve() {
    let dir = tempfile::tempdir().expect("folder");
    let path = dir.path().join("x.PNG");
    let out = picture(40, 30);
    let look = Look { exposure: -1.0, tonemap: ToneMap::Reinhard, ..Look::default() };
    write_picture(&path, &out, &WriteOptions { look, alpha: true, bits: None }).expect("writes");
    let image = read_image(&path, None).expect("reads");
    let Texels::Srgb8(texels) = &image.texels else { panic!("8 bits") };
    let value = |name: &str, at: usize| out.plane(name).expect("there").data[at];
    for (at, texel) in texels.iter().enumerate() {
        let shown = look.apply(Rgb::new(value("R", at), value("G", at), value("B", at)));
        let wanted = shown.to_array().map(|v| linear_to_srgb(v) * 255.0);
        for c in 0..3 {
            // Half a step of rounding, and f32 against f64 in the curve.
            assert!((f32::from(texel[c]) - wanted[c]).abs() <= 0.501, "{texel:?} {wanted:?}");
        }
        assert_eq!(texel[3], 255);
    }
}

#[test]
fn png_alpha_is_not_multiplied_in_and_optional() {
    let dir = tempfile::tempdir().expect("folder");
    let path = dir.path().join("x.png");
    let mut out = Picture::new(2, 1);
    for name in ["R", "G", "B"] {
        // Half-covered white, associated with alpha; and nothing.
        out.push(name, SampleKind::Half, vec![0.5, 0.0]);
    }
    out.push("A", SampleKind::Half, vec![0.5, 0.0]);
    let read = |alpha| {
        write_picture(&path, &out, &WriteOptions { alpha, ..WriteOptions::default() }).expect("writes");
        read_image(&path, None).expect("reads").texels
    };
    assert_eq!(read(true), Texels::Srgb8(vec![[255, 255, 255, 128], [0, 0, 0, 0]]));
    // 0.5 in sRGB is 187.5.
    assert_eq!(read(false), Texels::Srgb8(vec![[188, 188, 188, 255], [0, 0, 0, 255]]));
}

#[test]
fn jpeg_is_near() {
    let dir = tempfile::tempdir().expect("folder");
    let path = dir.path().join("x.jpg");
    let mut out = Picture::new(64, 64);
    let ramp: Vec<f32> = (0..64 * 64).map(|i| (i % 64) as f32 / 63.0).collect();
    ["R", "G", "B"].iter().for_each(|name| out.push(*name, SampleKind::Half, ramp.clone()));
    write_picture(&path, &out, &WriteOptions::default()).expect("writes");
    let image = read_image(&path, None).expect("reads");
    for (x, &v) in ramp[..64].iter().enumerate() {
        let (a, b) = (linear_to_srgb(image.texel(x, 31).g), linear_to_srgb(v));
        // A few of 255 steps at this quality, on a smooth ramp.
        assert!((a - b).abs() < 4.0 / 255.0, "{a} {b}");
    }
}

#[test]
fn places_that_cannot_be_written_are_found_beforehand() {
    let dir = tempfile::tempdir().expect("folder");
    let at = |name: &str| dir.path().join(name);
    std::fs::create_dir(at("folder.png")).expect("creates");
    std::fs::write(at("file"), "x").expect("writes");
    std::fs::write(at("old.png"), "precious").expect("writes");
    for (path, code, part) in [
        (at("x.bmp"), 2, "png, jpg, exr, hdr, pfm, tiff"),
        (at("x"), 2, "png, jpg, exr, hdr, pfm, tiff"),
        (at("none/x.png"), 3, "does not exist"),
        (at("folder.png"), 3, "folder"),
        (at("file/x.png"), 3, "not a folder"),
    ] {
        let error = check_writable(&path).expect_err("cannot be written");
        assert_eq!(error.exit_code(), code, "{error}");
        assert!(
            error.to_string().contains(part) && error.to_string().contains(&*path.to_string_lossy()),
            "{error}"
        );
        assert!(write_picture(&path, &picture(2, 2), &WriteOptions::default()).is_err());
    }
    check_writable(&at("new.exr")).expect("can be written");
    check_writable(&at("old.png")).expect("can be replaced");
    assert!(!at("new.exr").exists());
    assert_eq!(std::fs::read(at("old.png")).expect("reads"), b"precious");
    assert_eq!(std::fs::read_dir(dir.path()).expect("lists").count(), 3, "something was left behind");
}

#[test]
fn a_picture_that_fits_no_display_leaves_nothing_behind() {
    let dir = tempfile::tempdir().expect("folder");
    let mut out = Picture::new(1, 1);
    out.push("depth.Z", SampleKind::Float, vec![1.0]);
    let error =
        write_picture(&dir.path().join("x.png"), &out, &WriteOptions::default()).expect_err("no colour");
    assert!(error.to_string().contains("R, G, B or Y"), "{error}");
    assert_eq!(std::fs::read_dir(dir.path()).expect("lists").count(), 0);
}

#[cfg(unix)]
#[test]
fn links_are_followed_and_permissions_are_ordinary() {
    use std::os::unix::fs::PermissionsExt;
    let dir = tempfile::tempdir().expect("folder");
    let (link, real) = (dir.path().join("link.png"), dir.path().join("real.png"));
    std::fs::write(&real, "old").expect("writes");
    std::os::unix::fs::symlink(&real, &link).expect("links");
    write_picture(&link, &picture(2, 2), &WriteOptions::default()).expect("writes");
    assert!(link.symlink_metadata().expect("there").is_symlink());
    assert!(read_image(&real, None).is_ok());
    let plain = dir.path().join("plain");
    std::fs::write(&plain, "x").expect("writes");
    let mode = |path: &Path| path.metadata().expect("there").permissions().mode();
    assert_eq!(mode(&real), mode(&plain));
}

/// Colour of any magnitude that `HDR` holds, and runs of one colour.
fn bright(width: usize, height: usize) -> Picture {
    let mut rng = TestRng::new(5);
    let mut picture = Picture::new(width, height);
    for name in ["R", "G", "B"] {
        let value = |i: usize| match i / 7 % 3 {
            0 => 0.75,
            1 => (rng.f32() * 200.0 - 100.0).exp2(),
            _ => rng.f32(),
        };
        picture.push(name, SampleKind::Float, (0..width * height).map(value).collect());
    }
    picture
}

fn written(name: &str, picture: &Picture, options: &WriteOptions) -> (Vec<u8>, Loaded) {
    let dir = tempfile::tempdir().expect("folder");
    let path = dir.path().join(name);
    write_picture(&path, picture, options).expect("writes");
    (std::fs::read(&path).expect("reads"), load(&path, &Default::default()).expect("loads"))
}

#[test]
fn hdr_is_within_half_a_step_whatever_the_width() {
    // Without runs, the least with them, runs beyond 127 and others beyond 128, the most with them.
    for width in [1, 7, 8, 127, 128, 129, 400, 32767, 32768] {
        let picture = bright(width, 3);
        let (bytes, back) = written("x.hdr", &picture, &WriteOptions::default());
        // Another decoder.
        let decoder = image::codecs::hdr::HdrDecoder::new(std::io::Cursor::new(&bytes)).expect("reads");
        let other = image::DynamicImage::from_decoder(decoder).expect("decodes").into_rgb32f().into_raw();
        for i in 0..3 * width {
            let of = |p: &Picture| ["R", "G", "B"].map(|n| p.plane(n).expect("colour").data[i]);
            let (was, is) = (of(&picture), of(&back.picture));
            let most = was.iter().fold(0f32, |a, b| a.max(*b));
            for c in 0..3 {
                // Mantissas of the largest are 128 at least, so that half a step is 1 / 256 of it; but 255.5 becomes 256.
                assert!((was[c] - is[c]).abs() <= most / 255.5, "{was:?} {is:?}");
                assert_eq!(other[3 * i + c], is[c]);
            }
        }
    }
}

#[test]
fn hdr_by_its_definition() {
    let mut picture = Picture::new(6, 1);
    picture.push("R", SampleKind::Float, vec![1.0, f32::NAN, 1e-30, f32::INFINITY, 0.999, 0.0]);
    picture.push("G", SampleKind::Float, vec![0.5, -3.0, 1e-39, 2.0, 0.0, 0.0]);
    picture.push("B", SampleKind::Float, vec![0.25, 4.0, 0.0, 0.0, 0.0, f32::NEG_INFINITY]);
    picture.metadata.push(("command".into(), "two\nlines".into()));
    let (bytes, _) = written("x.hdr", &picture, &WriteOptions::default());
    let head = b"#?RADIANCE\n# command=twolines\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 6\n";
    let pixels: [[u8; 4]; 6] = [
        // 1 = 128 * 2^(129 - 136).
        [128, 64, 32, 129],
        [0, 0, 128, 131],
        // 1e-30 = 0.633825 * 2^-99; 256 times that is 162.3.
        [162, 0, 0, 29],
        [255, 0, 0, 255],
        // 0.999 * 256 = 255.7 is 256, which the next exponent holds.
        [128, 0, 0, 129],
        [0; 4],
    ];
    assert_eq!(bytes, [&head[..], &pixels.concat()].concat());
}

#[test]
fn pfm_and_tiff_of_floats_come_back_bit_for_bit() {
    let mut picture = bright(9, 5);
    picture.planes[0].data[..3].copy_from_slice(&[f32::INFINITY, -1.5, 1e-42]);
    let mut gray = Picture::new(9, 5);
    gray.push("Y", SampleKind::Half, picture.planes[0].data.clone());
    let mut covered = picture.clone();
    covered.push("A", SampleKind::Half, (0..45).map(|i| i as f32 / 44.0).collect());
    for name in ["x.pfm", "x.tiff", "x.TIF"] {
        for alpha in [false, true] {
            for picture in [&picture, &gray, &covered] {
                let options = WriteOptions { alpha, ..WriteOptions::default() };
                let (_, back) = written(name, picture, &options);
                assert_eq!(back.stored, Stored::Float);
                let wanted = picture.planes.iter().filter(|p| alpha || p.name != "A");
                assert_eq!(back.picture.planes.len(), wanted.clone().count(), "{name}");
                for plane in wanted {
                    let read = back.picture.plane(&plane.name).expect("there");
                    assert_eq!(read.data, plane.data, "{name} {}", plane.name);
                }
            }
        }
    }
    let (bytes, _) = written("x.pfm", &gray, &WriteOptions::default());
    assert_eq!(bytes[..11], *b"Pf\n9 5\n-1.0");
    assert_eq!(bytes.len(), 12 + 4 * 45);
}

#[test]
fn sixteen_bits_of_png_and_tiff_are_the_nearest() {
    let mut picture = Picture::new(300, 10);
    let ramp: Vec<f32> = (0..3000).map(|i| i as f32 / 2999.0).collect();
    for name in ["R", "G", "B", "A"] {
        let data = ramp.iter().map(|&v| if name == "A" { 1.0 } else { srgb_to_linear(v) }).collect();
        picture.push(name, SampleKind::Float, data);
    }
    for (name, bits, most) in [("x.png", 16, 65535.0), ("x.tiff", 16, 65535.0), ("x.tiff", 8, 255.0f32)] {
        let options = WriteOptions { alpha: true, bits: Some(bits), ..WriteOptions::default() };
        let (_, back) = written(name, &picture, &options);
        assert_eq!(back.stored, Stored::Integer { bits, encoding: Default::default() });
        for (i, (was, is)) in ramp.iter().zip(&back.picture.plane("G").expect("green").data).enumerate() {
            // Half a step, and the curve to linear values in f32.
            assert!((was - is).abs() <= 0.5 / most + 1e-6, "{name} {bits} {i}: {was} {is}");
        }
        assert!(back.picture.plane("A").expect("alpha").data.iter().all(|a| *a == 1.0));
    }
}

#[test]
fn bits_that_a_format_does_not_have_are_refused() {
    let dir = tempfile::tempdir().expect("folder");
    let cases =
        [("x.png", 32, "8 or 16"), ("x.jpg", 16, "but 8"), ("x.hdr", 32, "but 8"), ("x.pfm", 16, "but 32")];
    for (name, bits, words) in cases {
        let options = WriteOptions { bits: Some(bits), ..WriteOptions::default() };
        let e = write_picture(&dir.path().join(name), &bright(2, 2), &options).expect_err("refused");
        assert!(e.to_string().contains(words) && e.exit_code() == 2, "{e}");
    }
    assert_eq!(std::fs::read_dir(dir.path()).expect("lists").count(), 0);
}
