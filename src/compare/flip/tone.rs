//! Exposures and tone curves of HDR-FLIP: Andersson et al. 2021, "Visualizing Errors in Rendered High Dynamic Range
//! Images", section 3.

use super::Planes;
use super::colour::unit;
use crate::error::{Error, Result};
use crate::math::rank;
use rayon::prelude::*;

/// How radiance is shown before it is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ToneMapper {
    /// Narkowicz' fit of ACES, without its exposure of 0.6.
    #[default]
    Aces,
    /// Hable's curve.
    Hable,
    /// Division by one plus luminance: Reinhard et al. 2002.
    Reinhard,
}

impl ToneMapper {
    /// All of them.
    pub const ALL: [ToneMapper; 3] = [ToneMapper::Aces, ToneMapper::Hable, ToneMapper::Reinhard];

    /// Its name: that of the reference implementation.
    pub fn name(self) -> &'static str {
        match self {
            ToneMapper::Aces => "aces",
            ToneMapper::Hable => "hable",
            ToneMapper::Reinhard => "reinhard",
        }
    }

    /// `k` of the curve (k0 x^2 + k1 x + k2) / (k3 x^2 + k4 x + k5); for [`ToneMapper::Reinhard`] of luminance alone.
    fn curve(self) -> [f32; 6] {
        match self {
            ToneMapper::Aces => [0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.0, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14],
            ToneMapper::Hable => [0.231_683, 0.013_791, 0.0, 0.18, 0.3, 0.018],
            ToneMapper::Reinhard => [0.0, 1.0, 0.0, 0.0, 1.0, 1.0],
        }
    }

    /// The radiance that is shown as 0.85: what exposures are measured by.
    fn bright(self) -> f32 {
        const SHOWN: f32 = 0.85;
        let k = self.curve();
        let [a, b, c] = [k[0] - SHOWN * k[3], k[1] - SHOWN * k[4], k[2] - SHOWN * k[5]];
        if a == 0.0 {
            return -c / b;
        }
        let half = -0.5 * (b / a);
        half + (half * half - c / a).sqrt()
    }

    /// What is shown of radiance, linear in [0, 1].
    #[inline(always)]
    pub(super) fn shown(self, [r, g, b]: [f32; 3]) -> [f32; 3] {
        // The square of anything larger would be infinite, and the curve NaN.
        let tame = |v: f32| if v < 1e15 { v } else { 1e15 };
        let [r, g, b] = [tame(r), tame(g), tame(b)];
        if self == ToneMapper::Reinhard {
            let factor = 1.0 / (1.0 + luminance([r, g, b]));
            return [unit(r * factor), unit(g * factor), unit(b * factor)];
        }
        let k = self.curve();
        let of = |v: f32| {
            let square = v * v;
            unit((square * k[0] + v * k[1] + k[2]) / (square * k[3] + v * k[4] + k[5]))
        };
        [of(r), of(g), of(b)]
    }
}

/// Relative luminance of linear Rec. 709.
#[inline(always)]
fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// What HDR-FLIP is to do; `Default` is what the reference implementation does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HdrOptions {
    /// Pixels per degree of visual angle.
    pub ppd: f32,
    /// First exposure, in stops; where it is open, that which shows the reference's largest luminance as 0.85.
    pub start: Option<f32>,
    /// Last exposure, in stops; where it is open, that which shows the reference's median luminance as 0.85.
    pub stop: Option<f32>,
    /// How many; where it is open, one a stop, at least 2.
    pub exposures: Option<u32>,
    /// How radiance is shown.
    pub tone_mapper: ToneMapper,
}

impl Default for HdrOptions {
    fn default() -> Self {
        HdrOptions {
            ppd: super::DEFAULT_PPD,
            start: None,
            stop: None,
            exposures: None,
            tone_mapper: ToneMapper::default(),
        }
    }
}

/// More exposures than this are a mistake: f32 has 277 stops.
pub const MAX_EXPOSURES: u32 = 1000;

/// The exposures of a comparison, in stops, evenly from the first to the last: those asked for, else by the reference
/// picture. Its luminances below 2^-23 count as that where they are the largest or the median, so that a black reference has
/// exposures, too: the reference implementation refuses one.
pub(super) fn exposures(options: &HdrOptions, reference: Planes) -> Result<Vec<f32>> {
    let usage = |message: String| Err(Error::Usage(message));
    let (mut start, mut stop) = (options.start, options.stop);
    if let Some(bad) = [start, stop].into_iter().flatten().find(|e| e.is_nan() || e.abs() > 128.0) {
        return usage(format!("exposures of HDR-FLIP are from -128 to 128 stops, not {bad}"));
    }
    if start.is_none() || stop.is_none() {
        let bright = options.tone_mapper.bright();
        let [r, g, b] = reference;
        let of = |i: usize| luminance([r[i], g[i], b[i]]);
        let luminances: Vec<f32> = (0..r.len()).into_par_iter().with_min_len(1 << 14).map(of).collect();
        let median = rank::nth(&luminances, luminances.len() / 2).max(f32::EPSILON);
        let largest = luminances.par_iter().copied().reduce(|| median, f32::max);
        let stops = |luminance: f32| f64::from(bright / luminance).log2() as f32;
        let both = [stops(largest), stops(median)];
        start = start.or_else(|| Some(stop.map_or(both[0], |stop| both[0].min(stop))));
        stop = stop.or_else(|| start.map(|start| both[1].max(start)));
    }
    let (start, stop) = (start.unwrap_or_default(), stop.unwrap_or_default());
    if start > stop {
        return usage(format!("HDR-FLIP's first exposure of {start} is above its last, {stop}"));
    }
    let count = options.exposures.unwrap_or(((stop - start).ceil() as u32).max(2));
    if !(1..=MAX_EXPOSURES).contains(&count) {
        return usage(format!("HDR-FLIP takes from 1 to {MAX_EXPOSURES} exposures, not {count}"));
    }
    // The reference implementation divides by zero where there is but one.
    let step = if count > 1 { (stop - start) / (count - 1) as f32 } else { 0.0 };
    Ok((0..count).map(|i| start + i as f32 * step).collect())
}
