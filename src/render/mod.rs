//! L4: how a scene becomes a film: the [`Renderer`] deals blocks of pixels to threads, round by round.

pub mod adaptive;
pub mod aov;
pub mod backdrop;
pub mod block;
pub mod coverage;
pub mod dealing;
pub mod explain;
pub mod film;
pub mod film_layers;
pub mod fixed;
pub mod layers;
pub mod outlines;
mod prelude;
pub mod settings;

use crate::base::pixel_rect::PixelRect;
use crate::error::{Error, Result};
use crate::integrators::{Avoided, Integrator, RayCounts};
use crate::memory;
use crate::scene::Scene;
use adaptive::{Reached, Schedule, Task};
use block::{Job, SampleId, Worker};
use dealing::Notes;
use film::Film;
use layers::Layers;
use prelude::Prelude;
use rayon::prelude::*;
use serde::Serialize;
use settings::RenderSettings;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Instant;

/// Told of a render's progress from its worker threads, and asked whether to go on.
pub trait Progress: Sync {
    /// The most samples that will be taken.
    fn begin(&self, _samples: u64) {}

    /// So many more have been taken.
    fn advance(&self, _samples: u64) {}

    /// After a round: how good the picture is, where a target error is to be met.
    fn reached(&self, _error: &Reached, _target: f64) {}

    /// Whether the render shall stop with what it has; asked once a tile.
    fn should_stop(&self) -> bool {
        false
    }

    /// Whether [`Progress::tile`] wants to be called; asked once a tile.
    fn wants_tiles(&self) -> bool {
        false
    }

    /// What a tile's pixels have come to, row by row: mean radiance and alpha. Told after each round's samples of the tile
    /// are in, by the thread that took them, which waits meanwhile.
    fn tile(&self, _rect: PixelRect, _means: &[[f32; 4]]) {}
}

/// No progress is shown.
pub struct Silent;

impl Progress for Silent {}

/// What a render brings back.
pub struct Rendered {
    /// The picture's exact sums.
    pub film: Film,
    /// Further layers.
    pub layers: Layers,
    /// Counts and times.
    pub stats: RenderStats,
}

/// Pixels that outlines run through.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct OutlineStats {
    /// How many; 0 if they were not looked for.
    pub pixels: u64,
    /// How many samples each took for one of another pixel.
    pub times: u32,
}

/// Counts and times of a render.
#[derive(Debug, Clone, Default)]
pub struct RenderStats {
    /// Seconds from the first ray to the last.
    pub seconds: f64,
    /// Samples a pixel in the film, the most but for outlines.
    pub spp: u32,
    /// The fewest; fewer where samples went by need.
    pub spp_least: u32,
    /// Their mean over pixels.
    pub spp_mean: f64,
    /// Rounds begun: 1, unless a clock or a target decides.
    pub rounds: u32,
    /// How good the picture is, where there was a target.
    pub reached: Option<Reached>,
    /// Samples taken.
    pub samples: u64,
    /// Rays by kind.
    pub rays: RayCounts,
    /// Samples that were not finite and were left out.
    pub dropped: u64,
    /// The first few of them.
    pub bad: Vec<SampleId>,
    /// Whether it was stopped before its last tile.
    pub interrupted: bool,
    /// What the integrator decided beforehand; empty if nothing.
    pub decided: String,
    /// Pixels that no geometry projects into.
    pub free_pixels: u64,
    /// Pixels with more samples.
    pub outlines: OutlineStats,
    /// Samples of those that needed no ray: their pixels got the filter's integral of what is behind everything.
    pub spared: u64,
    /// Rays that were not needed; zeros of integrators that do not count them.
    pub avoided: Avoided,
    /// Rays that were spent on deciding; among `rays`.
    pub pilot: RayCounts,
}

impl RenderStats {
    /// What pixels have after a part of the samples, of which some tiles are done.
    fn tell(&mut self, tiles: &[PixelRect], done: &[Option<u64>], number: impl Fn(u32, u32, bool) -> u32) {
        (self.spp_least, self.spp) = (u32::MAX, 0);
        let (mut sum, mut pixels) = (0, 0);
        for (rect, done) in tiles.iter().zip(done) {
            for (x, y) in rect.pixels() {
                let n = number(x, y, done.is_some());
                (self.spp_least, self.spp) = (self.spp_least.min(n), self.spp.max(n));
                (sum, pixels) = (sum + u64::from(n), pixels + 1);
            }
        }
        self.spp_mean = sum as f64 / f64::from(pixels.max(1));
        self.interrupted = done.contains(&None);
    }
}

/// Decides how a scene is traced.
pub struct Renderer {
    /// What is estimated along each path.
    pub integrator: Arc<dyn Integrator>,
    /// How many, how, where.
    pub settings: RenderSettings,
}

impl Renderer {
    /// Renders; the film depends on the scene and the settings alone (and, with a time limit, on how many rounds
    /// the clock allowed). Errors on bad settings and on a failure inside a kernel's callbacks.
    pub fn render(&self, scene: &Scene, progress: &dyn Progress) -> Result<Rendered> {
        self.check(scene)?;
        self.in_pool(|| self.render_rounds(scene, progress))
    }

    fn check(&self, scene: &Scene) -> Result<()> {
        self.settings.check()?;
        let placed = [scene.film.width, scene.film.height];
        if self.settings.size != placed {
            let message =
                format!("the camera was placed for a film of {placed:?}, not {:?}", self.settings.size);
            return Err(Error::Usage(message));
        }
        Ok(())
    }

    /// By as many threads as the settings say.
    fn in_pool<T: Send>(&self, work: impl FnOnce() -> Result<T> + Send) -> Result<T> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(self.settings.threads.max(1))
            .build()
            .map_err(|e| Error::Internal(format!("cannot start {} threads: {e}", self.settings.threads)))?;
        pool.install(work)
    }

    fn render_rounds(&self, scene: &Scene, progress: &dyn Progress) -> Result<Rendered> {
        let s = &self.settings;
        let start = Instant::now();
        let crop = s.crop;
        let bytes_per_pixel =
            film::BYTES_PER_PIXEL + outlines::BYTES_PER_PIXEL + s.aovs.len() as u64 * layers::BYTES_PER_PIXEL;
        let bytes_per_pixel = bytes_per_pixel + if s.deals() { dealing::BYTES_PER_PIXEL } else { 0 };
        let what = || format!("a film of {} x {}", crop.width(), crop.height());
        // Held to the end: what is written is made only then.
        let _room = memory::room(crop.area() as u64 * bytes_per_pixel, what)?;
        progress.begin(crop.area() as u64 * u64::from(s.spp));
        let mut out = Rendered {
            film: Film::new(s.size[0], s.size[1], crop),
            layers: Layers::new(crop, &s.aovs),
            stats: RenderStats::default(),
        };
        let found = Prelude::new(self, scene)?;
        out.stats.free_pixels = found.coverage.as_ref().map_or(0, |c| c.free() as u64);
        (out.stats.decided, out.stats.pilot) = (found.decided.clone(), found.pilot);
        let job = found.job(scene, s);
        let workers = Mutex::new(Vec::<Worker>::new());
        if s.deals() {
            dealt(&job, &workers, &mut out, progress)?;
        } else {
            rounds(&job, &workers, &mut out, start, progress)?;
        }
        let stats = &mut out.stats;
        stats.seconds = start.elapsed().as_secs_f64();
        for w in lock(&workers).drain(..) {
            stats.rays.add(&w.work.counts);
            stats.avoided.add(&w.work.avoided);
            stats.bad.extend(w.bad);
            stats.spared += w.spared;
        }
        stats.samples = stats.rays.camera + stats.spared;
        if let Some(outlines) = &found.outlines {
            stats.outlines = OutlineStats { pixels: outlines.count() as u64, times: outlines.times() };
            stats.pilot.camera += outlines.rays;
        }
        stats.rays.add(&stats.pilot);
        stats.dropped = out.film.counts().dropped;
        stats.bad.sort_by_key(|b| (b.y, b.x, b.replicate, b.index));
        stats.bad.truncate(8);
        Ok(out)
    }
}

/// Samples round by round, as many rounds as targets and clocks ask for.
fn rounds(
    job: &Job,
    workers: &Mutex<Vec<Worker>>,
    out: &mut Rendered,
    start: Instant,
    progress: &dyn Progress,
) -> Result<()> {
    let s = job.settings;
    let mut schedule = Schedule::new(s, &out.film, out.stats.free_pixels);
    let in_time = |rounds: u32| s.time.is_none_or(|t| rounds == 0 || start.elapsed() < t);
    while in_time(schedule.rounds) && !out.stats.interrupted {
        let tasks = schedule.next(&out.film);
        if let (Some(reached), Some(target)) = (&schedule.reached, &s.target) {
            progress.reached(reached, target.error);
        }
        if tasks.is_empty() {
            break;
        }
        let rays = render_round(job, &tasks, workers, out, None, progress)?;
        for (task, rays) in tasks.iter().zip(rays) {
            match rays {
                Some(rays) => schedule.done(task, rays),
                None => out.stats.interrupted = true,
            }
        }
    }
    schedule.look(&out.film);
    let stats = &mut out.stats;
    [stats.spp_least, stats.spp] = schedule.spp_range();
    stats.spp_mean = schedule.spp_mean();
    stats.rounds = schedule.rounds;
    stats.reached = schedule.reached;
    Ok(())
}

/// Samples in two parts: some for every pixel, and the others where the first show that they are needed.
fn dealt(job: &Job, workers: &Mutex<Vec<Worker>>, out: &mut Rendered, progress: &dyn Progress) -> Result<()> {
    let spp = job.settings.spp;
    let first = dealing::first_samples(spp);
    let tiles: Vec<PixelRect> = out.film.tiles().collect();
    let tasks = |samples: Range<u32>| -> Vec<Task> {
        let task = |(tile, &rect)| Task { tile, rect, samples: samples.clone() };
        tiles.iter().enumerate().map(task).collect()
    };
    let mut notes = Notes::new(out.film.window());
    let noting = Job { notes: true, ..*job };
    let done = render_round(&noting, &tasks(0..first), workers, out, Some(&mut notes), progress)?;
    out.stats.rounds = 1;
    out.stats.tell(&tiles, &done, |_, _, is_done| if is_done { first } else { 0 });
    if out.stats.interrupted {
        return Ok(());
    }
    let counts = notes.deal(first, job.settings, job.outlines.map(|o| o.pixels));
    drop(notes);
    let rest = Job { counts: Some(&counts), ..*job };
    let done = render_round(&rest, &tasks(first..counts.most().max(first)), workers, out, None, progress)?;
    out.stats.rounds = 2;
    out.stats.tell(&tiles, &done, |x, y, is_done| if is_done { counts.with_bare(x, y) } else { first });
    Ok(())
}

/// One round; the rays that each task took, `None` for those that were stopped before they began.
fn render_round(
    job: &Job,
    tasks: &[Task],
    workers: &Mutex<Vec<Worker>>,
    out: &mut Rendered,
    notes: Option<&mut Notes>,
    progress: &dyn Progress,
) -> Result<Vec<Option<u64>>> {
    let stopped = AtomicBool::new(false);
    let sums = Mutex::new((&mut out.film, &mut out.layers, notes));
    let run = |task: &Task| {
        if stopped.load(Ordering::Relaxed) || progress.should_stop() {
            stopped.store(true, Ordering::Relaxed);
            return Ok(None);
        }
        let idle = lock(workers).pop();
        let mut worker = idle.unwrap_or_else(|| Worker::new(job.settings));
        let before = worker.work.counts.total();
        worker.render_tile(job, task.rect, task.samples.clone());
        job.scene.kernel.take_failure()?;
        let rays = worker.work.counts.total() - before;
        let mut sums = lock(&sums);
        sums.0.add_tile(&worker.film);
        sums.1.merge(&worker.layers);
        if let Some(notes) = &mut sums.2 {
            notes.add_tile(&task.rect, &worker.notes, &worker.spent);
        }
        let means = progress.wants_tiles().then(|| sums.0.means(task.rect));
        drop(sums);
        lock(workers).push(worker);
        if let Some(means) = means {
            progress.tile(task.rect, &means);
        }
        // Where samples are dealt by need, a tile counts as if they were not: the sum is known beforehand.
        let end = if job.counts.is_some() { job.settings.spp } else { task.samples.end };
        progress.advance(task.rect.area() as u64 * u64::from(end.saturating_sub(task.samples.start)));
        Ok(Some(rays))
    };
    tasks.par_iter().with_max_len(1).map(run).collect()
}

/// A panic elsewhere has already failed the render; the data behind the lock is sums, which stay sums.
fn lock<T>(m: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    m.lock().unwrap_or_else(|e| e.into_inner())
}
