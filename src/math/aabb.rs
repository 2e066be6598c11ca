//! Axis-aligned bounding boxes.

use glam::{DAffine3, DVec3, Vec3};

/// A box in single precision; empty where `min > max`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    /// Smallest corner.
    pub min: Vec3,
    /// Largest corner.
    pub max: Vec3,
}

impl Default for Aabb {
    fn default() -> Self {
        Aabb::EMPTY
    }
}

impl Aabb {
    /// Holds nothing; the identity of [`Aabb::union`].
    pub const EMPTY: Aabb = Aabb { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// Whether it holds no point.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// The smallest box around both.
    pub fn union(self, o: Aabb) -> Aabb {
        Aabb { min: self.min.min(o.min), max: self.max.max(o.max) }
    }

    /// Grows to hold `p`.
    pub fn extend(&mut self, p: Vec3) {
        self.min = self.min.min(p);
        self.max = self.max.max(p);
    }

    /// Middle.
    pub fn center(&self) -> Vec3 {
        self.min * 0.5 + self.max * 0.5
    }

    /// Half of the diagonal's length; 0 if empty.
    pub fn radius(&self) -> f32 {
        if self.is_empty() { 0.0 } else { (self.max * 0.5 - self.min * 0.5).length() }
    }
}

/// A box in double precision; empty where `min > max`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DAabb {
    /// Smallest corner.
    pub min: DVec3,
    /// Largest corner.
    pub max: DVec3,
}

impl DAabb {
    /// Holds nothing.
    pub const EMPTY: DAabb = DAabb { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// Whether it holds no point.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// The smallest box around both.
    pub fn union(self, o: DAabb) -> DAabb {
        DAabb { min: self.min.min(o.min), max: self.max.max(o.max) }
    }

    /// Grows to hold `p`.
    pub fn extend(&mut self, p: DVec3) {
        self.min = self.min.min(p);
        self.max = self.max.max(p);
    }

    /// Middle.
    pub fn center(&self) -> DVec3 {
        self.min * 0.5 + self.max * 0.5
    }

    /// The box around the image of this one.
    pub fn transformed(&self, by: &DAffine3) -> DAabb {
        if self.is_empty() {
            return DAabb::EMPTY;
        }
        let m = by.matrix3;
        let c = by.transform_point3(self.center());
        let h = (self.max - self.min) * 0.5;
        let r = m.x_axis.abs() * h.x + m.y_axis.abs() * h.y + m.z_axis.abs() * h.z;
        DAabb { min: c - r, max: c + r }
    }

    /// In single precision, rounded outwards.
    pub fn to_f32(&self) -> Aabb {
        if self.is_empty() {
            return Aabb::EMPTY;
        }
        let down = |v: f64| if (v as f32) as f64 > v { (v as f32).next_down() } else { v as f32 };
        let up = |v: f64| if ((v as f32) as f64) < v { (v as f32).next_up() } else { v as f32 };
        Aabb {
            min: Vec3::new(down(self.min.x), down(self.min.y), down(self.min.z)),
            max: Vec3::new(up(self.max.x), up(self.max.y), up(self.max.z)),
        }
    }
}

impl From<Aabb> for DAabb {
    fn from(b: Aabb) -> Self {
        DAabb { min: b.min.as_dvec3(), max: b.max.as_dvec3() }
    }
}
