//! How a sky is sampled: what is left for a table once BSDF sampling has done its part, how fine the table must be,
//! and which share discs get. All of it is decided by the variance that diffuse receivers would see.
//!
//! For receivers whose normals point anywhere with equal probability, under radiance L, with one sample of the cosine
//! lobe (density p1) and one of the sky (p2) joined by the balance heuristic, the mean second moment of the estimate
//! of E / pi has a closed form: per direction it is L^2 g(p2) with [`second_moment`] for g. So is its gain from
//! any table known before a ray is traced.

use super::SkySampling;
use crate::base::skybox::{ChartGrid, ChartPoint, Skybox};
use crate::sampling::distribution::ChartDistribution;
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Most cells of a table: 36 MB of it, enough for every texel of a 4096 x 2048 map.
pub(super) const MAX_CELLS: usize = 1 << 23;
/// A coarser table is taken if it adds no more than this part to the variance.
const TOLERANCE: f64 = 0.01;
/// What a second sample and its shadow ray cost, next to a path without: the table must at least lower the variance
/// by as much, or BSDF sampling alone is the better use of time.
const COST: f64 = 1.6;
/// Cells on which shares are tried out.
const TRIAL_CELLS: usize = 600;

/// What came of it.
pub(super) struct Plan {
    /// Cells with their distribution, if the map is sampled.
    pub table: Option<(ChartGrid, ChartDistribution)>,
    /// Probability of sampling the map.
    pub map_share: f64,
    /// Probability of each disc.
    pub disc_shares: Vec<f64>,
    /// Integral of luminance over the map.
    pub map_total: f64,
}

/// Cells of one resolution, and what is known of each.
pub(super) struct Level {
    grid: ChartGrid,
    /// Luminance over the cell.
    integral: Vec<f64>,
    /// Solid angle.
    solid_angle: Vec<f64>,
    /// Squared luminance over the cell; empty on the finest level, where a cell is taken as uniform.
    square: Vec<f64>,
}

/// The mean over receivers' normals of (c / pi)^2 / (c / pi + p), c the cosine to the normal or zero below the horizon:
/// half of the integral of c^2 / (c + a) over c in [0, 1], with a = pi p, over pi.
fn second_moment(p: f64) -> f64 {
    let a = PI * p;
    let integral = if a > 1e3 {
        // 1 / 3a - 1 / 4a^2: what is left of the differences below.
        (1.0 / 3.0 - 0.25 / a) / a
    } else if a > 0.0 {
        0.5 - a + a * a * (1.0 / a).ln_1p()
    } else {
        0.5
    };
    integral / (2.0 * PI)
}

impl Level {
    /// The finest that fits, and each half as fine as the one before.
    pub fn all(sky: &dyn Skybox) -> Vec<Self> {
        let mut levels = vec![Level::finest(sky)];
        while let Some(coarser) = levels.last().and_then(Level::coarser) {
            levels.push(coarser);
        }
        levels
    }

    /// Its cells.
    pub fn grid(&self) -> ChartGrid {
        self.grid
    }

    /// Luminance over a cell.
    pub fn integral(&self, i: usize) -> f64 {
        self.integral[i]
    }

    /// Of a cell.
    pub fn solid_angle(&self, i: usize) -> f64 {
        self.solid_angle[i]
    }

    /// The finest that fits.
    pub fn finest(sky: &dyn Skybox) -> Self {
        let mut grid = sky.grid();
        while grid.cells() > MAX_CELLS {
            grid.width = grid.width.div_ceil(2);
            grid.height = grid.height.div_ceil(2);
        }
        let integral = sky.cell_integrals(grid);
        Level { grid, integral, solid_angle: solid_angles(sky, grid), square: Vec::new() }
    }

    /// Half as fine, where both sides are even and not yet small.
    fn coarser(&self) -> Option<Self> {
        let ChartGrid { count, width, height } = self.grid;
        if width % 2 != 0 || height % 2 != 0 || width.min(height) < 8 {
            return None;
        }
        let grid = ChartGrid { count, width: width / 2, height: height / 2 };
        let sum = |of: &(dyn Fn(usize) -> f64 + Sync)| -> Vec<f64> {
            let w = width as usize;
            let cell = |i: usize| {
                let (row, x) = (i / (w / 2), i % (w / 2));
                let k = 2 * row * w + 2 * x;
                (of(k) + of(k + 1)) + (of(k + w) + of(k + w + 1))
            };
            (0..grid.cells()).into_par_iter().with_min_len(4096).map(cell).collect()
        };
        Some(Level {
            grid,
            integral: sum(&|i| self.integral[i]),
            solid_angle: sum(&|i| self.solid_angle[i]),
            square: sum(&|i| self.square(i)),
        })
    }

    /// Largest mean luminance of a cell.
    pub fn peak(&self) -> f64 {
        let of = |(flux, angle): (&f64, &f64)| if *angle > 0.0 { flux / angle } else { 0.0 };
        self.integral.iter().zip(&self.solid_angle).map(of).fold(0.0, f64::max)
    }

    /// Squared luminance over a cell.
    pub fn square(&self, i: usize) -> f64 {
        match self.square.get(i) {
            Some(&s) => s,
            None if self.solid_angle[i] > 0.0 => self.integral[i] * (self.integral[i] / self.solid_angle[i]),
            None => 0.0,
        }
    }

    /// What a table samples by: the luminance that rises above `floor` on average over the cell.
    fn weight(&self, i: usize, floor: f64) -> f64 {
        (self.integral[i] - floor * self.solid_angle[i]).max(0.0)
    }

    /// Second moment of the map's part if a share of the samples goes to a table with this floor.
    fn moment(&self, floor: f64, share: f64) -> f64 {
        let density = self.densities(floor, share);
        ordered_sum(self.integral.len(), |i| self.square(i) * second_moment(density(i)))
    }

    /// The density per solid angle of such samples, by cell.
    fn densities(&self, floor: f64, share: f64) -> impl Fn(usize) -> f64 + Sync {
        let total = ordered_sum(self.integral.len(), |i| self.weight(i, floor));
        let scale = if total > 0.0 { share / total } else { 0.0 };
        move |i| match self.weight(i, floor) {
            w if w > 0.0 => w * scale / self.solid_angle[i],
            _ => 0.0,
        }
    }
}

/// A sum in parallel whose bits do not depend on the number of threads.
pub(super) fn ordered_sum(n: usize, f: impl Fn(usize) -> f64 + Sync) -> f64 {
    const CHUNK: usize = 4096;
    let chunk = |c: usize| (c * CHUNK..((c + 1) * CHUNK).min(n)).map(&f).sum::<f64>();
    let parts: Vec<f64> = (0..n.div_ceil(CHUNK)).into_par_iter().map(chunk).collect();
    parts.iter().sum()
}

fn solid_angles(sky: &dyn Skybox, grid: ChartGrid) -> Vec<f64> {
    let (w, h) = (grid.width as usize, grid.height as usize);
    let area = 1.0 / (w as f64 * h as f64);
    // One point is enough where cells are small.
    const HALF: &[f64] = &[0.5];
    const GAUSS: &[f64] = &[0.112_701_665_379_258_31, 0.5, 0.887_298_334_620_741_7];
    const WEIGHTS: [f64; 3] = [5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0];
    let (nodes, weights): (&[f64], &[f64]) =
        if grid.cells() > 1 << 16 { (HALF, &[1.0]) } else { (GAUSS, &WEIGHTS) };
    let cell = |i: usize| {
        let (chart, x, y) = ((i / (w * h)) as u32, i % w, i / w % h);
        let mut sum = 0.0;
        for (b, wb) in nodes.iter().zip(weights) {
            for (a, wa) in nodes.iter().zip(weights) {
                let (u, v) = ((x as f64 + a) / w as f64, (y as f64 + b) / h as f64);
                sum += wa * wb * sky.solid_angle_density(ChartPoint { chart, u, v });
            }
        }
        sum * area
    };
    (0..grid.cells()).into_par_iter().with_min_len(1024).map(cell).collect()
}

/// What second moments exceed by the variance: the mean over receivers' normals of the squared expectations of both
/// samples, which are independent of each other. `share` of the sky's samples go to a table with this floor, `disc_share`
/// to the discs. On a coarse level, whose cells have the light of their middles.
fn mean_squares(sky: &dyn Skybox, level: &Level, floor: f64, share: f64, disc_share: f64) -> f64 {
    let ChartGrid { width, height, .. } = level.grid;
    let (w, h) = (width as usize, height as usize);
    let mut normals = Vec::new();
    for k in (0..27).filter(|&k| k != 13) {
        normals.push(
            DVec3::new(f64::from(k % 3 - 1), f64::from(k / 3 % 3 - 1), f64::from(k / 9 - 1)).normalize(),
        );
    }
    // Of the cosine lobe's sample and of the sky's.
    let mut expected = vec![[0.0; 2]; normals.len()];
    let mut add = |d: DVec3, flux: f64, p2: f64| {
        for (e, n) in expected.iter_mut().zip(&normals) {
            let p1 = d.dot(*n).max(0.0) / PI;
            if p1 > 0.0 {
                e[0] += flux * p1 * (p1 / (p1 + p2));
                e[1] += flux * p1 * (p2 / (p1 + p2));
            }
        }
    };
    let density = level.densities(floor, share);
    for (i, &flux) in level.integral.iter().enumerate() {
        let u = ((i % w) as f64 + 0.5) / f64::from(width);
        let v = ((i / w % h) as f64 + 0.5) / f64::from(height);
        add(sky.direction(ChartPoint { chart: (i / (w * h)) as u32, u, v }), flux, density(i));
    }
    let discs = Discs::of(sky);
    for ((disc, (flux, omega)), share) in sky.discs().iter().zip(&discs.0).zip(discs.shares(disc_share)) {
        add(disc.toward, *flux, share / omega);
    }
    expected.iter().map(|[a, b]| a * a + b * b).sum::<f64>() / normals.len() as f64
}

/// Fluxes and solid angles of discs.
struct Discs(Vec<(f64, f64)>);

impl Discs {
    fn of(sky: &dyn Skybox) -> Self {
        let disc = |d: &crate::base::skybox::SkyDisc| {
            let omega = d.solid_angle();
            (f64::from(d.radiance.luminance()) * omega, omega)
        };
        Discs(sky.discs().iter().map(disc).collect())
    }

    fn total(&self) -> f64 {
        self.0.iter().map(|d| d.0).sum()
    }

    /// Each one's part of `share`.
    fn shares(&self, share: f64) -> Vec<f64> {
        self.0.iter().map(|d| if share > 0.0 { share * d.0 / self.total() } else { 0.0 }).collect()
    }

    fn moment(&self, share: f64) -> f64 {
        let parts = self.0.iter().zip(self.shares(share));
        parts.map(|((flux, omega), p)| flux * flux / omega * second_moment(p / omega)).sum()
    }
}

/// Decides on a sky that is not constant.
pub(super) fn plan(sky: &dyn Skybox, levels: &[Level], sampling: SkySampling) -> Plan {
    let discs = Discs::of(sky);
    let finest = &levels[0];
    let n = finest.integral.len();
    let map_total = ordered_sum(n, |i| finest.integral[i]);
    let floor = match sampling {
        // MIS compensation: what the average level brings, the cosine lobe finds as well (Karlik et al., "MIS
        // Compensation: Optimizing Sampling Techniques in Multiple Importance Sampling", 2019, 4.3).
        SkySampling::Compensated => map_total / ordered_sum(n, |i| finest.solid_angle[i]),
        _ => 0.0,
    };
    let trial = levels.iter().find(|l| l.grid.cells() <= TRIAL_CELLS).or(levels.last()).unwrap_or(finest);
    let nothing = Plan { table: None, map_share: 0.0, disc_shares: discs.shares(0.0), map_total };
    let left = ordered_sum(n, |i| finest.weight(i, floor));
    // What rounding leaves of a constant map is nothing.
    if left <= 1e-9 * map_total && discs.total() <= 0.0 {
        return nothing;
    }
    let disc_share = if left <= 1e-9 * map_total { 1.0 } else { disc_share(&discs, trial, floor, sampling) };
    let map_share = 1.0 - disc_share;
    let disc_shares = discs.shares(disc_share);
    if map_share <= 0.0 || matches!(sampling, SkySampling::Cosine) {
        return Plan { table: None, map_share, disc_shares, map_total };
    }
    // What the model takes to be the same in all cells leaves some of the variance open.
    let variance = |l: &Level, share: f64| {
        let known = mean_squares(sky, trial, floor, share, disc_share);
        (l.moment(floor, share) + discs.moment(disc_share) - known).max(1e-3 * known)
    };
    let best = variance(finest, map_share);
    if discs.total() <= 0.0
        && matches!(sampling, SkySampling::Compensated)
        && variance(finest, 0.0) < COST * best
    {
        return nothing;
    }
    let fits = |l: &&Level| variance(l, map_share) <= best * (1.0 + TOLERANCE);
    let level = levels.iter().rev().find(fits).unwrap_or(finest);
    let weights: Vec<f64> = (0..level.integral.len()).map(|i| level.weight(i, floor)).collect();
    let ChartGrid { count, width, height } = level.grid;
    match ChartDistribution::new(count as usize, width as usize, height as usize, &weights) {
        Some(d) => Plan { table: Some((level.grid, d)), map_share, disc_shares, map_total },
        None => Plan { disc_shares: discs.shares(1.0), ..nothing },
    }
}

/// The probability of sampling a disc rather than the map that leaves the least variance.
fn disc_share(discs: &Discs, map: &Level, floor: f64, sampling: SkySampling) -> f64 {
    if discs.total() <= 0.0 {
        return 0.0;
    }
    if let SkySampling::Cosine = sampling {
        // The cosine lobe serves the map twice then; half each is within a factor 2 of any optimum.
        return 0.5;
    }
    let moment = |share: f64| map.moment(floor, 1.0 - share) + discs.moment(share);
    let candidates = (1..=39).map(|k| f64::from(k) / 40.0);
    let best = candidates.map(|s| (moment(s), s)).min_by(|a, b| a.0.total_cmp(&b.0));
    match best {
        // All to the discs, and so no shadow ray where none is in sight, if that costs little.
        Some((m, _)) if matches!(sampling, SkySampling::Compensated) && moment(1.0) < 1.02 * m => 1.0,
        Some((_, share)) => share,
        None => 0.5,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn second_moments_match_quadrature() {
        for p in [0.0, 1e-3, 0.1, 1.0, 30.0, 317.0, 319.0, 1e4] {
            let n = 20_000;
            let c = |i: i32| (f64::from(i) + 0.5) / f64::from(n) / PI;
            let want = 0.5 * (0..n).map(|i| c(i) * c(i) / (c(i) + p)).sum::<f64>() / f64::from(n);
            let got = second_moment(p);
            // The midpoint rule's error, and cancellation of three digits next to where the series takes over.
            assert!((got / want - 1.0).abs() < 2e-6, "{p}: {got} {want}");
        }
    }
}
