//! Placement, precision and spawned rays, on whole scenes.

use crate::common::{build_on, describe, integrator, render, render_rays, scene_on};
use glam::{DAffine3, DVec3};
use skylit::check::spawn::spawned;
use skylit::render::Rendered;
use skylit::scene::desc::{Content, ObjectDesc, SceneDesc};
use std::f64::consts::{PI, TAU};

/// Pixels whose means differ by more than a relative 1e-4 (thin silhouettes may fall to either side of a ray).
fn different(a: &Rendered, b: &Rendered) -> usize {
    let far = |x: f32, y: f32| (x - y).abs() > 1e-4 * (1.0 + x.abs().max(y.abs()));
    a.film
        .window()
        .pixels()
        .filter(|&(x, y)| {
            let (p, q) = (a.film.mean(x, y).to_array(), b.film.mean(x, y).to_array());
            p.iter().zip(q).any(|(&p, q)| far(p, q))
        })
        .count()
}

const VIEW: &str = r#"
[film]
size = [48, 32]
[camera]
type = "perspective"
eye = [6, 4, 9]
look_at = [0, 0, 0]
up = [0, 1, 0]
fov_deg = 25
[sky]
type = "gradient"
[materials.clay]
type = "diffuse"
albedo = 0.7
"#;

/// Four levels of groups, one of them mirrored, one sheared by a rotation between two uneven scales.
const NESTED: &str = r#"
[groups.atom]
objects = [
  { shape = { type = "sphere", center = [0, 0, 0], radius = 0.4 }, material = "clay" },
  { shape = { type = "displaced_sphere", triangles = 500, seed = 1 }, material = "clay", transform = [{ scale = 0.4 }, { translate = [0.9, 0.1, 0] }] },
]
[groups.pair]
objects = [
  { group = "atom" },
  { group = "atom", transform = [{ scale = [-1, 1, 1] }, { translate = [0, 1.2, 0] }] },
]
[groups.row]
objects = [
  { group = "pair", transform = [{ translate = [-1.5, 0, 0] }] },
  { group = "pair", transform = [{ scale = [1, 0.6, 1] }, { rotate_deg = 30, axis = [0, 0, 1] }, { scale = [0.7, 1, 1] }, { translate = [1.5, 0, 0] }] },
]
[[objects]]
group = "row"
transform = [{ translate = [0, -1, 1] }]
[[objects]]
group = "row"
transform = [{ rotate_deg = 70, axis = [0, 1, 0] }, { translate = [0, 0.5, -2] }]
"#;

/// A scene with every placement multiplied out by hand.
fn flattened(mut desc: SceneDesc) -> SceneDesc {
    fn expand(desc: &SceneDesc, objects: &[ObjectDesc], by: DAffine3, out: &mut Vec<ObjectDesc>) {
        for o in objects {
            let transform = by * o.transform;
            match &o.content {
                Content::Shape(_) => out.push(ObjectDesc { transform, ..o.clone() }),
                Content::Group(name) => {
                    let group = desc.groups.iter().find(|g| &g.name == name).unwrap();
                    expand(desc, &group.value, transform, out);
                }
            }
        }
    }
    let mut out = Vec::new();
    expand(&desc, &desc.objects, DAffine3::IDENTITY, &mut out);
    desc.objects = out;
    desc.groups.clear();
    desc
}

#[test]
fn nesting_renders_as_its_flattened_twin() {
    // Interpolated normals are those of the space in which they are interpolated, and uneven scales do not keep
    // them: with shear the shapes must be flat or quadrics, without it all shapes will do.
    let scale = "{ scale = [1, 0.6, 1] }, ";
    assert!(NESTED.contains(scale));
    let flat = NESTED.replace("type = \"displaced_sphere\", triangles = 500, seed = 1", "type = \"box\"");
    let even = NESTED.replace(scale, "").replace("{ scale = [0.7, 1, 1] }", "{ scale = 0.7 }");
    for (what, nested) in [("sheared", flat), ("smooth", even)] {
        let nested = describe(&format!("{VIEW}{nested}"));
        for backend in backends() {
            let twins = [nested.clone(), flattened(nested.clone())].map(|d| build_on(backend, d));
            assert_eq!(twins.each_ref().map(|s| s.geometry.depth()), [4, 1]);
            let [a, b] = twins.map(|s| render_rays(&s, integrator("path", &[("max_depth", 2.0)]), 4));
            let seen = a.film.window().pixels().filter(|&(x, y)| a.film.alpha(x, y) > 0.0).count();
            assert!(seen > 150, "{what}: {seen} pixels show anything");
            // Points agree to f32 rounding, so shadow rays that graze an edge may fall to either side: a few pixels.
            assert!(different(&a, &b) <= 8, "{backend} {what}: {} pixels differ", different(&a, &b));
        }
    }
}

fn backends() -> Vec<&'static str> {
    skylit::accel::KERNELS.iter().map(|k| k.name).collect()
}

#[test]
fn a_georeferenced_scene_renders_as_its_local_twin() {
    let local = describe(&format!("{VIEW}{NESTED}"));
    let mut far = local.clone();
    let offset = DVec3::new(4_000_000.0, 250.0, -5_600_000.0);
    for o in &mut far.objects {
        o.transform = DAffine3::from_translation(offset) * o.transform;
    }
    let camera = far.camera.as_mut().unwrap();
    for p in &mut camera.params.list {
        if let skylit::base::registry::Value::Numbers(v) = &mut p.value
            && p.name != "up"
        {
            for (x, o) in v.iter_mut().zip(offset.to_array()) {
                *x += o;
            }
        }
    }
    for backend in backends() {
        let [a, b] = [&local, &far]
            .map(|d| render(&build_on(backend, d.clone()), integrator("path", &[("max_depth", 2.0)]), 4));
        assert!(different(&a, &b) <= 15, "{backend}: {} of 1536 pixels differ", different(&a, &b));
    }
}

/// A ball of bumps as the text of an OBJ file, around `center`.
fn ball(center: DVec3) -> String {
    let (rows, columns) = (16, 24);
    let mut text = String::new();
    for i in 0..=rows {
        for j in 0..columns {
            let (theta, phi) = (PI * f64::from(i) / f64::from(rows), TAU * f64::from(j) / f64::from(columns));
            let r = 1.0 + 0.1 * (5.0 * phi).cos() * (4.0 * theta).sin();
            let p = center + DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin()) * r;
            text += &format!("v {:.6} {:.6} {:.6}\n", p.x, p.y, p.z);
        }
    }
    for i in 0..rows {
        for j in 0..columns {
            let at = |i: i32, j: i32| i * columns + j % columns + 1;
            text += &format!("f {} {} {} {}\n", at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j));
        }
    }
    text
}

/// The offset stands in the mesh file itself, where f32 would keep a quarter of a metre.
#[test]
fn a_georeferenced_mesh_renders_as_its_local_twin() {
    let picture = |center: DVec3| {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("ball.obj"), ball(center)).unwrap();
        let view = VIEW
            .replace(
                "eye = [6, 4, 9]",
                &format!("eye = {:?}", (center + DVec3::new(3.0, 2.0, 4.5)).to_array()),
            )
            .replace("look_at = [0, 0, 0]", &format!("look_at = {:?}", center.to_array()));
        let path = dir.path().join("scene.toml");
        let object = "[[objects]]\nshape = { type = \"mesh\", path = \"ball.obj\" }\nmaterial = \"clay\"\n";
        std::fs::write(&path, format!("{view}{object}")).unwrap();
        let desc = skylit::formats::load(&path).unwrap();
        render(&build_on(backends()[0], desc), integrator("path", &[("max_depth", 2.0)]), 4)
    };
    let [local, far] = [DVec3::ZERO, DVec3::new(4_000_000.0, 250.0, -5_600_000.0)].map(picture);
    let seen = local.film.window().pixels().filter(|&(x, y)| local.film.alpha(x, y) > 0.0).count();
    assert!(seen > 300, "{seen} pixels show the mesh");
    // Corners are written to a micrometre in both, and recentred by other roundings: a few grazing rays.
    assert!(different(&local, &far) <= 15, "{} pixels differ", different(&local, &far));
}

#[test]
fn size_changes_nothing() {
    let picture = |scale: f64| {
        let mut desc = describe(&format!("{VIEW}{NESTED}"));
        for o in &mut desc.objects {
            o.transform = DAffine3::from_scale(DVec3::splat(scale)) * o.transform;
        }
        for p in &mut desc.camera.as_mut().unwrap().params.list {
            if let skylit::base::registry::Value::Numbers(v) = &mut p.value
                && p.name != "up"
            {
                v.iter_mut().for_each(|x| *x *= scale);
            }
        }
        render(&build_on(backends()[0], desc), integrator("path", &[("max_depth", 2.0)]), 4)
    };
    let one = picture(1.0);
    for exponent in [-60, -30, 30, 60] {
        let other = picture(2f64.powi(exponent));
        assert!(different(&one, &other) <= 15, "2^{exponent}: {} pixels differ", different(&one, &other));
    }
}

/// No ray meets the surface that it leaves, nor a side of the body that it moves away from.
#[test]
fn no_ray_hits_the_surface_it_leaves() {
    let bodies = [
        "shape = { type = \"sphere\", center = [0, 0, 0], radius = 1.0 }",
        "shape = { type = \"box\", min = [-1, -1, -1], max = [1, 1, 1] }",
        // Sides in planes of a coordinate 0, where the bound across the side is zero, and the step of a ray one of f32.
        "shape = { type = \"box\", min = [-1, -1, 0], max = [1, 0, 1] }",
        "shape = { type = \"rectangle\", edge_u = [0.02, 0, 0], edge_v = [0, 0, 0.03] }",
    ];
    let places = [
        "[]",
        "[{ translate = [1000, 2000, -500] }]",
        "[{ scale = [100, 1, 0.01] }, { rotate_deg = 33, axis = [1, 2, 3] }, { translate = [5, 6, 7] }]",
        "[{ translate = [1e5, 0, 0] }, { scale = 1e-3 }, { translate = [-100, 0, 0] }]",
    ];
    for backend in backends() {
        for body in bodies {
            for place in places {
                for nested in [false, true] {
                    let object = format!("{{ {body}, material = \"clay\", transform = {place} }}");
                    // A second object far away, so that the group's own recentring does not do all the work.
                    let other = "{ shape = { type = \"sphere\", center = [0, 3000, 0], radius = 1.0 }, material = \"clay\" }";
                    let toml = if nested {
                        format!("{VIEW}[groups.g]\nobjects = [{object}]\n[[objects]]\ngroup = \"g\"\n")
                    } else {
                        format!(
                            "{VIEW}[groups.g]\nobjects = [{object}, {other}]\n[[objects]]\ngroup = \"g\"\ntransform = [{{ rotate_deg = 20, axis = [0, 1, 1] }}]\n"
                        )
                    };
                    let s = scene_on(backend, &toml);
                    let rays = if backend == "brute" { 500 } else { 5000 };
                    let t = spawned(&s.geometry, &*s.kernel, rays, 1);
                    let what = format!("{backend}: {body} at {place}, nested {nested}");
                    assert!(t.self_hits.tried > rays / 2, "{what}: {t:?}");
                    for tally in [t.self_hits, t.neighbours, t.offset, t.point] {
                        assert_eq!(tally.failed, 0, "{what}: {tally:?}");
                    }
                }
            }
        }
    }
}
