//! `skylit check`: a certificate of numerical stability for a scene or a mesh.

use super::args::amount;
use super::scene_args::SceneArgs;
use super::{Setting, interrupt, print};
use crate::accel;
use crate::base::intersectable::KernelOptions;
use crate::check::certificate::Certificate;
use crate::check::{CheckOptions, RayKind, Watch, examine};
use crate::error::{Error, Result, unknown_name};
use crate::image::write::{check_file, write_file};
use crate::report::machine::Machine;
use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use std::path::PathBuf;

/// Flags of `skylit check`.
#[derive(Args)]
pub struct CheckArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Rays of each kind for each kernel, over all placements, such as 300k or 2M [default: 1M]
    #[arg(long, value_name = "N", value_parser = |s: &str| amount(s, 1..=1_000_000_000_000))]
    rays: Option<u64>,
    /// Only these kinds of rays: random, vertices, edges, beside, spawned, tunnelling, quadrics [default: all]
    #[arg(long, value_name = "KIND,...", value_delimiter = ',', value_parser = kind)]
    only: Vec<RayKind>,
    /// Kernels to check (see `skylit list backend`) [default: all]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    backend: Vec<String>,
    /// Seed of every random choice [default: 0]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Write the certificate as JSON, too
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write it as a page, too, placement by placement
    #[arg(long, value_name = "FILE.html")]
    html: Option<PathBuf>,
}

/// Runs the verb.
///
/// # Errors
/// [`Error::Failed`] where a promise is broken, after everything has been written.
pub fn run(args: &CheckArgs, setting: &Setting) -> Result<()> {
    for path in [&args.json, &args.html].into_iter().flatten() {
        check_file(path)?;
    }
    let known = || accel::KERNELS.iter().map(|k| k.name);
    if let Some(name) = args.backend.iter().find(|n| known().all(|k| k != *n)) {
        return Err(Error::Usage(unknown_name("backend", name, known())));
    }
    let usual = CheckOptions::default();
    let options = CheckOptions {
        rays: args.rays.unwrap_or(usual.rays),
        seed: args.seed.unwrap_or(usual.seed),
        kinds: args.only.clone(),
        kernels: args.backend.clone(),
        kernel: KernelOptions { threads: setting.threads, ..usual.kernel },
    };
    let scene = args.scene.load()?;
    let bar = Bar::new(setting.quiet);
    let certificate = examine(&scene, &args.scene.input.display().to_string(), &options, &bar);
    bar.0.finish_and_clear();
    let certificate = certificate?;
    let machine = Machine::here();
    interrupt::hold_off(|| {
        if let Some(path) = &args.json {
            let record =
                Record { machine: &machine, verdict: certificate.verdict(), certificate: &certificate };
            let text = serde_json::to_string_pretty(&record)
                .map_err(|e| Error::Internal(format!("cannot write the certificate: {e}")))?;
            write_file(path, (text + "\n").as_bytes())?;
        }
        match &args.html {
            Some(path) => write_file(path, certificate.report(&machine).to_html()?.as_bytes()),
            None => Ok(()),
        }
    })?;
    print(certificate.to_text().as_bytes())?;
    outcome(&certificate)
}

/// Exit code 1 where a promise is broken.
fn outcome(certificate: &Certificate) -> Result<()> {
    match certificate.broken().next() {
        None => Ok(()),
        Some(_) => Err(Error::Failed(certificate.verdict())),
    }
}

/// A kind of rays by name.
fn kind(name: &str) -> std::result::Result<RayKind, String> {
    let known = || RayKind::ALL.iter().map(|k| k.0);
    let found = RayKind::ALL.iter().find(|k| k.0 == name);
    found.map(|k| k.1).ok_or_else(|| unknown_name("kind of rays", name, known()))
}

/// What the JSON file holds.
#[derive(Serialize)]
struct Record<'a> {
    machine: &'a Machine,
    verdict: String,
    #[serde(flatten)]
    certificate: &'a Certificate,
}

/// How far it is, on a terminal.
struct Bar(ProgressBar);

impl Bar {
    fn new(quiet: bool) -> Self {
        let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr_with_hz(8) };
        Bar(ProgressBar::with_draw_target(None, target))
    }
}

impl Watch for Bar {
    fn begin(&self, steps: u64) {
        if let Ok(style) = ProgressStyle::with_template("check {bar:32} {pos}/{len}  {msg}  {eta} left") {
            self.0.set_style(style);
        }
        self.0.set_length(steps);
    }

    fn step(&self, what: &str) {
        log::debug!("checking {what}");
        self.0.inc(1);
        self.0.set_message(what.to_owned());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::ray::Ray;
    use crate::check::certificate::Check;
    use crate::check::tally::Tally;
    use glam::Vec3;

    #[test]
    fn a_broken_promise_is_a_failure_and_a_known_leak_is_none() {
        let mut failed = Tally::default();
        failed.count(true, &Ray::new(Vec3::ZERO, Vec3::X, 0), 0);
        let mut certificate = Certificate::default();
        certificate.add(Check::LeaksAtVertices, ["rock", "as it is"], "embree", failed);
        certificate.add(Check::LeaksAtVertices, ["rock", "as it is"], "bvh", Tally::default());
        assert!(outcome(&certificate).is_ok());
        certificate.add(Check::LeaksAtVertices, ["rock", "scaled"], "bvh", failed);
        let e = outcome(&certificate).unwrap_err();
        assert_eq!(e.exit_code(), 1);
        assert!(e.to_string().contains("bvh, leaks, at vertices, rock (scaled): 1 of 1 rays"), "{e}");
        let text = certificate.to_text();
        assert!(
            text.contains("broken: bvh") && text.contains("[0.0, 0.0, 0.0] along [1.0, 0.0, 0.0]"),
            "{text}"
        );
    }
}
