//! A smooth sky as tables: one division, one square root and four neighbours a lookup.

use crate::color::Rgb;
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

/// Radiances on a cube cut in two by the horizon, one half of it above and one below. Values stand on the edges of faces
/// too, those on the horizon twice, so that no lookup ever leaves its face and the horizon stays sharp.
pub(super) struct Dome([Vec<Vec4>; 2]);

impl Dome {
    /// Tabulates `f`, which is asked just above and just below the horizon for what is on it.
    pub fn new(f: impl Fn(Vec3) -> Rgb + Sync) -> Self {
        let half = |sign: f32| {
            let mut table = vec![Vec4::ZERO; TOP + STRIDE * STRIDE];
            table.par_chunks_mut(STRIDE).enumerate().for_each(|(row, values)| {
                for (i, value) in values.iter_mut().enumerate() {
                    let c = f(direction(row, i, sign));
                    *value = Vec4::new(c.r, c.g, c.b, 0.0);
                }
            });
            table
        };
        Dome([half(1.0), half(-1.0)])
    }

    /// The radiance towards `d`, not zero, of any length.
    #[inline(always)]
    pub fn radiance(&self, d: Vec3) -> Rgb {
        let a = d.abs();
        let middle = 0.5 * ACROSS as f32;
        let (base, s, v, rows);
        if a.y > a.x.max(a.z) {
            let inv = middle / a.y;
            (base, s, v, rows) = (TOP, d.x * inv, d.z * inv + middle, ACROSS);
        } else {
            let x_major = a.x >= a.z;
            let (major, other) = if x_major { (d.x, d.z) } else { (d.z, d.x) };
            let inv = 1.0 / major.abs();
            let face = 2 * usize::from(!x_major) + usize::from(major < 0.0);
            (base, s) = (face * SIDE_FACE, other * inv * middle);
            (v, rows) = ((a.y * inv).sqrt() * UP as f32, UP);
        }
        let u = s + middle;
        let (i, j) = ((u as usize).min(ACROSS - 1), (v as usize).min(rows - 1));
        let (fu, fv) = (u - i as f32, v - j as f32);
        let at = base + j * STRIDE + i;
        let table = &self.0[usize::from(d.y < 0.0)];
        let (p, q) = (&table[at..at + 2], &table[at + STRIDE..at + STRIDE + 2]);
        let (p, q) = (p[0] + (p[1] - p[0]) * fu, q[0] + (q[1] - q[0]) * fu);
        let l = p + (q - p) * fv;
        Rgb::new(l.x, l.y, l.z)
    }

    /// Bytes held.
    pub fn memory(&self) -> u64 {
        self.0.iter().map(|t| (t.len() * size_of::<Vec4>()) as u64).sum()
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
        let mut rng = TestRng::new(1);
        for _ in 0..20_000 {
            let d = rng.direction();
            // Second derivatives of at most 2, intervals of at most 1 / 24 (the last from the horizon up, where
            // the square root is longest): h^2 / 8 times that.
            assert!(gap(d) < 5e-4, "{} at {d}", gap(d));
        }
    }
}
