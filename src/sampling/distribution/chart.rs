//! A distribution over the cells of a few equal grids: what a sky is sampled by.

use super::{Guided, ONE_MINUS, accumulate, usable};

/// Cells are kept in blocks of 4 x 4: one cache line.
const SIDE: usize = 4;

/// 4 x 4 weights, row by row.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(64))]
struct Block([f32; SIDE * SIDE]);

impl Block {
    /// One column, in f64.
    #[inline(always)]
    fn column(&self, k: usize) -> [f64; SIDE] {
        std::array::from_fn(|r| f64::from(self.0[r * SIDE + k % SIDE]))
    }

    /// Sums of the columns, in f64.
    #[inline(always)]
    fn columns(&self) -> [f64; SIDE] {
        let at = |r: usize, k: usize| f64::from(self.0[r * SIDE + k]);
        std::array::from_fn(|k| (at(0, k) + at(1, k)) + (at(2, k) + at(3, k)))
    }
}

/// Where a number fell among four weights.
struct Split {
    index: usize,
    /// The number rescaled within the part, in [0, 1).
    u: f64,
}

/// Stays below one through one multiplication and one rounding.
const SAFE_BELOW_ONE: f64 = 1.0 - 8.0 * f64::EPSILON;

/// Finds the part of `w` in which `u` in [0, 1) falls; parts of weight 0 are never chosen if any is positive.
#[inline(always)]
fn split(w: [f64; SIDE], u: f64) -> Split {
    let mut low = [0.0; SIDE];
    low[1] = w[0];
    low[2] = low[1] + w[1];
    low[3] = low[2] + w[2];
    // Below the sum strictly, even after rounding.
    let x = u.min(SAFE_BELOW_ONE) * (low[3] + w[3]);
    // Counting and indexing rather than branching: no branch here could be predicted.
    let index = usize::from(x >= low[1]) + usize::from(x >= low[2]) + usize::from(x >= low[3]);
    Split { index, u: ((x - low[index]) / w[index]).min(ONE_MINUS) }
}

/// The number that [`split`] maps to part `index` and remainder `u`.
fn unsplit(w: [f64; SIDE], index: usize, u: f64) -> f64 {
    let low: f64 = w[..index].iter().sum();
    (low + u * w[index]) / w.iter().sum::<f64>()
}

/// A distribution over `charts` grids of `width` x `height` cells each, sampled by inversion in three steps: u.y
/// chooses a row of blocks, u.x a block of that row, and then both choose a cell among the sixteen of the block. Every
/// step rescales the number it used and is monotone in it, so stratified points stay stratified. Cumulative sums are
/// in f64 and span one row or one column of blocks, so that a cell in the row of a sun a million times its weight keeps
/// eight digits of its probability.
///
/// Memory: 4.75 bytes a cell.
#[derive(Debug, Clone)]
pub struct ChartDistribution {
    /// Rows of blocks, chart by chart.
    blocks: Vec<Block>,
    /// Over the rows of blocks of all charts.
    row_cdf: Vec<f64>,
    row_guide: Vec<u32>,
    /// Over the blocks of each row: `across + 1` and `across` entries a row.
    column_cdf: Vec<f64>,
    column_guide: Vec<u32>,
    /// Blocks in a row, and rows in a chart.
    across: usize,
    down: usize,
    /// Cells in a row, and rows of cells in a chart.
    width: usize,
    height: usize,
    /// One over the sum of the stored weights, which is 1 but for their rounding.
    normalization: f64,
    total: f64,
}

/// A cell, and a place in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChartCell {
    /// Which chart.
    pub chart: u32,
    /// Column of the cell.
    pub x: u32,
    /// Row of the cell.
    pub y: u32,
    /// Uniform position within the cell (x, y), both in [0, 1).
    pub du: [f64; 2],
    /// Probability of the cell, more than 0.
    pub pmf: f64,
}

impl ChartDistribution {
    /// From `charts * width * height` weights, row by row, chart by chart. Weights that are negative or not finite count
    /// as zero; so does what falls below 1e-38 of the sum. `None` if nothing is left, if the sum overflows, or if
    /// `weights` has another length.
    pub fn new(charts: usize, width: usize, height: usize, weights: &[f64]) -> Option<Self> {
        let total: f64 = weights.iter().map(|&w| usable(w)).sum();
        let (across, down) = (width.div_ceil(SIDE), height.div_ceil(SIDE));
        let expected = charts.checked_mul(width)?.checked_mul(height)?;
        if weights.len() != expected || !(total > 0.0 && total < f64::INFINITY) {
            return None;
        }
        let rows = charts * down;
        let mut d = ChartDistribution {
            blocks: vec![Block::default(); rows * across],
            row_cdf: vec![0.0; rows + 1],
            row_guide: vec![0; rows],
            column_cdf: vec![0.0; rows * (across + 1)],
            column_guide: vec![0; rows * across],
            across,
            down,
            width,
            height,
            normalization: 1.0,
            total,
        };
        for (row, line) in weights.chunks_exact(width).enumerate() {
            for (x, &w) in line.iter().enumerate() {
                let (block, k) = d.place(row / height, x, row % height);
                d.blocks[block].0[k] = (usable(w) / total) as f32;
            }
        }
        // From here on only the stored, rounded weights count, so that probabilities and choices agree.
        for (row, blocks) in d.blocks.chunks_exact(across).enumerate() {
            let cdf = &mut d.column_cdf[row * (across + 1)..][..across + 1];
            for (c, b) in cdf[1..].iter_mut().zip(blocks) {
                *c = b.columns().iter().sum();
            }
            d.row_cdf[row + 1] = accumulate(cdf, &mut d.column_guide[row * across..][..across]);
        }
        let sum = accumulate(&mut d.row_cdf, &mut d.row_guide);
        d.normalization = 1.0 / sum;
        (sum > 0.0).then_some(d)
    }

    /// Block and place within it of a cell.
    #[inline(always)]
    fn place(&self, chart: usize, x: usize, y: usize) -> (usize, usize) {
        let row = chart * self.down + y / SIDE;
        (row * self.across + x / SIDE, (y % SIDE) * SIDE + x % SIDE)
    }

    /// The distribution over the blocks of a row.
    #[inline(always)]
    fn row(&self, row: usize) -> Guided<'_> {
        Guided {
            cdf: &self.column_cdf[row * (self.across + 1)..][..self.across + 1],
            guide: &self.column_guide[row * self.across..][..self.across],
        }
    }

    /// Sum of the weights.
    pub fn total(&self) -> f64 {
        self.total
    }

    /// Bytes held.
    pub fn memory(&self) -> u64 {
        let guides = size_of_val(&*self.row_guide) + size_of_val(&*self.column_guide);
        let cdfs = size_of_val(&*self.row_cdf) + size_of_val(&*self.column_cdf);
        (size_of_val(&*self.blocks) + cdfs + guides) as u64
    }

    /// The cell at `u`, both in [0, 1) (clamped to it). A million cells need 20 bits of `u` to tell them apart: give it
    /// more than the 24 of an f32, such as `PixelSampler::get_2d_f64`.
    #[inline]
    pub fn sample(&self, u: [f64; 2]) -> ChartCell {
        let [ux, uy] = u.map(|v| v.clamp(0.0, ONE_MINUS));
        let row = Guided { cdf: &self.row_cdf, guide: &self.row_guide }.search(uy);
        let column = self.row(row.index).search(ux);
        let block = &self.blocks[row.index * self.across + column.index];
        let x = split(block.columns(), column.du);
        let weights = block.column(x.index);
        let y = split(weights, row.du);
        let (chart, block_y) = (row.index / self.down, row.index % self.down);
        ChartCell {
            chart: chart as u32,
            x: (column.index * SIDE + x.index) as u32,
            y: (block_y * SIDE + y.index) as u32,
            du: [x.u, y.u],
            pmf: weights[y.index] * self.normalization,
        }
    }

    /// Probability of a cell: that with which [`ChartDistribution::sample`] chooses it. Zero for cells that do not
    /// exist.
    #[inline]
    pub fn pmf(&self, chart: u32, x: u32, y: u32) -> f64 {
        let (chart, x, y) = (chart as usize, x as usize, y as usize);
        if x >= self.width || y >= self.height {
            return 0.0;
        }
        let (block, k) = self.place(chart, x, y);
        self.blocks.get(block).map_or(0.0, |b| f64::from(b.0[k]) * self.normalization)
    }

    /// The numbers that [`ChartDistribution::sample`] maps to this cell and place; `None` where its probability is 0.
    pub fn invert(&self, chart: u32, x: u32, y: u32, du: [f64; 2]) -> Option<[f64; 2]> {
        if self.pmf(chart, x, y) <= 0.0 {
            return None;
        }
        let (block_index, k) = self.place(chart as usize, x as usize, y as usize);
        let block = &self.blocks[block_index];
        let ux = unsplit(block.columns(), k % SIDE, du[0]);
        let uy = unsplit(block.column(k % SIDE), k / SIDE, du[1]);
        let (row, column) = (block_index / self.across, block_index % self.across);
        let within = |cdf: &[f64], i: usize, u: f64| (cdf[i] + u * (cdf[i + 1] - cdf[i])).min(ONE_MINUS);
        Some([within(self.row(row).cdf, column, ux), within(&self.row_cdf, row, uy)])
    }
}
