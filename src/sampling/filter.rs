//! Pixel filters, by importance sampling: a sample's position is drawn from the filter itself, so every sample counts
//! with weight one for one pixel alone (Ernst, Stamminger, Greiner, "Filter Importance Sampling", 2006). All filters
//! here are positive, which makes that exact.

use std::str::FromStr;
use std::sync::LazyLock;

use glam::Vec2;

use super::warp::tent;
use crate::error::{Error, Result, unknown_name};
use crate::math::simd::{Kernel, dispatch};
use crate::math::trig::sin_cos_2pi_f64;

/// How samples are spread about a pixel's centre; the same in x and y, independently.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PixelFilter {
    /// The four-term Blackman-Harris window (Harris, "On the Use of Windows for Harmonic Analysis with the Discrete
    /// Fourier Transform", 1978), zero from `radius` pixels on. At 1.5, the default, it is all but a Gaussian with a
    /// standard deviation of 0.42 pixels; the same window of the same width is the default of Blender's Cycles.
    BlackmanHarris {
        /// Half width, pixels, at least 0.
        radius: f32,
    },
    /// The pixel's own square.
    Box,
    /// Nothing but the pixel's centre: edges stay jagged, as in pictures of programs that do the same.
    Center,
    /// 1 - |x| / radius: at 1, linear interpolation.
    Tent {
        /// Half width, pixels, at least 0.
        radius: f32,
    },
}

impl Default for PixelFilter {
    fn default() -> Self {
        PixelFilter::BlackmanHarris { radius: 1.5 }
    }
}

impl PixelFilter {
    /// Names as the command line and scene files spell them, each with its filter at its usual width.
    pub const NAMES: [(&'static str, PixelFilter); 4] = [
        ("blackman-harris", PixelFilter::BlackmanHarris { radius: 1.5 }),
        ("box", PixelFilter::Box),
        ("tent", PixelFilter::Tent { radius: 1.0 }),
        ("center", PixelFilter::Center),
    ];

    /// The name of this kind of filter.
    pub fn name(self) -> &'static str {
        match self {
            PixelFilter::BlackmanHarris { .. } => "blackman-harris",
            PixelFilter::Box => "box",
            PixelFilter::Tent { .. } => "tent",
            PixelFilter::Center => "center",
        }
    }

    /// One line for people.
    pub fn doc(self) -> &'static str {
        match self {
            PixelFilter::BlackmanHarris { .. } => {
                "Blackman-Harris window, half width 1.5 pixels: sharp without ringing"
            }
            PixelFilter::Box => "the pixel's own square",
            PixelFilter::Tent { .. } => "linear fall-off, half width 1 pixel",
            PixelFilter::Center => "the pixel's centre alone, without anti-aliasing",
        }
    }

    /// Half width in pixels: no sample lies farther from the centre in x or y.
    pub fn radius(self) -> f32 {
        match self {
            PixelFilter::BlackmanHarris { radius } | PixelFilter::Tent { radius } => radius,
            PixelFilter::Box => 0.5,
            PixelFilter::Center => 0.0,
        }
    }

    /// How much an offset of `x` pixels along one axis counts, next to others: the density of [`PixelFilter::sample`], not
    /// normalised.
    pub fn density(self, x: f32) -> f32 {
        let inside = x.abs() <= self.radius();
        match self {
            _ if !inside => 0.0,
            PixelFilter::BlackmanHarris { radius } => window(f64::from(x / radius)) as f32,
            PixelFilter::Tent { radius } => 1.0 - x.abs() / radius,
            PixelFilter::Box | PixelFilter::Center => 1.0,
        }
    }

    /// Adds [`PixelFilter::sample`] of each point of the unit square to a position. All columns are of one length.
    pub fn add_offsets(self, u: [&[f32]; 2], p: [&mut [f32]; 2]) {
        for (u, p) in u.into_iter().zip(p) {
            dispatch(AddOffsets { filter: self, u, p });
        }
    }

    /// Offset from the pixel's centre, in pixels, for `u` in the unit square. Continuous, and monotone in each
    /// coordinate; (1/2, 1/2) is the centre.
    #[inline]
    pub fn sample(self, u: Vec2) -> Vec2 {
        match self {
            PixelFilter::BlackmanHarris { radius } => {
                let table = &*BLACKMAN_HARRIS;
                Vec2::new(table.sample(u.x), table.sample(u.y)) * radius
            }
            PixelFilter::Box => u - Vec2::splat(0.5),
            PixelFilter::Tent { radius } => Vec2::new(tent(u.x), tent(u.y)) * radius,
            PixelFilter::Center => Vec2::ZERO,
        }
    }
}

impl FromStr for PixelFilter {
    type Err = Error;

    fn from_str(s: &str) -> Result<Self> {
        let found = Self::NAMES.iter().find(|(name, _)| *name == s);
        let known = Self::NAMES.iter().map(|(name, _)| *name);
        found.map(|(_, filter)| *filter).ok_or_else(|| Error::Usage(unknown_name("filter", s, known)))
    }
}

/// One axis of [`PixelFilter::add_offsets`].
struct AddOffsets<'a> {
    filter: PixelFilter,
    u: &'a [f32],
    p: &'a mut [f32],
}

impl Kernel for AddOffsets<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let all = self.p.iter_mut().zip(self.u);
        match self.filter {
            PixelFilter::BlackmanHarris { radius } => {
                let table = &*BLACKMAN_HARRIS;
                all.for_each(|(p, &u)| *p += table.sample(u) * radius);
            }
            PixelFilter::Box => all.for_each(|(p, &u)| *p += u - 0.5),
            PixelFilter::Tent { radius } => all.for_each(|(p, &u)| *p += tent(u) * radius),
            PixelFilter::Center => {}
        }
    }
}

/// Steps of the table below.
const STEPS: usize = 1024;

/// The positive half of a symmetric filter of half width 1, as x by the share of the half's mass below it. Between
/// entries x is interpolated linearly: the filter in use is a step function with 2048 steps of equal mass, which
/// differs from the window by less than 0.1 % of its mass.
struct HalfTable([f32; STEPS + 1]);

static BLACKMAN_HARRIS: LazyLock<HalfTable> = LazyLock::new(|| {
    let mut x = 0.0;
    HalfTable(std::array::from_fn(|i| {
        let share = i as f64 / STEPS as f64;
        // Newton's method inside a bracket: the window falls to 6e-5 at its end, where bare Newton would overshoot.
        let (mut low, mut high) = (x, 1.0);
        for _ in 0..60 {
            let error = 2.0 * half_mass(x) - share;
            (low, high) = if error > 0.0 { (low, x) } else { (x, high) };
            let next = x - error / (2.0 * window(x));
            x = if next > low && next < high { next } else { 0.5 * (low + high) };
        }
        // The ends are exact, whatever the last digit of the search.
        if i % STEPS == 0 { share as f32 } else { x as f32 }
    }))
});

/// Coefficients of the window, Harris 1978, table 1 (92 dB).
const A: [f64; 4] = [0.358_75, 0.488_29, 0.141_28, 0.011_68];

/// The window about 0 with half width 1, normalised to integrate to 1.
fn window(x: f64) -> f64 {
    let term = |k: usize| A[k] * sin_cos_2pi_f64(0.5 * k as f64 * x).cos;
    (A[0] + term(1) + term(2) + term(3)) / (2.0 * A[0])
}

/// Integral of [`window`] from 0 to x.
fn half_mass(x: f64) -> f64 {
    let pi = std::f64::consts::PI;
    let term = |k: usize| A[k] * sin_cos_2pi_f64(0.5 * k as f64 * x).sin / (k as f64 * pi);
    (A[0] * x + term(1) + term(2) + term(3)) / (2.0 * A[0])
}

impl HalfTable {
    #[inline(always)]
    fn sample(&self, u: f32) -> f32 {
        let v = 2.0 * u - 1.0;
        let at = v.abs() * STEPS as f32;
        let i = (at as usize).min(STEPS - 1);
        let (a, b) = (self.0[i], self.0[i + 1]);
        (a + (b - a) * (at - i as f32)).copysign(v)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [PixelFilter; 3] =
        [PixelFilter::BlackmanHarris { radius: 1.5 }, PixelFilter::Box, PixelFilter::Tent { radius: 2.0 }];

    #[test]
    fn samples_are_monotone_symmetric_and_inside() {
        for filter in ALL {
            let n = 20_000;
            let mut last = -filter.radius();
            for i in 0..=n {
                let u = i as f32 / n as f32;
                let p = filter.sample(Vec2::new(u, 0.5));
                assert!(p.x >= last && p.x <= filter.radius() && p.y == 0.0, "{filter:?} {u} {p}");
                // 1 - u is rounded, and the tails are steep.
                let mirrored = filter.sample(Vec2::new(1.0 - u, 0.5)).x;
                assert!((p.x + mirrored).abs() < 1e-3, "{filter:?} {u} {p} {mirrored}");
                last = p.x;
            }
            // The extreme steps of a 24-bit number stay inside.
            for u in [0.0, crate::sampler::ONE_MINUS_EPSILON] {
                assert!(filter.sample(Vec2::splat(u)).abs().max_element() <= filter.radius());
            }
        }
    }

    /// Moments against closed forms. For the window: E x^2 of each cosine term by parts,
    /// int_-1^1 x^2 cos(k pi x) dx = 4 (-1)^k / (k pi)^2.
    #[test]
    fn variances_are_those_of_the_filters() {
        let pi2 = std::f64::consts::PI.powi(2);
        let window_variance =
            (A[0] * 2.0 / 3.0 + 4.0 / pi2 * (-A[1] + A[2] / 4.0 - A[3] / 9.0)) / (2.0 * A[0]);
        let wanted = [window_variance * 2.25, 1.0 / 12.0, 4.0 / 6.0];
        for (filter, want) in ALL.into_iter().zip(wanted) {
            let n = 200_000;
            let square = |i: i32| {
                let u = (f64::from(i) + 0.5) / f64::from(n);
                f64::from(filter.sample(Vec2::new(0.5, u as f32)).y).powi(2)
            };
            let got = (0..n).map(square).sum::<f64>() / f64::from(n);
            // The steps of the tabulated window: 1e-3 of its mass moved within the tail.
            assert!((got / want - 1.0).abs() < 2e-3, "{filter:?} {got} {want}");
        }
    }

    #[test]
    fn window_table_follows_the_window() {
        let table = &*BLACKMAN_HARRIS;
        for i in 0..STEPS {
            assert!(table.0[i + 1] > table.0[i]);
            let mass = half_mass(f64::from(table.0[i + 1])) - half_mass(f64::from(table.0[i]));
            // Each step holds the same mass, to the rounding of its ends to f32.
            assert!((mass * 2.0 * STEPS as f64 - 1.0).abs() < 2e-3, "{i}: {mass}");
        }
        assert!((half_mass(1.0) - 0.5).abs() < 1e-15 && (2.0 * A[0] * window(0.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn names_parse() {
        for (name, filter) in PixelFilter::NAMES {
            assert_eq!(name.parse::<PixelFilter>().unwrap(), filter);
            assert_eq!(filter.name(), name);
        }
        assert!("gauss".parse::<PixelFilter>().unwrap_err().to_string().contains("blackman-harris"));
    }
}
