//! `--max-memory`: what does not fit is refused before it is loaded, and what is loaded fits.

use super::folder::Folder;
use std::fmt::Write;

/// A grid of `n` x `n` vertices as OBJ text.
fn obj(n: usize) -> String {
    let mut text = String::new();
    for i in 0..n * n {
        writeln!(text, "v {} {} {}", i % n, i / n, (i * i) % 7).unwrap();
    }
    for y in 0..n - 1 {
        for x in 0..n - 1 {
            let at = 1 + y * n + x;
            writeln!(text, "f {} {} {} {}", at, at + 1, at + n + 1, at + n).unwrap();
        }
    }
    text
}

/// The same as binary PLY, triangles alone.
fn ply(n: usize) -> Vec<u8> {
    let faces = 2 * (n - 1) * (n - 1);
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
         property float z\nelement face {faces}\nproperty list uchar int vertex_indices\nend_header\n",
        n * n
    )
    .into_bytes();
    for i in 0..n * n {
        [(i % n) as f32, (i / n) as f32, 0.0].iter().for_each(|c| bytes.extend(c.to_le_bytes()));
    }
    for y in 0..n - 1 {
        for x in 0..n - 1 {
            let at = (y * n + x) as i32;
            for corners in [[at, at + 1, at + n as i32], [at + 1, at + n as i32 + 1, at + n as i32]] {
                bytes.push(3);
                corners.iter().for_each(|c| bytes.extend(c.to_le_bytes()));
            }
        }
    }
    bytes
}

fn png(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(width, height).write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// What a limit may be passed by: small things that do not ask, and what the allocator keeps.
const SLACK: f64 = 16e6;

#[test]
fn it_bounds_what_is_loaded_and_refuses_the_rest() {
    let f = Folder::new();
    f.write("grid.obj", obj(400));
    f.write("grid.ply", ply(700));
    f.write("sky.png", png(4096, 2048));
    f.write("knot.toml", "[[objects]]\nshape = { type = \"knot\", triangles = 1000000 }\n");
    let lamp = "[materials.l]\ntype = \"emissive\"\n[[objects]]\nshape = { type = \"knot\", triangles = 100000 }\n\
                material = \"l\"\n";
    f.write("lamp.toml", lamp);
    let small = "--size 16x12 --sky constant";
    let inputs = [
        format!("grid.obj {small}"),
        format!("grid.ply {small}"),
        format!("knot.toml {small}"),
        format!("lamp.toml {small}"),
        format!("grid.ply {small} --backend embree"),
        format!("grid.ply {small} --backend obvhs"),
        "tri.ply --size 16x12 --sky sky.png".to_owned(),
        "tri.ply --size 2000x1500 --sky constant".to_owned(),
    ];
    for input in inputs.iter().filter(|i| {
        let has = |name, built| built || !i.contains(name);
        has("embree", cfg!(feature = "embree")) && has("obvhs", cfg!(feature = "bvh"))
    }) {
        let mut fitted = Vec::new();
        for limit in [30u64, 60, 120, 200, 400, 1000] {
            let command = format!(
                "render {input} --spp 1 --threads 2 -o a.png --stats s.json --max-memory {limit}M --quiet"
            );
            let run = f.run(&command);
            if run.code == 0 {
                let peak = f.json("s.json")["memory"]["peak"].as_u64().unwrap();
                assert!(peak as f64 <= limit as f64 * 1e6 + SLACK, "{command}: {peak} bytes");
                std::fs::remove_file(f.path().join("a.png")).unwrap();
            } else {
                run.refuses(2, &["do not fit into --max-memory"]);
                assert!(!f.path().join("a.png").exists(), "{command}");
            }
            fitted.push(run.code == 0);
        }
        assert_eq!((fitted[0], fitted[5]), (false, true), "{input}: 30 MB are too few and 1 GB is enough");
        assert!(fitted.is_sorted(), "{input}: {fitted:?}");
        // 105 bytes for each of 977,202 triangles, and 60 MB beside: what it promised is not counted against it.
        assert!(!input.contains("embree") || fitted[3], "{input}: 200 MB are enough");
    }
    f.refuses("render tri.ply -o a.png --max-memory 8", 2, &["--max-memory"]);
    f.refuses("render tri.ply -o a.png --max-memory lots", 2, &["--max-memory"]);
}
