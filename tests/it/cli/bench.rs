//! `skylit bench`.

use super::folder::Folder;

/// As little as shows all of it.
const SMALL: &str = "--count 500 --rounds 2 --threads 1 --backend brute --form single,batch";

#[test]
fn rays_are_measured_and_told_in_every_form() {
    let f = Folder::new();
    let run = f.run(&format!(
        "bench rays scene.toml {SMALL} --json r.json --csv r.csv --html r.html --rays rays.bin --quiet"
    ));
    let run = run.succeeds();
    assert_eq!(run.stderr, "");
    for word in ["brute", "single", "batch", "camera", "grazing", "Mrays/s"] {
        assert!(run.stdout.contains(word), "{word} in {}", run.stdout);
    }
    let record = f.json("r.json");
    assert_eq!(record["scene"]["triangles"], 2);
    assert_eq!(record["workloads"][0]["rays"], 500);
    assert_eq!(record["rows"][1]["cells"][0]["differs"]["hit"], 0);
    assert!(record["machine"]["cpu"].is_string() && record["machine"]["commit"].is_string());
    let read = |name: &str| std::fs::read_to_string(f.path().join(name)).unwrap();
    assert!(read("r.csv").starts_with("input,triangles,threads,kernel"));
    let page = read("r.html");
    assert!(page.starts_with("<!doctype html>") && page.contains("Agreement") && !page.contains("://"));

    let again = f.run(&format!("bench rays scene.toml {SMALL} --rays rays.bin --json again.json")).succeeds();
    assert_eq!(f.json("again.json")["rays"], record["rays"], "{}", again.stderr);
}

#[test]
fn a_baseline_decides_the_exit_code() {
    let f = Folder::new();
    let command = format!("bench rays tri.ply {SMALL} --quiet");
    f.run(&format!("{command} --json r.json")).succeeds();
    // Speeds that nothing reaches, and such as everything passes.
    let mut record = f.json("r.json");
    let mut scale = |by: f64| {
        for row in record["rows"].as_array_mut().unwrap() {
            for cell in row["cells"].as_array_mut().unwrap().iter_mut().filter(|c| !c.is_null()) {
                cell["mrays"] = by.into();
                cell["mad"] = 0.0.into();
            }
        }
        f.write(&format!("{by:e}.json"), record.to_string());
    };
    scale(1e9);
    scale(1e-9);
    f.refuses(&format!("{command} --baseline 1e9.json"), 1, &["slower than the baseline"]);
    let passed = f.run(&format!("{command} --baseline 1e-9.json")).succeeds();
    assert!(passed.stdout.contains("baseline: ok"), "{}", passed.stdout);
    f.refuses(&format!("{command} --baseline scene.toml"), 2, &["scene.toml", "no record"]);
    f.refuses(&format!("{command} --baseline gone.json"), 3, &["gone.json"]);
}

#[test]
fn sizes_are_generated() {
    let f = Folder::new();
    let run = f.run(&format!("bench rays --triangles 1k,400 {SMALL} --json g.json --html g.html")).succeeds();
    assert!(run.stdout.contains("triangles"), "{}", run.stdout);
    let growth = f.json("g.json");
    let triangles = |i: usize| growth["records"][i]["scene"]["triangles"].as_u64().unwrap();
    assert!((300..500).contains(&triangles(0)) && (800..1200).contains(&triangles(1)));
    f.run(&format!("bench rays terrain --triangles 400 {SMALL}")).succeeds();
    f.refuses(&format!("bench rays sphere --triangles 400 {SMALL}"), 2, &["knot", "sphere"]);
}

#[test]
fn another_program_runs_the_same_rays() {
    let f = Folder::new();
    let own = env!("CARGO_BIN_EXE_skylit");
    let run = f.run(&format!("bench rays tri.ply {SMALL} --peer {own} --json r.json")).succeeds();
    assert!(run.stdout.contains("brute (peer)"), "{}", run.stdout);
    let record = f.json("r.json");
    assert_eq!(record["rows"].as_array().unwrap().len(), 4);
    assert_eq!(record["kernels"][1]["peer"], true);
    for cell in record["rows"][3]["cells"].as_array().unwrap() {
        assert_eq!(cell["differs"]["hit"], 0);
    }
    f.refuses(&format!("bench rays tri.ply {SMALL} --peer gone"), 3, &["gone"]);
    #[cfg(unix)]
    f.refuses(&format!("bench rays tri.ply {SMALL} --peer /bin/echo"), 2, &["/bin/echo"]);
}

#[test]
fn what_makes_no_sense_is_refused() {
    let f = Folder::new();
    f.refuses("bench rays", 2, &["required"]);
    f.refuses("bench rays tri.ply --backend embre", 2, &["unknown backend"]);
    f.refuses("bench rays tri.ply --form singel", 2, &["did you mean \"single\""]);
    f.refuses("bench rays tri.ply --simd avx3", 2, &["avx3"]);
    f.refuses("bench rays tri.ply --count 0", 2, &["--count"]);
    f.refuses("bench rays tri.ply --json gone/r.json", 3, &["gone"]);
    f.write("rays.bin", "SKYLRAYS");
    f.refuses(&format!("bench rays tri.ply {SMALL} --rays rays.bin"), 2, &["rays.bin", "ends before"]);
    f.write("sky.toml", "[sky]\ntype = \"constant\"\n");
    f.refuses(&format!("bench rays sky.toml {SMALL}"), 2, &["no object"]);
}
