//! Which strategy suits which material, tried out before a render.
//!
//! Pixels of a coarse lattice are rendered with each strategy, by the integrator itself and with the points that the
//! render will use, in two independent halves; their spread is the variance that the render would have, stratification,
//! visibility and all. Rays are counted, not timed, so that the choice is a function of scene and seed. A material's
//! strategy is the one that takes the least time to the same error. Materials that few of the pixels show keep to what is
//! good in most scenes: light samples alone where paths end at the first surface and that is known to scatter evenly, else
//! scattered rays as well.

use super::path::PathTracer;
use super::strategy::{Strategies, Strategy};
use super::{
    BARE_COST, CameraBatch, Integrator, PathId, PathResults, PilotPlan, RayCounts, Specialised, Workspace,
};
use crate::base::camera::FilmSamples;
use crate::base::hit::HitBatch;
use crate::base::material::{Material, Prepared};
use crate::base::ray::{Coherence, RayBatch};
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::sampler::{Dim, ray_key};
use crate::scene::Scene;
use rayon::prelude::*;
use std::sync::Arc;

/// Samples of a pixel and half.
const SAMPLES: u32 = 8;
/// Strategies that are tried, at most, or nearly so.
const CANDIDATES: usize = 4;
/// Most pixels of a material that are tried.
const MOST: usize = 384;
/// Fewer say nothing.
const LEAST: usize = 24;
/// Pixels, over all materials, that a render must afford to try out for trials to be worth their tables of the sky, of
/// hundreds of directions and for each strategy others: under a tame light, where there is most to be gained, and others.
const WORTHWHILE: [usize; 2] = [192, 768];
/// Most part of a render's samples that is spent on trying.
const SHARE: f64 = 0.02;
/// Most camera rays that look for materials.
const SCOUTS: usize = 8192;
/// Seeds of pilots lie apart from those of renders.
const SEED: u64 = 0x7069_6c6f_7400_0000;
/// Part of the squared mean that is added to a pixel's own, as in relMSE: what a dark pixel counts for.
const EPSILON: f64 = 0.01;

/// How steeply those of outlines fall by themselves: what is smooth along them is stratified.
const OUTLINE_SLOPE: f64 = 1.5;
/// How steeply squared errors fall with the number of samples: the exponent at which cost counts against variance.
const SLOPE: f64 = 1.2;

/// Most contrast of a light that scattered rays, or light samples that know little of narrow lobes, are trusted with.
/// A pilot of thousands of samples overlooks what is met by one in some hundreds at most; at this contrast that is worth
/// some percent of the mean.
const TAME: f32 = 16.0;

/// How much better than the first candidate another has to look: so much is noise.
const MARGIN: f64 = 0.7;

/// What may be chosen in a scene.
struct Choices {
    /// What is best in most scenes for surfaces that scatter evenly, and for others: several samples for each camera ray,
    /// whose surface point costs as much as two of them, where the integrator takes more than one.
    even: Strategy,
    others: Strategy,
    /// Whether the light is trusted, see [`TAME`].
    is_tame: bool,
}

impl Choices {
    fn new(tracer: &PathTracer, scene: &Scene, contrast: f32) -> Self {
        let (splits, ends) = (scene.lights.list.len() == 1, tracer.max_depth == 1);
        Choices {
            even: match (ends, splits) {
                (true, true) => Strategy::Light(8),
                (true, false) => Strategy::Light(1),
                // The ray that the path goes on by is there anyway, and finds what is wide.
                (false, _) => Strategy::Both(1),
            },
            others: Strategy::Both(if splits && ends { 4 } else { 1 }),
            is_tame: contrast <= TAME,
        }
    }

    fn usual(&self, is_even: bool) -> Strategy {
        if is_even { self.even } else { self.others }
    }

    /// What is tried for a material, the most likely first. Scattered rays alone miss what is small and bright. So do light
    /// samples on narrow lobes: tables know their widths and middles, not their shapes.
    fn candidates(&self, is_even: bool) -> Vec<Strategy> {
        let mut all = vec![self.usual(is_even)];
        if self.even == Strategy::Light(8) && is_even {
            all.push(Strategy::Light(2));
        }
        if all[0] != Strategy::Both(1) {
            all.push(Strategy::Both(1));
        }
        if self.is_tame {
            all.push(Strategy::Bsdf);
        }
        all
    }

    /// Whether there is anything to be tried.
    fn are_several(&self) -> bool {
        [true, false].into_iter().any(|is_even| self.candidates(is_even).len() > 1)
    }
}

/// A kind of surface: those that share a material.
struct Class<'a> {
    material: &'a Arc<dyn Material>,
    /// Whether it was seen, and scattered evenly wherever that was.
    is_even: bool,
    /// Where it was seen first by a camera ray.
    pixels: Vec<[u32; 2]>,
    strategy: Strategy,
}

/// Numbers of the classes of all objects and slots, and the classes.
struct Classes<'a> {
    list: Vec<Class<'a>>,
    /// Pixels in whose middle there is no surface.
    bare: Vec<[u32; 2]>,
    /// Pixels that outlines run through.
    outlined: Vec<[u32; 2]>,
    /// By object, then slot.
    of: Vec<Vec<usize>>,
}

impl<'a> Classes<'a> {
    fn new(scene: &'a Scene) -> Self {
        let mut all = Classes { list: Vec::new(), bare: Vec::new(), outlined: Vec::new(), of: Vec::new() };
        let mut by_address = std::collections::HashMap::new();
        for object in &scene.objects {
            let slots = object.materials.iter().map(|material| {
                *by_address.entry(Arc::as_ptr(material).cast::<()>()).or_insert_with(|| {
                    let class =
                        Class { material, is_even: false, pixels: Vec::new(), strategy: Strategy::Both(1) };
                    all.list.push(class);
                    all.list.len() - 1
                })
            });
            let slots = slots.collect();
            all.of.push(slots);
        }
        all
    }

    fn of_vertex(&mut self, v: &Vertex) -> &mut Class<'a> {
        &mut self.list[self.of[v.object as usize][v.slot as usize]]
    }
}

/// See the module.
pub(super) fn choose(tracer: &PathTracer, scene: &Scene, plan: &PilotPlan) -> Option<Specialised> {
    if !(tracer.auto_strategy && tracer.light_sampling && tracer.mis) {
        return None;
    }
    let choices = Choices::new(tracer, scene, scene.lights.guided()?.1.contrast());
    let mut classes = Classes::new(scene);
    let mut rays = RayCounts::default();
    let samples = plan.pixels.area() as f64 * f64::from(plan.spp);
    let of_class = SAMPLES as usize * 2 * CANDIDATES;
    let affordable = (SHARE * samples / of_class as f64) as usize;
    let tries = affordable >= WORTHWHILE[usize::from(!choices.is_tame)] && choices.are_several();
    let scouts = ((SHARE * samples) as usize).min(SCOUTS);
    if affordable >= LEAST {
        rays.camera += scout(scene, plan, scouts, &mut classes);
    }
    let most = (affordable / classes.list.len().max(1)).min(MOST);
    let mut bare = Bare::default();
    if tries && !plan.by_need {
        let most = affordable.min(MOST);
        bare.add(tracer, scene, plan, (&classes.bare, most), 1);
        bare.add(tracer, scene, plan, (&classes.outlined, most), plan.outline_times);
    }
    rays.add(&bare.rays);
    for class in classes.list.iter_mut().filter(|c| !c.material.is_delta() && !c.material.is_black()) {
        if !tries || class.pixels.len().min(most) < LEAST {
            class.strategy = choices.usual(class.is_even);
            continue;
        }
        let candidates = choices.candidates(class.is_even);
        if let [only] = candidates[..] {
            class.strategy = only;
            continue;
        }
        let area = class.pixels.len() as f64;
        let pixels = thinned(&class.pixels, most);
        let run = |s: &Strategy| Trial::run(tracer, scene, plan, &pixels, *s);
        let trials: Vec<Trial> = candidates.iter().map(run).collect();
        class.strategy = best(&trials, area, &bare);
        trials.iter().for_each(|t| rays.add(&t.rays));
    }
    let list = &classes.list;
    let strategies = Strategies::by_object(
        classes.of.iter().map(|slots| slots.iter().map(|&c| list[c].strategy).collect()),
    );
    let integrator = Arc::new(PathTracer { strategies, auto_strategy: false, ..tracer.clone() });
    Some(Specialised { integrator, decided: describe(scene, &classes), rays })
}

/// About `most` of them, evenly.
fn thinned(pixels: &[[u32; 2]], most: usize) -> Vec<[u32; 2]> {
    let n = pixels.len();
    if n > most { (0..most).map(|i| pixels[i * n / most]).collect() } else { pixels.to_vec() }
}

/// Notes which pixels of a lattice show which material; returns the rays that took.
fn scout(scene: &Scene, plan: &PilotPlan, scouts: usize, classes: &mut Classes) -> u64 {
    let area = plan.pixels.area();
    let step = ((area as f64 / scouts as f64).sqrt().ceil() as u32).max(1);
    let lattice = |from: u32, to: u32| (from + step / 2..to).step_by(step as usize);
    let rect = plan.pixels;
    let pixels = lattice(rect.y0, rect.y1).flat_map(|y| lattice(rect.x0, rect.x1).map(move |x| [x, y]));
    let (outlined, pixels): (Vec<[u32; 2]>, Vec<[u32; 2]>) =
        pixels.partition(|[x, y]| (plan.is_outline)(*x, *y));
    classes.outlined = outlined;
    let coordinate = |axis: usize| pixels.iter().map(|p| p[axis] as f32 + 0.5).collect::<Vec<f32>>();
    let (x, y, half) = (coordinate(0), coordinate(1), vec![0.5; pixels.len()]);
    let lens: &[f32] = if scene.camera.has_lens() { &half } else { &[] };
    let mut rays = RayBatch::default();
    rays.resize(pixels.len());
    scene.camera.fill_rays(&FilmSamples { x: &x, y: &y, lens_u: lens, lens_v: lens }, &mut rays);
    let mut hits = HitBatch::default();
    scene.kernel.intersect_batch(&rays, &mut hits, Coherence::Coherent);
    for (i, pixel) in pixels.iter().enumerate() {
        let Some(hit) = hits.get(i) else {
            classes.bare.push(*pixel);
            continue;
        };
        let v = scene.vertex(&rays.get(i), hit, 0.0);
        let mut prepared = Prepared::default();
        let class = classes.of_vertex(&v);
        class.material.prepare(&v, &mut prepared);
        let is_even = class.material.transmission().is_none()
            && class.material.scattering(&prepared).is_some_and(|s| s.facets == 0.0);
        class.is_even = is_even && (class.is_even || class.pixels.is_empty());
        class.pixels.push(*pixel);
    }
    pixels.len() as u64
}

/// Pixels whose noise only more camera rays lower, which are dear where each carries many light samples: those without a
/// surface, whose noise is that of the sky's picture, and outlines.
#[derive(Default)]
struct Bare {
    /// Sum over the lattice's pixels of their squared relative errors.
    error: f64,
    /// The same of their costs.
    cost: f64,
    /// Rays that were spent.
    rays: RayCounts,
}

impl Bare {
    /// Adds pixels that take so many `times` the samples of others, by trying out so many of them at most.
    fn add(
        &mut self,
        tracer: &PathTracer,
        scene: &Scene,
        plan: &PilotPlan,
        (pixels, most): (&[[u32; 2]], usize),
        times: u32,
    ) {
        if pixels.is_empty() {
            return;
        }
        let (area, times) = (pixels.len() as f64, f64::from(times));
        // What is on the outlines may be of any kind.
        let trial = Trial::run(tracer, scene, plan, &thinned(pixels, most), Strategy::Both(1));
        let means = means(std::slice::from_ref(&trial));
        let each = 2.0 * f64::from(SAMPLES);
        self.error += area * trial.error(&means) / times.powf(OUTLINE_SLOPE);
        self.cost += area * times * each * BARE_COST;
        self.rays.add(&trial.rays);
    }
}

/// What a strategy came to.
struct Trial {
    strategy: Strategy,
    /// Means of the two halves, by pixel.
    halves: Vec<[Rgb; 2]>,
    rays: RayCounts,
}

impl Trial {
    fn run(
        tracer: &PathTracer,
        scene: &Scene,
        plan: &PilotPlan,
        pixels: &[[u32; 2]],
        strategy: Strategy,
    ) -> Self {
        let tracer = PathTracer { strategies: Strategies::uniform(strategy), ..tracer.clone() };
        // Chunks of a size that does not depend on the number of threads, joined in their order.
        let parts: Vec<(Vec<[Rgb; 2]>, RayCounts)> =
            pixels.par_chunks(64).map(|chunk| trace(&tracer, scene, plan, chunk)).collect();
        let mut trial = Trial { strategy, halves: Vec::new(), rays: RayCounts::default() };
        for (halves, rays) in parts {
            trial.halves.extend(halves);
            trial.rays.add(&rays);
        }
        trial
    }

    /// The mean over pixels of their squared errors, relative to their `means` as in relMSE.
    fn error(&self, means: &[Rgb]) -> f64 {
        let pixels = means.len().max(1) as f64;
        let mean = means.iter().map(|c| f64::from(c.luminance())).sum::<f64>() / pixels;
        let squares = self.halves.iter().zip(means).map(|([a, b], m)| {
            let d = f64::from((*a - *b).luminance());
            let scale = f64::from(m.luminance()).powi(2) + EPSILON * mean * mean;
            if d == 0.0 { 0.0 } else { d * d / scale }
        });
        squares.sum::<f64>() / pixels
    }
}

/// The means of both halves of some pixels. The camera's rays are spread over the pixel: what its surfaces differ by is
/// noise that no more samples of light take away, so that the dearer strategies must not be credited with it.
fn trace(
    tracer: &PathTracer,
    scene: &Scene,
    plan: &PilotPlan,
    pixels: &[[u32; 2]],
) -> (Vec<[Rgb; 2]>, RayCounts) {
    let mut batch = CameraBatch { spread: scene.camera.pixel_spread(), ..CameraBatch::default() };
    let (mut x, mut y) = (Vec::new(), Vec::new());
    let points = plan.kind.points(plan.seed ^ SEED, None);
    for &[px, py] in pixels {
        for half in 0..2 {
            let sampler = points.pixel(px, py, half);
            let key = ray_key(px, py, half);
            batch.ids.extend(PathId { sampler, index: 0, key }, SAMPLES as usize);
            for i in 0..SAMPLES {
                let [u, v] = sampler.get_2d(i, Dim::FILTER);
                x.push(px as f32 + u);
                y.push(py as f32 + v);
            }
        }
    }
    let middle = vec![0.5; if scene.camera.has_lens() { x.len() } else { 0 }];
    batch.rays.resize(x.len());
    scene.camera.fill_rays(&FilmSamples { x: &x, y: &y, lens_u: &middle, lens_v: &middle }, &mut batch.rays);
    let (mut work, mut out) = (Workspace::default(), PathResults::default());
    tracer.trace(scene, &batch, &mut work, &mut out);
    let mean = |samples: &[Rgb]| {
        let finite = samples.iter().filter(|c| c.is_finite());
        finite.fold(Rgb::BLACK, |sum, c| sum + *c) / samples.len() as f32
    };
    let halves = out.li.chunks_exact(SAMPLES as usize).map(mean).collect::<Vec<_>>();
    (halves.chunks_exact(2).map(|h| [h[0], h[1]]).collect(), work.counts)
}

/// The means of all trials, by pixel.
fn means(trials: &[Trial]) -> Vec<Rgb> {
    let pixels = trials.first().map_or(0, |t| t.halves.len());
    let sum = |i: usize| trials.iter().fold(Rgb::BLACK, |s, t| s + t.halves[i][0] + t.halves[i][1]);
    (0..pixels).map(|i| sum(i) / (2 * trials.len()) as f32).collect()
}

/// The strategy with which a picture of `area` such pixels and the bare ones comes to the same error with the fewest rays.
/// Squared differences of halves are weighed as relative errors are, by a mean over all trials, so that no trial is favoured
/// by its own noise.
fn best(trials: &[Trial], area: f64, bare: &Bare) -> Strategy {
    let means = means(trials);
    let pixels = means.len().max(1) as f64;
    let score = |t: &Trial| {
        let error = area * t.error(&means) + bare.error;
        error * (area * t.rays.cost() / pixels + bare.cost).powf(SLOPE)
    };
    let scores = (0..).zip(trials).map(|(i, t)| (score(t) * if i == 0 { MARGIN } else { 1.0 }, t));
    let found = scores.min_by(|a, b| a.0.total_cmp(&b.0)).map(|s| s.1);
    found.map_or(Strategy::Both(1), |t| t.strategy)
}

/// "light for 3 materials (clay, ...), both for 1".
fn describe(scene: &Scene, classes: &Classes) -> String {
    let mut parts = Vec::new();
    for (name, strategy) in Strategy::NAMES {
        let wanted = |c: &Class| c.strategy == strategy && !c.material.is_delta() && !c.material.is_black();
        let n = classes.list.iter().filter(|c| wanted(c)).count();
        if n == 0 {
            continue;
        }
        let first = scene
            .objects
            .iter()
            .zip(&classes.of)
            .find(|(_, slots)| slots.first().is_some_and(|&c| wanted(&classes.list[c])));
        let example = first.map_or(String::new(), |(o, _)| format!(" ({}...)", o.name));
        let s = if n == 1 { "" } else { "s" };
        parts.push(format!("{name} for {n} material{s}{}", if n > 1 { example } else { String::new() }));
    }
    format!("sky found by {}", parts.join(", "))
}
