//! What the formats of one command a line read of texts, good and bad.

use crate::base::registry::Value;
use crate::error::{Error, Result};
use crate::formats::{Compat, LoadOptions, SceneFormat, SceneText, cse168, seed};
use crate::scene::desc::{Content, SceneDesc};
use glam::DVec3;
use std::path::{Path, PathBuf};

fn read_as(format: &SceneFormat, path: &Path, text: &str, compat: Compat) -> Result<SceneDesc> {
    let options = LoadOptions { compat, ..LoadOptions::default() };
    (format.parse)(&SceneText { path, bytes: text.as_bytes() }, &options)
}

fn read(format: &SceneFormat, text: &str) -> Result<SceneDesc> {
    read_as(format, Path::new("a.scene"), text, Compat::Exact)
}

fn seed(text: &str) -> SceneDesc {
    read(&seed::FORMAT, text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn course(text: &str) -> SceneDesc {
    read(&cse168::FORMAT, text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// The message of the error that both formats must give.
fn refused(text: &str) -> String {
    let [a, b] = [&seed::FORMAT, &cse168::FORMAT].map(|f| match read(f, text) {
        Err(e @ Error::Content { .. }) => e.to_string(),
        Err(e) => panic!("{e}"),
        Ok(_) => panic!("accepted: {text}"),
    });
    assert_eq!(a, b);
    a
}

fn vector(scene: &SceneDesc, object: usize, name: &str) -> [f64; 3] {
    match &scene.objects[object].content {
        Content::Shape(node) => node.params.vector(name).unwrap(),
        Content::Group(_) => panic!("a group"),
    }
}

fn mesh(scene: &SceneDesc, object: usize) -> std::sync::Arc<crate::base::mesh_data::MeshData> {
    match &scene.objects[object].content {
        Content::Shape(node) => node.params.mesh("path").unwrap(),
        Content::Group(_) => panic!("a group"),
    }
}

#[test]
fn errors_say_where_what_and_what_else() {
    for (text, want) in [
        ("size 640\n", "a.scene:1:6: `size` wants a number here, and the line ends"),
        ("\n  size 640 x480", "a.scene:2:12: `size` takes finite numbers, not \"x480\""),
        ("size 0 480", "a.scene:1:6: `size` takes a whole number from 1 to 4294967295, not 0"),
        ("size 99999999 2", "a picture of 99999999 x 2 cannot be made"),
        ("ambient 0 -1 0", "a.scene:1:11: `ambient` takes colours of at least 0, not -1"),
        ("translate 1 nan 0", "a.scene:1:13: `translate` takes finite numbers, not \"nan\""),
        ("translate 1 1e999 0", "takes finite numbers, not \"1e999\""),
        ("rotate 0 0 0 90", "a.scene:1:14: `rotate` takes an axis that is not zero"),
        ("popTransform", "a.scene:1:1: `popTransform` without a `pushTransform`"),
        ("vertex 0 0 0\ntri 0 0 1", "a.scene:2:9: vertex 1 does not exist: 1 stand above, numbered from 0"),
        ("vertex 0 0 0\ntri 0 0 -1", "a.scene:2:9: `tri` takes numbers of vertices, not \"-1\""),
        ("tri 0 0 0", "vertex 0 does not exist: 0 stand above"),
        ("shininess -1", "`shininess` takes a number from 0 to 1e6, not -1"),
        ("attenuation 0 0 0", "`attenuation` takes three numbers that are not all 0"),
        ("spp 0", "`spp` takes a whole number"),
    ] {
        let message = refused(text);
        assert!(message.contains(want), "{text}: {message}, wanted {want}");
    }
    let wide = "t\u{e4}xt 1\nambient 1 \u{e4} 0";
    assert!(refused(wide).starts_with("a.scene:2:11: "), "columns are characters");
}

#[test]
fn format_specific_errors_are_located_too() {
    for (format, text, want) in [
        (&seed::FORMAT, "sph 0 0 0 0", "a.scene:1:11: `sph` takes a radius of more than 0, not 0"),
        (
            &seed::FORMAT,
            "matType Glass",
            "a.scene:1:9: unknown word for `matType` \"Glass\"; known: Normal, Mirror",
        ),
        (&seed::FORMAT, "mesh Ground", "`mesh` without a `tri` since the last one"),
        (&seed::FORMAT, "maxdepth 1.5", "`maxdepth` takes a whole number from 0 to 4095, not 1.5"),
        (&cse168::FORMAT, "maxdepth -2", "`maxdepth` takes a whole number from -1 to 4095, not -2"),
        (&seed::FORMAT, "OBJ ", "`OBJ` wants the path of an OBJ file here"),
        (&cse168::FORMAT, "quadLight 0 0 0 1 0 0 2 0 0 1 1 1", "are parallel: it has no area"),
        (
            &cse168::FORMAT,
            "integrator bidirectional",
            "unknown word for `integrator` \"bidirectional\"; known: raytracer",
        ),
        (
            &cse168::FORMAT,
            "brdf ggx\nroughness 2",
            "a.scene:2:11: `roughness` takes a number from 0 to 1, not 2",
        ),
        (&cse168::FORMAT, "gamma 0", "`gamma` takes a number from 0.1 to 10, not 0"),
    ] {
        let message = read(format, text).map(drop).unwrap_err().to_string();
        assert!(message.contains(want), "{text}: {message}");
    }
    for text in ["OBJ gone.obj", "sph 0 0 0 1\nskybox gone 0.5"] {
        let e = read(&seed::FORMAT, text).map(drop).unwrap_err();
        assert!(e.exit_code() == 3 && e.to_string().contains("there is no such file"), "{e}");
        assert!(e.to_string().contains("named at a.scene:"), "{e}");
    }
}

#[test]
fn garbage_is_skipped_or_refused_and_never_worse() {
    // Unknown words alone are no error.
    assert!(seed("hello world\n\u{0}\u{1}\n###\n").objects.is_empty());
    let deep = "pushTransform\ntranslate 1 0 0\n".repeat(10_000)
        + "sph 0 0 0 1\n"
        + &"popTransform\n".repeat(10_000);
    assert_eq!(vector(&seed(&deep), 0, "center"), [10_000.0, 0.0, 0.0]);
    let bottomless = "pushTransform\n".repeat(100_000);
    assert!(refused(&bottomless).contains("a.scene:65537:1: more than 65536 transforms are pushed"));
    // A word of the file's is not trusted: this asks for 32 GB.
    assert!(course("maxverts 1000000000\nvertex 0 0 0").objects.is_empty());
    for format in [&seed::FORMAT, &cse168::FORMAT] {
        let file = SceneText { path: Path::new("a"), bytes: b"size 4 4\n\xff\xfe" };
        let e = (format.parse)(&file, &LoadOptions::default()).map(drop).unwrap_err().to_string();
        assert!(e.contains("a:2: this is not text in UTF-8"), "{e}");
    }
}

#[test]
fn transforms_multiply_from_the_right() {
    let scene = course("translate 1 2 3\nscale 2 2 2\nrotate 0 0 5 90\nsphere 1 0 0 1");
    let p = scene.objects[0].transform.transform_point3(DVec3::X);
    // A quarter turn about z, twice the size, then moved; one rounding of the sine.
    assert!((p - DVec3::new(1.0, 4.0, 3.0)).length() < 1e-14, "{p}");
    let nested = course(
        "translate 1 0 0\npushTransform\ntranslate 0 1 0\nsphere 0 0 0 1\npopTransform\nsphere 0 0 0 1",
    );
    let origin = |i: usize| nested.objects[i].transform.transform_point3(DVec3::ZERO);
    assert_eq!([origin(0), origin(1)], [DVec3::new(1.0, 1.0, 0.0), DVec3::X]);
}

#[test]
fn a_seed_sphere_is_moved_and_an_ellipsoid_transformed() {
    let scene = seed("scale 2 3 4\ntranslate 1 1 1\nsph 1 0 0 0.5\nelp 1 0 0 0.5");
    assert_eq!(vector(&scene, 0, "center"), [4.0, 3.0, 4.0]);
    assert_eq!(scene.objects[0].transform, glam::DAffine3::IDENTITY);
    assert_eq!(vector(&scene, 1, "center"), [1.0, 0.0, 0.0]);
    assert_eq!(scene.objects[1].transform.matrix3.determinant(), 24.0);
    for (a, b) in [("point 1 0 0 1 1 1", "position"), ("directional 1 0 0 1 1 1", "direction")] {
        let scene = seed(&format!("translate 5 0 0\nscale 2 2 2\n{a}\nsph 0 0 0 1"));
        let moved = scene.lights[0].params.vector(b).unwrap();
        // A direction is not moved, and ours points the other way.
        assert_eq!(moved, if b == "position" { [7.0, 0.0, 0.0] } else { [-2.0, 0.0, 0.0] });
    }
}

#[test]
fn looks_and_meshes_are_as_many_as_there_are_different() {
    let text = "maxverts 4\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nvertex 0 0 1\n\
                diffuse 1 0 0\ntri 0 1 2\ntri 0 1 3\ndiffuse 1 0 0\ntri 1 2 3\n\
                diffuse 0 1 0\ntri 3 2 1\ndiffuse 1 0 0\nsphere 0 0 0 1\ntranslate 1 0 0\ntri 0 1 2\n\
                vertexnormal 0 0 0 0 0 1\nvertexnormal 1 0 0 0 0 1\nvertexnormal 0 1 0 0 0 1\ntrinormal 0 1 2\n";
    let scene = course(text);
    assert_eq!(scene.materials.len(), 2);
    let triangles: Vec<usize> = [0, 1, 3, 4].iter().map(|&i| mesh(&scene, i).indices.len()).collect();
    assert_eq!(triangles, [3, 1, 1, 1], "a change of look or transform starts a mesh");
    assert_eq!(mesh(&scene, 1).positions.len(), 3, "a mesh holds the vertices it uses");
    assert_eq!(mesh(&scene, 1).positions.get(0), DVec3::Z);
    assert_eq!(mesh(&scene, 4).normals, [[0.0, 0.0, 1.0]; 3]);
    // The seed's meshes end where `mesh` says, and share vertices.
    let scene = seed(
        "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\ntri 0 1 2\ndiffuse 1 1 1\nmesh a b\ntri 2 1 0\nmesh c",
    );
    assert_eq!(scene.objects.iter().map(|o| o.name.as_str()).collect::<Vec<_>>(), ["a", "c"]);
}

#[test]
fn settings_become_ours() {
    let scene = seed("size 3 2\nspp 7\nmaxdepth 2\ncamera 1 2 3 4 5 6 0 1 0 59.9\nsph 0 0 0 1");
    assert_eq!((scene.film.size, scene.render.spp), ([3, 2], Some(7)));
    assert_eq!(scene.camera.unwrap().params.number("fov_deg").unwrap(), 59.0, "cut to a whole degree");
    let integrator = scene.render.integrator.unwrap();
    assert_eq!((&*integrator.kind, integrator.params.number("max_depth").unwrap()), ("whitted", 3.0));

    let scene = course("integrator direct\nlightsamples 9\nsphere 0 0 0 1");
    assert_eq!((scene.render.spp, scene.render.filter.as_deref()), (Some(9), Some("center")));
    let scene = course(
        "integrator pathtracer\nspp 64\nmaxdepth -1\nnexteventestimation mis\ngamma 2.2\nsphere 0 0 0 1",
    );
    assert_eq!((scene.render.spp, scene.render.filter.as_deref()), (Some(64), Some("box")));
    assert_eq!(scene.film.transfer, crate::color::Transfer::Gamma(2.2));
    let integrator = scene.render.integrator.unwrap();
    assert!(integrator.params.number("max_depth").unwrap() == 4096.0, "unlimited");
    assert!(integrator.params.number("roulette_depth").unwrap() < 4096.0, "so that it ends");
    assert!(matches!(integrator.params.get("light_sampling"), Some(Value::Bool(true))));
}

#[test]
fn physical_looks_have_units() {
    let text = "ambient 1 1 1\nemission 2 2 2\ndiffuse 0.5 0.5 0.5\nsph 0 0 0 1";
    for (compat, units, ambient, emission) in
        [(Compat::Exact, "classic", 3.0, 0.0), (Compat::Physical, "radiometric", 0.0, 2.0)]
    {
        let scene = read_as(&seed::FORMAT, Path::new("a.scene"), text, compat).unwrap();
        let params = &scene.materials[0].value.params;
        assert_eq!(params.text_or("units", "").unwrap(), units);
        assert_eq!(params.color_or("ambient", [9.0; 3]).unwrap().r, ambient, "emission lights nothing there");
        assert_eq!(params.color_or("emission", [9.0; 3]).unwrap().r, emission);
    }
}

#[test]
fn files_are_found_from_the_folder_that_the_program_ran_in() {
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = dir.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, text).unwrap();
        path
    };
    write("objects/my tri.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let scene = write("scenes/deep/a.scene", "OBJ objects/my tri.obj\n");
    assert_eq!(mesh(&crate::formats::load(&scene).unwrap(), 0).indices.len(), 1);
    // Also of a scene that is named from here: tests run in the crate's folder.
    let here = super::locate(Path::new("scenes/any.scene"), "Cargo.toml", &Default::default()).unwrap();
    assert!(here.is_absolute() && here.ends_with("Cargo.toml"), "{}", here.display());
}

#[test]
fn content_tells_the_kind_of_file_where_its_name_does_not() {
    let dir = tempfile::tempdir().unwrap();
    let load = |name: &str, text: &str| {
        let path: PathBuf = dir.path().join(name);
        std::fs::write(&path, text).unwrap();
        crate::formats::load(&path)
    };
    let kind = |scene: Result<SceneDesc>| scene.unwrap().render.integrator.map(|n| n.kind);
    let course = "# a comment\nsize 4 4\nintegrator direct\nsphere 0 0 0 1\n";
    assert_eq!(kind(load("a.txt", course)).as_deref(), Some("direct"));
    assert_eq!(kind(load("a", "size 4 4\nsph 0 0 0 1\n")).as_deref(), Some("whitted"));
    // What tells the two apart may stand behind all that they share; without it, the name decides.
    let vertices =
        "size 4 4\nspp 2\ncamera 0 0 4 0 0 0 0 1 0 40\n".to_owned() + &"vertex 0 0 0\n".repeat(5000);
    for name in ["b.scene", "b"] {
        let text = vertices.clone() + "vertex 1 0 0\nvertex 0 1 0\ntri 0 5000 5001\nmesh m\n";
        assert_eq!(kind(load(name, &text)).as_deref(), Some("whitted"), "{name}");
    }
    let shared = vertices + "vertex 1 0 0\nvertex 0 1 0\ntri 0 5000 5001\n";
    assert_eq!(load("c.test", &shared).unwrap().objects.len(), 1);
    // A name that lies costs a warning.
    assert_eq!(kind(load("a.scene", course)).as_deref(), Some("direct"));
    let native = "[render]\nintegrator = \"ao\"\n[[objects]]\nshape = { type = \"sphere\" }\n";
    assert_eq!(kind(load("b.txt", native)).as_deref(), Some("ao"));
    assert_eq!(load("mesh.data", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap().objects.len(), 1);
    let e = load("c.txt", "once upon a time").map(drop).unwrap_err().to_string();
    assert!(
        e.contains(
            "unknown kind of scene file \"txt\"; did you mean \"test\"? known: toml, test, scene, obj, ply"
        ),
        "{e}"
    );
}
