//! Flags that say when a picture is good enough.

use super::args::share;
use crate::error::{Error, Result};
use crate::render::adaptive::{Part, Reached, Target};
use clap::{Args, ValueEnum};

/// Most samples a pixel of a render that has a target and no `--max-spp`.
const MAX_SPP: u32 = 65_536;

/// Flags of a target.
#[derive(Args)]
#[command(next_help_heading = "Sampling")]
pub struct TargetArgs {
    /// Render until the picture's relative RMSE is at most so much, such as 1% or 0.01
    #[arg(long, value_name = "ERROR", value_parser = share, allow_hyphen_values = true)]
    target_error: Option<f64>,
    /// How sure the target error shall be [default: 95%]
    #[arg(long, value_name = "SHARE", value_parser = share, requires = "target_error", allow_hyphen_values = true)]
    confidence: Option<f64>,
    /// Whether the target is for the picture, or for each block of 16x16 pixels [default: picture]
    #[arg(long, value_name = "picture|block", requires = "target_error")]
    target_of: Option<PartArg>,
    /// Most samples a pixel of a render with a target error [default: 65536]
    #[arg(long, value_name = "N", requires = "target_error", value_parser = clap::value_parser!(u32).range(1..))]
    max_spp: Option<u32>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum PartArg {
    Picture,
    Block,
}

/// A target and its limit.
#[derive(Debug, Clone, Copy)]
pub struct TargetPlan {
    /// When to stop.
    pub target: Target,
    /// Most samples a pixel.
    pub max_spp: u32,
}

impl TargetArgs {
    /// What was asked for, if anything; `spp` as given beside it, which would contradict.
    pub fn plan(&self, spp: Option<u32>) -> Result<Option<TargetPlan>> {
        let Some(error) = self.target_error else { return Ok(None) };
        if spp.is_some() {
            return Err(Error::Usage(
                "--spp fixes the samples that --target-error is to find: for a limit, use --max-spp".into(),
            ));
        }
        let part = match self.target_of {
            Some(PartArg::Block) => Part::Block,
            Some(PartArg::Picture) | None => Part::Picture,
        };
        let target = Target { error, confidence: self.confidence.unwrap_or(0.95), part };
        target.check()?;
        Ok(Some(TargetPlan { target, max_spp: self.max_spp.unwrap_or(MAX_SPP) }))
    }
}

/// Says so if a target was not met.
pub fn warn_if_missed(target: Option<&Target>, reached: Option<&Reached>, most_spp: u32) {
    let (Some(target), Some(reached)) = (target, reached) else { return };
    if !reached.met {
        log::warn!(
            "the target error of {} was not met: {} after at most {most_spp} samples a pixel, and less than {} with {} \
             confidence (--max-spp allows more samples)",
            percent(target.error),
            percent(reached.error),
            percent(reached.at_most),
            percent(target.confidence),
        );
    }
}

/// `1.25 %`, three digits.
pub fn percent(share: f64) -> String {
    let value = 100.0 * share;
    match value {
        v if v >= 10.0 => format!("{v:.1} %"),
        v if v >= 0.01 || v == 0.0 => format!("{v:.3} %"),
        v => format!("{v:.1e} %"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_read_well() {
        assert_eq!([0.0, 1e-9, 0.01234, 0.5].map(percent), ["0.000 %", "1.0e-7 %", "1.234 %", "50.0 %"]);
    }
}
