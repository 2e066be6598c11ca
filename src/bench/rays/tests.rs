//! Rays are where they are said to be, files are read back or refused, and verdicts follow from figures.

use super::agree::{compare as differences, sample};
use super::file::{from_bytes, to_bytes};
use super::forms::{Answers, FORMS};
use super::growth::scene_of;
use super::kernels::{Built, Choice, KernelInfo};
use super::measure::{Bench, Setup, measure};
use super::peer::serve;
use super::present;
use super::record::{Cell, Differences, KIND, Record, Row, SceneInfo, VERSION, WorkloadInfo, median};
use super::sets::{
    BATCH, Points, RayKind, RaySets, WORKLOADS, bounce, camera_rays, count, grazing, seen_side, shadow,
};
use super::verdict::{Judgement, compare};
use crate::base::intersectable::{BuildQuality, KernelMode};
use crate::base::ray::{Coherence, Ray, RayBatch};
use crate::bench::Silent;
use crate::report::machine::Machine;
use crate::scene::Scene;
use crate::scene::build::{BuildOptions, build};
use glam::Vec3;

/// A knot of a few hundred triangles.
fn scene() -> Scene {
    build(scene_of("knot", 400).unwrap(), &BuildOptions::default()).unwrap()
}

fn rays(batches: &[RayBatch]) -> Vec<Ray> {
    batches.iter().flat_map(|b| (0..b.len()).map(|i| b.get(i))).collect()
}

fn sets(scene: &Scene) -> RaySets {
    RaySets::generate(scene, 5000).unwrap()
}

fn choice() -> Choice {
    Choice {
        backends: Vec::new(),
        forms: Vec::new(),
        modes: vec![KernelMode::Robust, KernelMode::Fast],
        levels: Vec::new(),
        quality: BuildQuality::Balanced,
        threads: 1,
    }
}

#[test]
fn sets_depend_on_the_scene_alone() {
    let scene = scene();
    let (a, b) = (sets(&scene), sets(&scene));
    assert_eq!(to_bytes(&a), to_bytes(&b));
    assert_eq!(a.digest(), b.digest());
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(one.install(|| sets(&scene).digest()), a.digest(), "whatever the threads");
    for kind in RayKind::ALL {
        // Where the sky shines from below the surface there is no shadow ray.
        let least = if kind == RayKind::Shadow { 2500 } else { 5000 };
        assert!((least..=5000).contains(&count(a.of(kind))), "{kind:?}: {}", count(a.of(kind)));
        assert!(a.of(kind).iter().all(|b| (1..=BATCH).contains(&b.len())));
        assert!(rays(a.of(kind)).iter().all(Ray::is_valid));
    }
    assert_ne!(RaySets::generate(&scene, 4999).unwrap().digest(), a.digest());
}

#[test]
fn camera_rays_come_in_tiles() {
    let all = camera_rays(&scene(), 80 * BATCH);
    assert_eq!(count(&all), 80 * BATCH);
    let first = &all[0];
    assert_eq!(first.len(), BATCH);
    let mean: Vec3 = (0..BATCH).map(|i| first.direction(i)).sum::<Vec3>().normalize();
    // 16 pixels of 1280 over an angle of view of some 60 degrees: less than a degree, and two with the filter's reach.
    let cos = 2f32.to_radians().cos();
    assert!((0..BATCH).all(|i| first.direction(i).dot(mean) > cos));
}

#[test]
fn what_leaves_a_surface_starts_on_it_and_goes_up() {
    let scene = scene();
    let points = Points::new(&scene, sets(&scene).of(RayKind::Camera));
    let size = scene.geometry.root().bounds.radius();
    let mut cosines = Vec::new();
    for i in 0..2000 {
        let v = points.vertex(i as usize);
        let n = seen_side(&v);
        assert!(n.dot(v.wo) >= 0.0, "the side that is seen");
        let made = [bounce(&v, &scene, i), shadow(&v, &scene, i), grazing(&v, &scene, i)];
        for (kind, r) in [RayKind::Bounce, RayKind::Shadow, RayKind::Grazing].into_iter().zip(made) {
            let Some(r) = r else { continue };
            // Beside what smooth shading lifts it by: the derived bound, about 1e-6 of a mesh.
            let outward = r.d.dot(v.ng) >= 0.0;
            let off = r.o - v.p - if outward { v.lift } else { Vec3::ZERO };
            assert!(off.length() < 1e-5 * size && off.dot(n) >= 0.0, "{kind:?} starts {off} from its point");
            let cos = r.d.dot(n) / r.d.length();
            // A direction in the tangent plane is off it by a rounding or two in f32.
            assert!(cos > if kind == RayKind::Grazing { -1e-6 } else { 0.0 }, "{kind:?} goes down by {cos}");
            match kind {
                RayKind::Grazing => assert!(cos < 1f32.to_radians().sin() + 1e-5, "grazing by {cos}"),
                RayKind::Bounce => cosines.push(f64::from(cos)),
                _ => assert_eq!(r.tfar, f32::INFINITY, "to the sky"),
            }
        }
    }
    // The mean cosine of a cosine distribution is 2/3, and its deviation 0.236: five of those over sqrt(2000).
    let mean = cosines.iter().sum::<f64>() / cosines.len() as f64;
    assert!(cosines.len() > 1990 && (mean - 2.0 / 3.0).abs() < 5.0 * 0.236 / 44.0, "{mean}");
}

#[test]
fn chords_cross_the_bounds() {
    let scene = scene();
    let bounds = scene.geometry.root().bounds;
    let all = rays(sets(&scene).of(RayKind::Chord));
    let around = bounds.padded(0.1001 * bounds.radius());
    assert!(all.iter().all(|r| around.contains(r.o) && (r.d.length() - 1.0).abs() < 1e-5));
    let outside = all.iter().filter(|r| !bounds.contains(r.o)).count();
    assert!(outside > 0, "the bounds are enlarged");
}

#[test]
fn files_are_read_back_or_refused() {
    let sets = sets(&scene());
    let bytes = to_bytes(&sets);
    let back = from_bytes(&bytes).unwrap();
    assert_eq!(back.scene, sets.scene);
    assert_eq!(to_bytes(&back), bytes);
    let refused = |bytes: &[u8], word: &str| {
        let e = from_bytes(bytes).map(|_| ()).unwrap_err();
        assert!(e.contains(word), "wanted {word:?} in {e:?}");
    };
    refused(b"", "SKYLRAYS");
    refused(b"PLY", "SKYLRAYS");
    for n in [8, 11, 40, 60, 100, bytes.len() - 1] {
        refused(&bytes[..n], "ends before");
    }
    let changed = |at: usize, value: u32| {
        let mut b = bytes.clone();
        b[at..at + 4].copy_from_slice(&value.to_le_bytes());
        b
    };
    refused(&changed(8, 9), "version 9");
    refused(&changed(52, 4), "4 sets");
    refused(&changed(56, 3), "kind 3");
    // More batches, or longer ones, than there are bytes: refused before anything is allocated for them.
    refused(&changed(60, u32::MAX), "ends before");
    refused(&changed(64, u32::MAX), "batch");
    refused(&changed(64, 0), "batch");
    refused(&changed(64, 65_536), "ends before");
    let first_ray = 64 + 4 * sets.of(RayKind::Camera).len();
    refused(&changed(first_ray, f32::NAN.to_bits()), "ray 0 of camera is not valid");
    refused(&[bytes.as_slice(), &[0]].concat(), "1 bytes stand behind");
}

#[test]
fn rays_of_another_scene_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("rays");
    let sets = sets(&scene());
    super::file::save(&path, &sets).unwrap();
    assert_eq!(super::file::load(&path, &sets.scene).unwrap().digest(), sets.digest());
    let other = super::sets::SceneKey { triangles: 1, ..sets.scene };
    let e = super::file::load(&path, &other).unwrap_err();
    assert!(e.exit_code() == 2 && e.to_string().contains("another scene"), "{e}");
}

#[test]
fn every_form_of_every_kernel_gives_the_answers_of_the_first() {
    let scene = scene();
    let sets = sets(&scene);
    let variants = choice().variants().unwrap();
    for work in WORKLOADS {
        let mut hits = Vec::new();
        for v in &variants {
            let built = Built::new(v, &scene.geometry).unwrap();
            for form in FORMS.iter().filter(|f| f.fits(&built, work)) {
                let mut pass = form.lay_out(&built, sets.of(work.kind), work).expect("tame rays");
                let answers = pass.answers();
                assert_eq!(answers.prim.len(), count(sets.of(work.kind)));
                hits.push((format!("{} {}", built.info.name, form.name), answers));
            }
        }
        let (_, first) = hits.first().expect("some kernel");
        assert!(first.hits() > 0 || work.kind == RayKind::Shadow, "{}", work.name);
        for (name, answers) in &hits {
            // Edges met exactly are decided differently by single and packet code: a few in ten thousand.
            let d = differences(first, answers);
            assert!(d.total() <= 10, "{name}, {}: {d:?}", work.name);
        }
    }
}

#[test]
fn packets_that_are_not_full_are_answered_too() {
    let scene = scene();
    let all = rays(sets(&scene).of(RayKind::Chord));
    let mut odd = RayBatch::default();
    all.iter().take(37).for_each(|r| odd.push(r));
    let batches = [odd.clone(), RayBatch::default(), odd];
    let work = WORKLOADS.iter().find(|w| w.name == "chords").unwrap();
    for v in &choice().variants().unwrap() {
        let built = Built::new(v, &scene.geometry).unwrap();
        for form in FORMS.iter().filter(|f| f.fits(&built, work)) {
            let answers = form.lay_out(&built, &batches, work).unwrap().answers();
            assert_eq!(answers.prim.len(), 74, "{}", form.name);
            assert_eq!(answers.prim[..37], answers.prim[37..], "{}", form.name);
        }
    }
    assert_eq!(work.coherence, Coherence::Incoherent);
}

#[test]
fn samples_are_spread() {
    assert_eq!(sample(10, 3), [0, 3, 6]);
    assert_eq!(sample(2, 5), [0, 1]);
    assert!(sample(0, 5).is_empty());
}

#[test]
fn differences_are_counted_by_kind() {
    let answers = |list: &[Option<(u32, u64)>]| {
        let mut a = Answers::default();
        list.iter().for_each(|x| a.push(*x));
        a
    };
    let a = answers(&[None, Some((1, 0)), Some((1, 0)), Some((1, 0)), None]);
    let b = answers(&[None, Some((1, 0)), Some((2, 0)), Some((1, 7)), Some((1, 0))]);
    assert_eq!(differences(&a, &b), Differences { hit: 1, primitive: 2 });
    assert_eq!(differences(&a, &answers(&[])).hit, 5, "answers that are not there");
}

#[test]
fn a_measurement_is_whole() {
    let scene = scene();
    let sets = RaySets::generate(&scene, 600).unwrap();
    let choice = choice();
    let setup = Setup {
        input: "a,\"knot\"".into(),
        scene: &scene,
        sets: &sets,
        choice: &choice,
        rounds: 2,
        threads: 2,
        reference: None,
    };
    let bench = Bench::new(&setup, &Silent).unwrap();
    let record = measure(&bench, None, &Silent).unwrap();
    assert_eq!(record.workloads.len(), WORKLOADS.len());
    let reference = &record.rows[record.reference];
    for cell in reference.cells.iter().flatten() {
        assert!(
            cell.mrays > 0.0 && cell.min <= cell.mrays && cell.mrays <= cell.max && cell.seconds.len() == 2
        );
        assert_eq!((cell.ratio, cell.differs), (Some(1.0), Differences::default()));
    }
    let back: Record = serde_json::from_str(&record.to_json().unwrap()).unwrap();
    assert_eq!(back.rows.len(), record.rows.len());
    let lines: Vec<String> = present::csv(std::slice::from_ref(&record)).lines().map(str::to_owned).collect();
    let cells: usize = record.rows.iter().map(|r| r.cells.iter().flatten().count()).sum();
    assert_eq!(lines.len(), 1 + cells);
    assert!(lines[1].starts_with("\"a,\"\"knot\"\"\","), "{}", lines[1]);
    assert!(present::text(&record).contains("Mrays/s"));
    let page = present::page(&record, Some(&compare(&record, &record).unwrap())).to_html().unwrap();
    assert!(page.contains("within noise"));
    let unknown = Setup { reference: Some("embree robust singel".into()), ..setup };
    let bench = Bench::new(&unknown, &Silent).unwrap();
    assert!(measure(&bench, None, &Silent).unwrap_err().to_string().contains("unknown row"));
}

#[test]
fn a_worker_answers_a_line_for_a_line() {
    let scene = scene();
    let sets = RaySets::generate(&scene, 300).unwrap();
    let choice = choice();
    let setup = Setup {
        input: String::new(),
        scene: &scene,
        sets: &sets,
        choice: &choice,
        rounds: 1,
        threads: 1,
        reference: None,
    };
    let bench = Bench::new(&setup, &Silent).unwrap();
    let asked = concat!(
        r#"{"ask":"run","row":0,"workload":"camera"}"#,
        "\n",
        r#"{"ask":"run","row":0,"workload":"tea"}"#,
        "\nhello\n",
        r#"{"ask":"run","row":9999,"workload":"camera"}"#,
        "\n"
    );
    let mut said = Vec::new();
    serve(&bench, asked.as_bytes(), &mut said).unwrap();
    let lines: Vec<serde_json::Value> =
        String::from_utf8(said).unwrap().lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    assert_eq!(lines.len(), 5);
    assert_eq!(lines[0]["protocol"], 1);
    assert!(lines[1]["seconds"].as_f64().is_some_and(|s| s > 0.0));
    assert!(lines[2]["error"].as_str().unwrap().contains("unknown workload"));
    assert!(lines[3]["error"].is_string());
    assert!(lines[4]["seconds"].is_null() && lines[4]["error"].is_null(), "there is no such row");
}

/// A record of one row and one workload: rounds in Mrays/s.
fn made_up(speeds: &[f64]) -> Record {
    let info = KernelInfo {
        name: "embree 9 robust".into(),
        backend: "embree".into(),
        mode: "robust".into(),
        simd: None,
        quality: "balanced".into(),
        peer: false,
        build_seconds: 1.0,
        builds: 1,
        memory: 1,
        predicted: None,
    };
    let seconds = speeds.iter().map(|s| 1.0 / s).collect();
    let cell = Cell::new(1_000_000, seconds);
    let scene = SceneInfo {
        input: "x".into(),
        triangles: 1,
        procedurals: 0,
        placed_primitives: 1,
        geometry_bytes: 1,
    };
    let work =
        WorkloadInfo { name: "camera".into(), doc: String::new(), rays: 1, hit_part: 0.0, oracle_rays: 0 };
    Record {
        kind: KIND.into(),
        version: VERSION,
        machine: Machine::here(),
        peer: None,
        threads: 1,
        rounds: speeds.len(),
        scene,
        rays: "0".into(),
        workloads: vec![work],
        kernels: vec![info],
        reference: 0,
        rows: vec![Row { kernel: 0, form: "single".into(), cells: vec![Some(cell)] }],
        visits: Vec::new(),
    }
}

#[test]
fn slower_beyond_noise_is_what_counts() {
    let judge = |old: &[f64], new: &[f64]| {
        let c = compare(&made_up(old), &made_up(new)).unwrap();
        assert_eq!(c.passed(), c.changes[0].judgement != Judgement::Slower);
        c.changes[0].judgement
    };
    let steady = [10.0, 10.1, 9.9, 10.0, 10.05];
    assert_eq!(judge(&steady, &steady), Judgement::Same);
    assert_eq!(judge(&steady, &steady.map(|s| s * 0.8)), Judgement::Slower);
    assert_eq!(judge(&steady, &steady.map(|s| s * 1.2)), Judgement::Faster);
    // Beyond noise, but by less than 5 %.
    assert_eq!(judge(&[10.0; 5], &[9.6; 5]), Judgement::Same);
    assert_eq!(judge(&[10.0; 5], &[9.4; 5]), Judgement::Slower);
    // By 20 %, but within noise: a deviation of 1.5 is a spread of 2.2 each, and three combined ones are 9.4.
    let noisy = [8.5, 10.0, 11.5, 8.0, 12.0];
    assert_eq!(judge(&noisy, &noisy.map(|s| s * 0.8)), Judgement::Same);
    // One disturbed round changes nothing.
    assert_eq!(judge(&steady, &[10.0, 10.1, 2.0, 10.0, 10.05]), Judgement::Same);
}

#[test]
fn records_that_cannot_be_compared_are_refused() {
    let (a, mut b) = (made_up(&[1.0; 5]), made_up(&[1.0; 5]));
    b.scene.triangles = 2;
    assert!(compare(&a, &b).unwrap_err().to_string().contains("another scene"));
    let mut c = made_up(&[1.0; 5]);
    c.rows[0].form = "batch".into();
    assert!(compare(&a, &c).unwrap_err().to_string().contains("no row in common"));
    let mut d = made_up(&[1.0; 5]);
    d.threads = 7;
    let caveats = compare(&a, &d).unwrap().caveats;
    assert_eq!(caveats, ["threads: 1 then, 7 now"]);
    let hasty = compare(&a, &made_up(&[1.0; 2])).unwrap().caveats;
    assert!(hasty.len() == 1 && hasty[0].contains("2 rounds"), "{hasty:?}");
}

#[test]
fn medians_are_in_the_middle() {
    assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
    assert_eq!(median(vec![4.0, 1.0, 2.0, 3.0]), 2.5);
    assert_eq!(median(Vec::new()), 0.0);
}
