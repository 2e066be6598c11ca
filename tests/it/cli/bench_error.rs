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
    assert_eq!(again.stdout.matches("sampler=independent").count(), 2 * (2 + 1));
    let files = std::fs::read_dir(f.path().join("r.references")).unwrap().count();
    assert_eq!(files, 1);
    let read = |name: &str| std::fs::read_to_string(f.path().join(name)).unwrap();
    assert!(read("r.svg").starts_with("<svg") && read("r.html").contains("data:image/png"));
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
        let command = format!("render scene.toml --size 64x48 --spp 64 -o a.exr --stats s.json {flags}");
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
