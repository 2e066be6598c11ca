//! The law of the house: a kind of material, light, shape or sky is one file with its row. Each file beside this one
//! adds a kind of its family by what the crate makes public (a test is a crate of its own and can reach nothing else),
//! and the scenes below go through the real loader, builder, kernels, integrators and film. The families' own tests
//! run over the same four rows (src/testing/outside.rs).

mod light;
mod material;
mod shape;
mod sky;

use crate::common::{assert_mean, integrator, mean, render};
use skylit::base::intersectable::KernelOptions;
use skylit::formats::families::Families;
use skylit::formats::{LoadOptions, load_with};
use skylit::scene::Scene;
use skylit::scene::build::{BuildOptions, build_with};
use skylit::scene::registry::Registry;
use std::f64::consts::PI;
use std::path::{Path, PathBuf};

/// Everything that a program with kinds of its own has to say.
fn registry() -> Registry {
    let mut registry = Registry::default();
    registry.materials.push(material::ROW);
    registry.lights.push(light::ROW);
    registry.shapes.push(shape::ROW);
    registry.skies.push(sky::ROW);
    registry
}

fn load(toml: &str, registry: &Registry) -> skylit::Result<skylit::scene::desc::SceneDesc> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("scene.toml");
    std::fs::write(&path, toml).unwrap();
    let options = LoadOptions { families: Families::of(registry), ..LoadOptions::default() };
    load_with(&path, &options)
}

fn scene_on(backend: &str, toml: &str) -> Scene {
    let registry = registry();
    let desc = load(toml, &registry).unwrap_or_else(|e| panic!("{e}\n{toml}"));
    let options = BuildOptions { backend: backend.into(), kernel: KernelOptions::default() };
    build_with(desc, &options, &registry).unwrap()
}

/// Six standard errors: a false alarm in 5e8 comparisons.
const SIGMAS: f64 = 6.0;

const FILM: &str = "[film]\nsize = [16, 16]\n";

/// A disc of paper under the sideways sky, a lamp before it and one behind: a flat thing lights itself not at all, so
/// what it shows is r / pi of the irradiance of its front and t / pi of that of its back, all in closed form.
const LEAF: &str = r#"
[camera]
type = "perspective"
eye = [0, 0, 4]
look_at = [0, 0, 0]
up = [0, 1, 0]
fov_deg = 10
[sky]
type = "sideways"
mean = [0.8, 0.8, 0.8]
slope = 0.6
[materials.leaf]
type = "paper"
reflectance = 0.4
transmittance = 0.5
[[objects]]
shape = { type = "disc", normal = [0.6, 0, 0.8], radius = 1.0 }
material = "leaf"
[[lights]]
type = "far_lamp"
toward = [0.6, 0, 0.8]
half_angle_deg = 12
radiance = [5, 5, 5]
[[lights]]
type = "far_lamp"
toward = [0, 0, -1]
half_angle_deg = 8
radiance = [9, 9, 9]
"#;

#[test]
fn four_foreign_kinds_give_their_closed_forms() {
    let sky = |x: f64| 0.8 * PI * (1.0 + 2.0 / 3.0 * 0.6 * x);
    let lamp = |l: f64, degrees: f64, cos: f64| PI * l * degrees.to_radians().sin().powi(2) * cos;
    let front = sky(0.6) + lamp(5.0, 12.0, 1.0);
    let back = sky(-0.6) + lamp(9.0, 8.0, 0.8);
    let expected = 0.4 / PI * front + 0.5 / PI * back;
    let s = scene_on("auto", &format!("{FILM}{LEAF}"));
    for kind in ["path", "direct"] {
        for light_sampling in [1.0, 0.0] {
            let spp = if light_sampling == 1.0 { 256 } else { 1024 };
            let r = render(&s, integrator(kind, &[("light_sampling", light_sampling)]), spp);
            let m = mean(&r);
            // Noise far below the smallest part, the back lamp's 0.022: a light that were missing would show.
            assert!(m.error < 0.002, "{kind} {light_sampling}: {}", m.error);
            assert_mean(&format!("{kind} {light_sampling}"), &m, expected, SIGMAS, 1e-5 * expected);
        }
    }
}

/// What a disc that faces the camera covers of the picture, and what it does not show the background.
#[test]
fn a_foreign_shape_covers_its_silhouette() {
    let toml =
        LEAF.replace("fov_deg = 10", "fov_deg = 50").replace("[0.6, 0, 0.8], radius", "[0, 0, 1], radius");
    let size = 64;
    let film = format!("[film]\nbackground = \"transparent\"\nsize = [{size}, {size}]\n");
    let s = scene_on("auto", &format!("{film}{toml}"));
    let r = render(&s, integrator("direct", &[]), 16);
    let covered: f64 = r.film.window().pixels().map(|(x, y)| f64::from(r.film.alpha(x, y))).sum();
    let radius = 0.5 * f64::from(size) * 0.25 / (25f64).to_radians().tan();
    let expected = PI * radius * radius;
    // The border runs through 2 pi r = 108 pixels, each known to 1 / 16 or better: as if all errors were independent,
    // 0.6 pixels; six times that.
    assert!((covered - expected).abs() < 4.0, "{covered} pixels of {expected}");
}

/// The disc as a lamp, by a material of the crate's: pi L r^2 / (r^2 + h^2) on its axis.
#[test]
fn a_foreign_shape_is_an_area_light() {
    let s = scene_on(
        "auto",
        r#"
[film]
size = [8, 8]
[camera]
type = "perspective"
eye = [0, 0.5, 0]
look_at = [0, 0, 0]
up = [0, 0, 1]
fov_deg = 0.5
[materials.floor]
type = "diffuse"
albedo = 0.5
[materials.lamp]
type = "emissive"
radiance = 10.0
[[objects]]
shape = { type = "rectangle", edge_u = [0, 0, 2], edge_v = [2, 0, 0] }
material = "floor"
[[objects]]
shape = { type = "disc", center = [0, 2, 0], normal = [0, -1, 0], radius = 0.75 }
material = "lamp"
"#,
    );
    let expected = 0.5 * 10.0 * 0.75f64.powi(2) / (0.75f64.powi(2) + 4.0);
    let m = mean(&render(&s, integrator("path", &[]), 256));
    // The patch seen is 0.004 wide: irradiance falls by 1e-6 across it.
    assert_mean("disc lamp", &m, expected, SIGMAS, 5e-5 * expected);
}

/// No two primitives of this scene share an edge, so both kernels find the same one on every ray, and shared code does
/// the rest: the same bits.
#[cfg(feature = "embree")]
#[test]
fn foreign_kinds_look_the_same_to_every_kernel() {
    let toml = format!(
        "{}{}{}",
        "[film]\nsize = [48, 32]\n",
        LEAF.replace("fov_deg = 10", "fov_deg = 50"),
        r#"
[[objects]]
shape = { type = "sphere", center = [0.8, 0.3, 0.9], radius = 0.4 }
material = "leaf"
[[objects]]
shape = { type = "disc", center = [0, -1.2, 0], radius = 3.0 }
material = "leaf"
"#
    );
    let [a, b] = ["embree", "brute"]
        .map(|backend| render(&scene_on(backend, &toml), integrator("path", &[]), 16).film);
    assert!(a == b);
    let value = mean(&render(&scene_on("brute", &toml), integrator("path", &[]), 16)).value;
    assert!(value > 0.1, "there is something to see: {value}");
}

#[test]
fn foreign_kinds_are_known_where_they_were_added_and_nowhere_else() {
    let message = |toml: &str, registry: &Registry| load(toml, registry).err().expect("refused").to_string();
    let typo = message("[materials.a]\ntype = \"papre\"", &registry());
    assert!(typo.contains("scene.toml:2:8") && typo.contains("\"paper\""), "{typo}");
    let range = message("[materials.a]\ntype = \"paper\"\ntransmittance = 2", &registry());
    assert!(range.contains("scene.toml:3:17") && range.contains("`transmittance`"), "{range}");
    let unknown = message("[materials.a]\ntype = \"paper\"", &Registry::default());
    assert!(unknown.contains("paper") && unknown.contains("diffuse"), "{unknown}");
}

/// The files below a folder that are not for tests alone.
fn sources(dir: &Path) -> Vec<PathBuf> {
    let is_test =
        |p: &PathBuf| p.iter().any(|part| ["testing", "tests", "tests.rs"].iter().any(|t| part == *t));
    let src = crate::source::rust_files(dir);
    src.into_iter().filter(|p| !is_test(p)).collect()
}

/// Nothing in the crate had to learn of the four kinds, and what traces paths names no kind of any family.
#[test]
fn nothing_else_had_to_change() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let names = |dir: &Path, kinds: &[&str]| {
        for path in sources(dir) {
            let text = std::fs::read_to_string(&path).unwrap();
            for kind in kinds {
                assert!(!text.contains(&format!("\"{kind}\"")), "{} names {kind}", path.display());
            }
        }
    };
    let foreign = [material::ROW.kind, light::ROW.kind, shape::ROW.kind, sky::ROW.kind];
    assert!(sources(&src).len() > 100, "the source was found");
    names(&src, &foreign);
    let f = Families::of(&registry());
    let families = [&f.shapes, &f.materials, &f.textures, &f.lights, &f.skies, &f.cameras];
    let all: Vec<&str> = families.iter().flat_map(|f| f.names()).collect();
    assert!(foreign.iter().all(|k| all.contains(k)), "all are registered");
    names(&src.join("integrators"), &all);
}
