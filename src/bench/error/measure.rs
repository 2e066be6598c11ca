//! How far a film is from the truth.

use crate::compare::metrics::EPSILON;
use crate::render::film::Film;
use serde::{Deserialize, Serialize};

/// A pixel is one of a surface where the reference's alpha is at least this.
const COVERED: f32 = 0.99;

/// Something for each set of pixels.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Sets<T> {
    /// All of the film.
    pub all: T,
    /// Those that surfaces cover wholly. All zero where there is none.
    pub surfaces: T,
}

/// Which pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PixelSet {
    /// See [`Sets::all`].
    #[default]
    All,
    /// See [`Sets::surfaces`].
    Surfaces,
}

impl<T> Sets<T> {
    /// That of one set.
    pub fn get(&self, set: PixelSet) -> &T {
        match set {
            PixelSet::All => &self.all,
            PixelSet::Surfaces => &self.surfaces,
        }
    }
}

/// Distances of a picture x from the reference r, over the pixels of a set.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Errors {
    /// Mean over pixels and channels of (x - r)^2.
    pub mse: f64,
    /// Mean over pixels and channels of (x - r)^2 / (r^2 + [`EPSILON`] m^2), m the mean luminance of the whole film.
    pub relmse: f64,
    /// Mean over pixels of the luminance of x - r.
    pub bias: f64,
}

/// What the reference's own variance adds to [`Errors`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Noise {
    /// See [`Errors::mse`].
    pub mse: f64,
    /// See [`Errors::relmse`].
    pub relmse: f64,
}

/// Linear colours with what is known of their variance.
#[derive(Debug, Clone, PartialEq)]
pub struct Truth {
    /// By pixel, row by row.
    pub rgb: Vec<[f32; 3]>,
    /// By pixel.
    pub alpha: Vec<f32>,
    /// Variance of `rgb`, unbiased, or its average over neighbours.
    pub variance: Option<Vec<[f32; 3]>>,
}

fn luminance(c: [f64; 3]) -> f64 {
    0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]
}

/// Sums over one set.
#[derive(Default)]
struct Sums {
    pixels: u64,
    squares: f64,
    relative: f64,
    luminance: f64,
}

impl Sums {
    /// Adds a pixel with squared differences `d2` where the reference is `r`.
    fn add(&mut self, d2: [f64; 3], r: [f32; 3], floor: f64) {
        self.pixels += 1;
        for (d2, r) in d2.iter().zip(r) {
            self.squares += d2;
            // Where all is black, what differs is infinitely wrong, and what does not is right.
            let scale = f64::from(r).powi(2) + floor;
            self.relative += if *d2 > 0.0 { d2 / scale } else { 0.0 };
        }
    }

    fn errors(&self) -> Errors {
        let n = (self.pixels as f64).max(1.0);
        Errors { mse: self.squares / (3.0 * n), relmse: self.relative / (3.0 * n), bias: self.luminance / n }
    }
}

impl Truth {
    /// That of a film, with the variance of every pixel by itself.
    pub fn of_film(film: &Film) -> Self {
        let window = film.window();
        let variance = film.variance(0).map(|planes| {
            let [r, g, b] = planes;
            r.into_iter().zip(g).zip(b).map(|((r, g), b)| [r, g, b]).collect()
        });
        let rgb = window.pixels().map(|(x, y)| {
            let c = film.mean(x, y);
            [c.r, c.g, c.b]
        });
        let alpha = window.pixels().map(|(x, y)| film.alpha(x, y));
        Truth { rgb: rgb.collect(), alpha: alpha.collect(), variance }
    }

    /// Mean luminance.
    pub fn luminance(&self) -> f64 {
        let sum: f64 = self.rgb.iter().map(|c| luminance(c.map(f64::from))).sum();
        sum / (self.rgb.len() as f64).max(1.0)
    }

    /// Part of the pixels that surfaces cover.
    pub fn surfaces(&self) -> f64 {
        let covered = self.alpha.iter().filter(|a| **a >= COVERED).count();
        covered as f64 / (self.alpha.len() as f64).max(1.0)
    }

    /// How far `test` is, as many pixels as this has.
    pub fn errors(&self, test: &Truth) -> Sets<Errors> {
        self.over_sets(|i, sums, floor| {
            let (x, r) = (test.rgb[i], self.rgb[i]);
            let d: [f64; 3] = std::array::from_fn(|c| f64::from(x[c]) - f64::from(r[c]));
            sums.add(d.map(|d| d * d), r, floor);
            sums.luminance += luminance(d);
        })
    }

    /// What its own variance adds to every error.
    pub fn noise(&self) -> Option<Sets<Noise>> {
        let variance = self.variance.as_ref()?;
        let sums = self.over_sets(|i, sums, floor| sums.add(variance[i].map(f64::from), self.rgb[i], floor));
        let noise = |e: Errors| Noise { mse: e.mse, relmse: e.relmse };
        Some(Sets { all: noise(sums.all), surfaces: noise(sums.surfaces) })
    }

    fn over_sets(&self, add: impl Fn(usize, &mut Sums, f64)) -> Sets<Errors> {
        let floor = EPSILON * self.luminance().powi(2);
        let mut sums = Sets::<Sums>::default();
        for (i, alpha) in self.alpha.iter().enumerate() {
            add(i, &mut sums.all, floor);
            if *alpha >= COVERED {
                add(i, &mut sums.surfaces, floor);
            }
        }
        Sets { all: sums.all.errors(), surfaces: sums.surfaces.errors() }
    }
}
