//! FLIP, for what displays show and for radiance: Andersson et al. 2020, "FLIP: A Difference Evaluator for Alternating
//! Images", and 2021, "Visualizing Errors in Rendered High Dynamic Range Images". Parameters, borders (the pixels of the
//! edge go on) and exposures are those of the reference implementation, flip-evaluator 1.7.
//!
//! The picture is cut into tiles that fit a core's cache, and each is worked on at every exposure before the next.
//! Where both pictures look the same in and around a tile, there is nothing to do. Arithmetic is f32, in an order that
//! depends on nothing but the position of a pixel; sums are f64. So the bits do not depend on threads.
//!
//! Leaving out exposures of a tile whose differences are too small to matter there was tried, by bounds that are rigorous: one
//! bright or noisy pixel in 12,000 spoils them, so that they spared 7 % of the work (a picture with the sun in it, 18
//! exposures) and cost as much.

mod colour;
mod convolve;
mod kernels;
mod power;
#[cfg(test)]
mod summary;
#[cfg(test)]
pub(in crate::compare) mod tests;
mod tile;
mod tone;

pub use tone::{HdrOptions, MAX_EXPOSURES, ToneMapper};

use crate::error::{Error, Result};
use colour::Colours;
use kernels::Kernels;
use rayon::prelude::*;
use tile::{Display, Pair, Scratch, TILE};

/// Pixels per degree of visual angle at 0.7 m from a display 0.7 m wide that has 3840 of them.
pub const DEFAULT_PPD: f32 = 67.020_645;

/// More pixels per degree are refused: filters are 3 % of this wide, and nobody sees as much.
pub const MAX_PPD: f32 = 1000.0;

/// LDR-FLIP of two pictures.
#[derive(Debug, Clone, PartialEq)]
pub struct FlipMap {
    /// Error of each pixel, from 0 (no difference is seen) to 1; row-major.
    pub map: Vec<f32>,
    /// Its mean.
    pub mean: f64,
}

/// HDR-FLIP of two pictures.
#[derive(Debug, Clone, PartialEq)]
pub struct HdrFlipMap {
    /// Error of each pixel: the largest over exposures; row-major.
    pub map: Vec<f32>,
    /// At which of `exposures` each pixel's error was found, by number; 0 where it has none.
    pub which: Vec<u16>,
    /// The exposures, in stops, from the darkest picture to the brightest.
    pub exposures: Vec<f32>,
    /// Mean error.
    pub mean: f64,
}

/// Planes of red, green and blue; row-major.
pub type Planes<'a> = [&'a [f32]; 3];

/// LDR-FLIP of `test` against `reference`, sRGB-encoded pixels of finite values, which are clipped to [0, 1]. Width and
/// height are `size`; `ppd` are pixels per degree of visual angle, see [`DEFAULT_PPD`].
///
/// # Errors
/// Pixels per degree that are not above 0 and at most [`MAX_PPD`]; pictures that are empty or not of this size.
pub fn ldr(size: [usize; 2], reference: Planes, test: Planes, ppd: f32) -> Result<FlipMap> {
    let kernels = prepare(size, [reference, test], ppd)?;
    let colours = Colours::new();
    let display = Display::Encoded;
    let pair = Pair { size, pictures: [reference, test], display, kernels: &kernels, colours: &colours };
    let (map, _) = compare(&pair);
    Ok(FlipMap { mean: mean(&map, size[0]), map })
}

/// HDR-FLIP of `test` against `reference`, finite linear Rec. 709 radiance. Negative values pass through the tone curve, as
/// in the reference implementation; what that makes of them is clipped to [0, 1].
///
/// # Errors
/// As [`ldr`]; exposures beyond 128 stops, a first one above the last, none or more than [`MAX_EXPOSURES`].
pub fn hdr(size: [usize; 2], reference: Planes, test: Planes, options: &HdrOptions) -> Result<HdrFlipMap> {
    let kernels = prepare(size, [reference, test], options.ppd)?;
    let colours = Colours::new();
    let exposures = tone::exposures(options, reference)?;
    let display = Display::Radiance(&exposures, options.tone_mapper);
    let pair = Pair { size, pictures: [reference, test], display, kernels: &kernels, colours: &colours };
    let (map, which) = compare(&pair);
    Ok(HdrFlipMap { mean: mean(&map, size[0]), map, which, exposures })
}

fn prepare([width, height]: [usize; 2], pictures: [Planes; 2], ppd: f32) -> Result<Kernels> {
    if !(ppd > 0.0 && ppd <= MAX_PPD) {
        return Err(Error::Usage(format!(
            "pixels per degree are above 0 and at most {MAX_PPD}, not {ppd}; {DEFAULT_PPD} is usual"
        )));
    }
    let pixels = width * height;
    if pixels == 0 || pictures.iter().flatten().any(|p| p.len() != pixels) {
        let [a, b] = pictures.map(|p| p[0].len());
        return Err(Error::Usage(format!(
            "FLIP compares pictures of {width}x{height}, not of {a} and {b} pixels"
        )));
    }
    Ok(Kernels::new(f64::from(ppd)))
}

/// The map, and the number of the exposure for each pixel.
fn compare(pair: &Pair) -> (Vec<f32>, Vec<u16>) {
    let [width, height] = pair.size;
    let mut map = vec![0.0f32; width * height];
    let mut exposures = vec![0u16; width * height];
    let bands = map.par_chunks_mut(width * TILE[1]).zip(exposures.par_chunks_mut(width * TILE[1]));
    bands.enumerate().for_each(|(band, (map, exposures))| {
        let columns: Vec<usize> = (0..width).step_by(TILE[0]).collect();
        let tiles: Vec<(Vec<f32>, Vec<u16>, usize)> = columns
            .par_iter()
            .map_init(Scratch::default, |scratch, &x| {
                let found = scratch.run(pair, [x, band * TILE[1]]);
                let (errors, exposures) = (found.errors.clone(), found.exposures.clone());
                (errors, exposures, scratch.width())
            })
            .collect();
        for (x, (errors, which, padded)) in columns.iter().zip(tiles) {
            let n = TILE[0].min(width - x);
            for (y, row) in errors.chunks_exact(padded).enumerate() {
                map[y * width + x..][..n].copy_from_slice(&row[..n]);
            }
            for (y, row) in which.chunks_exact(padded).enumerate() {
                exposures[y * width + x..][..n].copy_from_slice(&row[..n]);
            }
        }
    });
    (map, exposures)
}

/// Rows are summed in f64, then their sums in order.
fn mean(map: &[f32], width: usize) -> f64 {
    let rows: Vec<f64> = map.par_chunks(width).map(|row| row.iter().map(|v| f64::from(*v)).sum()).collect();
    rows.iter().sum::<f64>() / map.len() as f64
}
