//! L4: a certificate of numerical stability for given geometry: is it closed, do rays leak, do spawned rays meet what
//! they left or jump over what is near, how well are points known; on every kernel, over a sweep of placements.
//!
//! The functions of the modules count what one kernel does on one geometry; [`examine`] runs them all.

mod batches;
pub mod bodies;
pub mod certificate;
pub mod exact;
pub mod leaks;
mod present;
pub mod quadrics;
pub mod random;
pub mod solid;
pub mod spawn;
pub mod surface;
pub mod sweep;
pub mod tally;
#[cfg(test)]
mod tests;
pub mod topology;
pub mod tunnel;

use crate::accel::{KERNELS, build_kernel};
use crate::base::geometry::Geometry;
use crate::base::intersectable::{Intersectable, KernelOptions};
use crate::error::{Error, Result};
use crate::sampler::hash::mix64;
use crate::scene::build::{BuildOptions, build};
use crate::scene::desc::SceneDesc;
use bodies::Body;
use certificate::{Certificate, Check, KernelFacts, MeshFacts};
use leaks::{Aim, leaks};
use serde::Serialize;
use solid::Solid;
use spawn::spawned;
use std::sync::Arc;
use tunnel::{Sheets, tunnelling};

/// What is wanted.
#[derive(Debug, Clone)]
pub struct CheckOptions {
    /// Rays of each kind for each kernel, dealt out over bodies and placements.
    pub rays: u64,
    /// Seed of every random choice.
    pub seed: u64,
    /// The kinds; all where empty.
    pub kinds: Vec<RayKind>,
    /// Kernels by name; all of this build where empty.
    pub kernels: Vec<String>,
    /// See [`KernelOptions`].
    pub kernel: KernelOptions,
}

impl Default for CheckOptions {
    fn default() -> Self {
        let (kinds, kernels) = (Vec::new(), Vec::new());
        CheckOptions { rays: 1_000_000, seed: 0, kinds, kernels, kernel: KernelOptions::default() }
    }
}

impl CheckOptions {
    fn wants(&self, kind: RayKind) -> bool {
        self.kinds.is_empty() || self.kinds.contains(&kind)
    }
}

/// Kinds of rays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum RayKind {
    /// From inside a mesh, in random directions.
    Random,
    /// From inside at vertices.
    Vertices,
    /// From inside at points of edges.
    Edges,
    /// From inside just beside both.
    Beside,
    /// Spawned at surface points.
    Spawned,
    /// Spawned under a sheet that lies close above.
    Tunnelling,
    /// At quadrics from afar.
    Quadrics,
}

impl RayKind {
    /// All of them with their names.
    pub const ALL: [(&'static str, RayKind); 7] = [
        ("random", RayKind::Random),
        ("vertices", RayKind::Vertices),
        ("edges", RayKind::Edges),
        ("beside", RayKind::Beside),
        ("spawned", RayKind::Spawned),
        ("tunnelling", RayKind::Tunnelling),
        ("quadrics", RayKind::Quadrics),
    ];
}

/// Told how far the examination is.
pub trait Watch {
    /// So many steps there are.
    fn begin(&self, steps: u64);
    /// One more begins.
    fn step(&self, what: &str);
}

/// Meshes of one geometry that are checked for leaks: of a scene, the first ones.
const MAX_SOLIDS: u64 = 4;
/// Leaves of a scene that are looked at for those.
const MAX_LOOKED_AT: u64 = 10_000;

/// Tests of primitives that a kernel without any structure (the oracle) may spend on each kind of ray. It stays a
/// sample: the oracle is simple enough to trust.
const PLAIN_WORK: u64 = 50_000_000;

/// The kinds of rays from inside.
const AIMS: [(RayKind, Check, Aim); 4] = [
    (RayKind::Random, Check::LeaksAtRandom, Aim::Random),
    (RayKind::Vertices, Check::LeaksAtVertices, Aim::Vertex),
    (RayKind::Edges, Check::LeaksAtEdges, Aim::Edge),
    (RayKind::Beside, Check::LeaksBeside, Aim::Beside),
];

/// A kernel under test.
struct Tested {
    name: String,
    kernel: Box<dyn Intersectable>,
    rays: u64,
}

/// A geometry under test.
struct Target<'a> {
    body: &'a str,
    placement: &'a str,
    geometry: Arc<Geometry>,
    seed: u64,
}

/// Examines a scene: all of its shapes in all placements, the scene as it is, and quadrics from afar.
///
/// # Errors
/// [`Error::Usage`] for a scene without objects, what the scene builder says of the scene as it is, or [`build_kernel`]
/// of a kernel's name. Placements that cannot be built are noted.
pub fn examine(
    scene: &SceneDesc,
    input: &str,
    options: &CheckOptions,
    watch: &dyn Watch,
) -> Result<Certificate> {
    let plain = BuildOptions { backend: "brute".into(), kernel: options.kernel };
    if scene.objects.is_empty() {
        return Err(Error::Usage("there is nothing to check: the scene has no object".into()));
    }
    // No ray asks for light.
    let unlit = SceneDesc { sky: None, lights: Vec::new(), ..scene.clone() };
    let whole = build(unlit, &plain)?;
    let mut found = bodies::of_scene(scene);
    let users = found.list.len();
    found.list.push(bodies::needles());
    let mut certificate = Certificate {
        input: input.to_owned(),
        rays: options.rays,
        seed: options.seed,
        kinds: options.kinds.clone(),
        ..Certificate::default()
    };
    if !options.kinds.is_empty() {
        let asked = RayKind::ALL.iter().filter(|k| options.wants(k.1)).map(|k| k.0);
        let asked = asked.collect::<Vec<_>>().join(", ");
        certificate.notes.push(format!("only these kinds of rays were asked for: {asked}"));
    }
    if found.more > 0 {
        certificate
            .notes
            .push(format!("{} more shapes were checked as parts of the scene alone", found.more));
    }
    let placements = sweep::placements();
    let targets = (found.list.len() * placements.len() + 1) as u64;
    let quadric_steps = match options.wants(RayKind::Quadrics) {
        true => (quadrics::BODIES.len() * quadrics::DISTANCES.len()) as u64,
        false => 0,
    };
    watch.begin(targets + quadric_steps);
    let mut run = Run { certificate, options, watch, targets };
    run.target(&Target {
        body: WHOLE,
        placement: "as it stands",
        geometry: whole.geometry,
        seed: options.seed,
    })?;
    for (b, body) in found.list.iter().enumerate() {
        for (p, placement) in placements.iter().enumerate() {
            let seed = mix64(options.seed ^ ((b as u64) << 32) ^ (p as u64 + 1));
            match placement.build(&body.node) {
                Ok(geometry) => {
                    let target = Target { body: &body.name, placement: &placement.name, geometry, seed };
                    if p == 0 && b < users {
                        run.facts(body, &target)?;
                    }
                    run.target(&target)?;
                }
                Err(e) => run.note(body, &placement.name, &e.to_string()),
            }
        }
    }
    if options.wants(RayKind::Quadrics) {
        run.quadrics()?;
    }
    Ok(run.certificate)
}

/// What the scene as a whole is called.
const WHOLE: &str = "the scene";

struct Run<'a> {
    certificate: Certificate,
    options: &'a CheckOptions,
    watch: &'a dyn Watch,
    targets: u64,
}

impl Run<'_> {
    fn note(&mut self, body: &Body, placement: &str, what: &str) {
        self.watch.step(placement);
        self.certificate.notes.push(format!("{}, {placement}: not checked: {what}", body.name));
    }

    /// What is to be told of a mesh as it is.
    fn facts(&mut self, body: &Body, target: &Target) -> Result<()> {
        let Some(solid) = Solid::new(&target.geometry, 0, target.seed) else { return Ok(()) };
        let source = crate::base::registry::build("shape", crate::shapes::REGISTRY, &body.node)?;
        let dropped = source.place(&glam::DAffine3::IDENTITY)?.dropped.total();
        self.certificate.meshes.push(MeshFacts {
            body: body.name.clone(),
            closed: solid.connectivity.topology.is_closed(),
            points_inside: solid.inside.len(),
            topology: solid.connectivity.topology,
            dropped,
        });
        Ok(())
    }

    /// The kernels that were asked for, over a geometry. One that cannot hold it is noted.
    fn kernels(&mut self, target: &Target, per_target: u64) -> Result<Vec<Tested>> {
        let all = || KERNELS.iter().map(|k| k.name.to_owned()).collect();
        let wanted = if self.options.kernels.is_empty() { all() } else { self.options.kernels.clone() };
        let primitives = primitives(&target.geometry).max(1);
        let mut built = Vec::new();
        for name in wanted {
            let kernel = match build_kernel(&name, target.geometry.clone(), &self.options.kernel) {
                Ok(kernel) => kernel,
                Err(e @ Error::Usage(_)) => return Err(e),
                Err(e) => {
                    let (body, placement) = (target.body, target.placement);
                    self.certificate.notes.push(format!("{name} cannot hold {body}, {placement}: {e}"));
                    continue;
                }
            };
            let rays = match kernel.memory() {
                0 => per_target.min((PLAIN_WORK / self.targets / primitives).max(8)),
                _ => per_target,
            };
            let facts = KernelFacts { name: name.clone(), version: kernel.describe() };
            if !self.certificate.kernels.iter().any(|k| k.name == name) {
                self.certificate.kernels.push(facts);
            }
            built.push(Tested { name, kernel, rays });
        }
        Ok(built)
    }

    /// All checks of one geometry on all kernels.
    fn target(&mut self, target: &Target) -> Result<()> {
        self.watch.step(&format!("{}, {}", target.body, target.placement));
        if target.geometry.root().paths == 0 {
            return Ok(());
        }
        let kernels = self.kernels(target, self.options.rays.div_ceil(self.targets))?;
        let names = [target.body, target.placement];
        let geometry = &*target.geometry;
        let meshes = mesh_paths(geometry);
        let solids: Vec<Solid> =
            meshes.iter().filter_map(|&path| Solid::new(geometry, path, target.seed)).collect();
        for t in &kernels {
            for (_, check, aim) in AIMS.into_iter().filter(|(kind, ..)| self.options.wants(*kind)) {
                let each = t.rays.div_ceil(solids.len().max(1) as u64);
                let of = |s: &Solid| leaks(s, &*t.kernel, aim, each, target.seed ^ check as u64);
                let tally = solids.iter().map(of).fold(Default::default(), |a: tally::Tally, b| a.merged(&b));
                self.certificate.add(check, names, &t.name, tally);
            }
            if self.options.wants(RayKind::Spawned) {
                let s = spawned(geometry, &*t.kernel, t.rays, target.seed);
                for (check, tally) in [
                    (Check::SelfHits, s.self_hits),
                    (Check::Neighbours, s.neighbours),
                    (Check::Offset, s.offset),
                    (Check::Point, s.point),
                    (Check::Distance, s.distance),
                ] {
                    self.certificate.add(check, names, &t.name, tally);
                }
            }
            t.kernel.take_failure()?;
        }
        drop(kernels);
        if !self.options.wants(RayKind::Tunnelling) {
            return Ok(());
        }
        match meshes.first().map(|&path| Sheets::new(geometry, path, target.seed)).transpose()?.flatten() {
            Some(sheets) => self.tunnelling(target, &sheets),
            None => Ok(()),
        }
    }

    fn tunnelling(&mut self, target: &Target, sheets: &Sheets) -> Result<()> {
        let with_sheets = Target { geometry: sheets.geometry.clone(), ..*target };
        for t in self.kernels(&with_sheets, self.options.rays.div_ceil(self.targets))? {
            for (check, lifted) in [(Check::Tunnelling, false), (Check::LiftedTunnelling, true)] {
                if !lifted || sheets.is_smooth() {
                    let tally = tunnelling(sheets, &*t.kernel, lifted, t.rays, target.seed);
                    self.certificate.add(check, [target.body, target.placement], &t.name, tally);
                }
            }
        }
        Ok(())
    }

    fn quadrics(&mut self) -> Result<()> {
        let steps = (quadrics::BODIES.len() * quadrics::DISTANCES.len()) as u64;
        for body in &quadrics::BODIES {
            for distance in quadrics::DISTANCES {
                let placement = format!("from {distance:.0e} radii away");
                self.watch.step(&format!("{}, {placement}", body.name));
                let seed = mix64(self.options.seed ^ distance.to_bits());
                let target =
                    Target { body: body.name, placement: &placement, geometry: body.geometry()?, seed };
                for t in self.kernels(&target, self.options.rays.div_ceil(steps))? {
                    let q = quadrics::quadrics(body, &target.geometry, &*t.kernel, distance, t.rays, seed);
                    for (check, tally) in [
                        (Check::QuadricDecision, q.decision),
                        (Check::SphereUlp, q.ulp),
                        (Check::QuadricPoint, q.point),
                        (Check::QuadricSelfHits, q.self_hits),
                    ] {
                        if check != Check::SphereUlp || body.is_sphere() {
                            self.certificate.add(check, [body.name, &placement], &t.name, tally);
                        }
                    }
                    t.kernel.take_failure()?;
                }
            }
        }
        Ok(())
    }
}

/// Paths of the first meshes.
fn mesh_paths(geometry: &Geometry) -> Vec<u64> {
    let (mut paths, mut looked) = (Vec::new(), 0);
    geometry.for_each_path(&mut |path, leaf, _| {
        looked += 1;
        if leaf.shape.triangles().is_some() {
            paths.push(path);
        }
        (paths.len() as u64) < MAX_SOLIDS && looked < MAX_LOOKED_AT
    });
    paths
}

/// Primitives that a loop over all placed shapes meets, as far as they can be counted cheaply.
fn primitives(geometry: &Geometry) -> u64 {
    let (mut count, mut looked) = (0u64, 0);
    geometry.for_each_path(&mut |_, leaf, _| {
        looked += 1;
        count += u64::from(leaf.shape.primitive_count());
        looked < MAX_LOOKED_AT
    });
    count.saturating_mul((geometry.root().paths / looked.max(1)).max(1))
}
