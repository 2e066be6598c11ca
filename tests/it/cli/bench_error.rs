//! `bench error`, and the flags whose worth it measures.

use super::folder::Folder;

#[test]
fn error_is_measured_against_time_and_kept() {
    let f = Folder::new();
    let command = "bench error scene.toml --size 24x16 --spp 2,4 --replicates 2 --reference-spp 64 -L \
                   sampler=owen-sobol,independent --json r.json --csv r.csv --svg r.svg --html r.html";
    let run = f.run(command).succeeds();
    for word in ["reference: 64 samples", "sampler=independent", "relMSE", "slope", "speed-up"] {
        assert!(run.stdout.contains(word), "{word}: {}", run.stdout);
    }
    let record = f.json("r.json");
    let series = &record["scenes"][0]["series"];
    assert_eq!(series.as_array().map(Vec::len), Some(2));
    assert_eq!(series[0]["points"][1]["runs"].as_array().map(Vec::len), Some(2));
    // With what it kept, a record of its own stands beside itself.
    let again = f.run(&format!("{command} --with r.json")).succeeds();
    let rows = |text: &str| text.lines().filter(|l| l.starts_with("sampler=independent")).count();
    assert_eq!(rows(&again.stdout), 2 * (2 + 1));
    // A record in a scene's place is shown without being measured; with another, times to the same error are compared.
    let shown = f.run("bench error r.json --with r.json --svg s.svg --html s.html").succeeds();
    assert_eq!(rows(&shown.stdout), 2 * (2 + 1));
    let (_, compared) = shown.stdout.split_once("times as long to the same error").unwrap();
    // Below the heading.
    let scene = compared.lines().filter(|l| l.starts_with("scene ")).nth(1).unwrap();
    let mean = compared.lines().find(|l| l.starts_with("geometric mean")).unwrap();
    // The same curves: of the best settings it takes no longer than of the first.
    for line in [scene, mean] {
        assert!(line.split_whitespace().last().unwrap().parse::<f64>().unwrap() <= 1.0, "{line}");
    }
    f.refuses("bench error r.json scene.toml", 2, &["as it is", "--with"]);
    let files = std::fs::read_dir(f.path().join("r.references")).unwrap().count();
    assert_eq!(files, 1);
    let read = |name: &str| std::fs::read_to_string(f.path().join(name)).unwrap();
    assert!(read("r.svg").starts_with("<svg") && read("r.html").contains("data-viewer"));
    assert_eq!(read("r.csv").lines().count(), 1 + 2 * 2 * 2);
}

#[test]
fn what_cannot_be_measured_is_refused() {
    let f = Folder::new();
    std::fs::write(f.path().join("no.json"), "{}").unwrap();
    for (flags, words) in [
        ("-L sampler=x", &["sampler", "independent"][..]),
        ("-L nothing=1", &["nothing", "sky-sampling"]),
        ("-L sampler", &["KEY=VALUE"]),
        ("-L integrator=path,direct", &["one value"]),
        ("-L strategy=x", &["strategy", "auto"]),
        ("--spp 4,2", &["rising"]),
        ("--replicates 1", &["--replicates"]),
        ("--with no.json", &["no.json", "no record"]),
        ("--reference none.exr", &["none.exr"]),
    ] {
        let code = if flags.contains("none.exr") { 3 } else { 2 };
        f.refuses(&format!("bench error scene.toml --size 24x16 {flags}"), code, words);
    }
}

#[test]
fn pixels_of_sky_alone_are_skipped_and_counted() {
    let f = Folder::new();
    let render = |flags: &str| {
        let command =
            format!("render scene.toml --size 64x48 --spp 64 --dealing even -o a.exr --stats s.json {flags}");
        f.run(&command).succeeds();
        f.json("s.json")
    };
    let (skipped, sampled) = (render(""), render("--sky-pixels sample"));
    assert_eq!(skipped["samples"], sampled["samples"]);
    let spared = skipped["skipped"]["samples"].as_u64().unwrap();
    let camera = |s: &serde_json::Value| s["rays"]["camera"].as_u64().unwrap();
    assert_eq!(sampled["skipped"]["samples"], 0);
    // The pilot's rays are the same in both.
    assert_eq!(camera(&skipped) + spared, camera(&sampled));
    f.refuses("render scene.toml -o a.png --sky-pixels trace", 2, &["--sky-pixels", "integrate"]);
}

/// All of a camera ray a sample, and from a surface point of a scattered ray and a shadow ray to each light that is to be
/// sampled, were traced or are told.
#[test]
fn every_ray_that_was_not_traced_has_its_cause() {
    let f = Folder::new();
    let text = std::fs::read_to_string(f.path().join("scene.toml")).unwrap();
    // Enough samples that integrals of bare sky pay.
    let text = text.replace("spp = 2", "spp = 64");
    let lamps = "[[lights]]\ntype = \"point\"\nposition = [0, 1, 2]\nintensity = 3\n[materials.mirror]\ntype = \
                 \"mirror\"\n[[objects]]\nshape = { type = \"sphere\", center = [1, 1, 0], radius = 0.4 }\nmaterial = \
                 \"mirror\"\n";
    let each = |kind: &str| format!("integrator = \"{kind}\"\neach_light = true");
    for (sky, more, by) in [
        ("gradient", "", String::new()),
        ("midday", "", String::new()),
        ("constant", "", String::new()),
        ("midday", lamps, String::new()),
        ("midday", lamps, each("path")),
        ("gradient", lamps, each("direct")),
    ] {
        let lit = text.replace("\"constant\"", &format!("\"{sky}\"")) + more;
        f.write("lit.toml", lit.replace("spp = 64", &format!("spp = 64\n{by}")));
        for flags in ["", "--integrator direct", "--sky-sampling product", "--sky-pixels sample"] {
            if flags.contains("integrator") && !by.is_empty() {
                continue;
            }
            f.run(&format!("render lit.toml --size 64x48 -o a.exr --stats s.json {flags}")).succeeds();
            let s = f.json("s.json");
            assert!(s["skipped"]["surface_points"].as_u64().unwrap() > 0, "{sky} {by} {flags}");
            let explained = s["skipped"]["explained"].as_f64().unwrap();
            assert!((explained - 1.0).abs() < 1e-12, "{sky} {by} {flags}: {}", s["skipped"]);
        }
        let info = f.run("info lit.toml --size 64x48 --json i.json").succeeds();
        assert!(info.stdout.contains("which no geometry projects into"), "{}", info.stdout);
        assert!(f.json("i.json")["skips"].as_array().is_some_and(|s| s.len() > 2));
    }
}
