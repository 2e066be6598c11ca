//! Pictures are decoded when the scene is built: each once, and only where something shows them.

use skylit::Result;
use skylit::base::deferred::Deferred;
use skylit::base::image_data::{ImageData, Texels};
use skylit::base::registry::{Node, Params, Value};
use skylit::formats::load;
use skylit::scene::Scene;
use skylit::scene::build::{BuildOptions, build};
use skylit::scene::desc::{Content, Named, ObjectDesc, SceneDesc, SkyDesc};
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

fn node(kind: &str, params: Params) -> Node {
    Node { kind: kind.into(), params, ..Node::default() }
}

fn gray() -> ImageData {
    ImageData { width: 2, height: 1, texels: Texels::F32(vec![[0.5; 3]; 2]) }
}

/// A picture, and how often it was decoded.
fn counted() -> (Deferred<ImageData>, Arc<AtomicUsize>) {
    let count = Arc::new(AtomicUsize::new(0));
    let counter = count.clone();
    let decode = move || {
        counter.fetch_add(1, Ordering::Relaxed);
        Ok(gray())
    };
    (Deferred::new(decode), count)
}

fn textured(name: &str, picture: &Deferred<ImageData>) -> Named<Node> {
    let texture = node("image", Params::new().with("path", Value::Image(picture.clone())));
    let value = node("diffuse", Params::new().with("albedo", Value::Node(Box::new(texture))));
    Named { name: name.into(), value, place: Default::default() }
}

fn ball(material: &str) -> ObjectDesc {
    ObjectDesc {
        name: String::new(),
        content: Content::Shape(node("sphere", Params::new())),
        materials: vec![material.into()],
        transform: Default::default(),
        place: Default::default(),
    }
}

#[test]
fn each_is_decoded_once_and_only_if_something_shows_it() {
    let ((shown, shown_count), (unshown, unshown_count)) = (counted(), counted());
    let (sky, sky_count) = counted();
    let sky = node("sphere", Params::new().with("path", Value::Image(sky)));
    let desc = SceneDesc {
        // Two materials share a picture, and one of them two objects; a third material is no object's.
        materials: vec![textured("a", &shown), textured("b", &shown), textured("c", &unshown)],
        objects: vec![ball("a"), ball("b"), ball("a")],
        sky: Some(SkyDesc::new(sky)),
        ..SceneDesc::default()
    };
    build(desc, &BuildOptions::default()).expect("builds");
    let counts = [&shown_count, &unshown_count, &sky_count].map(|c| c.load(Ordering::Relaxed));
    assert_eq!(counts, [1, 0, 1]);
}

fn write(folder: &Path, name: &str, bytes: &[u8]) {
    fs::write(folder.join(name), bytes).unwrap();
}

fn built(path: &Path) -> Result<Scene> {
    build(load(path)?, &BuildOptions::default())
}

/// The first bytes of a PNG file and no more of it: what is looked at when the scene is read.
const DAMAGED: &[u8] = b"\x89PNG\r\n\x1a\nand no more";

#[test]
fn a_damaged_one_is_an_error_where_it_is_shown() {
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), "bad.png", DAMAGED);
    let scene = |material: &str| {
        let text = format!(
            "[materials.bad]\ntype = \"diffuse\"\nalbedo = {{ texture = \"bad.png\" }}\n\
             [materials.good]\ntype = \"diffuse\"\n\
             [[objects]]\nshape = {{ type = \"sphere\" }}\nmaterial = \"{material}\"\n"
        );
        let path = dir.path().join(format!("{material}.toml"));
        fs::write(&path, text).unwrap();
        path
    };
    let e = built(&scene("bad")).map(drop).unwrap_err();
    assert!(e.to_string().contains("bad.png: damaged picture") && e.exit_code() == 2, "{e}");
    built(&scene("good")).expect("nothing shows the damaged picture");
    // What is no picture at all is refused when it is named.
    write(dir.path(), "bad.png", b"no picture");
    let e = load(&scene("good")).map(drop).unwrap_err();
    assert!(e.to_string().contains("not a picture of a known format"), "{e}");
}

#[test]
fn a_damaged_one_of_a_library_is_its_plain_colour() {
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), "bad.png", DAMAGED);
    write(dir.path(), "a.mtl", b"newmtl a\nKd 0.25 0.5 0.75\nmap_Kd bad.png\n");
    write(dir.path(), "a.obj", b"mtllib a.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let desc = load(&dir.path().join("a.obj")).unwrap();
    let Some(Value::Node(texture)) = desc.materials[0].value.params.get("albedo") else {
        panic!("a picture that was named is a texture");
    };
    let image = texture.params.image("path").unwrap();
    assert_eq!(image.texels, Texels::F32(vec![[0.25, 0.5, 0.75]]));
    build(desc, &BuildOptions::default()).expect("builds");
}
