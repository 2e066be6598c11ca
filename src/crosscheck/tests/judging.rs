//! Single rays whose right and possible answers are known.

use super::super::compare::Contender;
use super::super::crossing::Doubt;
use super::super::judge::{Answer, Class, Fault, Judgement, Ruling};
use super::super::oracle::Possible;
use super::super::replay::{Replay, read_ray, write_ray};
use super::scene_of;
use crate::accel::brute::Brute;
use crate::base::hit::Hit;
use crate::base::intersectable::Intersectable;
use crate::base::ray::Ray;
use crate::scene::Scene;
use crate::testing::TestRng;
use glam::Vec3;
use std::sync::Arc;

/// Two rectangles of two triangles at one place, and a ball beside them, all as large as render space has them.
fn planes_and_ball() -> Scene {
    scene_of(
        r#"
[camera]
type = "perspective"
eye = [0, 0, 9]
[[objects]]
name = "a"
shape = { type = "rectangle" }
[[objects]]
name = "b"
shape = { type = "rectangle" }
[[objects]]
name = "ball"
shape = { type = "sphere", center = [3, 0, 0], radius = 1.0 }
"#,
    )
}

fn judge(scene: &Scene, ray: &Ray, answers: &[Answer]) -> Vec<Ruling> {
    let all = Possible::of_all(&scene.geometry, ray, &mut 1_000_000).expect("few primitives");
    let named = answers.iter().filter_map(|a| if let Answer::Closest(h) = a { *h } else { None });
    let some = Possible::of_named(&scene.geometry, ray, named);
    assert!(all.complete && !some.complete);
    Judgement::new(answers, &all).rulings
}

fn hit(t: f32, path: u64, prim: u32) -> Answer {
    Answer::Closest(Some(Hit { t, prim, path }))
}

/// Down to a point of leaf `path`: a weight of its first triangle's corners.
fn down_to(scene: &Scene, path: u64, weights: [f32; 3]) -> Ray {
    let mesh = scene.geometry.resolve(path).leaf.shape.triangles().expect("triangles");
    let [a, b, c] = mesh.corners(0);
    let p = a * weights[0] + b * weights[1] + c * weights[2];
    let n = (b - a).cross(c - a).normalize();
    Ray::new(p + n, -n, 1)
}

/// The weights of a point half along the edge that both triangles of a rectangle have.
fn on_the_shared_edge(scene: &Scene) -> [f32; 3] {
    let mesh = scene.geometry.resolve(0).leaf.shape.triangles().expect("triangles");
    let other = mesh.indices[1];
    let shared = mesh.indices[0].map(|i| if other.contains(&i) { 0.5 } else { 0.0 });
    assert_eq!(shared.iter().sum::<f32>(), 1.0);
    shared
}

#[test]
fn neighbours_at_an_edge_and_coincident_planes_are_explained() {
    let scene = planes_and_ball();
    let edge = down_to(&scene, 0, on_the_shared_edge(&scene));
    let all = [hit(1.0, 0, 0), hit(1.0, 0, 1), Answer::Closest(None), hit(1.001, 0, 0), hit(1.0, 1, 1)];
    let rulings = judge(&scene, &edge, &all);
    let explained = Ruling::Explained(Doubt::Edge);
    assert_eq!(rulings, [Ruling::Right, explained, explained, Ruling::Wrong(Fault::Distance), explained]);
    // Within the first triangle, the plane of the other object is as near; its neighbour and a miss are wrong.
    let inside = down_to(&scene, 0, [0.4, 0.3, 0.3]);
    let all = [hit(1.0, 0, 0), hit(1.0, 1, 0), hit(1.0, 0, 1), Answer::Closest(None), Answer::Any(false)];
    let rulings = judge(&scene, &inside, &all);
    let tie = Ruling::Explained(Doubt::Tie);
    let wrong = Ruling::Wrong;
    let misses = wrong(Fault::Misses);
    assert_eq!(rulings, [Ruling::Right, tie, wrong(Fault::MeetsNothing), misses, misses]);
}

#[test]
fn ends_of_the_ray_are_explained_within_the_bound() {
    let scene = planes_and_ball();
    let inside = down_to(&scene, 0, [0.4, 0.3, 0.3]);
    let at = |tfar: f32| {
        let ray = Ray { tfar, ..inside };
        judge(&scene, &ray, &[hit(1.0, 0, 0), Answer::Closest(None), Answer::Any(true), Answer::Any(false)])
    };
    let end = Ruling::Explained(Doubt::RangeEnd);
    assert_eq!(at(1.0)[1], end);
    assert!(at(1.0f32.next_down().next_down()).iter().all(|r| !matches!(r, Ruling::Wrong(_))));
    let nothing = Ruling::Wrong(Fault::MeetsNothing);
    assert_eq!(at(0.99), [nothing, Ruling::Right, nothing, Ruling::Right]);
    let misses = Ruling::Wrong(Fault::Misses);
    assert_eq!(at(1.01), [Ruling::Right, misses, Ruling::Right, misses]);
}

#[test]
fn a_ball_is_grazed_within_rounding_and_no_further() {
    let scene = planes_and_ball();
    let ball = scene.geometry.resolve(2).leaf.shape.bounds();
    let (center, radius) = (ball.center(), 0.5 * ball.size().x);
    let at = |off: f32| {
        let ray = Ray::new(center + Vec3::new(0.0, radius * off, 2.0 * radius), -Vec3::Z, 1);
        let t = ray.o.z - center.z;
        judge(&scene, &ray, &[hit(t, 2, 0), Answer::Closest(None)])
    };
    let grazing = Ruling::Explained(Doubt::Grazing);
    let rulings = at(1.0);
    assert!(rulings.iter().all(|r| [Ruling::Right, grazing].contains(r)), "{rulings:?}");
    assert_eq!(at(1.0001), [Ruling::Wrong(Fault::MeetsNothing), Ruling::Right]);
    // Half of the chord of a ray so near the rim is 1.4 % of the radius: the middle is no hit.
    assert_eq!(at(0.9999), [Ruling::Wrong(Fault::Distance), Ruling::Wrong(Fault::Misses)]);
    // The far side, where the near one is in front.
    let ray = Ray::new(center + Vec3::new(0.0, 0.0, 2.0 * radius), -Vec3::Z, 1);
    let brute = Brute::new(scene.geometry.clone());
    let near = brute.intersect(&ray).expect("the ball");
    let far = brute.intersect(&Ray { tnear: near.t + radius, ..ray }).expect("its far side");
    let rulings = judge(&scene, &ray, &[near, far].map(|h| Answer::Closest(Some(h))));
    assert_eq!(rulings, [Ruling::Right, Ruling::Wrong(Fault::PassesOver)]);
}

#[test]
fn what_all_agree_on_can_be_wrong_and_names_of_nothing_are() {
    let scene = planes_and_ball();
    let inside = down_to(&scene, 0, [0.4, 0.3, 0.3]);
    let possible = Possible::of_all(&scene.geometry, &inside, &mut 1000).unwrap();
    let j = Judgement::new(&[hit(1.0, 0, 1), hit(1.0, 0, 1)], &possible);
    assert_eq!((j.class, j.is_explained()), (Class::Agreed, false));
    for (path, prim) in [(0, 77), (99, 0)] {
        assert_eq!(
            judge(&scene, &inside, &[hit(1.0, path, prim)]),
            [Ruling::Wrong(Fault::MeetsNothing)],
            "{path} {prim}"
        );
    }
    assert!(Possible::of_all(&scene.geometry, &inside, &mut 2).is_none(), "more tests than it may take");
}

/// Looking at everything finds what the oracle's own loop finds, through groups within groups.
#[test]
fn the_search_meets_what_the_oracle_meets() {
    let scene = scene_of(super::SCENE);
    let brute = Brute::new(scene.geometry.clone());
    let bounds = scene.geometry.root().bounds;
    let mut rng = TestRng::new(3);
    let mut met = 0;
    for i in 0..2000 {
        let o = bounds.center() + rng.direction() * bounds.radius() * 1.5;
        let target = bounds.center() + rng.cube().as_vec3() * bounds.size() * 0.5;
        let ray = Ray::new(o, target - o, i);
        let possible = Possible::of_all(&scene.geometry, &ray, &mut 1_000_000).unwrap();
        let got = possible.truth().map(|c| (c.path, c.prim, c.crossing.t as f32));
        assert_eq!(got, brute.intersect(&ray).map(|h| (h.path, h.prim, h.t)));
        met += u32::from(got.is_some());
    }
    assert!((200..1900).contains(&met), "{met}");
}

#[test]
fn rays_are_written_and_read_without_loss() {
    let mut rng = TestRng::new(5);
    for i in 0..1000 {
        let v = |rng: &mut TestRng| rng.direction() * f32::exp2((rng.f32() - 0.5) * 60.0);
        let (o, d) = (v(&mut rng), v(&mut rng));
        let tfar = if i % 2 == 0 { f32::INFINITY } else { 1.0 + rng.f32() };
        let ray = Ray { o, d, tnear: rng.f32() * 1e-20, tfar, key: rng.bits() as u32 };
        assert_eq!(read_ray(&write_ray(&ray, true)), Ok(ray));
        assert_eq!(read_ray(&write_ray(&ray, false)), Ok(Ray { key: 0, ..ray }));
    }
    assert_eq!(read_ray("0,0,1,0,0,-1,0,inf").unwrap().tfar, f32::INFINITY);
    for bad in ["", "1,2", "0,0,1,0,0,0,0,inf", "0,0,nan,0,0,1,0,1", "0,0,1,0,0,1,2,1", "a,0,1,0,0,1,0,1"] {
        assert!(read_ray(bad).is_err(), "{bad}");
    }
}

#[test]
fn a_replay_tells_what_everyone_says() {
    let scene = planes_and_ball();
    let brute: Arc<dyn Intersectable> = Arc::new(Brute::new(scene.geometry.clone()));
    let all = [Contender { name: "brute".into(), kernel: brute }];
    let edge = down_to(&scene, 0, on_the_shared_edge(&scene));
    let replay = Replay::new(&scene, &all, edge, 1_000_000);
    let text = replay.to_string();
    assert!(replay.passed());
    for word in ["a, triangle 0", "b, triangle 1", "0.000e0 +-", "through an edge", "verdict"] {
        assert!(text.contains(word), "{word} in {text}");
    }
}
