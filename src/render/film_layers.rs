//! Layers that the film itself gives: what its sums say beside the picture.

use super::film::{Film, Half};
use crate::image::picture::{Picture, SampleKind};

/// A layer of the film.
pub struct FilmLayer {
    /// Name on the command line and prefix of its channels in a file.
    pub name: &'static str,
    /// One line for `skylit list`.
    pub doc: &'static str,
    /// Whether it shows [`super::settings::RenderSettings::moments`].
    pub needs_moments: bool,
    /// Whether pixels must have points of their own, so that the errors of sums over pixels can be told from it:
    /// [`crate::sampler::Sampler::OwenSobol`] instead of [`crate::sampler::Sampler::ZSobol`].
    pub needs_independence: bool,
    /// Adds its planes.
    pub push: fn(&Film, &mut Picture),
}

/// Pixels around each over which variance estimates are pooled: one degree of freedom a pixel is too noisy to read.
const VARIANCE_RADIUS: u32 = 2;

/// The layer of replicates: for each of two halves `a` and `b` of a pixel's samples, which are independent of each other and
/// of other pixels', the mean radiance (`halves.a.R`, `.G`, `.B`) and how many they are (`halves.a.N`). The pixel is their mean
/// weighted by these numbers. Where a half has no sample, both have 0.
pub const HALVES: &str = "halves";

/// Every layer of the film.
pub static REGISTRY: &[FilmLayer] = &[
    FilmLayer {
        name: "variance",
        doc: "variance of the pixel's mean, by channel, from two half-buffers, pooled over 5 x 5 pixels",
        needs_moments: true,
        needs_independence: false,
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
        needs_independence: false,
        push: |film, picture| {
            let counts = film.window().pixels().map(|(x, y)| film.sample_count(x, y) as f32).collect();
            picture.push("spp.V", SampleKind::Float, counts);
        },
    },
    FilmLayer {
        name: HALVES,
        doc: "means and numbers of two independent halves of the pixel's samples, from which `skylit compare --statistical` knows the noise",
        needs_moments: true,
        needs_independence: true,
        push: push_halves,
    },
];

fn push_halves(film: &Film, picture: &mut Picture) {
    let halves: Vec<_> = film.window().pixels().map(|(x, y)| film.halves(x, y)).collect();
    if halves.iter().all(Option::is_none) {
        log::warn!("no halves: each needs a sample, so give at least --spp 2");
        return;
    }
    for (h, name) in ["a", "b"].into_iter().enumerate() {
        let mut push = |channel: &str, value: &dyn Fn(&Half) -> f32| {
            let data = halves.iter().map(|pair| pair.as_ref().map_or(0.0, |pair| value(&pair[h]))).collect();
            picture.push(format!("{HALVES}.{name}.{channel}"), SampleKind::Float, data);
        };
        for (c, channel) in ["R", "G", "B"].into_iter().enumerate() {
            push(channel, &|half| half.mean[c] as f32);
        }
        push("N", &|half| half.count as f32);
    }
}
