//! `--target-error` and its companions.

use super::folder::Folder;

#[test]
fn what_makes_no_target_is_refused() {
    let f = Folder::new();
    for (flags, words) in [
        ("--target-error -1%", &["--target-error", "takes a share"][..]),
        ("--target-error nan", &["--target-error", "takes a share"]),
        ("--target-error 101%", &["--target-error", "takes a share"]),
        ("--target-error 5", &["--target-error", "5% is meant?"]),
        ("--target-error 1% --spp 64", &["--spp", "--max-spp"]),
        ("--target-error 1% --confidence 100%", &["confidence"]),
        ("--target-error 1% --confidence 40%", &["confidence"]),
        ("--target-error 1% --target-of tile", &["--target-of", "block"]),
        ("--target-error 1% --max-spp 0", &["--max-spp"]),
        ("--max-spp 64", &["--target-error"]),
        ("--confidence 90%", &["--target-error"]),
    ] {
        f.refuses(&format!("render scene.toml -o a.png {flags}"), 2, words);
    }
}

#[test]
fn a_target_that_cannot_be_met_ends_at_max_spp_and_says_so() {
    let f = Folder::new();
    for error in ["0", "1e-9"] {
        let command =
            format!("render scene.toml -o a.exr --stats s.json --target-error {error} --max-spp 40");
        let run = f.run(&command).succeeds();
        assert!(
            run.stderr.contains("was not met") && run.stderr.contains("40 samples a pixel"),
            "{}",
            run.stderr
        );
        let rounds = &f.json("s.json")["rounds"];
        assert_eq!(rounds["target"]["met"], false);
        assert_eq!((&rounds["spp_max"], &rounds["rounds"]), (&40.into(), &4.into()));
        assert!(rounds["target"]["error"].as_f64().unwrap() > 0.0);
    }
}

#[test]
fn a_target_is_met_and_recorded() {
    let f = Folder::new();
    let command = "render scene.toml -o a.exr --stats s.json --size 40x30 --target-error 10% --confidence 99% \
                   --target-of block --outlines 1 --aov spp";
    let run = f.run(command).succeeds();
    assert!(!run.stderr.contains("not met") && run.stderr.contains("target 10.0 % met"), "{}", run.stderr);
    let stats = f.json("s.json");
    let rounds = &stats["rounds"];
    let target = &rounds["target"];
    assert_eq!((&target["met"], &target["target_of"]), (&true.into(), &"block".into()));
    assert_eq!((&target["target_error"], &target["confidence"]), (&0.1.into(), &0.99.into()));
    let [error, bound] = ["error", "error_at_most"].map(|k| target[k].as_f64().unwrap());
    assert!(0.0 < error && error < bound && bound <= 0.1, "{error} {bound}");
    let [min, mean, max] = ["spp_min", "spp_mean", "spp_max"].map(|k| rounds[k].as_f64().unwrap());
    assert!(8.0 <= min && min <= mean && mean <= max);
    assert_eq!(stats["samples"].as_f64().unwrap(), (mean * 1200.0).round());
    // With fixed samples there are no rounds to tell of.
    f.run("render scene.toml -o a.exr --stats s.json").succeeds();
    assert!(f.json("s.json")["rounds"].is_null());
}
