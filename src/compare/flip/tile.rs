//! FLIP over one tile: what fits in a core's cache, for every exposure while it is there.

use super::Planes;
use super::colour::{Colours, amplified, decode, unit};
use super::convolve::{AlongColumns, AlongRows, DetectColumns, DetectRows, Source};
use super::kernels::Kernels;
use super::tone::ToneMapper;
use crate::compare::lanes::LANES;
use crate::math::simd::{Kernel, dispatch};

/// Tiles are this wide and high, if the picture is.
pub(super) const TILE: [usize; 2] = [128, 96];

/// How the values of the two pictures become light on a display.
#[derive(Debug, Clone, Copy)]
pub(super) enum Display<'a> {
    /// sRGB-encoded from 0 to 1.
    Encoded,
    /// Radiance, at each of these exposures in stops.
    Radiance(&'a [f32], ToneMapper),
}

/// Two pictures of one size and what they are compared by.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair<'a> {
    pub size: [usize; 2],
    /// Reference and test.
    pub pictures: [Planes<'a>; 2],
    pub display: Display<'a>,
    pub kernels: &'a Kernels,
    pub colours: &'a Colours,
}

/// What came out: rows of [`Scratch::width`].
#[derive(Debug, Default)]
pub(super) struct Found {
    /// The largest error over exposures.
    pub errors: Vec<f32>,
    /// The number of the exposure that it was found at.
    pub exposures: Vec<u16>,
}

/// Room for the work on one tile; a thread has one and uses it again.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    /// Columns of results: those of the tile, up to a multiple of [`LANES`].
    width: usize,
    height: usize,
    /// Columns and rows of what surrounds the tile.
    margin: usize,
    /// Of planes with margins.
    stride: usize,
    /// Of the files, and as YCxCz: of reference and test.
    stored: [[Vec<f32>; 3]; 2],
    ycxcz: [[Vec<f32>; 3]; 2],
    /// Filtered along rows.
    halfway: [Vec<f32>; 3],
    /// Filtered; then Hunt-adjusted CIELAB.
    seen: [[Vec<f32>; 3]; 2],
    /// Edges and points.
    features: [[Vec<f32>; 2]; 2],
    found: Found,
}

impl Scratch {
    /// Columns of results.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Works on the tile whose left top pixel is at `x`, `y`.
    pub fn run(&mut self, pair: &Pair, [x, y]: [usize; 2]) -> &Found {
        self.margin = pair.kernels.radius();
        self.width = TILE[0].min(pair.size[0] - x).next_multiple_of(LANES);
        self.height = TILE[1].min(pair.size[1] - y);
        self.stride = (self.width + 2 * self.margin).next_multiple_of(LANES);
        for (planes, picture) in self.stored.iter_mut().zip(pair.pictures) {
            let window = Window { at: [x, y], margin: self.margin, stride: self.stride };
            sized(planes, (self.height + 2 * self.margin) * self.stride);
            planes.iter_mut().zip(picture).for_each(|(to, from)| window.gather(pair.size, from, to));
        }
        let area = self.width * self.height;
        self.found.errors.clear();
        self.found.errors.resize(area, 0.0);
        self.found.exposures.clear();
        self.found.exposures.resize(area, 0);
        match pair.display {
            Display::Encoded => {
                self.convert(pair, Encoded);
                self.compare(pair, 0);
            }
            Display::Radiance(exposures, tone) => {
                for (i, exposure) in exposures.iter().enumerate() {
                    let factor = f64::from(*exposure).exp2() as f32;
                    self.convert(pair, Exposed { factor, tone });
                    self.compare(pair, i as u16);
                }
            }
        }
        &self.found
    }

    fn convert(&mut self, pair: &Pair, light: impl Light) {
        for (from, to) in self.stored.iter().zip(&mut self.ycxcz) {
            dispatch(Convert { light, colours: pair.colours, from, to: sized(to, from[0].len()) });
        }
    }

    /// Takes the error of what is displayed now into account.
    fn compare(&mut self, pair: &Pair, exposure: u16) {
        // Equal colours have no error: all is saturated, or nothing differs.
        if self.ycxcz[0] == self.ycxcz[1] {
            return;
        }
        for i in 0..2 {
            self.filter(pair.kernels, i);
            dispatch(See { colours: pair.colours, planes: &mut self.seen[i] });
        }
        dispatch(Combine {
            colours: pair.colours,
            seen: &self.seen,
            features: &self.features,
            exposure,
            found: &mut self.found,
        });
    }

    /// Filters reference (0) or test (1).
    fn filter(&mut self, kernels: &Kernels, i: usize) {
        let (width, height, stride) = (self.width, self.height, self.stride);
        let area = width * height;
        // A filter of radius r looks at r rows and columns around the tile.
        let source = |plane: &'_ [f32], r: usize| (self.margin - r) * stride..plane.len();
        let [y, cx, cz] = &self.ycxcz[i];
        for (c, plane) in [y, cx].into_iter().enumerate() {
            let half = &kernels.sensitivity[c];
            let r = half.len() - 1;
            let halfway = resized(&mut self.halfway[0], width * (height + 2 * r));
            let source = Source { data: &plane[source(plane, r)], stride };
            let (margin, halves) = (self.margin, [half]);
            dispatch(AlongRows { source, margin, width, halves, out: [&mut *halfway] });
            let out = resized(&mut self.seen[i][c], area);
            dispatch(AlongColumns { sources: [halfway], width, halves, out });
        }
        let halves = [&kernels.blue_yellow[0], &kernels.blue_yellow[1]];
        let r = halves[0].len() - 1;
        let [first, second, third] = &mut self.halfway;
        let rows = height + 2 * r;
        let [a, b] = [resized(first, width * rows), resized(second, width * rows)];
        let data = Source { data: &cz[source(cz, r)], stride };
        dispatch(AlongRows { source: data, margin: self.margin, width, halves, out: [&mut *a, &mut *b] });
        let out = resized(&mut self.seen[i][2], area);
        dispatch(AlongColumns { sources: [a, b], width, halves, out });

        let r = kernels.gauss.len() - 1;
        let rows = height + 2 * r;
        let out = [first, second, third].map(|p| resized(p, width * rows));
        let data = Source { data: &y[source(y, r)], stride };
        dispatch(DetectRows { source: data, margin: self.margin, width, filters: kernels, out });
        let sources = self.halfway.each_ref().map(|p| &p[..width * rows]);
        let [edges, points] = &mut self.features[i];
        let (edges, points) = (resized(edges, area), resized(points, area));
        dispatch(DetectColumns { sources, width, filters: kernels, edges, points });
    }
}

/// The first `len` values, which are there afterwards.
fn resized(v: &mut Vec<f32>, len: usize) -> &mut [f32] {
    v.resize(len, 0.0);
    v
}

fn sized(planes: &mut [Vec<f32>; 3], len: usize) -> &mut [Vec<f32>; 3] {
    for p in planes.iter_mut() {
        p.resize(len, 0.0);
    }
    planes
}

/// The part of a picture around a tile.
struct Window {
    at: [usize; 2],
    margin: usize,
    stride: usize,
}

impl Window {
    /// One of its planes; beyond the edges of the picture stand the pixels of the edge.
    fn gather(&self, [w, h]: [usize; 2], plane: &[f32], out: &mut [f32]) {
        let [left, top] = self.at;
        let first = left.saturating_sub(self.margin);
        // Columns beyond the left edge, and those that the picture has.
        let outside = self.margin - (left - first);
        let inside = (self.stride - outside).min(w - first);
        for (y, out) in out.chunks_exact_mut(self.stride).enumerate() {
            let y = (top + y).saturating_sub(self.margin).min(h - 1);
            let row = &plane[y * w..][..w];
            out[..outside].fill(row[0]);
            out[outside..outside + inside].copy_from_slice(&row[first..first + inside]);
            out[outside + inside..].fill(row[w - 1]);
        }
    }
}

/// How stored values become linear light in [0, 1].
trait Light: Copy {
    fn linear(self, stored: [f32; 3]) -> [f32; 3];
}

/// They are sRGB-encoded.
#[derive(Clone, Copy)]
struct Encoded;

impl Light for Encoded {
    #[inline(always)]
    fn linear(self, [r, g, b]: [f32; 3]) -> [f32; 3] {
        [decode(unit(r)), decode(unit(g)), decode(unit(b))]
    }
}

/// They are radiance, multiplied by an exposure.
#[derive(Clone, Copy)]
struct Exposed {
    factor: f32,
    tone: ToneMapper,
}

impl Light for Exposed {
    #[inline(always)]
    fn linear(self, [r, g, b]: [f32; 3]) -> [f32; 3] {
        self.tone.shown([r * self.factor, g * self.factor, b * self.factor])
    }
}

/// Stored values to YCxCz.
struct Convert<'a, L> {
    light: L,
    colours: &'a Colours,
    from: &'a [Vec<f32>; 3],
    to: &'a mut [Vec<f32>; 3],
}

impl<L: Light> Kernel for Convert<'_, L> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let n = self.from[0].len();
        let [r, g, b] = self.from.each_ref().map(|p| &p[..n]);
        let [y, cx, cz] = self.to.each_mut().map(|p| &mut p[..n]);
        let (light, colours) = (self.light, *self.colours);
        for i in 0..n {
            [y[i], cx[i], cz[i]] = colours.ycxcz(light.linear([r[i], g[i], b[i]]));
        }
    }
}

/// Filtered YCxCz to Hunt-adjusted CIELAB, in place.
struct See<'a> {
    colours: &'a Colours,
    planes: &'a mut [Vec<f32>; 3],
}

impl Kernel for See<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let n = self.planes[0].len();
        let [a, b, c] = self.planes.each_mut().map(|p| &mut p[..n]);
        let colours = *self.colours;
        for i in 0..n {
            [a[i], b[i], c[i]] = colours.seen([a[i], b[i], c[i]]);
        }
    }
}

/// The error of each pixel, by its colours and features: Andersson et al. 2020, sections 4.3 and 4.4.
struct Combine<'a> {
    colours: &'a Colours,
    seen: &'a [[Vec<f32>; 3]; 2],
    features: &'a [[Vec<f32>; 2]; 2],
    exposure: u16,
    found: &'a mut Found,
}

impl Kernel for Combine<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let n = self.found.errors.len();
        let [p, q] = self.seen.each_ref().map(|planes| planes.each_ref().map(|v| &v[..n]));
        let [s, t] = self.features.each_ref().map(|planes| planes.each_ref().map(|v| &v[..n]));
        let (errors, exposures) = (&mut self.found.errors[..n], &mut self.found.exposures[..n]);
        let colours = *self.colours;
        for i in 0..n {
            let colour = colours.error([p[0][i], p[1][i], p[2][i]], [q[0][i], q[1][i], q[2][i]]);
            let (edge, point) = ((s[0][i] - t[0][i]).abs(), (s[1][i] - t[1][i]).abs());
            let error = amplified(colour, if edge > point { edge } else { point });
            let more = error > errors[i];
            errors[i] = if more { error } else { errors[i] };
            exposures[i] = if more { self.exposure } else { exposures[i] };
        }
    }
}
