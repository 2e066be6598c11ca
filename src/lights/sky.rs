//! The one light behind every sky: whatever its charts, it is sampled by a table of exact cell integrals, by
//! inversion, and its analytic discs by their cones.

use crate::base::light::{Extent, Light, LightSample, PathEnd, Receiver};
use crate::base::skybox::{ChartGrid, ChartPoint, SkyDisc, Skybox};
use crate::color::Rgb;
use crate::error::{Error, Result, unknown_name};
use crate::math::frame::Frame;
use crate::sampler::hash::extend_unit;
use crate::sampling::distribution::ChartDistribution;
use crate::sampling::warp::{cosine_hemisphere, uniform_cone};
use glam::{Vec2, Vec3};
use std::f64::consts::PI;
use std::str::FromStr;
use std::sync::Arc;

/// How directions to the sky are sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SkySampling {
    /// By what exceeds the mean: scattering finds the rest, and both are weighted together (Karlik et al. 2019, "MIS
    /// Compensation: Optimizing Sampling Techniques in Multiple Importance Sampling"). A constant sky leaves nothing.
    #[default]
    Compensated,
    /// By radiance.
    Table,
    /// By the cosine at the receiver, whatever the sky shows.
    Cosine,
}

impl SkySampling {
    /// Names as the command line and scene files spell them.
    pub const NAMES: [(&'static str, SkySampling); 3] = [
        ("compensated", SkySampling::Compensated),
        ("table", SkySampling::Table),
        ("cosine", SkySampling::Cosine),
    ];
}

impl FromStr for SkySampling {
    type Err = Error;

    fn from_str(s: &str) -> Result<Self> {
        let found = Self::NAMES.iter().find(|(name, _)| *name == s);
        let known = Self::NAMES.iter().map(|(name, _)| *name);
        found.map(|(_, k)| *k).ok_or_else(|| Error::Usage(unknown_name("sky sampling", s, known)))
    }
}

/// How a sky is placed and sampled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkyOptions {
    /// Scales its radiance; finite and at least 0.
    pub intensity: f64,
    /// Turns it about +y, degrees, counter-clockwise seen from above.
    pub rotate_y_deg: f64,
    /// See [`SkySampling`].
    pub sampling: SkySampling,
}

impl Default for SkyOptions {
    fn default() -> Self {
        SkyOptions { intensity: 1.0, rotate_y_deg: 0.0, sampling: SkySampling::default() }
    }
}

/// A sky as a light.
pub struct SkyLight {
    skybox: Arc<dyn Skybox>,
    intensity: f32,
    turn: Turn,
    sampling: SkySampling,
    table: Option<Table>,
    discs: Vec<Disc>,
    /// Probability that a sample is taken from the discs.
    disc_share: f64,
    /// Integral of luminance over the sphere, discs included, before `intensity`.
    total: f64,
}

/// Cells and their densities.
struct Table {
    cells: ChartDistribution,
    grid: ChartGrid,
}

/// A disc, in the sky's own axes.
struct Disc {
    disc: SkyDisc,
    frame: Frame,
    /// 1 - cos of the half angle.
    height: f32,
    /// Density within it, given that this disc is chosen.
    density: f64,
    /// Upper end of its share of the discs' samples.
    below: f64,
    share: f64,
}

/// A turn about +y.
#[derive(Clone, Copy)]
struct Turn {
    sin: f32,
    cos: f32,
}

impl Turn {
    /// From world to the sky's own axes.
    #[inline]
    fn to_sky(self, d: Vec3) -> Vec3 {
        Vec3::new(self.cos * d.x - self.sin * d.z, d.y, self.sin * d.x + self.cos * d.z)
    }

    /// From the sky's own axes to world.
    #[inline]
    fn to_world(self, d: Vec3) -> Vec3 {
        Vec3::new(self.cos * d.x + self.sin * d.z, d.y, self.cos * d.z - self.sin * d.x)
    }
}

impl SkyLight {
    /// From a sky. Errors where the intensity is not a number of at least 0, or the angle not finite.
    pub fn new(skybox: Arc<dyn Skybox>, o: &SkyOptions) -> Result<Self> {
        if !(o.intensity.is_finite() && o.intensity >= 0.0 && o.intensity <= f64::from(f32::MAX)) {
            return Err(Error::Usage(format!(
                "a sky's intensity is a number of at least 0, not {}",
                o.intensity
            )));
        }
        if !o.rotate_y_deg.is_finite() {
            return Err(Error::Usage("the angle by which a sky is turned is not finite".into()));
        }
        let (sin, cos) = o.rotate_y_deg.rem_euclid(360.0).to_radians().sin_cos();
        let (table, map_total) = match skybox.constant() {
            // The same everywhere: scattering finds it at once, and no table can help.
            Some(c) if o.sampling != SkySampling::Table => (None, 4.0 * PI * f64::from(c.luminance())),
            _ => build_table(skybox.as_ref(), o.sampling),
        };
        let discs = place_discs(skybox.discs());
        let disc_total: f64 = skybox.discs().iter().map(disc_power).sum();
        // What the table is sampled for is what it holds, less what compensation leaves to scattering.
        let table_total = table.as_ref().map_or(0.0, |t| t.cells.total());
        let disc_share = if disc_total > 0.0 { disc_total / (disc_total + table_total) } else { 0.0 };
        Ok(SkyLight {
            skybox,
            intensity: o.intensity as f32,
            turn: Turn { sin: sin as f32, cos: cos as f32 },
            sampling: o.sampling,
            table,
            discs,
            // With a table as well as discs both keep a tenth at least: a guard where one is blocked.
            disc_share: if table_total > 0.0 && disc_share > 0.0 {
                disc_share.clamp(0.1, 0.9)
            } else {
                disc_share
            },
            total: map_total + disc_total,
        })
    }

    /// Radiance from a unit direction in the sky's own axes, discs included, before `intensity`.
    #[inline]
    fn radiance(&self, d: Vec3) -> Rgb {
        let mut sum = self.skybox.radiance(d);
        for k in &self.discs {
            if k.holds(d) {
                sum += k.disc.radiance;
            }
        }
        sum
    }

    /// Density of table and discs together.
    #[inline]
    fn density(&self, d: Vec3, cell: Option<f64>) -> f64 {
        let mut pdf = 0.0;
        for k in &self.discs {
            if k.holds(d) {
                pdf += self.disc_share * k.share * k.density;
            }
        }
        if let Some(t) = &self.table {
            pdf += (1.0 - self.disc_share) * cell.unwrap_or_else(|| t.density(self.skybox.as_ref(), d));
        }
        pdf
    }

    /// A direction in the sky's own axes and its density.
    fn sample_direction(&self, u: [f32; 2]) -> Option<(Vec3, f64)> {
        // An f32 pair cannot address the cells of a large table.
        let [mut x, y] = extend_unit(u);
        if x < self.disc_share {
            x /= self.disc_share;
            let k = self.discs.iter().find(|k| x < k.below).or(self.discs.last())?;
            let within = ((x - (k.below - k.share)) / k.share).clamp(0.0, 1.0) as f32;
            let d = k.frame.to_world(uniform_cone(Vec2::new(within, u[1]), k.height));
            // Rounding may have put it a hair outside: it is inside by construction.
            let inside = if k.holds(d) { 0.0 } else { self.disc_share * k.share * k.density };
            return Some((d, self.density(d, None) + inside));
        }
        let t = self.table.as_ref()?;
        x = (x - self.disc_share) / (1.0 - self.disc_share);
        let cell = t.cells.sample([x, y]);
        let c = ChartPoint {
            chart: cell.chart,
            u: (f64::from(cell.x) + cell.du[0]) / f64::from(t.grid.width),
            v: (f64::from(cell.y) + cell.du[1]) / f64::from(t.grid.height),
        };
        let d = self.skybox.direction(c).as_vec3();
        let per_chart = f64::from(t.grid.width) * f64::from(t.grid.height);
        let cell = cell.pmf * per_chart / self.skybox.solid_angle_density(c);
        Some((d, self.density(d, Some(cell))))
    }
}

impl Light for SkyLight {
    fn sample_li(&self, at: &Receiver, u: [f32; 2]) -> Option<LightSample> {
        if self.sampling == SkySampling::Cosine {
            if at.ns == Vec3::ZERO {
                return None;
            }
            let local = cosine_hemisphere(u.into());
            let wi = Frame::from_z(at.ns).to_world(local);
            let pdf = local.z * std::f32::consts::FRAC_1_PI;
            let li = self.radiance(self.turn.to_sky(wi)) * self.intensity;
            return (pdf > 0.0).then_some(LightSample { wi, dist: f32::INFINITY, li, pdf, delta: false });
        }
        let (d, pdf) = self.sample_direction(u)?;
        let wi = self.turn.to_world(d);
        // Behind both horizons nothing can scatter it to the side that asks.
        if wi.dot(at.ng) < 0.0 && wi.dot(at.ns) < 0.0 {
            return None;
        }
        let li = self.radiance(d) * self.intensity;
        let pdf = pdf as f32;
        (pdf > 0.0 && pdf.is_finite()).then_some(LightSample {
            wi,
            dist: f32::INFINITY,
            li,
            pdf,
            delta: false,
        })
    }

    fn pdf_li(&self, at: &Receiver, end: &PathEnd) -> f32 {
        match self.sampling {
            SkySampling::Cosine => end.wi.dot(at.ns).max(0.0) * std::f32::consts::FRAC_1_PI,
            _ => self.density(self.turn.to_sky(end.wi), None) as f32,
        }
    }

    fn le(&self, end: &PathEnd) -> Rgb {
        if end.vertex.is_some() {
            return Rgb::BLACK;
        }
        self.radiance(self.turn.to_sky(end.wi)) * self.intensity
    }

    fn at_infinity(&self) -> bool {
        true
    }

    fn power(&self, extent: &Extent) -> f32 {
        let r = f64::from(extent.radius);
        (PI * r * r * self.total * f64::from(self.intensity)) as f32
    }

    fn irradiance_closed_form(&self, _p: Vec3, n: Vec3) -> Option<Rgb> {
        let map = self.skybox.irradiance_closed_form(self.turn.to_sky(n).as_dvec3())?;
        self.discs.is_empty().then(|| map * self.intensity)
    }
}

impl Disc {
    #[inline]
    fn holds(&self, d: Vec3) -> bool {
        // |d - axis|^2 = 2 (1 - cos): no cancellation at small angles.
        (d - self.frame.n).length_squared() <= 2.0 * self.height
    }
}

impl Table {
    #[inline]
    fn density(&self, skybox: &dyn Skybox, d: Vec3) -> f64 {
        let c = skybox.locate(d.as_dvec3());
        let (w, h) = (self.grid.width, self.grid.height);
        let x = ((c.u * f64::from(w)) as u32).min(w - 1);
        let y = ((c.v * f64::from(h)) as u32).min(h - 1);
        self.cells.pmf(c.chart, x, y) * f64::from(w) * f64::from(h) / skybox.solid_angle_density(c)
    }
}

fn disc_power(d: &SkyDisc) -> f64 {
    d.solid_angle() * f64::from(d.radiance.luminance())
}

fn place_discs(discs: &[SkyDisc]) -> Vec<Disc> {
    let total: f64 = discs.iter().map(disc_power).sum();
    let mut below = 0.0;
    let lit = discs.iter().filter(|d| disc_power(d) > 0.0);
    lit.map(|d| {
        let share = disc_power(d) / total;
        below += share;
        Disc {
            disc: *d,
            frame: Frame::from_z(d.toward.as_vec3()),
            height: (d.solid_angle() / (2.0 * PI)) as f32,
            density: 1.0 / d.solid_angle(),
            below,
            share,
        }
    })
    .collect()
}

/// Most cells of a table: 36 MB.
const MAX_CELLS: usize = 1 << 23;

/// Variance that a coarser table may add: it is looked up for every shadow ray, and should stay in cache.
const COARSER_MAY_COST: f64 = 1.01;

/// The table and the integral of luminance over the map.
fn build_table(skybox: &dyn Skybox, sampling: SkySampling) -> (Option<Table>, f64) {
    let mut grid = skybox.grid();
    while grid.cells() > MAX_CELLS {
        grid = ChartGrid { width: grid.width.div_ceil(2), height: grid.height.div_ceil(2), ..grid };
    }
    let mut integrals = skybox.cell_integrals(grid);
    let total: f64 = integrals.iter().sum();
    if sampling == SkySampling::Cosine {
        return (None, total);
    }
    coarsen(skybox, &mut grid, &mut integrals);
    if sampling == SkySampling::Compensated {
        let mean = total / (4.0 * PI);
        let omega = solid_angles(skybox, grid);
        integrals.iter_mut().zip(omega).for_each(|(i, o)| *i = (*i - mean * o).max(0.0));
    }
    // What is left of a sky that is flat but for rounding is noise: scattering alone is better.
    let left: f64 = integrals.iter().sum();
    if left <= 1e-4 * total {
        return (None, total);
    }
    let cells =
        ChartDistribution::new(grid.count as usize, grid.width as usize, grid.height as usize, &integrals);
    (cells.map(|cells| Table { cells, grid }), total)
}

/// Solid angles of the cells, by their middles: exact enough for choices, and no density depends on them.
fn solid_angles(skybox: &dyn Skybox, grid: ChartGrid) -> Vec<f64> {
    let (w, h) = (f64::from(grid.width), f64::from(grid.height));
    let mut out = Vec::with_capacity(grid.cells());
    for chart in 0..grid.count {
        for y in 0..grid.height {
            for x in 0..grid.width {
                let c = ChartPoint { chart, u: (f64::from(x) + 0.5) / w, v: (f64::from(y) + 0.5) / h };
                out.push(skybox.solid_angle_density(c) / (w * h));
            }
        }
    }
    out
}

/// Halves the table while the second moment of its estimate of the sky's irradiance grows by no more than
/// [`COARSER_MAY_COST`] over that of the finest.
fn coarsen(skybox: &dyn Skybox, grid: &mut ChartGrid, integrals: &mut Vec<f64>) {
    let omega = solid_angles(skybox, *grid);
    // Second moments within cells, from the finest grid on.
    let mut squares: Vec<f64> =
        integrals.iter().zip(&omega).map(|(i, o)| if *o > 0.0 { i * i / o } else { 0.0 }).collect();
    let mut omega = omega;
    let total: f64 = integrals.iter().sum();
    while grid.width.is_multiple_of(2) && grid.height.is_multiple_of(2) && grid.width.min(grid.height) > 16 {
        let half = |values: &[f64]| halved(values, *grid);
        let (i2, s2, o2) = (half(integrals), half(&squares), half(&omega));
        let moment: f64 =
            i2.iter().zip(&s2).zip(&o2).map(|((i, s), o)| if *i > 0.0 { s * o / i } else { 0.0 }).sum();
        // The finest table's moment is the square of the total.
        if moment > COARSER_MAY_COST * total {
            return;
        }
        *grid = ChartGrid { width: grid.width / 2, height: grid.height / 2, ..*grid };
        (*integrals, squares, omega) = (i2, s2, o2);
    }
}

/// Sums of 2x2 cells.
fn halved(values: &[f64], grid: ChartGrid) -> Vec<f64> {
    let w = grid.width as usize;
    values
        .chunks_exact(2 * w)
        .flat_map(|rows| {
            let (a, b) = rows.split_at(w);
            a.chunks_exact(2).zip(b.chunks_exact(2)).map(|(a, b)| a[0] + a[1] + b[0] + b[1])
        })
        .collect()
}
