//! One clear error with the right exit code, or a counted repair, for everything that can be wrong.

use super::folder::{Folder, QUICK, SCENE};
use std::fs;

#[test]
fn wrong_figures_and_names_are_refused() {
    let f = Folder::new();
    for (flags, words) in [
        ("--spp 0", &["--spp"][..]),
        ("--size 0x5", &["--size", "0 x 5"]),
        ("--size 65536x65536", &["--size"]),
        ("--size 12", &["--size", "WIDTHxHEIGHT"]),
        ("--time 0s", &["--time"]),
        ("--cropwindow 0.5,0.5,0,1", &["crop window"]),
        ("--cropwindow 0,2,0,1", &["crop window"]),
        ("--integrator psth", &["unknown integrator \"psth\"; did you mean \"path\"?"]),
        ("--integrator normals --max-depth 3", &["--max-depth"]),
        ("--sampler sobel", &["unknown sampler"]),
        ("--filter gauss", &["unknown", "gauss"]),
        ("--backend embre", &["unknown backend \"embre\""]),
        ("--aov albedo,nromal", &["nromal", "did you mean \"normal\"?"]),
        ("--tonemap acse", &["acse"]),
        ("--sky-sampling all", &["unknown sky sampling"]),
        ("--sky-rotate nan", &["--sky-rotate"]),
        ("--sky-encoding linear", &["--sky"]),
        ("--exposure inf", &["--exposure"]),
    ] {
        f.refuses(&format!("render scene.toml -o a.png {flags}"), 2, words);
    }
    for (old, new, words) in [
        ("spp = 2", "spp = 0", &["scene.toml:5:7", "`spp`"][..]),
        ("[8, 6]", "[0, 6]", &["scene.toml:3:9", "from 1 to 65536"]),
        ("\"clay\"", "\"caly\"", &["scene.toml:18:12: unknown material \"caly\"; did you mean \"clay\"?"]),
        ("eye =", "eyes =", &["scene.toml:8:1", "did you mean \"eye\"?"]),
        ("albedo =", "albedo = {}#", &["scene.toml:14:10", "`type`"]),
        ("\"constant\"", "\"constamt\"", &["did you mean \"constant\"?"]),
    ] {
        f.write("scene.toml", SCENE.replace(old, new));
        f.refuses("render scene.toml -o a.png", 2, words);
    }
}

#[test]
fn missing_and_unwritable_files_are_told_first() {
    let f = Folder::new();
    f.refuses("render none.ply -o a.png", 3, &["none.ply: cannot open"]);
    f.refuses("render none.toml -o a.png", 3, &["none.toml: cannot open"]);
    f.write("lost.toml", SCENE.replace("tri.ply", "try.ply"));
    let words = ["try.ply: cannot open", "lost.toml:17:33", "did you mean \"tri.ply\"?"];
    f.refuses("render lost.toml -o a.png", 3, &words);
    // Output and input are wrong: the output is told, as it is looked at before anything is loaded.
    f.refuses("render none.ply -o no/such/a.png", 3, &["a.png"]);
    f.refuses("render none.ply -o tri.ply/a.png", 3, &["a.png"]);
    f.refuses("render none.ply -o a.png --stats no/such/s.json", 3, &["s.json"]);
    f.refuses("render none.ply -o a.gif", 2, &["gif"]);
    f.refuses("render none.ply -o a", 2, &["a"]);
    fs::create_dir(f.path().join("dir.png")).unwrap();
    f.refuses("render none.ply -o dir.png", 3, &["dir.png"]);
    f.refuses("render scene.xyz -o a.png", 2, &["scene.xyz"]);
}

fn ply(corners: [&str; 4], faces: &str) -> String {
    format!(
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
         element face 2\nproperty list uchar int vertex_indices\nend_header\n{}\n{faces}\n",
        corners.join("\n")
    )
}

#[test]
fn scenes_and_meshes_without_content_are_refused_or_repaired() {
    let f = Folder::new();
    f.write("empty.toml", "");
    f.refuses("render empty.toml -o a.png", 2, &["empty"]);
    f.write("empty.obj", "");
    f.refuses("render empty.obj -o a.png", 2, &["empty.obj"]);
    f.write("range.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n");
    f.refuses("render range.obj -o a.png", 2, &["range.obj"]);
    f.write("range.ply", ply(["0 0 0", "1 0 0", "0 1 0", "1 1 0"], "3 0 1 7\n3 1 3 2"));
    f.refuses("render range.ply -o a.png", 2, &["range.ply"]);
    let faces = "3 0 1 2\n3 1 3 2";
    f.write("nan.ply", ply(["nan 0 0", "1 0 0", "0 1 0", "1 1 0"], faces));
    let run = f.run(&format!("render nan.ply -o a.png {QUICK}")).succeeds();
    assert!(run.stderr.contains("1 primitive"), "the dropped one is counted: {}", run.stderr);
    f.write("nans.ply", ply(["0 0 0", "nan 0 0", "inf 1 0", "1 1 0"], faces));
    f.refuses("render nans.ply -o b.png", 2, &["degenerate"]);
    let cycle = "[groups.a]\nobjects = [{ group = 'b' }]\n[groups.b]\nobjects = [{ group = 'a' }]\n";
    f.write("cycle.toml", format!("{cycle}[[objects]]\ngroup = 'a'"));
    f.refuses("render cycle.toml -o b.png", 2, &["cycle.toml:", "a > b > a"]);
}

/// A picture of one colour with equal sides.
fn png(side: u32) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let picture = image::RgbImage::from_pixel(side, side, image::Rgb([90, 120, 200]));
    picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

#[test]
fn damaged_skies_are_refused() {
    let f = Folder::new();
    let names = ["px", "nx", "py", "ny", "pz", "nz"];
    fs::create_dir(f.path().join("none")).unwrap();
    for (folder, count) in [("one", 1), ("five", 5), ("six", 6), ("unequal", 6)] {
        for (i, name) in names.iter().take(count).enumerate() {
            let side = if folder == "unequal" && i == 3 { 8 } else { 4 };
            f.write(&format!("{folder}/{name}.png"), png(side));
        }
    }
    let render = |sky: &str| format!("render tri.ply -o a.png --size 8x6 --spp 1 --sky {sky}");
    for sky in ["none", "one", "five", "unequal"] {
        f.refuses(&render(sky), 2, &[sky]);
    }
    f.write("huge.hdr", "#?RADIANCE\n\n-Y 60000 +X 60000\n12345");
    f.refuses(&render("huge.hdr"), 2, &["huge.hdr"]);
    f.write("not.png", "this is no picture");
    f.refuses(&render("not.png"), 2, &["not.png"]);
    f.refuses(&render("./constant"), 3, &["constant"]);
    f.refuses(&render("constamt"), 2, &["constamt", "did you mean \"constant\"?"]);
    f.run(&render("six")).succeeds();
    // A preset's name wins over a file of that name.
    f.write("constant", "this is no picture");
    f.run(&render("constant")).succeeds();
    f.refuses(&render("./constant"), 2, &["constant"]);
}

#[test]
fn truncated_files_never_crash_and_leave_nothing() {
    let f = Folder::new();
    f.write("ball.ply", binary_ply());
    f.write("sky.png", png(16));
    for name in ["scene.toml", "tri.ply", "ball.ply", "sky.png"] {
        let whole = fs::read(f.path().join(name)).unwrap();
        for k in 0..20 {
            // A large prime spreads the places over the whole file.
            let length = (k * 7919 + 13) % whole.len();
            let cut = format!("cut-{name}");
            f.write(&cut, &whole[..length]);
            let command = match name {
                "sky.png" => format!("render tri.ply -o a.png --size 8x6 --spp 1 --threads 1 --sky {cut}"),
                _ => format!("render {cut} -o a.png {QUICK}"),
            };
            let before = f.listing();
            let run = f.run(&command);
            match run.code {
                0 => fs::remove_file(f.path().join("a.png")).unwrap(),
                _ => run.refuses(2, &[]),
            }
            assert_eq!(f.listing(), before, "{command}");
        }
    }
}

/// A strip of 200 triangles.
fn binary_ply() -> Vec<u8> {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 202\nproperty float x\nproperty float y\n\
                  property float z\nelement face 200\nproperty list uchar int vertex_indices\nend_header\n";
    let mut bytes = header.as_bytes().to_vec();
    for i in 0..202u32 {
        for c in [(i / 2) as f32, (i % 2) as f32, (i as f32 * 0.1).sin()] {
            bytes.extend(c.to_le_bytes());
        }
    }
    for i in 0..200u32 {
        bytes.push(3);
        [i, i + 1, i + 2].iter().for_each(|v| bytes.extend(v.to_le_bytes()));
    }
    bytes
}
