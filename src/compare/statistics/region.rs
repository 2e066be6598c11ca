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

use super::matrix::{Mat, add_outer, dot, eigen, quadratic};
use super::pair::{Design, Item, LUMINANCE, Pair, Running, Use};
use super::replicates::Spread;
use rayon::prelude::*;

/// Pixels that are summed in one go; sums of such runs are added in order.
const RUN: usize = 4096;

/// Variances below this part of the squared tolerance of rounding are none.
const ROUNDING: f64 = 1.0 / 16.0;

/// From so many degrees of freedom of whole pictures on, their channels are looked at together; below, luminance alone.
const JOINT_FREEDOM: f64 = 8.0;

/// Pixels without noise that differ must be so many before that is called a difference: one or two on an edge may have
/// found the same in both halves by chance, but not as many with nothing beside them that varies.
pub const STILL: usize = 16;

/// Numbers of samples are unlike if they differ by this factor.
const UNLIKE: f64 = 1.5;

/// The noise of the picture with fewer samples is borrowed if its own is less than the other foretells by this factor:
/// chance alone hardly brings that where there are a few dozen pixels with noise.
const MISSED: f64 = 2.0;

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
    /// Red, green, blue, luminance.
    pub contrasts: [Contrast; 4],
    /// Squared length, in units of the noise, of the reference's sum: what a bias of 100 % in all channels would bring.
    pub strength: f64,
    /// Whether the picture with fewer samples was given the noise that the other foretells.
    pub borrowed: bool,
}

impl Finding {
    /// Degrees of freedom of F.
    pub fn denominator(&self) -> f64 {
        self.freedom - self.rank as f64 + 1.0
    }

    /// How often chance alone brings as much or more; `None` where nothing varies.
    pub fn p(&self) -> Option<f64> {
        let (p, f) = (self.rank as f64, self.denominator());
        (self.rank > 0).then(|| super::distributions::f_tail(self.t2 * f / (self.freedom * p), p, f))
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
        for side in 0..2 {
            (0..3).for_each(|i| vector(&mut self.covariance[side][i], &o.covariance[side][i]));
            self.parts[side].resize(o.parts[side].len().max(self.parts[side].len()), [0.0; 3]);
            self.parts[side].iter_mut().zip(&o.parts[side]).for_each(|(a, b)| vector(a, b));
        }
    }
}

/// How covariances and fourth moments are read.
struct Lens {
    /// What a side's items count: the square root of this multiplies them.
    weights: [f64; 2],
    /// Rows that make noise round: p of them.
    white: Vec<[f64; 3]>,
    /// Unit vectors, in scaled channels, of the directions without noise.
    dropped: Vec<[f64; 3]>,
    scale: [f64; 3],
}

/// Second sums.
#[derive(Debug, Clone, Copy, Default)]
struct Fourths {
    q2: f64,
    contrasts: [f64; 4],
    still: usize,
    largest_still: f64,
}

const CONTRASTS: [[f64; 3]; 4] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], LUMINANCE];

/// Tests the pixels of these numbers.
pub fn examine(pair: &Pair, pixels: &[u32]) -> Finding {
    let sides = by_side(pair);
    let sums = in_order(pixels, |run| first_sums(pair, run, sides), Sums::default(), |a, b| a.add(b));
    let whole = picture_items(pair, &sums, sides);
    let mut sums = sums;
    for (item, _) in &whole {
        add_outer(&mut sums.covariance[usize::from(item.of_test)], item.value, 1.0);
    }
    let (weights, borrowed) = weights(pair, &sums);
    let mut v: Mat = [[0.0; 3]; 3];
    for (side, weight) in weights.into_iter().enumerate() {
        (0..9).for_each(|i| v[i / 3][i % 3] += weight * sums.covariance[side][i / 3][i % 3]);
    }
    let joint = whole.is_empty() || picture_freedom(pair, sides) >= JOINT_FREEDOM;
    let lens = Lens::new(&v, &sums.rounding, weights, joint);
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
    let rank = lens.white.len();
    let freedom = freedom(&lens.white, rank, fourths.q2, &whole, &lens);
    let contrast = |k: usize| {
        let along = CONTRASTS[k];
        let variance = quadratic(&v, along).max(0.0);
        // The same formula for one direction.
        let white = [along.map(|c| c / variance.sqrt())];
        let fourth = fourths.contrasts[k] / (variance * variance);
        Contrast {
            reference: dot(along, sums.reference),
            difference: dot(along, sums.difference),
            error: variance.sqrt(),
            freedom: if variance > 0.0 { self::freedom(&white, 1, fourth, &whole, &lens) } else { 1.0 },
        }
    };
    let length2 = |v: [f64; 3]| lens.white.iter().map(|w| dot(*w, v).powi(2)).sum::<f64>();
    Finding {
        pixels: sums.pixels,
        not_finite: sums.not_finite,
        no_spread: sums.no_spread,
        quiet: sums.quiet,
        still: fourths.still,
        largest_still: fourths.largest_still,
        rank,
        t2: length2(sums.difference),
        freedom,
        contrasts: [0, 1, 2, 3].map(contrast),
        strength: length2(sums.reference),
        borrowed,
    }
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

/// Whether nothing varies, and nothing differs, beyond rounding.
fn is_still(items: &[Item], tolerance: &[f64; 3]) -> bool {
    items.iter().all(|i| (0..3).all(|c| i.value[c].abs() <= tolerance[c]))
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
        if is_still(&items, &visit.tolerance) && visit.is_within_tolerance() {
            sums.quiet += 1;
            continue;
        }
        for c in 0..3 {
            sums.difference[c] += difference[c];
            sums.rounding[c] += visit.tolerance[c] * visit.tolerance[c];
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
fn picture_items(pair: &Pair, sums: &Sums, pictures: [bool; 2]) -> Vec<(Item, f64)> {
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
    debug_assert!(pair.pixels() > 0);
    all
}

fn picture_freedom(pair: &Pair, pictures: [bool; 2]) -> f64 {
    let of = [pair.reference, pair.test];
    (0..2).filter(|side| pictures[*side]).map(|side| of[side].len() as f64 - 1.0).sum()
}

/// What the covariances of the two sides count. Where one picture has far fewer samples, its noise is at least what the other's
/// foretells: that of samples alike falls as 1 / n or faster. Its own estimate may have missed what is rare, and would then
/// make the other's rare finds look significant.
fn weights(pair: &Pair, sums: &Sums) -> ([f64; 2], bool) {
    let known =
        [pair.reference, pair.test].map(|r| if r.spread == Spread::Pixels { r.samples() } else { None });
    let (Design::Independent, [Some(m), Some(n)]) = (pair.design, known) else { return ([1.0; 2], false) };
    let variance = sums.covariance.map(|v| quadratic(&v, LUMINANCE));
    match n / m {
        ratio if ratio >= UNLIKE && ratio * variance[1] > MISSED * variance[0] => ([0.0, 1.0 + ratio], true),
        ratio if ratio * UNLIKE <= 1.0 && variance[0] > MISSED * ratio * variance[1] => {
            ([1.0 + 1.0 / ratio, 0.0], true)
        }
        _ => ([1.0; 2], false),
    }
}

impl Lens {
    fn new(v: &Mat, rounding: &[f64; 3], weights: [f64; 2], joint: bool) -> Self {
        let scale = rounding.map(|r| (ROUNDING * r).sqrt().max(1e-100));
        let mut lens = Lens { weights, white: Vec::new(), dropped: Vec::new(), scale };
        if !joint {
            let variance = quadratic(v, LUMINANCE);
            if variance > 0.0 {
                lens.white.push(LUMINANCE.map(|c| c / variance.sqrt()));
            }
            return lens;
        }
        let mut scaled = *v;
        (0..9).for_each(|i| scaled[i / 3][i % 3] /= scale[i / 3] * scale[i % 3]);
        for e in eigen(&scaled) {
            if e.value >= 1.0 && e.value.is_finite() {
                let root = e.value.sqrt();
                lens.white.push([0, 1, 2].map(|c| e.vector[c] / (scale[c] * root)));
            } else {
                lens.dropped.push(e.vector);
            }
        }
        lens
    }

    /// Whether a difference reaches, beyond rounding, into directions without noise.
    fn leaves(&self, difference: [f64; 3], tolerance: [f64; 3]) -> bool {
        let along = |u: &[f64; 3], v: [f64; 3]| (0..3).map(|c| u[c] * v[c] / self.scale[c]).sum::<f64>();
        let most = |u: &[f64; 3]| (0..3).map(|c| u[c].abs() * tolerance[c] / self.scale[c]).sum::<f64>();
        self.dropped.iter().any(|u| along(u, difference).abs() > 2.0 * most(u))
    }
}

fn second_sums(pair: &Pair, pixels: &[u32], pictures: [bool; 2], lens: &Lens) -> Fourths {
    let (mut sums, mut items) = (Fourths::default(), Vec::new());
    for &pixel in pixels {
        let Ok(visit) = pair.visit(pixel as usize, &mut items) else { continue };
        if is_still(&items, &visit.tolerance) && visit.is_within_tolerance() {
            continue;
        }
        let difference = visit.difference();
        if !lens.dropped.is_empty() && lens.leaves(difference, visit.tolerance) {
            sums.still += 1;
            let largest = difference.iter().fold(0.0f64, |m, d| m.max(d.abs()));
            sums.largest_still = sums.largest_still.max(largest);
        }
        for item in items.iter().filter(|i| !pictures[usize::from(i.of_test)]) {
            let weight = lens.weights[usize::from(item.of_test)];
            let q: f64 = lens.white.iter().map(|w| dot(*w, item.value).powi(2)).sum();
            sums.q2 += (weight * q).powi(2);
            for (sum, along) in sums.contrasts.iter_mut().zip(CONTRASTS) {
                *sum += (weight * dot(along, item.value).powi(2)).powi(2);
            }
        }
    }
    sums
}

/// See the module: `q2` is the sum over the pixels' items. Items of whole pictures are alike, so that their side's f is known:
/// it adds tr(O^2) + (tr O)^2 over its number to the denominator.
fn freedom(white: &[[f64; 3]], rank: usize, q2: f64, whole: &[(Item, f64)], lens: &Lens) -> f64 {
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
        let weight = lens.weights[usize::from(side)];
        // O in white coordinates.
        let mut o = vec![vec![0.0; rank]; rank];
        for (item, _) in &mine {
            let z: Vec<f64> = white.iter().map(|w| dot(*w, item.value)).collect();
            (0..rank * rank).for_each(|i| o[i / rank][i % rank] += weight * z[i / rank] * z[i % rank]);
        }
        let trace: f64 = (0..rank).map(|i| o[i][i]).sum();
        let squares: f64 = o.iter().flatten().map(|v| v * v).sum();
        below += (squares + trace * trace) / n;
    }
    ((p + p * p) / below).max(p)
}
