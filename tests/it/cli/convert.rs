//! `skylit convert` for pictures and skies: every format to every other, layers, false colours, layouts, bad input.

use super::folder::Folder;
use skylit::image::load::{LoadOptions, Stored, load};
use skylit::image::picture::{Picture, SampleKind};
use skylit::image::read::read_planes;
use skylit::image::write::{WriteOptions, write_picture};

/// Halves that 8-bit mantissas and floats hold, too.
fn sample() -> Picture {
    let mut picture = Picture { origin: [1, 0], frame: [5, 2], ..Picture::new(4, 2) };
    picture.push("R", SampleKind::Half, vec![1.0, 0.5, 0.25, 2.0, 0.0, 8.0, 0.125, 1.0]);
    picture.push("G", SampleKind::Half, vec![0.5, 0.5, 0.75, 1.0, 0.0, 4.0, 0.125, 0.5]);
    picture.push("B", SampleKind::Half, vec![0.25, 1.0, 0.25, 0.5, 0.0, 4.0, 0.125, 0.75]);
    picture.push("depth.Z", SampleKind::Float, vec![0.1, 0.2, 0.3, 0.4, 10.0, f32::NAN, 30.0, 1e9]);
    for (i, name) in ["normal.X", "normal.Y", "normal.Z"].into_iter().enumerate() {
        picture.push(name, SampleKind::Half, vec![i as f32 / 4.0; 8]);
    }
    picture.metadata = vec![("command".into(), "skylit render".into()), ("seed".into(), "7".into())];
    picture
}

fn with_sample() -> Folder {
    let f = Folder::new();
    write_picture(&f.path().join("a.exr"), &sample(), &WriteOptions::default()).unwrap();
    f
}

fn plane(f: &Folder, file: &str, name: &str) -> Vec<f32> {
    let loaded = load(&f.path().join(file), &LoadOptions::default()).unwrap();
    loaded.picture.plane(name).unwrap_or_else(|| panic!("{file} has no {name}")).data.clone()
}

#[test]
fn radiance_goes_through_every_format_that_holds_it() {
    let f = with_sample();
    for chain in [["hdr", "pfm", "exr"], ["tiff", "hdr", "pfm"], ["pfm", "tiff", "hdr"]] {
        let mut from = "a.exr".to_owned();
        for (i, ending) in chain.into_iter().enumerate() {
            let to = format!("{i}.{ending}");
            f.run(&format!("convert {from} {to}")).succeeds();
            for name in ["R", "G", "B"] {
                assert_eq!(plane(&f, &to, name), sample().plane(name).unwrap().data, "{from} to {to}");
            }
            from = to;
        }
    }
    f.run("convert a.exr brighter.pfm --exposure 2").succeeds();
    assert_eq!(plane(&f, "brighter.pfm", "R")[..2], [4.0, 2.0]);
}

#[test]
fn exr_keeps_every_layer_and_what_it_says() {
    let f = with_sample();
    f.run("convert a.exr b.exr").succeeds();
    let [a, b] = ["a.exr", "b.exr"].map(|n| read_planes(&f.path().join(n)).unwrap());
    assert_eq!(
        (a.metadata, a.origin, a.frame, a.planes.len()),
        (b.metadata, b.origin, b.frame, b.planes.len())
    );
    for (a, b) in a.planes.iter().zip(&b.planes) {
        assert_eq!((&a.name, a.kind), (&b.name, b.kind));
        assert!(a.data.iter().zip(&b.data).all(|(a, b)| a.to_bits() == b.to_bits()));
    }
    f.run("convert a.exr wide.exr --bits 32").succeeds();
    let wide = read_planes(&f.path().join("wide.exr")).unwrap();
    assert!(wide.planes.iter().all(|p| p.kind == SampleKind::Float));
    f.run("convert a.exr normal.exr --layer normal").succeeds();
    assert_eq!(plane(&f, "normal.exr", "Z"), [0.5; 8]);
    // A vector's components as colours, a layer's one channel as gray.
    f.run("convert a.exr normal.pfm --layer normal").succeeds();
    assert_eq!((plane(&f, "normal.pfm", "G"), plane(&f, "normal.pfm", "B")), (vec![0.25; 8], vec![0.5; 8]));
    f.run("convert a.exr depth.pfm --layer depth").succeeds();
    assert_eq!(plane(&f, "depth.pfm", "Y")[4], 10.0);
}

#[test]
fn whole_numbers_mean_what_is_said() {
    let f = with_sample();
    f.run("convert a.exr a.png").succeeds();
    let shown = load(&f.path().join("a.png"), &LoadOptions::default()).unwrap();
    assert_eq!(shown.stored, Stored::Integer { bits: 8, encoding: Default::default() });
    // IEC 61966-2-1 of 0.5 is 0.7354, times 255 is 187.5.
    assert_eq!(plane(&f, "a.png", "R")[..2], [1.0, 188.0 / 255.0]);
    f.run("convert a.png b.png").succeeds();
    let [a, b] = ["a.png", "b.png"].map(|n| plane(&f, n, "G"));
    assert_eq!(a, b);
    f.run("convert a.png linear.pfm --assume linear").succeeds();
    assert_eq!(plane(&f, "linear.pfm", "R")[1], 188.0 / 255.0);
    f.run("convert a.png srgb.pfm").succeeds();
    // Half a byte's step, where the curve's slope is 1.4 a unit.
    assert!((plane(&f, "srgb.pfm", "R")[1] - 0.5).abs() < 0.5 / 255.0 * 1.5);
    f.run("convert a.exr deep.png --bits 16 --tonemap reinhard --exposure -1").succeeds();
    let deep = load(&f.path().join("deep.png"), &LoadOptions::default()).unwrap();
    assert_eq!(deep.stored, Stored::Integer { bits: 16, encoding: Default::default() });
    f.run("convert a.exr a.tif --bits 8").succeeds();
    assert_eq!(plane(&f, "a.tif", "R"), plane(&f, "a.png", "R"));
}

#[test]
fn listings_say_what_is_there() {
    let f = with_sample();
    let text = f.run("convert a.exr --layers").succeeds().stdout;
    for words in [
        "EXR",
        "4 x 2",
        "from 1, 0, in a frame of 5 x 2 from 0, 0",
        "(unnamed): B (half) G (half) R (half)",
        "depth: Z (float)",
        "seed = 7",
        "zip",
    ] {
        assert!(text.to_lowercase().contains(&words.to_lowercase()), "{words} in {text}");
    }
    f.run("convert a.exr a.hdr").succeeds();
    assert!(f.run("convert a.hdr --layers").succeeds().stdout.contains("Radiance HDR"));
    f.refuses("convert a.exr b.png --layers", 2, &["--layers"]);
}

#[test]
fn false_colours_span_the_range_that_is_told() {
    let f = with_sample();
    let run = f.run("convert a.exr z.png --layer depth --false-colour viridis --range 0.1..30").succeeds();
    assert!(run.stderr.contains("Z from 0.1 to 30, in viridis"), "{}", run.stderr);
    let bytes =
        |name: &str| plane(&f, "z.png", name).iter().map(|v| (v * 255.0).round() as u8).collect::<Vec<_>>();
    // The ends of viridis are (68, 1, 84) and (253, 231, 37); NaN is magenta; beyond is the end.
    let at = |i: usize| ["R", "G", "B"].map(|n| bytes(n)[i]);
    assert_eq!((at(0), at(5), at(6), at(7)), ([68, 1, 84], [255, 0, 255], [253, 231, 37], [253, 231, 37]));
    let run =
        f.run("convert a.exr n.png --layer normal --channel y --false-color gray --range 0..0.5").succeeds();
    assert!(run.stderr.contains("Y from 0 to 0.5, in grey"), "{}", run.stderr);
    f.run("convert a.exr l.png --false-colour turbo --log").succeeds();
    f.refuses("convert a.exr z.png --layer normal --false-colour magma", 2, &["--channel", "X, Y, Z"]);
    f.refuses("convert a.exr z.png --false-colour virids", 2, &["did you mean \"viridis\"?"]);
    f.refuses("convert a.exr z.png --false-colour turbo --channel q", 2, &["unknown channel \"q\""]);
    f.refuses("convert a.exr z.png --range 0..1", 2, &["--false-colour"]);
    f.refuses("convert a.exr z.png --false-colour turbo --range 1..1", 2, &["two numbers"]);
    f.refuses("convert a.exr z.png --false-colour turbo --log --range -1..1", 2, &["positive"]);
}

#[test]
fn bad_conversions_leave_nothing_behind() {
    let f = with_sample();
    let before = f.names();
    std::fs::write(f.path().join("cut.exr"), &std::fs::read(f.path().join("a.exr")).unwrap()[..300]).unwrap();
    std::fs::write(f.path().join("empty.png"), b"").unwrap();
    f.refuses("convert cut.exr b.png", 2, &["cut.exr", "EXR picture that cannot be read"]);
    f.refuses("convert empty.png b.exr", 2, &["the file is empty"]);
    f.refuses("convert missing.exr b.png", 3, &["missing.exr", "cannot open"]);
    f.refuses(
        "convert a.exr b.png --layer albedo",
        2,
        &["unknown layer \"albedo\"", "(unnamed), depth, normal"],
    );
    f.refuses("convert a.exr b.bmp", 2, &["scenes are written as .toml", "pictures as png, jpg, exr"]);
    f.refuses("convert a.exr b.hdr --tonemap agx", 2, &["--tonemap", "radiance"]);
    f.refuses("convert a.exr b.png --tonemap agxx", 2, &["did you mean \"agx\"?"]);
    f.refuses("convert a.exr b.png --bits 12", 2, &["8 or 16"]);
    f.refuses("convert a.exr b.png --compat exact", 2, &["--compat is for scenes"]);
    f.refuses("convert scene.toml b.toml --exposure 1", 2, &["--exposure is for pictures"]);
    f.refuses("convert a.exr", 2, &["required"]);
    let odd = Picture { planes: sample().planes[..3].to_vec(), ..Picture::new(8, 1) };
    write_picture(&f.path().join("odd.hdr"), &odd, &WriteOptions::default()).unwrap();
    f.refuses("convert odd.hdr faces --to cube", 2, &["is 8x1; a sky is"]);
    f.refuses("convert a.exr b.exr --to cub", 2, &["cube", "equirectangular"]);
    f.refuses("convert a.exr faces --to cube --size 0", 2, &["--size 0"]);
    let mut after = f.names();
    after.retain(|n| !["cut.exr", "empty.png", "odd.hdr"].contains(&&**n));
    assert_eq!(after, before);
}

#[test]
fn skies_go_to_a_cube_and_back() {
    let f = Folder::new();
    // A gradient with a sun near the top.
    let mut sky = Picture::new(64, 32);
    for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
        let value =
            |i: usize| if i == 5 * 64 + 8 { 1e5 } else { 0.2 + 0.1 * c as f32 + (i / 64) as f32 / 40.0 };
        sky.push(name, SampleKind::Float, (0..64 * 32).map(value).collect());
    }
    write_picture(&f.path().join("sky.pfm"), &sky, &WriteOptions::default()).unwrap();
    f.run("convert sky.pfm faces --to cube --size 48").succeeds();
    let mut names: Vec<_> =
        std::fs::read_dir(f.path().join("faces")).unwrap().map(|e| e.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["nx.pfm", "ny.pfm", "nz.pfm", "px.pfm", "py.pfm", "pz.pfm"]);
    f.run("convert faces back.exr --to equirectangular --size 32").succeeds();
    let flux = |data: &[f32]| -> f64 {
        let edge = |y: usize| (std::f64::consts::PI * y as f64 / 32.0).cos();
        data.iter().enumerate().map(|(i, v)| (edge(i / 64) - edge(i / 64 + 1)) * f64::from(*v)).sum()
    };
    for name in ["R", "G", "B"] {
        let (was, is) = (flux(&sky.plane(name).unwrap().data), flux(&plane(&f, "back.exr", name)));
        assert!((was - is).abs() < 1e-5 * was, "{name}: {was} {is}");
    }
    // The same on any number of threads.
    f.run("convert faces one.exr --to equirectangular --size 32 --threads 1").succeeds();
    let [a, b] = ["back.exr", "one.exr"].map(|n| std::fs::read(f.path().join(n)).unwrap());
    assert_eq!(a, b);
    f.refuses("convert faces b.exr --to cube --size 9", 2, &["is a cube already"]);
    write_picture(&f.path().join("faces/other.png"), &sky, &WriteOptions::default()).unwrap();
    f.refuses("convert sky.pfm faces --to cube", 2, &["other.png", "taken for a face"]);
}

#[test]
fn a_sky_looks_the_same_in_every_direction_from_either_layout() {
    let f = Folder::new();
    // Each direction has its own colour: x is red, y green, z blue.
    let (w, h) = (128, 64);
    let direction = |i: usize| {
        let (x, y) = ((i % w) as f64 + 0.5, (i / w) as f64 + 0.5);
        let latitude = std::f64::consts::PI * (0.5 - y / h as f64);
        let longitude = std::f64::consts::TAU * (x / w as f64 - 0.5);
        [latitude.cos() * longitude.cos(), latitude.sin(), latitude.cos() * longitude.sin()]
    };
    let mut sky = Picture::new(w, h);
    for (c, name) in ["R", "G", "B"].into_iter().enumerate() {
        let data = (0..w * h).map(|i| (0.5 + 0.5 * direction(i)[c]) as f32).collect();
        sky.push(name, SampleKind::Float, data);
    }
    write_picture(&f.path().join("sky.exr"), &sky, &WriteOptions::default()).unwrap();
    f.run("convert sky.exr faces --to cube").succeeds();
    f.run("convert faces back.exr --to equirectangular").succeeds();
    let skies = [("sphere", "sky.exr"), ("cube", "faces"), ("sphere", "back.exr")];
    let views = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [1, 1, 1], [-1, -1, 1]];
    for to in views {
        let up = if to[0] == 0 && to[2] == 0 { [0, 0, 1] } else { [0, 1, 0] };
        let seen = skies.map(|(kind, path)| {
            let scene = format!(
                "[film]\nsize = [12, 12]\n[camera]\ntype = \"perspective\"\neye = [0, 0, 0]\nlook_at = {to:?}\n\
                 up = {up:?}\nfov_deg = 90\n[sky]\ntype = \"{kind}\"\npath = \"{path}\"\n[materials.clay]\n\
                 type = \"diffuse\"\n[[objects]]\nshape = {{ type = \"sphere\", center = [900, 900, -900], \
                 radius = 0.01 }}\nmaterial = \"clay\"\n"
            );
            f.write("s.toml", scene);
            f.run("render s.toml -o s.exr --spp 16 --full-float").succeeds();
            ["R", "G", "B"].map(|name| plane(&f, "s.exr", name))
        });
        for other in &seen[1..] {
            for (a, b) in seen[0].iter().flatten().zip(other.iter().flatten()) {
                // Texels of 0.05 on a side, slopes of 1/2: a texel's mean is off by half of it at most.
                assert!((a - b).abs() < 0.0125, "{to:?}: {a} {b}");
            }
        }
    }
}
