//! Kernels that are wrong on purpose are found, named and located; what rounding explains is not held against anyone.

mod judging;
mod kernels;

use super::judge::{Class, Fault};
use super::locate::RayKind;
use super::summary::Summary;
use super::*;
use crate::accel::KERNELS;
use crate::accel::brute::Brute;
use crate::base::intersectable::{Intersectable, KernelOptions};
use crate::integrators::path::PathTracer;
use crate::sampler::Sampler;
use crate::sampler::{SHADOW_KEY, ray_key};
use crate::scene::build::{BuildOptions, build};
use kernels::{Faulty, Flaw};

/// A rock, a ball and a mirrored rock in a group, on a floor: 24 x 16 pixels.
const SCENE: &str = r#"
[film]
size = [24, 16]
[camera]
type = "perspective"
eye = [0, 1.5, 7]
look_at = [0, 0.3, 0]
fov_deg = 40.0
[sky]
type = "gradient"
[materials.clay]
type = "diffuse"
albedo = 0.8
[groups.rock]
objects = [{ shape = { type = "displaced_sphere", triangles = 300, seed = 4 }, material = "clay" }]
[[objects]]
group = "rock"
transform = [{ scale = [-1, 0.8, 1] }, { rotate_deg = 30, axis = [1, 1, 0] }, { translate = [-1.3, 0.8, 0] }]
[[objects]]
name = "ball"
shape = { type = "sphere", center = [1.2, 0.9, 0], radius = 0.9 }
material = "clay"
[[objects]]
name = "floor"
shape = { type = "box", min = [-4, -0.2, -4], max = [4, 0, 4] }
material = "clay"
"#;

pub(super) fn scene_of(toml: &str) -> Scene {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("scene.toml");
    std::fs::write(&path, toml).unwrap();
    let desc = crate::formats::load(&path).unwrap_or_else(|e| panic!("{e}"));
    build(desc, &BuildOptions { backend: "brute".into(), ..BuildOptions::default() }).unwrap()
}

fn contender(name: &str, kernel: impl Intersectable + 'static) -> Contender {
    Contender { name: name.into(), kernel: Arc::new(kernel) }
}

fn plan(scene: &Scene, contenders: Vec<Contender>) -> Plan {
    let integrator = PathTracer { max_depth: 3, ..PathTracer::default() };
    let usual = RenderSettings::new([scene.film.width, scene.film.height]);
    let settings = RenderSettings { spp: 4, threads: 2, moments: true, sampler: Sampler::OwenSobol, ..usual };
    Plan { contenders, integrator: Arc::new(integrator), settings, oracle_tests: 1 << 28 }
}

fn check(scene: &mut Scene, contenders: Vec<Contender>) -> Crosscheck {
    let plan = plan(scene, contenders);
    run(scene, &plan, &Silent).unwrap()
}

/// The oracle against a copy of itself with a flaw.
fn check_flaw(flaw: Flaw) -> Crosscheck {
    check_flaw_with(flaw, 4)
}

fn check_flaw_with(flaw: Flaw, spp: u32) -> Crosscheck {
    let mut scene = scene_of(SCENE);
    let oracle = || Brute::new(scene.geometry.clone());
    let contenders = vec![contender("good", oracle()), contender("bad", Faulty::new(oracle(), flaw))];
    let mut plan = plan(&scene, contenders);
    plan.settings.spp = spp;
    run(&mut scene, &plan, &Silent).unwrap()
}

/// That the first kernel is always right, and how often the second is wrong in which way, single and batch together.
fn wrong(c: &Crosscheck, fault: Fault) -> u64 {
    assert!(c.tally.scores[..2].iter().all(|s| s.wrong_total() == 0), "{:?}", c.tally);
    let at = Fault::ALL.iter().position(|f| *f == fault).unwrap();
    c.tally.scores[2..].iter().map(|s| s.wrong[at]).sum()
}

fn differences_of(c: &Crosscheck, class: Class) -> u64 {
    let at = Class::ALL.iter().position(|k| *k == class).unwrap();
    c.tally.classes[at][1]
}

#[test]
fn a_kernel_agrees_with_itself_and_every_ray_is_compared() {
    let mut scene = scene_of(SCENE);
    let oracle = || Brute::new(scene.geometry.clone());
    let contenders = vec![contender("a", oracle()), contender("b", oracle())];
    let c = check(&mut scene, contenders);
    assert!(c.passed() && c.tally.differences() == 0, "{:?}", c.tally);
    assert_eq!(c.compared, c.rays.total());
    assert_eq!(c.rays.camera, 24 * 16 * 4);
    assert!(c.rays.scattered > 200 && c.rays.shadow > 50, "{:?}", c.rays);
    assert!(c.pictures.against_first[0].pixels.is_empty());
    assert_eq!(scene.kernel.describe(), "brute", "the scene has its kernel back");
}

/// All kernels of this build, the oracle among them: what differs is explained, and the oracle is never wrong.
#[test]
fn the_kernels_of_this_build_pass() {
    let mut scene = scene_of(SCENE);
    let build = |k: &crate::accel::KernelRow| {
        let kernel = (k.build)(scene.geometry.clone(), &KernelOptions::default()).unwrap();
        Contender { name: k.name.into(), kernel: Arc::from(kernel) }
    };
    let contenders = KERNELS.iter().map(build).collect();
    let c = check(&mut scene, contenders);
    assert!(c.passed(), "{}", Summary::new(&c, &scene, "skylit"));
}

#[test]
fn a_shifted_distance_is_found_in_either_style() {
    for (flaw, styles) in [(Flaw::Shift { batch_only: false }, 2), (Flaw::Shift { batch_only: true }, 1)] {
        let c = check_flaw(flaw);
        assert!(!c.passed());
        let bad = differences_of(&c, Class::Distance);
        assert!(bad > 100 && wrong(&c, Fault::Distance) == styles * bad, "{:?}", c.tally);
        assert_eq!(c.tally.unexplained(), bad);
        // The point is computed from the primitive: a wrong t alone changes no picture of meshes and spheres.
        assert!(c.pictures.against_first[0].pixels.is_empty());
    }
}

#[test]
fn a_dropped_primitive_is_found() {
    // Few rays pass nothing but what was dropped: the rocks are closed.
    let c = check_flaw_with(Flaw::Drop, 32);
    assert!(
        differences_of(&c, Class::OtherPrimitive) > 0 && wrong(&c, Fault::PassesOver) > 0,
        "{:?}",
        c.tally
    );
    assert!(differences_of(&c, Class::MissAgainstHit) > 0 && wrong(&c, Fault::Misses) > 0, "{:?}", c.tally);
    assert!(differences_of(&c, Class::Occlusion) > 0);
    assert_eq!((wrong(&c, Fault::Distance), wrong(&c, Fault::MeetsNothing)), (0, 0));
    // Every pixel that looks different is one in which a ray was answered differently.
    let p = &c.pictures.against_first[0];
    assert!(!p.pixels.is_empty() && p.unexplained.is_empty());
    assert!(p.pixels.iter().all(|x| c.pictures.marked.contains(x)));
}

#[test]
fn a_swapped_name_is_found() {
    let c = check_flaw(Flaw::Swap);
    assert!(differences_of(&c, Class::OtherPrimitive) > 0);
    assert!(wrong(&c, Fault::MeetsNothing) + wrong(&c, Fault::Distance) > 0, "{:?}", c.tally);
}

/// Leaks of one pixel alone: all that is reported lies in it, with its sample, depth and kind, and the pictures differ
/// nowhere else.
#[test]
fn leaks_are_located() {
    const PIXEL: [u32; 2] = [6, 9];
    let mut keys = HashSet::new();
    for (r, index, depth) in (0..2).flat_map(|r| (0..2).flat_map(move |i| (1..6).map(move |d| (r, i, d)))) {
        let key = ray_key(ray_key(PIXEL[0], PIXEL[1], r), index, depth);
        keys.extend([key, key ^ SHADOW_KEY]);
    }
    let c = check_flaw(Flaw::Leak(keys));
    assert!(wrong(&c, Fault::Misses) > 0 && !c.passed(), "{:?}", c.tally);
    let sources: Vec<Source> = c.differences.iter().map(|d| d.source.expect("found")).collect();
    assert!(sources.iter().all(|s| s.pixel == PIXEL && s.sample < 4), "{sources:?}");
    for kind in [RayKind::Camera, RayKind::Bounce, RayKind::Shadow] {
        assert!(sources.iter().any(|s| s.kind == kind), "{kind:?} in {sources:?}");
    }
    assert_eq!(c.pictures.marked, [PIXEL]);
    assert_eq!(c.pictures.against_first[0].pixels, [PIXEL]);
    // The oracle looked at everything for each of them.
    assert_eq!(c.tally.complete, c.tally.differences());
}

/// Nothing depends on the threads, and a record can be written.
#[test]
fn results_are_the_same_from_any_number_of_threads_and_can_be_told() {
    let mut scene = scene_of(SCENE);
    let text = [1, 3].map(|threads| {
        let oracle = || Brute::new(scene.geometry.clone());
        let bad = Faulty::new(oracle(), Flaw::Drop);
        let mut plan = plan(&scene, vec![contender("good", oracle()), contender("bad", bad)]);
        plan.settings.threads = threads;
        let c = run(&mut scene, &plan, &Silent).unwrap();
        let summary = Summary::new(&c, &scene, "skylit crosscheck scene.toml");
        let page = html::page(&c, &summary, &crate::report::machine::Machine::here(), "scene.toml").unwrap();
        assert!(page.contains("data-viewer") && page.contains("misses what must be met"));
        (summary.to_string(), serde_json::to_string(&summary).unwrap())
    });
    assert_eq!(text[0], text[1]);
    let (words, _) = &text[0];
    assert!(
        words.contains("NOT EXPLAINED") && words.contains("skylit crosscheck scene.toml --ray "),
        "{words}"
    );
    assert!(words.contains("pixel ") && words.contains("verdict"), "{words}");
}

/// A kernel that no callback of a ray tells of fails the pictures.
#[test]
fn a_picture_that_differs_where_no_ray_does_fails() {
    let scene = scene_of(SCENE);
    let a = Film::new(24, 16, PixelRect::of_size(24, 16));
    let mut b = Film::new(24, 16, PixelRect::of_size(24, 16));
    let plan = plan(&scene, Vec::new());
    let job = Job::new(&scene, plan.integrator.as_ref(), &plan.settings);
    let mut worker = Worker::new(&plan.settings);
    worker.render_tile(&job, PixelRect::new(0, 0, 16, 16), 0..1);
    b.add_tile(&worker.film);
    let p = PictureCheck::new(&["a".into(), "b".into()], vec![a, b], &HashSet::from([[3, 3]]));
    assert_eq!((p.against_first[0].pixels.len(), p.unexplained()), (256, 255));
}
