//! Six square pictures around the origin.
//!
//! Faces follow the OpenGL convention (OpenGL 4.6 core profile, table 8.19): with t upwards, (s, t) times the
//! magnitude of the major axis is +X (-z, y), -X (z, y), +Y (x, -z), -Y (x, z), +Z (x, y), -Z (-x, y).

use super::texel::{self, CellSums, Spread, Tap};
use crate::base::image_data::{ImageData, Texels};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::skybox::{ChartGrid, ChartPoint, Skybox, integrate_cells};
use crate::color::Rgb;
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

/// A cube map. Bilinear filtering runs on across edges; at the eight corners, where three texels meet and a fourth
/// is missing, their average stands in for it, which keeps the whole continuous.
pub struct Cube {
    faces: Arc<[ImageData; 6]>,
    size: usize,
}

impl Cube {
    /// From square faces of one size and pixel format, in the order +X -X +Y -Y +Z -Z; errors say what differs.
    pub fn new(faces: Arc<[ImageData; 6]>) -> Result<Self, String> {
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
        if size == 0 || size > 1 << 15 {
            return Err(format!("cube faces must be 1 to 32768 pixels wide, not {size}"));
        }
        Ok(Cube { faces, size })
    }

    /// As [`Cube::new`], of faces known to be square and alike.
    pub(super) fn of_floats(faces: Arc<[ImageData; 6]>) -> Self {
        let size = faces[0].width;
        Cube { faces, size }
    }

    /// Radiance of a texel that may lie one beyond the edges of its face.
    fn tap(&self, face: usize, x: i32, y: i32) -> Rgb {
        let n = self.size as i32;
        let inside = |i: i32| (0..n).contains(&i);
        match (inside(x), inside(y)) {
            (true, true) => self.faces[face].texel(x as usize, y as usize),
            (false, false) => {
                let (cx, cy) = (x.clamp(0, n - 1), y.clamp(0, n - 1));
                (self.tap(face, cx, cy) + self.tap(face, x, cy) + self.tap(face, cx, y)) * (1.0 / 3.0)
            }
            _ => {
                // In units of half a texel, the centre of a texel beyond the edge lies at n + 1 on a minor axis
                // and n on the major one; folded over the edge, at n and n - 1.
                let f = &FACES[face];
                let (s, t) = (f64::from(2 * x + 1 - n), f64::from(n - 1 - 2 * y));
                let n = f64::from(n);
                let folded = |m: f64| m.clamp(-n, n);
                let p = f.major * (n - 1.0) + f.across * folded(s) + f.up * folded(t);
                let (face, s, t) = project64(p);
                let texel = |s: f64| ((s * n + n - 1.0) * 0.5).round().clamp(0.0, n - 1.0) as usize;
                self.faces[face].texel(texel(s), texel(-t))
            }
        }
    }

    #[cold]
    #[inline(never)]
    fn across_edges(&self, face: usize, t: Tap) -> Rgb {
        let at = |dx, dy| self.tap(face, t.x + dx, t.y + dy);
        texel::mix([at(0, 0), at(1, 0), at(0, 1), at(1, 1)], t)
    }

    /// Luminance times solid angle of the texels of row `y`, with one more on every side.
    fn row(&self, face: usize, y: i64, out: &mut Vec<f32>) {
        let n = self.size as i64;
        let tap = |x: i64| self.tap(face, x as i32, y as i32).luminance();
        out.push(tap(-1));
        if (0..n).contains(&y) {
            let start = (y * n) as usize;
            texel::luminances(&self.faces[face].texels, start..start + n as usize, out);
        } else {
            out.extend((0..n).map(tap));
        }
        out.push(tap(n));
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

/// Face, s and t of a direction of any length.
#[inline(always)]
fn project(d: Vec3) -> (usize, f32, f32) {
    let a = d.abs();
    let x_major = a.x >= a.y && a.x >= a.z;
    let y_major = !x_major && a.y >= a.z;
    let major = if x_major {
        d.x
    } else if y_major {
        d.y
    } else {
        d.z
    };
    let sign = 1f32.copysign(major);
    let s = if x_major { -d.z } else { d.x } * if y_major { 1.0 } else { sign };
    let t = if y_major { -d.z * sign } else { d.y };
    let face = if x_major {
        0
    } else if y_major {
        2
    } else {
        4
    } + usize::from(sign < 0.0);
    let inv = 1.0 / major.abs();
    (face, s * inv, t * inv)
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

impl Skybox for Cube {
    #[inline]
    fn radiance(&self, d: Vec3) -> Rgb {
        let (face, s, t) = project(d);
        let half = 0.5 * self.size as f32;
        let tap = Tap::new(half + s * half, half - t * half);
        let last = self.size as u32 - 1;
        if (tap.x as u32) < last && (tap.y as u32) < last {
            texel::bilinear(&self.faces[face].texels, self.size, tap)
        } else {
            self.across_edges(face, tap)
        }
    }

    fn grid(&self) -> ChartGrid {
        let n = texel::table_size(&self.faces[0].texels, self.size, TABLE_8BIT) as u32;
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
        self.faces.iter().map(texel::bytes).sum()
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
        let cube = Cube::new(p.faces("path")?).map_err(|m| p.error("path", m))?;
        Ok(Arc::new(cube))
    },
    samples,
};

fn samples() -> Vec<Params> {
    let of = |size: usize, texel: &dyn Fn(usize, usize) -> [f32; 3]| {
        let faces = std::array::from_fn(|f| texel::picture(size, size, |i| texel(f, i)));
        Params::new().with("path", Value::Faces(Arc::new(faces)))
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
        Params::new().with("path", Value::Faces(Arc::new(std::array::from_fn(byte)))),
    ]
}

#[cfg(test)]
mod tests;
