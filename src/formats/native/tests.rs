//! The format against a registry of its own, so that these tests stand whatever kinds there are.

use super::*;
use crate::base::registry::{ParamKind, ParamSpec, Value};
use crate::formats::families::Family;
use crate::scene::desc::Content;
use glam::DVec3;

const fn spec(name: &'static str, kind: ParamKind, default: Option<&'static str>) -> ParamSpec {
    ParamSpec { name, kind, default, doc: "for tests" }
}

const UNIT: ParamKind = ParamKind::Number { min: 0.0, max: 1.0 };

type Kinds = &'static [(&'static str, &'static [ParamSpec])];

const SHAPES: Kinds = &[
    ("mesh", &[spec("path", ParamKind::Mesh, None), spec("smooth", ParamKind::Bool, Some("true"))]),
    ("ball", &[spec("center", ParamKind::Vector, Some("[0, 0, 0]")), spec("radius", UNIT, None)]),
];
const MATERIALS: Kinds = &[
    ("diffuse", &[spec("albedo", ParamKind::Texture, Some("0.8"))]),
    ("glossy", &[spec("rough", UNIT, Some("0.5")), spec("tint", ParamKind::Color, Some("1"))]),
];
const TEXTURES: Kinds = &[
    ("image", &[spec("path", ParamKind::Image, None)]),
    ("stripes", &[spec("count", ParamKind::Integer { min: 1, max: 9 }, Some("2"))]),
];
const LIGHTS: Kinds = &[("point", &[spec("position", ParamKind::Vector, None)])];
const SKIES: Kinds = &[
    ("cube", &[spec("path", ParamKind::CubeFaces, None)]),
    ("plain", &[spec("radiance", ParamKind::Color, Some("1"))]),
];
const CAMERAS: Kinds = &[("pinhole", &[spec("eye", ParamKind::Vector, None)])];
const INTEGRATORS: Kinds = &[
    ("path", &[spec("max_depth", ParamKind::Integer { min: 1, max: 100 }, Some("6"))]),
    ("flat", &[spec("mode", ParamKind::Choice(&["dim", "bright"]), Some("dim"))]),
];

fn families() -> Families {
    let family = |name, kinds: Kinds| Family {
        name,
        kinds: kinds.iter().map(|&(name, params)| Kind { name, doc: "", params }).collect(),
    };
    Families {
        shapes: family("shape", SHAPES),
        materials: family("material", MATERIALS),
        textures: family("texture", TEXTURES),
        lights: family("light", LIGHTS),
        skies: family("sky", SKIES),
        cameras: family("camera", CAMERAS),
        integrators: family("integrator", INTEGRATORS),
        samplers: family("sampler", &[("sobol", &[]), ("random", &[])]),
        filters: family("filter", &[("box", &[]), ("tent", &[])]),
        light_samplers: family("light sampler", &[("tree", &[]), ("power", &[])]),
        sky_sampling: family("sky sampling", &[("mis", &[]), ("cosine", &[])]),
    }
}

fn read(text: &str) -> Result<SceneDesc> {
    parse(Path::new("scene.toml"), text, &families(), NamedFiles::Read)
}

fn error(text: &str) -> String {
    read(text).err().expect("must be refused").to_string()
}

const WHOLE: &str = r#"
[film]
size = [640, 480]
filter = "tent"
background = "transparent"
[camera]
type = "pinhole"
eye = [5, 0, 0.5]
[render]
integrator = "path"
spp = 64
max_depth = 9
sampler = "random"
seed = 7
[sky]
type = "plain"
radiance = [1, 2, 3]
intensity = 0.5
rotate_y_deg = -90
sampling = "cosine"
[materials.clay]
type = "diffuse"
albedo = { type = "stripes", count = 3 }
[materials]
brass = { type = "glossy", tint = 0.9 }
[[objects]]
name = "ball"
shape = { type = "ball", radius = 1 }
material = "clay"
transform = [{ scale = 2.0 }, { rotate_deg = 90, axis = [0, 2, 0] }, { translate = [10, 0, 0] }]
[[objects]]
group = "pair"
[[groups.pair.objects]]
shape = { type = "ball", radius = 0.5, center = [1, 0, 0] }
material = "brass"
[groups.empty]
[[lights]]
type = "point"
position = [3, 3, 3]
"#;

#[test]
fn a_whole_scene_is_read() {
    let scene = read(WHOLE).unwrap();
    assert_eq!(scene.film.size, [640, 480]);
    assert_eq!(scene.background, Background::Transparent);
    assert_eq!(scene.camera.unwrap().params.vector("eye").unwrap(), [5.0, 0.0, 0.5]);
    let render = scene.render;
    assert_eq!((render.spp, render.seed), (Some(64), Some(7)));
    assert_eq!((render.sampler.as_deref(), render.filter.as_deref()), (Some("random"), Some("tent")));
    let integrator = render.integrator.unwrap();
    assert_eq!((integrator.kind.as_str(), integrator.params.number("max_depth").unwrap()), ("path", 9.0));
    let sky = scene.sky.unwrap();
    assert_eq!((sky.intensity, sky.rotate_y_deg, sky.sampling.as_deref()), (0.5, -90.0, Some("cosine")));
    assert_eq!(sky.node.params.list.len(), 1);
    let names: Vec<&str> = scene.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names, ["clay", "brass"]);
    assert!(
        matches!(scene.materials[0].value.params.get("albedo"), Some(Value::Node(n)) if n.kind == "stripes")
    );
    assert_eq!(scene.objects[0].materials, ["clay"]);
    assert!(matches!(&scene.objects[1].content, Content::Group(g) if g == "pair"));
    assert_eq!(scene.groups[0].value[0].materials, ["brass"]);
    assert!(scene.groups[1].value.is_empty());
    assert_eq!(scene.lights.len(), 1);
    // Scaled, then turned by a quarter about +y (x to -z), then moved: exact, all factors being 0, 1 or 2.
    let p = scene.objects[0].transform.transform_point3(DVec3::new(1.0, 2.0, 0.0));
    assert_eq!(p, DVec3::new(10.0, 4.0, -2.0));
}

#[test]
fn inline_and_headed_tables_are_the_same() {
    let scene = read("objects = [{ shape = { type = 'ball', radius = 1 } }]").unwrap();
    assert_eq!(scene.objects.len(), 1);
    assert!(scene.objects[0].materials.is_empty());
    let dotted = read("film.size = [2, 3]\nsky.type = 'plain'\nmaterials.a.type = 'diffuse'").unwrap();
    assert_eq!((dotted.film.size, dotted.materials.len()), ([2, 3], 1));
}

#[test]
fn matrices_are_rows_of_twelve_or_sixteen() {
    let of = |m: &str| {
        let text =
            format!("[[objects]]\nshape = {{ type = 'ball', radius = 1 }}\ntransform = [{{ matrix = {m} }}]");
        read(&text).map(|s| s.objects[0].transform)
    };
    let twelve = of("[1, 2, 0, 10, 0, 1, 0, 20, 0, 0, 1, 30]").unwrap();
    assert_eq!(twelve, of("[1, 2, 0, 10, 0, 1, 0, 20, 0, 0, 1, 30, 0, 0, 0, 1]").unwrap());
    assert_eq!(twelve.transform_point3(DVec3::new(1.0, 1.0, 1.0)), DVec3::new(13.0, 21.0, 31.0));
    assert!(of("[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 1]").is_err(), "a projection");
    assert!(of("[1, 0, 0]").is_err());
    assert!(of("[1, 0, 0, 0, 0, 1, 0, 0, 1, 1, 0, 0]").is_err(), "flattens");
}

#[test]
fn any_angle_turns_right_handed() {
    let text = "[[objects]]\nshape = { type = 'ball', radius = 1 }\ntransform = [{ rotate_deg = 30, axis = [0, 0, 1] }]";
    let p = read(text).unwrap().objects[0].transform.transform_point3(DVec3::X);
    let want = DVec3::new(30f64.to_radians().cos(), 0.5, 0.0);
    // A few roundings in double precision.
    assert!((p - want).length() < 1e-15, "{p}");
}

/// Text, and what the message must hold.
const REFUSED: &[(&str, &[&str])] = &[
    ("[flim]", &["scene.toml:1:2: unknown key of a scene \"flim\"; did you mean \"film\"? known: film,"]),
    ("[film]\nsize = [0, 1]", &["scene.toml:2:9: `size` takes a whole number from 1 to 65536, not 0"]),
    ("[film]\nsize = [65536, 65536]", &["scene.toml:2:8: a picture of 65536 x 65536"]),
    ("[film]\nsize = [640.5, 480]", &["2:9", "whole number"]),
    ("[film]\nsize = 640", &["2:8: `size` takes a list, not 640"]),
    ("[film]\nfilter = 'bax'", &["2:10: unknown filter \"bax\"; did you mean \"box\"?"]),
    ("[film]\nwidth = 3", &["2:1: unknown key of [film] \"width\""]),
    ("film = 3", &["1:8: `[film]` takes a table, not 3"]),
    ("[render]\nspp = 0", &["2:7: `spp` takes a whole number from 1 to"]),
    ("[render]\nseed = -1", &["2:8: `seed` takes a whole number of at least 0, not -1"]),
    (
        "[render]\nmax_depht = 3",
        &["2:1: unknown parameter of \"path\" \"max_depht\"; did you mean \"max_depth\"?"],
    ),
    ("[render]\nintegrator = 'flat'\nmode = 'dark'", &["3:8: unknown mode \"dark\"", "dim, bright"]),
    ("[camera]\ntype = 'pinhole'", &["1:1: \"pinhole\" needs `eye`"]),
    ("[camera]\neye = [1, 2, 3]", &["1:1: a camera needs a `type`: pinhole"]),
    ("[camera]\ntype = 'pinhole'\neye = [1, 2]", &["3:7: `eye` takes a list of 3 numbers, not a list of 2"]),
    ("[camera]\ntype = 'pinhole'\neye = [1, nan, 2]", &["3:11: `eye` takes a finite number, not NaN"]),
    ("[sky]\ntype = 'plian'", &["2:8: unknown sky \"plian\"; did you mean \"plain\"?"]),
    ("[sky]\ntype = 'plain'\nintensity = -1", &["3:13: `intensity` takes a number of at least 0"]),
    ("[sky]\ntype = 'plain'\nsampling = 'all'", &["3:12: unknown sky sampling \"all\""]),
    ("[sky]\ntype = 'plain'\nradiance = 'red'", &["3:12: `radiance` takes a colour", "not the text \"red\""]),
    ("[sky]\ntype = 'plain'\nradiance = -1", &["3:12", "at least 0"]),
    ("[materials.a]\ntype = 'glossy'\nrough = 1.5", &["3:9: `rough`: 1.5 is outside 0 to 1"]),
    ("[materials.a]\ntype = 'diffuse'\nalbedo = 'clay.png'", &["3:10", "{ texture = \"clay.png\" }"]),
    (
        "[materials.a]\ntype = 'diffuse'\nalbedo = { texture = 'a.png', type = 'image' }",
        &["3:22: `texture` stands for `type` and `path`"],
    ),
    ("[materials.a]\ntype = 'diffuse'\nalbedo = { type = 'stripes', count = 0 }", &["3:38", "from 1 to 9"]),
    (
        "[materials.a]\ntype = 'diffuse'\nencoding = 'srgb'",
        &["3:1: unknown parameter of \"diffuse\" \"encoding\""],
    ),
    ("[[objects]]", &["1:1: an object has either a `shape` or a `group`"]),
    (
        "[materials.glass]\ntype = 'diffuse'\n[[objects]]\nshape = { type = 'ball', radius = 1 }\nmaterial = 'glas'",
        &["scene.toml:5:12: unknown material \"glas\"; did you mean \"glass\"? known: glass"],
    ),
    ("[[objects]]\ngroup = 'x'", &["2:9: unknown group \"x\""]),
    (
        "[groups.g]\n[[objects]]\ngroup = 'g'\nmaterial = 'm'\n[materials.m]\ntype = 'diffuse'",
        &["2:1", "none here"],
    ),
    ("[[objects]]\nshape = { type = 'ball' }", &["2:9: \"ball\" needs `radius`"]),
    (
        "[[objects]]\nshape = { type = 'ball', radius = 1 }\ntransform = [{ scale = 0 }]",
        &["3:24: `scale` of 0"],
    ),
    (
        "[[objects]]\nshape = { type = 'ball', radius = 1 }\ntransform = [{ rotate_deg = 3 }]",
        &["3:14", "axis"],
    ),
    (
        "[[objects]]\nshape = { type = 'ball', radius = 1 }\ntransform = [{ rotate_deg = 3, axis = [0, 0, 0] }]",
        &["3:39: `axis` needs a direction"],
    ),
    (
        "[[objects]]\nshape = { type = 'ball', radius = 1 }\ntransform = [{ scale = 1e200 }, { scale = 1e200 }]",
        &["3:13: the transform has no inverse"],
    ),
    (
        "[[objects]]\nshape = { type = 'mesh', path = 'no-such.obj' }",
        &["no-such.obj: cannot open", "scene.toml:2:33"],
    ),
    ("[film]\nsize = [1, 2", &["scene.toml:2:"]),
    ("[film]\n[film]", &["scene.toml:2:"]),
    ("x = 1979-05-27", &["1:1: unknown key of a scene"]),
    ("[film]\nsize = 1979-05-27", &["2:8: `size` takes a list, not a date"]),
];

#[test]
fn errors_name_place_and_remedy() {
    for (text, wanted) in REFUSED {
        let message = error(text);
        for w in *wanted {
            assert!(message.contains(w), "{text}\n  gave: {message}\n  wanted: {w}");
        }
        assert!(!message.contains('\n'), "one line: {message}");
    }
}

#[test]
fn deep_nesting_is_refused_without_overflow() {
    let brackets = format!("x = {}", "[".repeat(100_000));
    let tables = format!("x = {}", "{ a = ".repeat(100_000));
    let header = format!("[{}]", vec!["a"; 100_000].join("."));
    for text in [brackets, tables, header] {
        assert!(error(&text).len() < 500);
    }
}

const TRIANGLE: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
    property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

#[test]
fn one_file_is_one_mesh_however_it_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let scene_file = dir.path().join("scene.toml");
    std::fs::write(dir.path().join("tri.ply"), TRIANGLE).unwrap();
    std::fs::create_dir(dir.path().join("sub")).unwrap();
    let text = "[materials.a]\ntype = 'diffuse'\n\
                [[objects]]\nshape = { type = 'mesh', path = 'tri.ply' }\n\
                [[objects]]\nshape = { type = 'mesh', path = 'sub/../tri.ply', smooth = false }\n";
    let scene = parse(&scene_file, text, &families(), NamedFiles::Read).unwrap();
    let meshes: Vec<_> = scene
        .objects
        .iter()
        .map(|o| match &o.content {
            Content::Shape(n) => n.params.mesh("path").unwrap(),
            Content::Group(_) => panic!("not a group"),
        })
        .collect();
    assert_eq!(meshes[0].indices.len(), 1);
    assert!(std::sync::Arc::ptr_eq(&meshes[0], &meshes[1]));
    let e =
        parse(&scene_file, &text.replace("tri.ply", "trj.ply"), &families(), NamedFiles::Read).err().unwrap();
    assert_eq!(e.exit_code(), 3);
    assert!(e.to_string().contains("did you mean \"tri.ply\"?"), "{e}");
    let e = parse(&scene_file, &format!("{text}materials = ['a', 'a']"), &families(), NamedFiles::Read)
        .err()
        .unwrap();
    assert!(e.to_string().contains("7:13: `materials` names 2, but the mesh has 1"), "{e}");
}

#[test]
fn textures_and_their_encoding_reach_the_reader() {
    let dir = tempfile::tempdir().unwrap();
    let picture = image::RgbImage::from_pixel(2, 2, image::Rgb([128, 128, 128]));
    picture.save(dir.path().join("gray.png")).unwrap();
    let value = |table: &str| {
        let text = format!("[materials.a]\ntype = 'diffuse'\nalbedo = {table}");
        let scene = parse(&dir.path().join("s.toml"), &text, &families(), NamedFiles::Read).unwrap();
        match scene.materials[0].value.params.get("albedo") {
            Some(Value::Node(n)) => n.params.image("path").unwrap().texel(1, 1).r,
            _ => panic!("a texture is a node"),
        }
    };
    // The sRGB curve takes 128 of 255 to 0.2159; half an 8-bit step is 0.002.
    assert!((value("{ texture = 'gray.png' }") - 0.2159).abs() < 1e-3);
    assert!((value("{ type = 'image', path = 'gray.png', encoding = 'srgb' }") - 0.2159).abs() < 1e-3);
    assert!((value("{ texture = 'gray.png', encoding = 'linear' }") - 128.0 / 255.0).abs() < 1e-6);
}

/// Small steps of a linear congruential generator (Knuth's MMIX constants): the test needs bytes, not quality.
fn next(state: &mut u64) -> usize {
    *state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*state >> 33) as usize
}

#[test]
fn damaged_text_never_panics() {
    let mut state = 1;
    let alphabet = b"[]{}=.,'\"\n#-+e0179azn \\\xff";
    for round in 0..3000 {
        let mut bytes = WHOLE.as_bytes().to_vec();
        if round % 3 == 0 {
            bytes.truncate(next(&mut state) % bytes.len());
        }
        for _ in 0..round % 5 {
            let i = next(&mut state) % bytes.len().max(1);
            let byte = alphabet[next(&mut state) % alphabet.len()];
            match next(&mut state) % 3 {
                0 if i < bytes.len() => bytes[i] = byte,
                1 if i < bytes.len() => drop(bytes.drain(i..bytes.len().min(i + 9))),
                _ => bytes.insert(i.min(bytes.len()), byte),
            }
        }
        if let Err(e) = read(&String::from_utf8_lossy(&bytes)) {
            assert!(e.to_string().starts_with("scene.toml:"), "{e}");
        }
    }
}
