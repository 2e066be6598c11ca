//! Product sampling: directions by what the sky brings times what the surface makes of it.
//!
//! The charts of the sky are cut into a few hundred coarse cells, each with its flux, the middle of its light, and a
//! bound on its reach about that. At a surface point every coarse cell is weighed by its flux and by how the surface
//! scatters from there (its even part by the cosine, clipped by the horizon as far as the cell reaches; its facets by
//! their distribution, widened by the cell), rows of cells and then a cell are chosen by inversion, and a table of its
//! own, by luminance alone, finds the direction within. Discs are cells, too. In the manner of Conty Estevez and Lecocq
//! ("Fast product importance sampling of environment maps", SIGGRAPH 2018 talks), with what is left of both numbers
//! handed on from step to step, so that stratified points stay stratified.
//!
//! Weights may be wrong by any factor and only cost variance, as long as none is zero where light is scattered.

mod weigh;

use super::placed::{PlacedDisc, Turn};
use super::plan::{Level, ordered_sum};
use crate::base::light::{Guide, Lobes, Receiver};
use crate::base::skybox::{ChartGrid, ChartPoint, Skybox};
use crate::math::simd::dispatch;
use crate::sampling::distribution::ChartDistribution;
use glam::{DVec3, Vec3};
use weigh::{Both, Cells, Even, Sum};

/// Cells along a chart's sides: of one chart that is the whole sphere, and of each of several.
const SPHERE_CELLS: [u32; 2] = [32, 16];
const FACE_CELLS: [u32; 2] = [8, 8];
/// Rows of cells are padded to a multiple of this: what vector registers hold.
const LANES: usize = 8;
/// Most cells of a level that the middles of coarse cells are made from.
const MIDDLE_CELLS: usize = 1 << 20;
/// A coarser table is taken where it adds no more than this part to the second moment of radiance over density. What is in
/// the way adds more to most pictures, and a fine table of a large sky costs a miss of the caches a lookup; at 0.05
/// pictures are noisier by a third under a sun of some texels.
const TOLERANCE: f64 = 0.01;
/// Largest f64 below one.
const ONE_MINUS: f64 = 1.0 - f64::EPSILON / 2.0;

/// The table.
pub(super) struct ProductTable {
    /// Of the cells that the parts choose among.
    grid: ChartGrid,
    /// Coarse cells along a chart's sides.
    across: usize,
    down: usize,
    /// Columns of a row of `cells`.
    stride: usize,
    /// By row and column; the discs after the last row.
    cells: Cells,
    /// The sky within each coarse cell, in the order of `cells`; None where it is black.
    parts: Vec<Option<ChartDistribution>>,
    /// See [`ProductTable::peak`].
    peak: f64,
}

/// What was chosen.
pub(super) enum Choice {
    /// A place within a cell of the sky's map, with the probability of that cell of the grid.
    Map {
        /// On the charts.
        at: ChartPoint,
        /// Of the cell of [`ProductTable::grid`].
        pmf: f64,
    },
    /// A disc, and two numbers for a place in it.
    Disc {
        /// Which.
        disc: usize,
        /// In [0, 1).
        u: [f64; 2],
    },
}

/// The first of the cells `0..n` that are the part `i` of `parts`.
fn edge(i: usize, n: u32, parts: usize) -> u32 {
    (i as u64 * u64::from(n) / parts as u64) as u32
}

/// The part of `parts` that cell `x` of `n` lies in.
fn part_of(x: u32, n: u32, parts: usize) -> usize {
    let guess = (u64::from(x) * parts as u64 / u64::from(n)) as usize;
    if guess + 1 < parts && edge(guess + 1, n, parts) <= x { guess + 1 } else { guess }
}

/// The coarsest level that loses little against the finest.
fn choose_level(levels: &[Level]) -> &Level {
    let finest = &levels[0];
    // The second moment of radiance over a density that is proportional to it on average over each cell.
    let moment = |l: &Level| {
        let part = |i: usize| match l.integral(i) {
            flux if flux > 0.0 => l.square(i) * (l.solid_angle(i) / flux),
            _ => 0.0,
        };
        ordered_sum(l.cells(), part)
    };
    let best = moment(finest);
    let fits = |l: &&Level| moment(l) <= best * (1.0 + TOLERANCE);
    levels.iter().rev().find(fits).unwrap_or(finest)
}

impl ProductTable {
    /// Of a sky as it is turned; None if it is black. The discs are as bright as `intensity` makes them.
    pub fn new(
        sky: &dyn Skybox,
        levels: &[Level],
        discs: &[PlacedDisc],
        turn: Option<Turn>,
        intensity: f32,
    ) -> Option<Self> {
        let level = choose_level(levels);
        let grid = level.grid();
        let [across, down] = if grid.count == 1 { SPHERE_CELLS } else { FACE_CELLS };
        let (across, down) = (across.min(grid.width) as usize, down.min(grid.height) as usize);
        let stride = across.next_multiple_of(LANES);
        let rows = grid.count as usize * down;
        let mut table = ProductTable {
            grid,
            across,
            down,
            stride,
            cells: Cells::default(),
            peak: levels[0].peak(),
            parts: Vec::with_capacity(rows * stride),
        };
        let disc_rows = discs.len().div_ceil(stride);
        table.cells.resize((rows + disc_rows) * stride);
        let coarse = levels.iter().find(|l| l.cells() <= MIDDLE_CELLS).unwrap_or(level);
        let middles = table.middles(sky, coarse);
        for row in 0..rows {
            for column in 0..stride {
                let part = (column < across).then(|| table.part(level, row, column)).flatten();
                if let Some(part) = &part {
                    let (middle, reach) = table.reach(sky, row, column, middles[row * across + column]);
                    let world = turn.map_or(middle, |t| t.to_world(middle)).as_vec3();
                    table.cells.set(row * stride + column, world, reach, part.total() as f32);
                }
                table.parts.push(part);
            }
        }
        for (i, disc) in discs.iter().enumerate() {
            // Integrals of the map are without the intensity.
            let radiance = disc.radiance.luminance() / intensity.max(f32::MIN_POSITIVE);
            let flux = radiance * std::f32::consts::TAU * disc.m;
            table.cells.set(rows * stride + i, disc.frame.n, disc.sin, flux);
        }
        let is_black = table.cells.flux.iter().all(|f| *f <= 0.0);
        (!is_black).then_some(table)
    }

    /// Chart, and the ranges of cells of the grid in u and v of a coarse cell.
    fn ranges(&self, row: usize, column: usize) -> (u32, [u32; 2], [u32; 2]) {
        let span = |i: usize, n: u32, parts: usize| [edge(i, n, parts), edge(i + 1, n, parts)];
        let (chart, y) = (row / self.down, row % self.down);
        (chart as u32, span(column, self.grid.width, self.across), span(y, self.grid.height, self.down))
    }

    /// The distribution of luminance within a coarse cell.
    fn part(&self, level: &Level, row: usize, column: usize) -> Option<ChartDistribution> {
        let (chart, [x0, x1], [y0, y1]) = self.ranges(row, column);
        let line = |y: u32| {
            let first = (chart * self.grid.height + y) as usize * self.grid.width as usize;
            (x0..x1).map(move |x| level.integral(first + x as usize))
        };
        let weights: Vec<f64> = (y0..y1).flat_map(line).collect();
        ChartDistribution::new(1, (x1 - x0) as usize, (y1 - y0) as usize, &weights)
    }

    /// Of each coarse cell, row by row without padding, the mean direction of its light, not normalised.
    fn middles(&self, sky: &dyn Skybox, level: &Level) -> Vec<DVec3> {
        let ChartGrid { width, height, .. } = level.grid();
        let mut sums = vec![DVec3::ZERO; self.grid.count as usize * self.down * self.across];
        for i in 0..level.cells() {
            let (row, x) = (i as u32 / width, i as u32 % width);
            let (chart, y) = (row / height, row % height);
            let u = (f64::from(x) + 0.5) / f64::from(width);
            let v = (f64::from(y) + 0.5) / f64::from(height);
            let coarse = (chart as usize * self.down + part_of(y, height, self.down)) * self.across;
            sums[coarse + part_of(x, width, self.across)] +=
                sky.direction(ChartPoint { chart, u, v }) * level.integral(i);
        }
        sums
    }

    /// The middle of a coarse cell's light and how far the cell reaches about it.
    fn reach(&self, sky: &dyn Skybox, row: usize, column: usize, middle: DVec3) -> (DVec3, f32) {
        let (chart, x, y) = self.ranges(row, column);
        let at = |[a, b]: [u32; 2], n: u32, part: f64| {
            (f64::from(a) + part * (f64::from(b) - f64::from(a))) / f64::from(n)
        };
        let points = (0..25).map(|k| {
            let part = |k: i32| f64::from(k) / 4.0;
            let (u, v) = (at(x, self.grid.width, part(k % 5)), at(y, self.grid.height, part(k / 5)));
            sky.direction(ChartPoint { chart, u, v })
        });
        let middle = middle
            .try_normalize()
            .unwrap_or_else(|| points.clone().sum::<DVec3>().try_normalize().unwrap_or(DVec3::Y));
        // Chords are longer than sines; the margin is for what lies between the points.
        let reach = points.map(|p| (p - middle).length()).fold(0.0, f64::max);
        (middle, (1.02 * reach) as f32)
    }

    /// Weighs all cells for a receiver; false if nothing can arrive.
    pub fn weigh(&self, at: &Receiver, lobes: &Lobes, guide: &mut Guide) -> bool {
        let n = self.cells.flux.len();
        guide.weights.resize(n, 0.0);
        guide.sums.resize(n / self.stride, 0.0);
        let weights = &mut guide.weights[..];
        if at.ns == Vec3::ZERO {
            weights.copy_from_slice(&self.cells.flux);
        } else if lobes.scattering.facets > 0.0 {
            dispatch(Both { cells: &self.cells, n: at.ns, lobes: *lobes, weights });
        } else {
            dispatch(Even { cells: &self.cells, n: at.ns, weights });
        }
        dispatch(Sum { weights: &guide.weights, stride: self.stride, sums: &mut guide.sums });
        guide.total() > 0.0
    }

    /// A cell and a place in it.
    pub fn sample(&self, guide: &Guide, u: [f64; 2]) -> Option<Choice> {
        let total = guide.total();
        let y = u[1] * total;
        // Counted, not searched: a few vector instructions without a branch to be foretold.
        let row = guide.sums.iter().map(|s| usize::from(*s <= y)).sum::<usize>().min(guide.sums.len() - 1);
        let before = if row > 0 { guide.sums[row - 1] } else { 0.0 };
        let of_row = guide.sums[row] - before;
        let weights = &guide.weights[row * self.stride..][..self.stride];
        // Rows without weight are never chosen; rounding may leave the last one so.
        if of_row <= 0.0 {
            return None;
        }
        let y = ((y - before) / of_row).clamp(0.0, ONE_MINUS);
        let x = u[0] * of_row;
        let (mut column, mut sum, mut left) = (0, 0.0, x);
        for (i, w) in (1..).zip(&weights[..self.stride - 1]) {
            sum += f64::from(*w);
            let beyond = x >= sum;
            column = if beyond { i } else { column };
            left = if beyond { x - sum } else { left };
        }
        let weight = f64::from(weights[column]);
        if weight <= 0.0 {
            return None;
        }
        let u = [(left / weight).clamp(0.0, ONE_MINUS), y];
        let cell = row * self.stride + column;
        let Some(part) = self.parts.get(cell) else {
            return Some(Choice::Disc { disc: cell - self.parts.len(), u });
        };
        let c = part.as_ref()?.sample(u);
        let (chart, [x0, _], [y0, _]) = self.ranges(row, column);
        // Off the border by more than the rounding of a direction to f32 can carry it back over.
        let inside = |u: f64, n: u32| {
            let rim = f64::from(n) * 1.5e-7;
            u.clamp(rim, 1.0 - rim)
        };
        let at = ChartPoint {
            chart,
            u: (f64::from(x0 + c.x) + inside(c.du[0], self.grid.width)) / f64::from(self.grid.width),
            v: (f64::from(y0 + c.y) + inside(c.du[1], self.grid.height)) / f64::from(self.grid.height),
        };
        Some(Choice::Map { at, pmf: weight / total * c.pmf })
    }

    /// The probability of the cell of the grid that a point lies in.
    pub fn pmf(&self, guide: &Guide, at: ChartPoint) -> f64 {
        let cell = |u: f64, n: u32| ((u * f64::from(n)) as u32).min(n - 1);
        let (x, y) = (cell(at.u, self.grid.width), cell(at.v, self.grid.height));
        let column = part_of(x, self.grid.width, self.across);
        let part_row = part_of(y, self.grid.height, self.down);
        let row = at.chart as usize * self.down + part_row;
        let index = row * self.stride + column;
        let weight = f64::from(guide.weights[index]);
        let Some(Some(part)) = self.parts.get(index).filter(|_| weight > 0.0) else { return 0.0 };
        let (x0, y0) =
            (edge(column, self.grid.width, self.across), edge(part_row, self.grid.height, self.down));
        weight / guide.total() * part.pmf(0, x - x0, y - y0)
    }

    /// The probability of a disc.
    pub fn disc_pmf(&self, guide: &Guide, disc: usize) -> f64 {
        f64::from(guide.weights[self.parts.len() + disc]) / guide.total()
    }

    /// Largest luminance of a cell of the finest grid, without the sky's intensity.
    pub fn peak(&self) -> f64 {
        self.peak
    }

    /// Flux of the map, without the sky's intensity.
    pub fn map_flux(&self) -> f64 {
        self.cells.flux[..self.parts.len()].iter().map(|f| f64::from(*f)).sum()
    }

    /// See the field.
    pub fn grid(&self) -> &ChartGrid {
        &self.grid
    }

    /// The number of the coarse cell, or disc, that was chosen.
    #[cfg(test)]
    pub fn cell_of(&self, choice: &Choice) -> usize {
        match choice {
            Choice::Disc { disc, .. } => self.parts.len() + disc,
            Choice::Map { at, .. } => {
                let cell = |u: f64, n: u32| ((u * f64::from(n)) as u32).min(n - 1);
                let column = part_of(cell(at.u, self.grid.width), self.grid.width, self.across);
                let row = part_of(cell(at.v, self.grid.height), self.grid.height, self.down);
                (at.chart as usize * self.down + row) * self.stride + column
            }
        }
    }

    /// For people.
    pub fn describe(&self) -> String {
        let g = &self.grid;
        format!(
            "by {} coarse cells and the surface, within them by a table of {} x {} x {} cells",
            g.count as usize * self.across * self.down,
            g.count,
            g.width,
            g.height
        )
    }

    /// Bytes held.
    pub fn memory(&self) -> u64 {
        let parts: u64 = self.parts.iter().flatten().map(ChartDistribution::memory).sum();
        parts + 24 * self.cells.flux.len() as u64
    }
}
