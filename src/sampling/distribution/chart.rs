//! A distribution over the cells of a few equal grids: what a sky is sampled by.

use super::{ONE_MINUS, usable};

/// Side of a block: every cell of a coarser level is the sum of a block of 4 x 4 finer ones. One block is one cache
/// line, and a sky of a million cells is five blocks deep.
const SIDE: usize = 4;
const BLOCK: usize = SIDE * SIDE;

/// Charts that fit into the topmost block.
const MAX_CHARTS: usize = BLOCK;

/// 4 x 4 weights, column by column.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(64))]
struct Block([f32; BLOCK]);

/// Where a number fell among four weights.
struct Split {
    index: usize,
    /// The number rescaled within the part, in [0, 1).
    u: f64,
}

/// Finds the part of `w` in which `u` in [0, 1) falls; parts of weight 0 are never chosen if any is positive.
#[inline(always)]
fn split(w: [f64; SIDE], u: f64) -> Split {
    let c = [w[0], w[0] + w[1], w[0] + w[1] + w[2], w[0] + w[1] + w[2] + w[3]];
    // Below the sum strictly, even after rounding: u is at most 1 - 2^-50.
    let x = u * c[3];
    let (p1, p2, p3) = (x >= c[0], x >= c[1], x >= c[2]);
    let index = usize::from(p1) + usize::from(p2) + usize::from(p3);
    let low = if p3 {
        c[2]
    } else if p2 {
        c[1]
    } else if p1 {
        c[0]
    } else {
        0.0
    };
    let width = if p3 {
        w[3]
    } else if p2 {
        w[2]
    } else if p1 {
        w[1]
    } else {
        w[0]
    };
    Split { index, u: ((x - low) / width).min(SAFE_BELOW_ONE) }
}

/// Stays below one through one multiplication and one rounding.
const SAFE_BELOW_ONE: f64 = 1.0 - 8.0 * f64::EPSILON;

impl Block {
    #[inline(always)]
    fn column(&self, k: usize) -> [f64; SIDE] {
        std::array::from_fn(|r| f64::from(self.0[k * SIDE + r]))
    }

    /// Sums of the columns.
    #[inline(always)]
    fn columns(&self) -> [f64; SIDE] {
        std::array::from_fn(|k| {
            let c = self.column(k);
            (c[0] + c[1]) + (c[2] + c[3])
        })
    }
}

/// One grid of blocks per chart, chart by chart.
#[derive(Debug, Clone)]
struct Level {
    blocks: Vec<Block>,
    /// Blocks across.
    width: usize,
    /// Blocks per chart.
    per_chart: usize,
}

impl Level {
    fn new(charts: usize, width: usize, height: usize) -> Self {
        let (width, height) = (width.div_ceil(SIDE), height.div_ceil(SIDE));
        let per_chart = width * height;
        Level { blocks: vec![Block::default(); charts * per_chart], width, per_chart }
    }

    #[inline(always)]
    fn block(&self, chart: usize, x: usize, y: usize) -> usize {
        chart * self.per_chart + y * self.width + x
    }

    /// Block and place within it of a cell.
    #[inline(always)]
    fn place(&self, chart: usize, x: usize, y: usize) -> (usize, usize) {
        (self.block(chart, x / SIDE, y / SIDE), (x % SIDE) * SIDE + y % SIDE)
    }

    fn height(&self) -> usize {
        self.per_chart / self.width
    }
}

/// A distribution over `charts` grids of `width` x `height` cells each, sampled by descending a tree of 4 x 4 sums
/// (hierarchical warping, after McCool and Harwood, "Probability Trees", 1997, and Clarberg et al., "Wavelet
/// Importance Sampling", 2005): u.x decides among columns, u.y among the cells of a column, each is rescaled, and so
/// down. Monotone within each step, so stratified points stay stratified; no cumulative sum is ever formed over more
/// than four numbers, so a cell next to a sun a million times its weight keeps all its digits.
///
/// Memory: 4.3 bytes a cell.
#[derive(Debug, Clone)]
pub struct ChartDistribution {
    /// Finest first.
    levels: Vec<Level>,
    /// The charts' sums, `top_columns` across.
    top: Block,
    top_columns: usize,
    width: usize,
    height: usize,
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
    /// Uniform position within the cell, both in [0, 1).
    pub du: [f64; 2],
    /// Probability of the cell, more than 0.
    pub pmf: f64,
}

impl ChartDistribution {
    /// From `charts * width * height` weights, row by row, chart by chart. Weights that are negative or not finite count
    /// as zero; so does what falls below 1e-38 of the sum. `None` if nothing is left or the sum overflows.
    ///
    /// # Panics
    /// If there are no charts or more than 16, no cells, or another number of weights.
    pub fn new(charts: usize, width: usize, height: usize, weights: &[f64]) -> Option<Self> {
        assert!((1..=MAX_CHARTS).contains(&charts), "{charts} charts; 1 to {MAX_CHARTS} are possible");
        assert!(width > 0 && height > 0 && weights.len() == charts * width * height);
        let total: f64 = weights.iter().map(|&w| usable(w)).sum();
        if !(total > 0.0 && total < f64::INFINITY) {
            return None;
        }
        let mut leaf = Level::new(charts, width, height);
        for (row, line) in weights.chunks_exact(width).enumerate() {
            let (chart, y) = (row / height, row % height);
            for (x, &w) in line.iter().enumerate() {
                let (block, k) = leaf.place(chart, x, y);
                leaf.blocks[block].0[k] = (usable(w) / total) as f32;
            }
        }
        let mut levels = vec![leaf];
        while let Some(finer) = levels.last().filter(|l| l.per_chart > 1) {
            let coarser = coarsen(finer, charts);
            levels.push(coarser);
        }
        let (mut top, top_columns) = (Block::default(), (1..).find(|c| c * c >= charts)?);
        for (chart, block) in levels.last()?.blocks.iter().enumerate() {
            top.0[top_place(chart, top_columns)] = block.columns().iter().sum::<f64>() as f32;
        }
        Some(ChartDistribution { levels, top, top_columns, width, height, total })
    }

    /// Sum of the weights.
    pub fn total(&self) -> f64 {
        self.total
    }

    /// Bytes held.
    pub fn memory(&self) -> u64 {
        self.levels.iter().map(|l| (l.blocks.len() * size_of::<Block>()) as u64).sum()
    }

    /// The cell at `u`, both in [0, 1) (clamped to it). A million cells need 20 bits of `u` to tell them apart: give it
    /// more than the 24 of an f32, such as `PixelSampler::get_2d_f64`.
    #[inline]
    pub fn sample(&self, u: [f64; 2]) -> ChartCell {
        let [mut ux, mut uy] = u.map(|v| v.clamp(0.0, SAFE_BELOW_ONE));
        let column = split(self.top.columns(), ux);
        let row = split(self.top.column(column.index), uy);
        (ux, uy) = (column.u, row.u);
        let chart = row.index * self.top_columns + column.index;
        let (mut x, mut y) = (0, 0);
        let mut pmf = 0.0;
        for level in self.levels.iter().rev() {
            let block = &level.blocks[level.block(chart, x, y)];
            let column = split(block.columns(), ux);
            let weights = block.column(column.index);
            let row = split(weights, uy);
            (ux, uy) = (column.u, row.u);
            (x, y) = (x * SIDE + column.index, y * SIDE + row.index);
            pmf = weights[row.index];
        }
        ChartCell { chart: chart as u32, x: x as u32, y: y as u32, du: [ux, uy], pmf }
    }

    /// Probability of a cell: that with which [`ChartDistribution::sample`] chooses it, to 1e-6 of itself. Zero for
    /// cells that do not exist.
    #[inline]
    pub fn pmf(&self, chart: u32, x: u32, y: u32) -> f64 {
        let (chart, x, y) = (chart as usize, x as usize, y as usize);
        let leaf = &self.levels[0];
        if x >= self.width || y >= self.height {
            return 0.0;
        }
        let (block, k) = leaf.place(chart, x, y);
        leaf.blocks.get(block).map_or(0.0, |b| f64::from(b.0[k]))
    }

    /// The numbers that [`ChartDistribution::sample`] maps to this cell and place; `None` where its probability is 0.
    pub fn invert(&self, chart: u32, x: u32, y: u32, du: [f64; 2]) -> Option<[f64; 2]> {
        if self.pmf(chart, x, y) <= 0.0 {
            return None;
        }
        let (chart, mut x, mut y) = (chart as usize, x as usize, y as usize);
        let mut u = du;
        for level in &self.levels {
            let (block, k) = level.place(chart, x, y);
            u = unsplit(&level.blocks[block], k, u);
            (x, y) = (x / SIDE, y / SIDE);
        }
        Some(unsplit(&self.top, top_place(chart, self.top_columns), u).map(|v| v.min(ONE_MINUS)))
    }
}

/// Place in the top block: as square an arrangement as there is, so that both numbers serve the choice of a chart.
#[inline(always)]
fn top_place(chart: usize, columns: usize) -> usize {
    (chart % columns) * SIDE + chart / columns
}

/// One level of inversion: the numbers that choose place `k` of `block` and leave `u`.
fn unsplit(block: &Block, k: usize, u: [f64; 2]) -> [f64; 2] {
    let back = |w: [f64; SIDE], index: usize, u: f64| {
        let low: f64 = w[..index].iter().sum();
        (low + u * w[index]) / w.iter().sum::<f64>()
    };
    let column = k / SIDE;
    [back(block.columns(), column, u[0]), back(block.column(column), k % SIDE, u[1])]
}

/// The level whose cells are the sums of the blocks of `finer`.
fn coarsen(finer: &Level, charts: usize) -> Level {
    let mut level = Level::new(charts, finer.width, finer.height());
    for chart in 0..charts {
        for i in 0..finer.per_chart {
            let sum: f64 = finer.blocks[chart * finer.per_chart + i].columns().iter().sum();
            let (block, k) = level.place(chart, i % finer.width, i / finer.width);
            level.blocks[block].0[k] = sum as f32;
        }
    }
    level
}
