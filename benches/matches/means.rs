//! Picture means.

use super::picture::Pixels;

/// The largest relative difference of the three channels' means, as a fraction, with its sign. Channels without light
/// on both sides do not differ.
pub fn relative_difference(ours: &Pixels, reference: &Pixels) -> f64 {
    let (a, b) = (ours.means(), reference.means());
    let difference = |c: usize| match b[c] {
        0.0 if a[c] == 0.0 => 0.0,
        0.0 => f64::INFINITY,
        b => a[c] / b - 1.0,
    };
    [0, 1, 2]
        .map(difference)
        .into_iter()
        .fold(0.0, |most: f64, d| if d.abs() > most.abs() { d } else { most })
}
