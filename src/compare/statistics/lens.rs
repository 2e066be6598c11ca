//! In which directions of colour there is noise, and how much an item counts along each.

use super::matrix::{Mat, dot, eigen, quadratic};
use super::pair::{Item, LUMINANCE};

/// Variances below this part of the squared tolerance of rounding are none.
const ROUNDING: f64 = 1.0 / 16.0;

/// Mixtures of channels that are told by themselves: red, green, blue, luminance.
pub const CONTRASTS: [[f64; 3]; 4] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], LUMINANCE];

/// How covariances and fourth moments are read.
pub struct Lens {
    /// Rows that make noise round: p of them.
    pub white: Vec<[f64; 3]>,
    /// What items of either side count along each of them: multiplies them.
    pub counts: Vec<[f64; 2]>,
    /// The same along each of [`CONTRASTS`].
    pub contrast_counts: [[f64; 2]; 4],
    /// Unit vectors, in scaled channels, of the directions without noise.
    pub dropped: Vec<[f64; 3]>,
    scale: [f64; 3],
}

/// What items of either side count, given their variances along some direction. Where one picture has far fewer samples,
/// its noise is at least what the other's foretells: that of samples alike falls as 1 / n or faster. Its own estimate may
/// have missed what is rare, and would then make the other's rare finds look significant; and as skewed noise is brighter
/// where it is larger, a picture that is too dark would have too little of it.
fn counts([of_reference, of_test]: [f64; 2], ratio: Option<f64>) -> [f64; 2] {
    match ratio {
        Some(r) if r > 1.0 && r * of_test > of_reference => [0.0, (1.0 + r).sqrt()],
        Some(r) if r < 1.0 && of_reference > r * of_test => [(1.0 + 1.0 / r).sqrt(), 0.0],
        _ => [1.0, 1.0],
    }
}

impl Lens {
    /// From the covariances of either side's items, what rounding may do to each channel (squared), how many times the
    /// reference's samples the test has where they are unlike, and whether channels are looked at together.
    pub fn new(covariance: &[Mat; 2], rounding: &[f64; 3], ratio: Option<f64>, joint: bool) -> Self {
        let scale = rounding.map(|r| (ROUNDING * r).sqrt().max(1e-100));
        let along = |v: [f64; 3]| counts(covariance.map(|m| quadratic(&m, v)), ratio);
        let mut lens = Lens {
            white: Vec::new(),
            counts: Vec::new(),
            contrast_counts: CONTRASTS.map(along),
            dropped: Vec::new(),
            scale,
        };
        if !joint {
            lens.push(LUMINANCE, covariance, ratio);
            return lens;
        }
        // Of the test's variance so much that both sides weigh alike where their noise is as their samples foretell.
        let mut scaled: Mat = [[0.0; 3]; 3];
        for (side, weight) in [1.0, ratio.unwrap_or(1.0)].into_iter().enumerate() {
            for (i, j) in (0..9).map(|k| (k / 3, k % 3)) {
                scaled[i][j] += weight * covariance[side][i][j] / (scale[i] * scale[j]);
            }
        }
        let mut rows = Vec::new();
        for e in eigen(&scaled) {
            if e.value >= 1.0 && e.value.is_finite() {
                rows.push([0, 1, 2].map(|c| e.vector[c] / (scale[c] * e.value.sqrt())));
            } else {
                lens.dropped.push(e.vector);
            }
        }
        // Within what is round for the sum, the directions in which the reference alone is.
        let mut of_reference: Mat = [[0.0; 3]; 3];
        for (i, j) in (0..9).map(|k| (k / 3, k % 3)) {
            if let (Some(a), Some(b)) = (rows.get(i), rows.get(j)) {
                of_reference[i][j] = dot(covariance[0].map(|row| dot(row, *b)), *a);
            } else if i == j {
                // Last, and left out.
                of_reference[i][j] = -1.0;
            }
        }
        for e in eigen(&of_reference).into_iter().take(rows.len()) {
            let row = [0, 1, 2].map(|c| rows.iter().zip(e.vector).map(|(row, v)| v * row[c]).sum());
            lens.push(row, covariance, ratio);
        }
        lens
    }

    /// One more direction, brought to variance 1.
    fn push(&mut self, along: [f64; 3], covariance: &[Mat; 2], ratio: Option<f64>) {
        let variances = covariance.map(|m| quadratic(&m, along).max(0.0));
        let counts = counts(variances, ratio);
        let variance: f64 = (0..2).map(|side| variances[side] * counts[side] * counts[side]).sum();
        if variance > 0.0 {
            self.white.push(along.map(|c| c / variance.sqrt()));
            self.counts.push(counts);
        }
    }

    /// Whether a pixel's difference reaches, beyond rounding, into directions without noise; the pixel's own items do not:
    /// beside a very bright pixel, whose rounding is coarse, there may be more noise in others than that.
    pub fn leaves(&self, difference: [f64; 3], items: &[Item], tolerance: [f64; 3]) -> bool {
        let along = |u: &[f64; 3], v: [f64; 3]| (0..3).map(|c| u[c] * v[c] / self.scale[c]).sum::<f64>();
        let most = |u: &[f64; 3]| (0..3).map(|c| u[c].abs() * tolerance[c] / self.scale[c]).sum::<f64>();
        self.dropped.iter().any(|u| {
            let reaches = |v: [f64; 3]| along(u, v).abs() > 2.0 * most(u);
            reaches(difference) && !items.iter().any(|i| reaches(i.value))
        })
    }
}

/// Degrees of freedom, see [`super::region`]: `q2` is the sum over the pixels' items. Items of whole pictures are alike, so that their side's f is known:
/// it adds tr(O^2) + (tr O)^2 over its number to the denominator.
pub fn freedom(white: &[[f64; 3]], counts: &[[f64; 2]], q2: f64, whole: &[(Item, f64)]) -> f64 {
    let rank = white.len();
    if rank == 0 {
        return 0.0;
    }
    let p = rank as f64;
    if whole.is_empty() {
        return (p * (p + 2.0) / q2 - 2.0).max(p);
    }
    let mut below = q2 * (p + 1.0) / (p + 2.0);
    for side in [false, true] {
        let mine: Vec<_> = whole.iter().filter(|(i, _)| i.of_test == side).collect();
        let Some((_, n)) = mine.first() else { continue };
        // O in white coordinates.
        let mut o = vec![vec![0.0; rank]; rank];
        for (item, _) in &mine {
            let rows = white.iter().zip(counts);
            let z: Vec<f64> = rows.map(|(w, c)| c[usize::from(side)] * dot(*w, item.value)).collect();
            (0..rank * rank).for_each(|i| o[i / rank][i % rank] += z[i / rank] * z[i % rank]);
        }
        let trace: f64 = (0..rank).map(|i| o[i][i]).sum();
        let squares: f64 = o.iter().flatten().map(|v| v * v).sum();
        below += (squares + trace * trace) / n;
    }
    ((p + p * p) / below).max(p)
}
