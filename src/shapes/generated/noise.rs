//! Gradient noise and the fractals made of it, each with its derivative, so that normals need no differences.

use crate::sampler::hash::mix32;
use glam::{DMat3, DVec3};

/// A function's value and gradient at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jet {
    /// Value.
    pub value: f64,
    /// Gradient.
    pub gradient: DVec3,
}

impl Jet {
    /// The same everywhere.
    pub const fn constant(value: f64) -> Self {
        Jet { value, gradient: DVec3::ZERO }
    }

    /// f(self), given f and f' there.
    #[inline]
    pub fn map(self, f: f64, df: f64) -> Self {
        Jet { value: f, gradient: self.gradient * df }
    }

    /// Scaled.
    #[inline]
    pub fn scaled(self, s: f64) -> Self {
        self.map(self.value * s, s)
    }

    /// Sum.
    #[inline]
    pub fn plus(self, o: Jet) -> Self {
        Jet { value: self.value + o.value, gradient: self.gradient + o.gradient }
    }

    /// Product.
    #[inline]
    pub fn times(self, o: Jet) -> Self {
        Jet { value: self.value * o.value, gradient: self.gradient * o.value + o.gradient * self.value }
    }

    /// Kept between 0 and 1.
    pub fn clamped(self) -> Self {
        if (0.0..=1.0).contains(&self.value) { self } else { Jet::constant(self.value.clamp(0.0, 1.0)) }
    }

    /// 0 below `low`, 1 above `high`, smooth between them.
    pub fn step(self, low: f64, high: f64) -> Self {
        let t = self.plus(Jet::constant(-low)).scaled(1.0 / (high - low)).clamped();
        t.map(t.value * t.value * (3.0 - 2.0 * t.value), 6.0 * t.value * (1.0 - t.value))
    }
}

/// Smooth noise over space: zero at the points of the unit lattice, where random slopes are given, and about
/// -0.7 to 0.7 between them (Perlin, "Improving Noise", 2002, with slopes from a hash and the fifth-order blend; its
/// derivative by the product rule).
#[derive(Debug, Clone, Copy)]
pub struct Noise {
    /// Any number gives other slopes.
    pub seed: u32,
}

impl Noise {
    /// The slope at a lattice point, with components in [-1, 1).
    #[inline]
    fn slope(&self, x: i32, y: i32, z: i32) -> DVec3 {
        let h = (x as u32).wrapping_mul(0x8da6_b343)
            ^ (y as u32).wrapping_mul(0xd816_3841)
            ^ (z as u32).wrapping_mul(0xcb1a_b31f);
        let h = mix32(h ^ self.seed);
        let part = |shift: u32| f64::from(h >> shift & 0x3ff) * (1.0 / 512.0) - 1.0;
        DVec3::new(part(0), part(10), part(20))
    }

    /// Value and gradient. Coordinates up to 1e9.
    #[inline]
    pub fn at(&self, p: DVec3) -> Jet {
        let cell = p.floor();
        let f = p - cell;
        let (x, y, z) = (cell.x as i32, cell.y as i32, cell.z as i32);
        let blend = f * f * f * (f * (f * 6.0 - DVec3::splat(15.0)) + DVec3::splat(10.0));
        let slope_of_blend = f * f * (f * (f - DVec3::splat(2.0)) + DVec3::ONE) * 30.0;
        // One corner: value of the linear function there, and its slope.
        let corner = |i: i32, j: i32, k: i32| {
            let g = self.slope(x.wrapping_add(i), y.wrapping_add(j), z.wrapping_add(k));
            Jet { value: g.dot(f - DVec3::new(i.into(), j.into(), k.into())), gradient: g }
        };
        // Two jets blended along an axis; the blend itself changes along it, too.
        let mix = |a: Jet, b: Jet, t: f64, along: DVec3| {
            let d = b.value - a.value;
            Jet { value: a.value + d * t, gradient: a.gradient + (b.gradient - a.gradient) * t + along * d }
        };
        let dx = DVec3::new(slope_of_blend.x, 0.0, 0.0);
        let dy = DVec3::new(0.0, slope_of_blend.y, 0.0);
        let dz = DVec3::new(0.0, 0.0, slope_of_blend.z);
        let line = |j: i32, k: i32| mix(corner(0, j, k), corner(1, j, k), blend.x, dx);
        let near = mix(line(0, 0), line(1, 0), blend.y, dy);
        let far = mix(line(0, 1), line(1, 1), blend.y, dy);
        mix(near, far, blend.z, dz)
    }
}

/// Sums of noise at growing frequencies.
#[derive(Debug, Clone, Copy)]
pub struct Fractal {
    /// The noise.
    pub noise: Noise,
    /// Frequency of the first octave.
    pub frequency: f64,
    /// How many octaves, each of twice the frequency.
    pub octaves: u32,
    /// What an octave's amplitude is of the one before; 0.5 looks the same at every scale.
    pub gain: f64,
}

/// Turns an octave against the one before, so that no direction of the lattice shows: by 1 rad about (1, 2, 3).
fn turn() -> DMat3 {
    // The entries as numbers: the same bits on any machine.
    DMat3::from_cols(
        DVec3::new(0.573_137_86, 0.740_348_84, -0.351_278_51),
        DVec3::new(-0.609_006_64, 0.671_644_50, 0.421_905_88),
        DVec3::new(0.548_291_81, -0.027_879_28, 0.835_822_25),
    )
}

impl Fractal {
    /// Octaves that a mesh with vertices `spacing` apart can show: the shortest wave spans four of them.
    pub fn octaves_for(frequency: f64, spacing: f64) -> u32 {
        let ratio = (0.25 / (frequency * spacing)).max(1.0);
        // log2, rounded down.
        (64 - (ratio as u64).leading_zeros()).clamp(1, 16)
    }

    /// Calls `octave` with the noise of each octave, its gradient by the point `p`, and its amplitude.
    fn each(&self, p: DVec3, mut octave: impl FnMut(Jet, f64)) {
        let mut m = DMat3::from_diagonal(DVec3::splat(self.frequency));
        let mut amplitude = 1.0;
        let step = turn() * 2.0;
        for k in 0..self.octaves {
            let noise = Noise { seed: self.noise.seed.wrapping_add(k.wrapping_mul(0x9e37_79b9)) };
            let n = noise.at(m * p);
            octave(Jet { value: n.value, gradient: m.transpose() * n.gradient }, amplitude);
            amplitude *= self.gain;
            m = step * m;
        }
    }

    /// Fractional Brownian motion: the plain sum, about -1 to 1.
    pub fn sum(&self, p: DVec3) -> Jet {
        let mut all = Jet::constant(0.0);
        self.each(p, |n, amplitude| all = all.plus(n.scaled(amplitude)));
        all
    }

    /// Ridges: sharp where an octave crosses zero, rough near earlier ridges and smooth in the valleys (Musgrave's
    /// ridged multifractal, in Ebert et al., "Texturing and Modeling", 3rd ed., 2003, ch. 16). About 0 to 1.3.
    pub fn ridges(&self, p: DVec3) -> Jet {
        // Rounds the crest, so that the normal does not jump there.
        const ROUND: f64 = 2e-3;
        let mut all = Jet::constant(0.0);
        let mut weight = Jet::constant(1.0);
        self.each(p, |n, amplitude| {
            let size = (n.value * n.value + ROUND).sqrt();
            let ridge = n.map(1.0 - 1.6 * size, -1.6 * n.value / size).clamped();
            let signal = ridge.times(ridge).times(weight);
            all = all.plus(signal.scaled(amplitude));
            weight = signal.scaled(1.8).clamped();
        });
        all.scaled(0.6)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestRng;

    fn check_gradient(name: &str, f: impl Fn(DVec3) -> Jet) {
        let mut rng = TestRng::new(5);
        let h = 1e-5;
        for _ in 0..500 {
            let p = rng.cube() * 4.0;
            let g = f(p).gradient;
            let d = |axis: DVec3| (f(p + axis * h).value - f(p - axis * h).value) / (2.0 * h);
            let numeric = DVec3::new(d(DVec3::X), d(DVec3::Y), d(DVec3::Z));
            // Central differences: h^2 times third derivatives, which for the last octave reach 1e4.
            assert!((g - numeric).length() < 1e-4 * (1.0 + g.length()), "{name} at {p}: {g} {numeric}");
        }
    }

    #[test]
    fn gradients_are_derivatives() {
        let noise = Noise { seed: 3 };
        check_gradient("noise", |p| noise.at(p));
        let f = Fractal { noise, frequency: 1.3, octaves: 4, gain: 0.5 };
        check_gradient("sum", |p| f.sum(p));
        check_gradient("step", |p| f.sum(p).step(-0.4, 0.5));
        // One octave: beyond it a clamp has corners, where differences say nothing.
        check_gradient("ridges", |p| Fractal { octaves: 1, ..f }.ridges(p));
    }

    #[test]
    fn values_stay_in_their_range_and_depend_on_the_seed() {
        let mut rng = TestRng::new(6);
        let f = Fractal { noise: Noise { seed: 1 }, frequency: 1.0, octaves: 8, gain: 0.5 };
        let g = Fractal { noise: Noise { seed: 2 }, ..f };
        let mut differ = 0;
        for _ in 0..2000 {
            let p = rng.cube() * 100.0;
            assert!(f.noise.at(p).value.abs() < 1.5 && f.sum(p).value.abs() < 3.0);
            let r = f.ridges(p).value;
            assert!((0.0..1.3).contains(&r), "{r}");
            differ += u32::from(f.sum(p) != g.sum(p));
        }
        assert!(differ > 1990);
        assert_eq!(Fractal::octaves_for(1.0, 1.0), 1);
        assert_eq!(Fractal::octaves_for(1.0, 1.0 / 64.0), 5);
    }
}
