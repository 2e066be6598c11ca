//! A test of every pixel's difference against the differences around it.

use super::picture::Pixels;

/// Half the side of the neighbourhood: 24 other pixels.
const RADIUS: usize = 2;

/// The share of pixels and channels whose difference is more than three times the root mean square of those around it
/// and of `absolute`. With normal noise of one strength this is 0.6 % (Student's t, 24 degrees of freedom).
pub fn outliers(ours: &Pixels, reference: &Pixels, absolute: f64) -> f64 {
    let (w, h) = (ours.width, ours.height);
    let difference = |i: usize, c: usize| f64::from(ours.data[i][c]) - f64::from(reference.data[i][c]);
    let mut out = 0usize;
    for i in 0..w * h {
        let (x, y) = (i % w, i / w);
        let (xs, ys) = (
            x.saturating_sub(RADIUS)..w.min(x + RADIUS + 1),
            y.saturating_sub(RADIUS)..h.min(y + RADIUS + 1),
        );
        for c in 0..3 {
            let (mut square, mut n) = (0.0, 0.0);
            for j in ys.clone().flat_map(|y| xs.clone().map(move |x| y * w + x)).filter(|j| *j != i) {
                square += difference(j, c).powi(2);
                n += 1.0;
            }
            let room = square / f64::max(n, 1.0) + absolute * absolute;
            out += usize::from(difference(i, c).powi(2) > 9.0 * room);
        }
    }
    out as f64 / (3 * w * h).max(1) as f64
}
