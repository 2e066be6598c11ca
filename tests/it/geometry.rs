//! Placement, precision and spawned rays, on whole scenes.

use crate::common::{build_on, describe, integrator, render, scene, scene_on};
use glam::{DAffine3, DVec3, Vec3};
use skylit::base::ray::Ray;
use skylit::render::Rendered;
use skylit::scene::Scene;

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
[camera]
type = "perspective"
eye = [6, 4, 9]
look_at = [0, 0, 0]
up = [0, 1, 0]
fov_deg = 40
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

/// The same scene with every placement multiplied out by hand.
fn flattened() -> skylit::scene::desc::SceneDesc {
    use skylit::scene::desc::{Content, ObjectDesc, SceneDesc};
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
    let mut desc = describe(&format!("{VIEW}{NESTED}"));
    let mut out = Vec::new();
    expand(&desc, &desc.objects, DAffine3::IDENTITY, &mut out);
    desc.objects = out;
    desc.groups.clear();
    desc
}

#[test]
fn nesting_renders_as_its_flattened_twin() {
    for backend in backends() {
        let nested = scene_on(backend, &format!("{VIEW}{NESTED}"));
        assert_eq!(nested.geometry.depth(), 4);
        let flat = build_on(backend, flattened());
        assert_eq!(flat.geometry.depth(), 1);
        let [a, b] =
            [&nested, &flat].map(|s| render(s, integrator("path", &[("max_depth", 2.0)]), [48, 32], 4));
        // Points agree to f32 rounding, so shadow rays that graze an edge may fall to either side: a few pixels.
        assert!(different(&a, &b) <= 15, "{backend}: {} of 1536 pixels differ", different(&a, &b));
    }
}

fn backends() -> Vec<&'static str> {
    if cfg!(feature = "embree") { vec!["embree", "brute"] } else { vec!["brute"] }
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
        let [a, b] = [&local, &far].map(|d| {
            render(&build_on(backend, d.clone()), integrator("path", &[("max_depth", 2.0)]), [48, 32], 4)
        });
        assert!(different(&a, &b) <= 15, "{backend}: {} of 1536 pixels differ", different(&a, &b));
    }
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
        render(&build_on(backends()[0], desc), integrator("path", &[("max_depth", 2.0)]), [48, 32], 4)
    };
    let one = picture(1.0);
    for exponent in [-60, -30, 30, 60] {
        let other = picture(2f64.powi(exponent));
        assert!(different(&one, &other) <= 15, "2^{exponent}: {} pixels differ", different(&one, &other));
    }
}

/// Leaves every surface of a scene in many directions and asks what the ray meets.
fn spawned(scene: &Scene, mut see: impl FnMut(&skylit::base::vertex::Vertex, Vec3, Option<f32>)) {
    let b = scene.kernel.bounds();
    let mut state = 1u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1u32 << 24) as f32
    };
    for _ in 0..20_000 {
        let target = b.min + (b.max - b.min) * Vec3::new(next(), next(), next());
        let d = Vec3::new(next() - 0.5, next() - 0.5, next() - 0.5).normalize();
        let ray = Ray::new(target - d * b.radius() * 3.0, d, 0);
        let Some(hit) = scene.kernel.intersect(&ray) else { continue };
        let v = scene.vertex(&ray, hit, 0.0);
        let w = Vec3::new(next() - 0.5, next() - 0.5, next() - 0.5).normalize();
        let outward = v.receiver().ng;
        let w = if w.dot(outward) < 0.0 { -w } else { w };
        see(&v, w, scene.kernel.intersect(&v.spawn(w, 0)).map(|h| h.t));
    }
}

/// A convex body cannot be met again by a ray that leaves it outwards: any hit is a self-hit.
#[test]
fn no_ray_hits_the_surface_it_leaves() {
    let bodies = [
        "shape = { type = \"sphere\", center = [0, 0, 0], radius = 1.0 }",
        "shape = { type = \"box\", min = [-1, -1, -1], max = [1, 1, 1] }",
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
                    let mut hits = 0;
                    spawned(&s, |v, w, t| {
                        // The other sphere may be met; the body itself is within its own size.
                        if let Some(t) = t
                            && (w * t).length() < 1e-2
                        {
                            hits += 1;
                            let _ = v;
                        }
                    });
                    assert_eq!(hits, 0, "{backend}: {body} at {place}, nested {nested}");
                }
            }
        }
    }
}

/// A sheet a little above another one is not jumped over. The sheets are tilted: on one along the axes the bound
/// across it is rightly zero.
#[test]
fn no_ray_tunnels_through_a_sheet_four_bounds_away() {
    let sheet = |center: Vec3| {
        format!(
            "[[objects]]\nmaterial = \"clay\"\nshape = {{ type = \"rectangle\", center = [{}, {}, {}], edge_u = [0.2, 0.3, 2], edge_v = [2, 0.1, -0.3] }}\n",
            center.x, center.y, center.z
        )
    };
    let (u, v) = (Vec3::new(0.2, 0.3, 2.0), Vec3::new(2.0, 0.1, -0.3));
    let n = u.cross(v).normalize();
    let one = scene(&format!("{VIEW}{}", sheet(Vec3::ZERO)));
    let ray = Ray::new(n, -n, 0);
    let vertex = one.vertex(&ray, one.kernel.intersect(&ray).unwrap(), 0.0);
    let bound = vertex.ng.abs().dot(vertex.error);
    assert!(bound > 0.0 && bound < 1e-5, "{bound}");
    let two = scene(&format!("{VIEW}{}{}", sheet(Vec3::ZERO), sheet(n * (4.0 * bound))));
    let mut missed = 0;
    for i in 0..10_000 {
        let (a, b) = ((i % 100) as f32 * 0.0098 - 0.49, (i / 100) as f32 * 0.0098 - 0.49);
        // From below, so that the lower sheet is met first, or at worst the upper.
        let below = u * a + v * b - n;
        let ray = Ray::new(below, n, 0);
        let vertex = two.vertex(&ray, two.kernel.intersect(&ray).unwrap(), 0.0);
        let is_lower = vertex.path == 0;
        missed += u32::from(is_lower && !two.kernel.occluded(&vertex.spawn(n, 0)));
    }
    assert_eq!(missed, 0);
}
