//! Which strategy suits which material, tried out before a render.
//!
//! Pixels of a coarse lattice are rendered with each strategy, by the integrator itself and with points of the kind that the
//! render will use; their spread is the variance that the render would have, visibility and all. Rays are counted, not timed,
//! so that the choice is a function of scene and seed. A material's strategy is the one that takes the least time to the same
//! error. Materials that few of the pixels show keep to what is good in most scenes: light samples alone where paths end at
//! the first surface and that is known to scatter evenly, else scattered rays as well.
//!
//! Tried: a strategy for each block of pixels (3ec7b42, `strategy=by-block`). Where samples go by need it is worth a few
//! percent on two scenes of nine, and less than nothing on another (benches/README.md).

mod judge;
mod scout;
mod trial;

use super::path::PathTracer;
use super::strategy::{Strategies, Strategy};
use super::{PilotPlan, RayCounts, Specialised};
use crate::scene::Scene;
use judge::{Bare, best};
use scout::{Class, Seen};
use std::sync::Arc;
use trial::{SAMPLES, Tracing};

/// Strategies that are tried, at most, or nearly so.
const CANDIDATES: usize = 4;
/// Most pixels of a material that are tried.
const MOST: usize = 192;
/// Fewer say nothing.
const LEAST: usize = 12;
/// Pixels, over all materials, that a render must afford to try out for trials to be worth their tables of the sky, of
/// hundreds of directions and for each strategy others: under a tame light, where there is most to be gained, and others.
const WORTHWHILE: [usize; 2] = [96, 1536];
/// Most part of a render's samples that is spent on trying.
const SHARE: f64 = 0.02;
/// Most camera rays that look for materials.
const SCOUTS: usize = 8192;

/// Most contrast of a light that scattered rays, or light samples that know little of narrow lobes, are trusted with.
/// A pilot of thousands of samples overlooks what is met by one in some hundreds at most; at this contrast that is worth
/// some percent of the mean.
const TAME: f32 = 16.0;

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
    /// samples on narrow lobes: tables know their widths and middles, not their shapes. (Several light samples for the first
    /// surface of a path were never the best for all that a material shows.)
    fn candidates(&self, is_even: bool) -> Vec<Strategy> {
        let usual = self.usual(is_even);
        let mut all = vec![usual];
        if usual == Strategy::Light(8) {
            all.push(Strategy::Light(2));
        }
        if usual != Strategy::Both(1) {
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

/// See the module.
pub(super) fn choose(tracer: &PathTracer, scene: &Scene, plan: &PilotPlan) -> Option<Specialised> {
    if !(tracer.auto_strategy && tracer.light_sampling && tracer.mis) {
        return None;
    }
    let choices = Choices::new(tracer, scene, scene.lights.guided()?.1.contrast());
    let mut seen = Seen::new(scene);
    let mut rays = RayCounts::default();
    let samples = SHARE * plan.pixels.area() as f64 * f64::from(plan.spp);
    let affordable = (samples / (SAMPLES as usize * CANDIDATES) as f64) as usize;
    let tries = affordable >= WORTHWHILE[usize::from(!choices.is_tame)] && choices.are_several();
    if affordable >= LEAST {
        rays.camera += seen.scout(scene, plan, (samples as usize).min(SCOUTS));
    }
    let mut strategies: Vec<Strategy> = seen.classes.iter().map(|c| choices.usual(c.is_even)).collect();
    if tries {
        let tracing = Tracing { tracer, scene, plan, classes: &seen.of, usual: &strategies };
        let bare =
            if plan.by_need { Bare::default() } else { Bare::of(&tracing, &seen, affordable.min(MOST)) };
        rays.add(&bare.rays);
        let most = (affordable / seen.classes.len().max(1)).min(MOST);
        let of_class = |(number, class): (usize, &Class)| {
            let candidates = choices.candidates(class.is_even);
            let pixels = thinned(&class.pixels, most);
            if !class.scatters() || pixels.len() < LEAST || candidates.len() < 2 {
                return candidates[0];
            }
            let run = |s: &Strategy| tracing.of_class(number, *s, &pixels);
            let trials: Vec<_> = candidates.iter().map(run).collect();
            trials.iter().for_each(|t| rays.add(&t.rays));
            candidates[best(&trials, class.pixels.len() as f64, &bare)]
        };
        strategies = seen.classes.iter().enumerate().map(of_class).collect();
    }
    let decided = describe(scene, &seen, &strategies);
    let strategies = Strategies::by_class(&seen.of, &strategies);
    let integrator = Arc::new(PathTracer { strategies, auto_strategy: false, ..tracer.clone() });
    Some(Specialised { integrator, decided, rays })
}

/// About `most` of them, evenly.
fn thinned(pixels: &[[u32; 2]], most: usize) -> Vec<[u32; 2]> {
    let n = pixels.len();
    if n > most { (0..most).map(|i| pixels[i * n / most]).collect() } else { pixels.to_vec() }
}

/// "light for 3 materials (clay...), both for 1 material".
fn describe(scene: &Scene, seen: &Seen, strategies: &[Strategy]) -> String {
    let mut parts = Vec::new();
    for (name, strategy) in Strategy::NAMES {
        let wanted = |class: usize| strategies[class] == strategy && seen.classes[class].scatters();
        let n = (0..strategies.len()).filter(|class| wanted(*class)).count();
        if n == 0 {
            continue;
        }
        let first = (0..).zip(&scene.objects).find(|(o, _)| seen.of.of(*o, 0).is_some_and(wanted));
        let example = first.map_or(String::new(), |(_, object)| format!(" ({}...)", object.name));
        let s = if n == 1 { "" } else { "s" };
        parts.push(format!("{name} for {n} material{s}{}", if n > 1 { example } else { String::new() }));
    }
    format!("sky found by {}", parts.join(", "))
}

#[cfg(test)]
mod tests;
