//! What is known of the colours before anything is filtered: which pixels are sound, how bright their surroundings
//! are, and how noisy.

use super::plane::Size;
use super::weights::Guide;
use super::{Halves, LUMINANCE};

/// A value is an outlier if it is so many times brighter than all that the other half has nearby.
const OUTLIER_FACTOR: f32 = 10.0;

/// Nearby: pixels to each side.
const OUTLIER_RADIUS: usize = 2;

/// In units of the picture's level: larger values are outliers whatever is near, as their squares leave `f32`.
const LARGEST: f32 = 1e9;

/// Darker surroundings count as this bright, in units of the picture's level.
const DARKEST: f32 = 1e-3;

/// Noise below this share of the brightness is taken for none.
const SMALLEST_NOISE: f32 = 1e-4;

/// What can be done with a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum State {
    /// Both halves are finite.
    Sound,
    /// Both are finite, but one has nothing like it around.
    Outlier,
    /// At least one half is not finite.
    Broken,
}

/// Colours made ready.
pub(super) struct Prepared {
    pub size: Size,
    /// The picture's level: a power of two, so that dividing by it and multiplying again changes no bit.
    pub unit: f32,
    /// Each half divided by `unit`; black where the pixel is not sound.
    pub halves: [Vec<[f32; 3]>; 2],
    pub states: Vec<State>,
    /// Whether a pixel is [`State::Sound`].
    pub sound: Vec<bool>,
    /// Brightness of a pixel's surroundings, in units; positive.
    pub scale: Vec<f32>,
    /// Variance of one half, summed over channels, in units squared; positive.
    pub variance: Vec<f32>,
}

impl Prepared {
    pub fn new(input: &Halves) -> Self {
        let size = Size { width: input.width, height: input.height };
        let unit = level(input);
        let states = states(input, size, unit);
        let sound: Vec<bool> = states.iter().map(|&s| s == State::Sound).collect();
        let halves = input.color.map(|half| {
            let scaled = half.iter().zip(&sound);
            scaled.map(|(c, &sound)| if sound { c.map(|v| v / unit) } else { [0.0; 3] }).collect()
        });
        let scale = scales(size, &halves, &sound);
        let variance = variances(size, &halves, &sound, &scale);
        Prepared { size, unit, halves, states, sound, scale, variance }
    }

    /// For weights between pixels.
    pub fn guide(&self) -> Guide {
        let channel = |half: &Vec<[f32; 3]>, c: usize| self.size.pad(|i| half[i][c]);
        Guide {
            size: self.size,
            halves: self.halves.each_ref().map(|half| (0..3).map(|c| channel(half, c)).collect()),
            variance: self.size.pad(|i| self.variance[i]),
            comparable: self.size.pad(|i| f32::from(u8::from(self.sound[i]))),
        }
    }
}

/// Rec. 709 luminance of a colour's magnitude.
fn magnitude(c: [f32; 3]) -> f32 {
    c.iter().zip(LUMINANCE).map(|(v, w)| v.abs() * w).sum()
}

/// Geometric mean over the pixels that are not black, to the nearest power of two. A mean of logarithms, because one
/// firefly must not decide what counts as bright.
fn level(input: &Halves) -> f32 {
    let lit = (0..input.width * input.height)
        .filter_map(|i| input.plain(i))
        .map(magnitude)
        .filter(|&v| v > 0.0 && v.is_finite());
    let (sum, n) = lit.fold((0.0, 0usize), |(sum, n), v| (sum + f64::from(v).log2(), n + 1));
    // Within these ends, neither the unit nor its reciprocal leaves f32.
    if n == 0 { 1.0 } else { (sum / n as f64).round().clamp(-100.0, 100.0).exp2() as f32 }
}

/// A value is held against the *other* half: there, neither it nor others of its kind hide what is usual.
fn states(input: &Halves, size: Size, unit: f32) -> Vec<State> {
    let finite = |i: usize| input.color.iter().all(|half| half[i].iter().all(|v| v.is_finite()));
    let brightness = input.color.map(|half| -> Vec<f32> {
        half.iter()
            .enumerate()
            .map(|(i, &c)| if finite(i) { magnitude(c.map(|v| v / unit)) } else { 0.0 })
            .collect()
    });
    let usual = brightness.each_ref().map(|half| box_maxima(size, half));
    let stands_out = |i: usize, a: usize| {
        let v = brightness[a][i];
        v > OUTLIER_FACTOR * usual[1 - a][i].max(1.0)
            || input.color[a][i].iter().any(|c| c.abs() / unit > LARGEST)
    };
    let state = |i| match (finite(i), stands_out(i, 0) || stands_out(i, 1)) {
        (false, _) => State::Broken,
        (true, true) => State::Outlier,
        (true, false) => State::Sound,
    };
    (0..size.area()).map(state).collect()
}

fn box_maxima(size: Size, values: &[f32]) -> Vec<f32> {
    let Size { width, height } = size;
    let around =
        |at: usize, end: usize| at.saturating_sub(OUTLIER_RADIUS)..(at + OUTLIER_RADIUS + 1).min(end);
    let largest = |it: &mut dyn Iterator<Item = f32>| it.fold(0.0, f32::max);
    let across: Vec<f32> = (0..size.area())
        .map(|i| largest(&mut around(i % width, width).map(|x| values[i - i % width + x])))
        .collect();
    (0..size.area())
        .map(|i| largest(&mut around(i / width, height).map(|y| across[y * width + i % width])))
        .collect()
}

/// The median of 3 x 3 pixels: it does not smear the sun over the sky beside it, as a mean would. A pixel far
/// brighter than its median counts a third of itself.
fn scales(size: Size, halves: &[Vec<[f32; 3]>; 2], sound: &[bool]) -> Vec<f32> {
    let bright: Vec<f32> = (0..size.area()).map(|i| brightness(halves, i)).collect();
    let scale = |i: usize| {
        let (x, y) = (i % size.width, i / size.width);
        let mut near = [0.0; 9];
        let mut n = 0;
        for y in y.saturating_sub(1)..(y + 2).min(size.height) {
            for x in x.saturating_sub(1)..(x + 2).min(size.width) {
                let j = y * size.width + x;
                if sound[j] {
                    near[n] = bright[j];
                    n += 1;
                }
            }
        }
        near[..n].sort_unstable_by(f32::total_cmp);
        let median = if n == 0 { 0.0 } else { near[n / 2] };
        median.max(bright[i] / 3.0).max(DARKEST)
    };
    (0..size.area()).map(scale).collect()
}

/// Two values have one degree of freedom, so they are pooled, as shares of the brightness: noise beside the sun is
/// not the sun's. Where an edge makes a pixel brighter than its surroundings, its own brightness counts. Pools of 7
/// x 7 have little noise; those of 3 x 3 say where noise ends, say at a clean sky.
fn variances(size: Size, halves: &[Vec<[f32; 3]>; 2], sound: &[bool], scale: &[f32]) -> Vec<f32> {
    let own: Vec<f32> = (0..size.area()).map(|i| scale[i].max(brightness(halves, i))).collect();
    let relative: Vec<f32> = (0..size.area())
        .map(|i| {
            let squares = (0..3).map(|c| (halves[0][i][c] - halves[1][i][c]) / own[i]).map(|d| d * d);
            squares.sum::<f32>() / 2.0
        })
        .collect();
    let pooled = pooled(size, &relative, sound);
    let floor = 3.0 * SMALLEST_NOISE * SMALLEST_NOISE;
    pooled.iter().zip(own).map(|(&v, s)| v.max(floor) * s * s).collect()
}

/// Mean magnitude over channels and halves.
fn brightness(halves: &[Vec<[f32; 3]>; 2], pixel: usize) -> f32 {
    halves.iter().flat_map(|half| half[pixel]).map(f32::abs).sum::<f32>() / 6.0
}

/// Variances pooled over 7 x 7 pixels, yet at most four times what 3 x 3 have: with their nine degrees of freedom,
/// chance exceeds that about once in a thousand.
pub(super) fn pooled(size: Size, values: &[f32], sound: &[bool]) -> Vec<f32> {
    let wide = size.box_means(3, values, sound);
    let near = size.box_means(1, values, sound);
    let pool = |(wide, near): (Option<f32>, Option<f32>)| match (wide, near) {
        (Some(wide), Some(near)) => wide.min(4.0 * near),
        (wide, _) => wide.unwrap_or(0.0),
    };
    wide.into_iter().zip(near).map(pool).collect()
}
