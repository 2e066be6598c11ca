//! Surface points of many hits together give the bits that they give one by one: flat and smooth meshes, placed and
//! nested, mirrored, textured, and other shapes between them.

use crate::common::scene_on;
use glam::{DVec3, Vec3};
use skylit::base::hit::{Hit, HitBatch};
use skylit::base::ray::{Coherence, Ray, RayBatch};
use skylit::base::vertices::Vertices;
use skylit::scene::{Meetings, Scene};

const OBJECTS: &str = r#"
[film]
size = [32, 32]
[camera]
type = "perspective"
eye = [0, 1, 7]
look_at = [0, 0, 0]
fov_deg = 40
[sky]
type = "constant"
radiance = 1
[materials.clay]
type = "diffuse"
albedo = 0.5
[groups.pair]
objects = [
  { shape = { type = "displaced_sphere", triangles = 500, seed = 3 }, material = "clay" },
  { shape = { type = "sphere", center = [1.2, 0.3, 0], radius = 0.4 }, material = "clay" },
]
[[objects]]
shape = { type = "knot", triangles = 3000 }
material = "clay"
transform = [{ rotate_deg = 70, axis = [1, 0, 0] }]
[[objects]]
group = "pair"
transform = [{ scale = [-0.7, 0.5, 0.9] }, { rotate_deg = 30, axis = [1, 1, 0] }, { translate = [1.5, 1, 0] }]
[[objects]]
group = "pair"
transform = [{ scale = 0.6 }, { translate = [-1.5, -1, 0.5] }]
[[objects]]
shape = { type = "rectangle", edge_u = [0, 0, 20], edge_v = [20, 0, 0], center = [0, -2, 0] }
material = "clay"
"#;

/// A grid of rays from the eye.
fn rays(scene: &Scene) -> RayBatch {
    let eye = scene.space.point(DVec3::new(0.0, 1.0, 7.0)).as_vec3();
    let mut rays = RayBatch::default();
    for i in 0..96 * 96 {
        let (x, y) = ((i % 96) as f32 / 96.0 - 0.5, (i / 96) as f32 / 96.0 - 0.5);
        rays.push(&Ray::new(eye, Vec3::new(0.8 * x, 0.8 * y - 0.14, -1.0), i));
    }
    rays
}

fn same_alone_and_together(scene: &Scene) {
    let rays = rays(scene);
    let mut hits = HitBatch::default();
    scene.kernel.intersect_batch(&rays, &mut hits, Coherence::Coherent);
    let which: Vec<u32> = (0..rays.len() as u32).filter(|&i| hits.get(i as usize).is_some()).collect();
    assert!(which.len() > 4000, "{} rays hit", which.len());
    let mut vertices = Vertices::default();
    let (mut done, mut calls) = (0, 0);
    while done < which.len() {
        let met = Meetings { rays: &rays, hits: &hits, spread: 0.01 };
        let n = scene.vertices(&met, &which[done..], &mut vertices);
        for (lane, &i) in which[done..done + n].iter().enumerate() {
            let i = i as usize;
            let hit: Hit = hits.get(i).unwrap();
            let alone = scene.vertex(&rays.get(i), hit, 0.01);
            // As text, two NaN are the same, and two zeros of different sign are not.
            assert_eq!(format!("{alone:?}"), format!("{:?}", vertices.get(lane)));
        }
        (done, calls) = (done + n, calls + 1);
    }
    assert!(calls < which.len() / 3, "{calls} calls for {} hits", which.len());
}

#[test]
fn points_are_the_same_alone_and_together() {
    same_alone_and_together(&scene_on("bvh", OBJECTS));
    // A texture asks for uv and tangents.
    let checks = r#"albedo = { type = "checker", a = 0.9, b = 0.1, uv_scale = 6 }"#;
    same_alone_and_together(&scene_on("bvh", &OBJECTS.replace("albedo = 0.5", checks)));
}
