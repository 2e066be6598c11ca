//! Which strategy suits which material, and where, tried out before a render.
//!
//! Pixels of a coarse lattice are rendered with each strategy, by the integrator itself and with points of the kind that the
//! render will use; their spread is the variance that the render would have, visibility and all. Rays are counted, not timed,
//! so that the choice is a function of scene and seed. A material's strategy is the one that takes the least time to the same
//! error; in a block of pixels where another takes less, as in corners that little light finds, it is that one. Materials
//! that few of the pixels show keep to what is good in most scenes: light samples alone where paths end at the first surface
//! and that is known to scatter evenly, else scattered rays as well.

mod judge;
mod scout;
mod trial;

use super::path::{Auto, PathTracer};
use super::strategy::{BLOCK_SIDE, Strategies, Strategy};
use super::{PilotPlan, RayCounts, Specialised};
use crate::scene::Scene;
use judge::{Bare, Choice, Judge};
use scout::{Class, Seen};
use std::sync::Arc;
use trial::{SAMPLES, Tracing};

/// Strategies that are tried, at most, or nearly so.
const CANDIDATES: usize = 4;
/// Fewer pixels of a material say nothing.
const LEAST: usize = 24;
/// Pixels, over all materials, that a render must afford to try out for trials to be worth their tables of the sky, of
/// hundreds of directions and for each strategy others: under a tame light, where there is most to be gained, and others.
const WORTHWHILE: [usize; 2] = [192, 768];
/// Most part of a render's samples that is spent on trying.
const SHARE: f64 = 0.02;
/// Fewest pixels, across and down, for each of those that are looked at: by then a block is known.
const STEP: u32 = 4;
/// Most strategies that are kept, of all blocks and materials; beyond, there is one for each material.
const MOST_KEPT: usize = 1 << 20;

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
    /// Whether surface points may take several light samples.
    splits: bool,
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
            splits,
            is_tame: contrast <= TAME,
        }
    }

    fn usual(&self, is_even: bool) -> Strategy {
        if is_even { self.even } else { self.others }
    }

    /// What is tried for a material, the most likely first. Scattered rays alone miss what is small and bright. So do light
    /// samples on narrow lobes: tables know their widths and middles, not their shapes.
    fn candidates(&self, is_even: bool) -> Vec<Strategy> {
        let usual = self.usual(is_even);
        let mut all = vec![usual];
        match usual {
            Strategy::Light(8) => all.extend([Strategy::Light(2), Strategy::Light(1)]),
            Strategy::Both(1) if is_even && self.splits => all.push(Strategy::Light(8)),
            Strategy::Both(1) => {}
            _ => all.push(Strategy::Both(1)),
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
    let auto = tracer.auto_strategy.filter(|_| tracer.light_sampling && tracer.mis)?;
    let choices = Choices::new(tracer, scene, scene.lights.guided()?.1.contrast());
    let mut seen = Seen::new(scene);
    let mut rays = RayCounts::default();
    let samples = SHARE * plan.pixels.area() as f64 * f64::from(plan.spp);
    let affordable = (samples / (SAMPLES as usize * CANDIDATES) as f64) as usize;
    let tries = affordable >= WORTHWHILE[usize::from(!choices.is_tame)] && choices.are_several();
    if affordable >= LEAST {
        rays.camera += seen.scout(scene, plan, samples as usize);
    }
    for class in &mut seen.classes {
        class.candidates = choices.candidates(class.is_even);
        class.candidates.truncate(if tries && class.pixels >= LEAST { usize::MAX } else { 1 });
    }
    let usual: Vec<Strategy> = seen.classes.iter().map(Class::usual).collect();
    let decided = tries.then(|| {
        let every = seen.thin_out(affordable);
        let tracing = Tracing { tracer, scene, plan, classes: &seen.of, usual: &usual };
        let cells = tracing.cells(&seen);
        let bare = if plan.by_need { Bare::default() } else { Bare::of(&tracing, &seen, affordable / 4) };
        cells.iter().flat_map(|c| &c.trials).for_each(|t| rays.add(&t.rays));
        rays.add(&bare.rays);
        Judge { classes: &seen.classes, bare, every: every as f64, by_need: plan.by_need }
            .decide(cells, auto == Auto::ByBlock)
    });
    let choice = decided.unwrap_or_else(|| Choice { usual, elsewhere: Vec::new() });
    let kept = plan.pixels.tiles(BLOCK_SIDE).count().saturating_mul(seen.classes.len());
    let strategies = if choice.elsewhere.is_empty() || kept > MOST_KEPT {
        Strategies::by_class(seen.of.clone(), &choice.usual)
    } else {
        let rows = choice.rows(kept / seen.classes.len());
        Strategies::by_block(seen.of.clone(), plan.pixels, &rows, seen.classes.len())
    };
    let decided = describe(&seen, &choice);
    let integrator = Arc::new(PathTracer { strategies, auto_strategy: None, ..tracer.clone() });
    Some(Specialised { integrator, decided, rays })
}

/// "light-8 for 3 materials, both for 1; by light-2, bsdf in 30 of 240 parts of blocks".
fn describe(seen: &Seen, choice: &Choice) -> String {
    let mut parts = Vec::new();
    for (name, strategy) in Strategy::NAMES {
        let wanted = |class: &Class, of: &Strategy| *of == strategy && class.scatters();
        let n = seen.classes.iter().zip(&choice.usual).filter(|(class, of)| wanted(class, of)).count();
        if n > 0 {
            parts.push(format!("{name} for {n} material{}", if n == 1 { "" } else { "s" }));
        }
    }
    let mut text = format!("sky found by {}", parts.join(", "));
    if !choice.elsewhere.is_empty() {
        let is_there = |wanted: &Strategy| choice.elsewhere.iter().any(|(_, strategy)| strategy == wanted);
        let names = Strategy::NAMES.iter().filter(|(_, strategy)| is_there(strategy));
        let names = names.map(|n| n.0).collect::<Vec<_>>().join(", ");
        text +=
            &format!("; by {names} in {} of {} parts of blocks", choice.elsewhere.len(), seen.cells.len());
    }
    text
}
