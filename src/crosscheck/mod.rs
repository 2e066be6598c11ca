//! L4: every ray of a render through every kernel, differences classified, decided by the double-precision oracle,
//! and located; then the same picture by each kernel.
//!
//! The rays are those of a real render: the scene's kernel is replaced by one that asks all others and answers like the
//! first ([`compare`]). Every answer is held against what a careful kernel in single precision may say ([`oracle`],
//! [`crossing`], [`triangle`]); a difference is *explained* if all answers are such. Nothing of it depends on a
//! clock or on the number of threads.

pub mod compare;
pub mod crossing;
pub mod equivalence;
pub mod html;
pub mod judge;
pub mod leaf_ray;
pub mod locate;
pub mod oracle;
pub mod pictures;
pub mod replay;
pub mod summary;
pub mod tally;
#[cfg(test)]
mod tests;
pub mod triangle;

use crate::base::pixel_rect::PixelRect;
use crate::error::{Error, Result};
use crate::integrators::{Integrator, RayCounts};
use crate::render::block::{Job, Worker};
use crate::render::film::Film;
use crate::render::settings::RenderSettings;
use crate::render::{Progress, Silent};
use crate::scene::Scene;
use compare::{Case, Comparing, Contender, Shared};
use judge::Judgement;
use locate::{Source, sources};
use oracle::Possible;
use pictures::PictureCheck;
use rayon::prelude::*;
use std::collections::HashSet;
use std::sync::{Arc, Mutex};
use tally::Tally;

/// What is to be compared.
#[derive(Clone)]
pub struct Plan {
    /// At least one kernel, each over the geometry of the scene. The first decides which rays there are.
    pub contenders: Vec<Contender>,
    /// What is rendered with them.
    pub integrator: Arc<dyn Integrator>,
    /// How; a time limit is not looked at.
    pub settings: RenderSettings,
    /// Primitive tests that the oracle may spend on looking at every primitive.
    pub oracle_tests: u64,
}

/// Tests of [`Plan::oracle_tests`] by default: about a minute of one core.
pub const ORACLE_TESTS: u64 = 2_000_000_000;
/// Differences that are kept in detail, of each sort: explained and not.
const MAX_KEPT: usize = 4096;
/// The same of one tile.
const MAX_KEPT_OF_TILE: usize = 256;
/// Tiles between two orderly additions of what was found in them.
const TILES_AT_ONCE: usize = 64;

/// A difference with all that is known of it.
#[derive(Debug, Clone)]
pub struct Difference {
    /// The ray and the answers.
    pub case: Case,
    /// What the oracle says.
    pub judgement: Judgement,
    /// The tile of the film it was met in.
    pub tile: PixelRect,
    /// The sample it belongs to; none where an integrator makes keys of its own.
    pub source: Option<Source>,
}

/// What a crosscheck comes to.
pub struct Crosscheck {
    /// Names of the kernels.
    pub names: Vec<String>,
    /// Their descriptions.
    pub kernels: Vec<String>,
    /// Rays of the render by the first kernel, by kind.
    pub rays: RayCounts,
    /// Rays that all kernels were asked, each in two styles: those, and where tiles were traced again, theirs.
    pub compared: u64,
    /// Counts of the differences.
    pub tally: Tally,
    /// The worst differences first: the unexplained, then by class, then in order of the film.
    pub differences: Vec<Difference>,
    /// The pictures.
    pub pictures: PictureCheck,
}

impl Crosscheck {
    /// Whether everything is explained.
    pub fn passed(&self) -> bool {
        self.tally.unexplained() == 0 && self.tally.lost == 0 && self.pictures.unexplained() == 0
    }
}

/// What was met in a tile.
struct TileResult {
    tally: Tally,
    rays: u64,
    kept: [Vec<Difference>; 2],
    marked: Vec<[u32; 2]>,
}

/// A scene under comparison.
struct Check<'a> {
    scene: &'a Scene,
    plan: &'a Plan,
    comparing: Arc<Comparing>,
}

/// Runs it. The scene's kernel is put aside meanwhile, and stands in its place again afterwards.
///
/// # Errors
/// Bad settings; a film of another size than the camera was placed for; a failure inside a kernel.
pub fn run(scene: &mut Scene, plan: &Plan, progress: &dyn Progress) -> Result<Crosscheck> {
    plan.settings.check()?;
    let placed = [scene.film.width, scene.film.height];
    if plan.settings.size != placed {
        let message = format!("the camera was placed for a film of {placed:?}, not {:?}", plan.settings.size);
        return Err(Error::Usage(message));
    }
    if plan.contenders.is_empty() {
        return Err(Error::Usage("there is no kernel to check".into()));
    }
    // Of the first kernel's picture, too: points depend on how samples are dealt.
    let plan = &Plan { settings: pictures::plain(&plan.settings), ..plan.clone() };
    let threads = plan.settings.threads.max(1);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| Error::Internal(format!("cannot start {threads} threads: {e}")))?;
    let comparing = Arc::new(Comparing::new(scene.geometry.clone(), plan.contenders.clone(), threads));
    let usual = std::mem::replace(&mut scene.kernel, Box::new(Shared(comparing.clone())));
    let done = pool.install(|| run_in_pool(scene, plan, comparing, progress));
    scene.kernel = usual;
    done
}

fn run_in_pool(
    scene: &mut Scene,
    plan: &Plan,
    comparing: Arc<Comparing>,
    progress: &dyn Progress,
) -> Result<Crosscheck> {
    let samples = plan.settings.crop.area() as u64 * u64::from(plan.settings.spp);
    progress.begin(samples * plan.contenders.len() as u64);
    let kernels = plan.contenders.len();
    let mut found = Found::new(kernels);
    let mut film = Film::new(plan.settings.size[0], plan.settings.size[1], plan.settings.crop);
    let tiles: Vec<PixelRect> = film.tiles().collect();
    let check = Check { scene, plan, comparing: comparing.clone() };
    let rays = check.compare_tiles(&tiles, &mut film, &mut found, progress)?;
    let mut films = vec![film];
    for c in plan.contenders.iter().skip(1) {
        scene.kernel = Box::new(Shared(c.kernel.clone()));
        films.push(pictures::render(scene, plan, progress)?);
    }
    scene.kernel = Box::new(Shared(comparing.clone()));
    let check = Check { scene, plan, comparing };
    let orphans = |k: usize, found: &Found| pictures::differing(&films[0], &films[k], &found.marked).1;
    for k in 1..kernels {
        // Where the pictures differ and no ray of the first did: the rays that this kernel's own paths took.
        let again: HashSet<[u32; 2]> = orphans(k, &found).into_iter().collect();
        let again: Vec<PixelRect> =
            tiles.iter().filter(|t| t.pixels().any(|(x, y)| again.contains(&[x, y]))).copied().collect();
        if !again.is_empty() {
            check.comparing.set_answering(k);
            let mut unused = Film::new(plan.settings.size[0], plan.settings.size[1], plan.settings.crop);
            check.compare_tiles(&again, &mut unused, &mut found, &Silent)?;
            check.comparing.set_answering(0);
        }
    }
    found.look_at_everything(scene, plan);
    let names: Vec<String> = plan.contenders.iter().map(|c| c.name.clone()).collect();
    let pictures = PictureCheck::new(&names, films, &found.marked);
    Ok(Crosscheck {
        names,
        kernels: plan.contenders.iter().map(|c| c.kernel.describe()).collect(),
        rays,
        compared: found.rays,
        tally: found.tally,
        differences: found.differences,
        pictures,
    })
}

impl Check<'_> {
    /// Renders tiles with the comparing kernel; the film gets the picture of the kernel that answers.
    fn compare_tiles(
        &self,
        tiles: &[PixelRect],
        film: &mut Film,
        found: &mut Found,
        progress: &dyn Progress,
    ) -> Result<RayCounts> {
        let settings = &self.plan.settings;
        let idle = Mutex::new(Vec::<Worker>::new());
        let film = Mutex::new(film);
        for some in tiles.chunks(TILES_AT_ONCE) {
            let results: Vec<TileResult> = some
                .par_iter()
                .with_max_len(1)
                .map(|rect| {
                    let worker = lock(&idle).pop();
                    let mut worker = worker.unwrap_or_else(|| Worker::new(settings));
                    let result = self.compare_tile(*rect, &mut worker)?;
                    lock(&film).add_tile(&worker.film);
                    lock(&idle).push(worker);
                    progress.advance(rect.area() as u64 * u64::from(settings.spp));
                    Ok(result)
                })
                .collect::<Result<_>>()?;
            results.into_iter().for_each(|r| found.add(r));
        }
        let mut rays = RayCounts::default();
        lock(&idle).iter().for_each(|w| rays.add(&w.work.counts));
        Ok(rays)
    }

    fn compare_tile(&self, rect: PixelRect, worker: &mut Worker) -> Result<TileResult> {
        let settings = &self.plan.settings;
        let job = Job::new(self.scene, self.plan.integrator.as_ref(), settings);
        // Nothing that an earlier failure has left behind.
        self.comparing.take_seen();
        worker.render_tile(&job, rect, 0..settings.spp);
        self.scene.kernel.take_failure()?;
        let seen = self.comparing.take_seen();
        let wanted: Vec<_> = seen.cases.iter().map(|c| (c.ray.key, c.query)).collect();
        let sources = sources(rect, settings, &wanted);
        let mut out = TileResult {
            tally: Tally { lost: seen.lost, ..Tally::new(self.plan.contenders.len()) },
            rays: seen.rays,
            kept: Default::default(),
            marked: Vec::new(),
        };
        for case in seen.cases {
            let source = sources.get(&(case.ray.key, case.query)).copied();
            match source {
                Some(s) => out.marked.push(s.pixel),
                None => out.marked.extend(rect.pixels().map(|(x, y)| [x, y])),
            }
            let possible = Possible::of_named(&self.scene.geometry, &case.ray, case.named.iter().copied());
            let judgement = Judgement::new(&case.answers, &possible);
            out.tally.add(&judgement);
            let kept = &mut out.kept[usize::from(judgement.is_explained())];
            if kept.len() < MAX_KEPT_OF_TILE {
                kept.push(Difference { case, judgement, tile: rect, source });
            }
        }
        out.marked.sort_unstable();
        out.marked.dedup();
        Ok(out)
    }
}

/// A panic elsewhere has already failed the run; sums stay sums.
fn lock<T>(m: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    m.lock().unwrap_or_else(|e| e.into_inner())
}

/// What has been found so far.
struct Found {
    tally: Tally,
    rays: u64,
    differences: Vec<Difference>,
    kept: [usize; 2],
    /// Pixels with a difference.
    marked: HashSet<[u32; 2]>,
}

impl Found {
    fn new(kernels: usize) -> Self {
        Found {
            tally: Tally::new(kernels),
            rays: 0,
            differences: Vec::new(),
            kept: [0; 2],
            marked: HashSet::new(),
        }
    }

    fn add(&mut self, tile: TileResult) {
        self.tally.merge(&tile.tally);
        self.rays += tile.rays;
        self.marked.extend(tile.marked);
        for (sort, kept) in tile.kept.into_iter().enumerate() {
            let room = MAX_KEPT - self.kept[sort];
            self.kept[sort] += kept.len().min(room);
            self.differences.extend(kept.into_iter().take(room));
        }
    }

    /// Judges the kept differences anew by all primitives there are, the unexplained first, as far as the tests last;
    /// then sorts them, the worst first.
    fn look_at_everything(&mut self, scene: &Scene, plan: &Plan) {
        self.differences.sort_by_key(|d| d.judgement.is_explained());
        let mut left = plan.oracle_tests;
        for some in self.differences.chunks_mut(TILES_AT_ONCE) {
            // Each may take its part of what is left, so that no order of threads decides.
            let share = left / some.len() as u64;
            let anew: Vec<(u64, Option<Judgement>)> = some
                .par_iter()
                .with_max_len(1)
                .map(|d| {
                    let mut tests = share;
                    let possible = Possible::of_all(&scene.geometry, &d.case.ray, &mut tests);
                    (share - tests, possible.map(|p| Judgement::new(&d.case.answers, &p)))
                })
                .collect();
            for (d, (spent, judgement)) in some.iter_mut().zip(anew) {
                left -= spent;
                if let Some(judgement) = judgement {
                    self.tally.take_back(&d.judgement);
                    self.tally.add(&judgement);
                    d.judgement = judgement;
                }
            }
        }
        self.differences.sort_by_key(|d| {
            let at = (d.tile.y0, d.tile.x0, d.source.map(|s| (s.pixel[1], s.pixel[0], s.sample, s.depth)));
            (d.judgement.is_explained(), d.judgement.class, at)
        });
    }
}
