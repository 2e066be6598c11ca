//! Sunlight in a clear atmosphere, by wavelength: what a sky of one sun is made of.
//!
//! Single scattering after Nishita, Sirai, Tadamura and Nakamae, "Display of the Earth Taking into Account Atmospheric
//! Scattering", SIGGRAPH 1993, with ozone; all further orders together after Hillaire, "A Scalable and Production
//! Ready Sky and Atmosphere Rendering Technique", EGSR 2020, 5.5. Lengths are in kilometres.

use super::spectrum::{self, LANES, Spectrum};
use crate::math::simd;
use glam::DVec3;
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;
use std::f64::consts::PI;

/// Radius of the ground.
const GROUND: f64 = 6360.0;
/// Where the atmosphere ends: above, less than 1e-4 of its air is left.
const TOP: f64 = 6440.0;
/// Heights over which the densities of molecules and of haze fall to 1/e (Nishita et al. 1993, section 3).
const RAYLEIGH_HEIGHT: f64 = 8.0;
const HAZE_HEIGHT: f64 = 1.2;
/// The ozone layer: a tent about 25 km, 15 km to either side.
const OZONE_CENTER: f64 = 25.0;
const OZONE_HALF_WIDTH: f64 = 15.0;
/// Share of the haze's extinction that is scattering.
const HAZE_ALBEDO: f32 = 0.95;
/// Angular radius of the sun seen from the Earth, on average.
pub(super) const SUN_HALF_ANGLE: f64 = 0.2666 * PI / 180.0;

/// The table of air masses of rising rays: by the square root of the height, and by the distance to the top between that
/// straight up and that of a level ray, in which a mass is almost linear (after Bruneton and Neyret, "Precomputed
/// Atmospheric Scattering", 2008, section 4).
const MASS_HEIGHTS: usize = 32;
const MASS_ANGLES: usize = 48;
/// The table of multiple scattering: by the square root of the height and by the sun's elevation about that at the
/// observer.
const MULTIPLE_HEIGHTS: usize = 8;
const MULTIPLE_ANGLES: usize = 5;
/// Half of the table's range of elevations, radians: beyond it lies air 1000 km away.
const MULTIPLE_RANGE: f64 = 0.17;

/// Columns of air: lengths of path, each weighted with the density there over that at its densest.
#[derive(Debug, Clone, Copy, Default)]
struct Columns {
    rayleigh: f32,
    haze: f32,
    ozone: f32,
}

impl Columns {
    /// Densities at a height.
    #[inline(always)]
    fn at_height(h: f64) -> Self {
        Columns {
            rayleigh: spectrum::exp_minus((h / RAYLEIGH_HEIGHT) as f32),
            haze: spectrum::exp_minus((h / HAZE_HEIGHT) as f32),
            ozone: (1.0 - (h - OZONE_CENTER).abs() / OZONE_HALF_WIDTH).max(0.0) as f32,
        }
    }

    /// Columns straight up from a height: the integrals of [`Columns::at_height`].
    #[inline(always)]
    fn above(h: f64) -> Self {
        let air = Columns::at_height(h);
        let (foot, head) = (OZONE_CENTER - OZONE_HALF_WIDTH, OZONE_CENTER + OZONE_HALF_WIDTH);
        // The tent's area: that of its upper half less what has been passed of it, or the corner that is left.
        let corner = |w: f64| 0.5 * w * w / OZONE_HALF_WIDTH;
        let ozone = if h < OZONE_CENTER {
            OZONE_HALF_WIDTH - corner((h - foot).max(0.0))
        } else {
            corner((head - h).max(0.0))
        };
        Columns {
            rayleigh: air.rayleigh * RAYLEIGH_HEIGHT as f32,
            haze: air.haze * HAZE_HEIGHT as f32,
            ozone: ozone as f32,
        }
    }

    #[inline(always)]
    fn zip(self, o: Columns, f: impl Fn(f32, f32) -> f32) -> Self {
        Columns {
            rayleigh: f(self.rayleigh, o.rayleigh),
            haze: f(self.haze, o.haze),
            ozone: f(self.ozone, o.ozone),
        }
    }

    /// `self + o * scale`.
    #[inline(always)]
    fn plus(self, o: Columns, scale: f32) -> Self {
        Columns {
            rayleigh: self.rayleigh + o.rayleigh * scale,
            haze: self.haze + o.haze * scale,
            ozone: self.ozone + o.ozone * scale,
        }
    }
}

/// An atmosphere under one sun.
pub(super) struct Atmosphere {
    /// Extinction at the densest, per kilometre.
    rayleigh: Spectrum,
    haze: Spectrum,
    ozone: Spectrum,
    ground_albedo: Spectrum,
    to_sun: DVec3,
    /// Columns along rising rays over those straight up.
    masses: Vec<Columns>,
    /// Radiance of light scattered at least once, averaged over directions.
    multiple: Vec<Spectrum>,
}

/// What arrives along a ray, per unit of irradiance by the sun above the atmosphere, at each wavelength.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arriving {
    /// Scattered once by molecules, before their phase function.
    pub rayleigh: Spectrum,
    /// Scattered once by haze, before its phase function.
    pub haze: Spectrum,
    /// Scattered more than once.
    pub multiple: Spectrum,
    /// Sent back by the ground, as far as the sun itself lights it; zero where the path does not end there.
    pub ground: Spectrum,
    /// Transmittance of the whole path.
    pub transmittance: Spectrum,
}

/// A ray through the air, as far as it goes, under a sun.
struct Path {
    start: DVec3,
    dir: DVec3,
    length: f64,
    ground: bool,
    to_sun: DVec3,
}

impl Path {
    fn new(height: f64, dir: DVec3, to_sun: DVec3) -> Self {
        let start = DVec3::new(0.0, GROUND + height, 0.0);
        let ground = to_ground(start.y, dir.y);
        let length = ground.unwrap_or_else(|| to_top(start.y, dir.y));
        Path { start, dir, length, ground: ground.is_some(), to_sun }
    }
}

/// Distance to the top along a ray from radius `r` with cosine `mu` to the vertical.
fn to_top(r: f64, mu: f64) -> f64 {
    (-r * mu + (r * r * (mu * mu - 1.0) + TOP * TOP).max(0.0).sqrt()).max(0.0)
}

/// Distance to the ground, if the ray meets it.
fn to_ground(r: f64, mu: f64) -> Option<f64> {
    let q = r * r * (mu * mu - 1.0) + GROUND * GROUND;
    (mu < 0.0 && q >= 0.0).then(|| (-r * mu - q.sqrt()).max(0.0))
}

/// Sine of the horizon's elevation seen from radius `r`: not positive.
fn horizon(r: f64) -> f64 {
    -(1.0 - (GROUND / r).powi(2)).max(0.0).sqrt()
}

impl Atmosphere {
    /// `turbidity` is the ratio of the optical depths of air with haze and without (Preetham, Shirley and Smits, "A
    /// Practical Analytic Model for Daylight", 1999, section 2.2), at least 1; `to_sun` a unit vector, y up.
    pub fn new(to_sun: DVec3, turbidity: f64, ground_albedo: Spectrum) -> Self {
        let per_km = |depth: Spectrum, height: f64| depth.map(|d| d / height as f32);
        let mut a = Atmosphere {
            rayleigh: per_km(spectrum::rayleigh_depth(), RAYLEIGH_HEIGHT),
            haze: per_km(spectrum::haze_depth(turbidity), HAZE_HEIGHT),
            ozone: per_km(spectrum::ozone_depth(), OZONE_HALF_WIDTH),
            ground_albedo,
            to_sun,
            masses: mass_table(),
            multiple: Vec::new(),
        };
        let cells = 0..MULTIPLE_HEIGHTS * MULTIPLE_ANGLES;
        a.multiple = cells.into_par_iter().map(|i| simd::dispatch(|| a.scattered_often(i))).collect();
        a
    }

    /// Transmittance from `height` to the sun, times the part of it above the horizon.
    pub fn sunlight(&self, height: f64) -> Spectrum {
        match self.towards_sun(GROUND + height, self.to_sun.y) {
            Some((c, visible)) => self.transmittance(c).map(|t| t * visible),
            None => [0.0; LANES],
        }
    }

    /// Light arriving at `height` from direction `dir`, by `steps` steps whose lengths grow with the distance.
    pub fn arriving(&self, height: f64, dir: DVec3, steps: usize) -> Arriving {
        let path = Path::new(height, dir, self.to_sun);
        simd::dispatch(|| self.follow(&path, steps, |r, mu| self.multiple_at(r, mu)))
    }

    /// Elevation of the horizon seen from `height`, radians: not positive.
    pub fn dip(height: f64) -> f64 {
        horizon(GROUND + height).asin()
    }

    #[inline(always)]
    fn transmittance(&self, c: Columns) -> Spectrum {
        std::array::from_fn(|i| {
            let depth = self.rayleigh[i] * c.rayleigh + self.haze[i] * c.haze + self.ozone[i] * c.ozone;
            spectrum::exp_minus(depth)
        })
    }

    /// Columns from radius `r` towards the sun at the cosine `mu`, and the part of the sun above the horizon there.
    #[inline(always)]
    fn towards_sun(&self, r: f64, mu: f64) -> Option<(Columns, f32)> {
        let horizon = horizon(r);
        let above = (mu - horizon) / SUN_HALF_ANGLE;
        let visible = (0.5 + 0.5 * above).clamp(0.0, 1.0) as f32;
        (visible > 0.0).then(|| (self.columns_at(r, mu.max(horizon)), visible))
    }

    /// Columns from radius `r` to the top at the cosine `mu`, not below the horizon.
    #[inline(always)]
    fn columns_at(&self, r: f64, mu: f64) -> Columns {
        if mu >= 0.0 {
            return self.rising_at(r, mu);
        }
        // Down to the lowest point and up again, less what lies behind.
        let lowest = (r * (1.0 - mu * mu).max(0.0).sqrt()).max(GROUND);
        let behind = self.rising_at(r, -mu);
        self.rising_at(lowest, 0.0).zip(behind, |whole, behind| (2.0 * whole - behind).max(0.0))
    }

    /// As [`Atmosphere::columns_at`] for `mu` of at least 0. Columns themselves fall by 1/e within an interval of the
    /// table or end in the middle of it, as ozone does; their ratios to those straight up do not.
    #[inline(always)]
    fn rising_at(&self, r: f64, mu: f64) -> Columns {
        let height = (r - GROUND).max(0.0);
        let x = (height / (TOP - GROUND)).min(1.0).sqrt();
        let (nearest, farthest) = mass_range(r);
        let y = (to_top(r, mu) - nearest) / (farthest - nearest).max(1e-9);
        let (i, fx) = cell(x, MASS_HEIGHTS);
        let (j, fy) = cell(y, MASS_ANGLES);
        let at = |i: usize, j: usize| self.masses[i * MASS_ANGLES + j];
        let mass = Columns::default()
            .plus(at(i, j), (1.0 - fx) * (1.0 - fy))
            .plus(at(i, j + 1), (1.0 - fx) * fy)
            .plus(at(i + 1, j), fx * (1.0 - fy))
            .plus(at(i + 1, j + 1), fx * fy);
        mass.zip(Columns::above(height), |mass, above| mass * above)
    }

    #[inline(always)]
    fn multiple_at(&self, r: f64, mu: f64) -> Spectrum {
        let x = ((r - GROUND) / (TOP - GROUND)).clamp(0.0, 1.0).sqrt();
        let elevation = mu.clamp(-1.0, 1.0).asin() - self.to_sun.y.asin();
        let (i, fx) = cell(x, MULTIPLE_HEIGHTS);
        let (j, fy) = cell(0.5 + 0.5 * elevation / MULTIPLE_RANGE, MULTIPLE_ANGLES);
        let at = |i: usize, j: usize| &self.multiple[i * MULTIPLE_ANGLES + j];
        let (a, b, c, d) = (at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j + 1));
        std::array::from_fn(|k| {
            (a[k] * (1.0 - fy) + b[k] * fy) * (1.0 - fx) + (c[k] * (1.0 - fy) + d[k] * fy) * fx
        })
    }

    /// Integrates along a path; `multiple(r, mu)` is the light that arrives at a point scattered before.
    #[inline(always)]
    fn follow(&self, path: &Path, steps: usize, multiple: impl Fn(f64, f64) -> Spectrum) -> Arriving {
        let zero = [0.0; LANES];
        let (mut rayleigh, mut hazy, mut often, mut ground) = (zero, zero, zero, zero);
        let mut passed = Columns::default();
        for step in 0..steps {
            // Middles after the substitution s = length t^2: the air is densest at the start.
            let edge = |i: usize| path.length * (i as f64 / steps as f64).powi(2);
            let (from, to) = (edge(step), edge(step + 1));
            let p = path.start + path.dir * (0.5 * (from + to));
            let r = p.length().max(GROUND);
            let mu = p.dot(path.to_sun) / r;
            let air = Columns::at_height(r - GROUND);
            let ds = (to - from) as f32;
            let here = passed.plus(air, 0.5 * ds);
            let (ray, haze) = (air.rayleigh * ds, air.haze * ds * HAZE_ALBEDO);
            if let Some((sun, visible)) = self.towards_sun(r, mu) {
                let lit = self.transmittance(here.plus(sun, 1.0));
                for i in 0..LANES {
                    rayleigh[i] += lit[i] * visible * self.rayleigh[i] * ray;
                    hazy[i] += lit[i] * visible * self.haze[i] * haze;
                }
            }
            let (before, view) = (multiple(r, mu), self.transmittance(here));
            for i in 0..LANES {
                often[i] += view[i] * before[i] * (self.rayleigh[i] * ray + self.haze[i] * haze);
            }
            passed = passed.plus(air, ds);
        }
        if path.ground {
            let end = path.start + path.dir * path.length;
            let cos = end.dot(path.to_sun) / end.length();
            if let Some((sun, visible)) = self.towards_sun(GROUND, cos) {
                let lit = self.transmittance(passed.plus(sun, 1.0));
                let cos = cos.max(0.0) as f32 * visible * FRAC_1_PI;
                for i in 0..LANES {
                    ground[i] = lit[i] * self.ground_albedo[i] * cos;
                }
            }
        }
        let transmittance = self.transmittance(passed);
        Arriving { rayleigh, haze: hazy, multiple: often, ground, transmittance }
    }

    /// One cell of the table of multiple scattering: the second order, taken as isotropic, over 1 - the share of light
    /// that one scattering more brings back (Hillaire 2020, equations 5 to 10).
    #[inline(always)]
    fn scattered_often(&self, cell: usize) -> Spectrum {
        let x = (cell / MULTIPLE_ANGLES) as f64 / (MULTIPLE_HEIGHTS - 1) as f64;
        let height = (TOP - GROUND) * x * x;
        let offset = 2.0 * (cell % MULTIPLE_ANGLES) as f64 / (MULTIPLE_ANGLES - 1) as f64 - 1.0;
        let elevation = self.to_sun.y.asin() + MULTIPLE_RANGE * offset;
        let to_sun = DVec3::new(elevation.cos(), elevation.sin(), 0.0);
        let (mut second, mut again) = ([0f32; LANES], [0f32; LANES]);
        const ZENITHS: usize = 8;
        const AZIMUTHS: usize = 4;
        for k in 0..ZENITHS * AZIMUTHS {
            let y = 1.0 - (2 * (k / AZIMUTHS) + 1) as f64 / ZENITHS as f64;
            // The half circle on one side of the sun; the other is its mirror.
            let azimuth = ((k % AZIMUTHS) as f64 + 0.5) / AZIMUTHS as f64 * PI;
            let r = (1.0 - y * y).sqrt();
            let dir = DVec3::new(r * azimuth.cos(), y, r * azimuth.sin());
            // Unit radiance in place of the light scattered before: what of it comes back.
            let a = self.follow(&Path::new(height, dir, to_sun), 10, |_, _| [1.0; LANES]);
            for i in 0..LANES {
                second[i] += (a.rayleigh[i] + a.haze[i]) * (0.25 * FRAC_1_PI) + a.ground[i];
                again[i] += a.multiple[i];
            }
        }
        let n = (ZENITHS * AZIMUTHS) as f32;
        std::array::from_fn(|i| second[i] / n / (1.0 - (again[i] / n).min(0.95)))
    }
}

/// Distance from radius `r` to the top straight up, and along a level ray.
fn mass_range(r: f64) -> (f64, f64) {
    (TOP - r, to_top(r, 0.0))
}

/// The cell of `x` in [0, 1] (clamped) between `n` values, and the place in it.
#[inline(always)]
fn cell(x: f64, n: usize) -> (usize, f32) {
    let x = x.clamp(0.0, 1.0) * (n - 1) as f64;
    let i = (x as usize).min(n - 2);
    (i, (x - i as f64) as f32)
}

fn mass_table() -> Vec<Columns> {
    let of = |k: usize| {
        let x = (k / MASS_ANGLES) as f64 / (MASS_HEIGHTS - 1) as f64;
        let y = (k % MASS_ANGLES) as f64 / (MASS_ANGLES - 1) as f64;
        let height = (TOP - GROUND) * x * x;
        let mut mass = mass(height, y);
        // There is no ozone above its layer whose mass could be told, only below, where the next interval ends.
        mass.ozone = self::mass(height.min(OZONE_CENTER + OZONE_HALF_WIDTH - 1.0), y).ozone;
        mass
    };
    (0..MASS_HEIGHTS * MASS_ANGLES).into_par_iter().with_min_len(64).map(of).collect()
}

/// Columns from a height, over those straight up, to the part `y` of the way from the nearest to the farthest point of
/// the top.
fn mass(height: f64, y: f64) -> Columns {
    let r = GROUND + height;
    let (nearest, farthest) = mass_range(r);
    let d = nearest + (farthest - nearest) * y;
    // At the very top no air is left.
    let mu = if d > 0.0 { (TOP * TOP - r * r - d * d) / (2.0 * r * d) } else { 1.0 };
    let ratio = |column: f32, above: f32| if above > 0.0 { column / above } else { 0.0 };
    rising(r, mu.clamp(0.0, 1.0)).zip(Columns::above(height), ratio)
}

/// Columns to the top along a ray that only rises, so that the air is densest at its start.
fn rising(r: f64, mu: f64) -> Columns {
    const STEPS: usize = 32;
    let length = to_top(r, mu);
    let mut sum = Columns::default();
    for i in 0..STEPS {
        // Middles after the substitution s = length t^2.
        let t = (i as f64 + 0.5) / STEPS as f64;
        let s = length * t * t;
        let height = (r * r + 2.0 * r * mu * s + s * s).sqrt() - GROUND;
        sum = sum.plus(Columns::at_height(height.max(0.0)), (2.0 * length * t / STEPS as f64) as f32);
    }
    sum
}

#[cfg(test)]
mod tests;
