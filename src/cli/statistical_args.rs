//! Flags of the test for bias, and the reading of what it needs.

use super::args::share;
use crate::compare::statistics::replicates::Replicates;
use crate::compare::statistics::{Question, StatisticalResult, compare};
use crate::error::{Error, Result};
use crate::image::read::read_planes;
use clap::Args;
use std::path::{Path, PathBuf};

/// Flags of the test for bias.
#[derive(Args, Debug, Clone, Default)]
#[command(next_help_heading = "Is one of them biased?")]
pub struct StatisticalArgs {
    /// Test whether the pictures differ by more than their noise, which layer `halves` tells (render with --aov halves), or
    /// several pictures of the same scene (--tiles)
    #[arg(long)]
    pub statistical: bool,
    /// Ask, too, whether the means of all channels are the same within such a share of the reference's, such as 0.1%
    #[arg(long, value_name = "SHARE", value_parser = share, requires = "statistical", allow_hyphen_values = true)]
    pub equivalent: Option<f64>,
    /// How often, of pictures without a difference, one may be found [default: 1%]
    #[arg(long, value_name = "SHARE", value_parser = share, requires = "statistical", allow_hyphen_values = true)]
    pub alpha: Option<f64>,
    /// Side of a tile in pixels [default: 16]
    #[arg(long, value_name = "N", requires = "statistical", value_parser = clap::value_parser!(u32).range(1..))]
    pub tile: Option<u32>,
    /// REF and TEST are each several pictures of the same scene with other seeds, a comma between their names
    #[arg(long, requires = "statistical")]
    pub tiles: bool,
}

impl StatisticalArgs {
    /// What is asked of pictures; masks and names of objects are the caller's to add.
    pub fn question(&self) -> Question {
        let usual = Question::default();
        Question {
            alpha: self.alpha.unwrap_or(usual.alpha),
            tile: self.tile.map_or(usual.tile, |n| n as usize),
            equivalent: self.equivalent,
            ..usual
        }
    }

    /// The files behind one argument: parted at commas with `--tiles`.
    pub fn files(&self, given: &Path) -> Vec<PathBuf> {
        let text = given.to_string_lossy();
        match self.tiles {
            true => text.split(',').filter(|name| !name.is_empty()).map(PathBuf::from).collect(),
            false => vec![given.to_owned()],
        }
    }

    /// The replicates behind one argument.
    ///
    /// # Errors
    /// Files that cannot be read; see [`Replicates::of_pictures`].
    pub fn replicates(&self, given: &Path) -> Result<Replicates> {
        let read = |path: PathBuf| Ok((path.display().to_string(), read_planes(&path)?));
        let pictures: Vec<_> = self.files(given).into_iter().map(read).collect::<Result<_>>()?;
        if pictures.is_empty() {
            return Err(Error::Usage(format!("{}: names no picture", given.display())));
        }
        Replicates::of_pictures(&pictures)
    }

    /// Reads both and tests them.
    ///
    /// # Errors
    /// As [`StatisticalArgs::replicates`] and [`compare`].
    pub fn run(&self, reference: &Path, test: &Path, question: &Question) -> Result<StatisticalResult> {
        let [a, b] = [reference, test].map(|path| self.replicates(path));
        let (a, b) = (a?, b?);
        compare(&a, &b, question)
    }
}
