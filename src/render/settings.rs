//! What a render is told beside its scene.

use crate::base::pixel_rect::PixelRect;
use crate::error::{Error, Result};
use crate::render::adaptive::Target;
use crate::render::aov::AovRow;
use crate::render::dealing::{Dealing, LEAST_SPP};
use crate::render::film::REPLICATES;
use crate::sampler::{PointSet, Sampler};
use crate::sampling::filter::PixelFilter;
use crate::scene::desc::SceneDesc;
use std::time::Duration;

/// What [`RenderSettings::outlines`] is where the integrator gains by it: more would gain little, as the error of an edge falls
/// as the power 1.5 of samples.
pub const OUTLINES: u32 = 4;
/// Most of that.
pub const MOST_OUTLINES: u32 = 64;

/// Sets the points of outlines apart from those of other pixels.
const OUTLINE_SEED: u64 = 0x6f75_746c_696e_6573;

/// Settings of a render. Two renders with the same scene and settings give the same bits, whatever the threads.
#[derive(Clone)]
pub struct RenderSettings {
    /// Film size in pixels.
    pub size: [u32; 2],
    /// The part of the film that is rendered, pixels; all of it by default.
    pub crop: PixelRect,
    /// Samples a pixel, at least 1; with a time limit or a target, at most so many.
    pub spp: u32,
    /// Samples are taken until the picture is so good.
    pub target: Option<Target>,
    /// Rounds are started only while less than this has passed; the picture says how many samples it has.
    pub time: Option<Duration>,
    /// Seed of every random choice.
    pub seed: u64,
    /// Kind of sample points.
    pub sampler: Sampler,
    /// Pixel filter.
    pub filter: PixelFilter,
    /// Whether pixels that no geometry projects into get the filter's integral of what is behind everything, where that
    /// is known to a thousandth, instead of samples.
    pub skip_background: bool,
    /// How many samples, at most, pixels that outlines run through take for each of another; 1 if no more; None for what is
    /// best with the integrator. See [`super::outlines`].
    pub outlines: Option<u32>,
    /// Which pixels get how many samples, for the same cost in all. Other than even takes
    /// [`super::dealing::LEAST_SPP`] samples, and does not go with `moments`, `target` or `time`, which deal by rounds.
    pub dealing: Dealing,
    /// Whether the film shall know how large its error is: each pixel's samples are then two independent randomisations,
    /// which are less even together than one. Targets and time limits ask for that by themselves.
    pub moments: bool,
    /// Whether the integrator may try out beforehand what suits the scene.
    pub pilot: bool,
    /// Worker threads, at least 1.
    pub threads: usize,
    /// Further layers.
    pub aovs: Vec<&'static AovRow>,
}

/// Pixels whose left top corner lies in a window given by fractions of the film (x0, x1, y0, y1 in [0, 1], as pbrt's
/// `--cropwindow` takes them). Errors where it holds no pixel.
pub fn crop_window([x0, x1, y0, y1]: [f64; 4], size: [u32; 2]) -> Result<PixelRect> {
    let inside = |v: f64| (0.0..=1.0).contains(&v);
    if ![x0, x1, y0, y1].into_iter().all(inside) {
        return Err(Error::Usage("a crop window takes four numbers from 0 to 1: x0,x1,y0,y1".into()));
    }
    let at = |f: f64, n: u32| (f * f64::from(n)).ceil() as u32;
    let crop = PixelRect::new(at(x0, size[0]), at(y0, size[1]), at(x1, size[0]), at(y1, size[1]));
    if crop.area() == 0 {
        return Err(Error::Usage(format!(
            "the crop window holds no pixel of a {}x{} film: x0 < x1 and y0 < y1 are needed",
            size[0], size[1]
        )));
    }
    Ok(crop)
}

impl RenderSettings {
    /// Defaults for a film of `size`: 64 samples a pixel, all cores.
    pub fn new(size: [u32; 2]) -> Self {
        RenderSettings {
            size,
            crop: PixelRect::of_size(size[0], size[1]),
            spp: 64,
            target: None,
            time: None,
            seed: 0,
            sampler: Sampler::default(),
            filter: PixelFilter::default(),
            skip_background: true,
            outlines: None,
            dealing: Dealing::default(),
            moments: false,
            pilot: true,
            threads: std::thread::available_parallelism().map_or(1, |n| n.get()),
            aovs: Vec::new(),
        }
    }

    /// What a scene asks for, and the defaults for the rest.
    ///
    /// # Errors
    /// Names of samplers and filters that nothing has.
    pub fn of_scene(scene: &SceneDesc) -> Result<Self> {
        let (usual, given) = (RenderSettings::new(scene.film.size), &scene.render);
        Ok(RenderSettings {
            spp: given.spp.unwrap_or(usual.spp),
            seed: given.seed.unwrap_or(usual.seed),
            sampler: given.sampler.as_deref().map(str::parse).transpose()?.unwrap_or(usual.sampler),
            filter: given.filter.as_deref().map(str::parse).transpose()?.unwrap_or(usual.filter),
            ..usual
        })
    }

    /// Independent randomisations of a pixel's points, at most [`REPLICATES`].
    pub fn replicates(&self) -> u32 {
        if self.moments || self.has_rounds() { REPLICATES as u32 } else { 1 }
    }

    /// The sample points of all pixels.
    pub fn points(&self) -> PointSet {
        self.points_of(self.seed, 1)
    }

    /// Those of pixels that outlines run through, of which each takes so many `times` the samples of others.
    pub fn outline_points(&self, times: u32) -> PointSet {
        self.points_of(self.seed ^ OUTLINE_SEED, times)
    }

    fn points_of(&self, seed: u64, times: u32) -> PointSet {
        let count = self.spp.saturating_mul(times).div_ceil(self.replicates());
        let decides = self.has_rounds() || self.deals();
        self.sampler.points(seed, (!decides).then_some(count))
    }

    /// Whether samples are dealt by what pixels show.
    pub fn deals(&self) -> bool {
        self.dealing != Dealing::Even && self.spp >= LEAST_SPP && !self.moments && !self.has_rounds()
    }

    /// Whether what was sampled decides how many samples pixels get.
    fn has_rounds(&self) -> bool {
        self.target.is_some() || self.time.is_some()
    }

    /// Checks what the types cannot.
    pub fn check(&self) -> Result<()> {
        if self.size.contains(&0) {
            return Err(Error::Usage("the film needs at least one pixel in each direction".into()));
        }
        if self.spp == 0 {
            return Err(Error::Usage("at least one sample a pixel is needed (--spp 1)".into()));
        }
        if let Some(times) = self.outlines.filter(|times| !(1..=MOST_OUTLINES).contains(times)) {
            return Err(Error::Usage(format!(
                "pixels that outlines run through take 1 to {MOST_OUTLINES} times the samples of others, not {times}"
            )));
        }
        self.target.map_or(Ok(()), |t| t.check())
    }
}
