//! One equirectangular picture around the origin.
//!
//! u = 0.5 + atan2(z, x) / 2 pi to the right, elevation from the bottom to the top: the middle column looks along +x.

mod lookups;

use super::texel::{self, CellSums, Spread, Tap};
use crate::base::directions::Directions;
use crate::base::image_data::ImageData;
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::skybox::{ChartDirections, ChartGrid, ChartLanes, ChartPoint, Skybox};
use crate::color::Rgb;
use crate::math::simd;
use crate::math::trig::{atan2_turns, atan2_turns_f64, sin_cos_2pi_f64};
use glam::{DVec3, Vec3};
use lookups::Lookups;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

/// The finest table made for eight-bit maps, cells down; twice as many across.
const TABLE_8BIT: usize = 256;

/// A sphere map. Bilinear filtering wraps around; between the outermost rows and the poles it runs towards one value
/// a pole, the mean of the row, so that the sky is continuous there too.
pub struct Sphere {
    image: Arc<ImageData>,
    top: Rgb,
    bottom: Rgb,
}

impl Sphere {
    /// From a picture of any size.
    pub fn new(image: Arc<ImageData>) -> Self {
        let mean = |y: usize| {
            let mut sum = [0f64; 3];
            for x in 0..image.width {
                for (s, c) in sum.iter_mut().zip(image.texel(x, y).to_array()) {
                    *s += f64::from(c);
                }
            }
            Rgb::from(sum.map(|s| (s / image.width as f64) as f32))
        };
        let (top, bottom) = (mean(0), mean(image.height - 1));
        Sphere { image, top, bottom }
    }

    /// A tap that leaves the picture on a side or touches a pole.
    #[cold]
    #[inline(never)]
    fn across_edges(&self, t: Tap) -> Rgb {
        let (w, h) = (self.image.width as i32, self.image.height as i32);
        let texel = |x: i32, y: i32| self.image.texel(x.rem_euclid(w) as usize, y as usize);
        let row = |y: i32| texel(t.x, y) * (1.0 - t.fx) + texel(t.x + 1, y) * t.fx;
        // From the centre of an outermost row it is half a texel to the pole.
        if t.y < 0 {
            self.top.lerp(row(0), (2.0 * t.fy - 1.0).clamp(0.0, 1.0))
        } else if t.y + 1 >= h {
            row(h - 1).lerp(self.bottom, (2.0 * t.fy).clamp(0.0, 1.0))
        } else {
            row(t.y).lerp(row(t.y + 1), t.fy)
        }
    }

    /// Luminances of the texels of row `y`, with one more on either side; the poles are rows of their own.
    fn row(&self, y: i64, out: &mut Vec<f32>) {
        let (w, h) = (self.image.width, self.image.height as i64);
        out.push(0.0);
        if (0..h).contains(&y) {
            let start = y as usize * w;
            texel::luminances(&self.image.texels, start..start + w, out);
        } else {
            let pole = if y < 0 { self.top } else { self.bottom };
            out.extend(std::iter::repeat_n(pole.luminance(), w));
        }
        out[0] = out[w];
        out.push(out[1]);
    }
}

/// Where a direction lies among so many texels.
#[inline(always)]
fn tap([w, h]: [f32; 2], [x, y, z]: [f32; 3]) -> Tap {
    let turns = atan2_turns(z, x) + 0.5;
    // By both legs rather than by asin, which has no digits left near the poles.
    let below = 0.5 - 2.0 * atan2_turns(y, (x * x + z * z).sqrt());
    Tap::new(turns * w, below * h)
}

/// See [`Skybox::direction_and_density`].
#[inline(always)]
fn toward(c: ChartPoint) -> (DVec3, f64) {
    // From -x, where u begins.
    let (a, p) = (sin_cos_2pi_f64(c.u), sin_cos_2pi_f64(0.5 * c.v));
    (DVec3::new(-p.sin * a.cos, p.cos, -p.sin * a.sin), TAU * PI * p.sin)
}

impl Skybox for Sphere {
    #[inline]
    fn radiance(&self, d: Vec3) -> Rgb {
        let size = [self.image.width as f32, self.image.height as f32];
        self.at(tap(size, d.to_array()))
    }

    fn radiance_batch(&self, d: Directions, out: &mut [Rgb]) {
        simd::dispatch(Lookups { sphere: self, d, out });
    }

    fn grid(&self) -> ChartGrid {
        let (w, h) = (self.image.width, self.image.height);
        ChartGrid {
            count: 1,
            width: texel::table_size(&self.image.texels, w, 2 * TABLE_8BIT) as u32,
            height: texel::table_size(&self.image.texels, h, TABLE_8BIT) as u32,
        }
    }

    fn direction(&self, c: ChartPoint) -> DVec3 {
        toward(c).0
    }

    fn locate(&self, d: DVec3) -> ChartPoint {
        let u = 0.5 + atan2_turns_f64(d.z, d.x);
        let v = 2.0 * atan2_turns_f64((d.x * d.x + d.z * d.z).sqrt(), d.y);
        ChartPoint { chart: 0, u, v }
    }

    fn solid_angle_density(&self, c: ChartPoint) -> f64 {
        TAU * PI * sin_cos_2pi_f64(0.5 * c.v).sin
    }

    fn direction_and_density(&self, c: ChartPoint) -> (DVec3, f64) {
        toward(c)
    }

    fn directions_and_densities(&self, at: &ChartLanes, _n: usize) -> ChartDirections {
        at.directions(toward)
    }

    fn cell_integrals(&self, grid: ChartGrid) -> Vec<f64> {
        let (w, h) = (self.image.width, self.image.height);
        let across = Spread::even(w, grid.width as usize);
        let mut rows: Vec<f64> = (0..h + 2).map(|i| i as f64 - 0.5).collect();
        (rows[0], rows[h + 1]) = (0.0, h as f64);
        let texel = TAU / w as f64 * PI / h as f64;
        let along = Spread::new(&rows, grid.height as usize, |y| texel * (y / h as f64 * PI).sin());
        let sums = CellSums { grid, across: &across, along: &along };
        sums.integrate(|_, y, out| self.row(y, out))
    }

    fn memory(&self) -> u64 {
        texel::bytes(&self.image)
    }
}

/// A sphere map in scene files.
pub const ROW: Row<dyn Skybox> = Row {
    kind: "sphere",
    doc: "one equirectangular picture; its middle column looks along +x",
    params: &[
        ParamSpec { name: "path", kind: ParamKind::Image, default: None, doc: "the picture" },
        super::ENCODING,
    ],
    build: |p| Ok(Arc::new(Sphere::new(p.image("path")?))),
    samples,
};

fn samples() -> Vec<Params> {
    let of = |w: usize, h: usize, texel: &dyn Fn(usize) -> [f32; 3]| {
        Params::new().with("path", Value::image(texel::picture(w, h, texel)))
    };
    vec![
        of(1, 1, &|_| [0.2, 0.4, 0.6]),
        of(8, 4, &|i| [i as f32, 0.5, 1.0]),
        of(70, 35, &|i| if i == 1000 { [1e6; 3] } else { [0.0; 3] }),
        of(64, 33, &|i| if i == 3 { [1.0; 3] } else { [1e-12; 3] }),
    ]
}

#[cfg(test)]
mod tests;
