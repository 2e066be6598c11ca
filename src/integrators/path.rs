//! Unidirectional path tracing with next-event estimation: light samples and material samples are combined by
//! multiple importance sampling (Veach 1997, ch. 9), long paths end by Russian roulette.

use super::depth::Block;
use super::escapes::Escapes;
use super::guided::Rivals;
use super::pending::Pending;
use super::points::VertexPoints;
use super::story::Story;
use super::strategy::{Strategies, Strategy};
use super::together::Together;
use super::{CameraBatch, FirstHit, Integrator, PathResults, PilotPlan, Specialised, Workspace, pilot};
use crate::base::hit::{HitBatch, NO_PRIMITIVE};
use crate::base::light::Receiver;
use crate::base::ray::{Coherence, RayBatch};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::color::Rgb;
use crate::error::Result;
use crate::scene::{Meetings, Scene};
use std::sync::Arc;

/// The registry row.
pub const ROW: Row<dyn Integrator> = Row {
    kind: "path",
    doc: "path tracing with light sampling, multiple importance sampling and Russian roulette",
    params: &[
        ParamSpec {
            name: "max_depth",
            kind: ParamKind::Integer { min: 1, max: 4096 },
            default: Some("6"),
            doc: "surfaces a path may scatter at, the camera's hit counted as 1",
        },
        ParamSpec {
            name: "roulette_depth",
            kind: ParamKind::Integer { min: 1, max: 4097 },
            default: Some("4"),
            doc: "first depth at which Russian roulette may end a path",
        },
        LIGHT_SAMPLING,
        EACH_LIGHT,
        STRATEGY,
        ParamSpec {
            name: "mis",
            kind: ParamKind::Bool,
            default: Some("true"),
            doc: "weigh light samples against scattered rays; false counts light samples alone wherever there are any",
        },
    ],
    build: |p| Ok(Arc::new(PathTracer::from_params(p)?)),
    samples: || {
        let off = |name| Params::new().with(name, Value::Bool(false));
        let each = Params::new().with("each_light", Value::Bool(true));
        let by = |name: &str| Params::new().with("strategy", Value::Text(name.into()));
        let by = ["both", "both-2", "light", "light-4", "bsdf"].map(by);
        [Params::new(), off("light_sampling"), off("mis"), each].into_iter().chain(by).collect()
    },
};

/// Shared with `direct`.
pub(super) const LIGHT_SAMPLING: ParamSpec = ParamSpec {
    name: "light_sampling",
    kind: ParamKind::Bool,
    default: Some("true"),
    doc: "sample lights at each surface; false leaves them to be found by scattered rays",
};

/// Shared with `direct`.
pub(super) const EACH_LIGHT: ParamSpec = ParamSpec {
    name: "each_light",
    kind: ParamKind::Bool,
    default: Some("false"),
    doc: "sample each light at a surface, not one that is chosen by what it may bring (beyond 1,024 lights always one)",
};

/// Shared with `direct`.
pub(super) const STRATEGY: ParamSpec = ParamSpec {
    name: "strategy",
    kind: ParamKind::Choice(&[
        "auto", "by-block", "both", "both-2", "both-4", "both-8", "light", "light-2", "light-4", "light-8",
        "bsdf",
    ]),
    default: Some("auto"),
    doc: "how a sky that is sampled by products is found: by light samples, scattered rays or both, so many of \
          each at the first surface where the sky is the only light (both: where paths end there); auto tries them out \
          for each material",
};

/// Most lights that are sampled each: a shadow ray for every one of them waits at every surface.
const MOST_EACH: usize = 1024;

/// The integrator `path`; with a depth of 1 it is `direct`.
#[derive(Clone)]
pub struct PathTracer {
    /// See the row.
    pub max_depth: u32,
    /// See the row.
    pub roulette_depth: u32,
    /// See the row.
    pub light_sampling: bool,
    /// See the row.
    pub each_light: bool,
    /// See the row.
    pub mis: bool,
    /// How light at infinity is found.
    pub strategies: Strategies,
    /// Whether [`Integrator::specialise`] may change `strategies`.
    pub auto_strategy: bool,
}

impl Default for PathTracer {
    /// What the row builds without parameters.
    fn default() -> Self {
        PathTracer {
            max_depth: 6,
            roulette_depth: 4,
            light_sampling: true,
            each_light: false,
            mis: true,
            strategies: Strategies::default(),
            auto_strategy: true,
        }
    }
}

/// A path on its way.
#[derive(Clone, Copy)]
pub(super) struct PathState {
    /// Throughput.
    pub beta: Rgb,
    /// Density per solid angle of the direction travelled; infinite where no light sample competes.
    pub pdf: f32,
    /// Where the ray left, for the density of light samples; nowhere if none competes.
    pub from: Receiver,
    /// What it competes with on the guided light.
    pub rivals: Rivals,
    /// Squared refractive index of the medium it travels in over that of the camera's.
    pub eta2: f32,
    /// Index into the block.
    pub index: u32,
}

impl PathState {
    /// Of a camera ray: what it meets shows all that it has.
    #[inline(always)]
    pub(super) fn from_camera(index: u32) -> Self {
        PathState {
            beta: Rgb::WHITE,
            pdf: f32::INFINITY,
            from: Receiver::NOWHERE,
            rivals: Rivals::default(),
            eta2: 1.0,
            index,
        }
    }
}

/// Path states, kept from block to block.
#[derive(Default)]
pub struct PathScratch {
    pub(super) states: Vec<PathState>,
    pub(super) next: Vec<PathState>,
    pub(super) pending: Vec<Pending>,
    pub(super) escapes: Escapes,
    /// Which rays of the depth met something.
    pub(super) hits: Vec<u32>,
    pub(super) points: VertexPoints,
}

impl Integrator for PathTracer {
    fn trace(&self, scene: &Scene, batch: &CameraBatch, work: &mut Workspace, out: &mut PathResults) {
        let mut paths = std::mem::take(&mut work.paths);
        let mut rays = std::mem::take(&mut work.rays);
        out.reset(batch.rays.len(), batch.want_first);
        self.first_depth(scene, batch, work, &mut paths, out);
        let mut depth = 1;
        while !paths.next.is_empty() {
            depth += 1;
            std::mem::swap(&mut paths.states, &mut paths.next);
            std::mem::swap(&mut rays, &mut work.next);
            let block = self.block(scene, batch, depth);
            if depth > self.max_depth && !scene.features.emitting_surfaces {
                block.leave_or_end(&rays, work, &mut paths, out);
                paths.next.clear();
            } else {
                self.next_depth(&block, &rays, work, &mut paths, out);
            }
        }
        work.paths = paths;
        work.rays = rays;
    }

    fn describe(&self) -> String {
        format!("path, depth {}", self.max_depth)
    }

    fn shows_background(&self) -> bool {
        true
    }

    /// Where samples of light are shared out among more camera rays. Where there is one of each, or a path, four times as many
    /// on outlines take 4 to 11 % more time to the same error (benches/README.md).
    fn gains_by_outlines(&self, scene: &Scene) -> bool {
        let (lights, ends) = (&scene.lights, self.max_depth == 1);
        let splits = self.light_sampling && lights.list.len() == 1 && lights.guided().is_some();
        splits && if self.auto_strategy { ends } else { self.strategies.usual().takes_several(ends) }
    }

    fn specialise(&self, scene: &Scene, plan: &PilotPlan) -> Option<Specialised> {
        pilot::choose(self, scene, plan)
    }

    fn tell(&self, scene: &Scene, batch: &CameraBatch, work: &mut Workspace) -> Option<Story> {
        Some(self.tell_path(scene, batch, work))
    }
}

/// None where it is to be tried out.
pub(super) fn strategy_param(p: &Params) -> Result<Option<Strategy>> {
    Ok(Strategy::find(p.text_or("strategy", "auto")?))
}

impl PathTracer {
    fn from_params(p: &Params) -> Result<Self> {
        let strategy = strategy_param(p)?;
        Ok(PathTracer {
            max_depth: p.number_or("max_depth", 6.0)? as u32,
            roulette_depth: p.number_or("roulette_depth", 4.0)? as u32,
            light_sampling: p.bool_or("light_sampling", true)?,
            each_light: p.bool_or("each_light", false)?,
            mis: p.bool_or("mis", true)?,
            strategies: Strategies::uniform(strategy.unwrap_or_default()),
            auto_strategy: strategy.is_none(),
        })
    }

    pub(super) fn block<'a>(&'a self, scene: &'a Scene, batch: &'a CameraBatch, depth: u32) -> Block<'a> {
        let lights = &scene.lights;
        let samples_lights = self.light_sampling && scene.features.sampled_lights;
        let guided = if samples_lights { lights.guided() } else { None };
        Block {
            scene,
            ids: &batch.ids,
            depth,
            mis: self.mis,
            samples_lights,
            each_light: self.each_light && lights.list.len() <= MOST_EACH,
            guided,
            strategies: &self.strategies,
            times: batch.times.max(1),
            splits: depth == 1 && lights.list.len() == 1,
            ends: depth == self.max_depth,
            guided_alone: depth >= self.max_depth
                && !scene.features.emitting_surfaces
                && lights.at_infinity.len() == 1,
        }
    }

    /// Camera rays: coherent, all of throughput 1, most of them perhaps straight into the sky.
    fn first_depth(
        &self,
        scene: &Scene,
        batch: &CameraBatch,
        work: &mut Workspace,
        paths: &mut PathScratch,
        out: &mut PathResults,
    ) {
        let rays = &batch.rays;
        work.counts.camera += rays.len() as u64;
        scene.kernel.intersect_batch(rays, &mut work.hits, Coherence::Coherent);
        let block = self.block(scene, batch, 1);
        paths.begin(&mut work.next, &mut work.shadow);
        if work.hits.none() {
            // Most batches of most pictures: nothing but sky, and nothing to sort out.
            return paths.escapes.fill_background(scene, rays.directions(), &mut out.li);
        }
        paths.sort_out(&work.hits, rays);
        paths.escapes.add_background(scene, &mut out.li);
        paths.draw(&block, |_, i| i);
        let mut some = Together::new(&block, true);
        loop {
            let met = Meetings { rays, hits: &work.hits, spread: batch.spread };
            let Some(found) = some.next(&met, &paths.hits, PathState::from_camera) else { break };
            for s in found.surfaces.iter() {
                out.alpha[s.state.index as usize] = 1.0;
                if batch.want_first {
                    out.first[s.state.index as usize] = Some(FirstHit::new(scene, s.v));
                }
                block.add_emission(&s.state, &s.v, -s.v.wo, out);
            }
            if let Some(like) = found.alike.as_ref().filter(|like| !like.recorded) {
                for (lane, &i) in paths.hits[like.range()].iter().enumerate() {
                    out.alpha[i as usize] = 1.0;
                    if batch.want_first {
                        out.first[i as usize] = Some(FirstHit::new(scene, like.vertices.get(lane)));
                    }
                }
            }
            self.scatter(&block, found, work, paths);
            block.resolve_many(work, paths, out);
        }
        block.resolve_shadows(work, paths, out);
    }

    /// Scattered rays.
    fn next_depth(
        &self,
        block: &Block,
        rays: &RayBatch,
        work: &mut Workspace,
        paths: &mut PathScratch,
        out: &mut PathResults,
    ) {
        work.counts.scattered += rays.len() as u64;
        block.scene.kernel.intersect_batch(rays, &mut work.hits, Coherence::Incoherent);
        paths.begin(&mut work.next, &mut work.shadow);
        paths.sort_out(&work.hits, rays);
        block.add_escapes(paths, out);
        let goes_on = block.depth <= self.max_depth;
        if goes_on {
            paths.draw(block, |states, i| states[i as usize].index);
        }
        let mut some = Together::new(block, goes_on);
        loop {
            let met = Meetings { rays, hits: &work.hits, spread: 0.0 };
            let state = |i: u32| paths.states[i as usize];
            let Some(found) = some.next(&met, &paths.hits, state) else { break };
            for s in found.surfaces.iter() {
                block.add_emission(&s.state, &s.v, -s.v.wo, out);
            }
            if goes_on {
                self.scatter(block, found, work, paths);
                block.resolve_many(work, paths, out);
            }
        }
        block.resolve_shadows(work, paths, out);
    }
}

impl PathScratch {
    /// Which rays met something, and which leave.
    pub(super) fn sort_out(&mut self, hits: &HitBatch, rays: &RayBatch) {
        self.hits.clear();
        for (i, &prim) in (0..).zip(&hits.prim) {
            if prim == NO_PRIMITIVE {
                self.escapes.push(i, rays.direction(i as usize));
            } else {
                self.hits.push(i);
            }
        }
    }

    /// Draws the points of all hits; `path_of` tells the path of a ray.
    pub(super) fn draw(&mut self, block: &Block, path_of: impl Fn(&[PathState], u32) -> u32) {
        let paths = self.hits.iter().map(|&i| path_of(&self.states, i));
        self.points.draw(block.ids, paths, block.depth, block.samples_lights);
    }

    pub(super) fn begin(&mut self, next: &mut RayBatch, shadow: &mut RayBatch) {
        self.next.clear();
        self.pending.clear();
        self.escapes.clear();
        next.clear();
        shadow.clear();
    }
}
