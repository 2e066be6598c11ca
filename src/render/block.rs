//! The unit of work of a thread: a tile of pixels, its samples dealt out in batches of camera rays.

use super::aov::Combine;
use super::backdrop::Backdrop;
use super::coverage::Coverage;
use super::dealing::{Counts, Kind, Note, Spent};
use super::film::{FilmTile, REPLICATES};
use super::layers::Layers;
use super::outlines::Outlines;
use super::settings::RenderSettings;
use crate::base::camera::FilmSamples;
use crate::base::pixel_rect::PixelRect;
use crate::base::ray::Coherence;
use crate::integrators::{CameraBatch, FirstHit, Integrator, PathId, PathIds, PathResults, Workspace};
use crate::math::simd;
use crate::sampler::{Dim, PointSet, points_2d, ray_key};
use crate::scene::Scene;
use std::ops::Range;

/// Rays that are traced together. Large enough that the kernel's batches and the loops over columns run long,
/// small enough that a block's state stays in the second-level cache (about 100 bytes a ray).
pub(super) const BATCH: usize = 2048;

/// Which sample of which pixel: one that is not finite, kept for the report, or one that is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleId {
    /// Pixel.
    pub x: u32,
    /// Pixel.
    pub y: u32,
    /// Which randomisation of the pixel's points.
    pub replicate: u32,
    /// Index among them.
    pub index: u32,
}

/// Consecutive samples of one pixel and replicate within a batch.
#[derive(Clone, Copy)]
struct Run {
    x: u32,
    y: u32,
    replicate: u32,
    first_index: u32,
    start: usize,
    len: usize,
}

/// What one thread keeps from tile to tile.
pub struct Worker {
    /// The tile's sums.
    pub film: FilmTile,
    /// The tile's further layers.
    pub layers: Layers,
    /// Pixels of the tile that see nothing.
    backdrop: Backdrop,
    /// Samples that were spared by it.
    pub spared: u64,
    runs: Vec<Run>,
    film_x: Vec<f32>,
    film_y: Vec<f32>,
    lens_u: Vec<f32>,
    lens_v: Vec<f32>,
    uv: [Vec<f32>; 2],
    batch: CameraBatch,
    results: PathResults,
    /// Scratch memory and ray counts.
    pub work: Workspace,
    /// Samples that were not finite, the first few.
    pub bad: Vec<SampleId>,
    /// What the tile's pixels showed, row by row, and what that took; where [`Job::notes`] asks for it.
    pub notes: Vec<Note>,
    /// See `notes`.
    pub spent: Spent,
}

/// What all tiles of a render share.
#[derive(Clone, Copy)]
pub struct Job<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The integrator.
    pub integrator: &'a dyn Integrator,
    /// The settings.
    pub settings: &'a RenderSettings,
    /// The sample points that these come to.
    pub points: PointSet,
    /// Which pixels see any geometry; None where all may.
    pub coverage: Option<&'a Coverage>,
    /// Which pixels take more samples.
    pub outlines: Option<Outlined<'a>>,
    /// Whether workers note what pixels show.
    pub notes: bool,
    /// How many samples each pixel gets in all, if not all as many.
    pub counts: Option<&'a Counts>,
}

/// See [`Job::outlines`].
#[derive(Clone, Copy)]
pub struct Outlined<'a> {
    /// Which.
    pub pixels: &'a Outlines,
    /// Their sample points.
    pub points: PointSet,
}

impl<'a> Job<'a> {
    /// With a ray for every sample.
    pub fn new(scene: &'a Scene, integrator: &'a dyn Integrator, settings: &'a RenderSettings) -> Self {
        Job {
            scene,
            integrator,
            settings,
            points: settings.points(),
            coverage: None,
            outlines: None,
            notes: false,
            counts: None,
        }
    }
}

/// Indices of replicate `r` of `of` among the samples `range` of a pixel: sample s is number s / of of replicate s mod of.
pub fn replicate_indices(range: &Range<u32>, r: u32, of: u32) -> Range<u32> {
    let first = |s: u32| if r < of { s.saturating_sub(r).div_ceil(of) } else { 0 };
    first(range.start)..first(range.end)
}

/// Those of the samples `range` that a pixel gets, by replicate.
fn indices(range: &Range<u32>, [x, y]: [u32; 2], job: &Job, replicates: u32) -> [Range<u32>; REPLICATES] {
    let end = job.counts.map_or(range.end, |c| range.end.min(c.of(x, y)));
    let range = range.start..end.max(range.start);
    std::array::from_fn(|replicate| replicate_indices(&range, replicate as u32, replicates))
}

/// Keys of camera rays.
struct FirstKeys<'a> {
    ids: &'a PathIds,
    out: &'a mut [u32],
}

impl simd::Kernel for FirstKeys<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for ((out, &key), &index) in self.out.iter_mut().zip(&self.ids.keys).zip(&self.ids.indices) {
            *out = ray_key(key, index, 1);
        }
    }
}

impl Worker {
    /// A worker for a render.
    pub fn new(settings: &RenderSettings) -> Self {
        Worker {
            film: FilmTile::new(PixelRect::default()),
            layers: Layers::new(PixelRect::default(), &settings.aovs),
            backdrop: Backdrop::default(),
            spared: 0,
            runs: Vec::new(),
            film_x: Vec::new(),
            film_y: Vec::new(),
            lens_u: Vec::new(),
            lens_v: Vec::new(),
            uv: Default::default(),
            batch: CameraBatch::default(),
            results: PathResults::default(),
            work: Workspace::default(),
            bad: Vec::new(),
            notes: Vec::new(),
            spent: Spent::default(),
        }
    }

    /// Renders the samples `range` of every pixel of a tile, or as many of them as it gets; the sums are then in `film` and
    /// `layers`.
    pub fn render_tile(&mut self, job: &Job, rect: PixelRect, range: Range<u32>) {
        self.film.reset(rect);
        self.layers.reset(rect);
        self.start_batch(job);
        self.notes.clear();
        self.notes.resize(if job.notes { rect.area() } else { 0 }, Note::default());
        let free = |x, y| job.coverage.is_some_and(|c| !c.is_covered(x, y));
        // Those that stand still get no further samples.
        let has_free =
            job.counts.is_none() && job.coverage.is_some() && rect.pixels().any(|(x, y)| free(x, y));
        if has_free {
            self.backdrop.fill(job.scene, job.settings.filter, rect);
        }
        let replicates = job.settings.replicates();
        let is_outline = |x, y| job.outlines.is_some_and(|o| o.pixels.contains(x, y));
        let start = self.work.counts;
        // Where samples are dealt by need, what needs none stands for as many as all have on average.
        let standing = if job.notes { 0..job.settings.spp } else { range.clone() };
        let standing = indices(&standing, [rect.x0, rect.y0], job, replicates);
        for (x, y) in rect.pixels().filter(|&(x, y)| !is_outline(x, y)) {
            if !(has_free && free(x, y) && self.spare(x, y, &standing)) {
                self.add_pixel(job, &job.points, [x, y], &indices(&range, [x, y], job, replicates));
            }
        }
        self.flush(job);
        let middle = self.work.counts;
        if let Some(Outlined { pixels, points }) = job.outlines {
            self.batch.times = pixels.times();
            for (x, y) in rect.pixels().filter(|&(x, y)| pixels.contains(x, y)) {
                let indices = indices(&range, [x, y], job, replicates)
                    .map(|i| i.start.saturating_mul(pixels.times())..i.end.saturating_mul(pixels.times()));
                self.add_pixel(job, &points, [x, y], &indices);
            }
            self.flush(job);
        }
        self.spent = Spent { plain: middle.since(&start), outlines: self.work.counts.since(&middle) };
        // After what was spent is known: which layers are asked for has no say in how samples are dealt.
        if range.start == 0 && self.layers.has(Combine::Centre) {
            self.look_at_centres(job, rect);
        }
    }

    /// Samples of one pixel, traced whenever a batch is full.
    fn add_pixel(
        &mut self,
        job: &Job,
        points: &PointSet,
        [x, y]: [u32; 2],
        indices: &[Range<u32>; REPLICATES],
    ) {
        for (replicate, indices) in (0..).zip(indices).filter(|(_, indices)| !indices.is_empty()) {
            let mut first = indices.start;
            while first < indices.end {
                let room = BATCH - self.film_x.len();
                let len = room.min((indices.end - first) as usize);
                let run = Run { x, y, replicate, first_index: first, start: self.film_x.len(), len };
                self.add_run(points, run);
                first += len as u32;
                if self.film_x.len() == BATCH {
                    self.flush(job);
                }
            }
        }
    }

    /// Adds a pixel that sees nothing without sampling it; false if it must be sampled all the same.
    fn spare(&mut self, x: u32, y: u32, indices: &[Range<u32>; REPLICATES]) -> bool {
        let Some(radiance) = self.backdrop.get(x, y) else { return false };
        for (replicate, indices) in indices.iter().enumerate().filter(|(_, indices)| !indices.is_empty()) {
            // Whether it fits depends on the radiance alone: all replicates or none.
            if !self.film.add_same(x, y, replicate, radiance, indices.len()) {
                return false;
            }
            self.spared += indices.len() as u64;
        }
        self.note(x, y, || Note::bare(radiance));
        true
    }

    /// Notes what a pixel showed, if that is asked for.
    fn note(&mut self, x: u32, y: u32, note: impl FnOnce() -> Note) {
        if !self.notes.is_empty() {
            self.notes[self.film.rect().index(x, y)] = note();
        }
    }

    /// Adds a run to what is to be traced: whose samples they are, and at which pixel.
    fn add_run(&mut self, points: &PointSet, run: Run) {
        let end = run.start + run.len;
        let sampler = points.pixel(run.x, run.y, run.replicate);
        let key = ray_key(run.x, run.y, run.replicate);
        self.batch.ids.extend(PathId { sampler, index: run.first_index, key }, run.len);
        self.film_x.resize(end, run.x as f32 + 0.5);
        self.film_y.resize(end, run.y as f32 + 0.5);
        self.runs.push(run);
    }

    /// From pixels to positions on the film and the lens, and keys.
    fn place_samples(&mut self, job: &Job) {
        let n = self.film_x.len();
        let ids = &self.batch.ids;
        self.batch.rays.resize(n);
        simd::dispatch(FirstKeys { ids, out: &mut self.batch.rays.key });
        let [u, v] = &mut self.uv;
        // A single sample goes through the pixel's centre.
        if job.settings.spp > 1 {
            u.resize(n, 0.0);
            v.resize(n, 0.0);
            points_2d(&ids.samplers, &ids.indices, Dim::FILTER, u, v);
            job.settings.filter.add_offsets([u, v], [&mut self.film_x, &mut self.film_y]);
        }
        if job.scene.camera.has_lens() {
            self.lens_u.resize(n, 0.5);
            self.lens_v.resize(n, 0.5);
            points_2d(&ids.samplers, &ids.indices, Dim::LENS, &mut self.lens_u, &mut self.lens_v);
        }
    }

    /// Makes the camera rays of what has been gathered.
    fn aim(&mut self, job: &Job) {
        self.place_samples(job);
        let samples =
            FilmSamples { x: &self.film_x, y: &self.film_y, lens_u: &self.lens_u, lens_v: &self.lens_v };
        job.scene.camera.fill_rays(&samples, &mut self.batch.rays);
    }

    /// The camera rays of the first `n` samples from one on, no more than a batch, as its tile has them; and their places on
    /// the film.
    pub fn aim_at(&mut self, job: &Job, sample: SampleId, n: usize) -> (&CameraBatch, [&[f32]; 2]) {
        self.start_batch(job);
        let SampleId { x, y, replicate, index } = sample;
        let outlined = job.outlines.filter(|o| o.pixels.contains(x, y));
        self.batch.times = outlined.map_or(1, |o| o.pixels.times());
        let points = outlined.map_or(job.points, |o| o.points);
        self.forget();
        self.add_run(&points, Run { x, y, replicate, first_index: index, start: 0, len: n.min(BATCH) });
        self.aim(job);
        (&self.batch, [&self.film_x, &self.film_y])
    }

    fn start_batch(&mut self, job: &Job) {
        self.batch.spread = job.scene.camera.pixel_spread();
        self.batch.want_first = self.layers.has(Combine::Mean);
        self.batch.times = 1;
    }

    fn forget(&mut self) {
        self.runs.clear();
        self.film_x.clear();
        self.film_y.clear();
        self.batch.ids.clear();
    }

    /// Traces what has been gathered and adds it to the tile.
    fn flush(&mut self, job: &Job) {
        if self.film_x.is_empty() {
            return;
        }
        self.aim(job);
        job.integrator.trace(job.scene, &self.batch, &mut self.work, &mut self.results);
        let runs = std::mem::take(&mut self.runs);
        for run in &runs {
            self.collect(run, job);
        }
        self.runs = runs;
        self.forget();
    }

    /// Adds a run's results to the tile.
    fn collect(&mut self, run: &Run, job: &Job) {
        let range = run.start..run.start + run.len;
        let (li, alpha) = (&self.results.li[range.clone()], &self.results.alpha[range.clone()]);
        let bad = self.film.add_run(run.x, run.y, run.replicate as usize, li, alpha);
        if run.first_index == 0 && !self.notes.is_empty() {
            let kind = if self.batch.times > 1 { Kind::Outline } else { Kind::Plain };
            self.notes[self.film.rect().index(run.x, run.y)] = Note::of(li, alpha, kind);
        }
        if bad > 0 {
            self.report_bad(run);
        }
        if self.batch.want_first {
            for hit in self.results.first[range].iter().flatten() {
                self.layers.add(run.x, run.y, hit, Combine::Mean, job.scene);
            }
        }
    }

    /// Adds what rays through the pixels' centres, and the lens's, meet.
    fn look_at_centres(&mut self, job: &Job, rect: PixelRect) {
        let pixels: Vec<(u32, u32)> = rect.pixels().collect();
        for pixels in pixels.chunks(BATCH) {
            let (x, y): (Vec<f32>, Vec<f32>) =
                pixels.iter().map(|&(x, y)| (x as f32 + 0.5, y as f32 + 0.5)).unzip();
            let middle = vec![0.5; if job.scene.camera.has_lens() { pixels.len() } else { 0 }];
            let samples = FilmSamples { x: &x, y: &y, lens_u: &middle, lens_v: &middle };
            let rays = &mut self.batch.rays;
            rays.resize(pixels.len());
            pixels.iter().zip(&mut rays.key).for_each(|(&(x, y), key)| *key = ray_key(x, y, 1));
            job.scene.camera.fill_rays(&samples, rays);
            self.work.counts.camera += pixels.len() as u64;
            job.scene.kernel.intersect_batch(rays, &mut self.work.hits, Coherence::Coherent);
            for (i, &(x, y)) in pixels.iter().enumerate() {
                if let Some(hit) = self.work.hits.get(i) {
                    let vertex = job.scene.vertex(&rays.get(i), hit, self.batch.spread);
                    self.layers.add(x, y, &FirstHit::new(job.scene, vertex), Combine::Centre, job.scene);
                }
            }
        }
    }

    /// Keeps which samples of a run are not finite, the first few: no number aborts a render.
    #[cold]
    fn report_bad(&mut self, run: &Run) {
        let li = &self.results.li[run.start..run.start + run.len];
        let bad = (run.first_index..).zip(li).filter(|(_, radiance)| !radiance.is_finite());
        for (index, _) in bad.take(8usize.saturating_sub(self.bad.len())) {
            self.bad.push(SampleId { x: run.x, y: run.y, replicate: run.replicate, index });
        }
    }
}
