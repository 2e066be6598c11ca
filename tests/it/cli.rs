//! The whole binary: exit codes and messages.

use std::process::Command;

/// Exit code, stdout, stderr.
fn run(command: &str) -> (Option<i32>, String, String) {
    let mut c = Command::new(env!("CARGO_BIN_EXE_skylit"));
    let output = c.args(command.split_whitespace()).env("NO_COLOR", "1").output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

#[test]
fn usage_is_told_on_the_right_stream() {
    let (code, out, err) = run("");
    assert_eq!((code, out.as_str()), (Some(2), ""));
    assert!(err.contains("Usage: skylit"));
    let (code, out, err) = run("--help");
    assert_eq!((code, err.as_str()), (Some(0), ""));
    for verb in ["list", "completions", "man"] {
        assert!(out.contains(verb));
        assert!(run(&format!("{verb} --help")).1.contains("--threads"));
    }
    assert!(run("--version").1.starts_with("skylit 0"));
    let (code, out, err) = run("paint x");
    assert_eq!((code, out.as_str()), (Some(2), ""));
    assert!(err.starts_with("skylit: error: ") && err.contains("paint"), "{err}");
    assert_eq!(run("list --threads 0").0, Some(2));
}

#[test]
fn lists_completions_and_manual_are_printed() {
    let (_, list, _) = run("list");
    for kind in ["diffuse", "perspective", "constant", "owen-sobol", "mesh", "albedo"] {
        assert!(list.contains(kind), "{kind}");
    }
    let (_, one, _) = run("list material");
    assert!(one.contains("diffuse") && !one.contains("perspective"));
    assert_eq!(one, run("list materials").1);
    let (code, _, err) = run("list materail");
    assert_eq!(code, Some(2));
    assert!(err.contains("did you mean \"material\"?"), "{err}");
    assert!(run("completions bash").1.contains("--threads"));
    assert!(run("man").1.contains(".TH skylit"));
    assert!(run("man list").1.contains("skylit\\-list"));
}
