//! Six square pictures around the origin.
//!
//! Faces follow the OpenGL convention (OpenGL 4.6 core profile, table 8.19): with t upwards, (s, t) times the
//! magnitude of the major axis is +X (-z, y), -X (z, y), +Y (x, -z), -Y (x, z), +Z (x, y), -Z (-x, y).

use super::texel::{self, CellSums, Spread};
use super::tiles::{self, CHUNK, Footprint, Footprints, Strides, Tiles};
use crate::base::directions::Directions;
use crate::base::image_data::{ImageData, Texels};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::skybox::{ChartDirections, ChartGrid, ChartLanes, ChartPoint, Skybox, integrate_cells};
use crate::color::Rgb;
use crate::math::simd;
use crate::memory;
use glam::{DVec3, Vec3};
use std::sync::Arc;

/// The axes of a face: a point is `major + s * across + t * up`, s and t in [-1, 1].
struct FaceAxes {
    major: DVec3,
    across: DVec3,
    up: DVec3,
}

const FACES: [FaceAxes; 6] = [
    FaceAxes { major: DVec3::X, across: DVec3::NEG_Z, up: DVec3::Y },
    FaceAxes { major: DVec3::NEG_X, across: DVec3::Z, up: DVec3::Y },
    FaceAxes { major: DVec3::Y, across: DVec3::X, up: DVec3::NEG_Z },
    FaceAxes { major: DVec3::NEG_Y, across: DVec3::X, up: DVec3::Z },
    FaceAxes { major: DVec3::Z, across: DVec3::X, up: DVec3::Y },
    FaceAxes { major: DVec3::NEG_Z, across: DVec3::NEG_X, up: DVec3::Y },
];

/// The finest table made for eight-bit faces, cells across a face.
const TABLE_8BIT: usize = 256;

/// Smaller faces are integrated by quadrature: only on larger ones is the error of taking the solid angle as constant
/// over a texel, of second order in its width, below a thousandth.
const SMALL: usize = 32;

/// The largest faces: their texels are numbered by 32 bits.
const LARGEST: usize = 26_000;

/// A cube map. Bilinear filtering runs on across edges; at the eight corners, where three texels meet and a fourth
/// is missing, their average stands in for it, which keeps the whole continuous.
pub struct Cube {
    /// Faces of `size + 2` texels a side: with a border of one texel, those of the neighbours.
    tiles: Tiles,
    size: usize,
    /// The finest table that its texels are worth.
    table: usize,
}

impl Cube {
    /// From square faces of one size and pixel format, in the order +X -X +Y -Y +Z -Z; errors say what differs.
    pub fn new(faces: &[ImageData; 6]) -> Result<Self, String> {
        let size = faces[0].width;
        for f in faces.iter() {
            if f.width != f.height {
                return Err(format!("cube faces must be square; one is {}x{}", f.width, f.height));
            }
            if f.width != size {
                return Err(format!(
                    "cube faces must be of one size; there are {size} and {} wide ones",
                    f.width
                ));
            }
            if std::mem::discriminant(&f.texels) != std::mem::discriminant(&faces[0].texels) {
                return Err("cube faces must be of one pixel format; some are 8-bit and some are not".into());
            }
        }
        if size == 0 || size > LARGEST {
            return Err(format!("cube faces must be 1 to {LARGEST} pixels wide, not {size}"));
        }
        Ok(Cube::of_alike(faces))
    }

    /// As [`Cube::new`], of faces known to be square and alike.
    pub(super) fn of_alike(faces: &[ImageData; 6]) -> Self {
        let n = faces[0].width;
        let source = |face: usize, x: usize, y: usize| {
            let inner = |i: usize| (1..=n).contains(&i);
            let (face, x, y) = match (inner(x), inner(y)) {
                (true, true) => (face, x - 1, y - 1),
                // Nothing is at the corners of the border; any texel will do.
                (false, false) => (face, 0, 0),
                _ => source_texel(n, face, x as i32 - 1, y as i32 - 1),
            };
            (face, y * n + x)
        };
        let tiles = Tiles::new(faces, 6, [n + 2, n + 2], source);
        Cube { tiles, size: n, table: texel::table_size(&faces[0].texels, n, TABLE_8BIT) }
    }

    /// The texel at the corner of a face's border: what its three neighbours have on average.
    fn corner(&self, face: usize, x: usize, y: usize) -> Rgb {
        let inner = |i: usize| i.clamp(1, self.size);
        let at = |x, y| self.tiles.texel(face, x, y);
        (at(inner(x), inner(y)) + at(x, inner(y)) + at(inner(x), y)) * (1.0 / 3.0)
    }

    /// The mix at one of the eight corners of the cube.
    #[cold]
    #[inline(never)]
    fn mix_at_corner(&self, d: Vec3) -> Rgb {
        let p = project(d);
        let half = 0.5 * self.size as f32;
        let [x, y] = [p.s, p.t].map(|c| c * half + (half + 0.5));
        let (ix, iy) = (x as usize, y as usize);
        let n = self.size;
        let at = |x: usize, y: usize| {
            if (x == 0 || x > n) && (y == 0 || y > n) {
                self.corner(p.face as usize, x, y)
            } else {
                self.tiles.texel(p.face as usize, x, y)
            }
        };
        let v = [at(ix, iy), at(ix + 1, iy), at(ix, iy + 1), at(ix + 1, iy + 1)];
        tiles::mix(v, x - ix as f32, y - iy as f32)
    }

    /// Luminance times solid angle of the texels of row `y`, with one more on every side.
    fn row(&self, face: usize, y: i64, out: &mut Vec<f32>) {
        let n = self.size;
        let row = (y + 1) as usize;
        self.tiles.luminances(face, row, 0..n + 2, out);
        if row == 0 || row == n + 1 {
            let end = out.len() - 1;
            out[end - n - 1] = self.corner(face, 0, row).luminance();
            out[end] = self.corner(face, n + 1, row).luminance();
        }
        let n = n as i64;
        let inv = 1.0 / self.size as f32;
        let at = |i: i64| (2 * i.clamp(0, n - 1) + 1 - n) as f32 * inv;
        let t = at(y);
        let a = 1.0 + t * t;
        let texel = 4.0 * inv * inv;
        for (x, l) in (-1..).zip(out.iter_mut()) {
            let s = at(x);
            let r = 1.0 / (a + s * s);
            *l *= texel * r * r.sqrt();
        }
    }
}

/// The texel of another face that stands where texel (x, y) of `face` would, one of which lies one beyond its edge.
fn source_texel(n: usize, face: usize, x: i32, y: i32) -> (usize, usize, usize) {
    let inside = |i: i32| (0..n as i32).contains(&i);
    if inside(x) && inside(y) {
        return (face, x as usize, y as usize);
    }
    // In units of half a texel, the centre of a texel beyond the edge lies at n + 1 on a minor axis and n on the major
    // one; folded over the edge, at n and n - 1.
    let f = &FACES[face];
    let n = n as i32;
    let (s, t) = (f64::from(2 * x + 1 - n), f64::from(n - 1 - 2 * y));
    let n = f64::from(n);
    let folded = |m: f64| m.clamp(-n, n);
    let p = f.major * (n - 1.0) + f.across * folded(s) + f.up * folded(t);
    let (face, s, t) = project64(p);
    let texel = |s: f64| ((s * n + n - 1.0) * 0.5).round().clamp(0.0, n - 1.0) as usize;
    (face, texel(s), texel(-t))
}

/// The point of a face at s and t, on the cube of edge 2.
pub(super) fn face_point(face: usize, s: f32, t: f32) -> Vec3 {
    let f = &FACES[face];
    f.major.as_vec3() + f.across.as_vec3() * s + f.up.as_vec3() * t
}

/// Where the plane of a face meets a direction, if it does.
pub(super) fn face_coordinates(face: usize, d: Vec3) -> Option<(f32, f32)> {
    let f = &FACES[face];
    let m = d.dot(f.major.as_vec3());
    (m > 1e-3).then(|| (d.dot(f.across.as_vec3()) / m, d.dot(f.up.as_vec3()) / m))
}

/// A point of a face.
#[derive(Clone, Copy)]
struct FacePoint {
    face: u32,
    /// To the right, in [-1, 1].
    s: f32,
    /// Downwards, in [-1, 1].
    t: f32,
}

/// The point of the cube towards a direction of any length. Without branches, so that many can be done at once.
#[inline(always)]
fn project(d: Vec3) -> FacePoint {
    let a = d.abs();
    let x_major = (a.x >= a.y) & (a.x >= a.z);
    let y_major = !x_major & (a.y >= a.z);
    let major = if x_major {
        d.x
    } else if y_major {
        d.y
    } else {
        d.z
    };
    let sign = 1f32.copysign(major);
    let s = if x_major { -d.z } else { d.x } * if y_major { 1.0 } else { sign };
    let t = if y_major { d.z * sign } else { -d.y };
    let axis = if x_major {
        0
    } else if y_major {
        2
    } else {
        4
    };
    let inv = 1.0 / major.abs();
    FacePoint { face: axis + (major.to_bits() >> 31), s: s * inv, t: t * inv }
}

/// Where lookups stand among the texels.
#[derive(Clone, Copy)]
struct Placing {
    strides: Strides,
    /// Half of the texels of a side.
    half: f32,
    /// Texels of a side.
    size: u32,
}

impl Placing {
    /// The footprint of a direction, and whether it has one of the eight corners in it.
    #[inline(always)]
    fn footprint(self, d: Vec3) -> (Footprint, bool) {
        let p = project(d);
        // Texel 0 is that of the border, whose centre lies half a texel before the face.
        let middle = self.half + 0.5;
        let (x, y) = (p.s * self.half + middle, p.t * self.half + middle);
        // Rounding leaves both in [0.5, size + 0.5]; the limit is for what is no direction.
        let (ix, iy) = ((x as i32).clamp(0, self.size as i32), (y as i32).clamp(0, self.size as i32));
        let f = [x - ix as f32, y - iy as f32];
        let at_end = |i: i32| (i == 0) | (i == self.size as i32);
        (self.strides.footprint(p.face, ix as u32, iy as u32, f), at_end(ix) & at_end(iy))
    }
}

/// See [`Skybox::direction_and_density`]. The axes of [`FACES`] by choices instead of loads, so that many can be done at
/// once.
#[inline(always)]
fn toward(c: ChartPoint) -> (DVec3, f64) {
    let (s, t) = (2.0 * c.u - 1.0, 1.0 - 2.0 * c.v);
    let r = 1.0 / (1.0 + s * s + t * t).sqrt();
    let sign = if c.chart & 1 == 0 { 1.0 } else { -1.0 };
    let (along_x, along_y) = (c.chart < 2, c.chart & 2 != 0);
    let x = if along_x { sign } else { s * if along_y { 1.0 } else { sign } };
    let y = if along_y { sign } else { t };
    let z = sign * if along_x { -s } else { 1.0 };
    let z = if along_y { -sign * t } else { z };
    (DVec3::new(x, y, z) * r, 4.0 * r * r * r)
}

/// Looks up a batch.
struct Lookups<'a> {
    cube: &'a Cube,
    d: Directions<'a>,
    out: &'a mut [Rgb],
}

impl simd::Kernel for Lookups<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let placing = self.cube.placing();
        let mut footprints = Footprints::NONE;
        let mut corners = [false; CHUNK];
        for ((_, d), out) in self.d.chunks(CHUNK).zip(self.out.chunks_mut(CHUNK)) {
            let mut any_corner = false;
            let n = d.len().min(CHUNK);
            let (xs, ys, zs) = (&d.x[..n], &d.y[..n], &d.z[..n]);
            for i in 0..n {
                let (f, corner) = placing.footprint(Vec3::new(xs[i], ys[i], zs[i]));
                footprints.set(i, f);
                corners[i] = corner;
                any_corner |= corner;
            }
            self.cube.tiles.mix_all(&footprints, out);
            if any_corner {
                for i in (0..n).filter(|&i| corners[i]) {
                    out[i] = self.cube.mix_at_corner(d.get(i));
                }
            }
        }
    }
}

/// [`project`] in double, for tables.
fn project64(d: DVec3) -> (usize, f64, f64) {
    let a = d.abs();
    let axis = if a.x >= a.y && a.x >= a.z {
        0
    } else if a.y >= a.z {
        1
    } else {
        2
    };
    let face = 2 * axis + usize::from(d[axis].is_sign_negative());
    let f = &FACES[face];
    let inv = 1.0 / a[axis];
    (face, d.dot(f.across) * inv, d.dot(f.up) * inv)
}

impl Cube {
    #[inline(always)]
    fn placing(&self) -> Placing {
        Placing { strides: self.tiles.strides(), half: 0.5 * self.size as f32, size: self.size as u32 }
    }
}

impl Skybox for Cube {
    #[inline]
    fn radiance(&self, d: Vec3) -> Rgb {
        let (f, corner) = self.placing().footprint(d);
        if corner { self.mix_at_corner(d) } else { self.tiles.mix(f) }
    }

    fn radiance_batch(&self, d: Directions, out: &mut [Rgb]) {
        simd::dispatch(Lookups { cube: self, d, out });
    }

    fn grid(&self) -> ChartGrid {
        let n = self.table as u32;
        ChartGrid { count: 6, width: n, height: n }
    }

    fn direction(&self, c: ChartPoint) -> DVec3 {
        let f = &FACES[c.chart as usize];
        (f.major + f.across * (2.0 * c.u - 1.0) + f.up * (1.0 - 2.0 * c.v)).normalize()
    }

    fn locate(&self, d: DVec3) -> ChartPoint {
        let (face, s, t) = project64(d);
        ChartPoint { chart: face as u32, u: 0.5 + 0.5 * s, v: 0.5 - 0.5 * t }
    }

    fn solid_angle_density(&self, c: ChartPoint) -> f64 {
        let (s, t) = (2.0 * c.u - 1.0, 2.0 * c.v - 1.0);
        let r = 1.0 / (1.0 + s * s + t * t);
        4.0 * r * r.sqrt()
    }

    #[inline]
    fn direction_and_density(&self, c: ChartPoint) -> (DVec3, f64) {
        toward(c)
    }

    fn directions_and_densities(&self, at: &ChartLanes, _n: usize) -> ChartDirections {
        at.directions(toward)
    }

    fn cell_integrals(&self, grid: ChartGrid) -> Vec<f64> {
        if self.size <= SMALL && grid == self.grid() {
            return integrate_cells(grid, |c| {
                let l = self.radiance(self.direction(c).as_vec3()).luminance();
                f64::from(l) * self.solid_angle_density(c)
            });
        }
        let across = Spread::even(self.size, grid.width as usize);
        let along = Spread::even(self.size, grid.height as usize);
        let sums = CellSums { grid, across: &across, along: &along };
        sums.integrate(|face, y, out| self.row(face as usize, y, out))
    }

    fn memory(&self) -> u64 {
        self.tiles.memory()
    }
}

/// A cube map in scene files.
pub const ROW: Row<dyn Skybox> = Row {
    kind: "cube",
    doc: "six faces: a folder, a cross or a strip",
    params: &[
        ParamSpec {
            name: "path",
            kind: ParamKind::CubeFaces,
            default: None,
            doc: "folder of six faces, or one picture that is a cross or a strip of them",
        },
        super::ENCODING,
    ],
    build: |p| {
        let faces = p.faces("path")?;
        let _room = memory::room(faces.iter().map(ImageData::memory).sum(), || "a cube map".into())?;
        let cube = Cube::new(&faces).map_err(|m| p.error("path", m))?;
        Ok(Arc::new(cube))
    },
    samples,
};

fn samples() -> Vec<Params> {
    let of = |size: usize, texel: &dyn Fn(usize, usize) -> [f32; 3]| {
        let faces = std::array::from_fn(|f| texel::picture(size, size, |i| texel(f, i)));
        Params::new().with("path", Value::faces(faces))
    };
    let byte = |f: usize| {
        let texels =
            (0..36 * 36).map(|i| [(i * 7 + f * 40) as u8, (i / 9) as u8, (f * 50) as u8, 255]).collect();
        ImageData { width: 36, height: 36, texels: Texels::Srgb8(texels) }
    };
    vec![
        of(1, &|f, _| [f as f32, 0.5, 0.2]),
        of(5, &|f, i| [0.1 + f as f32, i as f32, 0.2]),
        of(40, &|f, i| if (f, i) == (3, 777) { [1e6; 3] } else { [0.0; 3] }),
        Params::new().with("path", Value::faces(std::array::from_fn(byte))),
    ]
}

#[cfg(test)]
mod tests;
