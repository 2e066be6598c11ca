//! [`Integrator::tell`](super::Integrator::tell) of the path tracer. One path goes through the stages that all paths go
//! through, and what they put out is told; what they keep to themselves (densities, weights, what was rejected) is asked
//! again of the same functions, and held against what came out. So telling costs renders nothing.

use super::depth::Block;
use super::path::{PathScratch, PathState, PathTracer};
use super::pending::Pending;
use super::points::VertexPoint;
use super::several::draw;
use super::story::{End, Fate, Leg, Lit, Met, Onward, Scattered, Stop, Story};
use super::surface::{Course, Surface, key, survival};
use super::together::{Found, Together};
use super::{CameraBatch, PathId, PathResults, Workspace, light_dim};
use crate::base::directions::LANES;
use crate::base::hit::Hit;
use crate::base::light::{ChosenLight, LightSample, PathEnd};
use crate::base::ray::{Coherence, RayBatch};
use crate::color::Rgb;
use crate::sampler::{Dim, SHADOW_KEY, Slot};
use crate::scene::desc::Background;
use crate::scene::{Meetings, Scene};

/// The story so far.
struct Telling<'a> {
    scene: &'a Scene,
    story: Story,
    /// What the stages add to.
    out: PathResults,
    /// Legs of the present depth, by ray.
    legs: Vec<usize>,
    /// From which legs those of the next depth start.
    starts: Vec<usize>,
    /// The leg whose end asked lights, and the shadow ray of each light sample.
    asked: (usize, Vec<Option<usize>>),
}

impl PathTracer {
    /// See the module; of the first ray of the batch.
    pub(super) fn tell_path(&self, scene: &Scene, batch: &CameraBatch, work: &mut Workspace) -> Story {
        let mut paths = std::mem::take(&mut work.paths);
        let mut rays = RayBatch::default();
        rays.push(&batch.rays.get(0));
        let mut told = Telling {
            scene,
            story: Story { faithful: true, ..Story::default() },
            out: PathResults::default(),
            legs: Vec::new(),
            starts: Vec::new(),
            asked: (0, Vec::new()),
        };
        told.out.reset(1, false);
        paths.states.clear();
        paths.states.push(PathState::from_camera(0));
        let mut depth = 1;
        loop {
            let block = self.block(scene, batch, depth);
            told.set_out(&block, &rays, &paths);
            if depth > self.max_depth && !scene.features.emitting_surfaces {
                block.leave_or_end(&rays, work, &mut paths, &mut told.out);
                told.leave_or_end(&block, &work.blocked, &paths);
                break;
            }
            let spread = if depth == 1 { batch.spread } else { 0.0 };
            self.tell_depth(&block, (&rays, spread), work, &mut paths, &mut told);
            if paths.next.is_empty() {
                break;
            }
            std::mem::swap(&mut paths.states, &mut paths.next);
            std::mem::swap(&mut rays, &mut work.next);
            depth += 1;
        }
        work.paths = paths;
        told.story.faithful &= same(told.story.radiance, told.out.li[0]);
        told.story
    }

    /// As the stages of [`super::Integrator::trace`] for one depth.
    fn tell_depth(
        &self,
        block: &Block,
        (rays, spread): (&RayBatch, f32),
        work: &mut Workspace,
        paths: &mut PathScratch,
        told: &mut Telling,
    ) {
        let scene = block.scene;
        let coherence = if block.depth == 1 { Coherence::Coherent } else { Coherence::Incoherent };
        scene.kernel.intersect_batch(rays, &mut work.hits, coherence);
        paths.begin(&mut work.next, &mut work.shadow);
        paths.sort_out(&work.hits, rays);
        if block.depth == 1 {
            paths.escapes.add_background(scene, &mut told.out.li);
        } else {
            block.add_escapes(paths, &mut told.out);
        }
        told.escapes(block, |i| work.hits.get(i).is_none(), paths);
        let goes_on = block.depth <= self.max_depth;
        if goes_on {
            paths.draw(block, |states, i| states[i as usize].index);
        }
        let hits = work.hits.clone();
        let mut some = Together::new(block, goes_on);
        loop {
            let met = Meetings { rays, hits: &hits, spread };
            let state = |i: u32| paths.states[i as usize];
            let Some(Found { surfaces, .. }) = some.next(&met, &paths.hits, state) else { break };
            for s in surfaces.iter() {
                block.add_emission(&s.state, &s.v, -s.v.wo, &mut told.out);
                let ray = paths.hits[s.number] as usize;
                let stop = told.stop(block, s, (ray, goes_on));
                told.story.legs[told.legs[ray]].end = End::Surface(Box::new(stop));
            }
            if goes_on {
                // A path that goes on is alone.
                self.scatter(block, Found { surfaces: &mut *surfaces, alike: None }, work, paths);
                if let Some(s) = surfaces.first() {
                    let leg = told.legs[paths.hits[s.number] as usize];
                    told.lights(self.lit(block, s, paths), leg, work, paths);
                    told.onward(self.onward(block, s, paths), leg, paths);
                }
            }
        }
        let (pending, shadow) = (paths.pending.clone(), work.shadow.clone());
        block.resolve_shadows(work, paths, &mut told.out);
        let blocked = if pending.is_empty() { &[][..] } else { &work.blocked[..] };
        told.arrive(&pending, &shadow, blocked);
    }

    /// The light samples of a surface, each with the scattered rays that compete with it.
    fn asked(
        &self,
        block: &Block,
        s: &Surface,
        paths: &PathScratch,
    ) -> Vec<(ChosenLight, Option<LightSample>, u32)> {
        let point = paths.points.get(s.number);
        let lights = &block.scene.lights;
        let of_each = |sample: &dyn Fn(u32, [f32; 2]) -> (Option<LightSample>, u32)| {
            let each = (0..).zip(&lights.list).map(|(number, light)| {
                let u = match number {
                    _ if light.is_delta() => [0.0; 2],
                    0 => point.light,
                    _ => point.id.sampler.get_2d(point.id.index, light_dim(block.depth, number)),
                };
                let (l, rivals) = sample(number, u);
                (ChosenLight { light: number, pmf: 1.0 }, l, rivals)
            });
            each.collect()
        };
        let one = |found: Option<(ChosenLight, LightSample)>, rivals: &dyn Fn(u32) -> u32| {
            found.map(|(chosen, l)| (chosen, Some(l), rivals(chosen.light))).into_iter().collect()
        };
        if !block.samples_lights || s.look.is_delta {
            return Vec::new();
        }
        let Some(guided) = block.guided else {
            return match block.each_light {
                true => of_each(&|number, u| (lights.list[number as usize].sample_li(&s.receiver, u), 1)),
                false => one(block.sample_light(&s.receiver, &point), &|_| 1),
            };
        };
        let how = block.how(guided, s);
        let rivals = |light: u32| if light == guided.0 { how.scattered } else { how.scattered.max(1) };
        match how.lit {
            0 => Vec::new(),
            1 if block.each_light && lights.list.len() > 1 => {
                of_each(&|number, u| (block.sample(s, guided, &how, number, u), rivals(number)))
            }
            1 => one(block.sample_one(s, guided, &how, &point), &rivals),
            n => {
                let points = draw(&times(&point.id, n), Dim::at(block.depth, Slot::LightUv));
                let chosen = ChosenLight { light: guided.0, pmf: n as f32 };
                let sample = |k: usize| block.sample(s, guided, &how, guided.0, points.map(|c| c[k]));
                (0..n as usize).map(|k| (chosen, sample(k), how.scattered)).collect()
            }
        }
    }

    fn lit(&self, block: &Block, s: &Surface, paths: &PathScratch) -> Vec<Lit> {
        let id = paths.points.get(s.number).id;
        let tell = |(chosen, sample, rivals): (ChosenLight, Option<LightSample>, u32)| {
            let weighed = sample.and_then(|l| block.weigh(s, chosen, &l, rivals as f32));
            let ray = sample
                .zip(weighed)
                .map(|(l, _)| s.v.spawn_to(l.wi, l.dist, key(&id, block.depth) ^ SHADOW_KEY));
            let (li, value) = (Rgb::BLACK, Rgb::BLACK);
            Lit { chosen, sample, weighed, rivals: rivals as f32, ray, blocked: false, li, value }
        };
        self.asked(block, s, paths).into_iter().map(tell).collect()
    }

    /// The directions in which the path was to go on, with what it then counts for.
    fn onward(&self, block: &Block, s: &Surface, paths: &PathScratch) -> Vec<(Onward, Rgb)> {
        let point = paths.points.get(s.number);
        let how = block.guided.map(|guided| block.how(guided, s)).unwrap_or_default();
        if block.guided.is_some() && how.ends(block) {
            return vec![(Onward { scattered: None, roulette: None, fate: Fate::LitAlone }, Rgb::BLACK)];
        }
        if how.scattered <= 1 {
            return vec![self.alone(block, s, &point)];
        }
        let n = how.scattered;
        let id = times(&point.id, n);
        let u = draw(&id, Dim::at(block.depth, Slot::BsdfUv));
        let lobes = match s.look.picks_lobe {
            true => draw(&id, Dim::at(block.depth, Slot::LobeAndRoulette))[0],
            false => [0.0; LANES],
        };
        let one = |k: usize| {
            let b = s.material.sample(&s.prepared, s.wo, [u[0][k], u[1][k]], lobes[k]);
            let beta = b.map_or(Rgb::BLACK, |b| s.state.beta * b.weight * (1.0 / n as f32));
            let scattered = b.map(|b| {
                let wi = s.v.frame.to_world(b.wi);
                Scattered { wi, weight: b.weight, pdf: b.pdf, delta: b.delta }
            });
            let goes = scattered.is_some_and(|b| !beta.is_black() && s.v.is_consistent(b.wi));
            let fate = if goes { Fate::Leg(0) } else { Fate::Absorbed };
            (Onward { scattered, roulette: None, fate }, beta)
        };
        (0..n as usize).map(one).collect()
    }

    /// See [`PathTracer::extend`].
    fn alone(&self, block: &Block, s: &Surface, point: &VertexPoint) -> (Onward, Rgb) {
        let lobe = self.lobe(block, s, point);
        let Some(Course { b, wi, beta, eta2 }) = s.onward(point.bsdf, lobe[0]) else {
            return (Onward { scattered: None, roulette: None, fate: Fate::Absorbed }, Rgb::BLACK);
        };
        let scattered = Some(Scattered { wi, weight: b.weight, pdf: b.pdf, delta: b.delta });
        let roulette = self.gambles(block).then(|| [survival(beta, eta2), lobe[1]]);
        match roulette {
            Some([q, u]) if u >= q => (Onward { scattered, roulette, fate: Fate::Roulette }, Rgb::BLACK),
            _ => {
                let beta = roulette.map_or(beta, |[q, _]| beta / q);
                (Onward { scattered, roulette, fate: Fate::Leg(0) }, beta)
            }
        }
    }
}

/// Whose points follow one another.
fn times(id: &PathId, n: u32) -> PathId {
    PathId { sampler: id.sampler.times(n), index: id.index.wrapping_mul(n), ..*id }
}

/// Bit for bit, but for the sign of zero.
fn same(a: Rgb, b: Rgb) -> bool {
    a.to_array().iter().zip(b.to_array()).all(|(a, b)| a.to_bits() == b.to_bits() || *a == b)
}

impl Telling<'_> {
    fn add(&mut self, value: Rgb) {
        self.story.radiance += value;
    }

    /// The rays of a depth.
    fn set_out(&mut self, block: &Block, rays: &RayBatch, paths: &PathScratch) {
        self.legs.clear();
        for (i, state) in paths.states.iter().enumerate().take(rays.len()) {
            self.legs.push(self.story.legs.len());
            let from = if block.depth == 1 { None } else { self.starts.get(i).copied() };
            let (ray, beta, pdf) = (rays.get(i), state.beta, state.pdf);
            let leg = Leg { depth: block.depth, from, ray, beta, pdf, end: End::Escape, met: Vec::new() };
            self.story.legs.push(leg);
        }
        self.starts.clear();
    }

    /// See [`Block::leave_or_end`].
    fn leave_or_end(&mut self, block: &Block, blocked: &[bool], paths: &PathScratch) {
        for (leg, _) in self.legs.iter().zip(blocked).filter(|(_, blocked)| **blocked) {
            self.story.legs[*leg].end = End::Blocked;
        }
        self.escapes(block, |i| !blocked[i], paths);
    }

    /// What lights at infinity show to the rays that leave.
    fn escapes(&mut self, block: &Block, leaves: impl Fn(usize) -> bool, paths: &PathScratch) {
        let lights = &self.scene.lights;
        let seen = match (block.depth, self.scene.background) {
            (1, Background::Transparent) => return,
            (1, Background::Color(c)) => {
                if leaves(0) {
                    let value = Rgb::from(c);
                    let met = Met { light: None, le: value, pdf: 0.0, weight: 1.0, value };
                    self.story.legs[self.legs[0]].met.push(met);
                    self.add(value);
                }
                return;
            }
            _ => &lights.at_infinity,
        };
        for &light in seen {
            for i in (0..self.legs.len()).filter(|&i| leaves(i)) {
                let end = PathEnd { wi: self.story.legs[self.legs[i]].ray.d, vertex: None };
                self.meet(block, &paths.states[i], light, &end, i);
            }
        }
    }

    /// A light at a path's end.
    fn meet(&mut self, block: &Block, state: &PathState, light: u32, end: &PathEnd, ray: usize) {
        let le = self.scene.lights.list[light as usize].le(end);
        if le.is_black() {
            return;
        }
        let competes = state.pdf.is_finite();
        let pdf = match block.guided {
            _ if !competes => 0.0,
            Some((index, guided)) if index == light && end.vertex.is_none() => {
                state.rivals.pdf(guided, &state.from, end.wi)
            }
            _ => block.light_pdf(light, end, &state.from),
        };
        let weight = if competes { block.weight(state, pdf) } else { 1.0 };
        let value = state.beta * le * weight;
        self.story.legs[self.legs[ray]].met.push(Met { light: Some(light), le, pdf, weight, value });
        self.add(value);
    }

    /// A surface, with the lamp that it is.
    fn stop(&mut self, block: &Block, s: &Surface, (ray, goes_on): (usize, bool)) -> Stop {
        if self.scene.features.emitting_surfaces
            && let Some(light) = self.scene.lights.of_vertex(&s.v)
        {
            self.meet(block, &s.state, light, &PathEnd { wi: -s.v.wo, vertex: Some(&s.v) }, ray);
        }
        let hit = Hit { t: s.v.t, prim: s.v.prim, path: s.v.path };
        let goes_on = goes_on && !s.material.is_black();
        Stop { hit, vertex: s.v, goes_on, lit: Vec::new(), onward: Vec::new() }
    }

    fn at(&mut self, leg: usize) -> Option<&mut Stop> {
        match &mut self.story.legs[leg].end {
            End::Surface(stop) => Some(stop),
            End::Escape | End::Blocked => None,
        }
    }

    /// Holds light samples against the shadow rays that the stages put out.
    fn lights(&mut self, lit: Vec<Lit>, leg: usize, work: &Workspace, paths: &PathScratch) {
        let mut free: Vec<usize> = (0..paths.pending.len()).collect();
        // Not by order: rays that leave to the other side may follow the others.
        let of = lit.iter().map(|l| {
            let (ray, w) = l.ray.zip(l.weighed)?;
            let is_it = |i: &usize| work.shadow.get(*i) == ray && same(paths.pending[*i].value, w.value);
            let place = free.iter().position(is_it)?;
            Some(free.remove(place))
        });
        let of: Vec<Option<usize>> = of.collect();
        self.story.faithful &=
            free.is_empty() && lit.iter().zip(&of).all(|(l, i)| l.ray.is_some() == i.is_some());
        self.asked = (leg, of);
        if let Some(stop) = self.at(leg) {
            stop.lit = lit;
        }
    }

    /// Holds directions against the rays that go on.
    fn onward(&mut self, onward: Vec<(Onward, Rgb)>, leg: usize, paths: &PathScratch) {
        let first = self.story.legs.len();
        let mut list = Vec::new();
        for (mut on, beta) in onward {
            if on.fate == Fate::Leg(0) {
                let n = self.starts.len();
                self.story.faithful &= paths.next.get(n).is_some_and(|next| same(next.beta, beta));
                on.fate = Fate::Leg(first + n);
                self.starts.push(leg);
            }
            list.push(on);
        }
        self.story.faithful &= self.starts.len() == paths.next.len();
        if let Some(stop) = self.at(leg) {
            stop.onward = list;
        }
    }

    /// What shadow rays let through, in the order of [`super::pending::add_arriving`].
    fn arrive(&mut self, pending: &[Pending], shadow: &RayBatch, blocked: &[bool]) {
        let open =
            |asks: Option<u32>| (0..pending.len()).filter(move |&i| pending[i].ask == asks && !blocked[i]);
        let lights = &self.scene.lights;
        let mut arrived: Vec<(usize, Rgb, Rgb)> = Vec::new();
        for i in open(None) {
            arrived.push((i, Rgb::WHITE, pending[i].value));
        }
        for &light in &lights.at_infinity {
            for i in open(Some(light)) {
                let le = lights.list[light as usize].le(&PathEnd { wi: shadow.direction(i), vertex: None });
                arrived.push((i, le, pending[i].value * le));
            }
        }
        arrived.iter().for_each(|a| self.add(a.2));
        // Shadow rays of one depth leave from one surface.
        let (leg, of) = std::mem::take(&mut self.asked);
        let Some(stop) = self.at(leg) else { return };
        for (l, i) in stop.lit.iter_mut().zip(of).filter_map(|(l, i)| Some((l, i?))) {
            l.blocked = blocked[i];
            l.li = l.sample.and_then(|s| s.li).unwrap_or_default();
            if let Some((_, le, value)) = arrived.iter().find(|a| a.0 == i) {
                l.li = l.sample.and_then(|s| s.li).unwrap_or(*le);
                l.value = *value;
            }
        }
    }
}
