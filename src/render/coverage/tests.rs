use super::*;
use crate::integrators;
use crate::render::{Renderer, Silent, settings::RenderSettings};
use crate::scene::build::{BuildOptions, build};

fn scene(text: &str) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.toml");
    std::fs::write(&path, text).unwrap();
    let options = BuildOptions { backend: "brute".into(), ..BuildOptions::default() };
    build(crate::formats::load(&path).unwrap(), &options).unwrap()
}

const HEAD: &str = r#"
[film]
size = [96, 64]
[camera]
type = "perspective"
eye = [0.3, 1.0, 6.0]
look_at = [0, 0.2, 0]
fov_deg = 45.0
[sky]
type = "gradient"
"#;

/// Objects of every sort: a mesh, exact shapes, placed groups, what lies behind the camera and what crosses its plane.
const OBJECTS: [&str; 5] = [
    "[[objects]]\nshape = { type = \"knot\", triangles = 600 }\ntransform = [{ scale = 0.5 }]\n",
    "[[objects]]\nshape = { type = \"sphere\", radius = 0.7 }\ntransform = [{ translate = [-1.5, 0.3, 1] }]\n",
    "[groups.pair]\nobjects = [{ shape = { type = \"knot\", triangles = 300 } }]\n[[objects]]\ngroup = \"pair\"\n\
     transform = [{ scale = 0.3 }, { rotate_deg = 40, axis = [0, 0, 1] }, { translate = [1.2, 0.4, 0] }]\n[[objects]]\n\
     group = \"pair\"\ntransform = [{ scale = 0.2 }, { translate = [0, 1, 20] }]\n",
    "[[objects]]\nshape = { type = \"quad\", corner = [-9, -1, -2], edge_a = [18, 0, 0], edge_b = [0, 0, 30] }\n",
    "[[objects]]\nshape = { type = \"sphere\", radius = 0.3 }\ntransform = [{ translate = [0.3, 1.5, 6.2] }]\n",
];

#[test]
fn a_pixel_that_is_not_marked_sees_nothing() {
    for (k, objects) in OBJECTS.iter().enumerate() {
        let scene = scene(&format!("{HEAD}{objects}"));
        let rect = PixelRect::of_size(96, 64);
        let mut settings = RenderSettings::new([96, 64]);
        (settings.spp, settings.threads, settings.skip_background) = (32, 1, false);
        let coverage = Coverage::of(&scene, rect, settings.filter, 4096);
        let node = crate::base::registry::Node { kind: "direct".into(), ..Default::default() };
        let integrator = crate::base::registry::build("integrator", integrators::REGISTRY, &node).unwrap();
        let film = Renderer { integrator, settings }.render(&scene, &Silent).unwrap().film;
        let seen = rect.pixels().filter(|&(x, y)| film.alpha(x, y) > 0.0).count();
        let Some(coverage) = coverage else {
            // The last ball lies on both sides of the camera's plane: its box may be anywhere.
            assert!(seen > 0 || k == 4, "{k}");
            continue;
        };
        for (x, y) in rect.pixels() {
            assert!(coverage.is_covered(x, y) || film.alpha(x, y) == 0.0, "{k}: pixel {x}, {y}");
        }
        // Marks are close: the samples' reach of 1.5 pixels and small boxes add a rim to meshes. A ball is marked by its
        // box, which covers up to 2.2 times as much (seen along a diagonal of it, 1.27 face on).
        let marked = rect.area() - coverage.free();
        let most = if k == 1 { 2.2 } else { 1.6 };
        assert!(k == 4 || marked as f64 <= most * seen as f64 + 60.0, "{k}: {marked} for {seen}");
    }
}

#[test]
fn triangles_across_the_cameras_plane_mark_what_is_before_it() {
    // The floor of the fourth scene runs below the camera and behind it: above its edge there is only sky.
    let scene = scene(&format!("{HEAD}{}", OBJECTS[3]));
    let c = Coverage::of(&scene, PixelRect::of_size(96, 64), PixelFilter::Box, 4096).unwrap();
    assert!(!c.is_covered(48, 2) && c.is_covered(48, 62) && c.is_covered(1, 63));
}

#[test]
fn no_camera_but_a_pinhole_is_projected_and_few_samples_are_not_worth_it() {
    let lens = HEAD.replace("fov_deg", "aperture = 0.1\nfov_deg");
    let rect = PixelRect::of_size(96, 64);
    assert!(Coverage::of(&scene(&format!("{lens}{}", OBJECTS[1])), rect, PixelFilter::Box, 64).is_none());
    let many = OBJECTS[0].replace("600", "60000");
    assert!(Coverage::of(&scene(&format!("{HEAD}{many}")), rect, PixelFilter::Box, 2).is_none());
}
