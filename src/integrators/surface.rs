//! What happens at the surface points of one depth: a light sample each, then the direction in which the path goes on.
//!
//! A few points are worked on at once, stage by stage: the form that shapes need, which work out several points in
//! vector code. By itself it is no faster than one point after the other (measured).

use super::Workspace;
use super::depth::Block;
use super::guided::Rivals;
use super::path::{PathScratch, PathState, PathTracer};
use super::pending::Pending;
use super::points::VertexPoint;
use super::story::Weighed;
use super::together::{Alike, Found};
use super::{PathId, light_dim};
use crate::base::lanes::LANES;
use crate::base::light::{ChosenLight, LightSample, Receiver};
use crate::base::material::{BsdfSample, Material, Prepared, Transmission};
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::sampler::{Dim, SHADOW_KEY, Slot, ray_key};
use crate::sampling::mis::power;
use crate::scene::Scene;
use glam::Vec3;

/// A surface point of a path, with its material read.
pub(super) struct Surface<'a> {
    /// The point.
    pub v: Vertex,
    /// The path that met it.
    pub state: PathState,
    /// Its number among the hits of the depth.
    pub(super) number: usize,
    pub(super) material: &'a dyn Material,
    pub(super) look: Look,
    pub(super) prepared: Prepared,
    /// Local direction to the viewer.
    pub(super) wo: Vec3,
    pub(super) receiver: Receiver,
    /// A sample of a light, which waits for its shadow ray.
    pub(super) lit: Option<(ChosenLight, LightSample)>,
}

/// What is the same for all points of a material: asked for once, not at each.
#[derive(Clone, Copy)]
pub(super) struct Look {
    pub transmission: Option<Transmission>,
    is_black: bool,
    pub is_delta: bool,
    pub picks_lobe: bool,
}

/// The material of the last point.
#[derive(Default)]
pub(super) struct LastLook<'a> {
    of: Option<(u32, u32)>,
    last: Option<(&'a dyn Material, Look)>,
    /// Its numbers, where all points have the same.
    prepared: Option<Prepared>,
}

/// A material whose points are all alike.
pub(super) struct Plain<'a> {
    pub material: &'a dyn Material,
    pub look: Look,
    pub prepared: Prepared,
}

impl<'a> LastLook<'a> {
    #[inline(always)]
    fn of(&mut self, scene: &'a Scene, (object, slot): (u32, u32)) -> (&'a dyn Material, Look) {
        match self.last {
            Some(last) if self.of == Some((object, slot)) => last,
            _ => self.ask(scene, (object, slot)),
        }
    }

    fn ask(&mut self, scene: &'a Scene, (object, slot): (u32, u32)) -> (&'a dyn Material, Look) {
        let material = scene.material_of(object, slot);
        let look = Look {
            transmission: material.transmission(),
            is_black: material.is_black(),
            is_delta: material.is_delta(),
            picks_lobe: material.picks_lobe(),
        };
        let plain = !look.is_black && !scene.lights.is_emitting(object);
        self.prepared = if plain { material.prepared_everywhere() } else { None };
        (self.of, self.last) = (Some((object, slot)), Some((material, look)));
        (material, look)
    }

    /// What all points of a slot have in common, if that is all there is to know of their material, and they scatter
    /// but do not shine.
    #[inline(always)]
    pub fn plain(&mut self, scene: &'a Scene, slot: (u32, u32)) -> Option<Plain<'a>> {
        let (material, look) = self.of(scene, slot);
        self.prepared.map(|prepared| Plain { material, look, prepared })
    }
}

impl<'a> Surface<'a> {
    /// Points worked on at once: few enough for the first-level cache.
    pub const AT_ONCE: usize = LANES;

    /// A point whose material is still to be read.
    #[inline(always)]
    pub fn new(
        scene: &'a Scene,
        last: &mut LastLook<'a>,
        v: Vertex,
        state: PathState,
        number: usize,
    ) -> Self {
        let (material, look) = last.of(scene, (v.object, v.slot));
        let wo = v.frame.to_local(v.wo);
        let receiver = if look.transmission.is_some() { v.receiver_all_round() } else { v.receiver() };
        Surface { v, state, number, material, look, prepared: Prepared::default(), wo, receiver, lit: None }
    }
}

impl PathTracer {
    /// Puts out shadow rays, and the rays of the next depth.
    pub(super) fn scatter(&self, block: &Block, found: Found, work: &mut Workspace, paths: &mut PathScratch) {
        let Found { surfaces, alike } = found;
        let all = surfaces.len();
        surfaces.retain(|s| !s.look.is_black);
        let black = (all - surfaces.len()) as u64;
        let shadow_rays = block.shadow_rays();
        work.avoided.points += all as u64;
        work.avoided.candidates += all as u64 * (shadow_rays + 1);
        work.avoided.dark_samples += black * shadow_rays;
        work.avoided.absorbed += black;
        for s in surfaces.iter_mut() {
            s.material.prepare(&s.v, &mut s.prepared);
        }
        let recorded = alike.as_ref().filter(|alike| alike.recorded);
        match block.guided {
            Some(guided) => self.scatter_guided(block, guided, (surfaces, recorded), work, paths),
            None => self.scatter_plainly(block, (surfaces, recorded), work, paths),
        }
        if let Some(alike) = alike.as_ref().filter(|alike| !alike.recorded) {
            self.scatter_many(block, alike, work, paths);
        }
    }

    /// The same below lights that do not take surfaces into account.
    fn scatter_plainly(
        &self,
        block: &Block,
        (surfaces, alike): (&mut [Surface], Option<&Alike>),
        work: &mut Workspace,
        paths: &mut PathScratch,
    ) {
        let shadow_rays = block.shadow_rays();
        let before = work.shadow.len();
        if block.samples_lights && block.each_light {
            for s in surfaces.iter().filter(|s| !s.look.is_delta) {
                block.ask_each(s, work, paths);
            }
        } else if block.samples_lights {
            for s in surfaces.iter_mut().filter(|s| !s.look.is_delta) {
                s.lit = block.sample_light(&s.receiver, &paths.points.get(s.number));
            }
            for s in surfaces.iter() {
                if let Some((chosen, l)) = &s.lit {
                    block.connect(s, *chosen, l, 1.0, work, paths);
                }
            }
        }
        let asked = match block.samples_lights {
            true => surfaces.iter().filter(|s| !s.look.is_delta).count(),
            false => 0,
        };
        work.avoided.scattered_alone += (surfaces.len() - asked) as u64 * shadow_rays;
        work.avoided.dark_samples += asked as u64 * shadow_rays - (work.shadow.len() - before) as u64;
        let (singles, many) = surfaces.split_at(surfaces.len() - alike.map_or(0, |alike| alike.n));
        for s in singles {
            let point = paths.points.get(s.number);
            self.extend(block, s, &point, Rivals::default(), work, paths);
        }
        if let Some(alike) = alike {
            self.extend_many(block, alike, (many, &[]), work, paths);
        }
    }

    /// The direction in which a path goes on, if it does, by the numbers of `point`.
    #[inline]
    pub(super) fn extend(
        &self,
        block: &Block,
        s: &Surface,
        point: &VertexPoint,
        rivals: Rivals,
        work: &mut Workspace,
        paths: &mut PathScratch,
    ) {
        let roulette = self.gambles(block);
        let lobe = self.lobe(block, s, point);
        let Some(Course { b, wi, mut beta, eta2 }) = s.onward(point.bsdf, lobe[0]) else {
            work.avoided.absorbed += 1;
            return;
        };
        if roulette {
            let q = survival(beta, eta2);
            if lobe[1] >= q {
                work.avoided.roulette += 1;
                return;
            }
            beta = beta / q;
        }
        work.next.push(&s.v.spawn(wi, key(&point.id, block.depth + 1)));
        // Light sampling competes wherever it is tried at all, also where it found nothing this time.
        let competes = block.samples_lights && !s.look.is_delta && !b.delta;
        let state = PathState {
            beta,
            pdf: if competes { b.pdf } else { f32::INFINITY },
            from: s.receiver,
            rivals,
            eta2,
            index: s.state.index,
        };
        paths.next.push(state);
    }

    /// Whether Russian roulette is played at a depth.
    #[inline(always)]
    pub(super) fn gambles(&self, block: &Block) -> bool {
        block.depth >= self.roulette_depth && block.depth < self.max_depth
    }

    /// What picks a lobe and, after that, plays roulette; zeros where neither is asked for.
    #[inline(always)]
    pub(super) fn lobe(&self, block: &Block, s: &Surface, VertexPoint { id, .. }: &VertexPoint) -> [f32; 2] {
        match self.gambles(block) || s.look.picks_lobe {
            true => id.sampler.get_2d(id.index, Dim::at(block.depth, Slot::LobeAndRoulette)),
            false => [0.0; 2],
        }
    }
}

/// The chance of a path to survive: by throughput, in terms of the medium that the path began in: what radiance lost on
/// entering glass it gains again on leaving. Never certain, so that no path of a white scene lives for ever.
#[inline(always)]
pub(super) fn survival(beta: Rgb, eta2: f32) -> f32 {
    (beta * eta2).max_component().min(0.95)
}

/// A direction in which a path may go on.
pub(super) struct Course {
    pub b: BsdfSample,
    /// The direction in render space.
    pub wi: Vec3,
    /// See [`PathState::beta`], before roulette.
    pub beta: Rgb,
    /// See [`PathState::eta2`].
    pub eta2: f32,
}

impl Surface<'_> {
    /// What is scattered, if anything is.
    #[inline(always)]
    pub(super) fn onward(&self, bsdf: [f32; 2], lobe: f32) -> Option<Course> {
        let b = self.material.sample(&self.prepared, self.wo, bsdf, lobe)?;
        let wi = self.v.frame.to_world(b.wi);
        let beta = self.state.beta * b.weight;
        if beta.is_black() || !self.v.is_consistent(wi) {
            return None;
        }
        let eta2 = self.state.eta2 * self.look.transmission.map_or(1.0, |t| t.eta2(self.wo, b.wi));
        Some(Course { b, wi, beta, eta2 })
    }
}

impl Block<'_> {
    /// One light and one point on it, unless nothing can arrive.
    #[inline(always)]
    pub(super) fn sample_light(
        &self,
        at: &Receiver,
        point: &VertexPoint,
    ) -> Option<(ChosenLight, LightSample)> {
        let (lights, id) = (&self.scene.lights, &point.id);
        let chosen = if self.scene.features.many_lights {
            let pick = id.sampler.get_1d(id.index, Dim::at(self.depth, Slot::LightPick));
            lights.sampler.sample(at, pick)?
        } else {
            ChosenLight { light: 0, pmf: 1.0 }
        };
        let sample = lights.list.get(chosen.light as usize)?.sample_li(at, point.light)?;
        Some((chosen, sample))
    }

    /// A point on each light, and a shadow ray to it.
    #[inline(never)]
    fn ask_each(&self, s: &Surface, work: &mut Workspace, paths: &mut PathScratch) {
        let point = paths.points.get(s.number);
        for (number, light) in (0..).zip(&self.scene.lights.list) {
            let u = match number {
                _ if light.is_delta() => [0.0; 2],
                0 => point.light,
                _ => point.id.sampler.get_2d(point.id.index, light_dim(self.depth, number)),
            };
            if let Some(l) = light.sample_li(&s.receiver, u) {
                self.connect(s, ChosenLight { light: number, pmf: 1.0 }, &l, 1.0, work, paths);
            }
        }
    }

    /// A shadow ray to what was sampled of a light, with which so many scattered rays compete. (Always inlined: with two
    /// callers it would be a call in the loop that most renders run.)
    #[inline(always)]
    pub(super) fn connect(
        &self,
        s: &Surface,
        chosen: ChosenLight,
        l: &LightSample,
        scattered: f32,
        work: &mut Workspace,
        paths: &mut PathScratch,
    ) {
        let Some(Weighed { value, .. }) = self.weigh(s, chosen, l, scattered) else { return };
        let id = paths.points.get(s.number).id;
        work.shadow.push(&s.v.spawn_to(l.wi, l.dist, key(&id, self.depth) ^ SHADOW_KEY));
        let ask = l.li.is_none().then_some(chosen.light);
        paths.pending.push(Pending { value, index: s.state.index, ask });
    }

    /// What was sampled of a light counts, if anything of it gets to the viewer.
    #[inline(always)]
    pub(super) fn weigh(
        &self,
        s: &Surface,
        chosen: ChosenLight,
        l: &LightSample,
        scattered: f32,
    ) -> Option<Weighed> {
        if !s.v.is_consistent(l.wi) {
            return None;
        }
        let e = s.material.eval(&s.prepared, s.wo, s.v.frame.to_local(l.wi));
        let value = s.state.beta * e.f_cos * l.li.unwrap_or(Rgb::WHITE);
        if value.is_black() {
            return None;
        }
        let pdf = chosen.pmf * l.pdf;
        let alone = l.delta || scattered == 0.0 || !self.mis;
        let weight = if alone { 1.0 } else { power(pdf, scattered * e.pdf) };
        Some(Weighed { f_cos: e.f_cos, bsdf_pdf: e.pdf, pdf, weight, value: value * (weight / pdf) })
    }
}

#[inline]
pub(super) fn key(id: &PathId, depth: u32) -> u32 {
    ray_key(id.key, id.index, depth)
}
