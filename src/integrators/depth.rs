//! What is the same for all paths of a depth, and what the ends of paths count.

use super::path::{PathScratch, PathState};
use super::pending::{ShadowRays, add_arriving};
use super::strategy::Strategies;
use super::{PathIds, PathResults, Workspace};
use crate::base::light::{GuidedLight, PathEnd, Receiver};
use crate::base::ray::{Coherence, RayBatch};
use crate::base::vertex::Vertex;
use crate::sampling::mis::power;
use crate::scene::Scene;
use glam::Vec3;

/// Shadow rays that are traced together, at least, if there are as many. A quarter of this is 2 % slower; to trace them in the
/// order of their directions, put into 8 or some 40 bins, gained nothing (1.0 to 1.05 times the time).
const MANY_SHADOWS: usize = 4096;

/// What is the same for all paths of a depth.
pub(super) struct Block<'a> {
    pub scene: &'a Scene,
    pub ids: &'a PathIds,
    pub depth: u32,
    /// See [`super::path::PathTracer::mis`].
    pub mis: bool,
    /// Whether light samples are taken: some light can be sampled.
    pub samples_lights: bool,
    /// Whether each light is sampled.
    pub each_light: bool,
    /// The light at infinity that takes surfaces into account.
    pub guided: Option<(u32, &'a dyn GuidedLight)>,
    pub strategies: &'a Strategies,
    /// Whether surfaces may take several samples of the only light.
    pub splits: bool,
    /// Of how many of these they take one; at least 1. See [`super::CameraBatch::times`].
    pub times: u32,
    /// Whether rays that are scattered at this depth end where they land.
    pub ends: bool,
    /// Whether rays that are scattered at this depth can meet no other light than the guided one.
    pub guided_alone: bool,
}

impl Block<'_> {
    /// As [`Block::resolve_shadows`], if there are so many rays that more would not stay in the caches. (Between surfaces:
    /// what one of them adds to its path must not depend on others.)
    #[inline]
    pub(super) fn resolve_many(&self, work: &mut Workspace, paths: &mut PathScratch, out: &mut PathResults) {
        if work.shadow.len() >= MANY_SHADOWS {
            self.resolve_shadows(work, paths, out);
        }
    }

    /// Traces the shadow rays that wait and adds what arrives.
    pub(super) fn resolve_shadows(
        &self,
        work: &mut Workspace,
        paths: &mut PathScratch,
        out: &mut PathResults,
    ) {
        if work.shadow.is_empty() {
            return;
        }
        work.counts.shadow += work.shadow.len() as u64;
        self.scene.kernel.occluded_batch(&work.shadow, &mut work.blocked, Coherence::Incoherent);
        let PathScratch { pending, escapes, .. } = paths;
        add_arriving(
            self.scene,
            pending,
            ShadowRays { rays: &work.shadow, blocked: &work.blocked },
            escapes,
            &mut out.li,
        );
        work.shadow.clear();
        pending.clear();
    }

    /// The last rays of paths in a scene where only what lies at infinity shines: any hit ends them in the dark.
    pub(super) fn leave_or_end(
        &self,
        rays: &RayBatch,
        work: &mut Workspace,
        paths: &mut PathScratch,
        out: &mut PathResults,
    ) {
        work.counts.shadow += rays.len() as u64;
        self.scene.kernel.occluded_batch(rays, &mut work.blocked, Coherence::Incoherent);
        paths.escapes.pick(rays, |i| !work.blocked[i]);
        self.add_escapes(paths, out);
    }

    /// What a scattered ray counts that ends on a light, which light samples find with density `light`.
    #[inline]
    pub(super) fn weight(&self, state: &PathState, light: f32) -> f32 {
        match self.mis {
            true => power(state.pdf, light),
            false if light > 0.0 => 0.0,
            false => 1.0,
        }
    }

    /// Shadow rays that a surface point may have.
    pub(super) fn shadow_rays(&self) -> u64 {
        if self.each_light { self.scene.lights.list.len() as u64 } else { 1 }
    }

    /// The density per solid angle with which light samples from `from` find `end` on a light.
    #[inline]
    pub(super) fn light_pdf(&self, light: u32, end: &PathEnd, from: &Receiver) -> f32 {
        match self.each_light {
            true => self.scene.lights.list[light as usize].pdf_li(from, end),
            false => self.scene.lights.pdf(light, end, from),
        }
    }

    /// The light that a path's end lies on, if it does.
    #[inline]
    pub(super) fn add_emission(&self, state: &PathState, v: &Vertex, wi: Vec3, out: &mut PathResults) {
        if !self.scene.features.emitting_surfaces {
            return;
        }
        if let Some(light) = self.scene.lights.of_vertex(v) {
            self.add_end(state, light, &PathEnd { wi, vertex: Some(v) }, out);
        }
    }

    /// Paths that leave the scene end on the lights at infinity.
    pub(super) fn add_escapes(&self, paths: &mut PathScratch, out: &mut PathResults) {
        let PathScratch { states, escapes, .. } = paths;
        let lights = &self.scene.lights;
        for &light in &lights.at_infinity {
            for e in escapes.ask(&*lights.list[light as usize]).filter(|e| !e.le.is_black()) {
                let state = &states[e.number as usize];
                let end = PathEnd { wi: e.wi, vertex: None };
                let pdf = || match self.guided {
                    Some((index, guided)) if index == light => state.rivals.pdf(guided, &state.from, e.wi),
                    _ => self.light_pdf(light, &end, &state.from),
                };
                let weight = if state.pdf.is_finite() { self.weight(state, pdf()) } else { 1.0 };
                out.li[state.index as usize] += state.beta * e.le * weight;
            }
        }
    }

    #[inline]
    fn add_end(&self, state: &PathState, light: u32, end: &PathEnd, out: &mut PathResults) {
        let le = self.scene.lights.list[light as usize].le(end);
        if le.is_black() {
            return;
        }
        // Light sampling could not have found what the camera or a delta lobe sees.
        let competes = state.pdf.is_finite();
        let weight = if competes { self.weight(state, self.light_pdf(light, end, &state.from)) } else { 1.0 };
        out.li[state.index as usize] += state.beta * le * weight;
    }
}
