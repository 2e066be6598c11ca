//! Means over tiles of 16x16 pixels, against the noise of both pictures.

use super::picture::Pixels;

/// Side of a tile, pixels.
pub const SIDE: usize = 16;

/// What two pictures may differ by beside their noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Allowed {
    /// As a fraction of the reference's mean over the tile.
    pub relative: f64,
    /// In the reference's unit.
    pub absolute: f64,
    /// Standard errors are this many times those of independent pixels.
    pub correlation: f64,
}

/// Differences of tile means over what they may be, a standard error each.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Scores {
    /// Root mean square over all tiles and channels: 1 where noise is all there is, less where more is allowed.
    pub rms: f64,
    /// The largest.
    pub worst: f64,
    /// Left top pixel of the tile with the largest.
    pub at: [usize; 2],
    /// Tiles.
    pub count: usize,
}

/// Scores of all full tiles. The noise of a tile's difference is that of its pixels' differences (255 degrees of
/// freedom; it holds the noise of both pictures, and edges that are filtered in two ways), and never less than our own,
/// whose variances are given by pixel, in the pictures' unit.
pub fn scores(
    ours: &Pixels,
    reference: &Pixels,
    variances: Option<&[[f32; 3]]>,
    allowed: &Allowed,
) -> Scores {
    let mut all = Scores::default();
    let mut square = 0.0;
    for y in (0..ours.height / SIDE).map(|t| t * SIDE) {
        for x in (0..ours.width / SIDE).map(|t| t * SIDE) {
            all.count += 1;
            for c in 0..3 {
                let z = score(ours, reference, variances, allowed, [x, y, c]);
                square += z * z;
                if z.abs() > all.worst.abs() {
                    (all.worst, all.at) = (z, [x, y]);
                }
            }
        }
    }
    all.rms = (square / (3 * all.count).max(1) as f64).sqrt();
    all
}

/// One tile's score in one channel.
fn score(
    ours: &Pixels,
    reference: &Pixels,
    variances: Option<&[[f32; 3]]>,
    allowed: &Allowed,
    [x, y, c]: [usize; 3],
) -> f64 {
    const N: f64 = (SIDE * SIDE) as f64;
    let (mut sum, mut square, mut level, mut own) = (0.0, 0.0, 0.0, 0.0);
    for i in (y..y + SIDE).flat_map(|y| (x..x + SIDE).map(move |x| y * ours.width + x)) {
        let theirs = f64::from(reference.data[i][c]);
        let d = f64::from(ours.data[i][c]) - theirs;
        sum += d;
        square += d * d;
        level += theirs;
        own += variances.map_or(0.0, |v| f64::from(v[i][c]));
    }
    let mean = sum / N;
    let paired = (square / N - mean * mean).max(0.0) / (N - 1.0);
    let noise = paired.max(own / (N * N)) * allowed.correlation.powi(2);
    let room = (allowed.relative * level / N).powi(2) + allowed.absolute.powi(2);
    match noise + room {
        0.0 if mean == 0.0 => 0.0,
        total => mean / total.sqrt(),
    }
}
