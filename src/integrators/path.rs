//! Unidirectional path tracing with next-event estimation: light samples and material samples are combined by
//! multiple importance sampling (Veach 1997, ch. 9), long paths end by Russian roulette.

use super::escapes::Escapes;
use super::points::{VertexPoint, VertexPoints};
use super::{CameraBatch, FirstHit, Integrator, PathId, PathIds, PathResults, Workspace};
use crate::base::hit::{HitBatch, NO_PRIMITIVE};
use crate::base::light::{PathEnd, Receiver};
use crate::base::material::{Material, Prepared};
use crate::base::ray::{Coherence, RayBatch};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::error::Result;
use crate::sampler::ray_key;
use crate::sampler::{Dim, Slot};
use crate::sampling::mis::power;
use crate::scene::Scene;
use glam::Vec3;
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
    ],
    build: |p| Ok(Arc::new(PathTracer::from_params(p)?)),
    samples: || vec![Params::new(), Params::new().with("light_sampling", Value::Bool(false))],
};

/// Shared with `direct`.
pub(super) const LIGHT_SAMPLING: ParamSpec = ParamSpec {
    name: "light_sampling",
    kind: ParamKind::Bool,
    default: Some("true"),
    doc: "sample lights at each surface; false leaves them to be found by scattered rays",
};

/// The integrator `path`; with a depth of 1 it is `direct`.
pub struct PathTracer {
    /// See the row.
    pub max_depth: u32,
    /// See the row.
    pub roulette_depth: u32,
    /// See the row.
    pub light_sampling: bool,
}

/// A path on its way.
#[derive(Clone, Copy)]
struct PathState {
    /// Throughput.
    beta: Rgb,
    /// Density per solid angle of the direction travelled; infinite where no light sample competes.
    pdf: f32,
    /// Where the ray left, for the density of light samples.
    from: Receiver,
    /// Index into the block.
    index: u32,
}

/// A light sample that waits for its shadow ray.
#[derive(Clone, Copy)]
struct Pending {
    /// What the path brings: radiance, or what radiance is to be multiplied by.
    value: Rgb,
    /// Index into the block.
    index: u32,
    /// The light that has to be asked for the radiance, if it did not say.
    ask: Option<u32>,
}

/// Path states, kept from block to block.
#[derive(Default)]
pub struct PathScratch {
    states: Vec<PathState>,
    next: Vec<PathState>,
    pending: Vec<Pending>,
    escapes: Escapes,
    /// Which rays of the depth met something.
    hits: Vec<u32>,
    points: VertexPoints,
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
            let block = Block { scene, ids: &batch.ids, depth };
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
}

/// What is the same for all paths of a depth.
struct Block<'a> {
    scene: &'a Scene,
    ids: &'a PathIds,
    depth: u32,
}

impl PathTracer {
    fn from_params(p: &Params) -> Result<Self> {
        Ok(PathTracer {
            max_depth: p.number_or("max_depth", 6.0)? as u32,
            roulette_depth: p.number_or("roulette_depth", 4.0)? as u32,
            light_sampling: p.bool_or("light_sampling", true)?,
        })
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
        let block = Block { scene, ids: &batch.ids, depth: 1 };
        paths.begin(&mut work.next, &mut work.shadow);
        if work.hits.none() {
            // Most batches of most pictures: nothing but sky, and nothing to sort out.
            return paths.escapes.fill_background(scene, rays.directions(), &mut out.li);
        }
        paths.sort_out(&work.hits, rays);
        paths.draw(&block, self.light_sampling, |_, i| i);
        for k in 0..paths.hits.len() {
            let i = paths.hits[k] as usize;
            let Some(hit) = work.hits.get(i) else { continue };
            let v = scene.vertex(&rays.get(i), hit, batch.spread);
            out.alpha[i] = 1.0;
            if batch.want_first {
                out.first[i] = Some(first_hit(scene, v));
            }
            let state = PathState {
                beta: Rgb::WHITE,
                pdf: f32::INFINITY,
                from: Receiver { p: v.p, ng: Vec3::ZERO, ns: Vec3::ZERO },
                index: i as u32,
            };
            block.add_emission(&state, &v, rays.direction(i), out);
            let point = paths.points.get(k);
            self.scatter(&block, &state, &v, &point, work, paths);
        }
        paths.escapes.add_background(scene, &mut out.li);
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
        let goes_on = block.depth <= self.max_depth;
        if goes_on {
            paths.draw(block, self.light_sampling, |states, i| states[i as usize].index);
        }
        for k in 0..paths.hits.len() {
            let i = paths.hits[k] as usize;
            let Some(hit) = work.hits.get(i) else { continue };
            let state = paths.states[i];
            let v = block.scene.vertex(&rays.get(i), hit, 0.0);
            block.add_emission(&state, &v, rays.direction(i), out);
            if goes_on {
                let point = paths.points.get(k);
                self.scatter(block, &state, &v, &point, work, paths);
            }
        }
        block.add_escapes(paths, out);
        block.resolve_shadows(work, paths, out);
    }

    /// One surface: a light sample, then the direction in which the path goes on.
    fn scatter(
        &self,
        block: &Block,
        state: &PathState,
        v: &Vertex,
        point: &VertexPoint,
        work: &mut Workspace,
        paths: &mut PathScratch,
    ) {
        let material = block.scene.material(v);
        if material.is_black() {
            return;
        }
        let mut prepared = Prepared::default();
        material.prepare(v, &mut prepared);
        let surface = SurfacePoint { v, material, prepared: &prepared, wo: v.frame.to_local(v.wo), point };
        let lit = self.light_sampling && !material.is_delta();
        if lit {
            block.sample_light(state, &surface, work, paths);
        }
        self.extend(block, state, &surface, lit, work, paths);
    }

    fn extend(
        &self,
        block: &Block,
        state: &PathState,
        s: &SurfacePoint,
        lit: bool,
        work: &mut Workspace,
        paths: &mut PathScratch,
    ) {
        let id = &s.point.id;
        let roulette = block.depth >= self.roulette_depth && block.depth < self.max_depth;
        let lobe = if roulette || s.material.picks_lobe() {
            id.sampler.get_2d(id.index, Dim::at(block.depth, Slot::LobeAndRoulette))
        } else {
            [0.0; 2]
        };
        let Some(b) = s.material.sample(s.prepared, s.wo, s.point.bsdf, lobe[0]) else { return };
        let wi = s.v.frame.to_world(b.wi);
        let mut beta = state.beta * b.weight;
        if beta.is_black() || !s.v.is_consistent(wi) {
            return;
        }
        if roulette {
            // Survival by throughput; never certain, so that no path of a white scene lives for ever.
            let q = beta.max_component().min(0.95);
            if lobe[1] >= q {
                return;
            }
            beta = beta / q;
        }
        work.next.push(&s.v.spawn(wi, key(id, block.depth + 1)));
        paths.next.push(PathState {
            beta,
            pdf: if b.delta || !lit { f32::INFINITY } else { b.pdf },
            from: s.v.receiver(),
            index: state.index,
        });
    }
}

/// A vertex with its material read.
struct SurfacePoint<'a> {
    v: &'a Vertex,
    material: &'a dyn Material,
    prepared: &'a Prepared,
    wo: Vec3,
    point: &'a VertexPoint,
}

impl PathScratch {
    /// Which rays met something, and which leave.
    fn sort_out(&mut self, hits: &HitBatch, rays: &RayBatch) {
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
    fn draw(&mut self, block: &Block, with_light: bool, path_of: impl Fn(&[PathState], u32) -> u32) {
        let paths = self.hits.iter().map(|&i| path_of(&self.states, i));
        self.points.draw(block.ids, paths, block.depth, with_light);
    }

    fn begin(&mut self, next: &mut RayBatch, shadow: &mut RayBatch) {
        self.next.clear();
        self.pending.clear();
        self.escapes.clear();
        next.clear();
        shadow.clear();
    }
}

impl Block<'_> {
    /// Next-event estimation: one light, one point on it, one shadow ray, unless nothing can arrive.
    fn sample_light(
        &self,
        state: &PathState,
        s: &SurfacePoint,
        work: &mut Workspace,
        paths: &mut PathScratch,
    ) {
        let lights = &self.scene.lights;
        let id = &s.point.id;
        let pick = if self.scene.features.many_lights {
            id.sampler.get_1d(id.index, Dim::at(self.depth, Slot::LightPick))
        } else {
            0.0
        };
        let at = s.v.receiver();
        let Some(chosen) = lights.sampler.sample(&at, pick) else { return };
        let light = &lights.list[chosen.light as usize];
        let Some(l) = light.sample_li(&at, s.point.light) else { return };
        if !s.v.is_consistent(l.wi) {
            return;
        }
        let e = s.material.eval(s.prepared, s.wo, s.v.frame.to_local(l.wi));
        let value = state.beta * e.f_cos * l.li.unwrap_or(Rgb::WHITE);
        if value.is_black() {
            return;
        }
        let pdf = chosen.pmf * l.pdf;
        let weight = if l.delta { 1.0 } else { power(pdf, e.pdf) };
        work.shadow.push(&s.v.spawn_to(l.wi, l.dist, key(id, self.depth) ^ SHADOW_KEY));
        let ask = l.li.is_none().then_some(chosen.light);
        paths.pending.push(Pending { value: value * (weight / pdf), index: state.index, ask });
    }

    /// Traces the shadow rays of this depth and adds what arrives.
    fn resolve_shadows(&self, work: &mut Workspace, paths: &mut PathScratch, out: &mut PathResults) {
        if work.shadow.is_empty() {
            return;
        }
        work.counts.shadow += work.shadow.len() as u64;
        self.scene.kernel.occluded_batch(&work.shadow, &mut work.blocked, Coherence::Incoherent);
        let PathScratch { pending, escapes, .. } = paths;
        let arriving = || (0..).zip(&*pending).filter(|(i, _)| !work.blocked[*i as usize]);
        for (_, p) in arriving().filter(|(_, p)| p.ask.is_none()) {
            out.li[p.index as usize] += p.value;
        }
        for &light in &self.scene.lights.at_infinity {
            escapes.clear();
            for (i, _) in arriving().filter(|(_, p)| p.ask == Some(light)) {
                escapes.push(i, work.shadow.direction(i as usize));
            }
            for e in escapes.ask(&*self.scene.lights.list[light as usize]) {
                let p = &pending[e.number as usize];
                out.li[p.index as usize] += p.value * e.le;
            }
        }
    }

    /// The last rays of paths in a scene where only what lies at infinity shines: any hit ends them in the dark.
    fn leave_or_end(
        &self,
        rays: &RayBatch,
        work: &mut Workspace,
        paths: &mut PathScratch,
        out: &mut PathResults,
    ) {
        work.counts.shadow += rays.len() as u64;
        self.scene.kernel.occluded_batch(rays, &mut work.blocked, Coherence::Incoherent);
        paths.escapes.clear();
        for (i, _) in work.blocked.iter().enumerate().filter(|(_, blocked)| !**blocked) {
            paths.escapes.push(i as u32, rays.direction(i));
        }
        self.add_escapes(paths, out);
    }

    /// The light that a path's end lies on, if it does.
    #[inline]
    fn add_emission(&self, state: &PathState, v: &Vertex, wi: Vec3, out: &mut PathResults) {
        if !self.scene.features.emitting_surfaces {
            return;
        }
        if let Some(light) = self.scene.lights.of_vertex(v) {
            self.add_end(state, light, &PathEnd { wi, vertex: Some(v) }, out);
        }
    }

    /// Paths that leave the scene end on the lights at infinity.
    fn add_escapes(&self, paths: &mut PathScratch, out: &mut PathResults) {
        let PathScratch { states, escapes, .. } = paths;
        let lights = &self.scene.lights;
        for &light in &lights.at_infinity {
            for e in escapes.ask(&*lights.list[light as usize]).filter(|e| !e.le.is_black()) {
                let state = &states[e.number as usize];
                let end = PathEnd { wi: e.wi, vertex: None };
                let pdf = || lights.pdf(light, &end, &state.from);
                let weight = if state.pdf.is_finite() { power(state.pdf, pdf()) } else { 1.0 };
                out.li[state.index as usize] += state.beta * e.le * weight;
            }
        }
    }

    #[inline]
    fn add_end(&self, state: &PathState, light: u32, end: &PathEnd, out: &mut PathResults) {
        let from = state.pdf.is_finite().then_some(&state.from);
        let e = self.scene.lights.emitted(light, end, from);
        let weight = if from.is_some() { power(state.pdf, e.pdf) } else { 1.0 };
        out.li[state.index as usize] += state.beta * e.le * weight;
    }
}

/// Sets the keys of shadow rays apart from those of scattered rays.
const SHADOW_KEY: u32 = 0x9e37_79b9;

#[inline]
fn key(id: &PathId, depth: u32) -> u32 {
    ray_key(id.key, id.index, depth)
}

/// The record of a first surface for AOVs.
pub(super) fn first_hit(scene: &Scene, v: Vertex) -> FirstHit {
    let material = scene.material(&v);
    let mut prepared = Prepared::default();
    material.prepare(&v, &mut prepared);
    FirstHit { vertex: v, albedo: material.albedo(&prepared, v.frame.to_local(v.wo)) }
}
