//! The same picture by each kernel: identical bits wherever all hits agree.

use super::Plan;
use crate::error::Result;
use crate::render::dealing::Dealing;
use crate::render::film::Film;
use crate::render::settings::RenderSettings;
use crate::render::{Progress, Renderer};
use crate::scene::Scene;
use std::collections::HashSet;
use std::sync::Arc;

/// See the module.
pub struct PictureCheck {
    /// One film a kernel.
    pub films: Vec<Film>,
    /// The pictures after the first, against it.
    pub against_first: Vec<PictureDifference>,
    /// Pixels in which kernels differ on a ray.
    pub marked: Vec<[u32; 2]>,
}

/// One picture against the first.
pub struct PictureDifference {
    /// The kernel.
    pub name: String,
    /// Pixels whose colour or alpha has other bits.
    pub pixels: Vec<[u32; 2]>,
    /// Those among them in which no kernel differs on any ray.
    pub unexplained: Vec<[u32; 2]>,
    /// The largest difference of a channel.
    pub largest: f32,
}

impl PictureCheck {
    /// From the films, the first first, and the pixels with a difference of hits.
    pub fn new(names: &[String], films: Vec<Film>, marked: &HashSet<[u32; 2]>) -> Self {
        let against_first = names.iter().zip(&films).skip(1);
        let against_first = against_first.map(|(name, film)| {
            let (pixels, unexplained) = differing(&films[0], film, marked);
            let largest = pixels.iter().map(|p| off(&films[0], film, *p)).fold(0.0, f32::max);
            PictureDifference { name: name.clone(), pixels, unexplained, largest }
        });
        let against_first = against_first.collect();
        let mut marked: Vec<[u32; 2]> = marked.iter().copied().collect();
        marked.sort_unstable_by_key(|[x, y]| (*y, *x));
        PictureCheck { films, against_first, marked }
    }

    /// Pixels that differ though no hit does.
    pub fn unexplained(&self) -> usize {
        self.against_first.iter().map(|d| d.unexplained.len()).sum()
    }
}

fn channels(film: &Film, [x, y]: [u32; 2]) -> [f32; 4] {
    let c = film.mean(x, y);
    [c.r, c.g, c.b, film.alpha(x, y)]
}

fn off(a: &Film, b: &Film, pixel: [u32; 2]) -> f32 {
    let (a, b) = (channels(a, pixel), channels(b, pixel));
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// The pixels in which two films of one window have other bits, and those of them that are not marked.
pub fn differing(a: &Film, b: &Film, marked: &HashSet<[u32; 2]>) -> (Vec<[u32; 2]>, Vec<[u32; 2]>) {
    let bits = |film: &Film, pixel| channels(film, pixel).map(f32::to_bits);
    let pixels = a.window().pixels().map(|(x, y)| [x, y]);
    let differing: Vec<[u32; 2]> = pixels.filter(|p| bits(a, *p) != bits(b, *p)).collect();
    let unexplained = differing.iter().filter(|p| !marked.contains(*p)).copied().collect();
    (differing, unexplained)
}

/// Settings under which every sample has the rays that are compared, by the integrator as it is, whoever renders it.
pub fn plain(settings: &RenderSettings) -> RenderSettings {
    RenderSettings {
        skip_background: false,
        pilot: false,
        outlines: Some(1),
        dealing: Dealing::Even,
        time: None,
        target: None,
        ..settings.clone()
    }
}

/// The picture by the scene's present kernel.
pub(super) fn render(scene: &Scene, plan: &Plan, progress: &dyn Progress) -> Result<Film> {
    let renderer = Renderer { integrator: Arc::clone(&plan.integrator), settings: plain(&plan.settings) };
    Ok(renderer.render(scene, &Onward(progress))?.film)
}

/// Goes on counting where another pass has begun.
struct Onward<'a>(&'a dyn Progress);

impl Progress for Onward<'_> {
    fn advance(&self, samples: u64) {
        self.0.advance(samples);
    }

    fn should_stop(&self) -> bool {
        self.0.should_stop()
    }
}
