//! The whole binary: exit codes, messages, and that nothing is left half-written.

mod bad_input;
mod bench;
mod bench_error;
mod compare;
mod convert;
mod crosscheck;
mod denoise;
mod display_server;
mod equivalent;
mod explain;
pub mod folder;
#[cfg(target_os = "linux")]
mod memory;
mod preview;
mod skies;
mod target;

use folder::{Folder, QUICK};
#[cfg(unix)]
use std::process::{Command, Stdio};

#[test]
fn usage_is_told_on_the_right_stream() {
    let f = Folder::new();
    let bare = f.run("");
    assert_eq!((bare.code, bare.stdout.as_str()), (2, ""));
    assert!(bare.stderr.contains("Usage: skylit"));
    let help = f.run("--help");
    assert_eq!((help.code, help.stderr.as_str()), (0, ""));
    for verb in ["render", "info", "bench", "compare", "crosscheck", "check", "list", "completions", "man"] {
        assert!(help.stdout.contains(verb));
        assert!(f.run(&format!("{verb} --help")).succeeds().stdout.contains("--threads"));
    }
    assert!(f.run("--version").succeeds().stdout.starts_with("skylit 0"));
    f.refuses("paint x", 2, &["paint"]);
    f.refuses("render tri.ply -o a.png --ssp 4", 2, &["--ssp"]);
    f.refuses("render tri.ply", 2, &["required"]);
    f.refuses("render tri.ply -o a.png --threads 0", 2, &["--threads"]);
}

#[test]
fn lists_completions_and_manual_are_printed() {
    let f = Folder::new();
    let list = f.run("list").succeeds().stdout;
    for kind in ["diffuse", "perspective", "constant", "path", "owen-sobol", "mesh", "brute", "albedo"] {
        assert!(list.contains(kind), "{kind}");
    }
    let one = f.run("list material").succeeds().stdout;
    assert!(one.contains("diffuse") && !one.contains("perspective"));
    assert_eq!(one, f.run("list materials").succeeds().stdout);
    f.refuses("list materail", 2, &["unknown family", "did you mean \"material\"?"]);
    assert!(f.run("completions bash").succeeds().stdout.contains("--cropwindow"));
    assert!(f.run("man").succeeds().stdout.contains(".TH skylit"));
    assert!(f.run("man render").succeeds().stdout.contains("skylit\\-render"));
    // Of verbs within verbs, and of every flag.
    let nested = f.run("man bench rays").succeeds().stdout;
    assert!(nested.contains("skylit\\-bench\\-rays") && nested.contains("triangles"), "{nested}");
    f.refuses("man bench ray", 2, &["unknown verb \"ray\"", "did you mean \"rays\"?"]);
    f.refuses("man render fast", 2, &["no verbs of its own"]);
    for flag in ["display\\-server", "preview", "pixel", "explain", "worst", "sample"] {
        assert!(f.run("man render").succeeds().stdout.contains(flag), "{flag}");
    }
    for shell in ["bash", "zsh", "fish"] {
        let text = f.run(&format!("completions {shell}")).succeeds().stdout;
        for flag in ["display-server", "preview", "pixel", "explain", "worst"] {
            assert!(text.contains(flag), "{shell}: {flag}");
        }
    }
}

#[test]
fn pictures_and_statistics_are_written() {
    let f = Folder::new();
    let run = f
        .run("render scene.toml -o a.exr -o b.png --aov albedo,normal --outlines 4 --stats s.json")
        .succeeds();
    assert_eq!(run.stdout, "");
    assert!(run.stderr.contains("2 triangles") && run.stderr.contains("Mrays/s"), "{}", run.stderr);
    let stats = f.json("s.json");
    let count = |section: &str, name: &str| stats[section][name].as_u64().unwrap();
    let outlined = count("outlines", "pixels") * (count("outlines", "times") - 1);
    assert!(outlined > 0);
    assert_eq!(stats["samples"], (8 * 6 + outlined) * 2);
    // Rays through all corners of pixels have found the outlines.
    let rays = count("rays", "camera") + count("skipped", "samples");
    assert_eq!(rays, (8 * 6 + outlined) * 2 + 9 * 7);
    f.run("render scene.toml -o a.exr -o b.png --outlines 1 --stats s.json --aov albedo,normal").succeeds();
    let stats = f.json("s.json");
    assert_eq!((&stats["samples"], &stats["outlines"]["pixels"]), (&(8 * 6 * 2).into(), &0.into()));
    assert_eq!(stats["scene"]["triangles"], 2);
    assert!(stats["versions"]["kernel"].is_string());
    assert_eq!(f.names(), ["a.exr", "b.png", "s.json", "scene.toml", "tri.ply"]);
    let quiet = f.run(&format!("render tri.ply -o c.png --quiet {QUICK}")).succeeds();
    assert_eq!((quiet.stdout.as_str(), quiet.stderr.as_str()), ("", ""));
}

#[test]
fn flags_of_a_mesh_alone_change_its_picture() {
    let f = Folder::new();
    let mut seen = Vec::new();
    let all = [
        "",
        "--view -60,40",
        "--fov 70",
        "--up z",
        "--material mirror",
        "--ground",
        "--background 0.1,0.9,0.1",
        "--sky-intensity 0.3",
        "--cropwindow 0,1,0,0.5",
    ];
    for flags in all {
        let command = format!("render tri.ply -o a.exr --size 24x16 --spp 4 --sky gradient {flags}");
        f.run(&command).succeeds();
        let picture = skylit::image::read::read_image(&f.path().join("a.exr"), None).unwrap();
        assert!(!seen.contains(&picture), "{flags} changes nothing");
        seen.push(picture);
    }
    f.refuses("render scene.toml -o b.png --view 1,2", 2, &["--view", "mesh alone"]);
    f.refuses("render scene.toml -o b.png --ground", 2, &["--ground", "mesh alone"]);
    f.refuses("render tri.ply -o b.png --material image", 2, &["unknown material \"image\""]);
    f.run(&format!("render tri.ply -o flat.png --flat {QUICK}")).succeeds();
}

#[test]
fn info_tells_what_is_there() {
    let f = Folder::new();
    let run = f.run("info scene.toml --json i.json").succeeds();
    for word in ["2 triangles", "clay (diffuse)", "constant", "1 tri", "8 x 6"] {
        assert!(run.stdout.contains(word), "{word} in {}", run.stdout);
    }
    let max = f.json("i.json")["bounds"]["max"].clone();
    assert_eq!(max, serde_json::json!([1.0, 1.0, 1.0]));
    f.run("info tri.ply --sky gradient").succeeds();
}

#[test]
fn a_check_certifies_in_three_forms() {
    let f = Folder::new();
    let check = "check tri.ply --rays 300 --json c.json --html c.html";
    let run = f.run(check).succeeds();
    for word in ["open, 1 hole", "hole of 4 edges", "self-hits", "tunnelling", "verdict: all "] {
        assert!(run.stdout.contains(word), "{word} in {}", run.stdout);
    }
    let c = f.json("c.json");
    assert_eq!(c["meshes"][0]["topology"]["boundary_edges"], 4);
    assert_eq!(c["meshes"][0]["closed"], false);
    let kept = |e: &serde_json::Value| e["standing"] != "broken" && e["tried"].is_u64();
    assert!(c["rows"].as_array().unwrap().iter().all(|r| r["entries"].as_array().unwrap().iter().all(kept)));
    assert!(std::fs::read_to_string(f.path().join("c.html")).unwrap().contains("Placement by placement"));
    // The same counts again, from another number of threads.
    f.run("check tri.ply --rays 300 --json d.json --quiet --threads 1").succeeds();
    assert_eq!(f.json("d.json")["rows"], c["rows"]);
    f.refuses("check tri.ply --backend embre", 2, &["unknown backend", "brute"]);
    f.refuses("check tri.ply --rays 0", 2, &["--rays"]);
    f.refuses("check tri.ply --json none/c.json", 3, &["none"]);
    f.run("check scene.toml --rays 100 --backend brute").succeeds();
}

#[test]
#[cfg(unix)]
fn an_interrupt_ends_it_with_130_and_no_file() {
    let f = Folder::new();
    let before = f.listing();
    let mut child = f
        .command("render scene.toml -o a.exr --size 512x512 --spp 4000000 --threads 1")
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    // To listen for signals is the first thing that it does, and it would run for hours.
    std::thread::sleep(std::time::Duration::from_millis(1500));
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(killed.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(f.listing(), before);
}
