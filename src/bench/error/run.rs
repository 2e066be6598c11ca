//! Renders all variants in turn: run by run, sample count by sample count, forwards and backwards, so that whatever
//! drifts on the machine meets all alike.

use super::measure::Truth;
use super::record::{Point, Run, SceneRecord, Series};
use super::reference::{Kept, Reference};
use super::sweep::{Subject, label, truth_settings};
use crate::bench::Progress;
use crate::compare::metrics::EPSILON;
use crate::error::Result;
use crate::render::film::Film;
use crate::render::{Renderer, Silent};
use crate::scene::Scene;
use crate::scene::build::build;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// What is measured, and how.
pub struct Plan {
    /// See [`SceneRecord::name`].
    pub name: String,
    /// The scene as it is.
    pub subject: Subject,
    /// Settings of each variant.
    pub variants: Vec<BTreeMap<String, String>>,
    /// Samples a pixel, rising.
    pub ladder: Vec<u32>,
    /// Independent runs of each.
    pub replicates: u32,
    /// What errors are measured against.
    pub truth: TruthPlan,
}

/// Where the truth comes from.
pub enum TruthPlan {
    /// A picture.
    Given(PathBuf),
    /// Rendered with so many samples a pixel.
    Rendered {
        /// Samples a pixel.
        spp: u32,
        /// Where it is kept from one measurement to the next.
        kept: Option<Kept>,
    },
}

/// What came out, with the pictures of the first run of each variant and sample count.
pub struct Measured {
    /// The figures.
    pub record: SceneRecord,
    /// By variant, then by sample count.
    pub films: Vec<Vec<Film>>,
    /// What they are held against.
    pub truth: Truth,
}

struct Variant {
    scene: Scene,
    renderer: Renderer,
}

impl Variant {
    fn new(subject: &Subject, settings: &BTreeMap<String, String>) -> Result<Self> {
        let mut subject = subject.clone();
        settings.iter().try_for_each(|(k, v)| subject.set(k, v))?;
        let integrator = subject.integrator()?;
        let renderer = Renderer { integrator, settings: subject.settings.clone() };
        Ok(Variant { scene: build(subject.desc, &subject.options)?, renderer })
    }

    fn render(&self, spp: u32, seed: u64) -> Result<crate::render::Rendered> {
        let mut settings = self.renderer.settings.clone();
        (settings.spp, settings.seed) = (spp, seed);
        Renderer { integrator: self.renderer.integrator.clone(), settings }.render(&self.scene, &Silent)
    }
}

/// Measures one scene.
///
/// # Errors
/// Settings that nothing has; those of building, rendering and of the reference's file.
pub fn measure(plan: &Plan, progress: &dyn Progress) -> Result<Measured> {
    let runs = plan.ladder.len() * plan.variants.len() * plan.replicates as usize;
    progress.begin(runs as u64 + 2);
    progress.step(&format!("{}: build", plan.name));
    truth_settings(&plan.variants)?;
    // Names and values are looked up before anything long begins.
    let variants =
        plan.variants.iter().map(|v| Variant::new(&plan.subject, v)).collect::<Result<Vec<_>>>()?;
    progress.step(&format!("{}: reference", plan.name));
    let reference = plan.reference()?;
    let mut films: Vec<Vec<Film>> = vec![Vec::new(); variants.len()];
    let mut runs = vec![vec![Vec::new(); plan.ladder.len()]; variants.len()];
    // Caches, pages and clocks are warm when the first run counts.
    variants.iter().try_for_each(|v| v.render(plan.ladder[0], 0).map(drop))?;
    for replicate in 0..plan.replicates {
        for (rung, &spp) in plan.ladder.iter().enumerate() {
            let mut order: Vec<usize> = (0..variants.len()).collect();
            if replicate % 2 == 1 {
                order.reverse();
            }
            for v in order {
                let what = label(&plan.variants[v]);
                progress.step(&format!("{}: {what}, {spp} spp, run {}", plan.name, replicate + 1));
                // No two runs share a seed, whatever their sample counts.
                let seed = 1 + u64::from(replicate) * plan.ladder.len() as u64 + rung as u64;
                let rendered = variants[v].render(spp, seed)?;
                let errors = reference.truth.errors(&Truth::of_film(&rendered.film));
                let rays = Some(rendered.stats.rays.total());
                runs[v][rung].push(Run { seconds: rendered.stats.seconds, rays, errors });
                if replicate == 0 {
                    films[v].push(rendered.film);
                }
            }
        }
    }
    let points = |rungs: Vec<Vec<Run>>| {
        let point = |(&spp, runs): (&u32, Vec<Run>)| Point { spp: u64::from(spp), runs };
        plan.ladder.iter().zip(rungs).map(point).collect()
    };
    let series = plan.variants.iter().zip(runs).map(|(settings, rungs)| Series {
        name: label(settings),
        program: program(),
        settings: settings.clone(),
        points: points(rungs),
    });
    let record = SceneRecord {
        name: plan.name.clone(),
        size: plan.subject.settings.size,
        epsilon: EPSILON,
        reference: reference.record.clone(),
        series: series.collect(),
    };
    Ok(Measured { record, films, truth: reference.truth })
}

/// Name and version of this program.
pub fn program() -> String {
    format!("skylit {} ({})", env!("CARGO_PKG_VERSION"), env!("SKYLIT_GIT"))
}

impl Plan {
    fn reference(&self) -> Result<Reference> {
        match &self.truth {
            TruthPlan::Given(path) => Reference::load(path, self.subject.settings.size),
            TruthPlan::Rendered { spp, kept } => {
                let plain = Variant::new(&self.subject, &truth_settings(&self.variants)?)?;
                Reference::make(&plain.scene, &plain.renderer, *spp, kept.as_ref(), &Silent)
            }
        }
    }
}
