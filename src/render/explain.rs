//! One sample of one pixel, as the render takes it: what it adds to the film, and what its path went through.

mod asked;

pub use asked::{Answer, Asked};

use super::backdrop::Backdrop;
use super::block::{BATCH, Job, SampleId, Worker};
use super::film::TILE_SIDE;
use super::prelude::Prelude;
use super::{Renderer, dealing};
use crate::base::pixel_rect::PixelRect;
use crate::base::ray::Ray;
use crate::color::Rgb;
use crate::error::{Error, Result};
use crate::integrators::story::Story;
use crate::integrators::{PathResults, Workspace};
use crate::scene::Scene;

/// Most samples of a pixel among which the brightest is looked for: some seconds' work.
const MOST_LOOKED_AT: u64 = 1 << 20;

/// Which of a pixel's samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Which {
    /// By number, from 0. Where samples have two randomisations (replicates), they take turns. A pixel that an outline runs
    /// through has several samples for each of another's, which follow one another.
    Number(u64),
    /// The one with the largest radiance (or one that is not finite), of as many as the pixel has if all have as many.
    Brightest,
}

/// How many samples a pixel takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Count {
    /// If all pixels have as many.
    pub evenly: u64,
    /// Whether what was sampled decides, so that there may be fewer or more.
    pub decided: bool,
    /// For each of another pixel: more than 1 where an outline runs through.
    pub times: u32,
    /// The radiance that stands for all of them, where the pixel sees no geometry and needs none.
    pub spared: Option<Rgb>,
}

/// A sample and its path.
pub struct Explained {
    /// Its number.
    pub number: u64,
    /// Where its numbers come from.
    pub id: SampleId,
    /// How many the pixel takes.
    pub count: Count,
    /// Where on the film it lies, in pixels from the left top.
    pub place: [f32; 2],
    /// What it adds to the film.
    pub radiance: Rgb,
    /// See [`PathResults::alpha`].
    pub alpha: f32,
    /// What the integrator decided beforehand.
    pub decided: String,
    /// Every ray in order, with the kernel's answer.
    pub rays: Vec<(Ray, Answer)>,
    /// What it went through, from integrators that tell.
    pub story: Option<Story>,
}

/// Tells of samples of one render, which is prepared once.
pub struct Explainer<'a> {
    renderer: &'a Renderer,
    scene: &'a Scene,
    asked: &'a Asked,
    found: Prelude,
}

impl<'a> Explainer<'a> {
    /// Prepares a render as [`Renderer::render`] does; `asked` stands in the place of the scene's kernel.
    ///
    /// # Errors
    /// Those of a render.
    pub fn new(renderer: &'a Renderer, scene: &'a Scene, asked: &'a Asked) -> Result<Self> {
        renderer.check(scene)?;
        let found = renderer.in_pool(|| Prelude::new(renderer, scene))?;
        Ok(Explainer { renderer, scene, asked, found })
    }

    /// Takes one sample as the render does, and tells of it.
    ///
    /// # Errors
    /// A pixel outside of what is rendered, a sample that the pixel does not take; a failure inside a kernel's callbacks.
    pub fn explain(&self, [x, y]: [u32; 2], which: Which) -> Result<Explained> {
        let settings = &self.renderer.settings;
        let crop = settings.crop;
        if !crop.contains(x, y) {
            let [x1, y1] = [crop.x1, crop.y1].map(|v| v.saturating_sub(1));
            let message = format!(
                "pixel {x},{y} is not in the picture, which is x from {} to {x1} and y from {} to {y1}",
                crop.x0, crop.y0
            );
            return Err(Error::Usage(message));
        }
        let job = self.found.job(self.scene, settings);
        let count = self.count(&job, [x, y]);
        let id = |number| self.id(&count, [x, y], number);
        let mut taker = Taker { job: &job, worker: Worker::new(settings), out: PathResults::default() };
        let number = match which {
            Which::Number(number) => number,
            Which::Brightest if count.evenly > MOST_LOOKED_AT => {
                let message = format!(
                    "to find the worst sample takes a limit of samples: --spp up to {MOST_LOOKED_AT}"
                );
                return Err(Error::Usage(message));
            }
            Which::Brightest => taker.brightest(&count, id),
        };
        let most = self.most(&count);
        if number >= most {
            let message = format!("pixel {x},{y} takes at most {most} samples: --sample 0 to {}", most - 1);
            return Err(Error::Usage(message));
        }
        let id = id(number);
        self.asked.take();
        let (radiance, alpha, place) = taker.take(id);
        let rays = self.asked.take();
        let (batch, _) = taker.worker.aim_at(&job, id, 1);
        let story = job.integrator.tell(self.scene, batch, &mut Workspace::default());
        self.scene.kernel.take_failure()?;
        let decided = self.found.decided.clone();
        Ok(Explained { number, id, count, place, radiance, alpha, decided, rays, story })
    }

    /// The most samples that a pixel may take.
    fn most(&self, count: &Count) -> u64 {
        let dealt = self.renderer.settings.deals();
        let times = u64::from(count.times);
        if dealt { dealing::most_samples(self.renderer.settings.spp) * times } else { count.evenly }
    }

    fn count(&self, job: &Job, [x, y]: [u32; 2]) -> Count {
        let s = &self.renderer.settings;
        let times = job.outlines.filter(|o| o.pixels.contains(x, y)).map_or(1, |o| o.pixels.times());
        let spared = job.coverage.filter(|c| times == 1 && !c.is_covered(x, y)).and_then(|_| {
            let mut backdrop = Backdrop::default();
            let corner = |v: u32, first: u32| first + (v - first) / TILE_SIDE * TILE_SIDE;
            let [x0, y0] = [corner(x, s.crop.x0), corner(y, s.crop.y0)];
            let tile = PixelRect::new(x0, y0, x0 + TILE_SIDE, y0 + TILE_SIDE).intersection(&s.crop);
            backdrop.fill(job.scene, s.filter, tile);
            backdrop.get(x, y)
        });
        let decided = s.deals() || s.target.is_some() || s.time.is_some();
        Count { evenly: u64::from(s.spp) * u64::from(times), decided, times, spared }
    }

    /// See [`Which::Number`].
    fn id(&self, count: &Count, [x, y]: [u32; 2], number: u64) -> SampleId {
        let (times, replicates) = (u64::from(count.times), u64::from(self.renderer.settings.replicates()));
        let (of_pixel, within) = (number / times, number % times);
        SampleId {
            x,
            y,
            replicate: (of_pixel % replicates) as u32,
            index: (of_pixel / replicates * times + within) as u32,
        }
    }
}

/// Takes samples without a film.
struct Taker<'a> {
    job: &'a Job<'a>,
    worker: Worker,
    out: PathResults,
}

impl Taker<'_> {
    /// Radiance and alpha of one, and its place on the film.
    fn take(&mut self, id: SampleId) -> (Rgb, f32, [f32; 2]) {
        let (batch, [x, y]) = self.worker.aim_at(self.job, id, 1);
        let place = [x[0], y[0]];
        let mut work = Workspace::default();
        self.job.integrator.trace(self.job.scene, batch, &mut work, &mut self.out);
        (self.out.li[0], self.out.alpha[0], place)
    }

    /// The number of the brightest; what is not finite is brighter than all.
    fn brightest(&mut self, count: &Count, id: impl Fn(u64) -> SampleId) -> u64 {
        let mut work = Workspace::default();
        let (mut best, mut most) = (0, f32::NEG_INFINITY);
        let mut number = 0;
        while number < count.evenly {
            let first = id(number);
            // Those that follow one another in one randomisation.
            let mut n = 1;
            while n < BATCH as u64 && number + n < count.evenly {
                let next = id(number + n);
                if next.replicate != first.replicate || u64::from(next.index) != u64::from(first.index) + n {
                    break;
                }
                n += 1;
            }
            let (batch, _) = self.worker.aim_at(self.job, first, n as usize);
            self.job.integrator.trace(self.job.scene, batch, &mut work, &mut self.out);
            for (i, li) in (number..).zip(&self.out.li) {
                let luminance = if li.is_finite() { li.luminance() } else { f32::INFINITY };
                if luminance > most {
                    (best, most) = (i, luminance);
                }
            }
            number += n;
        }
        best
    }
}
