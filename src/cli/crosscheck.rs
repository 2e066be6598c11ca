//! `skylit crosscheck`: every ray of a render through every kernel, and the same picture by each.

use super::args::{duration, share};
use super::progress::Bar;
use super::render::{ModeArg, choose_integrator};
use super::scene_args::SceneArgs;
use super::{Setting, interrupt, print};
use crate::accel;
use crate::base::intersectable::{KernelMode, KernelOptions};
use crate::base::ray::Ray;
use crate::compare::statistics::equivalence::Answer;
use crate::crosscheck::compare::Contender;
use crate::crosscheck::equivalence::{self, Equal};
use crate::crosscheck::replay::{Replay, read_ray};
use crate::crosscheck::summary::Summary;
use crate::crosscheck::{ORACLE_TESTS, Plan, html, run as compare};
use crate::error::{Error, Result, unknown_name};
use crate::image::write::{check_file, write_file};
use crate::integrators::Integrator;
use crate::render::settings::RenderSettings;
use crate::report::machine::{self, Machine};
use crate::scene::Scene;
use crate::scene::build::{BuildOptions, build};
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// Flags of `skylit crosscheck`.
#[derive(Args)]
pub struct CrosscheckArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Samples a pixel
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..), help_heading = "Rays")]
    spp: u32,
    /// Whose rays are compared (see `skylit list integrator`) [default: path]
    #[arg(long, value_name = "NAME", help_heading = "Rays")]
    integrator: Option<String>,
    /// Longest path in surfaces, the camera's first hit counted
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = "Rays")]
    max_depth: Option<u32>,
    /// Seed of every random choice [default: 0]
    #[arg(long, value_name = "N", help_heading = "Rays")]
    seed: Option<u64>,
    /// This ray alone, in render space, as a crosscheck prints it: what every kernel and the oracle say of it
    #[arg(long, value_name = "ox,oy,oz,dx,dy,dz,tnear,tfar", allow_hyphen_values = true, value_parser = read_ray, help_heading = "Rays")]
    ray: Option<Ray>,
    /// The kernels; the first decides which rays there are [default: all but the oracle, brute]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', help_heading = "Ray kernels")]
    backend: Vec<String>,
    /// Whether rays may slip through between triangles for speed [default: robust]
    #[arg(long, value_name = "robust|fast", help_heading = "Ray kernels")]
    kernel_mode: Option<ModeArg>,
    /// Render by each kernel, too, with more samples until the means of all channels are known to be the same within such a
    /// share, such as 0.1%, or to be not
    #[arg(long, value_name = "SHARE", value_parser = share, conflicts_with = "ray", allow_hyphen_values = true, help_heading = "Equivalence")]
    equivalent: Option<f64>,
    /// When to give up: samples a pixel, or a time such as 60s after which no round begins [default: 1024]
    #[arg(long, value_name = "N|TIME", requires = "equivalent", value_parser = budget, help_heading = "Equivalence")]
    budget: Option<Budget>,
    /// Give each kernel a seed of its own, which takes far more samples than common random numbers
    #[arg(long, requires = "equivalent", help_heading = "Equivalence")]
    independent: bool,
    /// Write it as JSON, too
    #[arg(long, value_name = "FILE", conflicts_with = "ray", help_heading = "Output")]
    json: Option<PathBuf>,
    /// Write it as a page with the pictures, their difference and the places, too
    #[arg(long, value_name = "FILE", conflicts_with = "ray", help_heading = "Output")]
    html: Option<PathBuf>,
}

/// Runs the verb.
pub fn run(args: &CrosscheckArgs, setting: &Setting) -> Result<()> {
    let names = args.kernels()?;
    [&args.json, &args.html].into_iter().flatten().try_for_each(|path| check_file(path))?;
    let desc = args.scene.load()?;
    let integrator = choose_integrator(&desc, args.integrator.as_deref(), args.max_depth)?;
    let settings = RenderSettings {
        spp: args.spp,
        seed: args.seed.or(desc.render.seed).unwrap_or(0),
        threads: setting.threads,
        ..RenderSettings::new(desc.film.size)
    };
    let mode = args.kernel_mode.map_or(KernelMode::Robust, KernelMode::from);
    let kernel = KernelOptions { mode, threads: setting.threads, ..KernelOptions::default() };
    // The kernel that needs no build: those to be compared are built over its geometry.
    let mut scene = build(desc, &BuildOptions { backend: "brute".into(), kernel })?;
    let contenders = build_kernels(&names, &scene, &kernel)?;
    if let Some(ray) = args.ray {
        return replay(&scene, &contenders, ray);
    }
    let equal = args.equivalence(&contenders, &integrator, &settings);
    let plan = Plan { contenders, integrator, settings, oracle_tests: ORACLE_TESTS };
    let bar = Bar::new(setting.quiet, None);
    let done = compare(&mut scene, &plan, &bar);
    bar.finish();
    let done = done?;
    let equal = equal.map(|plan| equivalence::run(&mut scene, &plan, &bar)).transpose()?;
    let summary = Summary::new(&done, &scene, &command());
    let machine = Machine::here();
    let json = args.json.as_ref().map(|_| to_json(&machine, &summary, equal.as_ref())).transpose()?;
    let input = args.scene.input.display().to_string();
    let html = args.html.as_ref().map(|_| html::page(&done, &summary, &machine, &input)).transpose()?;
    interrupt::hold_off(|| {
        let files = [(&args.json, json), (&args.html, html)];
        let files = files.iter().filter_map(|(path, text)| path.as_ref().zip(text.as_ref()));
        files.into_iter().try_for_each(|(path, text)| write_file(path, text.as_bytes()))
    })?;
    let equal_line = equal.as_ref().map_or(String::new(), |e| format!("means    {}\n", e.sentence));
    print(format!("{summary}{equal_line}").as_bytes())?;
    match equal {
        _ if !summary.passed => Err(Error::Failed(format!("crosscheck: {}", summary.verdict))),
        Some(e) if e.answer != Answer::Equivalent => {
            Err(Error::Failed(format!("crosscheck: {}", e.sentence)))
        }
        _ => Ok(()),
    }
}

/// The record: where it was taken, and what came out.
#[derive(Serialize)]
struct Record<'a> {
    machine: &'a Machine,
    crosscheck: &'a Summary,
    #[serde(skip_serializing_if = "Option::is_none")]
    equivalence: Option<&'a Equal>,
}

fn to_json(machine: &Machine, crosscheck: &Summary, equivalence: Option<&Equal>) -> Result<String> {
    let text = serde_json::to_string_pretty(&Record { machine, crosscheck, equivalence });
    text.map(|t| t + "\n").map_err(|e| Error::Internal(format!("cannot write the record: {e}")))
}

fn replay(scene: &Scene, contenders: &[Contender], ray: Ray) -> Result<()> {
    let replay = Replay::new(scene, contenders, ray, ORACLE_TESTS);
    print(replay.to_string().as_bytes())?;
    match replay.passed() {
        true => Ok(()),
        false => Err(Error::Failed("crosscheck: rounding does not explain every answer to this ray".into())),
    }
}

fn build_kernels(names: &[&'static str], scene: &Scene, options: &KernelOptions) -> Result<Vec<Contender>> {
    let built = names.iter().map(|name| {
        let kernel = accel::build_kernel(name, scene.geometry.clone(), options)?;
        log::info!("{}", kernel.describe());
        Ok(Contender { name: (*name).to_owned(), kernel: Arc::from(kernel) })
    });
    built.collect()
}

/// The oracle's name among the kernels.
const ORACLE: &str = "brute";

/// When to give up.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Budget {
    Samples(u32),
    Time(Duration),
}

/// Samples of a pixel where nothing else is said.
const MOST_SPP: u32 = 1024;

/// A bare number is samples, one with a unit a time.
fn budget(s: &str) -> Result<Budget, String> {
    match s.parse() {
        Ok(0) => Err("takes at least one sample".into()),
        Ok(n) => Ok(Budget::Samples(n)),
        Err(_) => duration(s).map(Budget::Time).map_err(|e| format!("{e}; or a number of samples a pixel")),
    }
}

impl CrosscheckArgs {
    /// The plan of the stronger question, if it is asked.
    fn equivalence(
        &self,
        contenders: &[Contender],
        integrator: &Arc<dyn Integrator>,
        settings: &RenderSettings,
    ) -> Option<equivalence::Plan> {
        let (most_spp, time) = match self.budget {
            None => (MOST_SPP, None),
            Some(Budget::Samples(n)) => (n, None),
            Some(Budget::Time(t)) => (u32::MAX, Some(t)),
        };
        self.equivalent.map(|margin| equivalence::Plan {
            contenders: contenders.to_vec(),
            integrator: Arc::clone(integrator),
            settings: settings.clone(),
            margin,
            alpha: 0.01,
            independent: self.independent,
            most_spp,
            time,
        })
    }

    /// The names of the kernels that are wanted, each once.
    fn kernels(&self) -> Result<Vec<&'static str>> {
        let all = accel::KERNELS.iter().map(|k| k.name);
        if self.backend.is_empty() {
            let others: Vec<&str> = all.filter(|n| *n != ORACLE).collect();
            return Ok(if others.is_empty() { vec![ORACLE] } else { others });
        }
        let mut names = Vec::new();
        for wanted in &self.backend {
            let found = all.clone().find(|n| n == wanted);
            let name = found.ok_or_else(|| Error::Usage(unknown_name("backend", wanted, all.clone())))?;
            if names.contains(&name) {
                return Err(Error::Usage(format!("--backend names {name} twice")));
            }
            names.push(name);
        }
        Ok(names)
    }
}

/// This command without what it writes and the ray it asks, as a shell reads it.
fn command() -> String {
    let mut words = Vec::new();
    let mut args = std::env::args_os().map(|a| a.to_string_lossy().into_owned());
    while let Some(word) = args.next() {
        let flag = word.split('=').next().unwrap_or("");
        if !["--json", "--html", "--ray"].contains(&flag) {
            words.push(word);
        } else if flag == word {
            args.next();
        }
    }
    machine::command(words.into_iter())
}
