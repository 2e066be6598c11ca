//! Surfaces below a light that takes them into account.

use super::Workspace;
use super::depth::Block;
use super::path::{PathScratch, PathTracer};
use super::points::VertexPoint;
use super::several::Counts;
use super::strategy::{MOST_SPLIT, Strategy};
use super::surface::Surface;
use super::{PathId, light_dim};
use crate::base::directions::LANES;
use crate::base::light::{ChosenLight, Guide, GuidedLight, Lobes};
use crate::base::material::Scattering;
use crate::sampler::{Dim, Slot};
use glam::Vec3;

/// So few samples are not worth being worked out together.
const FEW: f32 = 2.0;

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
        let mut guide = Guide::default();
        let split = match strategy {
            Strategy::Light(n) if block.splits => u32::from(n),
            Strategy::Both(n) if block.splits && block.ends => u32::from(n),
            _ => 1,
        };
        let split = (split / block.times).max(1);
        let ready = strategy != Strategy::Bsdf && {
            let scattering = s.material.scattering(&s.prepared).unwrap_or(Scattering::EVEN);
            let lobes = Lobes { wo: s.v.wo, scattering, alone: strategy.is_light(), samples: split };
            light.prepare(&s.receiver, &lobes, &mut guide)
        };
        let scattered = if strategy.is_light() { 0 } else { split };
        let before = work.shadow.len();
        if !delta {
            let how = How { guided, guide, ready, scattered: scattered as f32 };
            match split {
                1 => block.ask_guided(s, &how, work, paths),
                _ => block.ask_again(s, &how, split, work, paths),
            }
        }
        let more = u64::from(split) - 1;
        work.avoided.candidates += more + u64::from(scattered.max(1)) - 1;
        let missing = block.shadow_rays() + more - (work.shadow.len() - before) as u64;
        let alone = match strategy {
            _ if delta => missing,
            Strategy::Bsdf => missing.min(1),
            Strategy::Light(_) | Strategy::Both(_) => 0,
        };
        work.avoided.scattered_alone += alone;
        work.avoided.dark_samples += missing - alone;
        // Light samples have counted all that scattered rays would find, and there is nothing else to be found.
        if strategy.is_light() && block.guided_alone {
            work.avoided.lit_alone += 1;
            return;
        }
        let pmf = block.guided_pmf(index, s);
        let guided_pdf = |wi: Vec3| match strategy {
            Strategy::Light(_) => f32::INFINITY,
            Strategy::Both(_) if ready => pmf * light.pdf(&s.receiver, &guide, wi),
            Strategy::Both(_) | Strategy::Bsdf => 0.0,
        };
        if scattered <= 1 {
            let point = paths.points.get(s.number);
            return self.extend(block, s, &point, work, paths, guided_pdf);
        }
        let id = paths.points.get(s.number).id;
        let id = PathId { sampler: id.sampler.times(split), index: id.index.wrapping_mul(split), ..id };
        let points = draw(&id, Dim::at(block.depth, Slot::BsdfUv));
        for k in 0..split {
            let id = PathId { index: id.index.wrapping_add(k), ..id };
            let bsdf = points.map(|column| column[k as usize]);
            let point = VertexPoint { id, light: [0.0; 2], bsdf, share: 1.0 / split as f32 };
            self.extend(block, s, &point, work, paths, guided_pdf);
        }
    }
}

/// The points of some samples from one on, as many as any surface takes.
#[inline]
fn draw(first: &PathId, dim: Dim) -> [[f32; LANES]; 2] {
    const { assert!(MOST_SPLIT as usize <= LANES) };
    first.sampler.few_2d(first.index, dim)
}

/// How the guided light is sampled from a surface.
struct How<'a> {
    guided: Guided<'a>,
    /// What it has worked out for the surface.
    guide: Guide,
    /// Whether it can be sampled at all.
    ready: bool,
    /// How many scattered rays compete.
    scattered: f32,
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

    /// Several shadow rays to the only light there is; each sample has the weight of a light that is chosen as many times
    /// as often. Their points follow one another in a sequence of as many more: together they are as even as if so many
    /// paths had drawn one.
    #[inline]
    fn ask_again(&self, s: &Surface, how: &How, n: u32, work: &mut Workspace, paths: &mut PathScratch) {
        let id = paths.points.get(s.number).id;
        let id = PathId { sampler: id.sampler.times(n), index: id.index.wrapping_mul(n), ..id };
        let points = draw(&id, Dim::at(self.depth, Slot::LightUv));
        if !how.ready {
            return;
        }
        let (light, guided) = how.guided;
        if how.guide.worth * n as f32 <= FEW {
            let chosen = ChosenLight { light, pmf: n as f32 };
            for k in 0..n as usize {
                self.ask_one(s, how, chosen, points.map(|column| column[k]), work, paths);
            }
            return;
        }
        let lanes = guided.sample_many(&s.receiver, &how.guide, &points, n as usize);
        let counts = Counts { lit: n as f32, scattered: how.scattered };
        self.connect_many(s, light, &lanes, counts, work, paths);
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
            true if how.ready => light.sample(&s.receiver, &how.guide, u),
            true => None,
            false => self.scene.lights.list[chosen.light as usize].sample_li(&s.receiver, u),
        };
        if let Some(l) = sample {
            let scattered = if is_guided { how.scattered } else { how.scattered.max(1.0) };
            self.connect(s, chosen, &l, scattered, work, paths);
        }
    }
}
