//! `skylit convert`: scenes of other programs as native ones.

use super::Setting;
use super::scene_args::CompatArg;
use crate::error::{Error, Result};
use crate::formats::{LoadOptions, load_with, native};
use crate::image::write::check_file;
use clap::Args;
use std::path::PathBuf;

/// Flags of `skylit convert`.
#[derive(Args)]
pub struct ConvertArgs {
    /// Scene file of any format, or a mesh alone
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// Native scene to write (.toml); meshes and pictures go into a folder beside it
    #[arg(value_name = "OUT.toml")]
    output: PathBuf,
    /// Look of scenes of other programs: as those show them, or in radiometric units [default: exact]
    #[arg(long, value_name = "exact|physical")]
    compat: Option<CompatArg>,
}

/// Runs the verb.
pub fn run(args: &ConvertArgs, setting: &Setting) -> Result<()> {
    let ending = args.output.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if ending != native::FORMAT.extension {
        let output = args.output.display();
        let known = native::FORMAT.extension;
        return Err(Error::Usage(format!("{output}: scenes are written as .{known}, not as \"{ending}\"")));
    }
    check_file(&args.output)?;
    let options =
        LoadOptions { compat: args.compat.map(Into::into).unwrap_or_default(), ..LoadOptions::default() };
    let scene = load_with(&args.input, &options)?;
    native::write::write(&args.output, &scene)?;
    if !setting.quiet {
        for loss in &scene.losses {
            eprintln!("{}: lost: {}", loss.place, loss.what);
        }
    }
    Ok(())
}
