//! What is kept of a measurement of error against time, as JSON has it. Other renderers write the same
//! (benches/peers/measure.py).

use super::measure::{Errors, Noise, Sets};
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Of a record of this kind and form, in [`Record::format`].
pub const FORMAT: &str = "skylit bench error 1";

/// A measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// [`FORMAT`].
    pub format: String,
    /// Name and version of the renderer.
    pub program: String,
    /// The words of the command.
    pub command: Vec<String>,
    /// On what: facts by name; [`crate::report::machine::Machine`] in records of ours.
    pub machine: serde_json::Value,
    /// What was rendered.
    pub scenes: Vec<SceneRecord>,
}

/// One scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneRecord {
    /// By which scenes of several records belong together.
    pub name: String,
    /// Of the film, pixels.
    pub size: [u32; 2],
    /// See [`crate::compare::metrics::EPSILON`].
    pub epsilon: f64,
    /// The truth.
    pub reference: ReferenceRecord,
    /// Settings that were compared.
    pub series: Vec<Series>,
}

/// What is known of a reference.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReferenceRecord {
    /// Samples a pixel; 0 where not known.
    pub spp: u64,
    /// Mean luminance over the film.
    pub luminance: f64,
    /// Part of the pixels that are wholly covered by surfaces, 0 to 1.
    pub surfaces: f64,
    /// What its own variance adds to every error measured against it; None where not known.
    pub noise: Option<Sets<Noise>>,
}

/// One way of rendering the scene.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Series {
    /// For people.
    pub name: String,
    /// Name and version of the renderer.
    pub program: String,
    /// Settings by name.
    pub settings: BTreeMap<String, String>,
    /// By rising number of samples.
    pub points: Vec<Point>,
}

/// All runs with one number of samples.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Samples a pixel.
    pub spp: u64,
    /// Independent runs.
    pub runs: Vec<Run>,
}

/// One render.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Of rendering alone: nothing is loaded, built or compiled meanwhile.
    pub seconds: f64,
    /// Rays, where they were counted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rays: Option<u64>,
    /// Against the reference, its noise included.
    #[serde(flatten)]
    pub errors: Sets<Errors>,
}

impl Record {
    /// Reads a record of `--json` or of another renderer.
    ///
    /// # Errors
    /// A file that cannot be opened, or that is no record of this form; a record with nothing to draw.
    pub fn load(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(|e| Error::file(path, "open", e))?;
        let record: Record = serde_json::from_str(&text)
            .map_err(|e| Error::content(path, format!("is no record of `bench error`: {e}")))?;
        if record.format != FORMAT {
            let message = format!("is of the form \"{}\"; known: \"{FORMAT}\"", record.format);
            return Err(Error::content(path, message));
        }
        let usable = |r: &Run| r.seconds > 0.0 && r.seconds.is_finite() && r.errors.all.relmse >= 0.0;
        for scene in &record.scenes {
            for point in scene.series.iter().flat_map(|s| &s.points) {
                if point.runs.is_empty() || !point.runs.iter().all(usable) {
                    let message = format!("scene \"{}\" has a point without usable runs", scene.name);
                    return Err(Error::content(path, message));
                }
            }
        }
        Ok(record)
    }

    /// As JSON text.
    pub fn to_json(&self) -> Result<String> {
        let text = serde_json::to_string_pretty(self);
        text.map(|t| t + "\n").map_err(|e| Error::Internal(format!("cannot write the record: {e}")))
    }

    /// A line of CSV a run.
    pub fn to_csv(&self) -> String {
        let mut out = String::from(
            "scene,series,spp,run,seconds,rays,mse,relmse,bias,surfaces_mse,surfaces_relmse,surfaces_bias\n",
        );
        for scene in &self.scenes {
            for s in &scene.series {
                for (p, (i, r)) in
                    s.points.iter().flat_map(|p| p.runs.iter().enumerate().map(move |r| (p, r)))
                {
                    let rays = r.rays.map_or(String::new(), |n| n.to_string());
                    let sets = [&r.errors.all, &r.errors.surfaces];
                    let figures: Vec<String> =
                        sets.iter().map(|e| format!("{},{},{}", e.mse, e.relmse, e.bias)).collect();
                    // Names hold no comma or quote that matters but for settings, which are quoted.
                    let name = s.name.replace('"', "\"\"");
                    out += &format!(
                        "{},\"{name}\",{},{i},{},{rays},{}\n",
                        scene.name,
                        p.spp,
                        r.seconds,
                        figures.join(",")
                    );
                }
            }
        }
        out
    }
}
