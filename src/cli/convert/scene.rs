//! Scenes of other programs as native ones.

use crate::cli::Setting;
use crate::cli::scene_args::CompatArg;
use crate::error::Result;
use crate::formats::{LoadOptions, load_with, native};
use crate::image::write::check_file;
use std::path::Path;

/// Writes the scene.
pub fn run(input: &Path, output: &Path, compat: Option<CompatArg>, setting: &Setting) -> Result<()> {
    check_file(output)?;
    let options =
        LoadOptions { compat: compat.map(Into::into).unwrap_or_default(), ..LoadOptions::default() };
    let scene = load_with(input, &options)?;
    native::write::write(output, &scene)?;
    if !setting.quiet {
        for loss in &scene.losses {
            eprintln!("{}: lost: {}", loss.place, loss.what);
        }
    }
    Ok(())
}
