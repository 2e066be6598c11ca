//! Normal equations of a row of pixels, side by side, and their solution.

use super::super::MAX_FEATURES;
use super::super::plane::{LANES, Lanes, add_product, product};
use super::FITS;

/// Unknowns of the largest fit: the mean, and slopes for features and for the two axes of the picture.
const MAX_UNKNOWNS: usize = MAX_FEATURES + 3;

/// Ridge as a share of what a feature varies: features that repeat one another stay solvable, and a slope loses no
/// more than this.
const RELATIVE_RIDGE: f64 = 1e-3;

/// Ridge in units of the usual deviation, squared: what varies less is rounding.
const ABSOLUTE_RIDGE: f64 = 1e-8;

/// Weighted least squares for [`LANES`] pixels and [`FITS`] fits. The unknowns are the colour at the pixel and a
/// slope for each feature.
///
/// The sums are `f32`: features are taken relative to the pixel's own, so that nothing large cancels, and with a
/// ridge of 1e-3 the 361 roundings of 6e-8 do not matter. What is solved is `f64`.
pub(super) struct Equations {
    unknowns: usize,
    /// Lower triangle, row by row.
    gram: Vec<[Lanes; FITS]>,
    /// By channel and unknown; the solution after [`Equations::solve`].
    right: Vec<[Lanes; FITS]>,
}

impl Equations {
    pub fn new(unknowns: usize) -> Self {
        let zero = [[0.0; LANES]; FITS];
        Equations {
            unknowns,
            gram: vec![zero; unknowns * (unknowns + 1) / 2],
            right: vec![zero; 3 * unknowns],
        }
    }

    pub fn clear(&mut self) {
        self.gram.as_flattened_mut().as_flattened_mut().fill(0.0);
        self.right.as_flattened_mut().as_flattened_mut().fill(0.0);
    }

    /// Adds one neighbour of each pixel: `rows` of the system, weights by fit, colours by half and channel.
    pub fn add(&mut self, rows: &[Lanes], weights: &[Lanes; FITS], colors: [[&Lanes; 3]; 2]) {
        let mut cells = self.gram.iter_mut();
        for (i, a) in rows.iter().enumerate() {
            for (b, cell) in rows[..=i].iter().zip(&mut cells) {
                let term = product(a, b);
                for (sum, w) in cell.iter_mut().zip(weights) {
                    add_product(sum, w, &term);
                }
            }
        }
        for (i, row) in rows.iter().enumerate() {
            for channel in 0..3 {
                let sums = &mut self.right[channel * self.unknowns + i];
                let terms = colors.each_ref().map(|half| product(row, half[channel]));
                for (fit, (sum, w)) in sums.iter_mut().zip(weights).enumerate() {
                    add_product(sum, w, &terms[fit / 2]);
                }
            }
        }
    }

    /// Replaces the right sides of a lane by the solutions; `noise` is the variance of a feature's error, which a
    /// slope must not be fitted to.
    pub fn solve(&mut self, lane: usize, noise: impl Fn(usize) -> f32) {
        for fit in 0..FITS {
            let total = f64::from(self.gram[0][fit][lane]);
            if total > 0.0 {
                self.solve_fit(lane, fit, 1.0 / total, &noise);
            }
        }
    }

    fn solve_fit(&mut self, lane: usize, fit: usize, scale: f64, noise: &impl Fn(usize) -> f32) {
        let n = self.unknowns;
        let mut lower = [[0.0; MAX_UNKNOWNS]; MAX_UNKNOWNS];
        let mut inverse = [0.0; MAX_UNKNOWNS];
        // Cholesky. The first unknown is the mean, so that afterwards the diagonal holds variances about it.
        for i in 0..n {
            for j in 0..=i {
                let mut sum = f64::from(self.gram[i * (i + 1) / 2 + j][fit][lane]) * scale;
                if i == j && i > 0 {
                    let variance = (sum - lower[i][0] * lower[i][0]).max(0.0);
                    sum += RELATIVE_RIDGE * variance + f64::from(noise(i - 1)) + ABSOLUTE_RIDGE;
                }
                sum -= lower[i][..j].iter().zip(&lower[j]).map(|(a, b)| a * b).sum::<f64>();
                if j < i {
                    lower[i][j] = sum * inverse[j];
                } else if sum > ABSOLUTE_RIDGE * 1e-3 {
                    lower[i][i] = sum.sqrt();
                    inverse[i] = 1.0 / lower[i][i];
                }
                // Else rounding has eaten the ridge: with an inverse of zero, the slope is zero.
            }
        }
        for channel in 0..3 {
            let right = &mut self.right[channel * n..][..n];
            let mut x = [0.0; MAX_UNKNOWNS];
            for i in 0..n {
                let known: f64 = (0..i).map(|k| lower[i][k] * x[k]).sum();
                x[i] = (f64::from(right[i][fit][lane]) * scale - known) * inverse[i];
            }
            for i in (0..n).rev() {
                let known: f64 = (i + 1..n).map(|k| lower[k][i] * x[k]).sum();
                x[i] = (x[i] - known) * inverse[i];
                right[i][fit][lane] = x[i] as f32;
            }
        }
    }

    /// What the solutions say where the features differ by `rows`.
    #[inline]
    pub fn predict(&self, fit: usize, channel: usize, rows: &[Lanes]) -> Lanes {
        let mut sum = [0.0; LANES];
        for (slope, row) in self.right[channel * self.unknowns..].iter().zip(rows) {
            add_product(&mut sum, &slope[fit], row);
        }
        sum
    }
}
