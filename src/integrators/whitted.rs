//! Classic ray tracing (Whitted, "An Improved Illumination Model for Shaded Display", 1980): at every surface what it
//! shows of itself, the light that comes straight from every light, and the mirror's picture, which is followed.
//! Light between diffuse surfaces is left out; every material and light may take part.

use super::escapes::Escapes;
use super::pending::{Pending, ShadowRays, add_arriving};
use super::{CameraBatch, FirstHit, Integrator, PathId, PathResults, Workspace, light_dim};
use crate::base::hit::HitBatch;
use crate::base::light::{LightSample, PathEnd, Receiver};
use crate::base::material::{Material, Prepared};
use crate::base::ray::{Coherence, Ray, RayBatch};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::vertex::Vertex;
use crate::color::Rgb;
use crate::sampler::{Dim, Slot, ray_key};
use crate::sampling::mis::power;
use crate::scene::Scene;
use glam::Vec3;
use std::sync::Arc;

/// The registry row.
pub const ROW: Row<dyn Integrator> = Row {
    kind: "whitted",
    doc: "classic ray tracing: ambient terms, light straight from every light, mirrors",
    params: &[
        ParamSpec {
            name: "max_depth",
            kind: ParamKind::Integer { min: 1, max: 4096 },
            default: Some("6"),
            doc: "surfaces along a chain of mirrors, the camera's hit counted as 1",
        },
        ParamSpec {
            name: "sky_light",
            kind: ParamKind::Number { min: 0.0, max: 1e12 },
            default: Some("1"),
            doc: "factor on the light that lights at infinity bring to surfaces; what is seen of them stays as it is",
        },
    ],
    build: |p| {
        Ok(Arc::new(Whitted {
            max_depth: p.number_or("max_depth", 6.0)? as u32,
            sky_light: p.number_or("sky_light", 1.0)? as f32,
        }))
    },
    samples: || vec![Params::new(), Params::new().with("sky_light", Value::Number(0.5))],
};

struct Whitted {
    max_depth: u32,
    sky_light: f32,
}

/// A chain of mirrors on its way.
#[derive(Clone, Copy)]
struct Chain {
    /// What arrives is multiplied by it.
    beta: Rgb,
    /// Index into the block.
    index: u32,
}

/// A ray that the material drew, which may find a light with an extent: the other half of what light samples bring.
struct Scattered {
    /// What the radiance found is multiplied by.
    value: Rgb,
    /// Density of its direction.
    pdf: f32,
    from: Receiver,
    index: u32,
}

/// What a depth leaves for later.
#[derive(Default)]
struct Later {
    next: Vec<Chain>,
    pending: Vec<Pending>,
    scattered: Vec<Scattered>,
    scattered_rays: RayBatch,
}

impl Later {
    fn clear(&mut self) {
        self.next.clear();
        self.pending.clear();
        self.scattered.clear();
        self.scattered_rays.clear();
    }
}

/// A surface being shaded.
struct Spot<'a> {
    v: Vertex,
    chain: Chain,
    id: PathId,
    depth: u32,
    material: &'a dyn Material,
    prepared: Prepared,
    wo: Vec3,
}

impl Integrator for Whitted {
    fn trace(&self, scene: &Scene, batch: &CameraBatch, work: &mut Workspace, out: &mut PathResults) {
        out.reset(batch.rays.len(), batch.want_first);
        let mut rays = std::mem::take(&mut work.rays);
        let mut chains: Vec<Chain> =
            (0..batch.rays.len() as u32).map(|index| Chain { beta: Rgb::WHITE, index }).collect();
        let mut later = Later::default();
        let (mut escapes, mut arrivals) = (Escapes::default(), Escapes::default());
        work.counts.camera += batch.rays.len() as u64;
        let mut depth = 1;
        while !chains.is_empty() {
            let (traced, spread, coherence) = match depth {
                1 => (&batch.rays, batch.spread, Coherence::Coherent),
                _ => (&rays, 0.0, Coherence::Incoherent),
            };
            scene.kernel.intersect_batch(traced, &mut work.hits, coherence);
            later.clear();
            work.next.clear();
            work.shadow.clear();
            escapes.clear();
            let hits = std::mem::take(&mut work.hits);
            for (i, chain) in chains.iter().enumerate() {
                let Some(v) = vertex(scene, traced, &hits, i, spread) else {
                    escapes.push(i as u32, traced.direction(i));
                    continue;
                };
                if depth == 1 {
                    out.alpha[i] = 1.0;
                    if batch.want_first {
                        out.first[i] = Some(FirstHit::new(scene, v));
                    }
                }
                let spot = Spot::new(scene, v, *chain, batch.ids.get(chain.index as usize), depth);
                out.li[chain.index as usize] += chain.beta * spot.own_light(scene);
                self.ask_lights(scene, &spot, &mut work.shadow, &mut later);
                if work.shadow.len() >= MOST_SHADOW_RAYS {
                    resolve_shadows(scene, work, &mut later.pending, &mut arrivals, out);
                }
                if depth < self.max_depth {
                    spot.reflect(&mut work.next, &mut later.next);
                }
            }
            work.hits = hits;
            if depth == 1 {
                escapes.add_background(scene, &mut out.li);
            } else {
                add_escapes(scene, &chains, &mut escapes, out);
            }
            resolve_shadows(scene, work, &mut later.pending, &mut arrivals, out);
            self.resolve_scattered(scene, work, &mut escapes, &later, out);
            std::mem::swap(&mut chains, &mut later.next);
            std::mem::swap(&mut rays, &mut work.next);
            work.counts.scattered += chains.len() as u64;
            depth += 1;
        }
        work.rays = rays;
    }

    fn describe(&self) -> String {
        format!("classic ray tracing, depth {}", self.max_depth)
    }
}

fn vertex(scene: &Scene, rays: &RayBatch, hits: &HitBatch, i: usize, spread: f32) -> Option<Vertex> {
    hits.get(i).map(|hit| scene.vertex(&rays.get(i), hit, spread))
}

/// Shadow rays that wait at a time, and those of one more surface: a scene of a million lamps must not fill the memory.
const MOST_SHADOW_RAYS: usize = 1 << 16;

/// Traces the shadow rays that wait and adds what arrives. A surface's rays are always together, so that sums do not
/// depend on where the others' end.
fn resolve_shadows(
    scene: &Scene,
    work: &mut Workspace,
    pending: &mut Vec<Pending>,
    arrivals: &mut Escapes,
    out: &mut PathResults,
) {
    work.counts.shadow += work.shadow.len() as u64;
    scene.kernel.occluded_batch(&work.shadow, &mut work.blocked, Coherence::Incoherent);
    let shadow = ShadowRays { rays: &work.shadow, blocked: &work.blocked };
    add_arriving(scene, pending, shadow, arrivals, &mut out.li);
    work.shadow.clear();
    pending.clear();
}

/// Mirrors show the lights at infinity as they are.
fn add_escapes(scene: &Scene, chains: &[Chain], escapes: &mut Escapes, out: &mut PathResults) {
    for &light in &scene.lights.at_infinity {
        for e in escapes.ask(&*scene.lights.list[light as usize]) {
            let chain = &chains[e.number as usize];
            out.li[chain.index as usize] += chain.beta * e.le;
        }
    }
}

impl<'a> Spot<'a> {
    fn new(scene: &'a Scene, v: Vertex, chain: Chain, id: PathId, depth: u32) -> Self {
        let material = scene.material(&v);
        let mut prepared = Prepared::default();
        material.prepare(&v, &mut prepared);
        let wo = v.frame.to_local(v.wo);
        Spot { v, chain, id, depth, material, prepared, wo }
    }

    /// What the surface shows of itself.
    fn own_light(&self, scene: &Scene) -> Rgb {
        let ambient = self.material.ambient(&self.prepared);
        match scene.lights.of_vertex(&self.v) {
            Some(light) => {
                let end = PathEnd { wi: -self.v.wo, vertex: Some(&self.v) };
                ambient + scene.lights.list[light as usize].le(&end)
            }
            None => ambient,
        }
    }

    /// The point as lights see it.
    fn receiver(&self) -> Receiver {
        match self.material.transmission() {
            None => self.v.receiver(),
            Some(_) => self.v.receiver_all_round(),
        }
    }

    fn key(&self, light: u32) -> u32 {
        ray_key(self.id.key ^ light.wrapping_mul(0x9e37_79b9), self.id.index, self.depth)
    }

    fn light_point(&self, number: u32) -> [f32; 2] {
        self.id.sampler.get_2d(self.id.index, light_dim(self.depth, number))
    }

    /// A shadow ray to what was sampled of a light, and what it would bring; None if that is nothing.
    fn connect(&self, l: &LightSample, light: u32) -> Option<(Ray, Rgb)> {
        let wi = self.v.frame.to_local(l.wi);
        if !self.v.is_consistent(l.wi) {
            return None;
        }
        let e = self.material.eval(&self.prepared, self.wo, wi);
        let weight = if l.delta { 1.0 } else { power(l.pdf, e.pdf) };
        let value = self.chain.beta * e.f_cos * (l.li.unwrap_or(Rgb::WHITE) * (weight / l.pdf));
        (!value.is_black()).then(|| (self.v.spawn_to(l.wi, l.dist, self.key(light)), value))
    }

    /// A direction of the material's choice, in which a light may lie.
    fn scatter(&self, later: &mut Later) {
        let point = self.id.sampler.get_2d(self.id.index, Dim::at(self.depth, Slot::BsdfUv));
        let lobe = self.id.sampler.get_2d(self.id.index, Dim::at(self.depth, Slot::LobeAndRoulette));
        let Some(s) = self.material.sample(&self.prepared, self.wo, point, lobe[0]) else { return };
        let wi = self.v.frame.to_world(s.wi);
        let value = self.chain.beta * s.weight;
        if !value.is_black() && self.v.is_consistent(wi) {
            later.scattered_rays.push(&self.v.spawn(wi, self.key(u32::MAX)));
            let (from, index) = (self.receiver(), self.chain.index);
            later.scattered.push(Scattered { value, pdf: s.pdf, from, index });
        }
    }

    /// The mirror direction, or what a perfectly smooth material makes of it.
    fn reflect(&self, rays: &mut RayBatch, chains: &mut Vec<Chain>) {
        let (wi, weight) = if self.material.is_delta() {
            let lobe = self.id.sampler.get_2d(self.id.index, Dim::at(self.depth, Slot::LobeAndRoulette));
            let point = self.id.sampler.get_2d(self.id.index, Dim::at(self.depth, Slot::BsdfUv));
            match self.material.sample(&self.prepared, self.wo, point, lobe[0]) {
                Some(s) => (s.wi, s.weight),
                None => return,
            }
        } else {
            let mirrored = self.material.mirrored(&self.prepared, self.wo);
            (Vec3::new(-self.wo.x, -self.wo.y, self.wo.z), mirrored)
        };
        let (beta, wi) = (self.chain.beta * weight, self.v.frame.to_world(wi));
        if !beta.is_black() && self.v.is_consistent(wi) {
            rays.push(&self.v.spawn(wi, ray_key(self.id.key, self.id.index, self.depth + 1)));
            chains.push(Chain { beta, index: self.chain.index });
        }
    }
}

impl Whitted {
    /// One shadow ray to every light; and one ray drawn by the material, if lights have an extent.
    fn ask_lights(&self, scene: &Scene, spot: &Spot, shadow: &mut RayBatch, later: &mut Later) {
        if spot.material.is_delta() || spot.material.is_black() {
            return;
        }
        let receiver = spot.receiver();
        for (number, light) in (0..).zip(&scene.lights.list) {
            let point = if light.is_delta() { [0.0; 2] } else { spot.light_point(number) };
            let Some(l) = light.sample_li(&receiver, point) else { continue };
            let Some((ray, mut value)) = spot.connect(&l, number) else { continue };
            if light.at_infinity() {
                value = value * self.sky_light;
            }
            shadow.push(&ray);
            let ask = l.li.is_none().then_some(number);
            later.pending.push(Pending { value, index: spot.chain.index, ask });
        }
        if scene.features.emitting_surfaces || !scene.lights.at_infinity.is_empty() {
            spot.scatter(later);
        }
    }

    /// What the materials' own rays found.
    fn resolve_scattered(
        &self,
        scene: &Scene,
        work: &mut Workspace,
        escapes: &mut Escapes,
        later: &Later,
        out: &mut PathResults,
    ) {
        let rays = &later.scattered_rays;
        work.counts.scattered += rays.len() as u64;
        scene.kernel.intersect_batch(rays, &mut work.hits, Coherence::Incoherent);
        escapes.clear();
        for (i, s) in (0..).zip(&later.scattered) {
            let Some(v) = vertex(scene, rays, &work.hits, i as usize, 0.0) else {
                escapes.push(i, rays.direction(i as usize));
                continue;
            };
            if let Some(light) = scene.lights.of_vertex(&v) {
                let end = PathEnd { wi: rays.direction(i as usize), vertex: Some(&v) };
                let light = &scene.lights.list[light as usize];
                let weight = power(s.pdf, light.pdf_li(&s.from, &end));
                out.li[s.index as usize] += s.value * light.le(&end) * weight;
            }
        }
        for &light in &scene.lights.at_infinity {
            let light = &*scene.lights.list[light as usize];
            for e in escapes.ask(light) {
                let s = &later.scattered[e.number as usize];
                let weight = power(s.pdf, light.pdf_li(&s.from, &PathEnd { wi: e.wi, vertex: None }));
                out.li[s.index as usize] += s.value * e.le * (weight * self.sky_light);
            }
        }
    }
}
