use super::*;
use crate::image::picture::SampleKind;
use crate::image::read::{decode_image, decode_planes};
use crate::image::write::{WriteOptions, write_picture};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding as ExrEncoding, FlatSamples, Image, ImageAttributes, IntegerBounds,
    Layer, LayerAttributes, Vec2, WritableImage,
};
use half::f16;
use std::io::Cursor;
use tiff::encoder::colortype::{self as of, ColorType as TiffColour};
use tiff::encoder::{TiffEncoder, TiffValue};

fn read(bytes: &[u8]) -> Result<Loaded> {
    decode(Path::new("a.picture"), bytes, &LoadOptions::default())
}

fn layer_of(bytes: &[u8], layer: &str) -> Result<Loaded> {
    let options = LoadOptions { layer: Some(layer.to_owned()), ..LoadOptions::default() };
    decode(Path::new("a.exr"), bytes, &options)
}

fn names(loaded: &Loaded) -> Vec<&str> {
    loaded.picture.planes.iter().map(|p| &*p.name).collect()
}

#[track_caller]
fn refused(bytes: &[u8]) -> String {
    match read(bytes) {
        Err(e @ Error::Content { .. }) => e.to_string(),
        other => panic!("{other:?}"),
    }
}

/// Name and channels.
type Part<'a> = (&'a str, &'a [&'a str]);

/// Parts of 2 x 1 pixels; the values of the i-th channel of a part are 10 part + i and that and a half.
fn parts(all: &[Part]) -> Vec<u8> {
    let size = Vec2(2, 1);
    let layers = all.iter().enumerate().map(|(part, (name, channels))| {
        let list = channels.iter().enumerate().map(|(i, channel)| {
            let value = (10 * part + i) as f32;
            AnyChannel::new(*channel, FlatSamples::F32(vec![value, value + 0.5]))
        });
        let attributes =
            if name.is_empty() { LayerAttributes::default() } else { LayerAttributes::named(*name) };
        Layer::new(size, attributes, ExrEncoding::UNCOMPRESSED, AnyChannels::sort(list.collect()))
    });
    let image = Image::from_layers(
        ImageAttributes::new(IntegerBounds::from_dimensions(size)),
        layers.collect::<Vec<_>>(),
    );
    let mut bytes = Cursor::new(Vec::new());
    image.write().non_parallel().to_buffered(&mut bytes).expect("memory takes it");
    bytes.into_inner()
}

#[test]
fn the_picture_is_found_by_the_names_that_programs_give() {
    let cases: [(&[Part], &str, &[&str]); 11] = [
        (
            &[("", &["Z", "A", "B", "G", "R", "albedo.R", "albedo.G", "albedo.B"])],
            "",
            &["R", "G", "B", "A", "Z"],
        ),
        (
            &[(
                "",
                &[
                    "a.R",
                    "a.G",
                    "a.B",
                    "ViewLayer.Combined.R",
                    "ViewLayer.Combined.G",
                    "ViewLayer.Combined.B",
                ],
            )],
            "ViewLayer.Combined",
            &["R", "G", "B"],
        ),
        (
            &[("", &["albedo.R", "albedo.G", "albedo.B", "color.R", "color.G", "color.B", "color.A"])],
            "color",
            &["R", "G", "B", "A"],
        ),
        (
            &[("", &["aov.R", "aov.G", "aov.B", "<root>.R", "<root>.G", "<root>.B"])],
            "<root>",
            &["R", "G", "B"],
        ),
        (&[("", &["r", "g", "b"])], "", &["R", "G", "B"]),
        (&[("", &["depth.Z", "Y"])], "", &["Y"]),
        (&[("", &["n.X", "n.Y", "n.Z", "light.Y"])], "light", &["Y"]),
        (&[("depth", &["Z"]), ("beauty", &["R", "G", "B"])], "beauty", &["R", "G", "B"]),
        (
            &[("a", &["a.albedo.R", "a.albedo.G", "a.albedo.B"]), ("b", &["R", "G", "B"])],
            "b",
            &["R", "G", "B"],
        ),
        (&[("", &["S0.550nm", "S0.450nm"])], "S0", &["450nm", "550nm"]),
        (&[("", &["y", "Y"])], "", &["Y", "y"]),
    ];
    for (file, layer, planes) in cases {
        let loaded = read(&parts(file)).expect("reads");
        assert_eq!((&*loaded.layer, &names(&loaded)[..]), (layer, planes));
        assert_eq!(loaded.stored, Stored::Float);
    }
}

#[test]
fn layers_are_chosen_by_name_by_ending_and_by_channel() {
    let file = parts(&[
        ("View.Combined", &["B", "G", "R"]),
        ("View", &["View.albedo.B", "View.albedo.G", "View.albedo.R"]),
        ("Other", &["albedo.V", "depth.Z"]),
    ]);
    // Channels of a part are in alphabetical order: B is its first.
    let values = |loaded: &Loaded, plane: &str| loaded.picture.plane(plane).expect(plane).data.clone();
    let combined = layer_of(&file, "combined").expect("by its ending");
    assert_eq!((&*combined.layer, values(&combined, "R")), ("View.Combined", vec![2.0, 2.5]));
    let albedo = layer_of(&file, "View.albedo").expect("by its name");
    assert_eq!(values(&albedo, "B"), [10.0, 10.5]);
    let depth = layer_of(&file, "Other.depth.Z").expect("by its channel");
    assert_eq!((names(&depth), values(&depth, "Z")), (vec!["Z"], vec![21.0, 21.5]));
    assert_eq!(depth.layers.len(), 4);
    assert_eq!(depth.layers[0], ("View.Combined".to_owned(), ["R", "G", "B"].map(String::from).to_vec()));
    let message = layer_of(&file, "albedo").expect_err("two").to_string();
    assert!(message.ends_with("ambiguous: View.albedo, Other.albedo"), "{message}");
    let message = layer_of(&file, "View.albdo").expect_err("none").to_string();
    assert!(message.contains("did you mean \"View.albedo\"? known: View.Combined, View.albedo"), "{message}");
    let message = layer_of(&parts(&[("", &["R", "x.R"])]), "depth").expect_err("none").to_string();
    assert!(message.contains("known: (unnamed), x"), "{message}");
}

#[test]
fn our_own_files_come_back_with_crop_window_kinds_and_what_is_not_finite() {
    let mut picture = Picture { origin: [3, 2], frame: [9, 7], ..Picture::new(2, 1) };
    picture.push("R", SampleKind::Half, vec![f32::NAN, 1.0]);
    picture.push("G", SampleKind::Float, vec![f32::INFINITY, 0.1]);
    picture.push("B", SampleKind::Float, vec![f32::NEG_INFINITY, -0.1]);
    picture.push("normal.X", SampleKind::Half, vec![0.5, -1.0]);
    picture.metadata.push(("seed".into(), "7".into()));
    let dir = tempfile::tempdir().expect("a temporary folder");
    let path = dir.path().join("a.exr");
    write_picture(&path, &picture, &WriteOptions::default()).expect("writes");
    let back = load(&path, &LoadOptions::default()).expect("reads").picture;
    assert_eq!((back.origin, back.frame), ([3, 2], [9, 7]));
    assert!(back.metadata.contains(&("seed".into(), "7".into())));
    let [r, g, b] = ["R", "G", "B"].map(|n| back.plane(n).expect(n));
    assert!(r.data[0].is_nan() && r.kind == SampleKind::Half && g.kind == SampleKind::Float);
    assert_eq!([g.data[0], g.data[1], b.data[0], b.data[1]], [f32::INFINITY, 0.1, f32::NEG_INFINITY, -0.1]);
    let bytes = std::fs::read(&path).expect("written");
    assert_eq!(layer_of(&bytes, "normal").expect("reads").picture.planes[0].data, [0.5, -1.0]);
}

fn tiff_of<C: TiffColour>(values: &[C::Inner]) -> Vec<u8>
where
    [C::Inner]: TiffValue,
{
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).expect("begins");
    encoder.write_image::<C>(2, 2, values).expect("memory takes it");
    bytes.into_inner()
}

#[test]
fn tiff_of_every_kind() {
    let whole = |bits| Stored::Integer { bits, encoding: Encoding::Srgb };
    let check = |bytes: &[u8], stored: Stored, planes: &[(&str, [f32; 4])]| {
        let loaded = read(bytes).expect("reads");
        assert_eq!(loaded.stored, stored);
        let found =
            loaded.picture.planes.iter().map(|p| (&*p.name, <[f32; 4]>::try_from(&p.data[..]).unwrap()));
        assert_eq!(found.collect::<Vec<_>>(), planes);
    };
    let bytes = |v: [u32; 4]| v.map(|v| v as f32 / 255.0);
    let words = |v: [u32; 4]| v.map(|v| v as f32 / 65535.0);
    check(&tiff_of::<of::Gray8>(&[0, 1, 128, 255]), whole(8), &[("Y", bytes([0, 1, 128, 255]))]);
    check(&tiff_of::<of::Gray16>(&[0, 1, 32768, 65535]), whole(16), &[("Y", words([0, 1, 32768, 65535]))]);
    let ramp: Vec<u8> = (0..16).collect();
    let rgb = [("R", bytes([0, 3, 6, 9])), ("G", bytes([1, 4, 7, 10])), ("B", bytes([2, 5, 8, 11]))];
    check(&tiff_of::<of::RGB8>(&ramp[..12]), whole(8), &rgb);
    let ramp: Vec<u16> = (0..16).collect();
    let rgba = [0, 1, 2, 3].map(|c| words([c, c + 4, c + 8, c + 12]));
    let rgba: Vec<_> = ["R", "G", "B", "A"].into_iter().zip(rgba).collect();
    check(&tiff_of::<of::RGBA16>(&ramp), whole(16), &rgba);
    let floats = [1e-9, f32::INFINITY, -2.0, 6e20];
    check(&tiff_of::<of::Gray32Float>(&floats), Stored::Float, &[("Y", floats)]);
    let ramp: Vec<f32> = (0..12).map(|v| v as f32).collect();
    let rgb = [("R", [0., 3., 6., 9.]), ("G", [1., 4., 7., 10.]), ("B", [2., 5., 8., 11.])];
    check(&tiff_of::<of::RGB32Float>(&ramp), Stored::Float, &rgb);
    // A sky or a texture of the same file.
    let image = decode_image(Path::new("a.tiff"), &tiff_of::<of::Gray32Float>(&floats), None).expect("reads");
    assert_eq!(image.texel(1, 1).to_array(), [6e20; 3]);
    for odd in
        [tiff_of::<of::CMYK8>(&[0; 16]), tiff_of::<of::Gray32>(&[0; 4]), tiff_of::<of::GrayI8>(&[0; 4])]
    {
        let message = refused(&odd);
        assert!(message.contains("gray, RGB and RGBA of 8 or 16 bits or floats are"), "{message}");
    }
}

#[test]
fn a_tiff_of_planes_one_after_the_other() {
    // TIFF 6.0 by hand: 2 x 1 pixels of RGB, PlanarConfiguration 2, three strips of two bytes at 8, 10 and 12.
    let mut file = b"II*\0\x10\0\0\0\x01\x02\x03\x04\x05\x06\0\0".to_vec();
    let tags: [(u16, u16, u32, u32); 10] = [
        (256, 3, 1, 2),
        (257, 3, 1, 1),
        (258, 3, 3, 0x8e),
        (259, 3, 1, 1),
        (262, 3, 1, 2),
        (273, 4, 3, 0x94),
        (277, 3, 1, 3),
        (278, 3, 1, 1),
        (279, 4, 3, 0xa0),
        (284, 3, 1, 2),
    ];
    file.extend((tags.len() as u16).to_le_bytes());
    for (tag, kind, count, value) in tags {
        file.extend([tag.to_le_bytes(), kind.to_le_bytes()].concat());
        file.extend([count.to_le_bytes(), value.to_le_bytes()].concat());
    }
    file.extend([0; 4]);
    assert_eq!(file.len(), 0x8e);
    file.extend([8u16, 8, 8].iter().flat_map(|v| v.to_le_bytes()));
    file.extend([8u32, 10, 12, 2, 2, 2].iter().flat_map(|v| v.to_le_bytes()));
    let picture = read(&file).expect("reads").picture;
    let values: Vec<f32> = picture.planes.iter().flat_map(|p| p.data.clone()).map(|v| v * 255.0).collect();
    assert_eq!(values, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
}

fn pfm_of(header: &str, values: &[f32], big: bool) -> Vec<u8> {
    let mut bytes = header.as_bytes().to_vec();
    values.iter().for_each(|v| bytes.extend(if big { v.to_be_bytes() } else { v.to_le_bytes() }));
    bytes
}

#[test]
fn pfm_of_both_byte_orders_from_the_bottom_up() {
    let values = [1.0, 2.0, 3.0, f32::NAN, -5.0, 6e30];
    for (scale, big) in [("-1.0", false), ("1", true)] {
        let loaded = read(&pfm_of(&format!("Pf\n3 2\n{scale}\n"), &values, big)).expect("reads");
        let y = &loaded.picture.plane("Y").expect("gray").data;
        assert!(y[0].is_nan() && y[1..] == [-5.0, 6e30, 1.0, 2.0, 3.0], "{y:?}");
        assert_eq!(loaded.stored, Stored::Float);
        let picture = read(&pfm_of(&format!("PF\r\n1 2\r\n{scale}\n"), &values, big)).expect("reads").picture;
        assert_eq!(picture.plane("B").expect("blue").data, [6e30, 3.0]);
        let picture =
            read(&pfm_of(&format!("PF4\n1 1\n{scale}\n"), &values[..4], big)).expect("reads").picture;
        assert!(picture.plane("A").expect("alpha").data[0].is_nan());
    }
    // The size of the scale is a factor.
    assert_eq!(read(&pfm_of("Pf\n1 1\n-2.5\n", &[3.0], false)).unwrap().picture.planes[0].data, [7.5]);
    // Values that look like white space are values.
    let spaces = f32::from_le_bytes(*b"\n\n  ");
    assert_eq!(read(&pfm_of("Pf\n1 1\n-1\n", &[spaces], false)).unwrap().picture.planes[0].data, [spaces]);
}

#[test]
fn whole_numbers_stay_encoded_and_gray_stays_gray() {
    let mut bytes = Cursor::new(Vec::new());
    let gray = image::ImageBuffer::<image::LumaA<u16>, _>::from_raw(1, 1, vec![257u16, 514]).expect("fits");
    image::DynamicImage::from(gray).write_to(&mut bytes, ImageFormat::Png).expect("memory takes it");
    let options = LoadOptions { encoding: Some(Encoding::Linear), ..LoadOptions::default() };
    let loaded = decode(Path::new("a.png"), bytes.get_ref(), &options).expect("reads");
    assert_eq!(loaded.stored, Stored::Integer { bits: 16, encoding: Encoding::Linear });
    assert_eq!(names(&loaded), ["Y", "A"]);
    assert_eq!(loaded.picture.planes[0].data, [257.0 / 65535.0]);
    let message = layer_of(bytes.get_ref(), "albedo").expect_err("none").to_string();
    assert!(message.contains("no layer \"albedo\"") && message.contains("EXR"), "{message}");
}

#[test]
fn bad_files_are_refused_with_what_is_wrong() {
    for bytes in [&b""[..], b"PF5\n1 1\n1\n", b"hello", b"II", b"PF"] {
        let message = refused(bytes);
        assert!(message.contains("known: PNG, JPEG, Radiance HDR, EXR, TIFF, PFM"), "{message}");
    }
    let cases: [(&[u8], &str); 9] = [
        (b"PF\n3 2\n-1\n0123", "the file ends early: 72 bytes of values are due, 4 stand"),
        (b"PF\n60000 60000\n-1\n0123", "claims 60000 x 60000 pixels"),
        (b"PF\n9000 9000\n-1\n0123", "more than its"),
        (b"Pf\n0 2\n-1\n", "has no pixels"),
        (b"Pf\n-1 2\n-1\n", "width and height"),
        (b"Pf\n1 2\n0\n01234567", "no scale"),
        (b"Pf\n1 2\nnan\n01234567", "no scale"),
        (b"Pf\n1 2", "width and height"),
        (b"MM\0*\0\0\0\x08", "TIFF picture that cannot be read"),
    ];
    for (bytes, words) in cases {
        let message = refused(bytes);
        assert!(message.contains(words), "{message}");
    }
    // A claim of a gigabyte in a file of a few hundred bytes; the width is the value of the first tag, at 10.
    let mut tiff = tiff_of::<of::Gray8>(&[1, 2, 3, 4]);
    let at = tiff.windows(4).position(|w| w == [0, 1, 4, 0] || w == [0, 1, 3, 0]).expect("ImageWidth");
    tiff[at + 8..at + 12].copy_from_slice(&60000u32.to_le_bytes());
    let at = tiff.windows(4).position(|w| w == [1, 1, 4, 0] || w == [1, 1, 3, 0]).expect("ImageLength");
    tiff[at + 8..at + 12].copy_from_slice(&4000u32.to_le_bytes());
    let message = refused(&tiff);
    assert!(message.contains("claims 60000 x 4000 pixels: more than its"), "{message}");
    let whole = tiff_of::<of::RGB16>(&[7; 12]);
    for cut in 1..whole.len() {
        // Where the tags stand last, every cut takes some of them.
        refused(&whole[..cut]);
    }
}

#[test]
fn luminance_and_chroma_and_deep_data_are_refused_by_name() {
    // The y sampling of the last channel: four bytes before the list's end, in a file of one channel "Y".
    let mut file = parts(&[("", &["Y"])]);
    assert!(read(&file).is_ok());
    let at = file.windows(8).position(|w| w == b"channels").expect("a list");
    let begin = at + b"channels\0chlist\0".len() + 4 + b"Y\0".len() + 8;
    file[begin..begin + 4].copy_from_slice(&2i32.to_le_bytes());
    let message = refused(&file);
    assert!(message.contains("ubsampl"), "{message}");
    // The part's type, and bit 11 of the version field ("OpenEXR File Layout").
    let flat = parts(&[("a", &["Y"]), ("b", &["Y"])]);
    let (was, is) = (b"string\0\x0d\0\0\0scanlineimage", b"string\0\x0c\0\0\0deepscanline");
    let at = flat.windows(was.len()).position(|w| w == was).expect("a type");
    let mut file = [&flat[..at], is, &flat[at + was.len()..]].concat();
    file[5] |= 0x08;
    let message = refused(&file);
    assert!(message.contains("deep"), "{message}");
    assert!(decode_planes(Path::new("a.exr"), &file).is_err());
}

#[test]
fn half_floats_of_tiff_and_exr_agree_with_their_definition() {
    let halfs = [0.0f32, 65504.0, 6e-8, -1.5].map(f16::from_f32);
    let channels = AnyChannels::sort(vec![AnyChannel::new("Y", FlatSamples::F16(halfs.to_vec()))].into());
    let layer = Layer::new(Vec2(2, 2), LayerAttributes::default(), ExrEncoding::SMALL_LOSSLESS, channels);
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).expect("memory takes it");
    let loaded = read(bytes.get_ref()).expect("reads");
    // 2^-24 is the least half.
    assert_eq!(loaded.picture.planes[0].data, [0.0, 65504.0, 2f32.powi(-24), -1.5]);
}
