//! What a render's record says of its rounds.

use super::target_args::percent;
use crate::render::Rendered;
use crate::render::settings::RenderSettings;
use serde::Serialize;
use std::fmt;

/// How samples were dealt, where not all pixels have as many.
#[derive(Debug, Clone, Serialize)]
pub struct Rounds {
    rounds: u32,
    spp_min: u32,
    spp_mean: f64,
    spp_max: u32,
    target: Option<TargetRecord>,
}

/// What was asked for and what was reached; errors are relative, as shares.
#[derive(Debug, Clone, Serialize)]
struct TargetRecord {
    target_error: f64,
    confidence: f64,
    target_of: &'static str,
    error: f64,
    error_at_most: f64,
    met: bool,
}

impl Rounds {
    /// `None` where one round of so many samples was asked for.
    pub fn new(rendered: &Rendered, settings: &RenderSettings) -> Option<Rounds> {
        let stats = &rendered.stats;
        let target = settings.target.zip(stats.reached).map(|(t, r)| TargetRecord {
            target_error: t.error,
            confidence: t.confidence,
            target_of: t.part.name(),
            error: r.error,
            error_at_most: r.at_most,
            met: r.met,
        });
        (target.is_some() || settings.time.is_some() || settings.deals()).then_some(Rounds {
            rounds: stats.rounds,
            spp_min: stats.spp_least,
            spp_mean: stats.spp_mean,
            spp_max: stats.spp,
            target,
        })
    }

    /// For a picture's metadata.
    pub fn pairs(&self) -> Vec<(String, String)> {
        let mut pairs = vec![
            ("rounds", self.rounds.to_string()),
            ("sppMin", self.spp_min.to_string()),
            ("sppMean", format!("{:.2}", self.spp_mean)),
            ("sppMax", self.spp_max.to_string()),
        ];
        if let Some(t) = &self.target {
            pairs.extend([
                ("targetError", t.target_error.to_string()),
                ("targetOf", t.target_of.to_owned()),
                ("confidence", t.confidence.to_string()),
                ("error", t.error.to_string()),
                ("errorAtMost", t.error_at_most.to_string()),
                ("targetMet", t.met.to_string()),
            ]);
        }
        pairs.into_iter().map(|(k, v)| (k.to_owned(), v)).collect()
    }
}

impl fmt::Display for Rounds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Rounds { rounds, spp_min, spp_mean, spp_max, target } = self;
        write!(f, "rounds  {rounds}: {spp_min} to {spp_max} samples a pixel, {spp_mean:.1} on average")?;
        if let Some(t) = target {
            write!(
                f,
                "; error of the {} {}, at most {} with {} confidence, target {} {}",
                if t.target_of == "block" { "worst block" } else { "picture" },
                percent(t.error),
                percent(t.error_at_most),
                percent(t.confidence),
                percent(t.target_error),
                if t.met { "met" } else { "not met" }
            )?;
        }
        writeln!(f)
    }
}
