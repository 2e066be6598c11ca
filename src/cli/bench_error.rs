//! `skylit bench error`: error against time.

use super::bench::BenchBar;
use super::scene_args::SceneArgs;
use super::{Setting, interrupt, print};
use crate::bench::error::measure::PixelSet;
use crate::bench::error::present::{self, gather};
use crate::bench::error::record::{FORMAT, Record};
use crate::bench::error::reference::Kept;
use crate::bench::error::run::{Measured, Plan, TruthPlan, measure, program};
use crate::bench::error::sweep::{Subject, Sweep, combinations, truth_settings};
use crate::error::{Error, Result};
use crate::image::write::{check_file, write_file};
use crate::render::film::Film;
use crate::render::settings::RenderSettings;
use crate::report::Report;
use crate::report::machine::Machine;
use crate::report::viewer::{Viewed, Viewer};
use crate::sampler::hash::mix64;
use crate::scene::build::BuildOptions;
use clap::{Args, ValueEnum};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Flags of `skylit bench error`.
#[derive(Args)]
pub struct ErrorArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Further scenes, measured alike. A single record of --json (or a peer's) instead of scenes is shown again
    #[arg(value_name = "SCENE")]
    more: Vec<PathBuf>,
    /// Render with each of these values of a setting: a flag of `skylit render` such as sampler, sky-sampling, backend or
    /// max-depth, or a parameter of the integrator such as mis; several -L give every combination
    #[arg(short = 'L', long = "sweep", value_name = "KEY=VALUE,...")]
    sweeps: Vec<Sweep>,
    /// Samples a pixel that are measured, rising
    #[arg(long, value_name = "N,...", value_delimiter = ',', default_value = "4,16,64")]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    spp: Vec<u32>,
    /// Independent runs of each, at least 2
    #[arg(long, value_name = "N", default_value = "8", value_parser = clap::value_parser!(u32).range(2..=1000))]
    replicates: u32,
    #[command(flatten)]
    truth: TruthArgs,
    /// Records of other measurements or renderers (see benches/peers) that are drawn beside this one's
    #[arg(long, value_name = "RECORD", num_args = 1)]
    with: Vec<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

#[derive(Args)]
#[command(next_help_heading = "Reference")]
struct TruthArgs {
    /// The truth: an EXR picture of one scene's film; one with --aov variance says how noisy it is
    #[arg(long, value_name = "FILE.exr", conflicts_with = "more")]
    reference: Option<PathBuf>,
    /// Samples a pixel of references that are rendered [default: 64 times the most of --spp]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..))]
    reference_spp: Option<u32>,
    /// Folder in which references are kept [default: beside the record of --json]
    #[arg(long, value_name = "DIR")]
    references: Option<PathBuf>,
}

#[derive(Args)]
#[command(next_help_heading = "Output")]
struct OutputArgs {
    /// The pixels whose error is told: all, or those that surfaces cover
    #[arg(long, value_name = "all|surfaces", default_value = "all")]
    pixels: PixelsArg,
    /// Write the record as JSON, too
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a line of CSV a run, too
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write the plot of the first scene, too
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Write a page with plots, tables and pictures at equal time, too
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum PixelsArg {
    All,
    Surfaces,
}

impl From<PixelsArg> for PixelSet {
    fn from(arg: PixelsArg) -> Self {
        match arg {
            PixelsArg::All => PixelSet::All,
            PixelsArg::Surfaces => PixelSet::Surfaces,
        }
    }
}

impl ErrorArgs {
    pub(super) fn run(&self, setting: &Setting) -> Result<()> {
        let o = &self.output;
        [&o.json, &o.csv, &o.svg, &o.html].into_iter().flatten().try_for_each(|p| check_file(p))?;
        if !self.spp.windows(2).all(|w| w[0] < w[1]) {
            return Err(Error::Usage("--spp takes rising numbers, such as 4,16,64".into()));
        }
        let peers = self.with.iter().map(|p| Record::load(p)).collect::<Result<Vec<_>>>()?;
        let set = PixelSet::from(o.pixels);
        if self.scene.input.extension().is_some_and(|e| e == "json") {
            let record = self.kept_record()?;
            let all: Vec<&Record> = std::iter::once(&record).chain(&peers).collect();
            interrupt::hold_off(|| self.write(&all, &[]))?;
            return print(present::text(&all, set).as_bytes());
        }
        let inputs = std::iter::once(&self.scene.input).chain(&self.more);
        let plans = inputs.map(|input| self.plan(input, setting)).collect::<Result<Vec<_>>>()?;
        let bar = BenchBar::new(setting);
        let measured: Result<Vec<Measured>> = plans.iter().map(|plan| measure(plan, &bar)).collect();
        bar.finish();
        let measured = measured?;
        let record = Record {
            format: FORMAT.into(),
            program: program(),
            command: std::env::args_os().map(|a| a.to_string_lossy().into_owned()).collect(),
            machine: serde_json::to_value(Machine::here())
                .map_err(|e| Error::Internal(format!("cannot write the machine's facts: {e}")))?,
            scenes: measured.iter().map(|m| m.record.clone()).collect(),
        };
        let all: Vec<&Record> = std::iter::once(&record).chain(&peers).collect();
        interrupt::hold_off(|| self.write(&all, &measured))?;
        print(present::text(&all, set).as_bytes())
    }

    /// The record that stands in place of scenes.
    fn kept_record(&self) -> Result<Record> {
        if !self.more.is_empty() || !self.sweeps.is_empty() {
            let message =
                "a record is shown as it is: it takes no further scenes and no -L (--with adds records)";
            return Err(Error::Usage(message.into()));
        }
        Record::load(&self.scene.input)
    }

    fn plan(&self, input: &Path, setting: &Setting) -> Result<Plan> {
        let mut scene = self.scene.clone();
        scene.input = input.to_owned();
        let desc = scene.load()?;
        let mut settings = RenderSettings::of_scene(&desc)?;
        settings.threads = setting.threads;
        let mut options = BuildOptions::default();
        options.kernel.threads = setting.threads;
        // What `auto` weighs against building a second kernel: the longest of the runs.
        options.kernel.expected_rays =
            u64::from(*self.spp.last().unwrap_or(&1)) * settings.crop.area() as u64 * 2;
        let name = input.file_stem().map_or("scene".into(), |s| s.to_string_lossy().into_owned());
        let most = self.spp.last().copied().unwrap_or(1);
        let variants = combinations(&self.sweeps)?;
        let truth = match &self.truth.reference {
            Some(path) => TruthPlan::Given(path.clone()),
            None => {
                let spp = self.truth.reference_spp.unwrap_or(most.saturating_mul(64));
                TruthPlan::Rendered { spp, kept: self.kept(&scene, &name, spp, &truth_settings(&variants)?) }
            }
        };
        Ok(Plan {
            name,
            subject: Subject { desc, settings, options },
            variants,
            ladder: self.spp.clone(),
            replicates: self.replicates,
            truth,
        })
    }

    /// Where the reference of a scene is kept, if anywhere.
    fn kept(
        &self,
        scene: &SceneArgs,
        name: &str,
        spp: u32,
        settings: &BTreeMap<String, String>,
    ) -> Option<Kept> {
        let beside = || self.output.json.as_ref().map(|json| json.with_extension("references"));
        let folder = self.truth.references.clone().or_else(beside)?;
        let input = std::fs::canonicalize(&scene.input).unwrap_or_else(|_| scene.input.clone());
        let content = std::fs::read(&input).unwrap_or_default();
        let hash = content.iter().fold(0, |h: u64, &b| mix64(h ^ u64::from(b)));
        let key = format!(
            "{} {hash:016x} {scene:?} {settings:?} {spp} {}",
            input.display(),
            env!("CARGO_PKG_VERSION")
        );
        let short = key.bytes().fold(0, |h: u64, b| mix64(h ^ u64::from(b))) as u32;
        Some(Kept { path: folder.join(format!("{name}-{short:08x}.exr")), key })
    }

    fn write(&self, records: &[&Record], measured: &[Measured]) -> Result<()> {
        let (o, set) = (&self.output, PixelSet::from(self.output.pixels));
        if let Some(path) = &o.json {
            write_file(path, records[0].to_json()?.as_bytes())?;
        }
        if let Some(path) = &o.csv {
            write_file(path, records[0].to_csv().as_bytes())?;
        }
        if let (Some(path), Some(scene)) = (&o.svg, gather(records).first()) {
            write_file(path, scene.plot(set).to_svg()?.as_bytes())?;
        }
        if let Some(path) = &o.html {
            let mut report = Report::new("Error against time");
            // What a record was measured on is not known in this form.
            if !measured.is_empty() {
                report = report.machine(&Machine::here());
            }
            let page = present::page(records, set, measured.iter().map(shown).collect(), report);
            write_file(path, page.to_html()?.as_bytes())?;
        }
        Ok(())
    }
}

/// Of each scene the reference, and of each variant the first picture whose time comes nearest to that of the quickest
/// variant's longest renders.
fn shown(measured: &Measured) -> Option<Viewer> {
    let series = &measured.record.series;
    let seconds = |series: usize, rung: usize| measured.record.series[series].points[rung].runs[0].seconds;
    let last = measured.films.first()?.len().checked_sub(1)?;
    let time = (0..series.len()).map(|s| seconds(s, last)).fold(f64::INFINITY, f64::min);
    let picture = |(s, films): (usize, &Vec<Film>)| {
        let far = |rung: usize| (seconds(s, rung) / time).ln().abs();
        let rung = (0..=last).min_by(|&a, &b| far(a).total_cmp(&far(b)))?;
        let name = format!("{}, {} spp", series[s].name, series[s].points[rung].spp);
        let facts = vec![("seconds".to_owned(), format!("{:.3}", seconds(s, rung)))];
        Some(Viewed { facts, ..Viewed::of_film(name, films.get(rung)?) })
    };
    let window = measured.films[0][0].window();
    let rgb = measured.truth.rgb.clone();
    let facts = vec![("samples a pixel".to_owned(), measured.record.reference.spp.to_string())];
    let reference = Viewed { name: "reference".into(), rgb, facts };
    let pictures: Vec<Viewed> =
        std::iter::once(reference).chain(measured.films.iter().enumerate().filter_map(picture)).collect();
    let alike = pictures.iter().all(|p| p.rgb.len() == window.area());
    alike.then(|| Viewer::of_window(window, pictures))
}
