//! A clear sky under one sun.

use super::atmosphere::{Arriving, Atmosphere, SUN_HALF_ANGLE};
use super::cylinder;
use super::dome::Dome;
use super::number;
use super::spectrum::{self, LANES, Spectrum};
use crate::base::directions::Directions;
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::skybox::{ChartDirections, ChartGrid, ChartLanes, ChartPoint, SkyDisc, Skybox};
use crate::color::Rgb;
use crate::error::Result;
use glam::{DVec3, Vec3, Vec4};
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

/// Rows of a table, from the horizon to the zenith or nadir.
const ROWS: usize = 65;
/// Columns of a table, by the cosine of the azimuth from the sun: even functions of an angle are smooth in its cosine.
const COLUMNS: usize = 17;
/// Azimuths at which light is integrated, from the sun to opposite it; columns are interpolated between them.
const AZIMUTHS: usize = 9;
/// Steps of each integral.
const STEPS: usize = 32;
/// Asymmetry of the haze's phase function.
const ASYMMETRY: f32 = 0.8;

/// What a sky is made of.
#[derive(Debug, Clone, Copy)]
pub(super) struct Weather {
    /// Unit direction to the sun.
    pub to_sun: DVec3,
    /// Ratio of the optical depths of air with haze and without, at least 1.
    pub turbidity: f64,
    /// Reflectance of the ground.
    pub ground_albedo: Rgb,
    /// Height of the observer above the ground, km.
    pub altitude_km: f64,
    /// Radiance of a white plate that faces the sun above the atmosphere.
    pub scale: f32,
    /// What each channel is multiplied by: [`spectrum::white_balance`].
    pub white: Rgb,
    /// Whether the sun itself is seen.
    pub disc: bool,
}

/// Half of the sphere, as a table by elevation and azimuth. A value holds in its first three numbers light to be
/// multiplied by the phase function of molecules, in `haze` by that of haze: what is left varies slowly enough for a
/// small table.
struct Half(Vec<Node>);

#[derive(Debug, Clone, Copy)]
struct Node {
    air: Vec4,
    haze: Vec4,
}

/// The light of the sky by direction, before it is tabulated once more for fast lookups.
struct Scattered {
    to_sun: Vec3,
    /// Horizontal unit direction towards the sun's azimuth.
    azimuth: Vec3,
    up: Half,
    down: Half,
}

/// A clear sky.
pub(super) struct Daylight {
    dome: Dome,
    discs: Vec<SkyDisc>,
}

/// Phase function of molecules: Rayleigh's.
#[inline(always)]
fn air_phase(mu: f32) -> f32 {
    0.059_683_103 * (1.0 + mu * mu) // 3 / 16 pi
}

/// Phase function of haze: Cornette and Shanks, "Physically Reasonable Analytic Expression for the Single-Scattering
/// Phase Function", Applied Optics 31(16), 1992, as Nishita et al. use it.
#[inline(always)]
fn haze_phase(mu: f32) -> f32 {
    const G2: f32 = ASYMMETRY * ASYMMETRY;
    const NORM: f32 = 0.119_366_21 * (1.0 - G2) / (2.0 + G2); // 3 / 8 pi
    let x = 1.0 + G2 - 2.0 * ASYMMETRY * mu;
    NORM * (1.0 + mu * mu) / (x * x.sqrt())
}

/// Place on the axis of elevations, 0 at the horizon to 1 straight up or down, of an angle to the horizon in [0, pi/2]:
/// its square root, because a sky changes fastest next to the horizon.
#[inline(always)]
fn warp(elevation: f32) -> f32 {
    (elevation * std::f32::consts::FRAC_2_PI).max(0.0).sqrt().min(1.0)
}

/// The elevation at a place, radians: inverse of [`warp`].
fn unwarp(w: f64) -> f64 {
    w * w * FRAC_PI_2
}

impl Daylight {
    /// Integrates the light of a sky.
    pub fn new(w: &Weather) -> Self {
        let albedo = spectrum::reflectance(w.ground_albedo);
        let air = Atmosphere::new(w.to_sun, w.turbidity, albedo);
        let flat = DVec3::new(w.to_sun.x, 0.0, w.to_sun.z);
        // With the sun overhead every azimuth is as good as another.
        let azimuth = flat.try_normalize().unwrap_or(DVec3::X);
        let rays = Rays { air: &air, azimuth, altitude_km: w.altitude_km };
        let above = rays.half(1.0);
        let lit = irradiance(&above, w.to_sun, azimuth);
        let mut below = rays.half(-1.0);
        for a in &mut below {
            for i in 0..LANES {
                // The ground also reflects the light of the sky.
                a.multiple[i] += a.transmittance[i] * albedo[i] * lit[i] * std::f32::consts::FRAC_1_PI;
            }
        }
        let scattered = Scattered {
            to_sun: w.to_sun.as_vec3(),
            azimuth: azimuth.as_vec3(),
            up: Half::new(&above, 1.0, w),
            down: Half::new(&below, -1.0, w),
        };
        Daylight { dome: Dome::new(|d| scattered.radiance(d)), discs: disc(w, &air).into_iter().collect() }
    }
}

/// The sun's own disc. Its limb is darker than its middle; this is the average.
fn disc(w: &Weather, air: &Atmosphere) -> Option<SkyDisc> {
    let [r, g, b] = spectrum::sunlit_rgb(&air.sunlight(w.altitude_km)).map(|c| c.max(0.0));
    let mut disc = SkyDisc { toward: w.to_sun, half_angle: SUN_HALF_ANGLE, radiance: Rgb::new(r, g, b) };
    // Irradiance over solid angle; a white plate of radiance 1 is given pi.
    disc.radiance = disc.radiance * w.white * ((PI / disc.solid_angle()) as f32 * w.scale);
    (w.disc && !disc.radiance.is_black()).then_some(disc)
}

/// The rays whose light makes the tables.
struct Rays<'a> {
    air: &'a Atmosphere,
    azimuth: DVec3,
    altitude_km: f64,
}

impl Rays<'_> {
    /// Light of one half, above (`sign` 1) or below, by row and azimuth.
    fn half(&self, sign: f64) -> Vec<Arriving> {
        let dip = Atmosphere::dip(self.altitude_km);
        let rays = 0..ROWS * AZIMUTHS;
        rays.into_par_iter()
            .with_min_len(8)
            .map(|k| {
                let elevation = sign * unwarp((k / AZIMUTHS) as f64 / (ROWS - 1) as f64);
                // The true horizon lies a little lower for an observer above the ground. It is moved up to y = 0,
                // and what is above and below it with it, less and less towards the zenith and nadir.
                let seen = elevation + (dip + sign * 1e-4) * (1.0 - elevation.abs() / FRAC_PI_2);
                let along = (k % AZIMUTHS) as f64 / (AZIMUTHS - 1) as f64 * PI;
                self.air.arriving(self.altitude_km, direction(self.azimuth, seen, along), STEPS)
            })
            .collect()
    }
}

/// The unit direction at an elevation and an azimuth from `azimuth`.
fn direction(azimuth: DVec3, elevation: f64, along: f64) -> DVec3 {
    let across = azimuth.cross(DVec3::Y);
    (azimuth * along.cos() + across * along.sin()) * elevation.cos() + DVec3::Y * elevation.sin()
}

/// Irradiance of the upper half on level ground, from the rays of its table.
fn irradiance(rays: &[Arriving], to_sun: DVec3, azimuth: DVec3) -> Spectrum {
    let mut sum = [0.0; LANES];
    for row in 1..ROWS {
        let height = |r: usize| unwarp(r as f64 / (ROWS - 1) as f64).sin();
        let (y0, y) = (height(row - 1), height(row));
        for k in 0..AZIMUTHS {
            let along = k as f64 / (AZIMUTHS - 1) as f64 * PI;
            let mu = direction(azimuth, y.asin(), along).dot(to_sun) as f32;
            let ends = if k == 0 || k + 1 == AZIMUTHS { 0.5 } else { 1.0 };
            // y dy dphi, over both half circles.
            let weight = (ends * 2.0 * PI / (AZIMUTHS - 1) as f64 * 0.5 * (y * y - y0 * y0)) as f32;
            let a = &rays[row * AZIMUTHS + k];
            for (i, sum) in sum.iter_mut().enumerate() {
                let once = a.rayleigh[i] * air_phase(mu) + a.haze[i] * haze_phase(mu);
                *sum += (once + a.multiple[i]) * weight;
            }
        }
    }
    sum
}

impl Half {
    fn new(rays: &[Arriving], sign: f64, w: &Weather) -> Self {
        let scale = Vec3::from(w.white.to_array()) * (w.scale * std::f32::consts::PI);
        let rgb = |s: &Spectrum| (Vec3::from(spectrum::sunlit_rgb(s)) * scale).extend(0.0);
        let horizontal = (1.0 - w.to_sun.y * w.to_sun.y).max(0.0).sqrt();
        let nodes = (0..ROWS).flat_map(|row| {
            let (y, r) = unwarp(row as f64 / (ROWS - 1) as f64).sin_cos();
            // What does not depend on the angle to the sun is divided by the phase function it will meet.
            let seen: Vec<Node> = (0..AZIMUTHS)
                .map(|k| {
                    let a = &rays[row * AZIMUTHS + k];
                    let along = (k as f64 / (AZIMUTHS - 1) as f64 * PI).cos();
                    let mu = (sign * y * w.to_sun.y + r * horizontal * along) as f32;
                    let even = std::array::from_fn(|i| a.multiple[i] + a.ground[i]);
                    Node { air: rgb(&a.rayleigh) + rgb(&even) / air_phase(mu), haze: rgb(&a.haze) }
                })
                .collect();
            (0..COLUMNS).map(move |c| interpolate(&seen, 2.0 * c as f64 / (COLUMNS - 1) as f64 - 1.0))
        });
        Half(nodes.collect())
    }
}

/// The value at the cosine `c` of the polynomial through values at the cosines of equal angles, by the barycentric
/// formula for Chebyshev's points (Berrut and Trefethen, "Barycentric Lagrange Interpolation", 2004, equation 5.4).
fn interpolate(seen: &[Node], c: f64) -> Node {
    let n = seen.len() - 1;
    let (mut sum, mut weights) = (Node { air: Vec4::ZERO, haze: Vec4::ZERO }, 0.0);
    for (k, node) in seen.iter().enumerate() {
        let d = c - (k as f64 / n as f64 * PI).cos();
        if d.abs() < 1e-9 {
            return *node;
        }
        let ends = if k == 0 || k == n { 0.5 } else { 1.0 };
        let w = (if k % 2 == 0 { ends } else { -ends } / d) as f32;
        sum.air += node.air * w;
        sum.haze += node.haze * w;
        weights += w;
    }
    Node { air: sum.air / weights, haze: sum.haze / weights }
}

impl Scattered {
    /// Radiance towards a unit direction.
    fn radiance(&self, d: Vec3) -> Rgb {
        let half = if d.y >= 0.0 { &self.up } else { &self.down };
        let flat = (d.x * d.x + d.z * d.z).max(1e-30).sqrt();
        // By both sides of the triangle: next to the zenith the height alone has lost half of the digits.
        let row = warp(d.y.abs().atan2(flat)) * (ROWS - 1) as f32;
        let along = (d.x * self.azimuth.x + d.z * self.azimuth.z) / flat;
        let column = (0.5 + 0.5 * along.clamp(-1.0, 1.0)) * (COLUMNS - 1) as f32;
        let (i, j) = ((row as usize).min(ROWS - 2), (column as usize).min(COLUMNS - 2));
        let (fi, fj) = (row - i as f32, column - j as f32);
        let at = i * COLUMNS + j;
        let (a, b) = (&half.0[at..at + 2], &half.0[at + COLUMNS..at + COLUMNS + 2]);
        let (w0, w1) = ((1.0 - fi) * (1.0 - fj), (1.0 - fi) * fj);
        let (w2, w3) = (fi * (1.0 - fj), fi * fj);
        let air = a[0].air * w0 + a[1].air * w1 + b[0].air * w2 + b[1].air * w3;
        let haze = a[0].haze * w0 + a[1].haze * w1 + b[0].haze * w2 + b[1].haze * w3;
        let mu = d.dot(self.to_sun).clamp(-1.0, 1.0);
        let l = (air * air_phase(mu) + haze * haze_phase(mu)).max(Vec4::ZERO);
        Rgb::new(l.x, l.y, l.z)
    }
}

impl Skybox for Daylight {
    #[inline]
    fn radiance(&self, d: Vec3) -> Rgb {
        self.dome.radiance(d)
    }

    fn radiance_batch(&self, d: Directions, out: &mut [Rgb]) {
        self.dome.radiance_batch(d, out);
    }

    fn is_smooth(&self) -> bool {
        true
    }

    fn grid(&self) -> ChartGrid {
        ChartGrid { count: 1, width: 128, height: 64 }
    }

    fn direction(&self, c: ChartPoint) -> DVec3 {
        cylinder::direction(c)
    }

    fn locate(&self, d: DVec3) -> ChartPoint {
        cylinder::locate(d)
    }

    fn solid_angle_density(&self, _c: ChartPoint) -> f64 {
        cylinder::DENSITY
    }

    fn directions_and_densities(&self, at: &ChartLanes, _n: usize) -> ChartDirections {
        at.directions(cylinder::toward)
    }

    fn discs(&self) -> &[SkyDisc] {
        &self.discs
    }

    fn memory(&self) -> u64 {
        self.dome.memory()
    }
}

/// A clear sky in scene files.
pub const ROW: Row<dyn Skybox> = Row {
    kind: "daylight",
    doc: "a clear sky: sunlight scattered by air, haze and ozone, and the sun's disc",
    params: &[
        number("sun_elevation_deg", (-18.0, 90.0), "45.0", "height of the sun above the horizon"),
        number("sun_azimuth_deg", (-360.0, 360.0), "0.0", "from +x towards +z"),
        number("turbidity", (1.0, 10.0), "2.5", "1: pure air; 2: clear; 5: hazy"),
        number("altitude_km", (0.0, 10.0), "0.3", "height of the observer above the ground"),
        number(
            "scale",
            (0.0, 1e9),
            "1.0",
            "radiance of a white plate that faces the sun above the atmosphere",
        ),
        number(
            "white_k",
            (4000.0, 25000.0),
            "6504",
            "colour temperature of the daylight that is shown as white, kelvin; 6504 leaves radiance as it is",
        ),
        ParamSpec {
            name: "ground_albedo",
            kind: ParamKind::Color,
            default: Some("[0.18, 0.17, 0.16]"),
            doc: "reflectance of the ground below the horizon",
        },
        ParamSpec {
            name: "sun",
            kind: ParamKind::Bool,
            default: Some("true"),
            doc: "whether the disc is seen",
        },
    ],
    build: |p| Ok(Arc::new(Daylight::new(&weather(p)?))),
    samples: || {
        let with = |name: &str, v: f64| Params::new().with(name, Value::Number(v));
        vec![
            Params::new(),
            with("sun_elevation_deg", 90.0).with("turbidity", Value::Number(1.0)),
            with("sun_elevation_deg", 2.0).with("sun_azimuth_deg", Value::Number(200.0)),
            with("sun_elevation_deg", -8.0).with("altitude_km", Value::Number(3.0)),
        ]
    },
};

fn weather(p: &Params) -> Result<Weather> {
    Ok(Weather {
        to_sun: super::toward(p, ["sun_elevation_deg", "sun_azimuth_deg"], [45.0, 0.0])?,
        turbidity: p.number_or("turbidity", 2.5)?.clamp(1.0, 10.0),
        ground_albedo: p.color_or("ground_albedo", [0.18, 0.17, 0.16])?,
        altitude_km: p.number_or("altitude_km", 0.3)?.clamp(0.0, 10.0),
        scale: p.number_or("scale", 1.0)?.clamp(0.0, 1e9) as f32,
        white: spectrum::white_balance(p.number_or("white_k", 6504.0)?.clamp(4000.0, 25000.0)),
        disc: p.bool_or("sun", true)?,
    })
}

#[cfg(test)]
mod tests;
