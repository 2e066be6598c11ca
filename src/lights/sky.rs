//! The light of a sky, of whatever kind.

mod many;
mod options;
mod placed;
mod plan;
mod product;

use crate::base::directions::{DirectionBatch, Directions, LANES};
use crate::base::light::{
    Extent, Guide, GuidedLight, Light, LightLanes, LightSample, Lobes, PathEnd, Receiver,
};
use crate::base::skybox::{ChartGrid, ChartPoint, Skybox};
use crate::color::Rgb;
use crate::error::{Error, Result};
use crate::math::Frame;
use crate::memory;
use crate::sampler::hash::extend_unit;
use crate::sampling::distribution::ChartDistribution;
use crate::sampling::warp;
use glam::{Vec2, Vec3};
pub use options::{SkyOptions, SkySampling};
use placed::{PlacedDisc, Turn};
use plan::{Level, Plan};
use product::{Choice, ProductTable};
use std::f64::consts::PI;
use std::sync::Arc;

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
    Table {
        grid: ChartGrid,
        cells: ChartDistribution,
    },
    /// Discs are among its cells.
    Product(Box<ProductTable>),
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
        let intensity = intensity as f32;
        let disc_total: f64 =
            sky.discs().iter().map(|d| f64::from(d.radiance.luminance()) * d.solid_angle()).sum();
        let place = |shares: &[f64]| -> Vec<PlacedDisc> {
            let shares = sky.discs().iter().zip(shares);
            shares.map(|(d, &share)| PlacedDisc::new(d, turn, intensity, share)).collect()
        };
        let is_plain = sky.constant().is_some() && sky.discs().is_empty();
        let plan_of = |levels: &[Level]| match sky.constant() {
            Some(radiance) => plan_constant(&*sky, levels, f64::from(radiance.luminance()), sampling),
            None => plan::plan(&*sky, levels, sampling),
        };
        // Of a constant sky without discs nothing need be known, unless a table is asked for; products need no level but
        // the finest.
        let levels = match sampling {
            SkySampling::Table => Level::all(&*sky),
            _ if is_plain => Vec::new(),
            s if s.is_product() => vec![Level::finest(&*sky)],
            _ => Level::all(&*sky),
        };
        let plan = match sampling {
            s if s.is_product() && !is_plain => None,
            _ => Some(plan_of(&levels)),
        };
        let Some(plan) = plan else {
            let discs = place(&vec![0.0; sky.discs().len()]);
            let is_fine = sampling == SkySampling::Product;
            let table = ProductTable::new(&*sky, &levels[0], &discs, (turn, intensity), is_fine);
            let map_total = table.as_ref().map_or(0.0, |t| t.map_flux());
            let total = (map_total + disc_total) * f64::from(intensity);
            let map = table.map_or(MapSampler::None, |t| MapSampler::Product(Box::new(t)));
            return Ok(SkyLight { sky, intensity, turn, discs, map, map_share: 0.0, total });
        };
        let discs = place(&plan.disc_shares);
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
        let table = match &self.map {
            MapSampler::Table { cells, .. } => cells.memory(),
            MapSampler::Product(table) => table.memory(),
            MapSampler::None | MapSampler::Cosine => 0,
        };
        self.sky.memory() + table
    }

    #[inline(always)]
    fn to_sky(&self, w: Vec3) -> Vec3 {
        match self.turn {
            None => w,
            Some(t) => t.to_sky(w.as_dvec3()).as_vec3(),
        }
    }

    /// Where a direction lies on the sky's charts.
    #[inline(always)]
    fn locate(&self, w: Vec3) -> ChartPoint {
        let d = w.as_dvec3();
        self.sky.locate(self.turn.map_or(d, |t| t.to_sky(d)))
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
            MapSampler::None | MapSampler::Product(_) => 0.0,
            MapSampler::Cosine if at.ns == Vec3::ZERO => f64::from(warp::UNIFORM_SPHERE_PDF),
            MapSampler::Cosine => f64::from(warp::cosine_hemisphere_pdf(at.ns.dot(w))),
            MapSampler::Table { grid, cells } => {
                let c = self.locate(w);
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
            MapSampler::None | MapSampler::Product(_) => None,
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
fn plan_constant(sky: &dyn Skybox, levels: &[Level], luminance: f64, sampling: SkySampling) -> Plan {
    let none = Plan {
        table: None,
        map_share: 0.0,
        disc_shares: vec![0.0; sky.discs().len()],
        map_total: 4.0 * PI * luminance,
    };
    match sampling {
        s if (s.is_product() || s == SkySampling::Compensated) && sky.discs().is_empty() => none,
        SkySampling::Cosine if sky.discs().is_empty() => Plan { map_share: 1.0, ..none },
        _ => plan::plan(sky, levels, sampling),
    }
}

impl Light for SkyLight {
    fn describe(&self) -> String {
        let map = match &self.map {
            MapSampler::None => "by BSDF sampling alone".to_owned(),
            MapSampler::Cosine => "by the cosine".to_owned(),
            MapSampler::Table { grid, .. } => {
                format!("by a table of {} x {} x {} cells", grid.count, grid.width, grid.height)
            }
            MapSampler::Product(table) => table.describe(),
        };
        format!("map {map}, {} discs", self.discs.len())
    }

    #[inline]
    fn sample_li(&self, at: &Receiver, u: [f32; 2]) -> Option<LightSample> {
        if let MapSampler::Product(table) = &self.map {
            return with_plain_guide(table, at, |guide| GuidedLight::sample(self, at, guide, u)).flatten();
        }
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
        if let MapSampler::Product(table) = &self.map {
            return with_plain_guide(table, at, |guide| self.pdf(at, guide, end.wi)).unwrap_or(0.0);
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
        if self.intensity != 1.0 {
            out.iter_mut().for_each(|l| *l = *l * self.intensity);
        }
        self.discs.iter().for_each(|disc| disc.add_to(wi, out));
    }

    fn is_sampled(&self) -> bool {
        // Discs have a share only where the sampler gives them one.
        !matches!(self.map, MapSampler::None) || self.discs.iter().any(|d| d.share > 0.0)
    }

    fn is_black(&self) -> bool {
        self.le_everywhere().is_some_and(Rgb::is_black)
    }

    fn le_everywhere(&self) -> Option<Rgb> {
        let plain = self.sky.constant().filter(|_| self.discs.is_empty());
        plain.map(|radiance| radiance * self.intensity)
    }

    fn is_smooth(&self, axis: Vec3, half_angle: f32) -> bool {
        self.sky.is_smooth() && self.discs.iter().all(|d| !d.meets(axis, half_angle))
    }

    fn guided(&self) -> Option<&dyn GuidedLight> {
        matches!(self.map, MapSampler::Product(_)).then_some(self)
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

/// What `f` makes of a receiver of whose surface nothing is known; None where nothing can arrive.
fn with_plain_guide<T>(table: &ProductTable, at: &Receiver, f: impl FnOnce(&Guide) -> T) -> Option<T> {
    let mut guide = Guide::default();
    table.prepare_plain(at, &mut guide).then(|| f(&guide))
}

impl GuidedLight for SkyLight {
    fn prepare(&self, at: &Receiver, lobes: &Lobes, guide: &mut Guide) -> bool {
        let MapSampler::Product(table) = &self.map else { return false };
        table.prepare(at, lobes, guide)
    }

    fn sample(&self, at: &Receiver, guide: &Guide, u: [f32; 2]) -> Option<LightSample> {
        let MapSampler::Product(table) = &self.map else { return None };
        let (wi, pdf) = match table.sample(guide, extend_unit(u))? {
            Choice::Map { at: c, density } => {
                let (d, solid_angle) = self.sky.direction_and_density(c);
                let w = self.turn.map_or(d, |t| t.to_world(d)).as_vec3();
                let map = if solid_angle > 0.0 { density / solid_angle } else { 0.0 };
                (w, (map + self.disc_density(table, guide, w)) as f32)
            }
            Choice::Disc { disc, u } => {
                let w = self.discs[disc].sample(Vec2::new(u[0] as f32, u[1] as f32));
                (w, self.pdf(at, guide, w))
            }
        };
        let seen = wi.dot(at.ng) >= 0.0 && pdf > 0.0;
        seen.then_some(LightSample { wi, dist: f32::INFINITY, li: None, pdf, delta: false })
    }

    fn sample_many(&self, at: &Receiver, guide: &Guide, u: &[[f32; LANES]; 2], n: usize) -> LightLanes {
        match &self.map {
            MapSampler::Product(table) => self.sample_product(table, at, guide, u, n),
            _ => LightLanes::default(),
        }
    }

    fn pdf(&self, at: &Receiver, guide: &Guide, wi: Vec3) -> f32 {
        let MapSampler::Product(table) = &self.map else { return 0.0 };
        if wi.dot(at.ng) < 0.0 {
            return 0.0;
        }
        let c = self.locate(wi);
        let solid_angle = self.sky.solid_angle_density(c);
        let map = if solid_angle > 0.0 { table.density(guide, c) / solid_angle } else { 0.0 };
        (map + self.disc_density(table, guide, wi)) as f32
    }
    fn contrast(&self) -> f32 {
        let MapSampler::Product(table) = &self.map else { return 1.0 };
        let mean = self.total / (4.0 * PI);
        let disc = self.discs.iter().map(|d| f64::from(d.radiance.luminance())).fold(0.0, f64::max);
        let peak = disc.max(table.peak() * f64::from(self.intensity));
        if mean > 0.0 { (peak / mean) as f32 } else { 1.0 }
    }
}

impl SkyLight {
    /// The density that the discs add in a direction.
    #[inline(always)]
    fn disc_density(&self, table: &ProductTable, guide: &Guide, w: Vec3) -> f64 {
        let discs = self.discs.iter().enumerate().filter(|(_, d)| d.contains(w));
        discs.map(|(i, d)| table.disc_pmf(guide, i) * f64::from(warp::uniform_cone_pdf(d.m))).sum()
    }
}

#[cfg(test)]
mod tests;
