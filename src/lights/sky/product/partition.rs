//! The charts of a sky cut into about a thousand cells, small where the light varies.
//!
//! Tables choose among cells by what surfaces make of them; what varies within a cell is noise to them. So cells are halved,
//! the one that adds most to the variance first, until there are as many as a table holds.

use super::super::plan::Level;
use super::inner::{Inner, MOST_HALVES};
use crate::base::skybox::{ChartGrid, ChartPoint, Skybox};
use glam::DVec3;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// Cells to begin with, along a chart's sides: of one chart that is the whole sphere, and of each of several.
const SPHERE_BLOCKS: [u32; 2] = [32, 16];
const FACE_BLOCKS: [u32; 2] = [8, 8];
/// What a steradian of a cell adds to its relative variance: the mean over surfaces, by the light that they get, of how
/// the cosine varies within a small square, s^2 tan^2 / 12.
const OF_ANGLE: f64 = 1.0 / 6.0;

/// A rectangle of cells of the finest grid.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rect {
    pub chart: u32,
    pub x: [u32; 2],
    pub y: [u32; 2],
}

/// A rectangle's halves, or its number among the cells.
#[derive(Debug, Clone, Copy)]
enum Node {
    Cell(u32),
    /// The first of the second half's columns, and the number of the first half's node; the second's follows.
    X(u32, u32),
    /// The same of rows.
    Y(u32, u32),
}

/// See the module.
pub(in super::super) struct Partition {
    grid: ChartGrid,
    across: usize,
    down: usize,
    /// The first blocks, row by row, chart by chart, then halves.
    nodes: Vec<Node>,
    cells: Vec<Rect>,
    /// The same for those who draw from them.
    patches: Vec<Patch>,
    scale: Scale,
    inner: Inner,
}

/// A cell as those who draw from it need it: half of a line of memory. In cells of the grid, which are fewer than f32 can
/// count.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(32))]
pub(in super::super) struct Patch {
    /// Least u and v.
    pub from: [f32; 2],
    /// How much u and v span.
    pub span: [f32; 2],
    pub chart: u32,
    /// Whether places in it are drawn by [`Partition::within`], and it has no density of its own.
    pub is_divided: bool,
    /// One over the area on the charts.
    pub density: f64,
}

/// From cells of the grid to charts.
#[derive(Debug, Clone, Copy)]
pub(in super::super) struct Scale {
    /// Of a cell on the charts.
    size: [f64; 2],
    /// How far directions keep off a patch's border: more than the rounding to f32 can carry them back over.
    rim: [f64; 2],
}

impl Scale {
    fn new(grid: &ChartGrid) -> Self {
        let sides = [grid.width, grid.height].map(f64::from);
        Scale { size: sides.map(|n| 1.0 / n), rim: sides.map(|n| n * 1.5e-7) }
    }

    /// A coordinate of the chart's point (u, then v) at this part of a patch's side, in [0, 1].
    #[inline(always)]
    pub fn at(&self, axis: usize, from: f32, span: f32, part: f64) -> f64 {
        let (span, rim) = (f64::from(span), self.rim[axis]);
        let x = part * span;
        let x = if x < rim { rim } else { x };
        let x = if x > span - rim { span - rim } else { x };
        (f64::from(from) + x) * self.size[axis]
    }
}

impl Patch {
    pub fn new(rect: &Rect, grid: &ChartGrid) -> Self {
        let span = [rect.x, rect.y].map(|[a, b]| (b - a) as f32);
        Patch {
            chart: rect.chart,
            is_divided: false,
            from: [rect.x[0] as f32, rect.y[0] as f32],
            span,
            density: f64::from(grid.width) * f64::from(grid.height) / rect.cells(),
        }
    }
}

/// What a rectangle brings: luminance, the sum of its squares over the grid's cells, solid angle.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Sums {
    pub flux: f64,
    squares: f64,
    angle: f64,
}

/// Waits to be halved.
pub(super) struct Candidate {
    pub gain: f64,
    pub node: u32,
    pub rect: Rect,
}

impl Ord for Candidate {
    fn cmp(&self, o: &Self) -> Ordering {
        self.gain.total_cmp(&o.gain).then(o.node.cmp(&self.node))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, o: &Self) -> Option<Ordering> {
        Some(self.cmp(o))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, o: &Self) -> bool {
        self.cmp(o) == Ordering::Equal
    }
}

impl Eq for Candidate {}

/// The first of the cells `0..n` that are the part `i` of `parts`.
fn edge(i: usize, n: u32, parts: usize) -> u32 {
    (i as u64 * u64::from(n) / parts as u64) as u32
}

/// The part of `parts` that cell `x` of `n` lies in.
fn part_of(x: u32, n: u32, parts: usize) -> usize {
    let guess = (u64::from(x) * parts as u64 / u64::from(n)) as usize;
    if guess + 1 < parts && edge(guess + 1, n, parts) <= x { guess + 1 } else { guess }
}

impl Sums {
    fn add(&mut self, o: &Sums) {
        self.flux += o.flux;
        self.squares += o.squares;
        self.angle += o.angle;
    }

    /// What a rectangle of `n` cells adds to the variance of one sample, up to a factor that all share: n sum f^2 / F is
    /// the second moment of light that arrives if it is chosen in proportion to its flux F, and F the square of the mean.
    pub fn spread(&self, n: f64) -> f64 {
        if self.flux > 0.0 { (n * self.squares / self.flux - self.flux).max(0.0) } else { 0.0 }
    }

    /// The same with that of what surfaces make of it, at so much a steradian.
    fn variance(&self, n: f64, of_angle: f64) -> f64 {
        self.spread(n) + of_angle * self.angle * self.flux
    }
}

impl Rect {
    pub fn cells(&self) -> f64 {
        f64::from(self.x[1] - self.x[0]) * f64::from(self.y[1] - self.y[0])
    }

    fn middle(&self) -> [u32; 2] {
        [self.x, self.y].map(|[a, b]| a + (b - a) / 2)
    }

    /// Sums over the four quarters about the middle, row by row; some are empty where a side is one cell.
    fn quarters(&self, level: &Level) -> [Sums; 4] {
        let ChartGrid { width, height, .. } = level.grid();
        let [mx, my] = self.middle();
        let mut sums = [Sums::default(); 4];
        for y in self.y[0]..self.y[1] {
            let row = (self.chart * height + y) as usize * width as usize;
            for (k, [a, b]) in [[self.x[0], mx], [mx, self.x[1]]].into_iter().enumerate() {
                let to = &mut sums[2 * usize::from(y >= my) + k];
                for i in row + a as usize..row + b as usize {
                    let flux = level.integral(i);
                    to.add(&Sums { flux, squares: flux * flux, angle: level.solid_angle(i) });
                }
            }
        }
        sums
    }

    /// The halves that leave less variance, and how much each leaves; None if it is one cell.
    pub fn halve(&self, level: &Level, of_angle: f64) -> Option<Halves> {
        let quarters = self.quarters(level);
        let [mx, my] = self.middle();
        let whole = |a: usize, b: usize| {
            let mut sums = quarters[a];
            sums.add(&quarters[b]);
            sums
        };
        let candidate = |along_x: bool| {
            let (ends, at, sums) = match along_x {
                true => (self.x, mx, [whole(0, 2), whole(1, 3)]),
                false => (self.y, my, [whole(0, 1), whole(2, 3)]),
            };
            let part = |k: usize| match along_x {
                true => Rect { x: if k == 0 { [ends[0], at] } else { [at, ends[1]] }, ..*self },
                false => Rect { y: if k == 0 { [ends[0], at] } else { [at, ends[1]] }, ..*self },
            };
            let parts = [part(0), part(1)];
            let variances = [0, 1].map(|k| sums[k].variance(parts[k].cells(), of_angle));
            (at > ends[0]).then_some(Halves { along_x, at, parts, sums, variances })
        };
        let left = |h: &Halves| h.variances[0] + h.variances[1];
        let both = [candidate(true), candidate(false)];
        both.into_iter().flatten().min_by(|a, b| left(a).total_cmp(&left(b)))
    }

    /// The sums over all of it.
    pub fn sums(&self, level: &Level) -> Sums {
        let mut all = Sums::default();
        self.quarters(level).iter().for_each(|q| all.add(q));
        all
    }

    /// The chart's point at these parts of the sides, in [0, 1].
    fn point(&self, grid: &ChartGrid, part: [f64; 2]) -> ChartPoint {
        let at = |[a, b]: [u32; 2], n: u32, part: f64| {
            (f64::from(a) + part * (f64::from(b) - f64::from(a))) / f64::from(n)
        };
        ChartPoint {
            chart: self.chart,
            u: at(self.x, grid.width, part[0]),
            v: at(self.y, grid.height, part[1]),
        }
    }
}

/// Two halves of a rectangle.
pub(super) struct Halves {
    pub along_x: bool,
    /// The first of the second half's columns or rows.
    pub at: u32,
    pub parts: [Rect; 2],
    pub sums: [Sums; 2],
    variances: [f64; 2],
}

/// What is known of a cell.
pub(in super::super) struct CellLight {
    /// Integral of luminance.
    pub flux: f64,
    /// Solid angle.
    pub angle: f64,
    /// Unit direction to the middle of its light.
    pub middle: DVec3,
    /// Sine, at least, of the largest angle between it and a direction of the cell.
    pub reach: f32,
    /// From the cell's centre to the middles of its sides of larger u and of larger v.
    pub sides: [DVec3; 2],
}

impl Partition {
    /// Into `most` cells, or as many as it takes until each is one of the grid's.
    pub fn new(level: &Level, most: usize, has_halves: bool) -> Self {
        let grid = level.grid();
        let [across, down] = if grid.count == 1 { SPHERE_BLOCKS } else { FACE_BLOCKS };
        let (across, down) = (across.min(grid.width) as usize, down.min(grid.height) as usize);
        let blocks = grid.count as usize * across * down;
        let block = |i: usize| {
            let (row, column) = (i / across, i % across);
            let (chart, y) = (row / down, row % down);
            let span = |i: usize, n: u32, parts: usize| [edge(i, n, parts), edge(i + 1, n, parts)];
            Rect { chart: chart as u32, x: span(column, grid.width, across), y: span(y, grid.height, down) }
        };
        let rects: Vec<Rect> = (0..blocks).map(block).collect();
        let gains: Vec<f64> = rects.par_iter().map(|r| r.sums(level).variance(r.cells(), OF_ANGLE)).collect();
        let mut heap: BinaryHeap<Candidate> = (0..)
            .zip(rects.iter().zip(&gains))
            .map(|(node, (&rect, &gain))| Candidate { gain, node, rect })
            .collect();
        let mut all = rects;
        let mut nodes = vec![Node::Cell(0); blocks];
        let mut count = blocks;
        while count < most {
            let Some(c) = heap.pop().filter(|c| c.gain > 0.0) else { break };
            let Some(halves) = c.rect.halve(level, OF_ANGLE) else { continue };
            let first = nodes.len() as u32;
            nodes[c.node as usize] =
                if halves.along_x { Node::X(halves.at, first) } else { Node::Y(halves.at, first) };
            for (k, (rect, gain)) in (0..).zip(halves.parts.into_iter().zip(halves.variances)) {
                nodes.push(Node::Cell(0));
                all.push(rect);
                heap.push(Candidate { gain, node: first + k, rect });
            }
            count += 1;
        }
        let mut cells = Vec::with_capacity(count);
        for (node, rect) in nodes.iter_mut().zip(all) {
            if let Node::Cell(number) = node {
                *number = cells.len() as u32;
                cells.push(rect);
            }
        }
        let inner = Inner::new(level, &cells, if has_halves { MOST_HALVES } else { 0 });
        let patch = |(i, rect)| Patch { is_divided: inner.is_divided(i), ..Patch::new(rect, &grid) };
        let patches = cells.iter().enumerate().map(patch).collect();
        Partition { grid, across, down, nodes, cells, patches, scale: Scale::new(&grid), inner }
    }

    /// All cells.
    pub fn patches(&self) -> &[Patch] {
        &self.patches
    }

    /// What their numbers mean.
    #[inline(always)]
    pub fn scale(&self) -> &Scale {
        &self.scale
    }

    /// The point at these parts of a patch's sides, in [0, 1].
    #[inline(always)]
    pub fn point(&self, patch: &Patch, part: [f64; 2]) -> ChartPoint {
        let [u, v] = [0, 1].map(|k| self.scale.at(k, patch.from[k], patch.span[k], part[k]));
        ChartPoint { chart: patch.chart, u, v }
    }

    /// The part of a cell that two numbers in [0, 1] lead to, and what is left of them.
    #[inline]
    pub fn within(&self, cell: usize, part: [f64; 2]) -> (&Patch, [f64; 2]) {
        let patch = &self.patches[cell];
        if patch.is_divided { self.inner.draw(cell, part) } else { (patch, part) }
    }

    /// The number of the cell that a point lies in, and the part of the cell.
    #[inline]
    pub fn find(&self, at: ChartPoint) -> (usize, &Patch) {
        let cell = |u: f64, n: u32| ((u * f64::from(n)) as u32).min(n - 1);
        let (x, y) = (cell(at.u, self.grid.width), cell(at.v, self.grid.height));
        let row = at.chart as usize * self.down + part_of(y, self.grid.height, self.down);
        let mut node = row * self.across + part_of(x, self.grid.width, self.across);
        loop {
            node = match self.nodes[node] {
                Node::Cell(number) => {
                    let patch = &self.patches[number as usize];
                    return match patch.is_divided {
                        true => (number as usize, self.inner.find(number as usize, [x, y])),
                        false => (number as usize, patch),
                    };
                }
                Node::X(at, first) => first as usize + usize::from(x >= at),
                Node::Y(at, first) => first as usize + usize::from(y >= at),
            };
        }
    }

    /// What is known of each cell.
    pub fn lights(&self, sky: &dyn Skybox, level: &Level) -> Vec<CellLight> {
        self.cells.par_iter().map(|r| self.light(sky, level, r)).collect()
    }

    fn light(&self, sky: &dyn Skybox, level: &Level, rect: &Rect) -> CellLight {
        const SIDE: u32 = 4;
        let part = |i: u32, [a, b]: [u32; 2]| (i - a) * SIDE / (b - a);
        let mut sums = [0.0; (SIDE * SIDE) as usize];
        for y in rect.y[0]..rect.y[1] {
            let row = (rect.chart * self.grid.height + y) as usize * self.grid.width as usize;
            for x in rect.x[0]..rect.x[1] {
                let of = part(y, rect.y) * SIDE + part(x, rect.x);
                sums[of as usize] += level.integral(row + x as usize);
            }
        }
        let lattice = |k: u32, n: u32, first: f64| {
            let at = |k: u32| (f64::from(k) + first) / f64::from(SIDE);
            sky.direction(rect.point(&self.grid, [at(k % n), at(k / n)]))
        };
        let flux: f64 = sums.iter().sum();
        let light: DVec3 = (0..)
            .zip(&sums)
            .map(|(k, s)| if *s > 0.0 { lattice(k, SIDE, 0.5) * *s } else { DVec3::ZERO })
            .sum();
        let borders = || (0..(SIDE + 1) * (SIDE + 1)).map(|k| lattice(k, SIDE + 1, 0.0));
        let middle = (light / flux.max(f64::MIN_POSITIVE))
            .try_normalize()
            .or_else(|| borders().sum::<DVec3>().try_normalize())
            .unwrap_or(DVec3::Y);
        // Chords are longer than sines; the margin is for what lies between the points.
        let reach = borders().map(|p| (p - middle).length()).fold(0.0, f64::max);
        let side = |part: [f64; 2]| {
            sky.direction(rect.point(&self.grid, part)) - sky.direction(rect.point(&self.grid, [0.5, 0.5]))
        };
        CellLight {
            flux,
            angle: rect.sums(level).angle,
            middle,
            reach: (1.02 * reach) as f32,
            sides: [side([1.0, 0.5]), side([0.5, 1.0])],
        }
    }

    /// Bytes held.
    pub fn memory(&self) -> u64 {
        let own = size_of_val(&*self.nodes) + size_of_val(&*self.cells) + size_of_val(&*self.patches);
        own as u64 + self.inner.memory()
    }
}
