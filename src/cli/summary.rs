//! What a render took: for people on stderr, and as JSON.

use super::denoise::DenoiseReport;
use super::rounds::Rounds;
use crate::error::{Error, Result};
use crate::integrators::{Avoided, RayCounts};
use crate::memory::{self, in_words};
use crate::render::dealing::Dealing;
use crate::render::settings::RenderSettings;
use crate::render::{OutlineStats, RenderStats, Rendered};
use crate::scene::{BuildReport, Scene};
use serde::Serialize;
use std::fmt;
use std::path::Path;
use std::time::Duration;

/// Seconds by stage.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Seconds {
    /// Reading scene and meshes.
    pub load: f64,
    /// Shapes and their places.
    pub scene: f64,
    /// The ray kernel.
    pub kernel: f64,
    /// Pictures, materials and lights, beside the kernel.
    pub looks: f64,
    /// From the first ray to the last.
    pub render: f64,
    /// Writing pictures.
    pub save: f64,
    /// From the start of the process' work to the end.
    pub total: f64,
}

/// Rays by kind.
#[derive(Debug, Clone, Serialize)]
struct Rays {
    camera: u64,
    scattered: u64,
    shadow: u64,
    total: u64,
    mrays_per_second: f64,
}

/// Who made the picture.
#[derive(Debug, Clone, Serialize)]
struct Versions {
    skylit: &'static str,
    commit: &'static str,
    target: &'static str,
    features: &'static str,
    embree: &'static str,
    kernel: String,
}

/// What is rendered.
#[derive(Debug, Clone, Serialize)]
struct Contents {
    triangles: u64,
    procedurals: u64,
    groups: usize,
    placed_shapes: u64,
    dropped_primitives: u64,
    lights: usize,
}

/// Bytes.
#[derive(Debug, Clone, Serialize)]
struct Memory {
    geometry: u64,
    kernel: u64,
    /// The most the process ever held, if the system tells.
    peak: Option<u64>,
}

/// What needed no ray.
#[derive(Debug, Clone, Serialize)]
struct Skipped {
    pixels: u64,
    samples: u64,
    surface_points: u64,
    /// By cause.
    rays: Avoided,
    /// Part of all rays that were not traced whose cause is known: of a camera ray a sample, and of what
    /// [`Avoided::candidates`] counts.
    explained: Option<f64>,
}

impl Skipped {
    fn of(stats: &RenderStats) -> Self {
        let a = stats.avoided;
        let traced = |kind: fn(&RayCounts) -> u64| kind(&stats.rays) - kind(&stats.pilot);
        let from_surfaces = traced(|r| r.scattered + r.shadow);
        let avoided = (stats.samples - traced(|r| r.camera)) + a.candidates.saturating_sub(from_surfaces);
        let known = stats.spared + a.rays();
        Skipped {
            pixels: stats.free_pixels,
            samples: stats.spared,
            surface_points: a.points,
            rays: a,
            explained: (avoided > 0 && a.points > 0).then(|| known as f64 / avoided as f64),
        }
    }
}

/// A sample that was not finite, to be traced again.
#[derive(Debug, Clone, Serialize)]
struct Dropped {
    x: u32,
    y: u32,
    replicate: u32,
    index: u32,
}

/// A render's record.
#[derive(Debug, Clone, Serialize)]
pub struct Record {
    versions: Versions,
    command: Vec<String>,
    input: String,
    threads: usize,
    size: [u32; 2],
    spp: u32,
    seed: u64,
    sampler: &'static str,
    dealing: &'static str,
    filter: &'static str,
    scene: Contents,
    /// Filled in stage by stage.
    pub seconds: Seconds,
    samples: u64,
    /// Pixels that no geometry projects into, and their samples that needed no ray.
    skipped: Skipped,
    /// Pixels with more samples.
    outlines: OutlineStats,
    msamples_per_second: f64,
    /// Where not all pixels have as many samples.
    rounds: Option<Rounds>,
    rays: Rays,
    /// What the integrator decided beforehand.
    decided: String,
    denoised: Option<DenoiseReport>,
    memory: Memory,
    dropped_samples: u64,
    first_dropped: Vec<Dropped>,
}

impl Record {
    /// Of a finished render; the stages outside of it are still to be told.
    pub fn new(input: &Path, scene: &Scene, rendered: &Rendered, settings: &RenderSettings) -> Self {
        let stats = &rendered.stats;
        let per_second = |n: u64| n as f64 * 1e-6 / stats.seconds.max(1e-9);
        let rays = &stats.rays;
        Record {
            versions: Versions::new(scene.kernel.describe()),
            command: std::env::args_os().map(|a| a.to_string_lossy().into_owned()).collect(),
            input: input.display().to_string(),
            threads: settings.threads,
            size: settings.size,
            spp: if settings.deals() { settings.spp } else { stats.spp },
            seed: settings.seed,
            sampler: settings.points().kind().name(),
            dealing: if settings.deals() { settings.dealing } else { Dealing::Even }.name(),
            filter: settings.filter.name(),
            scene: Contents::new(&scene.report, scene.lights.list.len()),
            seconds: Seconds {
                scene: scene.report.scene_seconds,
                kernel: scene.report.kernel_seconds,
                looks: scene.report.look_seconds,
                render: stats.seconds,
                ..Seconds::default()
            },
            samples: stats.samples,
            skipped: Skipped::of(stats),
            outlines: stats.outlines,
            msamples_per_second: per_second(stats.samples),
            rounds: Rounds::new(rendered, settings),
            rays: Rays {
                camera: rays.camera,
                scattered: rays.scattered,
                shadow: rays.shadow,
                total: rays.total(),
                mrays_per_second: per_second(rays.total()),
            },
            decided: stats.decided.clone(),
            denoised: None,
            memory: Memory {
                geometry: scene.report.geometry_bytes,
                kernel: scene.kernel.memory(),
                peak: memory::peak(),
            },
            dropped_samples: stats.dropped,
            first_dropped: stats
                .bad
                .iter()
                .map(|b| Dropped { x: b.x, y: b.y, replicate: b.replicate, index: b.index })
                .collect(),
        }
    }

    /// Stages before and after the render.
    pub fn tell(&mut self, denoised: Option<DenoiseReport>, load: Duration, save: Duration, total: Duration) {
        self.denoised = denoised;
        self.seconds.load = load.as_secs_f64();
        self.seconds.save = save.as_secs_f64();
        self.seconds.total = total.as_secs_f64();
        self.memory.peak = memory::peak();
    }

    /// What a picture says of how it was made: enough to make it again.
    pub fn metadata(&self) -> Vec<(String, String)> {
        let v = &self.versions;
        let pair = |k: &str, v: String| (k.to_owned(), v);
        let mut pairs = vec![
            pair("software", format!("skylit {} ({})", v.skylit, v.commit)),
            pair("command", self.command.join(" ")),
            pair("kernel", v.kernel.clone()),
            pair("spp", self.spp.to_string()),
            pair("seed", self.seed.to_string()),
            pair("sampler", self.sampler.to_owned()),
            pair("dealing", self.dealing.to_owned()),
            pair("filter", self.filter.to_owned()),
            pair("chosen", self.decided.clone()),
        ];
        pairs.extend(self.rounds.iter().flat_map(Rounds::pairs));
        pairs
    }

    /// The record as JSON text.
    pub fn to_json(&self) -> Result<String> {
        let text = serde_json::to_string_pretty(self);
        text.map(|t| t + "\n").map_err(|e| Error::Internal(format!("cannot write the statistics: {e}")))
    }
}

impl Versions {
    fn new(kernel: String) -> Self {
        Versions {
            skylit: env!("CARGO_PKG_VERSION"),
            commit: env!("SKYLIT_GIT"),
            target: env!("SKYLIT_TARGET"),
            features: env!("SKYLIT_FEATURES"),
            embree: env!("SKYLIT_EMBREE"),
            kernel,
        }
    }
}

impl Contents {
    fn new(report: &BuildReport, lights: usize) -> Self {
        Contents {
            triangles: report.triangles,
            procedurals: report.procedurals,
            groups: report.groups,
            placed_shapes: report.paths,
            dropped_primitives: report.dropped.total(),
            lights,
        }
    }
}

impl fmt::Display for Record {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let s = &self.scene;
        write!(f, "scene   {}", plural(s.triangles, "triangle"))?;
        if s.procedurals > 0 {
            write!(f, ", {} exact primitives", count(s.procedurals))?;
        }
        writeln!(
            f,
            ", {} placed, {}; {}",
            plural(s.placed_shapes, "shape"),
            plural(s.lights as u64, "light"),
            self.versions.kernel
        )?;
        let t = &self.seconds;
        writeln!(
            f,
            "time    load {:.2} s, scene {:.2} s, kernel {:.2} s beside textures and lights {:.2} s, render {:.2} s, \
             save {:.2} s; in all {:.2} s",
            t.load, t.scene, t.kernel, t.looks, t.render, t.save, t.total
        )?;
        let [w, h] = self.size;
        writeln!(
            f,
            "samples {w} x {h}, {} a pixel: {:.2} Msamples/s on {}",
            self.spp,
            self.msamples_per_second,
            plural(self.threads as u64, "thread")
        )?;
        if let Some(rounds) = &self.rounds {
            write!(f, "{rounds}")?;
        }
        if self.outlines.pixels > 0 {
            let OutlineStats { pixels, times } = self.outlines;
            writeln!(f, "        {times} times as many in {} of outlines", plural(pixels, "pixel"))?;
        }
        let r = &self.rays;
        writeln!(
            f,
            "rays    {} camera, {} scattered, {} shadow: {:.2} Mrays/s",
            count(r.camera),
            count(r.scattered),
            count(r.shadow),
            r.mrays_per_second
        )?;
        if self.skipped.samples > 0 {
            writeln!(
                f,
                "skipped {} of {} that see no geometry",
                plural(self.skipped.samples, "sample"),
                plural(self.skipped.pixels, "pixel")
            )?;
        }
        let a = &self.skipped.rays;
        let causes = [
            (a.dark_samples, "to light that brings nothing"),
            (a.scattered_alone, "to light that scattered rays find"),
            (a.lit_alone, "to light that was sampled"),
            (a.absorbed, "where nothing is scattered"),
            (a.roulette, "by roulette"),
        ];
        let causes: Vec<String> =
            causes.iter().filter(|c| c.0 > 0).map(|(n, why)| format!("{} {why}", count(*n))).collect();
        if !causes.is_empty() {
            writeln!(f, "skipped {}: {}", plural(a.rays(), "ray"), causes.join(", "))?;
        }
        if !self.decided.is_empty() {
            writeln!(f, "chosen  {}", self.decided)?;
        }
        if let Some(d) = &self.denoised {
            writeln!(
                f,
                "denoise mean luminance x {:.5}; estimated relative RMSE {:.2} % to {:.2} %, {} kept",
                d.mean_ratio,
                100.0 * d.error_before,
                100.0 * d.error_after,
                plural(d.outliers as u64, "outlier")
            )?;
        }
        let m = &self.memory;
        write!(f, "memory  geometry {}, kernel {}", in_words(m.geometry), in_words(m.kernel))?;
        writeln!(f, "{}", m.peak.map_or(String::new(), |p| format!("; peak {}", in_words(p))))?;
        if s.dropped_primitives > 0 {
            writeln!(
                f,
                "dropped {} that are degenerate or not finite",
                plural(s.dropped_primitives, "primitive")
            )?;
        }
        if let Some(b) = self.first_dropped.first() {
            writeln!(
                f,
                "dropped {} that were not finite; the first at pixel {},{} (replicate {}, sample {}, seed {})",
                plural(self.dropped_samples, "sample"),
                b.x,
                b.y,
                b.replicate,
                b.index,
                self.seed
            )?;
        }
        Ok(())
    }
}

/// `1 shape`, `2 shapes`.
fn plural(n: u64, what: &str) -> String {
    format!("{} {what}{}", count(n), if n == 1 { "" } else { "s" })
}

/// `871,414`.
pub fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::with_capacity(digits.len() * 4 / 3);
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(c);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_read_well() {
        assert_eq!(
            ["1", "871,414", "1,000,000"],
            [1, 871414, 1_000_000].map(count).each_ref().map(String::as_str)
        );
        assert_eq!(plural(1, "shape"), "1 shape");
    }
}
