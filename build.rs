//! Facts for `--version` and for the record of every benchmark, and the way to Embree's library at run time.

use std::env;
use std::path::Path;
use std::process::Command;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-env=SKYLIT_GIT={}", git_commit().unwrap_or_else(|| "unknown".to_owned()));
    println!("cargo::rustc-env=SKYLIT_TARGET={}", env::var("TARGET").unwrap_or_default());
    println!("cargo::rustc-env=SKYLIT_FEATURES={}", env::var("CARGO_CFG_TARGET_FEATURE").unwrap_or_default());
    // Both come from sys/build.rs, and are absent in a build without Embree.
    let embree = env::var("DEP_EMBREE_VERSION").unwrap_or_else(|_| "none".to_owned());
    println!("cargo::rustc-env=SKYLIT_EMBREE={embree}");
    if let Some(dir) = env::var("DEP_EMBREE_LIBDIR").ok().filter(|d| !d.is_empty()) {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{dir}");
    }
}

/// The short hash of the commit that is checked out, or `None` outside of a git checkout.
fn git_commit() -> Option<String> {
    let git = |args: &[&str]| {
        let output = Command::new("git").args(args).output().ok().filter(|o| o.status.success())?;
        Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    // A source package inside of somebody else's repository must not claim that one's commit.
    git(&["ls-files", "--error-unmatch", "build.rs"])?;
    // The log of HEAD grows with every commit and checkout; a missing file would run this script on every build.
    let log = git(&["rev-parse", "--git-path", "logs/HEAD"])?;
    if Path::new(&log).exists() {
        println!("cargo::rerun-if-changed={log}");
    }
    git(&["rev-parse", "--short=12", "HEAD"])
}
