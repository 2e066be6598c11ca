//! Surfaces below a light that takes them into account.

use super::Workspace;
use super::depth::Block;
use super::light_dim;
use super::path::{PathScratch, PathTracer};
use super::strategy::Strategy;
use super::surface::Surface;
use crate::base::light::{ChosenLight, GuidedLight, Lobes};
use crate::base::material::Scattering;
use crate::sampler::{Dim, Slot};

/// A guided light and its index.
type Guided<'a> = (u32, &'a dyn GuidedLight);

impl PathTracer {
    /// A light sample or none, then the direction in which the path goes on: as [`PathTracer::scatter`], with what the
    /// light worked out for this surface still at hand when the density of that direction is asked for.
    pub(super) fn scatter_guided(
        &self,
        block: &Block,
        guided: Guided,
        s: &Surface,
        work: &mut Workspace,
        paths: &mut PathScratch,
    ) {
        let delta = s.material.is_delta();
        let strategy = if delta { Strategy::Bsdf } else { block.strategies.of(&s.v) };
        let (index, light) = guided;
        let ready = strategy != Strategy::Bsdf && {
            let scattering = s.material.scattering(&s.prepared).unwrap_or(Scattering::EVEN);
            let lobes = Lobes { wo: s.v.wo, scattering };
            light.prepare(&s.receiver, &lobes, &mut paths.guide)
        };
        let before = work.shadow.len();
        if !delta {
            let how = How { guided, ready, alone: strategy == Strategy::Light };
            block.ask_guided(s, &how, work, paths);
        }
        let missing = block.shadow_rays() - (work.shadow.len() - before) as u64;
        let alone = match strategy {
            _ if delta => missing,
            Strategy::Bsdf => missing.min(1),
            Strategy::Light | Strategy::Both => 0,
        };
        work.avoided.scattered_alone += alone;
        work.avoided.dark_samples += missing - alone;
        // Light samples have counted all that scattered rays would find, and there is nothing else to be found.
        if strategy == Strategy::Light && block.guided_alone {
            work.avoided.lit_alone += 1;
            return;
        }
        let pmf = block.guided_pmf(index, s);
        self.extend(block, s, work, paths, |guide, wi| match strategy {
            Strategy::Light => f32::INFINITY,
            Strategy::Both if ready => pmf * light.pdf(&s.receiver, guide, wi),
            Strategy::Both | Strategy::Bsdf => 0.0,
        });
    }
}

/// How the guided light is sampled from a surface.
struct How<'a> {
    guided: Guided<'a>,
    /// Whether it can be sampled at all.
    ready: bool,
    /// Whether no scattered ray competes.
    alone: bool,
}

impl Block<'_> {
    /// The probability of choosing the guided light.
    #[inline]
    fn guided_pmf(&self, index: u32, s: &Surface) -> f32 {
        match self.scene.features.many_lights && !self.each_light {
            true => self.scene.lights.sampler.pmf(&s.receiver, index),
            false => 1.0,
        }
    }

    /// Shadow rays to one light, or to each.
    #[inline]
    fn ask_guided(&self, s: &Surface, how: &How, work: &mut Workspace, paths: &mut PathScratch) {
        let point = paths.points.get(s.number);
        let id = &point.id;
        let lights = &self.scene.lights;
        if self.each_light && lights.list.len() > 1 {
            for (number, light) in (0..).zip(&lights.list) {
                let u = match number {
                    _ if light.is_delta() => [0.0; 2],
                    0 => point.light,
                    _ => id.sampler.get_2d(id.index, light_dim(self.depth, number)),
                };
                self.ask_one(s, how, ChosenLight { light: number, pmf: 1.0 }, u, work, paths);
            }
            return;
        }
        let chosen = if self.scene.features.many_lights {
            let pick = id.sampler.get_1d(id.index, Dim::at(self.depth, Slot::LightPick));
            let Some(chosen) = lights.sampler.sample(&s.receiver, pick) else { return };
            chosen
        } else {
            ChosenLight { light: how.guided.0, pmf: 1.0 }
        };
        self.ask_one(s, how, chosen, point.light, work, paths);
    }

    #[inline]
    fn ask_one(
        &self,
        s: &Surface,
        how: &How,
        chosen: ChosenLight,
        u: [f32; 2],
        work: &mut Workspace,
        paths: &mut PathScratch,
    ) {
        let (index, light) = how.guided;
        let is_guided = chosen.light == index;
        let sample = match is_guided {
            true if how.ready => light.sample(&s.receiver, &paths.guide, u),
            true => None,
            false => self.scene.lights.list[chosen.light as usize].sample_li(&s.receiver, u),
        };
        if let Some(l) = sample {
            self.connect(s, chosen, &l, how.alone && is_guided, work, paths);
        }
    }
}
