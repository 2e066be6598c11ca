//! Geometry at its worst, on every kernel: an answer or a clear error, in bounded time and memory.

use glam::{DAffine3, DVec3, Vec3};
use skylit::accel::KERNELS;
use skylit::base::intersectable::KernelOptions;
use skylit::base::mesh_data::{MeshData, Positions, Repairs};
use skylit::base::ray::Ray;
use skylit::base::registry::{Node, Params, Value};
use skylit::scene::Scene;
use skylit::scene::build::{BuildOptions, build};
use skylit::scene::desc::{Content, Named, ObjectDesc, SceneDesc};
use std::sync::Arc;

fn mesh(positions: Positions, indices: Vec<[u32; 3]>) -> Node {
    let data = MeshData {
        positions,
        normals: Vec::new(),
        uvs: Vec::new(),
        indices,
        material_ids: Vec::new(),
        materials: Vec::new(),
        repairs: Repairs::default(),
    };
    let params = Params::new().with("path", Value::Mesh(Arc::new(data)));
    Node { kind: "mesh".into(), params, ..Node::default() }
}

fn object(content: Content, transform: DAffine3) -> ObjectDesc {
    ObjectDesc { name: String::new(), content, materials: Vec::new(), transform, place: Default::default() }
}

fn shape(node: Node) -> ObjectDesc {
    object(Content::Shape(node), DAffine3::IDENTITY)
}

fn placed(group: &str, transform: DAffine3) -> ObjectDesc {
    object(Content::Group(group.into()), transform)
}

fn group(name: &str, objects: Vec<ObjectDesc>) -> Named<Vec<ObjectDesc>> {
    Named { name: name.into(), value: objects, place: Default::default() }
}

fn ball() -> Node {
    Node { kind: "sphere".into(), ..Node::default() }
}

fn on(backend: &str, scene: SceneDesc) -> Result<Scene, String> {
    let options = BuildOptions { backend: backend.into(), kernel: KernelOptions::default() };
    build(scene, &options).map_err(|e| e.to_string())
}

fn of(objects: Vec<ObjectDesc>) -> SceneDesc {
    SceneDesc { objects, ..SceneDesc::default() }
}

/// Kernels that hold a structure: the oracle tests everything for each ray, and is no use for millions.
fn structured() -> impl Iterator<Item = &'static str> {
    KERNELS.iter().map(|k| k.name).filter(|n| *n != "brute")
}

/// The world point and direction in render space.
fn ray(scene: &Scene, o: DVec3, d: DVec3) -> Ray {
    Ray::new(scene.space.point(o).as_vec3(), d.as_vec3(), 0)
}

/// Hit or not by both queries, which must agree.
#[track_caller]
fn is_hit(scene: &Scene, ray: &Ray) -> bool {
    let hit = scene.kernel.intersect(ray);
    assert_eq!(hit.is_some(), scene.kernel.occluded(ray), "{ray:?}");
    assert!(hit.is_none_or(|h| h.t.is_finite() && h.t >= 0.0), "{hit:?}");
    hit.is_some()
}

/// The deepest nesting of groups that is accepted.
const DEEPEST: usize = 64;

const DOWN: DVec3 = DVec3::NEG_Z;

fn corners() -> Positions {
    Positions::F32(vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
}

#[test]
fn one_triangle_and_a_hundred_thousand_equal_ones() {
    for count in [1, 1000, 100_000] {
        let scene = of(vec![shape(mesh(corners(), vec![[0, 1, 2]; count]))]);
        // The builder of the obvhs library takes minutes for so many equal boxes: it is a baseline, and not ours.
        for backend in structured().filter(|b| count <= 1000 || *b != "obvhs") {
            let s = on(backend, scene.clone()).unwrap();
            assert!(is_hit(&s, &ray(&s, DVec3::new(0.25, 0.25, 2.0), DOWN)), "{backend}");
            assert!(!is_hit(&s, &ray(&s, DVec3::new(0.75, 0.75, 2.0), DOWN)), "{backend}");
        }
    }
}

/// Nested triangles about one point, so that no split by centroids parts them; queries run on a small stack.
#[test]
fn all_centroids_equal() {
    let mut positions = Vec::new();
    for i in 0..100_000u32 {
        let r = 0.5 + f64::from(i) * 1e-5;
        let (sin, cos) = (f64::from(i) * 0.001).sin_cos();
        let third = 3f64.sqrt() / 2.0;
        for (x, y) in [(1.0, 0.0), (-0.5, third), (-0.5, -third)] {
            positions.push([r * (cos * x - sin * y), r * (sin * x + cos * y), 0.0]);
        }
    }
    let indices = (0..100_000).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let scene = of(vec![shape(mesh(Positions::F64(positions), indices))]);
    for backend in structured() {
        let scene = scene.clone();
        let run = move || {
            let s = on(backend, scene).unwrap();
            assert!(is_hit(&s, &ray(&s, DVec3::new(0.05, 0.03, 1.0), DOWN)), "{backend}");
            assert!(!is_hit(&s, &ray(&s, DVec3::new(1.6, 0.0, 1.0), DOWN)), "{backend}");
        };
        std::thread::Builder::new().stack_size(1 << 20).spawn(run).unwrap().join().unwrap();
    }
}

#[test]
fn coordinates_at_the_end_of_their_range() {
    let far = f32::MAX;
    let single = Positions::F32(vec![[-far, -far, 0.0], [far, -far, 0.0], [0.0, far, 0.0]]);
    let far = 1e99;
    let double = Positions::F64(vec![[-far, -far, 0.0], [far, -far, 0.0], [0.0, far, 0.0]]);
    let far = 1e101;
    let beyond = Positions::F64(vec![[-far, -far, 0.0], [far, -far, 0.0], [0.0, far, 0.0]]);
    for k in KERNELS {
        // In render space the scene has a size of about one.
        for positions in [&single, &double] {
            let s = on(k.name, of(vec![shape(mesh(positions.clone(), vec![[0, 1, 2]]))])).unwrap();
            assert!(is_hit(&s, &Ray::new(Vec3::new(0.0, 0.0, 1.0), -Vec3::Z, 0)), "{}", k.name);
        }
        let refused = on(k.name, of(vec![shape(mesh(beyond.clone(), vec![[0, 1, 2]]))]));
        assert!(refused.err().is_some_and(|e| e.contains("too large")), "{}", k.name);
        // Beside something small, which is then a point.
        let both =
            of(vec![shape(mesh(single.clone(), vec![[0, 1, 2]])), shape(mesh(corners(), vec![[0, 1, 2]]))]);
        if let Ok(s) = on(k.name, both) {
            assert!(is_hit(&s, &Ray::new(Vec3::new(0.0, 0.0, 1.0), -Vec3::Z, 0)), "{}", k.name);
        }
    }
}

#[test]
fn ten_million_triangles_without_area() {
    let count = 10_000_000;
    let flat = |extra: &[[u32; 3]]| {
        let mut indices = vec![[1, 1, 2]; count];
        indices.extend_from_slice(extra);
        of(vec![shape(mesh(corners(), indices))])
    };
    for backend in structured() {
        let s = on(backend, flat(&[[0, 1, 2]])).unwrap();
        assert_eq!((s.report.dropped.degenerate, s.report.triangles), (count as u64, 1));
        assert!(is_hit(&s, &ray(&s, DVec3::new(0.25, 0.25, 2.0), DOWN)), "{backend}");
        // Its number in the file.
        let mesh = &s.geometry.root().leaves[0].shape;
        assert_eq!(mesh.triangles().unwrap().source_ids, [count as u32]);
    }
    let nothing = on("auto", flat(&[])).err().unwrap();
    assert!(nothing.contains("10000000 primitives without area"), "{nothing}");
}

#[test]
fn groups_that_contain_themselves_are_named() {
    let mut scene = of(vec![placed("a", DAffine3::IDENTITY)]);
    scene.groups = vec![group("a", vec![placed("a", DAffine3::IDENTITY), shape(ball())])];
    let told = on("auto", scene).err().unwrap();
    assert!(told.contains("a group cannot contain itself: a > a"), "{told}");
}

/// Every group places the next, moved by one along x, down to a ball.
fn chain(depth: usize) -> SceneDesc {
    let step = DAffine3::from_translation(DVec3::X);
    let mut scene = of(vec![placed("g0", DAffine3::IDENTITY)]);
    for i in 0..depth {
        let last = i + 1 == depth;
        let next = if last { shape(ball()) } else { placed(&format!("g{}", i + 1), step) };
        scene.groups.push(group(&format!("g{i}"), vec![next]));
    }
    scene
}

#[test]
fn nesting_to_the_limit_and_past_it() {
    for k in KERNELS {
        let s = on(k.name, chain(DEEPEST)).unwrap();
        assert_eq!(s.geometry.depth(), DEEPEST + 1);
        let x = DEEPEST as f64 - 1.0;
        assert!(is_hit(&s, &ray(&s, DVec3::new(x, 0.5, 9.0), DOWN)), "{}", k.name);
        assert!(!is_hit(&s, &ray(&s, DVec3::new(x + 1.5, 0.0, 9.0), DOWN)), "{}", k.name);
        let refused = on(k.name, chain(DEEPEST + 1)).err().unwrap();
        assert!(refused.contains("nested deeper than 64"), "{refused}");
    }
}

/// Groups that place the next one twice, a third of its size, at both ends: Cantor's dust of balls.
fn dust(levels: usize, balls: usize) -> SceneDesc {
    let left = DAffine3::from_scale(DVec3::splat(1.0 / 3.0));
    let right = DAffine3::from_translation(DVec3::X * (2.0 / 3.0)) * left;
    let mut scene = of(vec![placed("g0", DAffine3::IDENTITY)]);
    for i in 0..levels {
        let below = format!("g{}", i + 1);
        scene.groups.push(group(&format!("g{i}"), vec![placed(&below, left), placed(&below, right)]));
    }
    scene.groups.push(group(&format!("g{levels}"), (0..balls).map(|_| shape(ball())).collect()));
    scene
}

#[test]
fn placements_without_number() {
    for backend in structured() {
        let s = on(backend, dust(30, 1)).unwrap();
        assert_eq!(s.report.paths, 1 << 30);
        // The middle third is empty.
        assert!(!is_hit(&s, &ray(&s, DVec3::new(0.5, 0.0, 9.0), DOWN)), "{backend}");
        assert!(s.kernel.memory() < 1 << 30, "{backend}: {} bytes", s.kernel.memory());
    }
    let refused = on("auto", dust(63, 2)).err().unwrap();
    assert!(refused.contains("2^64"), "{refused}");
}

#[test]
fn a_million_instances() {
    let side = 1000;
    let at = |i: u32| DVec3::new(f64::from(i % side), f64::from(i / side), 0.0) * 3.0;
    let mut scene = of((0..side * side).map(|i| placed("g", DAffine3::from_translation(at(i)))).collect());
    scene.groups = vec![group("g", vec![shape(ball())])];
    for backend in structured() {
        let s = on(backend, scene.clone()).unwrap();
        assert_eq!(s.report.paths, u64::from(side * side));
        for i in [0, 999, 123_456, 999_999] {
            let from = at(i) + DVec3::Z * 5.0;
            let r = ray(&s, from + DVec3::new(0.3, 0.2, 0.0), DOWN);
            assert!(is_hit(&s, &r), "{backend}");
            assert_eq!(s.kernel.intersect(&r).unwrap().path, u64::from(i), "{backend}");
            assert!(!is_hit(&s, &ray(&s, from + DVec3::new(1.5, 1.5, 0.0), DOWN)), "{backend}");
        }
    }
}
