//! The GGX distribution of facets, its masking, and the sampling of those facets that a viewer sees.
//!
//! Sources: Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007; Heitz, "Understanding
//! the Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT 3(2), 2014; Heitz, "Sampling the GGX Distribution
//! of Visible Normals", JCGT 7(4), 2018; Dupuy and Benyoub, "Sampling Visible GGX Normals with Spherical Caps",
//! Computer Graphics Forum 42(8), 2023. All directions lie above the surface (z > 0).

use crate::math::trig::{SinCos, sin_cos_2pi};
use glam::Vec3;
use std::f32::consts::PI;

/// The smallest alpha. A half vector in f32 is off by some 1e-7: at this width that is 1e-4 of the lobe, and its
/// density still means something. The lobe is 0.06 degrees wide then, a ninth of the sun.
pub const MIN_ALPHA: f32 = 1e-3;

/// Cosines below this scatter nothing: their products would leave the range of f32.
pub const MIN_COS: f32 = 1e-12;

/// A GGX distribution of facet normals, wider along one tangent than the other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ggx {
    /// Width along x.
    pub ax: f32,
    /// Width along y.
    pub ay: f32,
}

/// What both directions of a reflection need of the facet between them.
#[derive(Debug, Clone, Copy)]
pub struct Facet {
    /// Density of facet normals there, per solid angle and area.
    pub d: f32,
    /// Cosine between the facet's normal and either direction.
    pub cos: f32,
}

impl Ggx {
    /// From `roughness` in [0, 1], alpha being its square, and `anisotropy` in [0, 1], which makes alpha along x up to
    /// 10 times that along y at the same product (Burley, "Physically Based Shading at Disney", 2012, section 5.4).
    pub fn new(roughness: f32, anisotropy: f32) -> Self {
        let alpha = roughness * roughness;
        let aspect = (1.0 - 0.9 * anisotropy).sqrt();
        Ggx { ax: (alpha / aspect).max(MIN_ALPHA), ay: (alpha * aspect).max(MIN_ALPHA) }
    }

    /// Whether it is the same along every tangent.
    pub fn is_isotropic(&self) -> bool {
        self.ax == self.ay
    }

    /// The facet that reflects `wo` to `wi`; None where the two are opposite to rounding.
    #[inline]
    pub fn facet(&self, wo: Vec3, wi: Vec3) -> Option<Facet> {
        let h = wo + wi;
        let l2 = h.length_squared();
        if l2 < 1e-24 {
            return None;
        }
        Some(Facet { d: self.density(h, l2), cos: (0.5 * l2.sqrt()).min(1.0) })
    }

    /// Density of facets with their normal along `h`, whose squared length is `l2`, per solid angle and area.
    #[inline]
    pub fn density(&self, h: Vec3, l2: f32) -> f32 {
        // Walter eq. 33; anisotropic as Heitz 2018, eq. 1. The half vector need not be normalised for it.
        let (x, y) = (h.x / self.ax, h.y / self.ay);
        let q = (x * x + y * y + h.z * h.z) / l2;
        1.0 / (PI * self.ax * self.ay * q * q)
    }

    /// Length of `w` stretched by the widths: |(ax x, ay y, z)|. Everything about masking is made of it:
    /// Lambda (Heitz 2014, eq. 72 and 86) is (stretch / cos - 1) / 2.
    #[inline]
    pub fn stretch(&self, w: Vec3) -> f32 {
        Vec3::new(self.ax * w.x, self.ay * w.y, w.z).length()
    }

    /// G1(w) / (4 cos w): with [`Facet::d`] the density of reflected directions per solid angle when facets are
    /// drawn by [`Ggx::sample_visible`]. G1 = 1 / (1 + Lambda) (Heitz 2014, eq. 43) without its division by cos;
    /// density of visible normals: Heitz 2018, eq. 3; 1 / (4 cos) for the reflection: Walter eq. 14.
    #[inline]
    pub fn visible_over_4cos(&self, w: Vec3) -> f32 {
        0.5 / (w.z + self.stretch(w))
    }

    /// G2(wo, wi) / (4 cos wo cos wi), with masking and shadowing correlated by height: G2 = 1 / (1 + Lambda(wo) +
    /// Lambda(wi)) (Heitz 2014, eq. 99).
    #[inline]
    pub fn masking_over_4cos(&self, wo: Vec3, wi: Vec3) -> f32 {
        0.5 / (self.stretch(wo) * wi.z + self.stretch(wi) * wo.z)
    }

    /// G2 / G1(wo): what is left of the light after a facet was drawn by [`Ggx::sample_visible`] (Heitz 2018, section
    /// 4: the weight of a sample, without Fresnel).
    #[inline]
    pub fn weight(&self, wo: Vec3, wi: Vec3) -> f32 {
        let so = self.stretch(wo);
        wi.z * (wo.z + so) / (so * wi.z + self.stretch(wi) * wo.z)
    }

    /// A facet's unit normal, drawn from those visible from `wo` in proportion to their projected area. None where
    /// rounding leaves no direction.
    #[inline]
    pub fn sample_visible(&self, wo: Vec3, u: [f32; 2]) -> Option<Vec3> {
        // Dupuy and Benyoub: where the facets are those of a hemisphere, its reflections of wo fill a spherical cap
        // evenly; draw there, take the half vector, and squeeze it back.
        let v = Vec3::new(self.ax * wo.x, self.ay * wo.y, wo.z).try_normalize()?;
        let z = (1.0 - u[1]) * (1.0 + v.z) - v.z;
        let r = ((1.0 - z) * (1.0 + z)).max(0.0).sqrt();
        let SinCos { sin, cos } = sin_cos_2pi(u[0]);
        let h = Vec3::new(r * cos, r * sin, z) + v;
        Vec3::new(self.ax * h.x, self.ay * h.y, h.z.max(0.0)).try_normalize()
    }
}

/// `w` reflected by a facet with unit normal `h`, unit length again to rounding.
#[inline]
pub fn reflect(w: Vec3, h: Vec3) -> Vec3 {
    (2.0 * w.dot(h) * h - w).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{ChiSquare, chi_square_sphere, integrate_sphere};

    fn all() -> [Ggx; 5] {
        [(1.0, 0.0), (0.7, 0.0), (0.4, 0.0), (0.7, 0.6), (1.0, 1.0)].map(|(r, a)| Ggx::new(r, a))
    }

    fn views() -> [Vec3; 4] {
        let at = |t: f32, p: f32| Vec3::new(t.sin() * p.cos(), t.sin() * p.sin(), t.cos());
        [Vec3::Z, at(0.5, 0.3), at(1.2, -2.0), at(1.35, 1.4)]
    }

    /// The facet with normal `h`, by way of a reflection about it.
    fn d(g: &Ggx, h: Vec3) -> f64 {
        if h.z <= 0.0 { 0.0 } else { g.facet(h, h).map_or(0.0, |f| f64::from(f.d)) }
    }

    fn g1(g: &Ggx, w: Vec3) -> f64 {
        f64::from(4.0 * w.z * g.visible_over_4cos(w))
    }

    #[test]
    fn facets_cover_the_surface_once() {
        for g in all() {
            // Heitz 2014, eq. 2: projected onto the surface, facets add up to it; rounding of f32 densities.
            let area = integrate_sphere(|h| d(&g, h.as_vec3()) * h.z.max(0.0), 1e-5);
            assert!((area - 1.0).abs() < 1e-4, "{g:?}: {area}");
        }
    }

    #[test]
    fn masking_leaves_what_the_viewer_sees_of_the_surface() {
        for g in all() {
            for w in views() {
                // Heitz 2014, eq. 19 and 43: seen from w, unmasked facets fill the surface's outline.
                let seen = |h: glam::DVec3| d(&g, h.as_vec3()) * h.dot(w.as_dvec3()).max(0.0);
                let outline = g1(&g, w) * integrate_sphere(seen, 1e-5);
                assert!((outline - f64::from(w.z)).abs() < 2e-4, "{g:?} {w}: {outline}");
            }
        }
    }

    #[test]
    fn visible_facets_are_drawn_by_their_density() {
        let tests = (all().len() * views().len()) as u32;
        for g in all() {
            for w in views() {
                let how = ChiSquare { tests, samples: 100_000, ..ChiSquare::default() };
                // Heitz 2018, eq. 3.
                let pdf = |h: Vec3| (d(&g, h) * g1(&g, w)) as f32 * w.dot(h).max(0.0) / w.z;
                chi_square_sphere("facets", &how, |rng| g.sample_visible(w, rng.vec2().into()), pdf);
            }
        }
    }

    #[test]
    fn masking_forms_agree() {
        for g in all() {
            for (wo, wi) in views().into_iter().flat_map(|o| views().map(|i| (o, i))) {
                let lambda = |w: Vec3| 0.5 * (g.stretch(w) / w.z - 1.0);
                let g2 = 1.0 / (1.0 + lambda(wo) + lambda(wi));
                let same = |a: f32, b: f32| assert!((a / b - 1.0).abs() < 1e-5, "{g:?} {wo} {wi}: {a} {b}");
                same(g.masking_over_4cos(wo, wi) * 4.0 * wo.z * wi.z, g2);
                same(g.weight(wo, wi), g2 * (1.0 + lambda(wo)));
                same(g1(&g, wo) as f32, 1.0 / (1.0 + lambda(wo)));
            }
        }
    }
}
