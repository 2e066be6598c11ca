//! What a strategy comes to at some pixels.

use super::scout::Seen;
use crate::base::camera::FilmSamples;
use crate::color::Rgb;
use crate::integrators::path::PathTracer;
use crate::integrators::strategy::{Classes, Strategies, Strategy};
use crate::integrators::{CameraBatch, Integrator, PathId, PathResults, PilotPlan, RayCounts, Workspace};
use crate::sampler::{Dim, ray_key};
use crate::scene::Scene;
use rayon::prelude::*;
use std::sync::Arc;

/// Samples of a pixel.
pub(super) const SAMPLES: u32 = 16;
/// Consecutive samples whose mean counts as one: points are stratified, so that the spread of single samples says too much,
/// and most where little of it is the light's.
const GROUP: u32 = 4;
/// What a surface point costs beside its rays where it takes several light samples, in the same unit as
/// [`RayCounts::cost`]: measured, two light samples take 0.515 and one 0.32 of the time of eight.
const SEVERAL_COST: f64 = 2.25;
/// Groups of a pixel, less the one that the mean takes.
pub(super) const FREEDOM: u32 = SAMPLES / GROUP - 1;
/// Seeds of pilots lie apart from those of renders.
const SEED: u64 = 0x7069_6c6f_7400_0000;

/// What the samples of a pixel showed.
#[derive(Clone, Copy)]
pub(super) struct Shown {
    /// Mean luminance.
    pub mean: f64,
    /// Variance of a sample's.
    pub variance: f64,
}

/// What a strategy came to.
pub(super) struct Trial {
    pub pixels: Vec<Shown>,
    pub rays: RayCounts,
    /// What the rays took with all that goes with them, as [`RayCounts::cost`] has it.
    pub cost: f64,
}

/// Pixels of a class in a block, and what each of its candidates came to there.
pub(super) struct Cell {
    pub block: usize,
    pub class: usize,
    pub trials: Vec<Trial>,
}

/// How trials are traced.
pub(super) struct Tracing<'a> {
    pub tracer: &'a PathTracer,
    pub scene: &'a Scene,
    pub plan: &'a PilotPlan<'a>,
    pub classes: &'a Arc<Classes>,
    /// The strategies of classes that are not on trial.
    pub usual: &'a [Strategy],
}

impl Tracing<'_> {
    /// All candidates of all classes that have several, block by block.
    pub fn cells(&self, seen: &Seen) -> Vec<Cell> {
        let tracers: Vec<Vec<PathTracer>> = (0..)
            .zip(&seen.classes)
            .map(|(n, c)| c.candidates.iter().map(|s| self.tracer_of(n, *s)).collect())
            .collect();
        let wanted: Vec<_> = seen.cells.iter().filter(|((_, class), _)| tracers[*class].len() > 1).collect();
        let run = |work: &mut Memory, (&(block, class), pixels): (&(usize, usize), &Vec<[u32; 2]>)| {
            let ends = self.tracer.max_depth == 1;
            let run = |(tracer, strategy): (&PathTracer, &Strategy)| {
                let mut trial = self.run(tracer, pixels, work);
                let several = if strategy.takes_several(ends) { SEVERAL_COST } else { 0.0 };
                trial.cost += several * trial.rays.camera as f64;
                trial
            };
            let trials = tracers[class].iter().zip(&seen.classes[class].candidates).map(run).collect();
            Cell { block, class, trials }
        };
        wanted.into_par_iter().map_init(Memory::default, run).collect()
    }

    /// Pixels that may show anything, with the usual strategies.
    pub fn any(&self, pixels: &[[u32; 2]]) -> Trial {
        let strategies = Strategies::by_class(self.classes.clone(), self.usual);
        let tracer = PathTracer { strategies, ..self.tracer.clone() };
        let run = |work: &mut Memory, chunk: &[[u32; 2]]| self.run(&tracer, chunk, work);
        // Chunks of a size that does not depend on the number of threads, joined in their order.
        let parts: Vec<Trial> = pixels.par_chunks(64).map_init(Memory::default, run).collect();
        let mut all = Trial { pixels: Vec::new(), rays: RayCounts::default(), cost: 0.0 };
        for part in parts {
            all.pixels.extend(part.pixels);
            all.rays.add(&part.rays);
            all.cost += part.cost;
        }
        all
    }

    fn tracer_of(&self, class: usize, strategy: Strategy) -> PathTracer {
        let mut row = self.usual.to_vec();
        row[class] = strategy;
        PathTracer { strategies: Strategies::by_class(self.classes.clone(), &row), ..self.tracer.clone() }
    }

    /// The camera's rays are spread over the pixel: what its surfaces differ by is noise that no more samples of light take
    /// away, so that the dearer strategies must not be credited with it.
    fn run(&self, tracer: &PathTracer, pixels: &[[u32; 2]], memory: &mut Memory) -> Trial {
        let Memory { batch, work, out } = memory;
        let camera = &self.scene.camera;
        batch.spread = camera.pixel_spread();
        batch.ids.clear();
        let (mut x, mut y) = (Vec::new(), Vec::new());
        let points = self.plan.kind.points(self.plan.seed ^ SEED, None);
        for &[px, py] in pixels {
            let sampler = points.pixel(px, py, 0);
            batch.ids.extend(PathId { sampler, index: 0, key: ray_key(px, py, 0) }, SAMPLES as usize);
            for i in 0..SAMPLES {
                let [u, v] = sampler.get_2d(i, Dim::FILTER);
                x.push(px as f32 + u);
                y.push(py as f32 + v);
            }
        }
        let middle = vec![0.5; if camera.has_lens() { x.len() } else { 0 }];
        batch.rays.resize(x.len());
        camera.fill_rays(&FilmSamples { x: &x, y: &y, lens_u: &middle, lens_v: &middle }, &mut batch.rays);
        let before = work.counts;
        tracer.trace(self.scene, batch, work, out);
        let luminance = |c: &Rgb| if c.is_finite() { f64::from(c.luminance()) } else { 0.0 };
        let shown = |samples: &[Rgb]| {
            let of_group = |g: &[Rgb]| g.iter().map(luminance).sum::<f64>() / f64::from(GROUP);
            let groups = samples.chunks_exact(GROUP as usize).map(of_group);
            let mean = groups.clone().sum::<f64>() / f64::from(FREEDOM + 1);
            let squares = groups.map(|g| (g - mean).powi(2)).sum::<f64>();
            Shown { mean, variance: squares * f64::from(GROUP) / f64::from(FREEDOM) }
        };
        let pixels = out.li.chunks_exact(SAMPLES as usize).map(shown).collect();
        let rays = work.counts.since(&before);
        Trial { pixels, cost: rays.cost(), rays }
    }
}

/// What is kept from trial to trial.
#[derive(Default)]
struct Memory {
    batch: CameraBatch,
    work: Workspace,
    out: PathResults,
}
