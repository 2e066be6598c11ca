//! The rays: made once, from a fixed seed, the same for every kernel.

use crate::accel;
use crate::base::geometry::Geometry;
use crate::base::hit::{Hit, HitBatch};
use crate::base::intersectable::QueryKind;
use crate::base::ray::{Coherence, Ray, RayBatch};
use crate::base::vertex::Vertex;
use crate::error::{Error, Result};
use crate::integrators::{CameraBatch, Integrator, PathResults, Workspace};
use crate::math::aabb::Aabb;
use crate::math::frame::Frame;
use crate::render::block::{Job, Worker};
use crate::render::dealing::Dealing;
use crate::render::film::Film;
use crate::render::settings::RenderSettings;
use crate::sampler::{Dim, Sampler, ray_key};
use crate::sampling::warp::cosine_hemisphere;
use crate::scene::Scene;
use glam::{Vec2, Vec3};
use rayon::prelude::*;
use std::sync::Mutex;

/// Rays in a batch, as a renderer's blocks have them.
pub const BATCH: usize = 2048;

/// Of every random choice.
pub const SEED: u64 = 20_260_101;

/// Samples a pixel that camera rays have, so that a batch is a tile of 16 x 16 pixels.
const SPP: u32 = 8;

/// Tiles that camera rays come from at least, where the picture has as many.
const TILES: usize = 64;

/// Where rays come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RayKind {
    /// As the renderer makes them for the scene's view: tile by tile, neighbours together.
    Camera,
    /// From the points that the camera sees, by the cosine law about the geometric normal.
    Bounce,
    /// From the points that the camera sees to where the sky's sampling points.
    Shadow,
    /// Between two random points of the bounds, enlarged by a twentieth, and on without end.
    Chord,
    /// From the points that the camera sees, up to one degree above the tangent plane.
    Grazing,
}

/// A set of rays that is asked in one way.
pub struct Workload {
    /// Its name in tables and records.
    pub name: &'static str,
    /// One line for people.
    pub doc: &'static str,
    /// Which rays.
    pub kind: RayKind,
    /// What they are asked.
    pub query: QueryKind,
    /// What is known of them.
    pub coherence: Coherence,
}

/// All workloads, in the order of the tables.
pub const WORKLOADS: &[Workload] = &[
    Workload {
        name: "camera",
        doc: "camera rays in the renderer's order, closest hit",
        kind: RayKind::Camera,
        query: QueryKind::Closest,
        coherence: Coherence::Coherent,
    },
    Workload {
        name: "bounce",
        doc: "cosine-distributed rays from what the camera sees, closest hit",
        kind: RayKind::Bounce,
        query: QueryKind::Closest,
        coherence: Coherence::Incoherent,
    },
    Workload {
        name: "bounce any",
        doc: "the same rays, any hit",
        kind: RayKind::Bounce,
        query: QueryKind::Any,
        coherence: Coherence::Incoherent,
    },
    Workload {
        name: "shadow",
        doc: "rays from what the camera sees to directions sampled from the sky, any hit",
        kind: RayKind::Shadow,
        query: QueryKind::Any,
        coherence: Coherence::Incoherent,
    },
    Workload {
        name: "chords",
        doc: "rays from one random point of the bounds towards another, closest hit",
        kind: RayKind::Chord,
        query: QueryKind::Closest,
        coherence: Coherence::Incoherent,
    },
    Workload {
        name: "grazing",
        doc: "rays that leave what the camera sees at 0 to 1 degree above the surface, closest hit",
        kind: RayKind::Grazing,
        query: QueryKind::Closest,
        coherence: Coherence::Incoherent,
    },
];

impl RayKind {
    /// All of them, as files number them.
    pub const ALL: [RayKind; 5] =
        [RayKind::Camera, RayKind::Bounce, RayKind::Shadow, RayKind::Chord, RayKind::Grazing];

    /// Its name in messages.
    pub fn name(self) -> &'static str {
        match self {
            RayKind::Camera => "camera",
            RayKind::Bounce => "bounce",
            RayKind::Shadow => "shadow",
            RayKind::Chord => "chords",
            RayKind::Grazing => "grazing",
        }
    }
}

/// For which scene rays were made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneKey {
    /// Triangles, each instanced mesh once.
    pub triangles: u64,
    /// Other primitives.
    pub procedurals: u64,
    /// Of everything, in render space.
    pub bounds: Aabb,
}

impl SceneKey {
    /// Of a scene.
    pub fn of(scene: &Scene) -> Self {
        let report = &scene.report;
        let bounds = scene.geometry.root().bounds;
        SceneKey { triangles: report.triangles, procedurals: report.procedurals, bounds }
    }
}

/// The rays of all kinds, in batches.
#[derive(Debug, Clone)]
pub struct RaySets {
    /// For which scene.
    pub scene: SceneKey,
    /// By number of [`RayKind::ALL`]. A set may be empty: no surface is seen, or no light comes from the sky.
    pub sets: [Vec<RayBatch>; 5],
}

impl RaySets {
    /// Those of one kind.
    pub fn of(&self, kind: RayKind) -> &[RayBatch] {
        &self.sets[kind as usize]
    }

    /// About `count` rays of each kind, the same for the same scene and count.
    ///
    /// # Errors
    /// A failure of the scene's kernel, by which the points that rays leave from are found.
    pub fn generate(scene: &Scene, count: usize) -> Result<RaySets> {
        let camera = camera_rays(scene, count);
        let chords = from_candidates(count, |i| Some(chord(&scene.geometry.root().bounds, i)));
        let mut points = Points::new(scene, &camera);
        if points.is_empty() {
            points = Points::new(scene, &chords);
        }
        scene.kernel.take_failure()?;
        let each = |f: fn(&Vertex, &Scene, u32) -> Option<Ray>| match points.is_empty() {
            true => Vec::new(),
            false => from_candidates(count, |i| f(&points.vertex(i), scene, i as u32)),
        };
        let sets = [camera, each(bounce), each(shadow), chords, each(grazing)];
        Ok(RaySets { scene: SceneKey::of(scene), sets })
    }

    /// A number that other rays do not have, for records.
    pub fn digest(&self) -> u64 {
        let mut sum = 0xcbf2_9ce4_8422_2325_u64;
        let mut add = |word: u32| sum = (sum ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3);
        for batch in self.sets.iter().flatten() {
            for r in (0..batch.len()).map(|i| batch.get(i)) {
                let [o, d] = [r.o, r.d].map(|v| v.to_array().map(f32::to_bits));
                o.into_iter().chain(d).chain([r.tnear.to_bits(), r.tfar.to_bits(), r.key]).for_each(&mut add);
            }
        }
        sum
    }
}

/// The number of rays of some batches.
pub fn count(batches: &[RayBatch]) -> usize {
    batches.iter().map(RayBatch::len).sum()
}

/// An integrator that keeps the camera rays that it is given.
struct Keep(Mutex<Vec<RayBatch>>);

impl Integrator for Keep {
    fn trace(&self, _: &Scene, batch: &CameraBatch, _: &mut Workspace, out: &mut PathResults) {
        out.reset(batch.rays.len(), false);
        self.0.lock().unwrap_or_else(|e| e.into_inner()).push(batch.rays.clone());
    }

    fn describe(&self) -> String {
        "keeps camera rays".into()
    }
}

/// The rays of tiles that are spread evenly over the picture, as [`crate::render`] makes them.
pub(super) fn camera_rays(scene: &Scene, count: usize) -> Vec<RayBatch> {
    let size = [scene.film.width, scene.film.height];
    let pixels = size[0] as usize * size[1] as usize;
    // A small picture has more samples a pixel instead.
    let spp = count.div_ceil(pixels).next_multiple_of(2).max(SPP as usize) as u32;
    let settings =
        RenderSettings { spp, threads: 1, seed: SEED, dealing: Dealing::Even, ..RenderSettings::new(size) };
    let tiles: Vec<_> = Film::new(size[0], size[1], settings.crop).tiles().collect();
    let of_whole_tiles = count.div_ceil(16 * 16 * spp as usize);
    // Few rays are parts of more tiles: a handful of whole ones could all miss.
    let wanted = of_whole_tiles.max(TILES).min(tiles.len());
    let most = if of_whole_tiles < wanted { count.div_ceil(wanted) } else { usize::MAX };
    let chosen: Vec<_> = spread(tiles.len(), wanted).into_iter().map(|i| tiles[i]).collect();
    let of_tile = |rect| {
        let keep = Keep(Mutex::default());
        let job = Job::new(scene, &keep, &settings);
        Worker::new(&settings).render_tile(&job, rect, 0..spp);
        keep.0.into_inner().unwrap_or_else(|e| e.into_inner())
    };
    let made: Vec<Vec<RayBatch>> = chosen.into_par_iter().map(of_tile).collect();
    let mut out: Vec<RayBatch> = Vec::new();
    let mut left = count;
    for tile in made {
        let mut room = most.min(left);
        for mut batch in tile {
            batch.resize(batch.len().min(room));
            (room, left) = (room - batch.len(), left - batch.len());
            match out.last_mut() {
                Some(last) if most < usize::MAX && last.len() + batch.len() <= BATCH => {
                    (0..batch.len()).for_each(|i| last.push(&batch.get(i)));
                }
                _ => out.push(batch),
            }
        }
    }
    out.retain(|b| !b.is_empty());
    out
}

/// So many numbers below `n`, ascending, spread evenly without a period that tiles of a row could fall in with.
fn spread(n: usize, wanted: usize) -> Vec<usize> {
    if 3 * wanted > n {
        return (0..wanted).map(|i| i * n / wanted).collect();
    }
    // Multiples of the golden ratio keep at least 0.38 / wanted apart: no number comes twice.
    const RATIO: f64 = 0.618_033_988_749_894_9;
    let place = |i: usize| ((i as f64 + 0.5) * RATIO).fract();
    let mut all: Vec<usize> = (0..wanted).map(|i| (place(i) * n as f64) as usize).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Surface points, as rays that met them.
pub(super) struct Points<'a> {
    scene: &'a Scene,
    /// Each ray that met something, with its hit.
    hits: Vec<(Ray, Hit)>,
    spread: f32,
}

impl<'a> Points<'a> {
    pub(super) fn new(scene: &'a Scene, rays: &[RayBatch]) -> Self {
        let of_batch = |batch: &RayBatch| {
            let mut hits = HitBatch::default();
            scene.kernel.intersect_batch(batch, &mut hits, Coherence::Incoherent);
            let met = (0..batch.len()).filter_map(|i| Some((batch.get(i), hits.get(i)?)));
            met.collect::<Vec<_>>()
        };
        let hits: Vec<_> = rays.par_iter().map(of_batch).collect();
        Points { scene, hits: hits.concat(), spread: scene.camera.pixel_spread() }
    }

    fn is_empty(&self) -> bool {
        self.hits.is_empty()
    }

    /// Point `i`; after the last comes the first again.
    pub(super) fn vertex(&self, i: usize) -> Vertex {
        let (ray, hit) = self.hits[i % self.hits.len()];
        self.scene.vertex(&ray, hit, self.spread)
    }
}

/// Candidates that are tried for each ray wanted: points that no light reaches give no shadow ray.
const TRIES: usize = 16;

/// The first `count` rays that candidates 0, 1, ... come to, in batches.
fn from_candidates(count: usize, ray: impl Fn(usize) -> Option<Ray> + Sync) -> Vec<RayBatch> {
    let mut out = vec![RayBatch::default()];
    let mut left = count;
    // Enough at once for all threads, few enough that little is thrown away.
    let step = 64 * BATCH;
    for first in (0..count.saturating_mul(TRIES)).step_by(step) {
        if left == 0 {
            break;
        }
        let candidates = first..first + step.min(left.next_multiple_of(BATCH));
        let made: Vec<Option<Ray>> = candidates.into_par_iter().map(&ray).collect();
        for r in made.into_iter().flatten().filter(Ray::is_valid).take(left) {
            if out.last().is_none_or(|b| b.len() == BATCH) {
                out.push(RayBatch::default());
            }
            out.last_mut().expect("never empty").push(&r);
            left -= 1;
        }
    }
    out.retain(|b| !b.is_empty());
    out
}

/// Two random numbers of a candidate, independent of all others.
fn random(kind: RayKind, i: u32, which: u32) -> [f32; 2] {
    Sampler::Independent.points(SEED, None).pixel(i, kind as u32, which).get_2d(0, Dim::FILTER)
}

fn key(kind: RayKind, i: u32) -> u32 {
    ray_key(i, kind as u32, 2)
}

/// The geometric normal of the side that is seen.
pub(super) fn seen_side(v: &Vertex) -> Vec3 {
    if v.wo.dot(v.ng) >= 0.0 { v.ng } else { -v.ng }
}

pub(super) fn bounce(v: &Vertex, _: &Scene, i: u32) -> Option<Ray> {
    let kind = RayKind::Bounce;
    let local = cosine_hemisphere(Vec2::from(random(kind, i, 0)));
    let n = seen_side(v);
    let w = Frame::from_z(n).to_world(local);
    // Rounding may have put a flat direction below the surface.
    (w.dot(n) > 0.0).then(|| v.spawn(w, key(kind, i)))
}

pub(super) fn shadow(v: &Vertex, scene: &Scene, i: u32) -> Option<Ray> {
    let kind = RayKind::Shadow;
    let lights = &scene.lights;
    let u = random(kind, i, 1)[0];
    let number = lights.at_infinity.len();
    let light = *lights.at_infinity.get((u * number as f32) as usize % number.max(1))?;
    let sample = lights.list[light as usize].sample_li(&v.receiver(), random(kind, i, 0))?;
    (sample.wi.dot(seen_side(v)) > 0.0).then(|| v.spawn_to(sample.wi, sample.dist, key(kind, i)))
}

/// Above the tangent plane, at most: degrees.
const GRAZING_DEG: f32 = 1.0;

pub(super) fn grazing(v: &Vertex, _: &Scene, i: u32) -> Option<Ray> {
    let kind = RayKind::Grazing;
    let [u, turn] = random(kind, i, 0);
    let (sin, cos) = (u * GRAZING_DEG).to_radians().sin_cos();
    let (y, x) = (turn * std::f32::consts::TAU).sin_cos();
    let w = Frame::from_z(seen_side(v)).to_world(Vec3::new(x * cos, y * cos, sin)).normalize();
    Some(v.spawn(w, key(kind, i)))
}

fn chord(bounds: &Aabb, i: usize) -> Ray {
    let kind = RayKind::Chord;
    let i = i as u32;
    // A flat scene has thickness this way.
    let b = bounds.padded(0.05 * 2.0 * bounds.radius());
    let point = |which| {
        let ([x, y], [z, _]) = (random(kind, i, which), random(kind, i, which + 1));
        b.min + b.size() * Vec3::new(x, y, z)
    };
    let (from, to) = (point(0), point(2));
    Ray::new(from, (to - from).normalize_or_zero(), key(kind, i))
}

/// Refuses a scene that has nothing to ask rays about.
///
/// # Errors
/// [`Error::Usage`] if it has no primitive.
pub fn check_scene(scene: &Scene) -> Result<()> {
    match scene.geometry.root().bounds.is_empty() {
        true => Err(Error::Usage("the scene has no object that a ray could meet".into())),
        false => Ok(()),
    }
}

/// Tests of one primitive that asking the oracle for a ray costs: every placement of every primitive.
pub fn placed_primitives(geometry: &Geometry) -> u64 {
    let mut of_group: Vec<u64> = Vec::with_capacity(geometry.groups.len());
    for g in &geometry.groups {
        let leaves = g.leaves.iter().map(|l| u64::from(l.shape.primitive_count()));
        let children = g.children.iter().map(|c| of_group[c.group]);
        of_group.push(leaves.chain(children).fold(0, u64::saturating_add));
    }
    of_group.last().copied().unwrap_or(0)
}

/// The oracle over a geometry.
pub fn oracle(scene: &Scene) -> accel::brute::Brute {
    accel::brute::Brute::new(scene.geometry.clone())
}
