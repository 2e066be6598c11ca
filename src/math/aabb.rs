//! Axis-aligned boxes: [`Aabb`] in f32 for kernels, [`DAabb`] in f64 for placing things.

use glam::{DAffine3, DVec3, Vec3};

/// The f32 nearest to `v` that is not above it; -infinity below the range of f32.
#[inline]
pub fn round_down(v: f64) -> f32 {
    let f = v as f32;
    if f64::from(f) > v { f.next_down() } else { f }
}

/// The f32 nearest to `v` that is not below it; infinity above the range of f32.
#[inline]
pub fn round_up(v: f64) -> f32 {
    let f = v as f32;
    if f64::from(f) < v { f.next_up() } else { f }
}

macro_rules! aabb {
    ($(#[$doc:meta])* $name:ident, $vec:ident, $scalar:ident) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $name {
            /// Smallest corner.
            pub min: $vec,
            /// Largest corner.
            pub max: $vec,
        }

        impl $name {
            /// The box that holds nothing and is neutral in unions: min = +inf, max = -inf.
            pub const EMPTY: Self = Self { min: $vec::INFINITY, max: $vec::NEG_INFINITY };

            /// From two corners; empty if any component of `min` lies above `max`.
            #[inline]
            pub const fn new(min: $vec, max: $vec) -> Self {
                Self { min, max }
            }

            /// The smallest box around `points`.
            pub fn from_points(points: impl IntoIterator<Item = $vec>) -> Self {
                let mut b = Self::EMPTY;
                points.into_iter().for_each(|p| b.extend(p));
                b
            }

            /// Whether no point lies in the box (a single point is not empty).
            #[inline]
            pub fn is_empty(&self) -> bool {
                !self.min.cmple(self.max).all()
            }

            /// Whether all corners are finite numbers; false for the empty box.
            #[inline]
            pub fn is_finite(&self) -> bool {
                self.min.is_finite() && self.max.is_finite()
            }

            /// Grows the box to hold `p`. A NaN component of `p` leaves that axis as it was.
            #[inline]
            pub fn extend(&mut self, p: $vec) {
                // `p.min(old)` style keeps `old` where p is NaN, in every instruction set.
                self.min = $vec::select(p.cmplt(self.min), p, self.min);
                self.max = $vec::select(p.cmpgt(self.max), p, self.max);
            }

            /// The smallest box around both.
            #[inline]
            pub fn union(self, o: Self) -> Self {
                Self { min: self.min.min(o.min), max: self.max.max(o.max) }
            }

            /// The common part; empty if there is none.
            #[inline]
            pub fn intersection(self, o: Self) -> Self {
                Self { min: self.min.max(o.min), max: self.max.min(o.max) }
            }

            /// Midpoint; NaN for the empty box.
            #[inline]
            pub fn center(&self) -> $vec {
                // Halved first: the sum of two large corners may overflow.
                self.min * 0.5 + self.max * 0.5
            }

            /// Side lengths; zero for the empty box.
            #[inline]
            pub fn size(&self) -> $vec {
                (self.max - self.min).max($vec::ZERO)
            }

            /// Half of the diagonal's length: radius of the sphere around the box. Zero for the empty box.
            #[inline]
            pub fn radius(&self) -> $scalar {
                (self.size() * 0.5).length()
            }

            /// Total area of the six sides; zero for the empty box.
            #[inline]
            pub fn surface_area(&self) -> $scalar {
                let d = self.size();
                2.0 * (d.x * d.y + d.y * d.z + d.z * d.x)
            }

            /// Largest absolute coordinate of any corner; zero for the empty box.
            #[inline]
            pub fn max_abs(&self) -> $scalar {
                if self.is_empty() { 0.0 } else { self.min.abs().max(self.max.abs()).max_element() }
            }

            /// Whether `p` lies inside or on the border.
            #[inline]
            pub fn contains(&self, p: $vec) -> bool {
                self.min.cmple(p).all() && p.cmple(self.max).all()
            }

            /// Whether all of `o` lies inside; true for an empty `o`.
            #[inline]
            pub fn contains_box(&self, o: &Self) -> bool {
                o.is_empty() || (self.min.cmple(o.min).all() && o.max.cmple(self.max).all())
            }

            /// The box grown by `d` to every side.
            #[inline]
            pub fn padded(&self, d: $scalar) -> Self {
                Self { min: self.min - $vec::splat(d), max: self.max + $vec::splat(d) }
            }

            /// The eight corners.
            pub fn corners(&self) -> [$vec; 8] {
                std::array::from_fn(|i| {
                    let pick = |bit: usize, lo, hi| if i & bit == 0 { lo } else { hi };
                    $vec::new(
                        pick(1, self.min.x, self.max.x),
                        pick(2, self.min.y, self.max.y),
                        pick(4, self.min.z, self.max.z),
                    )
                })
            }
        }

        impl Default for $name {
            fn default() -> Self {
                Self::EMPTY
            }
        }
    };
}

aabb!(
    /// An axis-aligned box in f32.
    Aabb,
    Vec3,
    f32
);
aabb!(
    /// An axis-aligned box in f64.
    DAabb,
    DVec3,
    f64
);

impl From<Aabb> for DAabb {
    fn from(b: Aabb) -> Self {
        DAabb { min: b.min.as_dvec3(), max: b.max.as_dvec3() }
    }
}

impl DAabb {
    /// The smallest f32 box that holds all of this one (rounded outwards; beyond the range of f32, infinite).
    pub fn to_f32(&self) -> Aabb {
        let down = |v: DVec3| Vec3::new(round_down(v.x), round_down(v.y), round_down(v.z));
        let up = |v: DVec3| Vec3::new(round_up(v.x), round_up(v.y), round_up(v.z));
        Aabb { min: down(self.min), max: up(self.max) }
    }

    /// The smallest box around the image of this box, to f64 rounding (Arvo, "Transforming axis-aligned
    /// bounding boxes", Graphics Gems, 1990). Empty stays empty.
    pub fn transformed(&self, m: &DAffine3) -> Self {
        if self.is_empty() {
            return *self;
        }
        let mut out = DAabb { min: m.translation, max: m.translation };
        for (axis, lo, hi) in [
            (m.matrix3.x_axis, self.min.x, self.max.x),
            (m.matrix3.y_axis, self.min.y, self.max.y),
            (m.matrix3.z_axis, self.min.z, self.max.z),
        ] {
            let (a, b) = (axis * lo, axis * hi);
            out.min += a.min(b);
            out.max += a.max(b);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_box_is_neutral() {
        let b = Aabb::new(Vec3::new(-1.0, 0.0, 2.0), Vec3::new(1.0, 3.0, 2.0));
        assert!(Aabb::EMPTY.is_empty() && !b.is_empty());
        assert_eq!(b.union(Aabb::EMPTY), b);
        assert_eq!(Aabb::EMPTY.surface_area(), 0.0);
        assert_eq!(Aabb::EMPTY.radius(), 0.0);
        assert!(b.contains_box(&Aabb::EMPTY) && !Aabb::EMPTY.contains_box(&b));
        assert_eq!(b.surface_area(), 12.0);
        assert_eq!(b.center(), Vec3::new(0.0, 1.5, 2.0));
        assert!(b.contains(b.min) && b.contains(b.max) && !b.contains(Vec3::ZERO));
        assert!(b.corners().iter().all(|c| b.contains(*c)));
        let all = DAabb::EMPTY.transformed(&DAffine3::from_scale(DVec3::splat(-2.0)));
        assert!(all.is_empty());
    }

    #[test]
    fn nan_points_do_not_spoil_a_box() {
        let mut b = Aabb::from_points([Vec3::ZERO, Vec3::ONE]);
        b.extend(Vec3::new(f32::NAN, 2.0, f32::NAN));
        assert_eq!(b, Aabb::new(Vec3::ZERO, Vec3::new(1.0, 2.0, 1.0)));
    }

    #[test]
    fn rounding_is_outward_and_tight() {
        for v in [0.1, -0.1, 1.0, 1e300, -1e300, 16_777_217.0, 1e-60, -1e-60, 0.0] {
            let (lo, hi) = (round_down(v), round_up(v));
            assert!(f64::from(lo) <= v && v <= f64::from(hi), "{v}: {lo} {hi}");
            assert!(lo == hi || lo.next_up() == hi, "{v}: {lo} {hi}");
        }
        assert_eq!(DAabb::EMPTY.to_f32(), Aabb::EMPTY);
    }

    #[test]
    fn transformed_box_is_the_hull_of_its_corners() {
        let m = DAffine3::from_cols(
            DVec3::new(0.3, -2.0, 0.0),
            DVec3::new(1.5, 0.2, -0.7),
            DVec3::new(0.0, 0.4, -3.0),
            DVec3::new(10.0, -4.0, 2.0),
        );
        let b = DAabb::new(DVec3::new(-1.0, 2.0, 0.5), DVec3::new(3.0, 2.5, 4.0));
        let hull = DAabb::from_points(b.corners().map(|c| m.transform_point3(c)));
        let t = b.transformed(&m);
        // Sums of four terms of size up to 12, in f64.
        assert!((t.min - hull.min).length() < 1e-14 && (t.max - hull.max).length() < 1e-14);
    }
}
