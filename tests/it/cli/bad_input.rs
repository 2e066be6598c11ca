//! One clear error with the right exit code, or a counted repair, for everything that can be wrong.

use super::folder::{Folder, QUICK, SCENE};
use crate::common::shared;
use std::fs;
use std::path::{Path, PathBuf};

#[test]
fn wrong_figures_and_names_are_refused() {
    let f = Folder::new();
    for (flags, words) in [
        ("--spp 0", &["--spp", "0"][..]),
        ("--size 0x0", &["--size", "0 x 0"]),
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
    f.refuses("render scene.xyz -o a.png", 2, &["scene.xyz", "known: toml, test, scene, obj, ply"]);
    f.refuses("render . -o a.png", 2, &["folder"]);
    f.refuses("render scene -o a.png", 2, &["scene", "no extension", "known: toml, test, scene, obj, ply"]);
}

/// A limit on the size of files, and by the same way a full disk, is an error that leaves nothing behind.
#[test]
#[cfg(unix)]
fn a_picture_that_does_not_fit_is_told_and_leaves_nothing() {
    let f = Folder::new();
    let before = f.listing();
    let limited =
        "ulimit -f 8; exec \"$0\" render tri.ply -o a.exr --size 200x200 --spp 1 --sky constant --quiet";
    let output = std::process::Command::new("sh")
        .args(["-c", limited, env!("CARGO_BIN_EXE_skylit")])
        .current_dir(f.path())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{} {text}", output.status);
    assert!(text.contains("a.exr: cannot write"), "{text}");
    assert_eq!(f.listing(), before);
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
    // A sky alone is a picture, and said to be one.
    f.write("sky.toml", "[sky]\ntype = 'constant'");
    let run = f.run("render sky.toml -o a.png --size 8x6 --spp 1").succeeds();
    assert!(run.stderr.contains("no object"), "{}", run.stderr);
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
    f.refuses("render nans.ply -o b.png", 2, &["nans.ply", "2 primitives", "not finite"]);
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
    for (sky, words) in [
        ("none", "no picture"),
        ("one", "six faces"),
        ("five", "-Z of the six faces is missing"),
        ("unequal", "8"),
    ] {
        f.refuses(&render(sky), 2, &[sky, words]);
    }
    let empty = ["render", "tri.ply", "-o", "a.png", "--sky", ""];
    let output = f.command("").args(empty).output().unwrap();
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(2) && text.contains("unknown sky \"\""), "{text}");
    f.write("huge.hdr", "#?RADIANCE\n\n-Y 60000 +X 60000\n12345");
    f.refuses(&render("huge.hdr"), 2, &["huge.hdr", "claims 60000 x 60000"]);
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

/// The OBJ and PLY files of a folder of shared meshes, and of those within it.
fn meshes(dir: &Path) -> Vec<PathBuf> {
    let mut all = Vec::new();
    for entry in fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(meshes(&path));
        } else if path.to_string_lossy().contains(".obj") || path.to_string_lossy().contains(".ply") {
            all.push(path);
        }
    }
    all.sort();
    all
}

#[test]
fn malformed_meshes_of_others_are_refused_by_name() {
    let Some(dir) = shared("meshes/malformed") else { return };
    let files = meshes(&dir);
    assert!(files.len() >= 12, "{files:?}");
    let f = Folder::new();
    for file in files {
        let name = file.file_name().unwrap().to_str().unwrap();
        f.write(name, fs::read(&file).unwrap());
        f.refuses(&format!("render {name} -o a.png {QUICK}"), 2, &[name]);
    }
}

/// Loaders are cut at 20 places of every file in src/formats/tests.rs; here the whole program is, at some places of
/// those that are small, as a run costs 30 ms.
#[test]
fn truncated_meshes_of_others_are_refused_or_rendered_by_the_program() {
    let Some(dir) = shared("meshes") else { return };
    let f = Folder::new();
    let (mut seed, mut refused) = (1u64, 0);
    for file in ["obj", "ply", "awkward-obj"].iter().flat_map(|d| meshes(&dir.join(d))) {
        let bytes = fs::read(&file).unwrap();
        if bytes.len() > 1 << 16 {
            continue;
        }
        let name = file.file_name().unwrap().to_str().unwrap().replace(' ', "-");
        for _ in 0..3 {
            // Constants of Knuth's MMIX generator.
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            f.write(&name, &bytes[..(seed >> 33) as usize % bytes.len()]);
            let before = f.listing();
            let run = f.run(&format!("render {name} -o a.png {QUICK}"));
            match run.code {
                0 => fs::remove_file(f.path().join("a.png")).unwrap(),
                _ => run.refuses(2, &[&name]),
            }
            refused += u32::from(run.code != 0);
            assert_eq!(f.listing(), before, "{name}");
        }
        fs::remove_file(f.path().join(&name)).unwrap();
    }
    assert!(refused > 50, "{refused} cut files were refused");
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
