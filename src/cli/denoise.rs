//! `--denoise`: the picture without its noise, beside the picture.

use crate::color::Rgb;
use crate::error::{Error, Result};
use crate::image::denoise::{Halves, denoise};
use crate::image::picture::{Picture, Plane, SampleKind};
use crate::memory;
use crate::render::aov::AovRow;
use crate::render::film::Film;
use serde::Serialize;

/// Layers of the first surfaces that tell apart what noise must not join.
pub const FEATURES: [&str; 3] = ["albedo", "normal", "depth"];
/// The layer's name.
pub const LAYER: &str = "denoised";
/// Held at once for a pixel: halves, eight features before and after they are filtered, and three results with what is
/// known of each.
const BYTES_PER_PIXEL: u64 = 600;

/// What it did to the picture.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct DenoiseReport {
    /// Mean luminance after over that before.
    pub mean_ratio: f64,
    /// Estimated relative root mean square error over pixels and channels, as `--target-error` has it: of the picture, and
    /// of the layer with its bias.
    pub error_before: f64,
    /// See `error_before`.
    pub error_after: f64,
    /// Pixels far brighter in one half of their samples than all around are in the other; they stay as they are.
    pub outliers: usize,
}

/// Adds the layer to a picture that has those of [`FEATURES`].
///
/// # Errors
/// Too little memory.
pub fn add_layer(film: &Film, picture: &mut Picture) -> Result<DenoiseReport> {
    let window = film.window();
    let what = || format!("denoising {} x {} pixels", window.width(), window.height());
    let _room = memory::room(window.area() as u64 * BYTES_PER_PIXEL, what)?;
    let mut halves = [Vec::with_capacity(window.area()), Vec::with_capacity(window.area())];
    for (x, y) in window.pixels() {
        let means = film.halves(x, y).map(|h| h.map(|h| h.mean.map(|v| v as f32)));
        // What has no sample in a half is filled in from around.
        let means = means.unwrap_or([[f32::NAN; 3]; 2]);
        halves.iter_mut().zip(means).for_each(|(half, mean)| half.push(mean));
    }
    let features = features(picture);
    let input = Halves {
        width: picture.width,
        height: picture.height,
        color: [&halves[0], &halves[1]],
        features: features.iter().map(|f| [f.as_slice(); 2]).collect(),
    };
    let done = denoise(&input).map_err(|e| Error::Internal(format!("denoising: {e}")))?;
    let report = DenoiseReport {
        mean_ratio: done.bias(&input).ratio,
        error_before: relative_error(&done.color, |i, c| {
            f64::from(halves[0][i][c] - halves[1][i][c]).powi(2) / 4.0
        }),
        error_after: relative_error(&done.color, |i, c| f64::from(done.error[i][c])),
        outliers: done.outliers,
    };
    for (c, channel) in ["R", "G", "B"].into_iter().enumerate() {
        let data = done.color.iter().map(|v| v[c]).collect();
        picture.push(format!("{LAYER}.{channel}"), SampleKind::Half, data);
    }
    Ok(report)
}

/// Coverage and the layers that were rendered for it, misses marked. Of distance the logarithm: what a plane's colour
/// depends on changes with it about linearly near and far. They are taken to have no noise: below a lens or few samples at
/// outlines they have some, which the layer keeps.
fn features(picture: &Picture) -> Vec<Vec<f32>> {
    let channels = picture.planes.iter().filter(|p| {
        p.name == "A" || FEATURES.iter().any(|f| p.name.strip_prefix(f).is_some_and(|c| c.starts_with('.')))
    });
    let plane = |p: &Plane| match p.name.as_str() {
        "depth.Z" => p.data.iter().map(|z| if *z > 0.0 { z.ln() } else { f32::NAN }).collect(),
        _ => p.data.clone(),
    };
    channels.map(plane).collect()
}

/// Root of the mean of squared errors, each over the square of `color` and a hundredth of the squared mean luminance.
fn relative_error(color: &[[f32; 3]], square: impl Fn(usize, usize) -> f64) -> f64 {
    let n = color.len().max(1) as f64;
    let mean = color.iter().map(|c| f64::from(Rgb::from(*c).luminance())).sum::<f64>() / n;
    let floor = (0.01 * mean * mean).max(f64::MIN_POSITIVE);
    let all = color.iter().enumerate().flat_map(|(i, v)| (0..3).map(move |c| (i, c, f64::from(v[c]))));
    let terms = all.map(|(i, c, v)| square(i, c) / (v * v + floor)).filter(|t| t.is_finite());
    (terms.sum::<f64>() / (3.0 * n)).sqrt()
}

/// The picture that is shown where a file holds one alone: with the layer in the picture's place.
pub fn shown(picture: &Picture) -> Picture {
    let mut out = picture.clone();
    for channel in ["R", "G", "B"] {
        let from = picture.plane(&format!("{LAYER}.{channel}"));
        let to = out.planes.iter_mut().find(|p| p.name == channel);
        if let (Some(from), Some(to)) = (from, to) {
            to.data.clone_from(&from.data);
        }
    }
    out
}

/// Takes out the layers that only denoising asked for.
pub fn drop_unwanted(picture: &mut Picture, wanted: &[&AovRow]) {
    picture.planes.retain(|p| {
        let layer = p.name.split_once('.').map_or("", |(layer, _)| layer);
        !FEATURES.contains(&layer) || wanted.iter().any(|row| row.name == layer)
    });
}
