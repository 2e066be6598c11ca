//! A smooth sky as tables: one division, one square root and four neighbours a lookup.

use crate::base::directions::Directions;
use crate::color::Rgb;
use crate::math::simd::{self, Kernel};
use glam::{Vec3, Vec4};
use rayon::prelude::*;

/// Intervals across a face: about a degree each.
const ACROSS: usize = 96;
/// Intervals from the horizon up a side face, by the square root of the height: skies change fastest there.
const UP: usize = 48;
/// Values in a row, in a side face, and before the top face.
const STRIDE: usize = ACROSS + 1;
const SIDE_FACE: usize = STRIDE * (UP + 1);
const TOP: usize = 4 * SIDE_FACE;
/// All of a half.
const HALF: usize = TOP + STRIDE * STRIDE;
/// Lookups that are placed at once.
const CHUNK: usize = 128;

/// Radiances on a cube cut in two by the horizon, one half of it above and one below. Values stand on the edges of faces
/// too, those on the horizon twice, so that no lookup ever leaves its face and the horizon stays sharp.
/// The upper half first.
pub(super) struct Dome(Vec<Vec4>);

impl Dome {
    /// Tabulates `f`, which is asked just above and just below the horizon for what is on it.
    pub fn new(f: impl Fn(Vec3) -> Rgb + Sync) -> Self {
        let mut table = vec![Vec4::ZERO; 2 * HALF];
        table.par_chunks_mut(STRIDE).enumerate().for_each(|(row, values)| {
            const ROWS: usize = HALF / STRIDE;
            let sign = if row < ROWS { 1.0 } else { -1.0 };
            for (i, value) in values.iter_mut().enumerate() {
                let c = f(direction(row % ROWS, i, sign));
                *value = Vec4::new(c.r, c.g, c.b, 0.0);
            }
        });
        Dome(table)
    }

    /// The radiance towards `d`, not zero, of any length.
    #[inline(always)]
    pub fn radiance(&self, d: Vec3) -> Rgb {
        self.mix(place(d.to_array()))
    }

    /// The same of many directions, bit for bit.
    pub fn radiance_batch(&self, d: Directions, out: &mut [Rgb]) {
        simd::dispatch(Lookups { dome: self, d, out });
    }

    #[inline(always)]
    fn mix(&self, (at, fu, fv): (u32, f32, f32)) -> Rgb {
        let at = at as usize;
        let (p, q) = (&self.0[at..at + 2], &self.0[at + STRIDE..at + STRIDE + 2]);
        let (p, q) = (p[0] + (p[1] - p[0]) * fu, q[0] + (q[1] - q[0]) * fu);
        let l = p + (q - p) * fv;
        Rgb::new(l.x, l.y, l.z)
    }

    /// Bytes held.
    pub fn memory(&self) -> u64 {
        size_of_val(&*self.0) as u64
    }
}

/// The first of the four values about a direction, and how far it is on to the others. Without a branch, of which no
/// processor could foretell where it goes.
#[inline(always)]
fn place([x, y, z]: [f32; 3]) -> (u32, f32, f32) {
    let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
    let x_major = ax >= az;
    let (major, other) = if x_major { (x, z) } else { (z, x) };
    let is_top = ay > major.abs();
    let inv = 1.0 / if is_top { ay } else { major.abs() };
    let middle = 0.5 * ACROSS as f32;
    let u = if is_top { x } else { other } * inv * middle + middle;
    let side = (ay * inv).sqrt() * UP as f32;
    let v = if is_top { z * inv * middle + middle } else { side };
    let side =
        if x_major { 0 } else { 2 * SIDE_FACE as i32 } + if major < 0.0 { SIDE_FACE as i32 } else { 0 };
    let (base, rows) = if is_top { (TOP as i32, ACROSS as i32) } else { (side, UP as i32) };
    // What is next to nothing may have an infinite inverse.
    let whole = |x: f32| if x > 0.0 { x as i32 } else { 0 };
    let (i, j) = (whole(u), whole(v));
    let i = if i < ACROSS as i32 { i } else { ACROSS as i32 - 1 };
    let j = if j < rows { j } else { rows - 1 };
    let half = if y < 0.0 { HALF as i32 } else { 0 };
    ((half + base + j * STRIDE as i32 + i) as u32, u - i as f32, v - j as f32)
}

struct Lookups<'a> {
    dome: &'a Dome,
    d: Directions<'a>,
    out: &'a mut [Rgb],
}

impl Kernel for Lookups<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let mut at = [0; CHUNK];
        let [mut fu, mut fv] = [[0.0; CHUNK]; 2];
        for ((_, d), out) in self.d.chunks(CHUNK).zip(self.out.chunks_mut(CHUNK)) {
            let n = d.len().min(CHUNK);
            let (x, y, z) = (&d.x[..n], &d.y[..n], &d.z[..n]);
            for k in 0..n {
                (at[k], fu[k], fv[k]) = place([x[k], y[k], z[k]]);
            }
            for (k, out) in out.iter_mut().take(n).enumerate() {
                *out = self.dome.mix((at[k], fu[k], fv[k]));
            }
        }
    }
}

/// The unit direction of value `i` of a row of the table.
fn direction(row: usize, i: usize, sign: f32) -> Vec3 {
    let at = |i: usize| 2.0 * i as f32 / ACROSS as f32 - 1.0;
    let (face, row) = (row / (UP + 1), row % (UP + 1) + (row / (UP + 1)).saturating_sub(4) * (UP + 1));
    // Never quite on the horizon, which belongs to both halves.
    let y = sign * (row as f32 / UP as f32).powi(2).max(1e-6);
    match face {
        0 => Vec3::new(1.0, y, at(i)),
        1 => Vec3::new(-1.0, y, at(i)),
        2 => Vec3::new(at(i), y, 1.0),
        3 => Vec3::new(at(i), y, -1.0),
        _ => Vec3::new(at(i), sign, at(row)),
    }
    .normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestRng;

    #[test]
    fn values_are_exact_and_the_rest_is_close() {
        let f = |d: Vec3| Rgb::new(2.0 + d.x * d.y, 2.0 + d.z, if d.y > 0.0 { 1.0 } else { 3.0 });
        let dome = Dome::new(f);
        let gap = |d: Vec3| (dome.radiance(d) - f(d)).map(f32::abs).max_component();
        for row in (0..4 * (UP + 1) + STRIDE).step_by(7) {
            for (i, sign) in [(0, 1.0), (ACROSS, -1.0), (31, 1.0), (ACROSS / 2, -1.0)] {
                let d = direction(row, i, sign);
                // Two roundings of a position of up to 96.
                assert!(gap(d) < 1e-4, "{row} {i}: {d}");
            }
        }
        for i in 0..8 {
            let corner = Vec3::from([0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 0.5 } else { -0.7 }));
            let d = dome.radiance(corner);
            // Of any length; two roundings of a position of up to 96.
            for length in [1e-20, 1e20] {
                let off = (dome.radiance(corner * length) - d).map(f32::abs).max_component();
                assert!(off < 1e-4, "{corner} * {length}: {off}");
            }
            // Where the inverse is infinite the place is none, but one of the table's.
            assert!((place((corner * 1e-39).to_array()).0 as usize) < dome.0.len() - STRIDE - 1);
        }
        let mut rng = TestRng::new(1);
        for _ in 0..20_000 {
            let d = rng.direction();
            // Second derivatives of at most 2, intervals of at most 1 / 24 (the last from the horizon up, where
            // the square root is longest): h^2 / 8 times that.
            assert!(gap(d) < 5e-4, "{} at {d}", gap(d));
        }
    }
}
