//! `skylit convert`: scenes of other programs as native ones, pictures as others, skies in other layouts.

mod listing;
mod picture;
mod scene;
mod sky;

use super::Setting;
use super::args::{TransferArg, number_in};
use super::scene_args::CompatArg;
use crate::base::image_data::Encoding;
use crate::error::{Error, Result};
use crate::formats::native;
use crate::image::write::{KNOWN, is_picture};
use clap::{ArgAction, Args, ValueEnum};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Flags of `skylit convert`.
#[derive(Args)]
pub struct ConvertArgs {
    /// Scene of any format, mesh, or picture (EXR, HDR, PNG, JPEG, TIFF, PFM); with --to, a sky
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// What to write: a native scene, whose meshes and pictures go into a folder beside it, or a picture; a folder for
    /// the faces of a cube
    #[arg(
        value_name = "OUT.toml|exr|hdr|png|...",
        required_unless_present = "layers",
        conflicts_with = "layers"
    )]
    output: Option<PathBuf>,
    /// Look of scenes of other programs: as those show them, or in radiometric units [default: exact]
    #[arg(long, value_name = "exact|physical")]
    compat: Option<CompatArg>,
    #[command(flatten)]
    pictures: PictureArgs,
}

/// Flags of pictures.
#[derive(Args)]
#[command(next_help_heading = "Pictures")]
struct PictureArgs {
    /// List what is in the picture, and write nothing
    #[arg(long)]
    layers: bool,
    /// The layer to take, by its name or the end of it [default: all into EXR, else the picture itself]
    #[arg(long, value_name = "NAME")]
    layer: Option<String>,
    /// Stops of exposure [default: 0]
    #[arg(long, value_name = "EV", allow_hyphen_values = true, value_parser = |s: &str| number_in(s, -64.0..=64.0))]
    exposure: Option<f64>,
    /// Tone operator, for PNG and JPEG (see `skylit list tonemap`) [default: none]
    #[arg(long, value_name = "NAME")]
    tonemap: Option<String>,
    /// Curve of PNG and JPEG: srgb, linear, or a gamma such as 2.2 [default: srgb]
    #[arg(long, value_name = "srgb|linear|GAMMA")]
    transfer: Option<TransferArg>,
    /// What whole numbers of IN mean [default: srgb]
    #[arg(long, value_name = "srgb|linear")]
    assume: Option<Assume>,
    /// Bits a sample: 8 or 16 of PNG, 16 or 32 of EXR, 8, 16 or 32 of TIFF [default: 8; of EXR as IN has it; 32 of TIFF]
    #[arg(long, value_name = "N")]
    bits: Option<u32>,
    /// Show numbers by a scale of colours: of --channel, of the layer's one channel, or of its luminance
    #[arg(long, alias = "false-color", value_name = "viridis|turbo|magma|inferno|grey", action = ArgAction::Set)]
    false_colour: Option<String>,
    /// The channel that --false-colour shows
    #[arg(long, value_name = "NAME", requires = "false_colour")]
    channel: Option<String>,
    /// The ends of the scale [default: the 1 % and 99 % quantiles]
    #[arg(long, value_name = "A..B", requires = "false_colour", allow_hyphen_values = true)]
    range: Option<Ends>,
    /// Equal steps of the scale are equal ratios
    #[arg(long, requires = "false_colour")]
    log: bool,
    /// The layout of a sky to write, with the flux of every part of it kept: six faces into a folder, or one picture
    #[arg(long, value_name = "cube|equirectangular", conflicts_with_all = ["layers", "false_colour", "layer"])]
    to: Option<Layout>,
    /// Pixels across a face, or down an equirectangular picture [default: as fine as IN]
    #[arg(long, value_name = "N", requires = "to")]
    size: Option<u32>,
}

impl PictureArgs {
    fn encoding(&self) -> Option<Encoding> {
        self.assume.map(|a| match a {
            Assume::Srgb => Encoding::Srgb,
            Assume::Linear => Encoding::Linear,
        })
    }

    /// The first flag that a scene has no use for.
    fn given(&self) -> Option<&'static str> {
        let all = [
            (self.layer.is_some(), "--layer"),
            (self.exposure.is_some(), "--exposure"),
            (self.tonemap.is_some(), "--tonemap"),
            (self.transfer.is_some(), "--transfer"),
            (self.assume.is_some(), "--assume"),
            (self.bits.is_some(), "--bits"),
            (self.false_colour.is_some(), "--false-colour"),
        ];
        all.iter().find(|(given, _)| *given).map(|(_, name)| *name)
    }
}

/// How whole numbers hold light.
#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Assume {
    Srgb,
    Linear,
}

/// Layouts of skies.
#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Layout {
    Cube,
    Equirectangular,
}

/// `A..B`.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Ends([f32; 2]);

impl FromStr for Ends {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        let end = |t: &str| t.trim().parse::<f32>().ok().filter(|v| v.is_finite());
        let ends = s.split_once("..").and_then(|(a, b)| Some([end(a)?, end(b)?]));
        ends.filter(|[a, b]| a != b).map(Ends).ok_or_else(|| "takes two numbers, such as 0..1".to_owned())
    }
}

/// Runs the verb.
pub fn run(args: &ConvertArgs, setting: &Setting) -> Result<()> {
    let Some(output) = &args.output else { return listing::run(&args.input) };
    let no_compat = |what: &str| match args.compat {
        Some(_) => Err(Error::Usage(format!("--compat is for scenes, not for {what}"))),
        None => Ok(()),
    };
    if let Some(layout) = args.pictures.to {
        no_compat("skies")?;
        return sky::run(&args.input, output, layout, &args.pictures);
    }
    if is_picture(output) {
        no_compat("pictures")?;
        return picture::run(&args.input, output, &args.pictures, setting);
    }
    if !ends_in(output, native::FORMAT.extension) {
        let ending = output.extension().unwrap_or_default().to_string_lossy();
        let message = format!("scenes are written as .{}, pictures as {KNOWN}", native::FORMAT.extension);
        return Err(Error::Usage(format!("{}: {message}, not as \"{ending}\"", output.display())));
    }
    if let Some(flag) = args.pictures.given() {
        return Err(Error::Usage(format!("{flag} is for pictures, not for scenes")));
    }
    scene::run(&args.input, output, args.compat, setting)
}

fn ends_in(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
}
