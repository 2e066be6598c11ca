//! Skies painted once, when they are built, onto the texels of a cube map.

use super::cube::{self, Cube};
use super::noise::{Points, WIDE};
use crate::base::directions::Directions;
use crate::base::image_data::{ImageData, Texels};
use crate::base::skybox::{ChartDirections, ChartGrid, ChartLanes, ChartPoint, SkyDisc, Skybox};
use crate::color::Rgb;
use crate::math::simd;
use crate::sampler::hash::mix64;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// The finest table made, cells across a face: stars are too small and too dim to be worth finding one by one.
const TABLE: u32 = 128;

/// A painted sky.
pub(super) struct Baked {
    cube: Cube,
    discs: Vec<SkyDisc>,
}

/// Six faces while they are painted.
pub(super) struct Canvas {
    size: usize,
    faces: [Vec<[f32; 3]>; 6],
}

/// Paints `WIDE` directions at a time.
pub(super) trait Painter: Sync {
    /// Radiances towards unit vectors.
    fn paint(&self, d: &Points) -> [Rgb; WIDE];
}

impl Canvas {
    /// Faces of `size` texels painted by `painter`.
    pub fn painted(size: usize, painter: &impl Painter) -> Self {
        let mut faces = [(); 6].map(|()| vec![[0f32; 3]; size * size]);
        let rows: Vec<_> = faces
            .iter_mut()
            .enumerate()
            .flat_map(|(f, face)| face.chunks_mut(size).enumerate().map(move |(y, row)| (f, y, row)))
            .collect();
        rows.into_par_iter().for_each(|(f, y, row)| {
            for (i, texels) in row.chunks_mut(WIDE).enumerate() {
                let texel = |k: usize| centre(f, size, i * WIDE + k, y);
                let d: [Vec3; WIDE] = std::array::from_fn(texel);
                let axis = |a: usize| d.map(|v| v[a]);
                let points = Points { xyz: [axis(0), axis(1), axis(2)] };
                let painted = simd::dispatch(
                    #[inline(always)]
                    || painter.paint(&points),
                );
                for (t, c) in texels.iter_mut().zip(painted) {
                    *t = c.to_array();
                }
            }
        });
        Canvas { size, faces }
    }

    /// The same picture on finer faces, by bilinear interpolation across edges, times `transmit`.
    pub fn finer(self, size: usize, transmit: impl Fn(Vec3, Rgb) -> Rgb + Sync) -> Self {
        let coarse = self.cube();
        let mut faces = [(); 6].map(|()| vec![[0f32; 3]; size * size]);
        for (f, face) in faces.iter_mut().enumerate() {
            face.par_chunks_mut(size).enumerate().for_each(|(y, row)| {
                for (x, t) in row.iter_mut().enumerate() {
                    let d = centre(f, size, x, y);
                    *t = transmit(d, coarse.radiance(d)).to_array();
                }
            });
        }
        Canvas { size, faces }
    }

    fn cube(self) -> Cube {
        let n = self.size;
        let image = |t| ImageData { width: n, height: n, texels: Texels::F32(t) };
        Cube::of_alike(&self.faces.map(image))
    }

    /// Adds small round spots, each a Gaussian of its flux (irradiance facing it) however fine the texels.
    pub fn add_spots(&mut self, spots: &[Spot]) {
        let size = self.size;
        self.faces.par_iter_mut().enumerate().for_each(|(f, face)| {
            for s in spots {
                splat(f, face, size, s);
            }
        });
    }

    /// The finished sky.
    pub fn finish(self, discs: Vec<SkyDisc>) -> Baked {
        Baked { cube: self.cube(), discs }
    }
}

/// Unit direction of the centre of a texel.
fn centre(face: usize, size: usize, x: usize, y: usize) -> Vec3 {
    let at = |i: usize| (2.0 * i as f32 + 1.0) / size as f32 - 1.0;
    cube::face_point(face, at(x), -at(y)).normalize()
}

/// A small source of light: a star.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    /// Unit direction.
    pub toward: Vec3,
    /// Irradiance facing it.
    pub flux: Rgb,
    /// Standard deviation of its picture, radians; at least half a texel is painted.
    pub sigma: f32,
}

fn splat(f: usize, face: &mut [[f32; 3]], size: usize, spot: &Spot) {
    let Some((s, t)) = cube::face_coordinates(f, spot.toward) else { return };
    // Half a texel, where texels are largest: in the middle of a face.
    let sigma = spot.sigma.max(1.0 / size as f32);
    let reach = 4.0 * sigma * (1.0 + s * s + t * t);
    if s.abs() > 1.0 + reach || t.abs() > 1.0 + reach {
        return;
    }
    let half = 0.5 * size as f32;
    let range = |c: f32| {
        let at = |c: f32| (c * half + half).clamp(0.0, size as f32) as usize;
        at(c - reach)..(at(c + reach) + 1).min(size)
    };
    // A Gaussian of unit integral over solid angle.
    let peak = spot.flux * (1.0 / (std::f32::consts::TAU * sigma * sigma));
    for y in range(-t) {
        for x in range(s) {
            let apart = (centre(f, size, x, y) - spot.toward).length_squared();
            // Beyond four sigma lies 3e-4 of a spot, and where exponentials underflow they are slow.
            if apart > 16.0 * sigma * sigma {
                continue;
            }
            let c = peak * (-0.5 * apart / (sigma * sigma)).exp();
            for (v, c) in face[y * size + x].iter_mut().zip(c.to_array()) {
                *v += c;
            }
        }
    }
}

/// A stream of random numbers for placing things.
pub(super) struct Stream(u64);

impl Stream {
    pub fn new(seed: u64) -> Self {
        Stream(mix64(seed))
    }

    /// Uniform in [0, 1).
    pub fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (mix64(self.0) >> 40) as f32 / (1u32 << 24) as f32
    }

    /// Uniform on the unit sphere.
    pub fn direction(&mut self) -> Vec3 {
        crate::sampling::warp::uniform_sphere(glam::Vec2::new(self.next(), self.next()))
    }
}

/// A star of a random brightness and colour. Fluxes follow the law of stars spread evenly through space, N(> f) ~
/// f^-3/2, from `faintest` on; temperatures run from orange to blue.
pub(super) fn star(random: &mut Stream, toward: Vec3, faintest: f32) -> Spot {
    let flux = faintest * (1.0 - random.next()).max(1e-5).powf(-2.0 / 3.0);
    let t = random.next();
    let (cool, white, hot) = (Rgb::new(1.0, 0.72, 0.45), Rgb::new(1.0, 0.96, 0.92), Rgb::new(0.68, 0.8, 1.0));
    let colour = if t < 0.4 { cool.lerp(white, t / 0.4) } else { white.lerp(hot, (t - 0.4) / 0.6) };
    Spot { toward, flux: colour * flux, sigma: 0.0 }
}

impl Skybox for Baked {
    #[inline]
    fn radiance(&self, d: Vec3) -> Rgb {
        self.cube.radiance(d)
    }

    fn radiance_batch(&self, d: Directions, out: &mut [Rgb]) {
        self.cube.radiance_batch(d, out);
    }

    fn grid(&self) -> ChartGrid {
        let natural = self.cube.grid();
        ChartGrid { width: natural.width.min(TABLE), height: natural.height.min(TABLE), ..natural }
    }

    fn direction(&self, c: ChartPoint) -> DVec3 {
        self.cube.direction(c)
    }

    fn locate(&self, d: DVec3) -> ChartPoint {
        self.cube.locate(d)
    }

    fn solid_angle_density(&self, c: ChartPoint) -> f64 {
        self.cube.solid_angle_density(c)
    }

    fn direction_and_density(&self, c: ChartPoint) -> (DVec3, f64) {
        self.cube.direction_and_density(c)
    }

    fn directions_and_densities(&self, at: &ChartLanes, n: usize) -> ChartDirections {
        self.cube.directions_and_densities(at, n)
    }

    fn cell_integrals(&self, grid: ChartGrid) -> Vec<f64> {
        self.cube.cell_integrals(grid)
    }

    fn discs(&self) -> &[SkyDisc] {
        &self.discs
    }

    fn memory(&self) -> u64 {
        self.cube.memory()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spot_keeps_its_flux_on_any_texels_and_across_edges() {
        for size in [32, 101] {
            for toward in [Vec3::X, Vec3::new(1.0, 0.2, 1.0), Vec3::new(1.0, -1.0, 1.0)] {
                let mut canvas = Canvas { size, faces: [(); 6].map(|()| vec![[0.0; 3]; size * size]) };
                let flux = Rgb::new(1.0, 2.0, 3.0);
                canvas.add_spots(&[Spot { toward: toward.normalize(), flux, sigma: 0.05 }]);
                let sky = canvas.finish(Vec::new());
                let got = sky.cell_integrals(sky.grid()).iter().sum::<f64>();
                // A Gaussian of 1.6 texels or more, cut off at 4 sigma and bent to a sphere: a per cent.
                assert!((got / f64::from(flux.luminance()) - 1.0).abs() < 0.02, "{size} {toward}: {got}");
            }
        }
    }

    #[test]
    fn finer_faces_show_the_same() {
        struct Ramp;
        impl Painter for Ramp {
            fn paint(&self, d: &Points) -> [Rgb; WIDE] {
                std::array::from_fn(|i| Rgb::new(1.0 + d.xyz[0][i], 1.0 + d.xyz[1][i], 1.0 + d.xyz[2][i]))
            }
        }
        let sky = Canvas::painted(24, &Ramp).finer(50, |_, c| c).finish(Vec::new());
        for d in [Vec3::X, Vec3::NEG_Y, Vec3::new(0.6, 0.0, -0.8), Vec3::ONE.normalize()] {
            let c = sky.radiance(d);
            // Half a coarse texel of 1 / 12 at a corner, less elsewhere.
            assert!((Vec3::new(c.r, c.g, c.b) - Vec3::ONE - d).length() < 0.03, "{c:?} {d}");
        }
    }
}
