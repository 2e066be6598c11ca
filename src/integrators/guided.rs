//! Surfaces below a light that takes them into account.

use super::Workspace;
use super::depth::Block;
use super::path::{PathScratch, PathTracer};
use super::points::VertexPoint;
use super::several::{Counts, draw};
use super::strategy::Strategy;
use super::surface::Surface;
use super::together::Alike;
use super::{PathId, light_dim};
use crate::base::light::{ChosenLight, Guide, GuidedLight, LightSample, Lobes, Receiver};
use crate::base::material::Scattering;
use crate::sampler::{Dim, Slot};
use glam::Vec3;

/// So few samples are not worth being worked out together.
const FEW: f32 = 2.0;

/// A guided light and its index.
pub(super) type Guided<'a> = (u32, &'a dyn GuidedLight);

/// How the guided light is found from a surface.
#[derive(Clone, Copy, Default)]
pub(super) struct How {
    strategy: Strategy,
    /// What the light has worked out for the surface.
    guide: Guide,
    /// Whether it can be sampled at all.
    ready: bool,
    /// Light samples; where they are not several, of any light.
    pub lit: u32,
    /// Scattered rays that compete with each.
    pub scattered: u32,
}

/// Light samples on the guided light that compete with a scattered ray. Their density is worked out where the ray finds the
/// light, which many never do.
#[derive(Clone, Copy, Default)]
pub(super) struct Rivals {
    /// How many there are on average for each scattered ray: 0 if none, infinite where what the ray finds counts nothing.
    times: f32,
    /// What the light has worked out for the surface.
    guide: Guide,
}

impl Rivals {
    /// Their density per solid angle in a direction.
    #[inline]
    pub fn pdf(&self, light: &dyn GuidedLight, from: &Receiver, wi: Vec3) -> f32 {
        if self.times == 0.0 || self.times == f32::INFINITY {
            return self.times;
        }
        self.times * light.pdf(from, &self.guide, wi)
    }
}

impl PathTracer {
    /// Light samples or none, then the directions in which paths go on: as [`PathTracer::scatter`], but each stage for all
    /// surfaces, as they wait for tables that lie anywhere in memory: together, and not one after the other.
    pub(super) fn scatter_guided(
        &self,
        block: &Block,
        guided: Guided,
        (surfaces, alike): (&mut [Surface], Option<&Alike>),
        work: &mut Workspace,
        paths: &mut PathScratch,
    ) {
        let mut hows = [How::default(); Surface::AT_ONCE];
        for (how, s) in hows.iter_mut().zip(&*surfaces) {
            *how = block.how(guided, s);
        }
        let asks_each = block.each_light && block.scene.lights.list.len() > 1;
        for (how, s) in hows.iter().zip(surfaces.iter_mut()) {
            if how.lit == 1 && !asks_each {
                s.lit = block.sample_one(s, guided, how, &paths.points.get(s.number));
            }
        }
        for (how, s) in hows.iter().zip(&*surfaces) {
            let before = work.shadow.len();
            match how.lit {
                0 => {}
                1 if asks_each => block.ask_all(s, guided, how, work, paths),
                1 => {
                    if let Some((chosen, l)) = &s.lit {
                        block.connect_one(s, (guided.0, how), (*chosen, l), work, paths);
                    }
                }
                _ => block.ask_again(s, guided, how, work, paths),
            }
            block.count(how, work.shadow.len() - before, work);
        }
        let hows = &hows[..surfaces.len()];
        self.go_on(block, guided.0, (surfaces, alike, hows), work, paths);
    }

    /// The directions in which paths go on.
    fn go_on(
        &self,
        block: &Block,
        index: u32,
        (surfaces, alike, hows): (&[Surface], Option<&Alike>, &[How]),
        work: &mut Workspace,
        paths: &mut PathScratch,
    ) {
        let mut rivals = [Rivals::default(); Surface::AT_ONCE];
        for (rivals, (how, s)) in rivals.iter_mut().zip(hows.iter().zip(surfaces)) {
            *rivals = how.rivals(block.guided_pmf(index, s));
        }
        // Those of one material have one strategy.
        let many = alike.filter(|_| hows.last().is_some_and(|how| how.scattered <= 1));
        let singles = surfaces.len() - many.map_or(0, |alike| alike.n);
        for (i, (how, s)) in hows.iter().zip(surfaces).enumerate().take(singles) {
            if how.ends(block) {
                work.avoided.lit_alone += 1;
            } else if how.scattered > 1 {
                self.extend_several(block, s, (how.scattered, rivals[i]), work, paths);
            } else {
                self.extend(block, s, &paths.points.get(s.number), rivals[i], work, paths);
            }
        }
        match many.zip(hows.last()) {
            None => {}
            Some((alike, how)) if how.ends(block) => work.avoided.lit_alone += alike.n as u64,
            Some((alike, _)) => {
                self.extend_many(block, alike, (&surfaces[singles..], &rivals[singles..]), work, paths);
            }
        }
    }
}

impl How {
    /// What scattered rays compete with, if the guided light is chosen with this probability.
    fn rivals(&self, pmf: f32) -> Rivals {
        match self.strategy {
            Strategy::Light(_) => Rivals { times: f32::INFINITY, guide: self.guide },
            Strategy::Both(_) if self.ready => Rivals { times: pmf, guide: self.guide },
            Strategy::Both(_) | Strategy::Bsdf => Rivals::default(),
        }
    }

    /// Whether light samples have counted all that scattered rays would find, and there is nothing else to be found.
    pub(super) fn ends(&self, block: &Block) -> bool {
        self.strategy.is_light() && block.guided_alone
    }
}

impl Block<'_> {
    pub(super) fn how(&self, (_, light): Guided, s: &Surface) -> How {
        let delta = s.material.is_delta();
        let strategy = if delta { Strategy::Bsdf } else { self.strategies.of(s.v.object, s.v.slot) };
        let mut guide = Guide::default();
        let split = match strategy {
            Strategy::Light(n) if self.splits => u32::from(n),
            Strategy::Both(n) if self.splits && self.ends => u32::from(n),
            _ => 1,
        };
        let split = (split / self.times).max(1);
        let ready = strategy != Strategy::Bsdf && {
            let scattering = s.material.scattering(&s.prepared).unwrap_or(Scattering::EVEN);
            let lobes = Lobes { wo: s.v.wo, scattering, alone: strategy.is_light(), samples: split };
            light.prepare(&s.receiver, &lobes, &mut guide)
        };
        let scattered = if strategy.is_light() { 0 } else { split };
        How { strategy, guide, ready, lit: if delta { 0 } else { split }, scattered }
    }

    /// Counts rays that are spared at a surface with so many shadow rays.
    fn count(&self, how: &How, shadow_rays: usize, work: &mut Workspace) {
        let more = u64::from(how.lit.max(1)) - 1;
        work.avoided.candidates += more + u64::from(how.scattered.max(1)) - 1;
        let missing = self.shadow_rays() + more - shadow_rays as u64;
        let alone = match how.strategy {
            _ if how.lit == 0 => missing,
            Strategy::Bsdf => missing.min(1),
            Strategy::Light(_) | Strategy::Both(_) => 0,
        };
        work.avoided.scattered_alone += alone;
        work.avoided.dark_samples += missing - alone;
    }

    /// The probability of choosing the guided light.
    #[inline]
    fn guided_pmf(&self, index: u32, s: &Surface) -> f32 {
        match self.scene.features.many_lights && !self.each_light {
            true => self.scene.lights.sampler.pmf(&s.receiver, index),
            false => 1.0,
        }
    }

    /// A point on the guided light, or on one that is chosen.
    #[inline(always)]
    pub(super) fn sample_one(
        &self,
        s: &Surface,
        guided: Guided,
        how: &How,
        point: &VertexPoint,
    ) -> Option<(ChosenLight, LightSample)> {
        let chosen = if self.scene.features.many_lights {
            let id = &point.id;
            let pick = id.sampler.get_1d(id.index, Dim::at(self.depth, Slot::LightPick));
            self.scene.lights.sampler.sample(&s.receiver, pick)?
        } else {
            ChosenLight { light: guided.0, pmf: 1.0 }
        };
        Some((chosen, self.sample(s, guided, how, chosen.light, point.light)?))
    }

    #[inline(always)]
    pub(super) fn sample(
        &self,
        s: &Surface,
        (index, light): Guided,
        how: &How,
        which: u32,
        u: [f32; 2],
    ) -> Option<LightSample> {
        match which == index {
            true if how.ready => light.sample(&s.receiver, &how.guide, u),
            true => None,
            false => self.scene.lights.list[which as usize].sample_li(&s.receiver, u),
        }
    }

    /// A shadow ray to what was sampled of a light.
    #[inline(never)]
    fn connect_one(
        &self,
        s: &Surface,
        (guided, how): (u32, &How),
        (chosen, l): (ChosenLight, &LightSample),
        work: &mut Workspace,
        paths: &mut PathScratch,
    ) {
        let scattered = if chosen.light == guided { how.scattered } else { how.scattered.max(1) };
        self.connect(s, chosen, l, scattered as f32, work, paths);
    }

    /// Shadow rays to each light.
    fn ask_all(&self, s: &Surface, guided: Guided, how: &How, work: &mut Workspace, paths: &mut PathScratch) {
        let point = paths.points.get(s.number);
        let id = &point.id;
        for (number, light) in (0..).zip(&self.scene.lights.list) {
            let u = match number {
                _ if light.is_delta() => [0.0; 2],
                0 => point.light,
                _ => id.sampler.get_2d(id.index, light_dim(self.depth, number)),
            };
            if let Some(l) = self.sample(s, guided, how, number, u) {
                let chosen = ChosenLight { light: number, pmf: 1.0 };
                self.connect_one(s, (guided.0, how), (chosen, &l), work, paths);
            }
        }
    }

    /// Several shadow rays to the only light there is; each sample has the weight of a light that is chosen as many times
    /// as often. Their points follow one another in a sequence of as many more: together they are as even as if so many
    /// paths had drawn one.
    #[inline]
    fn ask_again(
        &self,
        s: &Surface,
        guided: Guided,
        how: &How,
        work: &mut Workspace,
        paths: &mut PathScratch,
    ) {
        let n = how.lit;
        let id = paths.points.get(s.number).id;
        let id = PathId { sampler: id.sampler.times(n), index: id.index.wrapping_mul(n), ..id };
        let points = draw(&id, Dim::at(self.depth, Slot::LightUv));
        if !how.ready {
            return;
        }
        if how.guide.worth * n as f32 <= FEW {
            let chosen = ChosenLight { light: guided.0, pmf: n as f32 };
            for k in 0..n as usize {
                let u = points.map(|column| column[k]);
                if let Some(l) = guided.1.sample(&s.receiver, &how.guide, u) {
                    self.connect_one(s, (guided.0, how), (chosen, &l), work, paths);
                }
            }
            return;
        }
        let lanes = guided.1.sample_many(&s.receiver, &how.guide, &points, n as usize);
        let counts = Counts { lit: n as f32, scattered: how.scattered as f32 };
        self.connect_many(s, guided.0, &lanes, counts, work, paths);
    }
}
