//! `skylit bench`: measurements. `rays` asks how fast every kernel answers the same rays, and whether all answer alike;
//! for `error` see [`super::bench_error`].

use super::args::amount;
use super::bench_error::ErrorArgs;
use super::scene_args::SceneArgs;
use super::{Setting, interrupt, print};
use crate::base::intersectable::{BuildQuality, KernelMode};
use crate::bench::Progress;
use crate::bench::rays::growth::{Growth, default_sky, grow};
use crate::bench::rays::kernels::Choice;
use crate::bench::rays::measure::{Bench, Setup, measure};
use crate::bench::rays::peer::{Peer, serve};
use crate::bench::rays::record::{Record, to_json};
use crate::bench::rays::sets::{RaySets, SceneKey, check_scene, oracle};
use crate::bench::rays::verdict::{Comparison, Judgement, compare};
use crate::bench::rays::{file, present};
use crate::error::{Error, Result, unknown_name};
use crate::image::write::{check_file, write_file};
use crate::math::simd::Level;
use crate::report::Report;
use crate::scene::Scene;
use crate::scene::build::{BuildOptions, build};
use clap::{Args, Subcommand};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Flags of `skylit bench`.
#[derive(Args)]
pub struct BenchArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// Run the same rays through every kernel, mode and form of call: speed, build time, memory, agreement
    #[command(
        after_help = "The clock runs while rays are traced, one round after another over all rows, forwards and \
        backwards in turn. With --triangles the input is a shape that is generated in several sizes: knot, \
        displaced-sphere or terrain."
    )]
    Rays(Box<RaysArgs>),
    /// Render again and again with settings of your choice: error against time, bias, speed-up at equal error
    #[command(
        after_help = "Errors are measured against a reference of many times the samples, whose own noise is taken off. \
        Runs of all settings alternate; seconds are those of rendering alone. Every run has a seed of its own."
    )]
    Error(Box<ErrorArgs>),
    /// The other side of --peer: answers requests on stdin
    #[command(hide = true)]
    RaysWorker(Box<RaysArgs>),
}

#[derive(Args)]
struct RaysArgs {
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    rows: RowArgs,
    #[command(flatten)]
    output: OutputArgs,
    /// Rays of each kind, such as 300k or 2M
    #[arg(long, value_name = "N", default_value = "1M", value_parser = |s: &str| amount(s, 1..=16_000_000))]
    count: u64,
    /// Timed rounds; the median is told
    #[arg(long, value_name = "N", default_value = "5", value_parser = clap::value_parser!(u16).range(1..=1000))]
    rounds: u16,
    /// Replay the rays of this file, or save them to it if it does not exist
    #[arg(long, value_name = "FILE", conflicts_with = "triangles")]
    rays: Option<PathBuf>,
    /// Another skylit program, such as one built against another Embree, that runs the same rays in turn
    #[arg(long, value_name = "PROGRAM", conflicts_with = "triangles")]
    peer: Option<PathBuf>,
    /// Generate the input in these sizes, such as 1M,10M,50M, and show how build, memory and speed grow
    #[arg(long, value_name = "N,...", value_delimiter = ',', value_parser = |s: &str| amount(s, 1..=1_000_000_000))]
    triangles: Vec<u64>,
}

#[derive(Args)]
#[command(next_help_heading = "Rows")]
struct RowArgs {
    /// Kernels (see `skylit list backend`) [default: all but brute]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    backend: Vec<String>,
    /// Forms of call: single, batch, batch-incoherent, rtc-single, rtc-packet, rtc-stream, rtc-packet-stream, rtc-arrays
    /// [default: all]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    form: Vec<String>,
    /// Modes, where a kernel has them [default: robust,fast; with --triangles robust]
    #[arg(long, value_name = "robust,fast", value_delimiter = ',', value_parser = mode)]
    mode: Vec<KernelMode>,
    /// Instruction sets, where a kernel has a choice: portable, sse4.2, avx2, avx512 [default: its own choice]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', value_parser = level)]
    simd: Vec<Level>,
    /// All instruction sets that this processor has
    #[arg(long, conflicts_with = "simd")]
    all_simd: bool,
    /// Speed of the kernels' builds against that of tracing
    #[arg(long, value_name = "fast|balanced|best", default_value = "balanced", value_parser = quality)]
    build: BuildQuality,
    /// The row that others are compared with, such as "embree robust single"
    #[arg(long, value_name = "ROW")]
    reference: Option<String>,
}

#[derive(Args)]
#[command(next_help_heading = "Output")]
struct OutputArgs {
    /// Write the record as JSON, too
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a line of CSV a figure, too
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write a page with charts, too
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Compare with an earlier record of --json; exit code 1 if anything is slower beyond noise
    #[arg(long, value_name = "FILE", conflicts_with = "triangles")]
    baseline: Option<PathBuf>,
}

fn mode(s: &str) -> Result<KernelMode, String> {
    match s {
        "robust" => Ok(KernelMode::Robust),
        "fast" => Ok(KernelMode::Fast),
        _ => Err("takes robust or fast".into()),
    }
}

fn quality(s: &str) -> Result<BuildQuality, String> {
    match s {
        "fast" => Ok(BuildQuality::Fast),
        "balanced" => Ok(BuildQuality::Balanced),
        "best" => Ok(BuildQuality::Best),
        _ => Err("takes fast, balanced or best".into()),
    }
}

fn level(s: &str) -> Result<Level, String> {
    let found = Level::ALL.into_iter().find(|l| l.name() == s);
    let level = found.ok_or_else(|| unknown_name("instruction set", s, Level::ALL.map(Level::name)))?;
    match level.is_available() {
        true => Ok(level),
        false => Err(format!("this processor has no {s}")),
    }
}

/// Runs the verb.
pub fn run(args: &BenchArgs, setting: &Setting) -> Result<()> {
    match &args.what {
        What::Rays(a) if a.triangles.is_empty() => a.rays(setting),
        What::Rays(a) => a.grow(setting),
        What::RaysWorker(a) => a.work(setting),
        What::Error(a) => a.run(setting),
    }
}

impl RaysArgs {
    fn rays(&self, setting: &Setting) -> Result<()> {
        self.output.check()?;
        let choice = self.rows.choice(setting, &[KernelMode::Robust, KernelMode::Fast]);
        // Names are looked up before anything is loaded.
        choice.variants()?;
        choice.forms()?;
        let baseline = self.output.baseline.as_deref().map(Record::load).transpose()?;
        let bar = BenchBar::new(setting);
        bar.step("load");
        let (scene, sets) = self.load(setting, &bar)?;
        let setup = self.setup(&scene, &sets, &choice, setting);
        // The file that the other program reads; gone when it is.
        let mut room = None;
        let peer = match &self.peer {
            Some(program) => Some(self.start_peer(program, &sets, &mut room, &bar)?),
            None => None,
        };
        let bench = Bench::new(&setup, &bar)?;
        let record = measure(&bench, peer, &bar);
        bar.finish();
        let record = record?;
        let comparison = baseline.as_ref().map(|b| compare(b, &record)).transpose()?;
        interrupt::hold_off(|| {
            let page = || present::page(&record, comparison.as_ref());
            self.output.write(&record, std::slice::from_ref(&record), page)
        })?;
        print(present::text(&record).as_bytes())?;
        comparison.map_or(Ok(()), |c| judge(&c))
    }

    fn grow(&self, setting: &Setting) -> Result<()> {
        self.output.check()?;
        let choice = self.rows.choice(setting, &[KernelMode::Robust]);
        choice.variants()?;
        choice.forms()?;
        let growth = Growth {
            shape: self.scene.input.to_string_lossy().into_owned(),
            sizes: self.triangles.clone(),
            count: self.count as usize,
            choice: &choice,
            rounds: usize::from(self.rounds),
            threads: setting.threads,
            reference: self.rows.reference.clone(),
        };
        let bar = BenchBar::new(setting);
        let records = grow(&growth, &bar);
        bar.finish();
        let records = records?;
        let all = Grown { kind: "skylit bench rays growth", version: 1, records: &records };
        interrupt::hold_off(|| self.output.write(&all, &records, || present::growth_page(&records)))?;
        print(present::growth_table(&records).to_text().as_bytes())
    }

    /// Answers another program of ours until that closes stdin.
    fn work(&self, setting: &Setting) -> Result<()> {
        let choice = self.rows.choice(setting, &[KernelMode::Robust, KernelMode::Fast]);
        let bar = BenchBar::hidden();
        let (scene, sets) = self.load(setting, &bar)?;
        let setup = self.setup(&scene, &sets, &choice, setting);
        let bench = Bench::new(&setup, &bar)?;
        serve(&bench, std::io::stdin().lock(), std::io::stdout().lock())
    }

    fn setup<'a>(
        &self,
        scene: &'a Scene,
        sets: &'a RaySets,
        choice: &'a Choice,
        setting: &Setting,
    ) -> Setup<'a> {
        Setup {
            input: self.scene.input.display().to_string(),
            scene,
            sets,
            choice,
            rounds: usize::from(self.rounds),
            threads: setting.threads,
            reference: self.rows.reference.clone(),
        }
    }

    /// The scene and its rays: made, or those of the file.
    fn load(&self, setting: &Setting, bar: &BenchBar) -> Result<(Scene, RaySets)> {
        let mut desc = self.scene.load()?;
        desc.sky.get_or_insert_with(default_sky);
        let saved = self.rays.as_deref().filter(|p| p.exists());
        if let (Some(path), None) = (&self.rays, saved) {
            check_file(path)?;
        }
        // Rays that are made need a kernel that finds where they leave from.
        let backend = if saved.is_some() { "brute" } else { "auto" };
        let mut options = BuildOptions { backend: backend.into(), ..BuildOptions::default() };
        options.kernel.threads = setting.threads;
        let mut scene = build(desc, &options)?;
        check_scene(&scene)?;
        let sets = match saved {
            Some(path) => file::load(path, &SceneKey::of(&scene))?,
            None => {
                bar.step("make rays");
                let sets = RaySets::generate(&scene, self.count as usize)?;
                if let Some(path) = &self.rays {
                    interrupt::hold_off(|| file::save(path, &sets))?;
                }
                sets
            }
        };
        // It would hold memory beside the kernels that are measured.
        scene.kernel = Box::new(oracle(&scene));
        Ok((scene, sets))
    }

    fn start_peer(
        &self,
        program: &Path,
        sets: &RaySets,
        room: &mut Option<tempfile::TempDir>,
        bar: &BenchBar,
    ) -> Result<Peer> {
        bar.step("start the peer");
        let mut words = worker_words(std::env::args_os().skip(1));
        if self.rays.is_none() {
            let made = tempfile::tempdir().map_err(|e| Error::file(&std::env::temp_dir(), "create", e))?;
            let path = made.path().join("rays");
            file::save(&path, sets)?;
            words.extend(["--rays".into(), path.into_os_string()]);
            *room = Some(made);
        }
        Peer::start(program, &words)
    }
}

/// This program's words for a worker: the same scene, kernels and rays.
fn worker_words(words: impl Iterator<Item = OsString>) -> Vec<OsString> {
    let mut out: Vec<OsString> = Vec::new();
    let mut is_next_name = false;
    for word in words {
        let is_verb = is_next_name && word == "rays";
        is_next_name = (is_next_name && !is_verb) || word == "bench";
        out.push(if is_verb { "rays-worker".into() } else { word });
    }
    out
}

/// All records of a growth.
#[derive(Serialize)]
struct Grown<'a> {
    kind: &'static str,
    version: u32,
    records: &'a [Record],
}

impl RowArgs {
    fn choice(&self, setting: &Setting, modes: &[KernelMode]) -> Choice {
        Choice {
            backends: self.backend.clone(),
            forms: self.form.clone(),
            modes: if self.mode.is_empty() { modes.to_vec() } else { self.mode.clone() },
            levels: if self.all_simd { Level::available() } else { self.simd.clone() },
            quality: self.build,
            threads: setting.threads,
        }
    }
}

impl OutputArgs {
    /// Tries all files before anything is measured.
    fn check(&self) -> Result<()> {
        [&self.json, &self.csv, &self.html].into_iter().flatten().try_for_each(|p| check_file(p))
    }

    fn write(&self, json: &impl Serialize, records: &[Record], page: impl FnOnce() -> Report) -> Result<()> {
        if let Some(path) = &self.json {
            write_file(path, to_json(json)?.as_bytes())?;
        }
        if let Some(path) = &self.csv {
            write_file(path, present::csv(records).as_bytes())?;
        }
        match &self.html {
            Some(path) => write_file(path, page().to_html()?.as_bytes()),
            None => Ok(()),
        }
    }
}

/// Tells what a comparison came to, and fails if anything is slower.
fn judge(c: &Comparison) -> Result<()> {
    let mut changed = c.of(Judgement::Slower);
    changed.extend(c.of(Judgement::Faster));
    let mut text = String::from("\n");
    c.caveats.iter().for_each(|caveat| text += &format!("note: {caveat}\n"));
    c.missing.iter().for_each(|row| text += &format!("note: not measured: {row}\n"));
    if !changed.is_empty() {
        text += &present::baseline_table(&changed).to_text();
    }
    let word = if c.passed() { "ok" } else { "slower" };
    text += &format!("baseline: {word}: {}\n", c.sentence());
    print(text.as_bytes())?;
    if c.passed() { Ok(()) } else { Err(Error::Failed(c.sentence())) }
}

/// What is being done, and how much is left.
pub(super) struct BenchBar(ProgressBar);

impl BenchBar {
    /// Nothing is drawn if quiet, or where stderr is no terminal.
    pub(super) fn new(setting: &Setting) -> Self {
        if setting.quiet {
            return BenchBar::hidden();
        }
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr_with_hz(4));
        if let Ok(style) = ProgressStyle::with_template("bench {bar:32} {pos}/{len}  {wide_msg}") {
            bar.set_style(style);
        }
        BenchBar(bar)
    }

    fn hidden() -> Self {
        BenchBar(ProgressBar::hidden())
    }

    pub(super) fn finish(&self) {
        self.0.finish_and_clear();
    }
}

impl Progress for BenchBar {
    fn begin(&self, steps: u64) {
        self.0.reset();
        self.0.set_length(steps);
    }

    fn step(&self, what: &str) {
        if self.0.length().is_some() {
            self.0.inc(1);
        }
        self.0.set_message(what.to_owned());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_worker_is_given_the_same_words() {
        let words = "--threads 2 bench --quiet rays rays --peer x --form single";
        let words = worker_words(words.split(' ').map(OsString::from));
        let expected = "--threads 2 bench --quiet rays-worker rays --peer x --form single";
        assert_eq!(words.join(" ".as_ref()), expected);
    }

    #[test]
    fn names_are_read_or_refused_with_a_reason() {
        assert_eq!(level("portable"), Ok(Level::Portable));
        assert!(level("avx3").unwrap_err().contains("avx2"));
        assert!(mode("slow").is_err() && quality("worst").is_err());
    }
}
