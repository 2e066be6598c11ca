//! Which pixels any geometry projects into. The others show nothing but what is behind everything, and need no ray.
//!
//! Boxes of groups, of runs of primitives and of primitives are projected, from the coarse to the fine: what lies behind
//! the camera, or where all pixels are marked already, is done with; a box that covers few pixels marks them all;
//! triangles mark the pixels of their own outline, row by row. So a pixel may be marked in vain, but a pixel that is not
//! marked sees nothing: all is done in double precision with a margin for the rounding of rays and kernels.

use crate::base::camera::Projection;
use crate::base::geometry::{Geometry, Group, Leaf};
use crate::base::pixel_rect::PixelRect;
use crate::base::shape::Shape;
use crate::math::aabb::{Aabb, DAabb};
use crate::memory;
use crate::sampling::filter::PixelFilter;
use crate::scene::Scene;
use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;
use std::collections::HashMap;

/// Rays in single precision miss their place on the film by 1e-4 pixels at most.
const MARGIN: f64 = 0.02;
/// A kernel that works in f32 may take a surface for this part of the scene's coordinates off its place (four roundings
/// of a placement and a difference, doubled).
const ROUNDING: f64 = 1e-6;
/// A primitive's depths are taken to be at least this part of the largest, where the margin for rounding is worked out:
/// what is nearer, of a floor that runs below the camera, lies far beside the picture.
const NEAREST: f64 = 1e-3;
/// A box over no more pixels than this marks them all.
const SMALL: usize = 9;
/// Primitives under a lowest box, and boxes under each above.
const FAN: usize = 8;
/// Nanoseconds, roughly, of projecting a primitive, and of a sample that is saved: what is worth the trouble.
const COSTS: [u64; 2] = [100, 45];
/// Fewer samples of a pixel cost no more than the lookups that take their place.
pub const LEAST_SPP: u32 = 16;
/// Boxes at least among which threads share the work of a shape, and in how many parts.
const SHARED: usize = 32;
/// See [`SHARED`].
const PARTS: usize = 8;

/// Marks by pixel.
pub struct Coverage {
    rect: PixelRect,
    covered: Vec<bool>,
}

/// Boxes over runs of a shape's primitives, level by level: each of [`FAN`] of the one before.
struct Runs {
    levels: Vec<Vec<Aabb>>,
}

impl Runs {
    fn new(shape: &dyn Shape) -> Self {
        let n = shape.primitive_count() as usize;
        let union = |boxes: &[Aabb]| boxes.iter().fold(Aabb::EMPTY, |a, b| a.union(*b));
        let lowest = |run: usize| {
            let of_run = run * FAN..((run + 1) * FAN).min(n);
            let Some(mesh) = shape.triangles() else {
                return of_run.fold(Aabb::EMPTY, |all, p| all.union(shape.primitive_bounds(p as u32)));
            };
            let mut all = Aabb::EMPTY;
            for i in mesh.indices[of_run].iter().flatten() {
                all.extend(Vec3::from(mesh.positions()[*i as usize]));
            }
            all
        };
        let lowest = (0..n.div_ceil(FAN)).into_par_iter().with_min_len(512).map(lowest);
        let mut levels: Vec<Vec<Aabb>> = vec![lowest.collect()];
        while let Some(last) = levels.last().filter(|l| l.len() > 1) {
            let next = last.chunks(FAN).map(union).collect();
            levels.push(next);
        }
        Runs { levels }
    }

    /// The coarsest level that threads can share; that of the single box on top if there is none.
    fn shared(&self) -> usize {
        self.levels.iter().rposition(|l| l.len() >= SHARED).unwrap_or(self.levels.len().saturating_sub(1))
    }
}

/// Where a box lies on the film.
enum Place {
    /// Behind the camera, or beside the picture.
    Outside,
    /// On both sides of the camera's plane: anywhere.
    Anywhere,
    /// Within these pixels.
    Within(PixelRect),
}

struct Marker<'a> {
    geometry: &'a Geometry,
    projection: Projection,
    /// How far a pixel's samples reach from its middle.
    reach: f64,
    /// By how much kernels may misplace surfaces, in pixels at depth 1.
    slack: f64,
    coverage: Coverage,
    /// By address: a shape may be placed many times.
    runs: HashMap<usize, Runs>,
}

impl Coverage {
    /// Of the pixels `rect` of a scene's film; None where the camera does not project by lines through one point, where
    /// every pixel is covered, where so few samples of a pixel would be saved that rays are cheaper, or where memory is
    /// short.
    pub fn of(scene: &Scene, rect: PixelRect, filter: PixelFilter, spp: u32) -> Option<Self> {
        let projection = scene.camera.projection()?;
        let primitives = scene.report.triangles + scene.report.procedurals;
        let samples = rect.area() as u64 * u64::from(spp);
        if spp < LEAST_SPP || primitives.saturating_mul(COSTS[0]) > samples.saturating_mul(COSTS[1]) {
            return None;
        }
        // Boxes over runs of primitives, and a mark a pixel for each part.
        let runs = size_of::<Aabb>() as u64 * primitives.div_ceil(FAN as u64 - 1);
        if !memory::fits(runs + (PARTS as u64 + 1) * rect.area() as u64) {
            return None;
        }
        let reach = f64::from(filter.radius()) + MARGIN;
        let coverage = Coverage { rect, covered: vec![false; rect.area()] };
        let geometry = &scene.geometry;
        let bounds = geometry.root().bounds;
        let scale = f64::from(bounds.min.abs().max(bounds.max.abs()).max_element());
        let pixel = projection.steps[0].length().min(projection.steps[1].length());
        let slack = ROUNDING * (scale + projection.eye.length()) / pixel;
        let mut marker = Marker { geometry, projection, reach, slack, coverage, runs: HashMap::new() };
        marker.group(geometry.root(), None);
        let coverage = marker.coverage;
        (!coverage.covered.iter().all(|c| *c)).then_some(coverage)
    }

    /// Whether anything may be seen in a pixel.
    #[inline]
    pub fn is_covered(&self, x: u32, y: u32) -> bool {
        self.covered[self.rect.index(x, y)]
    }

    /// Pixels that see nothing.
    pub fn free(&self) -> usize {
        self.covered.iter().filter(|c| !**c).count()
    }

    fn mark(&mut self, rect: &PixelRect) {
        for y in rect.y0..rect.y1 {
            let first = self.rect.index(rect.x0, y);
            self.covered[first..first + rect.width() as usize].fill(true);
        }
    }

    fn is_marked(&self, rect: &PixelRect) -> bool {
        (rect.y0..rect.y1).all(|y| {
            let first = self.rect.index(rect.x0, y);
            self.covered[first..first + rect.width() as usize].iter().all(|c| *c)
        })
    }
}

impl Marker<'_> {
    fn group(&mut self, group: &Group, placement: Option<DAffine3>) {
        if group.paths == 0 || self.is_done(&DAabb::from(group.bounds), placement) {
            return;
        }
        for leaf in &group.leaves {
            self.leaf(leaf, placement);
        }
        for child in &group.children {
            let below = placement.map_or(child.to_parent, |p| p * child.to_parent);
            self.group(&self.geometry.groups[child.group], Some(below));
        }
    }

    fn leaf(&mut self, leaf: &Leaf, placement: Option<DAffine3>) {
        let shape = leaf.shape.as_ref();
        if self.is_done(&DAabb::from(shape.bounds()), placement) {
            return;
        }
        let key = std::ptr::from_ref(shape).cast::<()>().addr();
        let runs = self.runs.remove(&key).unwrap_or_else(|| Runs::new(shape));
        let level = runs.shared();
        let boxes = runs.levels.get(level).map_or(0, Vec::len);
        if boxes < SHARED {
            (0..boxes).for_each(|i| self.run(shape, &runs, (level, i), placement));
        } else {
            // Parts mark pixels of their own. What they do twice, as they do not see each other's marks, marks nothing new
            // but by rounding: so they are the same for any number of threads.
            let part = |part: usize| {
                let mut marker = self.fork();
                let of_part = edge(part, boxes)..edge(part + 1, boxes);
                of_part.for_each(|i| marker.run(shape, &runs, (level, i), placement));
                marker.coverage.covered
            };
            for theirs in (0..PARTS).into_par_iter().map(part).collect::<Vec<_>>() {
                self.coverage.covered.iter_mut().zip(theirs).for_each(|(mine, theirs)| *mine |= theirs);
            }
        }
        self.runs.insert(key, runs);
    }

    /// One that knows what is marked so far.
    fn fork(&self) -> Self {
        let Coverage { rect, covered } = &self.coverage;
        let coverage = Coverage { rect: *rect, covered: covered.clone() };
        Marker { projection: self.projection, coverage, runs: HashMap::new(), ..*self }
    }

    /// Box `i` of a level and what is below it.
    fn run(
        &mut self,
        shape: &dyn Shape,
        runs: &Runs,
        (level, i): (usize, usize),
        placement: Option<DAffine3>,
    ) {
        if self.is_done(&DAabb::from(runs.levels[level][i]), placement) {
            return;
        }
        let below = |n: usize| i * FAN..((i + 1) * FAN).min(n);
        match level.checked_sub(1) {
            Some(l) => {
                below(runs.levels[l].len()).for_each(|k| self.run(shape, runs, (l, k), placement));
            }
            None => {
                below(shape.primitive_count() as usize)
                    .for_each(|p| self.primitive(shape, p as u32, placement));
            }
        }
    }

    fn primitive(&mut self, shape: &dyn Shape, prim: u32, placement: Option<DAffine3>) {
        if let Some(mesh) = shape.triangles() {
            let corner = |i: u32| {
                let p = DVec3::from(mesh.positions()[i as usize].map(f64::from));
                placement.map_or(p, |m| m.transform_point3(p))
            };
            let corners = mesh.indices[prim as usize].map(corner);
            return self.triangle(corners);
        }
        match self.place(&DAabb::from(shape.primitive_bounds(prim)), placement) {
            Place::Outside => {}
            Place::Anywhere => self.coverage.covered.fill(true),
            Place::Within(rect) => self.coverage.mark(&rect),
        }
    }

    /// Whether there is nothing more to say about a box; marks the pixels of a small one.
    fn is_done(&mut self, bounds: &DAabb, placement: Option<DAffine3>) -> bool {
        match self.place(bounds, placement) {
            Place::Outside => true,
            Place::Anywhere => false,
            Place::Within(rect) if rect.area() <= SMALL => {
                self.coverage.mark(&rect);
                true
            }
            Place::Within(rect) => self.coverage.is_marked(&rect),
        }
    }

    fn place(&self, bounds: &DAabb, placement: Option<DAffine3>) -> Place {
        let pick = |bit: usize, a: f64, b: f64| if bit == 0 { a } else { b };
        let corners: [DVec3; 8] = std::array::from_fn(|k| {
            let (lo, hi) = (bounds.min, bounds.max);
            let p = DVec3::new(pick(k & 1, lo.x, hi.x), pick(k & 2, lo.y, hi.y), pick(k & 4, lo.z, hi.z));
            placement.map_or(p, |m| m.transform_point3(p))
        });
        let depths = corners.map(|p| self.projection.depth(p));
        let far = depths.iter().fold(0.0, |a: f64, d| a.max(d.abs()));
        // What is nearer to the camera's plane than rounding tells may be on either side of it.
        let near = 1e-9 * far;
        if depths.iter().all(|d| *d <= -near) {
            return Place::Outside;
        }
        if !depths.iter().all(|d| *d > near) {
            return Place::Anywhere;
        }
        let points = corners.map(|p| self.projection.film(p));
        let span = |axis: usize| {
            points
                .iter()
                .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], p| [a.min(p[axis]), b.max(p[axis])])
        };
        let (rect, reach) = (self.coverage.rect, self.reach(&depths));
        let (x, y) = (pixels(span(0), reach, [rect.x0, rect.x1]), pixels(span(1), reach, [rect.y0, rect.y1]));
        match (x, y) {
            (Some([x0, x1]), Some([y0, y1])) => Place::Within(PixelRect::new(x0, y0, x1, y1)),
            _ => Place::Outside,
        }
    }

    /// How far a pixel's samples reach towards what has these depths, as kernels see it.
    fn reach(&self, depths: &[f64]) -> f64 {
        let (near, far) =
            depths.iter().fold((f64::INFINITY, 0.0), |(a, b): (f64, f64), d| (a.min(*d), b.max(*d)));
        self.reach + self.slack / near.max(NEAREST * far)
    }

    /// Marks what a triangle's outline, cut at the camera's plane, covers of each row.
    fn triangle(&mut self, corners: [DVec3; 3]) {
        let depths = corners.map(|p| self.projection.depth(p));
        let near = 1e-9 * depths.iter().fold(0.0, |a: f64, d| a.max(d.abs()));
        // At most four corners are left of three.
        let mut outline = [[0.0; 2]; 4];
        let mut n = 0;
        for i in 0..3 {
            let (j, d) = ((i + 1) % 3, depths[i]);
            if d > near {
                outline[n] = self.projection.film(corners[i]);
                n += 1;
            }
            if (d > near) != (depths[j] > near) {
                let t = (near - d) / (depths[j] - d);
                let mut p = corners[i].lerp(corners[j], t);
                // On the plane to rounding: put a hair before it, so that it projects to the right side.
                p += self.projection.forward * (2.0 * near - self.projection.depth(p));
                outline[n] = self.projection.film(p);
                n += 1;
            }
        }
        let outline = &outline[..n];
        let extent =
            outline.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], p| [a.min(p[1]), b.max(p[1])]);
        let (rect, reach) = (self.coverage.rect, self.reach(&depths));
        let Some([y0, y1]) = pixels(extent, reach, [rect.y0, rect.y1]).filter(|_| n > 0) else { return };
        for y in y0..y1 {
            let middle = f64::from(y) + 0.5;
            let Some(span) = span_in_band(outline, [middle - reach, middle + reach]) else { continue };
            if let Some([x0, x1]) = pixels(span, reach, [rect.x0, rect.x1]) {
                self.coverage.mark(&PixelRect::new(x0, y, x1, y + 1));
            }
        }
    }
}

/// The first of `n` boxes that belongs to a part.
fn edge(part: usize, n: usize) -> usize {
    part * n / PARTS
}

/// The pixels of a range whose samples, reaching so far from their middles, meet an interval; None if there are none.
fn pixels([low, high]: [f64; 2], reach: f64, [first, end]: [u32; 2]) -> Option<[u32; 2]> {
    let from = (low - 0.5 - reach).ceil().max(f64::from(first));
    let to = ((high - 0.5 + reach).floor() + 1.0).min(f64::from(end));
    (from < to).then_some([from as u32, to as u32])
}

/// Least and largest x of a convex outline within a band of y.
fn span_in_band(outline: &[[f64; 2]], [low, high]: [f64; 2]) -> Option<[f64; 2]> {
    let mut span = [f64::INFINITY, f64::NEG_INFINITY];
    let mut add = |x: f64| span = [span[0].min(x), span[1].max(x)];
    for (i, a) in outline.iter().enumerate() {
        let b = &outline[(i + 1) % outline.len()];
        if a[1] >= low && a[1] <= high {
            add(a[0]);
        }
        for edge in [low, high] {
            if (a[1] < edge) != (b[1] < edge) {
                add(a[0] + (edge - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
            }
        }
    }
    (span[0] <= span[1]).then_some(span)
}

#[cfg(test)]
mod tests;
