//! Orthonormal frames.

use glam::Vec3;

/// A right-handed orthonormal basis; local z is `n`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Local x axis in the outer space, unit length.
    pub s: Vec3,
    /// Local y axis in the outer space, unit length.
    pub t: Vec3,
    /// Local z axis in the outer space, unit length.
    pub n: Vec3,
}

impl Frame {
    /// A frame whose z axis is the unit vector `n`, continuous but for the crossing of `n.z` through zero.
    /// Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017, listing 3.
    #[inline]
    pub fn from_z(n: Vec3) -> Self {
        let sign = 1f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Frame {
            s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// A frame with z axis `n` (unit) and x axis as near to `x` as orthogonality allows;
    /// `None` where `x` is (nearly) parallel to `n` or not finite.
    #[inline]
    pub fn from_zx(n: Vec3, x: Vec3) -> Option<Self> {
        let s = (x - n * n.dot(x)).try_normalize()?;
        // One more projection: a single one leaves an error of eps / sin(angle between x and n).
        let s = (s - n * n.dot(s)).try_normalize()?;
        Some(Frame { s, t: n.cross(s), n })
    }

    /// Components of an outer-space vector along s, t and n.
    #[inline]
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(self.s.dot(v), self.t.dot(v), self.n.dot(v))
    }

    /// The outer-space vector with components `v` along s, t and n.
    #[inline]
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn directions() -> Vec<Vec3> {
        let mut all = vec![Vec3::Z, -Vec3::Z, Vec3::X, Vec3::Y, Vec3::new(0.0, 0.0, -0.0) - Vec3::Z];
        for i in 0..5000 {
            let u = (i as f32 + 0.5) / 5000.0;
            let phi = i as f32 * 2.399_963;
            let r = 2.0 * (u * (1.0 - u)).sqrt();
            all.push(Vec3::new(r * phi.cos(), r * phi.sin(), 1.0 - 2.0 * u).normalize());
        }
        // Next to the south pole, where older constructions lose all digits.
        all.extend([1e-4f32, 1e-6, 1e-20].map(|e| Vec3::new(e, -e, -1.0).normalize()));
        all
    }

    #[test]
    fn frames_are_orthonormal_right_handed_and_invert() {
        for n in directions() {
            for f in
                [Some(Frame::from_z(n)), Frame::from_zx(n, Vec3::new(0.3, -0.5, 0.2))].into_iter().flatten()
            {
                // A handful of f32 roundings of values up to 1.
                let tol = 6e-7;
                for (a, b) in [(f.s, f.t), (f.t, f.n), (f.n, f.s)] {
                    assert!(a.dot(b).abs() < tol, "{f:?}");
                    assert!((a.length() - 1.0).abs() < tol, "{f:?}");
                }
                assert!((f.s.cross(f.t) - f.n).length() < 2.0 * tol, "{f:?}");
                let v = Vec3::new(0.3, -0.8, 0.52);
                assert!((f.to_world(f.to_local(v)) - v).length() < 3.0 * tol);
                assert!((f.to_local(f.n) - Vec3::Z).length() < 2.0 * tol);
            }
        }
        assert!(Frame::from_zx(Vec3::Z, Vec3::Z).is_none());
        assert!(Frame::from_zx(Vec3::Z, Vec3::NAN).is_none());
    }
}
