//! `skylit render`: load, build, render, save.

use super::args::{CropWindow, duration};
use super::explain::ExplainArgs;
use super::output::{OutputArgs, OutputPlan, PictureInfo};
use super::scene_args::SceneArgs;
use super::summary::Record;
use super::target_args::{TargetArgs, TargetPlan, warn_if_missed};
use super::watch::{Picture, WatchArgs, Watchers};
use super::{Setting, interrupt};
use crate::base::intersectable::{BuildQuality, KernelMode, KernelOptions};
use crate::base::registry::{self, Node, Value};
use crate::error::{Error, Result, unknown_name};
use crate::formats::native::MAX_SIDE;
use crate::image::write::{check_file, write_file};
use crate::integrators::Integrator;
use crate::render::Renderer;
use crate::render::dealing::Dealing;
use crate::render::settings::{MOST_OUTLINES, RenderSettings, crop_window};
use crate::sampler::Sampler;
use crate::sampling::filter::PixelFilter;
use crate::scene::build::{BuildOptions, build as build_scene};
use crate::scene::desc::SceneDesc;
use crate::{accel, integrators};
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Flags of `skylit render`.
#[derive(Args)]
pub struct RenderArgs {
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    output: OutputArgs,
    #[command(flatten)]
    watch: WatchArgs,
    #[command(flatten)]
    sampling: SamplingArgs,
    #[command(flatten)]
    kernel: KernelArgs,
    #[command(flatten)]
    explain: ExplainArgs,
    /// Write the summary as JSON, too
    #[arg(long, value_name = "FILE.json", help_heading = "Output")]
    stats: Option<PathBuf>,
}

#[derive(Args)]
#[command(next_help_heading = "Sampling")]
struct SamplingArgs {
    /// Samples a pixel [default: 64]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    spp: Option<u32>,
    /// Start rounds of samples, where they lower the error most, until so much time has passed, such as 60s or 5m (at
    /// most --spp samples, if given)
    #[arg(long, value_name = "TIME", value_parser = duration)]
    time: Option<Duration>,
    #[command(flatten)]
    target: TargetArgs,
    /// What is estimated along each path (see `skylit list integrator`) [default: path]
    #[arg(long, value_name = "NAME")]
    integrator: Option<String>,
    /// Longest path in surfaces, the camera's first hit counted
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    max_depth: Option<u32>,
    /// Point set [default: zsobol, which is the same as owen-sobol where samples are dealt by need, with --time, a target or --aov halves]
    #[arg(long, value_name = "NAME")]
    sampler: Option<String>,
    /// Pixel filter [default: blackman-harris]
    #[arg(long, value_name = "NAME")]
    filter: Option<String>,
    /// Pixels that see no geometry: their filter's integral of the sky where that is known to a thousandth, or samples as
    /// everywhere [default: integrate; sample with --aov halves]
    #[arg(long, value_name = "integrate|sample")]
    sky_pixels: Option<SkyPixels>,
    /// Samples of pixels that outlines run through, at most, for each of another's (1: as many) [default: 4
    /// where a surface point's samples of light are shared out among them, else 1: on paths, under several lights]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_OUTLINES)))]
    outlines: Option<u32>,
    /// Which pixels the samples go to: those that need them, for what --spp samples of each would cost, as far as their need
    /// can be foretold (by-guess: as if that were certain), or all as many
    /// [default: by-need; even below 4 samples, and where --time, a target, --denoise, --aov variance or --aov halves take two sets of points]
    #[arg(long, value_name = "by-need|by-guess|even")]
    dealing: Option<Dealing>,
    /// Seed of every random choice [default: 0]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// The part of the picture to render, as fractions of its width and height
    #[arg(long, value_name = "x0,x1,y0,y1")]
    cropwindow: Option<CropWindow>,
}

#[derive(Args)]
#[command(next_help_heading = "Ray kernel")]
struct KernelArgs {
    /// Which kernel traces: auto, or one of `skylit list backend` [default: auto]
    #[arg(long, value_name = "NAME")]
    backend: Option<String>,
    /// Whether rays may slip through between triangles for speed [default: robust]
    #[arg(long, value_name = "robust|fast")]
    kernel_mode: Option<ModeArg>,
    /// Speed of the kernel's build against that of tracing [default: balanced]
    #[arg(long, value_name = "fast|balanced|best")]
    build: Option<QualityArg>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum ModeArg {
    Robust,
    Fast,
}

impl From<ModeArg> for KernelMode {
    fn from(mode: ModeArg) -> Self {
        match mode {
            ModeArg::Robust => KernelMode::Robust,
            ModeArg::Fast => KernelMode::Fast,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum SkyPixels {
    Integrate,
    Sample,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum QualityArg {
    Fast,
    Balanced,
    Best,
}

/// Runs the verb.
pub fn run(args: &RenderArgs, setting: &Setting) -> Result<()> {
    let start = Instant::now();
    let plan = args.check()?;
    let watch = args.watch.check()?;
    let desc = args.scene.load()?;
    let settings = args.sampling.settings(&desc, &plan, setting.threads)?;
    if plan.output.denoises && settings.spp < 2 {
        let message = "--denoise holds two halves of the samples against each other: give at least --spp 2";
        return Err(Error::Usage(message.into()));
    }
    let s = &args.sampling;
    let integrator = choose_integrator(&desc, s.integrator.as_deref(), s.max_depth)?;
    let renderer = Renderer { integrator, settings };
    let transfer = desc.film.transfer;
    let load = start.elapsed();
    if desc.objects.is_empty() {
        log::warn!("the scene has no object: only the sky can be seen");
    }
    let options = args.kernel.options(setting.threads, expected_rays(&renderer.settings));
    let mut scene = build_scene(desc, &options)?;
    log::info!("{} threads, {}", setting.threads, scene.kernel.describe());
    if let Some(pixel) = args.explain.wanted() {
        let io = (&args.scene, args.stats.as_deref());
        return args.explain.run(pixel, &renderer, &mut scene, io);
    }
    let shown = Picture {
        output: args.output.first(),
        settings: &renderer.settings,
        background: scene.background,
        look: args.output.look(&plan.output, transfer),
    };
    let mut watchers = Watchers::new(watch, &shown, setting.quiet)?;
    let rendered = renderer.render(&scene, &watchers);
    watchers.rendered();
    let rendered = rendered?;
    let stats = &rendered.stats;
    warn_if_missed(renderer.settings.target.as_ref(), stats.reached.as_ref(), stats.spp);
    let mut record = Record::new(&args.scene.input, &scene, &rendered, &renderer.settings);
    let info = PictureInfo { background: scene.background, transfer, metadata: record.metadata() };
    interrupt::hold_off(|| {
        let saving = Instant::now();
        let denoised = args.output.write(&plan.output, &rendered, &info)?;
        record.tell(denoised, load, saving.elapsed(), start.elapsed());
        match &args.stats {
            Some(path) => write_file(path, record.to_json()?.as_bytes()),
            None => Ok(()),
        }
    })?;
    watchers.finish();
    if !setting.quiet {
        eprint!("{record}");
    }
    Ok(())
}

/// What was looked up before anything was loaded.
struct Plan {
    output: OutputPlan,
    target: Option<TargetPlan>,
    sampler: Option<Sampler>,
    filter: Option<PixelFilter>,
}

impl RenderArgs {
    /// Finds all that is wrong with the flags, and outputs that cannot be written, before anything is loaded.
    fn check(&self) -> Result<Plan> {
        let s = &self.sampling;
        if let Some(name) = &s.integrator {
            registry::find("integrator", integrators::REGISTRY, &named(name))?;
        }
        if let Some(name) = self.kernel.backend.as_deref().filter(|n| *n != "auto") {
            let known = accel::KERNELS.iter().map(|k| k.name);
            if !known.clone().any(|k| k == name) {
                return Err(Error::Usage(unknown_name("backend", name, ["auto"].into_iter().chain(known))));
            }
        }
        if let Some(CropWindow(window)) = s.cropwindow {
            crop_window(window, [MAX_SIDE; 2])?;
        }
        let target = s.target.plan(s.spp)?;
        let output = self.output.check()?;
        self.stats.as_deref().map_or(Ok(()), check_file)?;
        Ok(Plan {
            output,
            target,
            sampler: s.sampler.as_deref().map(str::parse).transpose()?,
            filter: s.filter.as_deref().map(str::parse).transpose()?,
        })
    }
}

impl SamplingArgs {
    /// The command line's word counts more than the scene's.
    fn settings(&self, scene: &SceneDesc, plan: &Plan, threads: usize) -> Result<RenderSettings> {
        let usual = RenderSettings::of_scene(scene)?;
        let crop = self.cropwindow.map(|CropWindow(w)| crop_window(w, usual.size)).transpose()?;
        // With a target or a time limit these rule, unless the command line says otherwise.
        let usual_spp = match (&plan.target, self.time) {
            (Some(target), _) => target.max_spp,
            (None, Some(_)) => u32::MAX,
            (None, None) => usual.spp,
        };
        Ok(RenderSettings {
            crop: crop.unwrap_or(usual.crop),
            spp: self.spp.unwrap_or(usual_spp),
            target: plan.target.map(|t| t.target),
            time: self.time,
            seed: self.seed.unwrap_or(usual.seed),
            sampler: match plan.sampler.unwrap_or(usual.sampler) {
                Sampler::ZSobol if plan.output.independent => Sampler::OwenSobol,
                sampler => sampler,
            },
            filter: plan.filter.unwrap_or(usual.filter),
            skip_background: match self.sky_pixels {
                Some(how) => how == SkyPixels::Integrate,
                // What is known to a thousandth has no noise that would tell it.
                None => !plan.output.independent,
            },
            outlines: self.outlines,
            dealing: self.dealing.unwrap_or_default(),
            threads,
            moments: plan.output.moments,
            aovs: plan.output.aovs.clone(),
            ..usual
        })
    }
}

/// The scene's integrator keeps its parameters unless another one is asked for.
pub(super) fn choose_integrator(
    scene: &SceneDesc,
    name: Option<&str>,
    max_depth: Option<u32>,
) -> Result<Arc<dyn Integrator>> {
    let default = integrators::REGISTRY.first().map_or("", |r| r.kind);
    let of_scene = scene.render.integrator.clone().unwrap_or_else(|| named(default));
    let mut node = match name {
        Some(name) if *name != of_scene.kind => named(name),
        _ => of_scene,
    };
    if let Some(depth) = max_depth {
        let row = registry::find("integrator", integrators::REGISTRY, &node)?;
        if !row.params.iter().any(|p| p.name == MAX_DEPTH) {
            return Err(Error::Usage(format!("the integrator \"{}\" has no --max-depth", node.kind)));
        }
        node.params.list.retain(|p| p.name != MAX_DEPTH);
        node.params = std::mem::take(&mut node.params).with(MAX_DEPTH, Value::Number(f64::from(depth)));
    }
    registry::build("integrator", integrators::REGISTRY, &node)
}

const MAX_DEPTH: &str = "max_depth";

fn named(kind: &str) -> Node {
    Node { kind: kind.to_owned(), ..Node::default() }
}

/// Rays of a render, roughly: with a limit of time, those of a million samples a second and thread.
fn expected_rays(s: &RenderSettings) -> u64 {
    /// A camera ray, a shadow ray, and a bounce where something is hit.
    const RAYS_A_SAMPLE: u64 = 2;
    let spp = match s.target {
        // As if a sample's error were as large as what it shows.
        Some(target) => s.spp.min(target.error.powi(-2) as u32),
        None => s.spp,
    };
    let samples = s.crop.area() as u64 * u64::from(spp);
    let samples = match s.time {
        Some(time) => samples.min((time.as_secs_f64() * 1e6) as u64 * s.threads as u64),
        None => samples,
    };
    samples.saturating_mul(RAYS_A_SAMPLE)
}

impl KernelArgs {
    fn options(&self, threads: usize, expected_rays: u64) -> BuildOptions {
        let quality = match self.build {
            Some(QualityArg::Fast) => BuildQuality::Fast,
            Some(QualityArg::Best) => BuildQuality::Best,
            Some(QualityArg::Balanced) | None => BuildQuality::Balanced,
        };
        let mode = self.kernel_mode.map_or(KernelMode::Robust, KernelMode::from);
        let backend = self.backend.clone().unwrap_or_else(|| "auto".into());
        BuildOptions { backend, kernel: KernelOptions { quality, mode, threads, simd: None, expected_rays } }
    }
}
