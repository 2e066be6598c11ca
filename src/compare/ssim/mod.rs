//! Structural similarity: Wang, Bovik, Sheikh, Simoncelli 2004, "Image Quality Assessment: From Error Visibility to
//! Structural Similarity", with the settings of scikit-image's `structural_similarity`; and over several scales: Wang,
//! Simoncelli, Bovik 2003, "Multi-Scale Structural Similarity for Image Quality Assessment".
//!
//! All moments are f64 and summed anew for each pixel, so variances keep their digits in bright flat parts. Sums are in an
//! order that depends on the size of the picture alone.

mod scales;
#[cfg(test)]
mod tests;
mod tile;

pub use scales::{MultiScale, WEIGHTS, multi_scale};

use crate::error::{Error, Result};
use rayon::prelude::*;
use tile::{Pair, Scratch, TILE};

/// What a pixel's surroundings are weighed by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Window {
    /// A Gaussian, cut off at `truncate` times `sigma` (in pixels), rounded to the nearest pixel.
    Gaussian {
        /// Standard deviation in pixels.
        sigma: f64,
        /// Radius in standard deviations.
        truncate: f64,
    },
    /// A square of this odd side, weights equal.
    Uniform {
        /// In pixels.
        side: usize,
    },
}

impl Window {
    /// Pixels from the middle to the edge.
    pub fn radius(self) -> usize {
        match self {
            Window::Gaussian { sigma, truncate } => (truncate * sigma + 0.5) as usize,
            Window::Uniform { side } => side / 2,
        }
    }

    /// Weights along one direction, the middle first; they sum to 1.
    fn half(self) -> Vec<f64> {
        let weights: Vec<f64> = match self {
            Window::Gaussian { sigma, .. } => {
                (0..=self.radius()).map(|k| (-0.5 * (k as f64 / sigma).powi(2)).exp()).collect()
            }
            Window::Uniform { .. } => vec![1.0; self.radius() + 1],
        };
        let sum = weights[0] + 2.0 * weights[1..].iter().sum::<f64>();
        weights.iter().map(|w| w / sum).collect()
    }
}

/// Widest window that is accepted, as a radius in pixels.
pub const MAX_RADIUS: usize = 100;

/// How similarity is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// What surroundings are weighed by.
    pub window: Window,
    /// Largest less smallest value that there can be: 1 for displayed pictures.
    pub data_range: f64,
    /// Steadies the ratio of means; 0.01 in the paper.
    pub k1: f64,
    /// Steadies the ratio of variances; 0.03 in the paper.
    pub k2: f64,
    /// Whether variances are divided by one less than the number of pixels in the window, as scikit-image has it where it
    /// is not told otherwise (of a square; it takes the side of a Gaussian's square, too).
    pub sample_covariance: bool,
}

impl Default for Options {
    /// Wang's own settings, for values from 0 to 1.
    fn default() -> Self {
        Options {
            window: Window::Gaussian { sigma: 1.5, truncate: 3.5 },
            data_range: 1.0,
            k1: 0.01,
            k2: 0.03,
            sample_covariance: false,
        }
    }
}

impl Options {
    /// What scikit-image 0.26 does where it is told the range alone.
    pub fn scikit_image(data_range: f64) -> Self {
        let window = Window::Uniform { side: 7 };
        Options { window, data_range, sample_covariance: true, ..Options::default() }
    }

    fn check(&self) -> Result<()> {
        let usage = |message: String| Err(Error::Usage(message));
        let positive = |v: f64| v > 0.0 && v.is_finite();
        if ![self.data_range, self.k1, self.k2].into_iter().all(positive) {
            return usage(format!(
                "SSIM's range {}, K1 {} and K2 {} must be above zero and finite",
                self.data_range, self.k1, self.k2
            ));
        }
        let good = match self.window {
            Window::Gaussian { sigma, truncate } => positive(sigma) && positive(truncate),
            Window::Uniform { side } => side % 2 == 1,
        };
        if !good || self.window.radius() > MAX_RADIUS {
            return usage(format!(
                "SSIM's window {:?} is none: an odd side, or sigma and truncation above zero, up to {MAX_RADIUS} pixels \
                 from its middle",
                self.window
            ));
        }
        Ok(())
    }
}

/// Structural similarity of two pictures of `C` channels.
#[derive(Debug, Clone, PartialEq)]
pub struct Ssim<const C: usize> {
    /// Similarity around each pixel, from -1 to 1, the mean of the channels; row-major. Beyond the edges, the picture is
    /// mirrored.
    pub map: Vec<f32>,
    /// Mean similarity of each channel, over the pixels whose window is within the picture: as scikit-image has it.
    pub channels: [f64; C],
    /// Mean of `channels`.
    pub mean: f64,
    /// Mean of the second factor alone, contrast and structure, of each channel.
    pub contrast: [f64; C],
}

/// Structural similarity of `test` and `reference`: finite pixels, row-major, width and height are `size`.
///
/// # Errors
/// Settings that make no sense; pictures that are not of this size, or smaller than the window.
pub fn ssim<const C: usize>(
    size: [usize; 2],
    reference: &[[f32; C]],
    test: &[[f32; C]],
    options: &Options,
) -> Result<Ssim<C>> {
    options.check()?;
    let pixels = size[0] * size[1];
    if reference.len() != pixels || test.len() != pixels {
        return Err(Error::Usage(format!(
            "SSIM compares pictures of {}x{}, not of {} and {} pixels",
            size[0],
            size[1],
            reference.len(),
            test.len()
        )));
    }
    let side = 2 * options.window.radius() + 1;
    if size[0].min(size[1]) < side {
        return Err(Error::Usage(format!(
            "SSIM looks at {side}x{side} pixels around each: a picture of {}x{} is too small",
            size[0], size[1]
        )));
    }
    Ok(measure(size, reference, test, options))
}

/// As [`ssim`], of pictures that are large enough.
fn measure<T, const C: usize>(
    size: [usize; 2],
    reference: &[[T; C]],
    test: &[[T; C]],
    options: &Options,
) -> Ssim<C>
where
    T: Copy + Into<f64> + Sync,
{
    let pair = Pair::new(size, [reference, test], options);
    let [width, height] = size;
    let mut map = vec![0.0f32; width * height];
    let bands = map.par_chunks_mut(width * TILE[1]).enumerate();
    let sums: Vec<Vec<[[f64; 2]; C]>> = bands
        .map(|(band, map)| {
            let columns: Vec<usize> = (0..width).step_by(TILE[0]).collect();
            let tiles: Vec<_> = columns
                .par_iter()
                .map_init(Scratch::default, |scratch, &x| {
                    let sums = scratch.run(&pair, [x, band * TILE[1]]);
                    (sums, scratch.map().to_vec(), scratch.width())
                })
                .collect();
            for (x, (_, tile, padded)) in columns.iter().zip(&tiles) {
                let n = TILE[0].min(width - x);
                for (y, row) in tile.chunks_exact(*padded).enumerate() {
                    map[y * width + x..][..n].copy_from_slice(&row[..n]);
                }
            }
            tiles.into_iter().map(|t| t.0).collect()
        })
        .collect();
    let radius = options.window.radius();
    let inside = ((width - 2 * radius) * (height - 2 * radius)) as f64;
    let mean = |c: usize, which: usize| sums.iter().flatten().map(|s| s[c][which]).sum::<f64>() / inside;
    let channels: [f64; C] = std::array::from_fn(|c| mean(c, 0));
    Ssim {
        map,
        channels,
        mean: channels.iter().sum::<f64>() / C as f64,
        contrast: std::array::from_fn(|c| mean(c, 1)),
    }
}
