//! The light of a sky, of whatever kind.

mod plan;

use crate::base::directions::{DirectionBatch, Directions};
use crate::base::light::{Extent, Light, LightSample, PathEnd, Receiver};
use crate::base::skybox::{ChartGrid, ChartPoint, SkyDisc, Skybox};
use crate::color::Rgb;
use crate::error::{Error, Result, unknown_name};
use crate::math::Frame;
use crate::memory;
use crate::sampler::hash::extend_unit;
use crate::sampling::distribution::ChartDistribution;
use crate::sampling::warp;
use glam::{DVec3, Vec2, Vec3};
use plan::Plan;
use std::f64::consts::PI;
use std::str::FromStr;
use std::sync::Arc;

/// How directions to the map of a sky are sampled; discs are sampled uniformly within their cones by all methods.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SkySampling {
    /// By the luminance that rises above the average, where that pays: BSDF sampling finds the rest as well (Karlik et
    /// al. 2019). Under a constant sky nothing is left and there is no sample.
    #[default]
    Compensated,
    /// By luminance.
    Table,
    /// By the cosine to the receiver's shading normal.
    Cosine,
}

impl SkySampling {
    /// All methods with their names, as scene files spell them.
    pub const NAMES: [(&'static str, SkySampling); 3] = [
        ("compensated", SkySampling::Compensated),
        ("table", SkySampling::Table),
        ("cosine", SkySampling::Cosine),
    ];

    /// One line about it.
    pub const fn doc(self) -> &'static str {
        match self {
            SkySampling::Compensated => {
                "by the luminance above the average; the rest is left to BSDF sampling"
            }
            SkySampling::Table => "by luminance",
            SkySampling::Cosine => "by the cosine at the receiver, whatever the sky shows",
        }
    }
}

impl FromStr for SkySampling {
    type Err = Error;

    fn from_str(s: &str) -> Result<Self> {
        let known = Self::NAMES.iter().map(|n| n.0);
        let found = Self::NAMES.iter().find(|n| n.0 == s);
        found.map(|n| n.1).ok_or_else(|| Error::Usage(unknown_name("sky sampling", s, known)))
    }
}

/// How a sky is placed and sampled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkyOptions {
    /// Scales its radiance; finite and at least 0.
    pub intensity: f64,
    /// Turns it about +y by the right-hand rule (counter-clockwise seen from above), degrees: 90 brings what was at
    /// +z to +x.
    pub rotate_y_deg: f64,
    /// How it is sampled.
    pub sampling: SkySampling,
}

impl Default for SkyOptions {
    fn default() -> Self {
        SkyOptions { intensity: 1.0, rotate_y_deg: 0.0, sampling: SkySampling::default() }
    }
}

/// The light of a skybox. Render space has the axes of world space, so directions are the same in both.
pub struct SkyLight {
    sky: Arc<dyn Skybox>,
    intensity: f32,
    turn: Option<Turn>,
    discs: Vec<PlacedDisc>,
    map: MapSampler,
    /// Probability of sampling the map where all discs are in sight.
    map_share: f64,
    /// Integral of luminance over all directions.
    total: f64,
}

enum MapSampler {
    None,
    Cosine,
    Table { grid: ChartGrid, cells: ChartDistribution },
}

/// A rotation about +y.
#[derive(Debug, Clone, Copy)]
struct Turn {
    sin: f64,
    cos: f64,
}

impl Turn {
    /// None for whole turns.
    fn new(degrees: f64) -> Option<Self> {
        let d = degrees.rem_euclid(360.0);
        // Quarter turns are exact.
        let (sin, cos) = match d {
            90.0 => (1.0, 0.0),
            180.0 => (0.0, -1.0),
            270.0 => (-1.0, 0.0),
            _ => d.to_radians().sin_cos(),
        };
        (d != 0.0).then_some(Turn { sin, cos })
    }

    #[inline(always)]
    fn to_world(self, d: DVec3) -> DVec3 {
        DVec3::new(d.x * self.cos + d.z * self.sin, d.y, d.z * self.cos - d.x * self.sin)
    }

    #[inline(always)]
    fn to_sky(self, d: DVec3) -> DVec3 {
        DVec3::new(d.x * self.cos - d.z * self.sin, d.y, d.z * self.cos + d.x * self.sin)
    }
}

/// A disc of the sky in world space.
struct PlacedDisc {
    frame: Frame,
    /// 1 - cos of its half angle.
    m: f32,
    /// Sine of its half angle.
    sin: f32,
    radiance: Rgb,
    /// Probability of sampling it where all discs are in sight.
    share: f64,
}

impl PlacedDisc {
    fn new(disc: &SkyDisc, turn: Option<Turn>, intensity: f32, share: f64) -> Self {
        let toward = turn.map_or(disc.toward, |t| t.to_world(disc.toward));
        PlacedDisc {
            frame: Frame::from_z(toward.as_vec3()),
            m: (2.0 * (0.5 * disc.half_angle).sin().powi(2)) as f32,
            sin: disc.half_angle.sin() as f32,
            radiance: disc.radiance * intensity,
            share,
        }
    }

    /// Whether a unit direction lies within, by the squared chord, which has digits where a cosine has none.
    #[inline(always)]
    fn contains(&self, w: Vec3) -> bool {
        (w - self.frame.n).length_squared() <= 2.0 * self.m
    }

    /// Whether any of it is above the horizon of a receiver.
    #[inline(always)]
    fn in_sight(&self, at: &Receiver) -> bool {
        at.ng.dot(self.frame.n) >= -self.sin
    }

    fn sample(&self, u: Vec2) -> Vec3 {
        let w = self.frame.to_world(warp::uniform_cone(u, self.m)).normalize();
        if self.contains(w) {
            return w;
        }
        // Rounding carried it over the rim.
        w.lerp(self.frame.n, 1e-3).normalize()
    }
}

impl SkyLight {
    /// Prepares a sky for sampling.
    ///
    /// # Errors
    /// An intensity that is not a number of at least 0, or an angle that is not finite.
    pub fn new(sky: Arc<dyn Skybox>, options: &SkyOptions) -> Result<Self> {
        let SkyOptions { intensity, rotate_y_deg, sampling } = *options;
        if !(0.0..=f64::from(f32::MAX)).contains(&intensity) {
            let message = format!("a sky's intensity is a number of at least 0, not {intensity}");
            return Err(Error::Usage(message));
        }
        if !rotate_y_deg.is_finite() {
            return Err(Error::Usage("the angle by which a sky is turned is not finite".into()));
        }
        let turn = Turn::new(rotate_y_deg);
        // Integrals and solid angles of cells in double precision, coarser levels, and the table itself.
        let cells = sky.grid().cells().min(plan::MAX_CELLS) as u64;
        let _room = memory::room(48 * cells, || "the table of a sky".into())?;
        let plan = match sky.constant() {
            Some(radiance) => plan_constant(&*sky, f64::from(radiance.luminance()), sampling),
            None => plan::plan(&*sky, sampling),
        };
        let intensity = intensity as f32;
        let shares = sky.discs().iter().zip(&plan.disc_shares);
        let discs: Vec<PlacedDisc> =
            shares.map(|(d, &share)| PlacedDisc::new(d, turn, intensity, share)).collect();
        let disc_total: f64 =
            sky.discs().iter().map(|d| f64::from(d.radiance.luminance()) * d.solid_angle()).sum();
        let map = match (plan.table, sampling) {
            (Some((grid, cells)), _) => MapSampler::Table { grid, cells },
            (None, SkySampling::Cosine) => MapSampler::Cosine,
            (None, _) => MapSampler::None,
        };
        let map_share = if matches!(map, MapSampler::None) { 0.0 } else { plan.map_share };
        let total = (plan.map_total + disc_total) * f64::from(intensity);
        Ok(SkyLight { sky, intensity, turn, discs, map, map_share, total })
    }

    /// Bytes held, with the skybox.
    pub fn memory(&self) -> u64 {
        let table = if let MapSampler::Table { cells, .. } = &self.map { cells.memory() } else { 0 };
        self.sky.memory() + table
    }

    /// For people: how the map is sampled.
    pub fn describe(&self) -> String {
        let map = match &self.map {
            MapSampler::None => "by BSDF sampling alone".to_owned(),
            MapSampler::Cosine => "by the cosine".to_owned(),
            MapSampler::Table { grid, .. } => {
                format!("by a table of {} x {} x {} cells", grid.count, grid.width, grid.height)
            }
        };
        format!("map {map}, {} discs", self.discs.len())
    }

    #[inline(always)]
    fn to_sky(&self, w: Vec3) -> Vec3 {
        match self.turn {
            None => w,
            Some(t) => t.to_sky(w.as_dvec3()).as_vec3(),
        }
    }

    #[inline(always)]
    fn radiance(&self, w: Vec3) -> Rgb {
        self.with_discs(self.sky.radiance(self.to_sky(w)), w)
    }

    /// The light towards `w` where the map has this radiance.
    #[inline(always)]
    fn with_discs(&self, map: Rgb, w: Vec3) -> Rgb {
        let mut l = map * self.intensity;
        for disc in &self.discs {
            if disc.contains(w) {
                l += disc.radiance;
            }
        }
        l
    }

    /// Sum of the probabilities of what a receiver can see.
    #[inline(always)]
    fn in_sight(&self, at: &Receiver) -> f64 {
        let discs = self.discs.iter().filter(|d| d.in_sight(at)).map(|d| d.share);
        self.map_share + discs.sum::<f64>()
    }

    /// Density of the map's sampler.
    #[inline]
    fn map_pdf(&self, at: &Receiver, w: Vec3) -> f64 {
        match &self.map {
            MapSampler::None => 0.0,
            MapSampler::Cosine if at.ns == Vec3::ZERO => f64::from(warp::UNIFORM_SPHERE_PDF),
            MapSampler::Cosine => f64::from(warp::cosine_hemisphere_pdf(at.ns.dot(w))),
            MapSampler::Table { grid, cells } => {
                let d = w.as_dvec3();
                let c = self.sky.locate(self.turn.map_or(d, |t| t.to_sky(d)));
                let cell = |u: f64, n: u32| ((u * f64::from(n)) as u32).min(n - 1);
                let pmf = cells.pmf(c.chart, cell(c.u, grid.width), cell(c.v, grid.height));
                cell_density(&*self.sky, grid, c, pmf)
            }
        }
    }

    /// A direction to the map, with its density.
    #[inline]
    fn sample_map(&self, at: &Receiver, u: [f64; 2]) -> Option<(Vec3, f64)> {
        match &self.map {
            MapSampler::None => None,
            MapSampler::Cosine => {
                let u = Vec2::new(u[0] as f32, u[1] as f32);
                let w = if at.ns == Vec3::ZERO {
                    warp::uniform_sphere(u)
                } else {
                    Frame::from_z(at.ns).to_world(warp::cosine_hemisphere(u)).normalize()
                };
                Some((w, self.map_pdf(at, w)))
            }
            MapSampler::Table { grid, cells } => {
                let s = cells.sample(u);
                // Off the border by more than the rounding of a direction to f32 can carry it back over.
                let inside = |u: f64, n: u32| {
                    let rim = f64::from(n) * 1.5e-7;
                    u.clamp(rim, 1.0 - rim)
                };
                let c = ChartPoint {
                    chart: s.chart,
                    u: (f64::from(s.x) + inside(s.du[0], grid.width)) / f64::from(grid.width),
                    v: (f64::from(s.y) + inside(s.du[1], grid.height)) / f64::from(grid.height),
                };
                let d = self.sky.direction(c);
                let w = self.turn.map_or(d, |t| t.to_world(d)).as_vec3();
                Some((w, cell_density(&*self.sky, grid, c, s.pmf)))
            }
        }
    }

    /// The density of the whole mixture, `map_pdf` known.
    #[inline(always)]
    fn mixture_pdf(&self, at: &Receiver, w: Vec3, map_pdf: f64) -> f32 {
        let mut pdf = self.map_share * map_pdf;
        let mut total = self.map_share;
        for disc in self.discs.iter().filter(|d| d.in_sight(at)) {
            total += disc.share;
            if disc.contains(w) {
                pdf += disc.share * f64::from(warp::uniform_cone_pdf(disc.m));
            }
        }
        if total > 0.0 { (pdf / total) as f32 } else { 0.0 }
    }
}

/// Density per solid angle within a cell of this probability.
#[inline(always)]
fn cell_density(sky: &dyn Skybox, grid: &ChartGrid, c: ChartPoint, pmf: f64) -> f64 {
    let cells = f64::from(grid.width) * f64::from(grid.height);
    let solid_angle = sky.solid_angle_density(c);
    if pmf > 0.0 && solid_angle > 0.0 { pmf * cells / solid_angle } else { 0.0 }
}

/// A constant map needs no table to know what is left of it.
fn plan_constant(sky: &dyn Skybox, luminance: f64, sampling: SkySampling) -> Plan {
    let none = Plan {
        table: None,
        map_share: 0.0,
        disc_shares: vec![0.0; sky.discs().len()],
        map_total: 4.0 * PI * luminance,
    };
    match sampling {
        SkySampling::Compensated if sky.discs().is_empty() => none,
        SkySampling::Cosine if sky.discs().is_empty() => Plan { map_share: 1.0, ..none },
        _ => plan::plan(sky, sampling),
    }
}

impl Light for SkyLight {
    #[inline]
    fn sample_li(&self, at: &Receiver, u: [f32; 2]) -> Option<LightSample> {
        let total = self.in_sight(at);
        if total <= 0.0 {
            return None;
        }
        let [mut x, y] = extend_unit(u);
        x *= total;
        let mut picked = None;
        for disc in self.discs.iter().filter(|d| d.in_sight(at)) {
            if x < disc.share {
                let w = disc.sample(Vec2::new((x / disc.share) as f32, y as f32));
                let map_pdf = if self.map_share > 0.0 { self.map_pdf(at, w) } else { 0.0 };
                picked = Some((w, map_pdf));
                break;
            }
            x -= disc.share;
        }
        let (wi, map_pdf) = match picked {
            Some(p) => p,
            None => self.sample_map(at, [x / self.map_share.max(f64::MIN_POSITIVE), y])?,
        };
        if wi.dot(at.ng) < 0.0 {
            return None;
        }
        let pdf = self.mixture_pdf(at, wi, map_pdf);
        (pdf > 0.0).then_some(LightSample { wi, dist: f32::INFINITY, li: None, pdf, delta: false })
    }

    #[inline]
    fn pdf_li(&self, at: &Receiver, end: &PathEnd) -> f32 {
        if end.vertex.is_some() || end.wi.dot(at.ng) < 0.0 {
            return 0.0;
        }
        let map_pdf = if self.map_share > 0.0 { self.map_pdf(at, end.wi) } else { 0.0 };
        self.mixture_pdf(at, end.wi, map_pdf)
    }

    #[inline]
    fn le(&self, end: &PathEnd) -> Rgb {
        if end.vertex.is_some() { Rgb::BLACK } else { self.radiance(end.wi) }
    }

    fn le_escaped(&self, wi: Directions, out: &mut [Rgb]) {
        match self.turn {
            None => self.sky.radiance_batch(wi, out),
            Some(_) => {
                let turned: DirectionBatch = (0..wi.len()).map(|i| self.to_sky(wi.get(i))).collect();
                self.sky.radiance_batch(turned.view(), out);
            }
        }
        for (i, out) in out.iter_mut().enumerate() {
            *out = self.with_discs(*out, wi.get(i));
        }
    }

    fn at_infinity(&self) -> bool {
        true
    }

    fn power(&self, extent: &Extent) -> f32 {
        (self.total * PI) as f32 * extent.radius * extent.radius
    }

    fn irradiance_closed_form(&self, _p: Vec3, n: Vec3) -> Option<Rgb> {
        let d = n.as_dvec3();
        let mut e = self.sky.irradiance_closed_form(self.turn.map_or(d, |t| t.to_sky(d)))? * self.intensity;
        for disc in &self.discs {
            let cos = disc.frame.n.dot(n);
            if cos.abs() < disc.sin {
                // Part of it is below the horizon.
                return None;
            }
            e += disc.radiance * (std::f32::consts::PI * disc.sin * disc.sin * cos.max(0.0));
        }
        Some(e)
    }
}

#[cfg(test)]
mod tests;
