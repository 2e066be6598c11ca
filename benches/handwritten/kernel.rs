//! The hand-written kernel of `plain.toml`: what a program does that can show this one scene and nothing else.
//!
//! Single precision, a film of floats, constants for the material and the sky, no virtual call, no vertex record. The
//! camera, the sample points and the map to the cosine-weighted hemisphere are skylit's, so that both take the same
//! samples and their pictures can be held against each other pixel by pixel.

use super::embree::{CALL, Hits, Mesh, Rays};
use super::scatter::{LANES, Lanes, Leaving, scatter};
use embree_sys::INVALID_ID;
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use skylit::base::camera::Projection;
use skylit::base::pixel_rect::PixelRect;
use skylit::math::simd::{self, dispatch};
use skylit::sampler::{Dim, PointSet, Slot};
use std::sync::Mutex;

/// Radiance of the sky, and what the clay makes of it, as in `plain.toml`.
const SKY: [f32; 3] = [1.0; 3];
const CLAY: [f32; 3] = [0.8; 3];

/// Side of a block of pixels.
const SIDE: u32 = 16;
/// Rays in single precision miss their place on the film by less, in pixels.
const MARGIN: f64 = 0.02;

pub struct Kernel {
    pub mesh: Mesh,
    /// A pinhole.
    pub camera: Projection,
    pub size: [u32; 2],
    pub points: PointSet,
    /// Samples a pixel; a pixel's rays go into one call, so at most [`CALL`].
    pub spp: u32,
}

/// Mean radiances by pixel, row by row.
pub type Film = Vec<[f32; 3]>;

impl Kernel {
    /// The picture; `skip` leaves pixels without rays that no triangle projects into.
    pub fn render(&self, skip: bool) -> Film {
        let [w, h] = self.size;
        let whole = PixelRect::of_size(w, h);
        let covered = skip.then(|| self.covered());
        let film = Mutex::new(vec![[0.0; 3]; whole.area()]);
        let tiles: Vec<PixelRect> = whole.tiles(SIDE).collect();
        tiles.par_iter().with_max_len(1).for_each_init(
            || Worker::new(self),
            |worker, tile| {
                worker.tile(*tile, covered.as_deref());
                let mut film = film.lock().expect("no panic while a tile is stored");
                for ((x, y), sum) in tile.pixels().zip(&worker.sums) {
                    film[(y * w + x) as usize] = sum.map(|v| v / self.spp as f32);
                }
            },
        );
        film.into_inner().expect("all tiles are done")
    }

    /// Which pixels a triangle may project into: those of its bounds on the film. The whole mesh lies before the camera.
    pub fn covered(&self) -> Vec<bool> {
        let [w, h] = self.size;
        let positions = &self.mesh.positions[..self.mesh.positions.len() - 1];
        let on_film = |p: &[f32; 3]| self.camera.film(DVec3::from(p.map(f64::from)));
        let film: Vec<[f64; 2]> = positions.iter().map(on_film).collect();
        let mut covered = vec![false; (w * h) as usize];
        for t in &self.mesh.indices {
            let [a, b, c] = t.map(|i| film[i as usize]);
            let span = |axis: usize, n: u32| {
                let low = a[axis].min(b[axis]).min(c[axis]) - MARGIN;
                let high = a[axis].max(b[axis]).max(c[axis]) + MARGIN;
                let end = (high.floor() + 1.0).clamp(0.0, f64::from(n));
                low.floor().clamp(0.0, f64::from(n)) as u32..end as u32
            };
            for y in span(1, h) {
                let x = span(0, w);
                covered[(y * w + x.start) as usize..(y * w + x.end.max(x.start)) as usize].fill(true);
            }
        }
        covered
    }
}

/// What a thread keeps.
struct Worker<'a> {
    kernel: &'a Kernel,
    /// Sums of the tile, row by row.
    sums: Vec<[f32; 3]>,
    /// Pixels of the batch, each with its number in the tile.
    pixels: Vec<([u32; 2], usize)>,
    /// Film positions, then points.
    film: [Vec<f32>; 2],
    uv: [Vec<f32>; 2],
    rays: Rays,
    hits: Hits,
    /// Numbers of the rays that hit.
    hit: Vec<usize>,
    shadow: Rays,
    /// Numbers of the pixels of the shadow rays in the batch.
    shadow_pixels: Vec<usize>,
}

impl<'a> Worker<'a> {
    fn new(kernel: &'a Kernel) -> Self {
        let columns = || [(); 2].map(|()| vec![0.0; CALL]);
        let mut rays = Rays::default();
        let eye = kernel.camera.eye.as_vec3().to_array();
        rays.o.iter_mut().zip(eye).for_each(|(column, e)| column.fill(e));
        Worker {
            kernel,
            sums: Vec::new(),
            pixels: Vec::new(),
            film: columns(),
            uv: columns(),
            rays,
            hits: Hits::default(),
            hit: Vec::new(),
            shadow: Rays::default(),
            shadow_pixels: Vec::new(),
        }
    }

    fn tile(&mut self, tile: PixelRect, covered: Option<&[bool]>) {
        let spp = self.kernel.spp;
        let all = SKY.map(|s| s * spp as f32);
        self.sums.clear();
        self.sums.resize(tile.area(), [0.0; 3]);
        for (number, (x, y)) in tile.pixels().enumerate() {
            if covered.is_some_and(|c| !c[(y * self.kernel.size[0] + x) as usize]) {
                self.sums[number] = all;
                continue;
            }
            self.pixels.push(([x, y], number));
            if (self.pixels.len() + 1) * spp as usize > CALL {
                self.batch();
            }
        }
        self.batch();
    }

    /// All samples of the pixels that were gathered.
    fn batch(&mut self) {
        let n = self.pixels.len() * self.kernel.spp as usize;
        if n == 0 {
            return;
        }
        self.camera_rays(n);
        self.kernel.mesh.closest(&mut self.rays, n, &mut self.hits);
        self.sort_out(n);
        if !self.hit.is_empty() {
            self.shade();
        }
        self.pixels.clear();
    }

    fn camera_rays(&mut self, n: usize) {
        let spp = self.kernel.spp as usize;
        for (k, ([x, y], _)) in self.pixels.iter().enumerate() {
            let range = k * spp..(k + 1) * spp;
            let [fx, fy] = self.film.each_mut().map(|c| &mut c[range.clone()]);
            self.kernel.points.pixel(*x, *y, 0).fill_2d(0, Dim::FILTER, fx, fy);
            fx.iter_mut().for_each(|v| *v += *x as f32);
            fy.iter_mut().for_each(|v| *v += *y as f32);
        }
        let film = self.film.each_ref().map(|c| &c[..n]);
        let d = self.rays.d.each_mut().map(|c| &mut c[..n]);
        dispatch(Pinhole { camera: &self.kernel.camera, film, d });
    }

    /// Misses see the sky.
    fn sort_out(&mut self, n: usize) {
        let spp = self.kernel.spp as usize;
        self.hit.clear();
        for (k, (_, number)) in self.pixels.iter().enumerate() {
            let mut misses = 0;
            for i in k * spp..((k + 1) * spp).min(n) {
                match self.hits.prim[i] {
                    INVALID_ID => misses += 1,
                    _ => self.hit.push(i),
                }
            }
            add(&mut self.sums[*number], SKY, misses);
        }
    }

    /// A ray from each hit; those that nothing blocks bring the sky's light.
    fn shade(&mut self) {
        let spp = self.kernel.spp as usize;
        // Points of whole pixels: made together, they cost least.
        let mut last = usize::MAX;
        for &i in &self.hit {
            let k = i / spp;
            if k != last {
                let [x, y] = self.pixels[k].0;
                let [u, v] = self.uv.each_mut().map(|c| &mut c[k * spp..(k + 1) * spp]);
                self.kernel.points.pixel(x, y, 0).fill_2d(0, Dim::at(1, Slot::BsdfUv), u, v);
                last = k;
            }
        }
        self.shadow_pixels.clear();
        let mut lanes = Lanes::default();
        let mut out = Leaving::default();
        for first in (0..self.hit.len()).step_by(LANES) {
            let some = &self.hit[first..self.hit.len().min(first + LANES)];
            for (lane, &i) in some.iter().enumerate() {
                let hit = [self.hits.uv[0][i], self.hits.uv[1][i]];
                let d = self.rays.d.each_ref().map(|c| c[i]);
                lanes.gather(lane, &self.kernel.mesh, self.hits.prim[i], hit, d);
                lanes.point(lane, [self.uv[0][i], self.uv[1][i]]);
            }
            dispatch(Scatter { lanes: &lanes, out: &mut out });
            for (lane, &i) in some.iter().enumerate().filter(|(lane, _)| out.is_up(*lane)) {
                let n = self.shadow_pixels.len();
                for axis in 0..3 {
                    self.shadow.o[axis][n] = out.o[axis][lane];
                    self.shadow.d[axis][n] = out.d[axis][lane];
                }
                self.shadow_pixels.push(self.pixels[i / spp].1);
            }
        }
        self.kernel.mesh.any(&mut self.shadow, self.shadow_pixels.len());
        let lit = |n: usize| {
            [0, 1, 2]
                .map(|c: usize| SKY[c] * CLAY[c])
                .map(|v| if self.shadow.is_blocked(n) { 0.0 } else { v })
        };
        for (n, &pixel) in self.shadow_pixels.iter().enumerate() {
            add(&mut self.sums[pixel], lit(n), 1);
        }
    }
}

#[inline(always)]
fn add(sum: &mut [f32; 3], radiance: [f32; 3], times: u32) {
    sum.iter_mut().zip(radiance).for_each(|(s, r)| *s += r * times as f32);
}

/// Directions of a pinhole camera.
struct Pinhole<'a> {
    camera: &'a Projection,
    film: [&'a [f32]; 2],
    d: [&'a mut [f32]; 3],
}

impl simd::Kernel for Pinhole<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let c = self.camera;
        let (forward, dx, dy) = (c.forward.as_vec3(), c.steps[0].as_vec3(), c.steps[1].as_vec3());
        let (mx, my) = (c.middle[0] as f32, c.middle[1] as f32);
        let n = self.film[0].len();
        let (fx, fy) = (&self.film[0][..n], &self.film[1][..n]);
        let [x, y, z] = self.d;
        let (x, y, z) = (&mut x[..n], &mut y[..n], &mut z[..n]);
        for i in 0..n {
            let d: Vec3 = forward + (fx[i] - mx) * dx + (fy[i] - my) * dy;
            let inv = 1.0 / d.length_squared().sqrt();
            (x[i], y[i], z[i]) = (d.x * inv, d.y * inv, d.z * inv);
        }
    }
}

struct Scatter<'a> {
    lanes: &'a Lanes,
    out: &'a mut Leaving,
}

impl simd::Kernel for Scatter<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        scatter(self.lanes, self.out);
    }
}
