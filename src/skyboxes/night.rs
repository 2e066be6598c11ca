//! A clear night: moonlight in the air, stars, the Milky Way and the moon.

use super::baked::{Canvas, Painter, Spot, Stream, star};
use super::daylight::{Daylight, Weather};
use super::noise::{Points, WIDE, fractal, smoothstep};
use super::{integer, number};
use crate::base::registry::{Params, Row, Value};
use crate::base::skybox::{SkyDisc, Skybox};
use crate::color::Rgb;
use crate::math::trig;
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// The pole of the Milky Way's plane and its brightest part, towards the galactic centre: an arch that leans across the
/// sky, 20 degrees up where it is brightest, and as far from where the moon stands by default as it can be, so that a
/// camera that has the moon over its shoulder sees it.
const POLE: Vec3 = Vec3::new(0.659, 0.539, 0.524);
const CENTRE: Vec3 = Vec3::new(0.397, 0.342, -0.852);

/// The band of the Milky Way.
struct Band {
    seed: u32,
    scale: f32,
}

impl Painter for Band {
    #[inline(always)]
    fn paint(&self, d: &Points) -> [Rgb; WIDE] {
        let s = self.seed;
        let flow = [0, 1, 2].map(|k| fractal(s ^ (11 + k), &d.scaled(2.2, [4.0, k as f32, 1.0]), 3));
        let p = d.moved(&flow, 0.14);
        let cloud = fractal(s ^ 31, &p.scaled(3.1, [1.0, 2.0, 3.0]), 6);
        let dust = fractal(s ^ 41, &p.scaled(2.4, [7.0, 5.0, 3.0]), 6);
        let wave = fractal(s ^ 51, &d.scaled(1.7, [2.0, 2.0, 8.0]), 2);
        std::array::from_fn(|i| {
            let dir = Vec3::new(d.xyz[0][i], d.xyz[1][i], d.xyz[2][i]);
            self.shade(dir, cloud[i], dust[i], wave[i])
        })
    }
}

impl Band {
    #[inline(always)]
    fn shade(&self, d: Vec3, cloud: f32, dust: f32, wave: f32) -> Rgb {
        let latitude = d.dot(POLE) + 0.05 * wave;
        let core = smoothstep(-0.3, 1.0, d.dot(CENTRE));
        let width = 0.11 + 0.10 * core;
        let x = latitude / width;
        let band = trig::exp(-0.5 * x * x);
        let lane =
            trig::exp(-8.0 * x * x) * smoothstep(-0.35, 0.25, dust) + smoothstep(0.2, 0.6, dust) * band;
        let light = band * (0.25 + 0.95 * core * core) * (0.55 + 0.9 * smoothstep(-0.5, 0.6, cloud));
        let colour = Rgb::new(0.62, 0.70, 0.95).lerp(Rgb::new(1.0, 0.80, 0.58), core * band);
        colour * (light * (1.0 - 0.8 * lane.min(1.0)) * self.scale)
    }
}

/// What the night is made of.
struct Night {
    size: usize,
    seed: u32,
    scale: f32,
    toward_moon: DVec3,
    moon_half_angle: f64,
    moon_irradiance: f32,
}

/// A sky of the night in scene files.
pub const ROW: Row<dyn Skybox> = Row {
    kind: "night",
    doc: "a clear night: stars, the Milky Way and a moon",
    params: &[
        integer("size", (1, 4096), "1024", "texels across a face of the cube it is painted on"),
        integer("seed", (0, 1_000_000), "1", "which stars"),
        number("scale", (0.0, 1e9), "1.0", "scales all of its radiance"),
        number("moon_elevation_deg", (-18.0, 90.0), "38.0", "height of the moon"),
        number("moon_azimuth_deg", (-360.0, 360.0), "60.0", "from +x towards +z"),
        number("moon_half_angle_deg", (0.05, 5.0), "0.5", "half of its width; 0.26 in nature"),
        number("moon_irradiance", (0.0, 1e9), "1.7", "irradiance of a surface that faces the moon"),
    ],
    build: |p| {
        let night = Night {
            size: super::size(p, "size", 1024.0, 4096.0)?,
            seed: p.number_or("seed", 1.0)?.clamp(0.0, 1e6) as u32,
            scale: p.number_or("scale", 1.0)?.clamp(0.0, 1e9) as f32,
            toward_moon: super::toward(p, ["moon_elevation_deg", "moon_azimuth_deg"], [38.0, 60.0])?,
            moon_half_angle: p.number_or("moon_half_angle_deg", 0.5)?.clamp(0.05, 5.0).to_radians(),
            moon_irradiance: p.number_or("moon_irradiance", 1.7)?.clamp(0.0, 1e9) as f32,
        };
        Ok(Arc::new(night.paint()))
    },
    samples: || {
        let small = || Params::new().with("size", Value::Number(40.0));
        vec![small(), small().with("moon_irradiance", Value::Number(0.0)).with("seed", Value::Number(7.0))]
    },
};

impl Night {
    fn paint(&self) -> super::baked::Baked {
        // The moon lights the air as the sun does, and far more dimly than it lights a night's long exposure.
        let air = Daylight::new(&Weather {
            to_sun: self.toward_moon,
            turbidity: 1.6,
            // Woods: the horizon is to stand out from what is below it.
            ground_albedo: Rgb::splat(0.06),
            altitude_km: 0.3,
            scale: 0.16 * self.scale,
            white: Rgb::splat(1.0),
            disc: false,
        });
        // The Milky Way as in a long exposure: several times the air before it, and still dimmer than what the moon lights.
        let band = Band { seed: self.seed, scale: 0.11 * self.scale };
        let tint = Rgb::new(0.62, 0.8, 1.25);
        let airglow = Rgb::new(0.0040, 0.0062, 0.0090) * self.scale;
        let mut canvas = Canvas::painted(self.size.div_ceil(2).max(16), &band).finer(self.size, |d, band| {
            let above = smoothstep(-0.01, 0.35, d.y);
            air.radiance(d) * tint + airglow * (1.6 - 0.6 * d.y.max(0.0)) + band * above
        });
        canvas.add_spots(&self.stars());
        let mut discs = Vec::new();
        let irradiance = self.moon_irradiance * self.scale;
        if irradiance > 0.0 && self.toward_moon.y > 0.0 {
            // Sunlight reflected by dust is warmer than daylight. The eye, which sees blue better in the dark, and film
            // by custom call it cool.
            let colour = Rgb::new(0.80, 0.88, 1.0);
            let mut disc =
                SkyDisc { toward: self.toward_moon, half_angle: self.moon_half_angle, radiance: colour };
            disc.radiance = colour * (irradiance / disc.solid_angle() as f32);
            canvas.add_spots(&self.corona(colour * irradiance));
            discs.push(disc);
        }
        canvas.finish(discs)
    }

    /// Moonlight scattered by thin haze.
    fn corona(&self, flux: Rgb) -> Vec<Spot> {
        let spot = |share: f32, degrees: f32| Spot {
            toward: self.toward_moon.as_vec3(),
            flux: flux * share,
            sigma: degrees.to_radians(),
        };
        vec![spot(0.003, 0.8), spot(0.004, 2.0), spot(0.006, 6.0)]
    }

    fn stars(&self) -> Vec<Spot> {
        let mut random = Stream::new(u64::from(self.seed) ^ 0x0057_a25e);
        (0..20_000)
            .filter_map(|_| {
                let mut toward = random.direction();
                // A third of them gather in the Milky Way.
                if random.next() < 0.33 {
                    toward = (toward - POLE * (0.75 * toward.dot(POLE))).normalize();
                }
                let s = star(&mut random, toward, 1.2e-7 * self.scale);
                // Air dims what is low.
                let seen = smoothstep(0.0, 0.3, toward.y);
                (seen > 0.0).then_some(Spot { flux: s.flux * seen, ..s })
            })
            .collect()
    }
}
