//! What a strategy comes to at some pixels.

use crate::base::camera::FilmSamples;
use crate::color::Rgb;
use crate::integrators::path::PathTracer;
use crate::integrators::strategy::{Classes, Strategies, Strategy};
use crate::integrators::{CameraBatch, Integrator, PathId, PathResults, PilotPlan, RayCounts, Workspace};
use crate::sampler::{Dim, points_2d, ray_key};
use crate::scene::Scene;
use rayon::prelude::*;

/// Samples of a pixel.
pub(super) const SAMPLES: u32 = 32;
/// Consecutive samples whose mean counts as one: points are stratified, so that the spread of single samples says too much,
/// and most where little of it is the light's.
const GROUP: u32 = 8;
/// What a surface point costs beside its rays where it takes several light samples, in the same unit as
/// [`RayCounts::cost`]: on `dragon-cube`, renders with two light samples take 0.515 and with one 0.32 of the time of eight.
const SEVERAL_COST: f64 = 2.25;
/// Groups of a pixel, less the one that the mean takes.
const FREEDOM: u32 = SAMPLES / GROUP - 1;
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

/// How trials are traced.
pub(super) struct Tracing<'a> {
    pub tracer: &'a PathTracer,
    pub scene: &'a Scene,
    pub plan: &'a PilotPlan<'a>,
    pub classes: &'a Classes,
    /// The strategies of classes that are not on trial.
    pub usual: &'a [Strategy],
}

impl Tracing<'_> {
    /// Pixels that show a class, with this strategy for it.
    pub fn of_class(&self, class: usize, strategy: Strategy, pixels: &[[u32; 2]]) -> Trial {
        let mut strategies = self.usual.to_vec();
        strategies[class] = strategy;
        let mut trial = self.with(&strategies, pixels);
        if strategy.takes_several(self.tracer.max_depth == 1) {
            trial.cost += SEVERAL_COST * trial.rays.camera as f64;
        }
        trial
    }

    /// Pixels that may show anything, with the usual strategies.
    pub fn of_any(&self, pixels: &[[u32; 2]]) -> Trial {
        self.with(self.usual, pixels)
    }

    fn with(&self, strategies: &[Strategy], pixels: &[[u32; 2]]) -> Trial {
        let strategies = Strategies::by_class(self.classes, strategies);
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

    /// The camera's rays are spread as the render's are: what the surfaces of a pixel differ by is noise that no more samples
    /// of light take away, so that the dearer strategies must not be credited with it.
    fn run(&self, tracer: &PathTracer, pixels: &[[u32; 2]], memory: &mut Memory) -> Trial {
        let Memory { batch, work, out } = memory;
        let camera = &self.scene.camera;
        batch.spread = camera.pixel_spread();
        batch.ids.clear();
        let n = pixels.len() * SAMPLES as usize;
        let [mut x, mut y, mut u, mut v] = [(); 4].map(|()| Vec::with_capacity(n));
        let points = self.plan.kind.points(self.plan.seed ^ SEED, None);
        for &[px, py] in pixels {
            let sampler = points.pixel(px, py, 0);
            batch.ids.extend(PathId { sampler, index: 0, key: ray_key(px, py, 0) }, SAMPLES as usize);
            x.resize(x.len() + SAMPLES as usize, px as f32 + 0.5);
            y.resize(x.len(), py as f32 + 0.5);
        }
        u.resize(n, 0.0);
        v.resize(n, 0.0);
        points_2d(&batch.ids.samplers, &batch.ids.indices, Dim::FILTER, &mut u, &mut v);
        self.plan.filter.add_offsets([&u, &v], [&mut x, &mut y]);
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
