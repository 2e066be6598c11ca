//! `skylit compare`: pictures against a reference.

use super::args::{CropWindow, number_in};
use super::statistical_args::StatisticalArgs;
use super::{Setting, interrupt, print};
use crate::base::image_data::Encoding;
use crate::compare::comparison::{CompareOptions, Comparison, compare};
use crate::compare::folders;
use crate::compare::html::{self, Shown};
use crate::compare::limits::Limit;
use crate::compare::metrics::{self, MetricOptions, PIXELS_PER_DEGREE};
use crate::compare::open::{Crop, Mask, PairOptions, Source};
use crate::compare::pair::Space;
use crate::compare::present;
use crate::compare::statistics::equivalence::Answer;
use crate::compare::statistics::{Outcome, Question, StatisticalResult};
use crate::error::{Error, Result};
use crate::image::load::LoadOptions;
use crate::image::write::{check_file, write_file};
use crate::report::machine::Machine;
use clap::{Args, ValueEnum};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Flags of `skylit compare`.
#[derive(Args)]
pub struct CompareArgs {
    /// The picture that is taken for true, or a folder of such (EXR, HDR, PNG, JPEG, TIFF or PFM)
    #[arg(value_name = "REF")]
    reference: PathBuf,
    /// What is held against it; a folder is compared name by name
    #[arg(value_name = "TEST", required = true)]
    tests: Vec<PathBuf>,
    /// Figures to take (see `skylit list metric`) [default: all]
    #[arg(long, value_name = "NAME,...|all", value_delimiter = ',')]
    metric: Vec<String>,
    #[command(flatten)]
    what: WhatArgs,
    #[command(flatten)]
    choices: ChoiceArgs,
    #[command(flatten)]
    statistical: StatisticalArgs,
    #[command(flatten)]
    output: OutputArgs,
}

#[derive(Args)]
#[command(next_help_heading = "What is compared")]
struct WhatArgs {
    /// Layer of EXR files, such as albedo or denoised [default: the picture itself]
    #[arg(long, value_name = "NAME")]
    layer: Option<String>,
    /// Channels of it [default: R, G and B, or else all that both have]
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    channels: Option<Vec<String>>,
    /// A part of the picture: fractions of width and height, or pixels from the left top on
    #[arg(long, value_name = "x0,x1,y0,y1|WxH+X+Y")]
    crop: Option<CropArg>,
    /// Only pixels where this picture is brighter than half of white
    #[arg(long, value_name = "FILE", conflicts_with = "object")]
    mask: Option<PathBuf>,
    /// Only pixels that show the object of this number, by the reference's layer of `--aov id` (numbers: `skylit info`)
    #[arg(long, value_name = "N")]
    object: Option<u32>,
    /// How 8-bit and 16-bit values hold light [default: srgb]
    #[arg(long, value_name = "srgb|linear")]
    assume: Option<EncodingArg>,
    /// Where figures are taken: on radiance, or on what a display shows of it [default: display where all files hold 8 or
    /// 16 bits, else linear; SSIM and FLIP: display]
    #[arg(long, value_name = "linear|display")]
    space: Option<SpaceArg>,
    /// Stops by which both pictures are brightened first [default: 0]
    #[arg(long, value_name = "EV", allow_hyphen_values = true, value_parser = |s: &str| number_in(s, -64.0..=64.0))]
    exposure: Option<f64>,
}

#[derive(Args)]
#[command(next_help_heading = "Choices of metrics")]
struct ChoiceArgs {
    /// Added to the reference's square by relative errors [default: 0.01 of its squared mean]
    #[arg(long, value_name = "X", value_parser = |s: &str| number_in(s, 1e-30..=1e30))]
    epsilon: Option<f64>,
    /// The largest possible value, of PSNR and SSIM [default: 1 of colours, else the reference's largest]
    #[arg(long, value_name = "X", value_parser = |s: &str| number_in(s, 1e-30..=1e30))]
    peak: Option<f64>,
    /// Pixels in a degree of the viewer's field, of FLIP [default: 67.02, a 4K display of 0.7 m from 0.7 m]
    #[arg(long, value_name = "N", value_parser = |s: &str| number_in(s, 1.0..=1000.0))]
    ppd: Option<f64>,
}

#[derive(Args)]
#[command(next_help_heading = "Output")]
struct OutputArgs {
    /// Exit with code 1 if a figure is above this (bias: farther from 0); may be given several times
    #[arg(long, value_name = "METRIC=VALUE", value_parser = Limit::above)]
    fail_above: Vec<Limit>,
    /// Exit with code 1 if a figure is below this (PSNR, SSIM)
    #[arg(long, value_name = "METRIC=VALUE", value_parser = Limit::below)]
    fail_below: Vec<Limit>,
    /// Write the record as JSON, too; - is stdout, in place of the text
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a line of CSV a figure, too; - is stdout
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write the table as Markdown, too; - is stdout
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// Write a page to look at, too: wipe, flip, heat maps, values of pixels
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Keep every value of the page to the last bit, for a larger file
    #[arg(long, requires = "html")]
    lossless: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum EncodingArg {
    Srgb,
    Linear,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum SpaceArg {
    Linear,
    Display,
}

#[derive(Debug, Clone, Copy)]
struct CropArg(Crop);

impl FromStr for CropArg {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        if s.contains(',') {
            let CropWindow([x0, x1, y0, y1]) = s.parse()?;
            let ordered = 0.0 <= x0 && x0 < x1 && x1 <= 1.0 && 0.0 <= y0 && y0 < y1 && y1 <= 1.0;
            return match ordered {
                true => Ok(CropArg(Crop::Fractions([x0, x1, y0, y1]))),
                false => Err("takes fractions from 0 to 1, x0 < x1 and y0 < y1".into()),
            };
        }
        let numbers: Vec<Option<usize>> = s.split(['x', '+']).map(|n| n.parse().ok()).collect();
        match numbers[..] {
            [Some(w), Some(h), Some(x), Some(y)] if w > 0 && h > 0 => Ok(CropArg(Crop::Pixels([x, y, w, h]))),
            _ => Err("takes x0,x1,y0,y1 as fractions or WxH+X+Y in pixels, such as 200x100+40+0".into()),
        }
    }
}

/// The record.
#[derive(Serialize)]
struct Record<'a> {
    machine: &'a Machine,
    comparisons: &'a [Comparison],
    /// What the tests of the pairs came to, in the same order.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    statistical: &'a [StatisticalResult],
    /// Pictures that only one of two folders has.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    alone: &'a [PathBuf],
    /// Limits that were missed.
    missed: &'a [String],
}

/// Runs the verb.
pub fn run(args: &CompareArgs, setting: &Setting) -> Result<()> {
    let o = &args.output;
    let files = [&o.json, &o.csv, &o.markdown, &o.html];
    files.into_iter().flatten().filter(|p| !is_stdout(p)).try_for_each(|p| check_file(p))?;
    let options = args.options()?;
    let (pairs, alone) = args.pairs()?;
    let (mut comparisons, mut shown) = (Vec::new(), Vec::new());
    let mut tested = Vec::new();
    let mut kept: Option<Source> = None;
    for [given, test_given] in &pairs {
        // Of several pictures of one scene the first stands for all where figures are taken.
        let [reference, test] = &[given, test_given].map(|g| args.statistical.files(g).swap_remove(0));
        let source = kept.take().filter(|k| k.path == *reference);
        let (source, test) = rayon::join(
            || source.map_or_else(|| Source::read(reference, &options.load), Ok),
            || Source::read(test, &options.load),
        );
        let (source, test) = (source?, test?);
        let compare_options = options.of(&source)?;
        let (comparison, pair) = compare(&source, &test, &compare_options)?;
        if args.statistical.statistical {
            let question = args.question(&compare_options.pair);
            tested.push(args.statistical.run(given, test_given, &question)?);
        }
        if o.html.is_some() {
            shown.push(Shown::new(comparison.clone(), &pair, [&source, &test], tested.last()));
        }
        comparisons.push(comparison);
        kept = Some(source);
    }
    let mut missed = args.missed(&comparisons, &alone);
    missed.extend(comparisons.iter().zip(&tested).filter_map(|(c, t)| failed(c, t)));
    let page = match o.html {
        Some(_) => Some(html::report(&shown, &Machine::here(), o.lossless).to_html()?),
        None => None,
    };
    interrupt::hold_off(|| {
        o.html.as_deref().zip(page).map_or(Ok(()), |(path, page)| write_file(path, page.as_bytes()))?;
        args.write(&comparisons, &tested, &alone, &missed)
    })?;
    if !setting.quiet {
        missed.iter().for_each(|m| log::info!("{m}"));
    }
    match missed.as_slice() {
        [] => Ok(()),
        all => Err(Error::Failed(format!("compare: {}", all.join("; ")))),
    }
}

/// What a test says against a picture.
fn failed(c: &Comparison, t: &StatisticalResult) -> Option<String> {
    let margin = t.equivalence.as_ref().filter(|e| e.answer != Answer::Equivalent);
    let words = match margin {
        Some(e) => &e.sentence,
        None if t.outcome == Outcome::Different => &t.sentence,
        None => return None,
    };
    Some(format!("{}: {words}", c.test))
}

fn is_stdout(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Choices that hold for all pairs.
struct Options<'a> {
    args: &'a CompareArgs,
    load: LoadOptions,
    metrics: Vec<&'static metrics::Metric>,
    mask: Option<Mask>,
}

impl Options<'_> {
    /// Those of one reference.
    fn of(&self, reference: &Source) -> Result<CompareOptions> {
        let (what, choices) = (&self.args.what, &self.args.choices);
        let mask = match what.object {
            Some(object) => Some(Mask::of_object(&reference.path, object)?),
            None => self.mask.clone(),
        };
        let space = what.space.map(|s| match s {
            SpaceArg::Linear => Space::Linear,
            SpaceArg::Display => Space::Display,
        });
        let pair = PairOptions {
            channels: what.channels.clone(),
            crop: what.crop.map(|CropArg(crop)| crop),
            mask,
            exposure: what.exposure.unwrap_or(0.0) as f32,
            space,
        };
        let choices = MetricOptions {
            epsilon: choices.epsilon,
            peak: choices.peak,
            pixels_per_degree: choices.ppd.map_or(PIXELS_PER_DEGREE, |p| p as f32),
            keep_space: space.is_some(),
        };
        Ok(CompareOptions {
            pair,
            metrics: self.metrics.clone(),
            choices,
            maps: self.args.output.html.is_some(),
        })
    }
}

impl CompareArgs {
    fn options(&self) -> Result<Options<'_>> {
        let limits = self.output.fail_above.iter().chain(&self.output.fail_below);
        let mut names = self.metric.clone();
        if names.is_empty() {
            names.push("all".into());
        }
        names.extend(limits.map(|l| l.metric().name.to_owned()));
        let encoding = self.what.assume.map(|a| match a {
            EncodingArg::Srgb => Encoding::Srgb,
            EncodingArg::Linear => Encoding::Linear,
        });
        Ok(Options {
            args: self,
            load: LoadOptions { layer: self.what.layer.clone(), encoding },
            metrics: metrics::find(&names)?,
            mask: self.what.mask.as_deref().map(Mask::of_picture).transpose()?,
        })
    }

    /// Reference and test of each comparison, and pictures without a partner.
    fn pairs(&self) -> Result<(Vec<[PathBuf; 2]>, Vec<PathBuf>)> {
        if !self.reference.is_dir() {
            if let Some(folder) = self.tests.iter().find(|t| t.is_dir()) {
                let text = format!("{} is a folder, and the reference is none", folder.display());
                return Err(Error::Usage(text));
            }
            return Ok((
                self.tests.iter().map(|t| [self.reference.clone(), t.clone()]).collect(),
                Vec::new(),
            ));
        }
        let (mut pairs, mut alone) = (Vec::new(), Vec::new());
        for test in &self.tests {
            if !test.is_dir() {
                let text = format!("the reference is a folder, and {} is none", test.display());
                return Err(Error::Usage(text));
            }
            let matched = folders::matched(&self.reference, test)?;
            pairs.extend(matched.pairs);
            alone.extend(matched.alone);
        }
        Ok((pairs, alone))
    }

    /// What is asked of the noise; the mask is a region of its own.
    fn question(&self, options: &PairOptions) -> Question {
        let mut question = self.statistical.question();
        let name = self.what.object.map_or("mask".to_owned(), |n| format!("object {n}"));
        question.masks.extend(options.mask.as_ref().map(|m| (name, m.counted.clone())));
        question
    }

    /// Limits that were missed, in words. Where there is a limit, a picture without a partner misses it.
    fn missed(&self, all: &[Comparison], alone: &[PathBuf]) -> Vec<String> {
        let limits: Vec<&Limit> = self.output.fail_above.iter().chain(&self.output.fail_below).collect();
        let of_pairs = all.iter().flat_map(|c| limits.iter().filter_map(|l| l.missed(c)));
        let mut missed: Vec<String> = of_pairs.collect();
        if !limits.is_empty() {
            missed.extend(alone.iter().map(|p| format!("{} has no partner", p.display())));
        }
        missed
    }

    fn write(
        &self,
        all: &[Comparison],
        tested: &[StatisticalResult],
        alone: &[PathBuf],
        missed: &[String],
    ) -> Result<()> {
        let o = &self.output;
        let mut printed = false;
        let mut put = |path: &Option<PathBuf>, text: &dyn Fn() -> Result<String>| match path {
            Some(path) if is_stdout(path) => {
                printed = true;
                print(text()?.as_bytes())
            }
            Some(path) => write_file(path, text()?.as_bytes()),
            None => Ok(()),
        };
        put(&o.json, &|| {
            let record =
                Record { machine: &Machine::here(), comparisons: all, statistical: tested, alone, missed };
            let text = serde_json::to_string_pretty(&record);
            text.map(|t| t + "\n").map_err(|e| Error::Internal(format!("cannot write the record: {e}")))
        })?;
        put(&o.csv, &|| Ok(present::csv(all)))?;
        put(&o.markdown, &|| Ok(present::markdown(all)))?;
        if printed {
            return Ok(());
        }
        let mut text = present::text(all);
        for (c, tested) in all.iter().zip(tested) {
            let heading = if all.len() > 1 { format!("{}: ", c.test) } else { String::new() };
            text += &format!("\n{heading}{}", tested.to_text());
        }
        alone.iter().for_each(|p| text += &format!("without a partner: {}\n", p.display()));
        print(text.as_bytes())
    }
}
