//! Hotelling's test of the mean difference over some pixels, in all three channels at once.
//!
//! # The statistic
//!
//! D is the sum of the differences over the pixels, V the sum of the outer products of the items ([`super::pair::Item`]):
//! an unbiased estimate of the covariance of D. Where V has full rank, T^2 = D' V^-1 D asks for a difference in any mixture
//! of channels: a bias of brightness is as visible as one of hue, and correlated channels are not counted twice. Grey scenes
//! have a V of rank 1. So V is first scaled by what rounding may do to each channel; directions with less variance than
//! that are left out, and p is the number of those that stay.
//!
//! Where halves can be dealt anew, their covariance U over all deals takes the place of V (`exchange`): it is known,
//! and p goes by chi-square, until deals tell better. All below is for other pairs, and for the errors of
//! single channels. Such pairs' p is never better than chi-square's by [`Finding::careful`]: points are spread so evenly over
//! a pixel that both halves may find the same number of a sun's images, and V then knows nothing of them.
//!
//! # Degrees of freedom
//!
//! The items have unlike covariances W_i: the noise of a shadow's edge is not that of the floor. In the manner of Nel and
//! van der Merwe (1986), as Krishnamoorthy and Yu (2004) made it invariant, V goes as a Wishart matrix with
//! f = (p + p^2) / sum [tr(O_i^2) + (tr O_i)^2], O_i = W_i V^-1; then T^2 (f - p + 1) / (f p) follows F(p, f - p + 1).
//! The W_i are not known, but q_i = d_i' V^-1 d_i of an item d_i has E q_i^2 = 2 tr(O_i^2) + (tr O_i)^2, so that
//! f = p (p + 2) / sum q_i^2 for round O_i, and, as V is made of the same items,
//!
//! > f = p (p + 2) / sum q_i^2 - 2.
//!
//! That is exact for n alike normal items: q_i follows Beta(p / 2, (n - p) / 2), the mean of whose square makes f = n. For
//! one channel it is Satterthwaite's f with the factor 3 for the fourth moment of chi-square's root, 3 S^2 / Q - 2. As
//! q_i <= 1 and sum q_i = p, f is p at least, where p pixels have all the noise. Heavy tails raise the sum of q_i^2, and so
//! lower f: a pixel that outweighs all others is not taken for a significant one.

use super::distributions::{chi_square_tail, f_tail};
use super::exchange::whiten;
use super::lens::{CONTRASTS, Lens, freedom};
use super::matrix::{Mat, add_outer, dot, eigen, quadratic};
use super::pair::{Design, Item, Pair, Running, Use};
use super::replicates::Spread;
use rayon::prelude::*;

/// Pixels that are summed in one go; sums of such runs are added in order.
const RUN: usize = 4096;

/// From so many degrees of freedom of whole pictures on, their channels are looked at together; below, luminance alone.
const JOINT_FREEDOM: f64 = 8.0;

/// Pixels without noise that differ must be so many before that is called a difference: one or two on an edge may have
/// found the same in both halves by chance, but not as many with nothing beside them that varies.
pub const STILL: usize = 16;

/// A difference with its error along one mixture of channels.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Contrast {
    /// Sum over the pixels of the reference.
    pub reference: f64,
    /// Sum of the differences: test less reference.
    pub difference: f64,
    /// Standard error of the latter.
    pub error: f64,
    /// Degrees of freedom of the error.
    pub freedom: f64,
}

/// What was found in some pixels.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Finding {
    /// Pixels that were used.
    pub pixels: usize,
    /// Pixels left out because a value is not finite.
    pub not_finite: usize,
    /// Pixels left out because there are less than two replicates.
    pub no_spread: usize,
    /// Pixels without noise that are the same in both: they say nothing of a bias elsewhere.
    pub quiet: usize,
    /// Pixels without noise, or without any in the direction of their difference, that are not the same.
    pub still: usize,
    /// The largest difference of a channel among the latter.
    pub largest_still: f64,
    /// Mixtures of channels that have noise.
    pub rank: usize,
    /// Squared distance in units of the noise.
    pub t2: f64,
    /// Degrees of freedom of the covariance.
    pub freedom: f64,
    /// Whether `t2` is by the covariance of all deals (`exchange`), which is known, and not by its estimate.
    pub is_known: bool,
    /// Squared distance by a covariance that the differences themselves are a third of, so that a single pixel's never exceeds
    /// 3: the probability is at least chi-square's of it. None where that is not asked: where halves are dealt, or whole pictures
    /// are replicates.
    pub careful: Option<f64>,
    /// Red, green, blue, luminance.
    pub contrasts: [Contrast; 4],
    /// Squared length, in units of the noise, of the reference's sum: what a bias of 100 % in all channels would bring.
    pub strength: f64,
    /// Whether the picture with fewer samples was given, along some mixture of channels, the noise that the other foretells.
    pub borrowed: bool,
    /// Rows that make a difference's noise round.
    pub white: Vec<[f64; 3]>,
}

impl Finding {
    /// Degrees of freedom of F.
    pub fn denominator(&self) -> f64 {
        if self.is_known { f64::INFINITY } else { self.freedom - self.rank as f64 + 1.0 }
    }

    /// How often chance alone brings as much or more; `None` where nothing varies.
    pub fn p(&self) -> Option<f64> {
        let (p, f) = (self.rank as f64, self.denominator());
        (self.rank > 0).then(|| match self.is_known {
            true => chi_square_tail(self.t2, self.rank),
            false => {
                let careful = self.careful.map_or(0.0, |t2| chi_square_tail(t2, self.rank));
                f_tail(self.t2 * f / (self.freedom * p), p, f).max(careful)
            }
        })
    }

    /// Whether there is a difference where there is no noise, see [`STILL`].
    pub fn is_exact(&self) -> bool {
        self.still >= STILL
    }
}

/// First sums.
#[derive(Debug, Clone, Default)]
struct Sums {
    pixels: usize,
    not_finite: usize,
    no_spread: usize,
    quiet: usize,
    reference: [f64; 3],
    difference: [f64; 3],
    /// Of the reference's items (or the pairs'), and of the test's.
    covariance: [Mat; 2],
    /// Of the difference, over all deals; its outer products by pixel where halves cannot be dealt.
    dealt: Mat,
    /// Squared tolerances.
    rounding: [f64; 3],
    /// Sums of each replicate of a side whose pixels are not independent; of the differences, if paired.
    parts: [Vec<[f64; 3]>; 2],
}

impl Sums {
    fn add(&mut self, o: &Sums) {
        self.pixels += o.pixels;
        self.not_finite += o.not_finite;
        self.no_spread += o.no_spread;
        self.quiet += o.quiet;
        let vector = |a: &mut [f64; 3], b: &[f64; 3]| (0..3).for_each(|c| a[c] += b[c]);
        vector(&mut self.reference, &o.reference);
        vector(&mut self.difference, &o.difference);
        vector(&mut self.rounding, &o.rounding);
        (0..3).for_each(|i| vector(&mut self.dealt[i], &o.dealt[i]));
        for side in 0..2 {
            (0..3).for_each(|i| vector(&mut self.covariance[side][i], &o.covariance[side][i]));
            self.parts[side].resize(o.parts[side].len().max(self.parts[side].len()), [0.0; 3]);
            self.parts[side].iter_mut().zip(&o.parts[side]).for_each(|(a, b)| vector(a, b));
        }
    }
}

/// Second sums.
#[derive(Debug, Clone, Copy, Default)]
struct Fourths {
    q2: f64,
    contrasts: [f64; 4],
    still: usize,
    largest_still: f64,
}

/// Tests the pixels of these numbers.
pub fn examine(pair: &Pair, pixels: &[u32]) -> Finding {
    let sides = by_side(pair);
    let sums = in_order(pixels, |run| first_sums(pair, run, sides), Sums::default(), |a, b| a.add(b));
    let whole = picture_items(&sums, sides);
    let mut sums = sums;
    for (item, _) in &whole {
        add_outer(&mut sums.covariance[usize::from(item.of_test)], item.value, 1.0);
    }
    let joint = whole.is_empty() || picture_freedom(pair, sides) >= JOINT_FREEDOM;
    let lens = Lens::new(&sums.covariance, &sums.rounding, pair.ratio, joint);
    let fourths = in_order(
        pixels,
        |run| second_sums(pair, run, sides, &lens),
        Fourths::default(),
        |a, b| {
            a.q2 += b.q2;
            (0..4).for_each(|k| a.contrasts[k] += b.contrasts[k]);
            a.still += b.still;
            a.largest_still = a.largest_still.max(b.largest_still);
        },
    );
    let of_all = freedom(&lens.white, &lens.counts, fourths.q2, &whole);
    let (white, is_known) = match pair.ways {
        0 => (lens.white.clone(), false),
        _ => (whiten(&sums.dealt, &lens), true),
    };
    let contrast = |k: usize| {
        let along = CONTRASTS[k];
        let sides = sums.covariance.map(|m| quadratic(&m, along).max(0.0));
        let counts = lens.contrast_counts[k];
        let variance: f64 = (0..2).map(|side| sides[side] * counts[side] * counts[side]).sum();
        // The same formula for one direction.
        let white = [along.map(|c| c / variance.sqrt())];
        let fourth = fourths.contrasts[k] / (variance * variance);
        Contrast {
            reference: dot(along, sums.reference),
            difference: dot(along, sums.difference),
            error: variance.sqrt(),
            freedom: if variance > 0.0 { freedom(&white, &[counts], fourth, &whole) } else { 1.0 },
        }
    };
    let length2 = |v: [f64; 3]| white.iter().map(|w| dot(*w, v).powi(2)).sum::<f64>();
    Finding {
        pixels: sums.pixels,
        not_finite: sums.not_finite,
        no_spread: sums.no_spread,
        quiet: sums.quiet,
        still: fourths.still,
        largest_still: fourths.largest_still,
        rank: white.len(),
        t2: length2(sums.difference),
        freedom: of_all,
        is_known,
        careful: (!is_known && whole.is_empty()).then(|| careful(&white, &sums)),
        contrasts: [0, 1, 2, 3].map(contrast),
        strength: length2(sums.reference),
        borrowed: lens.counts.iter().flatten().any(|c| *c == 0.0),
        white,
    }
}

/// See [`Finding::careful`]: by (2 V + sum d d') / 3, which has the covariance of the sum D of the differences d as its mean, as V has.
fn careful(white: &[[f64; 3]], sums: &Sums) -> f64 {
    let mut covariance: Mat = [[0.0; 3]; 3];
    let mut seen = [0.0; 3];
    for (i, a) in white.iter().enumerate() {
        seen[i] = dot(*a, sums.difference);
        for (j, b) in white.iter().enumerate() {
            covariance[i][j] = dot(sums.dealt.map(|row| dot(row, *b)), *a) / 3.0;
        }
        // V is round here, and counts as what it is worth.
        covariance[i][i] += 2.0 / 3.0;
    }
    let along = eigen(&covariance).into_iter().take(white.len());
    along.map(|e| dot(e.vector, seen).powi(2) / e.value).sum()
}

/// Which sides are known by whole pictures alone.
fn by_side(pair: &Pair) -> [bool; 2] {
    match pair.design {
        Design::Independent => [pair.reference, pair.test].map(|r| r.spread == Spread::Pictures),
        Design::Paired => [!pair.by_pixels(), false],
    }
}

fn in_order<T: Send + Sync>(
    pixels: &[u32],
    of_run: impl Fn(&[u32]) -> T + Send + Sync,
    start: T,
    add: impl Fn(&mut T, &T),
) -> T {
    if pixels.len() <= RUN {
        return of_run(pixels);
    }
    let runs: Vec<T> = pixels.par_chunks(RUN).map(of_run).collect();
    let mut all = start;
    runs.iter().for_each(|run| add(&mut all, run));
    all
}

fn first_sums(pair: &Pair, pixels: &[u32], pictures: [bool; 2]) -> Sums {
    let (mut sums, mut items) = (Sums::default(), Vec::new());
    for (side, of) in [pair.reference, pair.test].into_iter().enumerate().filter(|(side, _)| pictures[*side])
    {
        sums.parts[side] = vec![[0.0; 3]; of.len()];
    }
    for &pixel in pixels {
        let visit = match pair.visit(pixel as usize, &mut items) {
            Ok(visit) => visit,
            Err(Use::NotFinite) => {
                sums.not_finite += 1;
                continue;
            }
            Err(_) => {
                sums.no_spread += 1;
                continue;
            }
        };
        sums.pixels += 1;
        let difference = visit.difference();
        (0..3).for_each(|c| sums.reference[c] += visit.reference[c]);
        if visit.is_quiet(&items) {
            sums.quiet += 1;
            continue;
        }
        (0..3).for_each(|c| sums.difference[c] += difference[c]);
        (0..3).for_each(|c| sums.rounding[c] += visit.tolerance[c] * visit.tolerance[c]);
        match pair.ways {
            0 => add_outer(&mut sums.dealt, difference, 1.0),
            ways => {
                let contrasts = pair.contrasts(pixel as usize);
                contrasts.iter().for_each(|c| add_outer(&mut sums.dealt, *c, 1.0 / ways as f64));
            }
        }
        for item in items.iter().filter(|i| !pictures[usize::from(i.of_test)]) {
            add_outer(&mut sums.covariance[usize::from(item.of_test)], item.value, 1.0);
        }
        for side in (0..2).filter(|side| pictures[*side]) {
            for (part, sum) in sums.parts[side].iter_mut().enumerate() {
                let value = pair.part(side, part, pixel as usize);
                (0..3).for_each(|c| sum[c] += value[c]);
            }
        }
    }
    sums
}

/// The items of sides that are known by whole pictures, each with the number of its like.
fn picture_items(sums: &Sums, pictures: [bool; 2]) -> Vec<(Item, f64)> {
    let mut all = Vec::new();
    for side in (0..2).filter(|side| pictures[*side]) {
        let (mut running, mut items) = (Running::default(), Vec::new());
        for part in &sums.parts[side] {
            if let Some(value) = running.add(*part, 1.0) {
                items.push(Item { value, of_test: side == 1 });
            }
        }
        if running.finish(&mut items, 0).is_some() {
            let n = items.len() as f64;
            all.extend(items.into_iter().map(|i| (i, n)));
        }
    }
    all
}

fn picture_freedom(pair: &Pair, pictures: [bool; 2]) -> f64 {
    let of = [pair.reference, pair.test];
    (0..2).filter(|side| pictures[*side]).map(|side| of[side].len() as f64 - 1.0).sum()
}

fn second_sums(pair: &Pair, pixels: &[u32], pictures: [bool; 2], lens: &Lens) -> Fourths {
    let (mut sums, mut items) = (Fourths::default(), Vec::new());
    for &pixel in pixels {
        let Ok(visit) = pair.visit(pixel as usize, &mut items) else { continue };
        if visit.is_quiet(&items) {
            continue;
        }
        let difference = visit.difference();
        if !lens.dropped.is_empty() && lens.leaves(difference, &items, visit.tolerance) {
            sums.still += 1;
            let largest = difference.iter().fold(0.0f64, |m, d| m.max(d.abs()));
            sums.largest_still = sums.largest_still.max(largest);
        }
        for item in items.iter().filter(|i| !pictures[usize::from(i.of_test)]) {
            let side = usize::from(item.of_test);
            let rows = lens.white.iter().zip(&lens.counts);
            let q: f64 = rows.map(|(w, count)| (count[side] * dot(*w, item.value)).powi(2)).sum();
            sums.q2 += q * q;
            for (k, along) in CONTRASTS.into_iter().enumerate() {
                sums.contrasts[k] += (lens.contrast_counts[k][side] * dot(along, item.value)).powi(4);
            }
        }
    }
    sums
}
