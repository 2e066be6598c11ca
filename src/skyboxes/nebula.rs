//! Glowing clouds among stars, lit by one near star.

use super::baked::{Canvas, Painter, Spot, Stream, star};
use super::noise::{Points, WIDE, fractal, ridges, smoothstep};
use super::{integer, number};
use crate::base::registry::{Params, Row, Value};
use crate::base::skybox::{SkyDisc, Skybox};
use crate::color::Rgb;
use crate::error::Result;
use glam::DVec3;
use std::sync::Arc;

/// Clouds of gas: noise, folded by noise.
struct Clouds {
    seed: u32,
    scale: f32,
}

impl Painter for Clouds {
    #[inline(always)]
    fn paint(&self, d: &Points) -> [Rgb; WIDE] {
        let s = self.seed;
        // A slow flow bends everything; a faster one curls the edges.
        let flow = [0, 1, 2].map(|k| fractal(s ^ (11 + k), &d.scaled(1.1, [5.0, k as f32, 2.0]), 3));
        let bent = d.moved(&flow, 0.55);
        let curl = [0, 1, 2].map(|k| fractal(s ^ (21 + k), &bent.scaled(2.6, [1.0, 7.0, k as f32]), 3));
        let p = bent.moved(&curl, 0.16);
        let body = fractal(s ^ 31, &p.scaled(1.5, [0.0; 3]), 6);
        let veils = ridges(s ^ 41, &p.scaled(1.9, [3.0, 1.0, 4.0]), 5);
        let dust = fractal(s ^ 51, &p.scaled(2.3, [8.0, 2.0, 6.0]), 6);
        let hue = fractal(s ^ 61, &bent.scaled(0.9, [2.0, 9.0, 1.0]), 2);
        let grain = fractal(s ^ 71, &p.scaled(9.0, [6.0, 6.0, 1.0]), 3);
        std::array::from_fn(|i| self.shade(body[i], veils[i], dust[i], hue[i]) * (1.0 + 0.18 * grain[i]))
    }
}

impl Clouds {
    #[inline(always)]
    fn shade(&self, body: f32, veils: f32, dust: f32, hue: f32) -> Rgb {
        // The colours of emission: hydrogen's red, oxygen's teal, and starlight scattered blue by dust.
        let red = Rgb::new(0.95, 0.22, 0.20);
        let amber = Rgb::new(1.0, 0.52, 0.16);
        let teal = Rgb::new(0.08, 0.55, 0.62);
        let blue = Rgb::new(0.10, 0.20, 0.75);
        let dense = smoothstep(-0.25, 0.65, body);
        let warm = smoothstep(-0.28, 0.30, hue);
        let cold = blue.lerp(teal, smoothstep(-0.1, 0.4, body));
        let hot = red.lerp(amber, smoothstep(0.05, 0.6, body));
        let glow = cold.lerp(hot, warm) * (dense * dense * 0.9);
        let thread = veils * veils * dense;
        let threads = hot.lerp(Rgb::new(1.0, 0.85, 0.7), 0.4) * (thread * thread * 1.6);
        let dark = 1.0 - 0.85 * smoothstep(0.02, 0.45, dust);
        let space = Rgb::new(0.006, 0.008, 0.018);
        (space + (glow + threads) * dark) * self.scale
    }
}

/// A sky of clouds in scene files.
pub const ROW: Row<dyn Skybox> = Row {
    kind: "nebula",
    doc: "glowing clouds of gas among stars, lit by one near star",
    params: &[
        integer("size", (1, 4096), "1024", "texels across a face of the cube it is painted on"),
        integer("seed", (0, 1_000_000), "1", "which nebula"),
        number("scale", (0.0, 1e9), "1.0", "scales all of its radiance"),
        number("star_elevation_deg", (-90.0, 90.0), "35.0", "height of the near star"),
        number("star_azimuth_deg", (-360.0, 360.0), "60.0", "from +x towards +z"),
        number("star_irradiance", (0.0, 1e9), "1.8", "irradiance of a surface that faces the near star"),
    ],
    build,
    samples: || {
        let small = |seed: f64| {
            let p = Params::new().with("size", Value::Number(40.0));
            p.with("seed", Value::Number(seed))
        };
        vec![small(1.0), small(2.0).with("star_irradiance", Value::Number(0.0))]
    },
};

fn build(p: &Params) -> Result<Arc<dyn Skybox>> {
    let size = super::size(p, "size", 1024.0, 4096.0)?;
    let seed = p.number_or("seed", 1.0)?.clamp(0.0, 1e6) as u32;
    let scale = p.number_or("scale", 1.0)?.clamp(0.0, 1e9) as f32;
    let toward = super::toward(p, ["star_elevation_deg", "star_azimuth_deg"], [35.0, 60.0])?;
    let irradiance = p.number_or("star_irradiance", 1.8)?.clamp(0.0, 1e9) as f32 * scale;
    // Clouds are soft: half the texels show all of them.
    let mut canvas = Canvas::painted(size.div_ceil(2).max(16), &Clouds { seed, scale }).finer(size, |_, c| c);
    let colour = Rgb::new(0.92, 0.97, 1.0);
    canvas.add_spots(&stars(seed, scale));
    let mut discs = Vec::new();
    if irradiance > 0.0 {
        canvas.add_spots(&halo(toward, colour * irradiance));
        let mut disc = SkyDisc { toward, half_angle: 0.3f64.to_radians(), radiance: colour };
        disc.radiance = colour * (irradiance / disc.solid_angle() as f32);
        discs.push(disc);
    }
    Ok(Arc::new(canvas.finish(discs)))
}

/// The glow about a bright star: a hundredth of its light, spread by the eye or the lens.
fn halo(toward: DVec3, flux: Rgb) -> Vec<Spot> {
    let spot = |share: f32, degrees: f32| Spot {
        toward: toward.as_vec3(),
        flux: flux * share,
        sigma: degrees.to_radians(),
    };
    vec![spot(0.004, 0.5), spot(0.004, 1.4), spot(0.004, 4.0)]
}

fn stars(seed: u32, scale: f32) -> Vec<Spot> {
    let mut random = Stream::new(u64::from(seed) ^ 0x5747_a125);
    (0..16_000)
        .map(|_| {
            let toward = random.direction();
            star(&mut random, toward, 1.1e-7 * scale)
        })
        .collect()
}
