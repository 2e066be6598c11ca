use super::analyse::{Curve, speed_up};
use super::measure::{Errors, PixelSet, Sets, Truth};
use super::record::{FORMAT, Point, Record, ReferenceRecord, Run, SceneRecord, Series};
use super::run::{Plan, TruthPlan, measure};
use super::sweep::{Subject, Sweep, combinations, truth_settings};
use crate::bench::Silent;
use crate::compare::metrics::EPSILON;
use crate::render::settings::RenderSettings;
use crate::scene::build::BuildOptions;

fn reference(noise: f64) -> ReferenceRecord {
    let noise = super::measure::Noise { mse: noise, relmse: noise };
    ReferenceRecord {
        spp: 4096,
        luminance: 1.0,
        surfaces: 0.5,
        noise: Some(Sets { all: noise, surfaces: noise }),
    }
}

/// A method with squared error `error / spp^slope` and time `time * spp`, in runs that scatter by a factor.
fn series(error: f64, slope: f64, time: f64) -> Series {
    let run = |spp: f64, k: u64| {
        let scatter = 1.0 + 0.1 * (k as f64 - 3.5) / 3.5;
        let relmse = error * spp.powf(-slope) * scatter;
        let e = Errors { mse: relmse, relmse, bias: 1e-3 * (k as f64 - 3.5) };
        Run { seconds: time * spp, rays: None, errors: Sets { all: e, surfaces: e } }
    };
    let point = |spp: u64| Point { spp, runs: (0..8).map(|k| run(spp as f64, k)).collect() };
    let points = [4, 16, 64, 256].map(point).into();
    Series {
        name: format!("{error} {slope} {time}"),
        program: "p".into(),
        settings: Default::default(),
        points,
    }
}

#[test]
fn slopes_times_and_speed_ups_are_those_of_power_laws() {
    let (truth, set) = (reference(0.0), PixelSet::All);
    let (slow, fast) = (series(0.4, 1.0, 0.01), series(0.1, 1.0, 0.02));
    let [slow, fast] = [&slow, &fast].map(|s| Curve::new(s, &truth, set));
    assert!((slow.slope() + 1.0).abs() < 1e-9);
    // relMSE 0.4 / spp = 0.05^2 at 160 samples, 1.6 s.
    let reach = slow.time_to(0.05).unwrap();
    assert!((reach.seconds / 1.6 - 1.0).abs() < 1e-9 && !reach.beyond);
    assert!(slow.time_to(0.01).unwrap().beyond);
    // A quarter of the error at twice the time per sample.
    let gain = speed_up(&slow, &fast).unwrap();
    assert!((gain.ratio.value - 2.0).abs() < 1e-9 && !gain.beyond);
    assert!(gain.ratio.low < 2.0 && 2.0 < gain.ratio.high && gain.ratio.low > 1.5, "{gain:?}");
}

#[test]
fn the_references_noise_is_taken_off_and_bias_has_an_honest_interval() {
    let s = series(0.4, 1.0, 0.01);
    let noisy = reference(1e-3);
    let e = Curve::new(&s, &noisy, PixelSet::Surfaces).estimates();
    // 0.4 / 256 = 1.5625e-3, of which 1e-3 is the reference's.
    assert!((e[3].relmse.value - 0.5625e-3).abs() < 1e-12, "{:?}", e[3]);
    assert!(e[3].bias.low < 0.0 && 0.0 < e[3].bias.high && e[3].bias.value.abs() < 1e-12);
}

#[test]
fn errors_are_means_over_pixels_and_channels() {
    let truth = Truth { rgb: vec![[1.0; 3], [3.0; 3]], alpha: vec![1.0, 0.0], variance: None };
    let test = Truth { rgb: vec![[1.5; 3], [3.0, 3.0, 2.0]], ..truth.clone() };
    let e = truth.errors(&test);
    let floor = EPSILON * 4.0;
    assert!((e.all.mse - (3.0 * 0.25 + 1.0) / 6.0).abs() < 1e-12);
    assert!((e.all.relmse - (3.0 * 0.25 / (1.0 + floor) + 1.0 / (9.0 + floor)) / 6.0).abs() < 1e-12);
    assert!((e.surfaces.mse - 0.25).abs() < 1e-12 && (e.surfaces.bias - 0.5).abs() < 1e-6);
    assert_eq!(truth.noise(), None);
    // Black against black is right, however it is scaled.
    let black = Truth { rgb: vec![[0.0; 3]; 2], ..truth };
    assert_eq!(black.errors(&black).all, Errors::default());
}

#[test]
fn sweeps_are_every_combination_of_values() {
    let sweep = |s: &str| s.parse::<Sweep>();
    let all = combinations(&[sweep("a=1,2").unwrap(), sweep("b=x,y,z").unwrap()]).unwrap();
    assert_eq!(all.len(), 6);
    assert!(combinations(&[sweep("a=1").unwrap(), sweep("a=2").unwrap()]).is_err());
    for bad in ["a", "=1", "a=", "a=1,,2", "a=1,1"] {
        assert!(sweep(bad).is_err(), "{bad}");
    }
    let variants = |s: &str| combinations(&[s.parse().unwrap()]).unwrap();
    assert_eq!(truth_settings(&variants("max_depth=2")).unwrap().len(), 1);
    assert_eq!(truth_settings(&variants("sampler=independent,owen-sobol")).unwrap().len(), 0);
    assert!(truth_settings(&variants("integrator=path,direct")).is_err());
    let many = "k=".to_owned() + &(0..65).map(|i| i.to_string()).collect::<Vec<_>>().join(",");
    assert!(combinations(&[sweep(&many).unwrap()]).unwrap_err().to_string().contains("64"));
}

const SCENE: &str = r#"
[film]
size = [24, 16]
[camera]
type = "perspective"
eye = [0, 1, 4]
[sky]
type = "gradient"
[[objects]]
shape = { type = "sphere" }
"#;

fn subject() -> Subject {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball.toml");
    std::fs::write(&path, SCENE).unwrap();
    let desc = crate::formats::load(&path).unwrap();
    let mut settings = RenderSettings::of_scene(&desc).unwrap();
    settings.threads = 1;
    let options = BuildOptions { backend: "brute".into(), ..BuildOptions::default() };
    Subject { desc, settings, options }
}

#[test]
fn settings_are_set_by_name_and_refused_with_what_is_known() {
    let mut s = subject();
    for (key, value) in [
        ("sampler", "independent"),
        ("filter", "box"),
        ("integrator", "direct"),
        ("mis", "false"),
        ("sky-sampling", "table"),
        ("light-sampler", "power"),
        ("backend", "brute"),
        ("kernel-mode", "fast"),
        ("build", "best"),
        ("each_light", "true"),
    ] {
        // `mis` belongs to `path`.
        assert_eq!(s.set(key, value).is_err(), key == "mis", "{key}");
    }
    assert!(s.integrator().is_ok());
    for (key, value, word) in [
        ("nothing", "1", "sampler"),
        ("sampler", "x", "independent"),
        ("backend", "x", "brute"),
        ("sky-sampling", "x", "cosine"),
        ("each_light", "maybe", "true or false"),
    ] {
        let e = s.set(key, value).unwrap_err().to_string();
        assert!(e.contains(word), "{key}: {e}");
    }
    s.desc.sky = None;
    assert!(s.set("sky-sampling", "table").unwrap_err().to_string().contains("no sky"));
}

#[test]
fn a_small_scene_is_measured_honestly() {
    let plan = Plan {
        name: "ball".into(),
        subject: subject(),
        variants: combinations(&["sampler=independent,owen-sobol".parse().unwrap()]).unwrap(),
        ladder: vec![2, 8, 32],
        replicates: 8,
        truth: TruthPlan::Rendered { spp: 2048, kept: None },
    };
    let m = measure(&plan, &Silent).unwrap();
    assert_eq!((m.films.len(), m.films[0].len()), (2, 3));
    let record = Record {
        format: FORMAT.into(),
        program: "test".into(),
        command: Vec::new(),
        machine: serde_json::Value::Null,
        scenes: vec![m.record],
    };
    // Through JSON and back, as --with reads it.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("record.json");
    std::fs::write(&path, record.to_json().unwrap()).unwrap();
    assert_eq!(Record::load(&path).unwrap(), record);
    assert_eq!(record.to_csv().lines().count(), 1 + 2 * 3 * 8);
    let scene = &record.scenes[0];
    let curve = |s: usize| Curve::new(&scene.series[s], &scene.reference, PixelSet::All);
    // Independent samples: the squared error falls as 1 / n. 8 runs of 384 pixels leave some percent of scatter.
    let slope = curve(0).slope();
    assert!((slope + 1.0).abs() < 0.15, "{slope}");
    // Scrambled nets are never worse, and fall faster.
    assert!(curve(1).slope() < slope, "{}", curve(1).slope());
    for s in 0..2 {
        for e in curve(s).estimates() {
            // 95 % intervals: six of them, of which one may miss by chance; twice as wide none does.
            let half = e.bias.high - e.bias.value;
            assert!(e.bias.value.abs() < 2.0 * half, "{e:?}");
        }
    }
    let text = super::present::text(&[&record], PixelSet::All);
    assert!(text.contains("sampler=owen-sobol") && text.contains("speed-up"));
    let page = super::present::page(&[&record], PixelSet::All, Vec::new(), crate::report::Report::new("t"));
    assert!(page.to_html().unwrap().contains("error against time"));
}

#[test]
fn records_that_are_none_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("r.json");
    let scene = SceneRecord {
        name: "s".into(),
        size: [1, 1],
        epsilon: EPSILON,
        reference: reference(0.0),
        series: vec![Series { points: vec![Point { spp: 1, runs: Vec::new() }], ..series(1.0, 1.0, 1.0) }],
    };
    let record = |format: &str| Record {
        format: format.into(),
        program: String::new(),
        command: Vec::new(),
        machine: serde_json::Value::Null,
        scenes: vec![scene.clone()],
    };
    for (text, word) in [
        ("{}".to_owned(), "no record"),
        (record("other 2").to_json().unwrap(), "other 2"),
        (record(FORMAT).to_json().unwrap(), "without usable runs"),
    ] {
        std::fs::write(&path, text).unwrap();
        let e = Record::load(&path).unwrap_err().to_string();
        assert!(e.contains(word), "{e}");
    }
    assert!(Record::load(&folder.path().join("none.json")).is_err());
}
