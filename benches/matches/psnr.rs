//! Peak signal-to-noise ratio of 8-bit values.

use super::picture::Pixels;

/// In decibels, for a range of 255; infinite for equal pictures.
pub fn psnr(ours: &Pixels, reference: &Pixels) -> f64 {
    let square = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>();
    let sum: f64 = ours.data.iter().zip(&reference.data).map(square).sum();
    10.0 * (255.0 * 255.0 * (3 * ours.data.len()) as f64 / sum).log10()
}
