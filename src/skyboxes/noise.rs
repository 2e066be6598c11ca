//! Noise on a lattice, eight points at a time, so that the compiler makes vectors of it.

use crate::sampler::hash::mix32;

/// Points worked on together.
pub(super) const WIDE: usize = 8;
/// One number a point.
pub(super) type Wide = [f32; WIDE];

/// Points of space.
#[derive(Debug, Clone, Copy)]
pub(super) struct Points {
    /// By axis.
    pub xyz: [Wide; 3],
}

impl Points {
    /// `self * scale + offset`.
    #[inline(always)]
    pub fn scaled(&self, scale: f32, offset: [f32; 3]) -> Self {
        let axis = |a: usize| std::array::from_fn(|i| self.xyz[a][i] * scale + offset[a]);
        Points { xyz: [axis(0), axis(1), axis(2)] }
    }

    /// Moved by three numbers a point.
    #[inline(always)]
    pub fn moved(&self, by: &[Wide; 3], scale: f32) -> Self {
        let axis = |a: usize| std::array::from_fn(|i| self.xyz[a][i] + by[a][i] * scale);
        Points { xyz: [axis(0), axis(1), axis(2)] }
    }
}

/// The scalar product of a random vector of [-1, 1]^3 that belongs to a lattice point with the way from there.
#[inline(always)]
fn slope(corner: u32, x: f32, y: f32, z: f32) -> f32 {
    let h = mix32(corner);
    let part = |shift: u32| ((h >> shift) & 1023) as i32 as f32 * (2.0 / 1023.0) - 1.0;
    part(0) * x + part(10) * y + part(20) * z
}

/// Gradient noise (Perlin, "Improving Noise", SIGGRAPH 2002, with random gradients): smooth, zero at lattice points, mostly
/// in [-0.7, 0.7]; |coordinates| < 2^20.
#[inline(always)]
fn noise1(seed: u32, x: f32, y: f32, z: f32) -> f32 {
    // Adding this rounds to the nearest whole number, which the low bits then hold.
    const ROUND: f32 = 12_582_912.0;
    let floor = |v: f32| v - 0.5 + ROUND;
    let (rx, ry, rz) = (floor(x), floor(y), floor(z));
    let (fx, fy, fz) = (x - (rx - ROUND), y - (ry - ROUND), z - (rz - ROUND));
    const A: u32 = 0x9e37_79b1;
    const B: u32 = 0x85eb_ca77;
    const C: u32 = 0xc2b2_ae3d;
    let base = seed
        .wrapping_add(rx.to_bits().wrapping_mul(A))
        .wrapping_add(ry.to_bits().wrapping_mul(B))
        .wrapping_add(rz.to_bits().wrapping_mul(C));
    let fade = |t: f32| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let (wx, wy, wz) = (fade(fx), fade(fy), fade(fz));
    let edge = |corner: u32, y: f32, z: f32| {
        let (a, b) = (slope(corner, fx, y, z), slope(corner.wrapping_add(A), fx - 1.0, y, z));
        a + (b - a) * wx
    };
    let face = |corner: u32, z: f32| {
        let (a, b) = (edge(corner, fy, z), edge(corner.wrapping_add(B), fy - 1.0, z));
        a + (b - a) * wy
    };
    let (a, b) = (face(base, fz), face(base.wrapping_add(C), fz - 1.0));
    a + (b - a) * wz
}

/// Sum of `octaves` of noise, each of half the size and half the height of the one before; mostly in [-1, 1].
#[inline(always)]
pub(super) fn fractal(seed: u32, p: &Points, octaves: u32) -> Wide {
    octave_sum(seed, p, octaves, |n| n)
}

/// As [`fractal`], of 1 - |noise| sharpened: ridges, in about [0, 1].
#[inline(always)]
pub(super) fn ridges(seed: u32, p: &Points, octaves: u32) -> Wide {
    let sum = octave_sum(seed, p, octaves, |n| {
        let r = 1.0 - (2.0 * n).abs().min(1.0);
        r * r
    });
    sum.map(|v| 0.5 * v)
}

#[inline(always)]
fn octave_sum(seed: u32, p: &Points, octaves: u32, shape: impl Fn(f32) -> f32) -> Wide {
    let mut sum = [0.0; WIDE];
    let (mut frequency, mut height) = (1.0, 1.0);
    for octave in 0..octaves {
        // Octaves are moved apart, or all of them would be zero at the origin.
        let at = 17.3 * octave as f32;
        let seed = mix32(seed.wrapping_add(octave));
        for (i, sum) in sum.iter_mut().enumerate() {
            let [x, y, z] = [p.xyz[0][i], p.xyz[1][i], p.xyz[2][i]];
            *sum += height * shape(noise1(seed, x * frequency + at, y * frequency - at, z * frequency + at));
        }
        frequency *= 2.03;
        height *= 0.5;
    }
    sum
}

/// 0 below `lo`, 1 above `hi`, smooth between.
#[inline(always)]
pub(super) fn smoothstep(lo: f32, hi: f32, v: f32) -> f32 {
    let t = ((v - lo) / (hi - lo)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestRng;

    #[test]
    fn continuous_bounded_and_of_mean_zero() {
        let mut rng = TestRng::new(1);
        let (mut sum, mut sum2) = (0.0, 0.0);
        let n = 20_000;
        for _ in 0..n {
            let p = rng.cube() * 50.0;
            let [x, y, z] = p.to_array().map(|v| v as f32);
            let v = noise1(5, x, y, z);
            assert!(v.abs() < 1.5);
            // Slopes of at most sqrt(3) at the corners and 15/8 of a difference of up to 3 between: below 8.
            assert!((v - noise1(5, x + 1e-3, y, z)).abs() < 1e-2);
            sum += f64::from(v);
            sum2 += f64::from(v * v);
        }
        let sigma = (sum2 / f64::from(n)).sqrt();
        assert!((0.15..0.5).contains(&sigma), "{sigma}");
        // Neighbouring points correlate a little: ten standard errors.
        assert!((sum / f64::from(n)).abs() < 10.0 * sigma / f64::from(n).sqrt());
    }

    #[test]
    fn zero_at_lattice_points_and_different_by_seed() {
        assert_eq!(noise1(1, 3.0, -4.0, 7.0), 0.0);
        assert_ne!(noise1(1, 3.3, -4.4, 7.1), noise1(2, 3.3, -4.4, 7.1));
    }
}
