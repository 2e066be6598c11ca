//! Layers that the film itself gives: what its sums say beside the picture.

use super::film::Film;
use crate::image::picture::{Picture, SampleKind};

/// A layer of the film.
pub struct FilmLayer {
    /// Name on the command line and prefix of its channels in a file.
    pub name: &'static str,
    /// One line for `skylit list`.
    pub doc: &'static str,
    /// Whether it shows [`super::settings::RenderSettings::moments`].
    pub needs_moments: bool,
    /// Adds its planes.
    pub push: fn(&Film, &mut Picture),
}

/// Pixels around each over which variance estimates are pooled: one degree of freedom a pixel is too noisy to read.
const VARIANCE_RADIUS: u32 = 2;

/// Every layer of the film.
pub static REGISTRY: &[FilmLayer] = &[
    FilmLayer {
        name: "variance",
        doc: "variance of the pixel's mean, by channel, from two half-buffers, pooled over 5 x 5 pixels",
        needs_moments: true,
        push: |film, picture| {
            let Some(planes) = film.variance(VARIANCE_RADIUS) else {
                log::warn!("no variance: each half-buffer needs a sample, so give at least --spp 2");
                return;
            };
            for (channel, data) in ["R", "G", "B"].into_iter().zip(planes) {
                picture.push(format!("variance.{channel}"), SampleKind::Float, data);
            }
        },
    },
    FilmLayer {
        name: "spp",
        doc: "samples of the pixel",
        needs_moments: false,
        push: |film, picture| {
            let counts = film.window().pixels().map(|(x, y)| film.sample_count(x, y) as f32).collect();
            picture.push("spp.V", SampleKind::Float, counts);
        },
    },
];
