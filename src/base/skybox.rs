//! Radiance by direction, cut into charts so that one light can sample every kind of sky.

use crate::color::Rgb;
use glam::{DVec3, Vec3};

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

    /// Radiance if it is the same everywhere; then no table is built.
    fn constant(&self) -> Option<Rgb> {
        None
    }

    /// The natural grid: no finer than what [`Skybox::radiance`] resolves.
    fn grid(&self) -> ChartGrid;

    /// Unit direction of a chart's point.
    fn direction(&self, c: ChartPoint) -> DVec3;

    /// The chart's point of a unit direction; inverse of [`Skybox::direction`].
    fn locate(&self, d: DVec3) -> ChartPoint;

    /// Solid angle per unit of u and v at a chart's point, steradians.
    fn solid_angle_density(&self, c: ChartPoint) -> f64;

    /// The integral of luminance over each cell of a `grid` at most as fine as the natural one, in double,
    /// row by row, chart by chart. Not zero wherever the radiance is not.
    fn cell_integrals(&self, grid: ChartGrid) -> Vec<f64>;

    /// Analytic parts.
    fn discs(&self) -> &[SkyDisc] {
        &[]
    }

    /// Bytes held.
    fn memory(&self) -> u64;
}
