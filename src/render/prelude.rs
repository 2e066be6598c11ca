//! What is found out before a render's first sample, as functions of scene and settings alone.

use super::block::{Job, Outlined};
use super::coverage::Coverage;
use super::outlines::Outlines;
use super::settings::{OUTLINES, RenderSettings};
use super::{Renderer, backdrop};
use crate::error::Result;
use crate::integrators::{Integrator, PilotPlan, RayCounts, Specialised};
use crate::scene::Scene;
use std::sync::Arc;

/// See the module.
pub(super) struct Prelude {
    /// Pixels that take more samples.
    pub outlines: Option<Outlines>,
    /// Pixels that no geometry projects into, where these need no samples.
    pub coverage: Option<Coverage>,
    /// The integrator as it suits the scene.
    pub integrator: Arc<dyn Integrator>,
    /// What it decided; empty if nothing.
    pub decided: String,
    /// Rays that this took.
    pub pilot: RayCounts,
}

impl Prelude {
    /// Errors on a failure inside a kernel's callbacks.
    pub fn new(renderer: &Renderer, scene: &Scene) -> Result<Self> {
        let (s, integrator) = (&renderer.settings, &renderer.integrator);
        // A single sample a pixel shows what lies in its middle.
        let most = s.outlines.unwrap_or(if integrator.gains_by_outlines(scene) { OUTLINES } else { 1 });
        let outlines = if s.spp > 1 { Outlines::of(scene, s.crop, most) } else { None };
        scene.kernel.take_failure()?;
        let is_outline = |x, y| outlines.as_ref().is_some_and(|o| o.contains(x, y));
        let plan = PilotPlan {
            pixels: s.crop,
            spp: s.spp,
            seed: s.seed,
            kind: s.sampler,
            filter: s.filter,
            is_outline: &is_outline,
            outline_times: outlines.as_ref().map_or(1, Outlines::times),
            by_need: s.deals(),
        };
        let adapted = if s.pilot { integrator.specialise(scene, &plan) } else { None };
        let usual = || Specialised {
            integrator: integrator.clone(),
            decided: String::new(),
            rays: RayCounts::default(),
        };
        let Specialised { integrator, decided, rays: pilot } = adapted.unwrap_or_else(usual);
        let skips = s.skip_background && s.spp > 1 && integrator.shows_background();
        let coverage = if skips { backdrop::pays(scene, s.filter, s.crop, s.spp) } else { None };
        Ok(Prelude { outlines, coverage, integrator, decided, pilot })
    }

    /// What all tiles share.
    pub fn job<'a>(&'a self, scene: &'a Scene, settings: &'a RenderSettings) -> Job<'a> {
        let outlined = |o: &'a Outlines| Outlined { pixels: o, points: settings.outline_points(o.times()) };
        Job {
            coverage: self.coverage.as_ref(),
            outlines: self.outlines.as_ref().map(outlined),
            ..Job::new(scene, self.integrator.as_ref(), settings)
        }
    }
}
