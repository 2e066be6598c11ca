//! Pixels that see nothing but what is behind everything: their filter's integral of it, instead of samples.
//!
//! A sky that is the same everywhere is what it is, and one without detail takes a few points a tile (`smooth`). Any other
//! sky, and tiles that a sun or a horizon runs through, are looked up on a grid of 4 x 4 points a pixel, which neighbours
//! share, and the filter laid over it one axis after the other: up to 144 points count for a pixel, of which it pays for
//! 16 to 23. Half of the points make an estimate
//! by themselves and the other half another, in three ways: by rows, by columns and by fields, of which those at the ends
//! of every four are one half and those between the other, so that a mere slope divides evenly. Where halves differ by too
//! much (the rim of a sun, stars, texels as large as pixels that differ wildly) the pixel is sampled as others are. One way
//! is not enough: halves agree by chance, too.

mod smooth;

use super::coverage::{Coverage, LEAST_SPP};
use super::film::TILE_SIDE;
use crate::base::camera::FilmSamples;
use crate::base::directions::Directions;
use crate::base::pixel_rect::PixelRect;
use crate::base::ray::RayBatch;
use crate::color::Rgb;
use crate::math::simd;
use crate::sampling::filter::PixelFilter;
use crate::scene::Scene;
use crate::scene::desc::Background;
use glam::{Vec3, Vec4};

/// Points along each side of a pixel.
const PER_PIXEL: usize = 4;
/// Largest sum, over the three ways, of half the difference of the halves, over the mean, of a pixel that is taken.
/// Measured over all preset skies and three filters, errors of what is taken are below 0.44 of this.
const TOLERANCE: f32 = 1e-3;

/// Tiles that are tried.
const TRIED: usize = 16;
/// Samples whose rays cost as much as the lookups of a pixel, and as its share of a few points a tile.
const WORTH: [u64; 2] = [12, 1];

/// Which pixels see nothing, if integrals pay there: if of these pixels enough can be taken. It is found out first whether in
/// any tile enough of all could be, as if nothing stood before them: under a photograph of fine grain hardly one can. Some
/// tiles tell, the same whatever the threads.
pub fn pays(scene: &Scene, filter: PixelFilter, rect: PixelRect, spp: u32) -> Option<Coverage> {
    scene.camera.projection()?;
    let pays = |[spent, taken]: [u64; 2]| taken * u64::from(spp) >= spent;
    if spp < LEAST_SPP || !tried(scene, filter, rect, |_, _| true).into_iter().any(pays) {
        return None;
    }
    let coverage = Coverage::of(scene, rect, filter, spp)?;
    let free = tried(scene, filter, rect, |x, y| !coverage.is_covered(x, y));
    let all = free.iter().fold([0; 2], |[a, b], [spent, taken]| [a + spent, b + taken]);
    pays(all).then_some(coverage)
}

/// Of some tiles, what the lookups of the pixels cost that are free, in samples, and how many can be taken.
fn tried(
    scene: &Scene,
    filter: PixelFilter,
    rect: PixelRect,
    is_free: impl Fn(u32, u32) -> bool,
) -> Vec<[u64; 2]> {
    let tiles: Vec<PixelRect> =
        rect.tiles(TILE_SIDE).filter(|tile| tile.pixels().any(|(x, y)| is_free(x, y))).collect();
    let mut backdrop = Backdrop::default();
    let of_tile = |tile: &PixelRect| {
        backdrop.fill(scene, filter, *tile);
        let free = tile.pixels().filter(|&(x, y)| is_free(x, y));
        free.fold([0; 2], |[spent, taken], (x, y)| {
            [spent + WORTH[usize::from(backdrop.is_cheap)], taken + u64::from(backdrop.get(x, y).is_some())]
        })
    };
    tiles.iter().step_by(tiles.len().div_ceil(TRIED).max(1)).map(of_tile).collect()
}

/// Works out pixels; keeps its room from tile to tile.
#[derive(Default)]
pub struct Backdrop {
    x: Vec<f32>,
    y: Vec<f32>,
    rays: RayBatch,
    li: Vec<Rgb>,
    more: Vec<Rgb>,
    /// See [`FoldDown`].
    columns: [Vec<f32>; 2],
    /// Those of tiles without detail, from the coarsest on.
    lattices: [smooth::Axis; 3],
    tile: Vec<Rgb>,
    room: smooth::Room,
    /// By pixel of the tile.
    pixels: Vec<Option<Rgb>>,
    rect: PixelRect,
    /// See [`taps`], and whose they are.
    taps: Option<Vec<[f32; 2]>>,
    filter: Option<PixelFilter>,
    /// Whether they took a few points together, or none.
    is_cheap: bool,
}

/// What each point along one axis about a pixel counts for, first to last: the filter's weight, together 1, and half of
/// what it adds to the difference of the halves, together 0. None where the filter's edge lies between points.
fn taps(filter: PixelFilter) -> Option<Vec<[f32; 2]>> {
    let n = 2.0 * filter.radius() * PER_PIXEL as f32;
    if n.fract() != 0.0 || n < 1.0 {
        return None;
    }
    let n = n as usize;
    let weight = |i: usize| filter.density(((i as f32 + 0.5) / n as f32 * 2.0 - 1.0) * filter.radius());
    let sum: f32 = (0..n).map(weight).sum();
    let sign = |i: usize| if matches!(i % PER_PIXEL, 0 | 3) { 1.0 } else { -1.0 };
    let apart: f32 = (0..n).map(|i| weight(i) * sign(i)).sum::<f32>() / sum;
    Some((0..n).map(|i| weight(i) / sum).enumerate().map(|(i, w)| [w, w * (sign(i) - apart)]).collect())
}

impl Backdrop {
    /// Works out the pixels of a rectangle; see [`Backdrop::get`].
    pub fn fill(&mut self, scene: &Scene, filter: PixelFilter, rect: PixelRect) {
        self.rect = rect;
        self.pixels.clear();
        let same = match scene.background {
            Background::Transparent => Some(Rgb::BLACK),
            Background::Color(c) => Some(Rgb::from(c)),
            Background::Sky => scene.lights.le_everywhere(),
        };
        self.is_cheap = true;
        self.pixels.resize(rect.area(), same);
        if same.is_some() {
            return;
        }
        if self.filter != Some(filter) {
            (self.filter, self.taps) = (Some(filter), taps(filter));
            self.lattices = Default::default();
        }
        let Some(taps) = self.taps.take() else { return };
        // Tiles of the whole picture, whatever part of it is rendered: no pixel depends on that.
        let start = |from: u32| from / TILE_SIDE * TILE_SIDE;
        for y in (start(rect.y0)..rect.y1).step_by(TILE_SIDE as usize) {
            for x in (start(rect.x0)..rect.x1).step_by(TILE_SIDE as usize) {
                let tile = PixelRect::new(x, y, x + TILE_SIDE, y + TILE_SIDE);
                let part = tile.intersection(&rect);
                if self.fill_smooth(scene, &taps, tile) {
                    part.pixels()
                        .for_each(|(x, y)| self.pixels[rect.index(x, y)] = Some(self.tile[tile.index(x, y)]));
                } else {
                    self.is_cheap = false;
                    self.fill_sky(scene, &taps, part);
                }
            }
        }
        self.taps = Some(taps);
    }

    /// What a pixel of the rectangle shows; None where it must be sampled.
    pub fn get(&self, x: u32, y: u32) -> Option<Rgb> {
        self.pixels[self.rect.index(x, y)]
    }

    /// Works out a tile by a few points, if it can be; see [`smooth`].
    fn fill_smooth(&mut self, scene: &Scene, taps: &[[f32; 2]], tile: PixelRect) -> bool {
        for (level, step) in smooth::steps(scene.camera.pixel_spread()).enumerate() {
            let axis = &mut self.lattices[level];
            axis.prepare(taps, step);
            self.x.clear();
            self.y.clear();
            let n = axis.points.len();
            for y in &axis.points {
                self.x.extend(axis.points.iter().map(|x| tile.x0 as f32 + x));
                self.y.extend(std::iter::repeat_n(tile.y0 as f32 + y, n));
            }
            self.aim(scene);
            // All lattices of a tile have the same corners.
            if level == 0 && !is_smooth(scene, self.rays.directions(), n) {
                return false;
            }
            self.look_up(scene);
            let axis = &self.lattices[level];
            if axis.fits(&self.li, &mut self.room) {
                axis.pixels(&self.li, &mut self.room, &mut self.tile);
                return true;
            }
        }
        false
    }

    fn fill_sky(&mut self, scene: &Scene, taps: &[[f32; 2]], rect: PixelRect) {
        // The first point of the first pixel's filter, in points from the pixel's left edge.
        let before = (taps.len() - PER_PIXEL) / 2;
        let span = |pixels: u32| pixels as usize * PER_PIXEL + 2 * before;
        let (w, h) = (span(rect.width()), span(rect.height()));
        let place = |first: u32, i: usize| first as f32 + (i as f32 + 0.5 - before as f32) / PER_PIXEL as f32;
        self.x.clear();
        self.y.clear();
        for j in 0..h {
            self.x.extend((0..w).map(|i| place(rect.x0, i)));
            self.y.extend(std::iter::repeat_n(place(rect.y0, j), w));
        }
        self.aim(scene);
        self.look_up(scene);
        // Reading a pixel's last channel takes one number more.
        self.columns.iter_mut().for_each(|c| c.resize(3 * w + 1, 0.0));
        let li: &[f32] = bytemuck::cast_slice(&self.li);
        let rows = li.windows(taps.len() * 3 * w).step_by(PER_PIXEL * 3 * w);
        for (y, row) in (rect.y0..).zip(rows) {
            let [sums, halves] = self.columns.each_mut().map(Vec::as_mut_slice);
            simd::dispatch(FoldDown { taps, row, sums: &mut sums[..3 * w], halves: &mut halves[..3 * w] });
            for x in 0..rect.width() {
                self.pixels[self.rect.index(rect.x0 + x, y)] = fold(taps, [sums, halves], x as usize);
            }
        }
    }

    /// The rays of all points.
    fn aim(&mut self, scene: &Scene) {
        self.rays.resize(self.x.len());
        scene
            .camera
            .fill_rays(&FilmSamples { x: &self.x, y: &self.y, lens_u: &[], lens_v: &[] }, &mut self.rays);
    }

    /// The radiance of all points.
    fn look_up(&mut self, scene: &Scene) {
        let n = self.x.len();
        self.li.clear();
        self.li.resize(n, Rgb::BLACK);
        for (k, &light) in scene.lights.at_infinity.iter().enumerate() {
            let light = &scene.lights.list[light as usize];
            if k == 0 {
                light.le_escaped(self.rays.directions(), &mut self.li);
                continue;
            }
            self.more.resize(n, Rgb::BLACK);
            light.le_escaped(self.rays.directions(), &mut self.more);
            self.li.iter_mut().zip(&self.more).for_each(|(sum, &le)| *sum += le);
        }
    }
}

/// Whether the sky is without detail in what rows of `n` directions span: a cone about the mean of its corners.
fn is_smooth(scene: &Scene, w: Directions, n: usize) -> bool {
    let corners = [0, n - 1, w.len() - n, w.len() - 1].map(|i| w.get(i));
    let axis = corners.iter().sum::<Vec3>().normalize_or_zero();
    let chord = corners.iter().fold(0.0, |most: f32, c| most.max((*c - axis).length()));
    scene.lights.is_smooth(axis, 2.0 * (0.5 * chord).min(1.0).asin())
}

/// Weighted sums down columns of numbers, and halves of the differences of their halves.
struct FoldDown<'a> {
    taps: &'a [[f32; 2]],
    /// As many rows as taps.
    row: &'a [f32],
    sums: &'a mut [f32],
    halves: &'a mut [f32],
}

impl simd::Kernel for FoldDown<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        self.sums.fill(0.0);
        self.halves.fill(0.0);
        for (tap, row) in self.taps.iter().zip(self.row.chunks_exact(self.sums.len())) {
            for ((sum, half), value) in self.sums.iter_mut().zip(self.halves.iter_mut()).zip(row) {
                *sum += value * tap[0];
                *half += value * tap[1];
            }
        }
    }
}

/// Pixel `x` of what [`FoldDown`] gives, if its halves agree.
#[inline]
fn fold(taps: &[[f32; 2]], [sums, halves]: [&[f32]; 2], x: usize) -> Option<Rgb> {
    let [mut sum, mut columns, mut rows, mut fields] = [Vec4::ZERO; 4];
    for (i, tap) in (x * PER_PIXEL..).zip(taps) {
        let (s, h) = (Vec4::from_slice(&sums[3 * i..]), Vec4::from_slice(&halves[3 * i..]));
        sum += s * tap[0];
        columns += s * tap[1];
        rows += h * tap[0];
        fields += h * tap[1];
    }
    // Halves are the sum plus and minus these.
    let spread = rows.abs() + columns.abs() + fields.abs();
    let close = spread.truncate().max_element() <= TOLERANCE * sum.abs().truncate().max_element();
    close.then(|| Rgb::new(sum.x, sum.y, sum.z))
}

#[cfg(test)]
mod tests;
