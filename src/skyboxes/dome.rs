//! A smooth sky as two tables, one above the horizon and one below: one division and four neighbours a lookup.

use crate::color::Rgb;
use glam::{Vec3, Vec4};
use rayon::prelude::*;

/// Intervals along a side of a table: half a degree each on average.
const SIDE: usize = 192;

/// Radiances on the octahedron's upper and lower half (Engelhardt and Dachsbacher, "Octahedron Environment Maps",
/// 2008), each turned by 45 degrees to fill a square, with values on its border: the horizon is the border of both and
/// stays sharp, and no lookup ever leaves its table.
pub(super) struct Dome([Vec<Vec4>; 2]);

impl Dome {
    /// Tabulates `f`, which is asked just above and just below the horizon for what is on it.
    pub fn new(f: impl Fn(Vec3) -> Rgb + Sync) -> Self {
        let half = |sign: f32| {
            let mut table = vec![Vec4::ZERO; (SIDE + 1) * (SIDE + 1)];
            table.par_chunks_mut(SIDE + 1).enumerate().for_each(|(j, row)| {
                for (i, value) in row.iter_mut().enumerate() {
                    let c = f(direction(i, j, sign));
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
        let scale = 0.5 * SIDE as f32 / (a.x + a.y + a.z);
        let middle = 0.5 * SIDE as f32;
        let u = ((d.x + d.z) * scale + middle).max(0.0);
        let v = ((d.x - d.z) * scale + middle).max(0.0);
        let (i, j) = ((u as usize).min(SIDE - 1), (v as usize).min(SIDE - 1));
        let (fu, fv) = (u - i as f32, v - j as f32);
        let table = &self.0[usize::from(d.y < 0.0)];
        let at = j * (SIDE + 1) + i;
        let (p, q) = (&table[at..at + 2], &table[at + SIDE + 1..at + SIDE + 3]);
        let (p, q) = (p[0] + (p[1] - p[0]) * fu, q[0] + (q[1] - q[0]) * fu);
        let l = p + (q - p) * fv;
        Rgb::new(l.x, l.y, l.z)
    }

    /// Bytes held.
    pub fn memory(&self) -> u64 {
        self.0.iter().map(|t| (t.len() * size_of::<Vec4>()) as u64).sum()
    }
}

/// The unit direction of a node.
fn direction(i: usize, j: usize, sign: f32) -> Vec3 {
    let at = |i: usize| 2.0 * i as f32 / SIDE as f32 - 1.0;
    let (x, z) = (0.5 * (at(i) + at(j)), 0.5 * (at(i) - at(j)));
    // Never quite on the horizon, which belongs to both halves.
    let y = (1.0 - x.abs() - z.abs()).max(1e-6);
    Vec3::new(x, sign * y, z).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestRng;

    #[test]
    fn nodes_are_exact_and_the_rest_is_close() {
        let f = |d: Vec3| Rgb::new(2.0 + d.x * d.y, 2.0 + d.z, if d.y > 0.0 { 1.0 } else { 3.0 });
        let dome = Dome::new(f);
        let gap = |d: Vec3| (dome.radiance(d) - f(d)).map(f32::abs).max_component();
        for (i, j) in [(0, 0), (SIDE, 0), (SIDE / 2, SIDE / 2), (17, 100), (SIDE, SIDE), (3, SIDE)] {
            for sign in [1.0, -1.0] {
                // Two roundings of a position of up to 192.
                assert!(gap(direction(i, j, sign)) < 1e-4);
            }
        }
        let mut rng = TestRng::new(1);
        for _ in 0..10_000 {
            // Second derivatives of about 1, intervals of at most 2 / 192 radians.
            assert!(gap(rng.direction()) < 1e-3);
        }
    }
}
