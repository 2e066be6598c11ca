//! Radiance by direction, cut into charts so that one light can sample every kind of sky.

use crate::base::directions::{Directions, LANES};
use crate::color::Rgb;
use crate::math::simd::{Kernel, dispatch};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// A point of a chart; u and v run over [0, 1].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChartPoint {
    /// Which chart.
    pub chart: u32,
    /// Across.
    pub u: f64,
    /// Along.
    pub v: f64,
}

/// A few points of charts as columns.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(64))]
pub struct ChartLanes {
    /// Across.
    pub u: [f64; LANES],
    /// Along.
    pub v: [f64; LANES],
    /// Which chart.
    pub chart: [u32; LANES],
}

/// Their directions, with [`Skybox::solid_angle_density`].
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(64))]
pub struct ChartDirections {
    /// x of each.
    pub x: [f64; LANES],
    /// y of each.
    pub y: [f64; LANES],
    /// z of each.
    pub z: [f64; LANES],
    /// Steradians per unit of u and v.
    pub density: [f64; LANES],
}

impl ChartLanes {
    /// Point `k`.
    #[inline(always)]
    pub fn get(&self, k: usize) -> ChartPoint {
        ChartPoint { chart: self.chart[k], u: self.u[k], v: self.v[k] }
    }

    /// What `toward`, which has to be inlined always, makes of all points, in vector code.
    #[inline]
    pub fn directions(&self, toward: impl Fn(ChartPoint) -> (DVec3, f64)) -> ChartDirections {
        dispatch(Toward { at: self, toward })
    }
}

struct Toward<'a, F> {
    at: &'a ChartLanes,
    toward: F,
}

impl<F: Fn(ChartPoint) -> (DVec3, f64)> Kernel for Toward<'_, F> {
    type Output = ChartDirections;

    #[inline(always)]
    fn run(self) -> ChartDirections {
        let mut out = ChartDirections::default();
        for k in 0..LANES {
            out.set(k, (self.toward)(self.at.get(k)));
        }
        out
    }
}

impl ChartDirections {
    /// Sets number `k` to a direction and its density.
    #[inline(always)]
    pub fn set(&mut self, k: usize, (d, density): (DVec3, f64)) {
        [self.x[k], self.y[k], self.z[k]] = d.to_array();
        self.density[k] = density;
    }
}

/// How the sphere of directions is cut: `count` charts of `width` x `height` cells each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ChartGrid {
    /// Number of charts: 1 for a sphere map, 6 for a cube.
    pub count: u32,
    /// Cells across.
    pub width: u32,
    /// Cells along.
    pub height: u32,
}

/// An analytic part of a sky: a disc of constant radiance, such as the sun.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkyDisc {
    /// Unit direction to its centre.
    pub toward: DVec3,
    /// Half of its angle across, radians, in (0, pi/2).
    pub half_angle: f64,
    /// Radiance within it, added to that of the map.
    pub radiance: Rgb,
}

/// A sky: radiance by unit direction in world space axes (y up).
pub trait Skybox: Send + Sync {
    /// Radiance of the map alone, without the discs.
    fn radiance(&self, d: Vec3) -> Rgb;

    /// [`Skybox::radiance`] of many directions, bit for bit; as many as `out` has room for.
    fn radiance_batch(&self, d: Directions, out: &mut [Rgb]) {
        for (i, o) in out.iter_mut().enumerate() {
            *o = self.radiance(d.get(i));
        }
    }

    /// Radiance if it is the same everywhere; then no table is built.
    fn constant(&self) -> Option<Rgb> {
        None
    }

    /// Whether radiance has no detail but a straight horizon: where points that lie a degree apart fit to each other, there
    /// is nothing else between them.
    fn is_smooth(&self) -> bool {
        false
    }

    /// The natural grid: no finer than what [`Skybox::radiance`] resolves.
    fn grid(&self) -> ChartGrid;

    /// Unit direction of a chart's point.
    fn direction(&self, c: ChartPoint) -> DVec3;

    /// The chart's point of a unit direction; inverse of [`Skybox::direction`].
    fn locate(&self, d: DVec3) -> ChartPoint;

    /// Solid angle per unit of u and v at a chart's point, steradians.
    fn solid_angle_density(&self, c: ChartPoint) -> f64;

    /// [`Skybox::direction`] and [`Skybox::solid_angle_density`] of a point, which share most of their arithmetic.
    fn direction_and_density(&self, c: ChartPoint) -> (DVec3, f64) {
        (self.direction(c), self.solid_angle_density(c))
    }

    /// [`Skybox::direction_and_density`] of the first `n` points, bit for bit; what it makes of the others means nothing.
    fn directions_and_densities(&self, at: &ChartLanes, n: usize) -> ChartDirections {
        let mut out = ChartDirections::default();
        (0..n).for_each(|k| out.set(k, self.direction_and_density(at.get(k))));
        out
    }

    /// The integral of luminance over each cell of a `grid` at most as fine as the natural one, in double,
    /// row by row (the row of v = 0 first), chart by chart. Not zero wherever the radiance is not. By quadrature
    /// unless a sky knows better.
    fn cell_integrals(&self, grid: ChartGrid) -> Vec<f64> {
        // However coarse the grid, the natural one is what resolves the radiance.
        let natural = self.grid();
        let parts = [natural.width.div_ceil(grid.width), natural.height.div_ceil(grid.height)];
        integrate_parts(grid, parts, |c| {
            let l = self.radiance(self.direction(c).as_vec3()).luminance();
            f64::from(l) * self.solid_angle_density(c)
        })
    }

    /// Irradiance of the map alone on an unoccluded surface with unit normal `n`, where a closed form is known.
    fn irradiance_closed_form(&self, _n: DVec3) -> Option<Rgb> {
        None
    }

    /// Analytic parts.
    fn discs(&self) -> &[SkyDisc] {
        &[]
    }

    /// Bytes held.
    fn memory(&self) -> u64;
}

impl SkyDisc {
    /// Solid angle, steradians.
    pub fn solid_angle(&self) -> f64 {
        // 2 pi (1 - cos a) without cancellation.
        4.0 * std::f64::consts::PI * (0.5 * self.half_angle).sin().powi(2)
    }
}

impl ChartGrid {
    /// The number of cells of all charts.
    pub fn cells(&self) -> usize {
        self.count as usize * self.width as usize * self.height as usize
    }
}

/// Abscissas in [0, 1] of the two-point Gauss rule on either half: what is smooth, or bends in the middle of a cell
/// as bilinear filters of the cell's own width do, is met to fourth order.
const ABSCISSAS: [f64; 4] =
    [0.105_662_432_702_593_56, 0.394_337_567_297_406_44, 0.605_662_432_702_593_6, 0.894_337_567_297_406_4];

/// As [`integrate_cells`], with each cell cut into `parts` across and along, of at least 1.
fn integrate_parts(grid: ChartGrid, parts: [u32; 2], f: impl Fn(ChartPoint) -> f64 + Sync) -> Vec<f64> {
    let [across, along] = parts.map(|n| n as usize);
    let (width, height) = (grid.width * parts[0], grid.height * parts[1]);
    let fine = integrate_cells(ChartGrid { width, height, ..grid }, f);
    let w = grid.width as usize;
    // Rows of all charts follow one another, and so do those of the parts.
    let cell = |i: usize| {
        let start = i / w * along * w * across + i % w * across;
        let row = |k: usize| fine[start + k * w * across..][..across].iter().sum::<f64>();
        (0..along).map(row).sum()
    };
    (0..grid.cells()).map(cell).collect()
}

/// Integrals of `f` over each cell of `grid`, row by row, chart by chart: 16 points a cell, in parallel.
pub fn integrate_cells(grid: ChartGrid, f: impl Fn(ChartPoint) -> f64 + Sync) -> Vec<f64> {
    let (w, h) = (grid.width as usize, grid.height as usize);
    let scale = 1.0 / (16.0 * w as f64 * h as f64);
    let mut out = vec![0.0; grid.cells()];
    out.par_chunks_mut(w).enumerate().for_each(|(row, cells)| {
        let chart = (row / h) as u32;
        for (x, cell) in cells.iter_mut().enumerate() {
            let mut sum = 0.0;
            for b in ABSCISSAS {
                let v = ((row % h) as f64 + b) / h as f64;
                for a in ABSCISSAS {
                    sum += f(ChartPoint { chart, u: (x as f64 + a) / w as f64, v });
                }
            }
            *cell = sum * scale;
        }
    });
    out
}
