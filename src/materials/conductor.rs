//! How metals reflect: Fresnel's equations for a complex index, and Schlick's approximation for a given colour.

use crate::color::Rgb;

/// A metal's complex index n + ik, per channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conductor {
    /// Its name in scene files.
    pub name: &'static str,
    /// Real part.
    pub n: [f32; 3],
    /// Imaginary part.
    pub k: [f32; 3],
}

/// The metals known by name.
///
/// From measured n(lambda), k(lambda): Johnson and Christy, Phys. Rev. B 6, 4370 (1972) for gold, silver and copper;
/// the same, Phys. Rev. B 9, 5056 (1974) for iron; Rakic, Appl. Opt. 34, 4755 (1995) for aluminium. Fresnel
/// reflectance at 24 angles was carried to linear Rec. 709 under D65 (colour matching by Wyman, Sloan and Shirley, JCGT
/// 2(2), 2013), and per channel that (n, k) taken which gives the reflectance at normal incidence exactly and the other
/// angles best: to 0.005, for iron, silver and aluminium to 0.001. The red of gold lies outside Rec. 709 (1.035): there
/// stand the constants at 700 nm, where gold reflects most (0.970).
pub const CONDUCTORS: &[Conductor] = &[
    Conductor { name: "aluminium", n: [1.495, 0.988, 0.605], k: [7.642, 6.557, 5.349] },
    Conductor { name: "copper", n: [0.24, 1.041, 1.297], k: [3.471, 2.628, 2.363] },
    Conductor { name: "gold", n: [0.13, 0.494, 1.477], k: [4.06, 2.253, 1.778] },
    Conductor { name: "iron", n: [2.922, 2.92, 2.547], k: [3.075, 2.938, 2.75] },
    Conductor { name: "silver", n: [0.056, 0.056, 0.044], k: [4.463, 3.589, 2.623] },
];

impl Conductor {
    /// Unpolarised reflectance from air at this cosine, in [0, 1]. Born and Wolf, "Principles of Optics", 14.2; in real
    /// arithmetic as Lagarde, "Memo on Fresnel equations", 2013.
    #[inline]
    pub fn reflectance(&self, cos: f32) -> Rgb {
        let cos2 = cos * cos;
        let sin2 = 1.0 - cos2;
        Rgb::from(std::array::from_fn(|c| {
            let (n2, k2) = (self.n[c] * self.n[c], self.k[c] * self.k[c]);
            let t0 = n2 - k2 - sin2;
            let a2_plus_b2 = (t0 * t0 + 4.0 * n2 * k2).sqrt();
            let a = (0.5 * (a2_plus_b2 + t0)).max(0.0).sqrt();
            let (sum, cross) = (a2_plus_b2 + cos2, 2.0 * a * cos);
            let rs = (sum - cross) / (sum + cross);
            let (sum, cross) = (cos2 * a2_plus_b2 + sin2 * sin2, cross * sin2);
            let rp = rs * (sum - cross) / (sum + cross);
            0.5 * (rs + rp)
        }))
    }

    /// Reflectance averaged over a hemisphere of light: 2 * integral of F(mu) mu dmu.
    pub fn average(&self) -> Rgb {
        const N: usize = 64;
        let node = |i: usize| (i as f32 + 0.5) / N as f32;
        (0..N).map(|i| self.reflectance(node(i)) * (2.0 * node(i) / N as f32)).sum()
    }
}

/// Schlick, "An Inexpensive BRDF Model for Physically-based Rendering", 1994, eq. 15: from `f0` at normal incidence to
/// 1 at grazing.
#[inline]
pub fn schlick(f0: Rgb, cos: f32) -> Rgb {
    f0.lerp(Rgb::WHITE, schlick_weight(cos))
}

/// The share of white in [`schlick`]: (1 - cos)^5.
#[inline]
pub fn schlick_weight(cos: f32) -> f32 {
    let m = 1.0 - cos;
    let m2 = m * m;
    m2 * m2 * m
}

/// [`schlick`] averaged over a hemisphere of light, in closed form: 2 * integral of (1 - mu)^5 mu dmu = 1 / 21.
pub fn schlick_average(f0: Rgb) -> Rgb {
    f0.lerp(Rgb::WHITE, 1.0 / 21.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_have_closed_forms() {
        for m in CONDUCTORS {
            let normal = m.reflectance(1.0).to_array();
            let grazing = m.reflectance(0.0).to_array();
            for (c, (normal, grazing)) in normal.into_iter().zip(grazing).enumerate() {
                let (n, k) = (m.n[c], m.k[c]);
                let r = ((n - 1.0).powi(2) + k * k) / ((n + 1.0).powi(2) + k * k);
                // Roundings of terms up to k^4 = 3400, relative.
                assert!((normal - r).abs() < 1e-5, "{}: {normal} {r}", m.name);
                assert!((grazing - 1.0).abs() < 1e-6, "{}: {grazing}", m.name);
            }
            for i in 0..=1000 {
                let f = m.reflectance(i as f32 / 1000.0);
                assert!(f.is_finite() && f.to_array().iter().all(|v| (0.0..=1.0).contains(v)), "{f:?}");
            }
        }
    }

    #[test]
    fn fresnel_agrees_with_complex_arithmetic() {
        // rs = (cos - b) / (cos + b), rp = (e cos - b) / (e cos + b), with b^2 = e - sin^2 and e = (n + ik)^2.
        type Complex = (f64, f64);
        let mul = |a: Complex, b: Complex| (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0);
        let norm = |a: Complex| a.0 * a.0 + a.1 * a.1;
        let sqrt = |a: Complex| {
            let r = norm(a).sqrt();
            ((0.5 * (r + a.0)).sqrt(), (0.5 * (r - a.0)).sqrt().copysign(a.1))
        };
        for m in CONDUCTORS {
            for cos in [0.02, 0.2, 0.5, 0.9] {
                let e = mul((m.n[0] as f64, m.k[0] as f64), (m.n[0] as f64, m.k[0] as f64));
                let b = sqrt((e.0 - (1.0 - cos * cos), e.1));
                let rs = norm((cos - b.0, -b.1)) / norm((cos + b.0, b.1));
                let rp = norm((e.0 * cos - b.0, e.1 * cos - b.1)) / norm((e.0 * cos + b.0, e.1 * cos + b.1));
                let f = f64::from(m.reflectance(cos as f32).r);
                assert!((f - 0.5 * (rs + rp)).abs() < 2e-5, "{} at {cos}: {f}", m.name);
            }
        }
    }

    #[test]
    fn averages_are_integrals() {
        let f0 = Rgb::new(0.0, 0.3, 1.0);
        const N: usize = 2000;
        let node = |i: usize| (i as f32 + 0.5) / N as f32;
        let sum: Rgb = (0..N).map(|i| schlick(f0, node(i)) * (2.0 * node(i) / N as f32)).sum();
        let error = (sum - schlick_average(f0)).to_array().into_iter().fold(0f32, |a, e| a.max(e.abs()));
        assert!(error < 1e-5, "2,000 f32 additions: {error}");
    }
}
