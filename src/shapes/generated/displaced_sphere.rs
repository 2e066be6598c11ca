//! A ball of mountains.

use super::noise::{Fractal, Jet, Noise};
use super::{Generated, Grid, GridVertex, SEED, TRIANGLES, integer, triangles};
use crate::base::mesh_data::MeshData;
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::shape::ShapeSource;
use crate::math::trig::sin_cos_2pi_f64;
use glam::DVec3;
use std::f64::consts::FRAC_PI_2;

/// The registry row.
pub const ROW: Row<dyn ShapeSource> = Row {
    kind: "displaced_sphere",
    doc: "a ball of ridges and valleys, of radius 1 to about 1.4, made in code",
    params: &[
        TRIANGLES,
        SEED,
        ParamSpec {
            name: "amplitude",
            kind: ParamKind::Number { min: 0.0, max: 2.0 },
            default: Some("0.4"),
            doc: "height of the ridges, in radii",
        },
        ParamSpec {
            name: "frequency",
            kind: ParamKind::Number { min: 0.1, max: 100.0 },
            default: Some("1.2"),
            doc: "of the largest ridges, per radius",
        },
    ],
    build: |p| {
        let frequency = p.number_or("frequency", 1.2)?;
        let amplitude = p.number_or("amplitude", 0.4)?;
        if !(0.1..=100.0).contains(&frequency) || !(0.0..=2.0).contains(&amplitude) {
            return Err(p.error("frequency", "or `amplitude` is out of range"));
        }
        let triangles = triangles(p)?;
        let noise = Noise { seed: integer(p, &SEED, 1.0)? };
        // Six sides of n x n cells of two triangles.
        let n = (f64::from(triangles) / 12.0).sqrt().round() as usize;
        let relief = Relief::new(noise, frequency, amplitude, FRAC_PI_2 / n as f64);
        Ok(Generated::source("displaced sphere", move || mesh(n, &relief)))
    },
    samples: || {
        vec![
            Params::new().with("triangles", Value::Number(600.0)),
            Params::new()
                .with("triangles", Value::Number(300.0))
                .with("seed", Value::Number(7.0))
                .with("amplitude", Value::Number(0.1)),
        ]
    },
};

/// The height of the surface over the unit sphere.
struct Relief {
    warp: [Fractal; 3],
    ridges: Fractal,
    swell: Fractal,
    amplitude: f64,
}

impl Relief {
    fn new(noise: Noise, frequency: f64, amplitude: f64, spacing: f64) -> Self {
        let fractal = |k: u32, factor: f64, most: u32| Fractal {
            noise: Noise { seed: noise.seed.wrapping_mul(16).wrapping_add(k) },
            frequency: frequency * factor,
            octaves: Fractal::octaves_for(frequency * factor, spacing).min(most),
            gain: 0.5,
        };
        Relief {
            warp: [fractal(0, 1.0, 2), fractal(1, 1.0, 2), fractal(2, 1.0, 2)],
            ridges: fractal(3, 1.0, 16),
            swell: fractal(4, 0.6, 3),
            amplitude,
        }
    }

    fn at(&self, d: DVec3) -> Jet {
        // Ridges bend where space is bent before they are looked up: q = d + w(d), and by the chain rule the
        // gradient is (1 + Dw)^T that of the ridges.
        let w = [self.warp[0].sum(d), self.warp[1].sum(d), self.warp[2].sum(d)];
        const BEND: f64 = 0.25;
        let r = self.ridges.ridges(d + DVec3::new(w[0].value, w[1].value, w[2].value) * BEND);
        let g = r.gradient;
        let bent = g + (w[0].gradient * g.x + w[1].gradient * g.y + w[2].gradient * g.z) * BEND;
        let ridges = Jet { value: r.value, gradient: bent };
        // Highlands and lowlands.
        let high = self.swell.sum(d).step(-0.7, 0.5);
        let land = high.scaled(0.8).plus(Jet::constant(0.2));
        ridges.times(land).plus(high.scaled(0.15)).scaled(self.amplitude)
    }
}

/// A cube's sides, blown up to a ball: outward, along i, along j.
const SIDES: [[DVec3; 3]; 6] = [
    [DVec3::X, DVec3::NEG_Z, DVec3::Y],
    [DVec3::NEG_X, DVec3::Z, DVec3::Y],
    [DVec3::Y, DVec3::X, DVec3::NEG_Z],
    [DVec3::NEG_Y, DVec3::X, DVec3::Z],
    [DVec3::Z, DVec3::X, DVec3::Y],
    [DVec3::NEG_Z, DVec3::NEG_X, DVec3::Y],
];

fn mesh(n: usize, relief: &Relief) -> MeshData {
    // tan spreads the cells evenly by angle. It is odd, exactly, and 1 at the border, so that vertices on the edge
    // between two sides, which both have, are the same to the bit, and the ball has no seam.
    let spread: Vec<f64> = (0..=n)
        .map(|i| {
            let a = (2.0 * i as f64 - n as f64) / n as f64;
            let at = sin_cos_2pi_f64(a.abs() * 0.125);
            let t = if a.abs() == 1.0 { 1.0 } else { at.sin / at.cos };
            t.copysign(a)
        })
        .collect();
    let grid = Grid { patches: 6, across: n, along: n, closed: false };
    grid.mesh(|side, i, j| {
        let [out, u, v] = SIDES[side];
        let c = out + u * spread[i] + v * spread[j];
        let d = c / c.length();
        let h = relief.at(d);
        let r = 1.0 + h.value;
        // The normal of the radial surface r(d) d: r d minus the part of r's gradient along the sphere.
        let along = h.gradient - d * h.gradient.dot(d);
        GridVertex { p: d * r, n: d * r - along }
    })
}
