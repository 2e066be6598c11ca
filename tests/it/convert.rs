//! Scenes written anew are the scenes that were read.

use crate::common::{build_on, settings};
use skylit::base::registry;
use skylit::formats::{Compat, LoadOptions, load_with, native};
use skylit::integrators;
use skylit::render::film::Film;
use skylit::render::settings::RenderSettings;
use skylit::render::{Renderer, Silent};
use skylit::scene::desc::SceneDesc;
use std::path::Path;

fn load(path: &Path, compat: Compat) -> SceneDesc {
    load_with(path, &LoadOptions { compat, ..LoadOptions::default() }).unwrap_or_else(|e| panic!("{e}"))
}

/// Rendered as the file says, but small.
fn film(desc: SceneDesc) -> Film {
    let node = desc.render.integrator.clone();
    let filter = desc.render.filter.clone();
    let scene = build_on("auto", desc);
    let default = registry::Node { kind: "path".into(), ..registry::Node::default() };
    let integrator = registry::build("integrator", integrators::REGISTRY, &node.unwrap_or(default)).unwrap();
    let mut settings = RenderSettings { spp: 4, threads: 2, ..settings(&scene) };
    if let Some(name) = filter {
        settings.filter = name.parse().unwrap();
    }
    Renderer { integrator, settings }.render(&scene, &Silent).unwrap().film
}

fn assert_round_trip(path: &Path, compat: Compat) {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("a b.toml");
    let shrink = |mut desc: SceneDesc| {
        desc.film.size = [48, 32];
        desc
    };
    let first = shrink(load(path, compat));
    native::write::write(&out, &first).unwrap();
    let (a, b) = (film(first), film(shrink(load(&out, Compat::Exact))));
    let label = path.display();
    for (x, y) in a.window().pixels() {
        assert_eq!(a.mean(x, y), b.mean(x, y), "{label}: pixel {x}, {y}");
    }
    assert!(a.window().pixels().any(|(x, y)| !a.mean(x, y).is_black()), "{label}: something is seen");
}

#[test]
fn gallery_scenes_survive() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    for name in ["nested.toml", "primitives.toml", "hero.toml"] {
        assert_round_trip(&scenes.join(name), Compat::Exact);
    }
}

#[test]
fn scenes_of_other_programs_survive_with_their_files() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, content: &[u8]| {
        let path = dir.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, content).unwrap();
        path
    };
    let png = |seed: u8| {
        let mut bytes = Vec::new();
        let pixels: Vec<u8> =
            (0..4 * 4 * 3).map(|i| (i as u8).wrapping_mul(37).wrapping_add(seed * 40)).collect();
        let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
        image::ImageEncoder::write_image(encoder, &pixels, 4, 4, image::ExtendedColorType::Rgb8).unwrap();
        bytes
    };
    for (i, face) in ["+Z", "-Z", "+X", "-X", "+Y", "-Y"].into_iter().enumerate() {
        write(&format!("sky/{i}_{face}.png"), &png(i as u8));
    }
    write("grid.png", &png(9));
    write("body.obj", b"v -1 -1 0\nv 1 -1 0\nv 0 1 0.5\nf 1 2 3\n");
    let seed = write(
        "a.scene",
        b"size 48 32\noutput x.png\ncamera 0 1 5 0 0 0 0 1 0 40\nmaxdepth 2\nskybox sky 0.4\npoint 1 4 3 5 5 5\nfrobnicate 1\n\
          ambient 0.1 0 0\ndiffuse 0.5 0.6 0.7\nspecular 0.3 0.3 0.3\nshininess 9\nsph 1 0 0 0.7\n\
          pushTransform\nrotate 0 1 0 30\ntexture grid.png\nOBJ body.obj\ntexture None\npopTransform\n\
          vertex -3 -1 -3\nvertex -3 -1 3\nvertex 3 -1 3\nvertex 3 -1 -3\ntri 0 1 2\ntri 0 2 3\nmesh floor\n\
          matType Mirror\nscale 1 2 1\nelp -1.2 0.2 0 0.5\n",
    );
    assert_round_trip(&seed, Compat::Exact);
    assert_round_trip(&seed, Compat::Physical);
    let course = write(
        "a.test",
        b"size 48 32\nintegrator pathtracer\nmaxdepth 3\nnexteventestimation mis\ngamma 2.2\ncamera 0 1 5 0 0 0 0 1 0 40\n\
          quadLight -1 3 -1 0 0 2 2 0 0 8 8 7\nbrdf ggx\nroughness 0.3\ndiffuse 0.2 0.3 0.4\nspecular 0.5 0.4 0.3\n\
          scale 1 0.5 1\nsphere 0 0 0 1\nbrdf phong\nvertex -3 -1 -3\nvertex -3 -1 3\nvertex 3 -1 3\ntri 0 1 2\n",
    );
    assert_round_trip(&course, Compat::Exact);
    // What is lost stands where it would be.
    let out = dir.path().join("out.toml");
    native::write::write(&out, &load(&seed, Compat::Physical)).unwrap();
    let text = std::fs::read_to_string(&out).unwrap();
    for (comment, before) in [
        (":7:1: the unknown command \"frobnicate\"", "[film]"),
        ("x.png", "[film]"),
        ("scaled by 0.4", "[sky]"),
        ("ambient", "[materials.look-1]"),
    ] {
        let line = text.lines().position(|l| l.starts_with("# lost from") && l.contains(comment));
        let line = line.unwrap_or_else(|| panic!("no comment on {comment} in\n{text}"));
        let next = text.lines().skip(line).find(|l| !l.starts_with('#'));
        assert_eq!(next, Some(before), "{comment}");
    }
}
