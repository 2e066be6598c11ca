//! A mountain island.

use super::noise::{Fractal, Jet, Noise};
use super::{Generated, Grid, GridVertex, SEED, TRIANGLES, integer, triangles};
use crate::base::mesh_data::MeshData;
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::shape::ShapeSource;
use glam::DVec3;

/// The registry row.
pub const ROW: Row<dyn ShapeSource> = Row {
    kind: "terrain",
    doc: "a mountain island over the square from -1 to 1 in x and z, made in code; its shore lies at y = 0",
    params: &[
        TRIANGLES,
        SEED,
        ParamSpec {
            name: "height",
            kind: ParamKind::Number { min: 0.0, max: 10.0 },
            default: Some("0.5"),
            doc: "about that of the highest peak",
        },
        ParamSpec {
            name: "frequency",
            kind: ParamKind::Number { min: 0.1, max: 100.0 },
            default: Some("1.6"),
            doc: "of the largest ridges, per unit",
        },
    ],
    build: |p| {
        let frequency = p.number_or("frequency", 1.6)?;
        let height = p.number_or("height", 0.5)?;
        if !(0.1..=100.0).contains(&frequency) || !(0.0..=10.0).contains(&height) {
            return Err(p.error("frequency", "or `height` is out of range"));
        }
        let triangles = triangles(p)?;
        let noise = Noise { seed: integer(p, &SEED, 1.0)? };
        let n = (f64::from(triangles) / 2.0).sqrt().round() as usize;
        let island = Island::new(noise, frequency, height, 2.0 / n as f64);
        Ok(Generated::source("terrain", move || mesh(n, &island)))
    },
    samples: || {
        vec![
            Params::new().with("triangles", Value::Number(600.0)),
            Params::new()
                .with("triangles", Value::Number(300.0))
                .with("seed", Value::Number(3.0))
                .with("height", Value::Number(1.0)),
        ]
    },
};

struct Island {
    warp: [Fractal; 2],
    ridges: Fractal,
    hills: Fractal,
    coast: Fractal,
    height: f64,
}

impl Island {
    fn new(noise: Noise, frequency: f64, height: f64, spacing: f64) -> Self {
        let fractal = |k: u32, factor: f64, most: u32| Fractal {
            noise: Noise { seed: noise.seed.wrapping_mul(16).wrapping_add(8 + k) },
            frequency: frequency * factor,
            octaves: Fractal::octaves_for(frequency * factor, spacing).min(most),
            gain: 0.5,
        };
        Island {
            warp: [fractal(0, 0.8, 3), fractal(1, 0.8, 3)],
            ridges: fractal(2, 1.0, 16),
            hills: fractal(3, 2.0, 12),
            coast: fractal(4, 0.7, 8),
            height,
        }
    }

    fn at(&self, p: DVec3) -> Jet {
        const BEND: f64 = 0.22;
        let (wx, wz) = (self.warp[0].sum(p), self.warp[1].sum(p));
        let r = self.ridges.ridges(p + DVec3::new(wx.value, 0.0, wz.value) * BEND);
        let bent = r.gradient + (wx.gradient * r.gradient.x + wz.gradient * r.gradient.z) * BEND;
        let ridges = Jet { value: r.value, gradient: bent };
        let hills = self.hills.sum(p).scaled(0.06);
        // 1 in the middle, below 0 towards the border: the coast is where its noise and it balance.
        let radial = Jet { value: 1.0 - 1.25 * p.length_squared(), gradient: p * -2.5 };
        let land = radial.plus(self.coast.sum(p).scaled(0.7));
        // Mountains rise inland; the shore is flat and goes on below the sea.
        let inland = land.step(0.1, 1.2);
        let shore = land.plus(Jet::constant(-0.05)).scaled(0.08);
        let floor = shore.step(-0.06, 0.0).scaled(0.06).plus(Jet::constant(-0.06));
        let ground = if shore.value > 0.0 { shore } else { floor };
        let relief = ridges.plus(hills).times(inland);
        relief.plus(ground).scaled(self.height)
    }
}

fn mesh(n: usize, island: &Island) -> MeshData {
    let at = |i: usize| 2.0 * i as f64 / n as f64 - 1.0;
    let grid = Grid { patches: 1, across: n, along: n, closed: false };
    grid.mesh(|_, i, j| {
        // i along x and j against z: counter-clockwise from above.
        let p = DVec3::new(at(i), 0.0, -at(j));
        let h = island.at(p);
        GridVertex { p: p + DVec3::Y * h.value, n: DVec3::new(-h.gradient.x, 1.0, -h.gradient.z) }
    })
}
