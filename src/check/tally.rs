//! Counts of a check, and the ray that shows the worst of it.

use crate::base::ray::Ray;
use serde::Serialize;

/// What came of the rays of one check on one kernel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Tally {
    /// Rays that count.
    pub tried: u64,
    /// Of these, how many broke what is asked.
    pub failed: u64,
    /// Rays set aside with a reason: through a hole, along a rim, too close to tell.
    pub aside: u64,
    /// The largest value measured, where there is one, or the first failure; and its ray.
    pub worst: Option<Worst>,
}

/// A value and the ray that shows it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Worst {
    /// In the unit of the check; none for checks that only count.
    pub value: Option<f64>,
    /// The ray; its numbers read back as they are written.
    pub ray: PlainRay,
    /// The number of the ray in the run, so that one worst is chosen whatever the threads do.
    #[serde(skip)]
    pub order: u64,
}

/// A ray as data.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PlainRay {
    /// Origin, in render space.
    pub origin: [f32; 3],
    /// Direction.
    pub direction: [f32; 3],
}

impl From<&Ray> for PlainRay {
    fn from(r: &Ray) -> Self {
        PlainRay { origin: r.o.to_array(), direction: r.d.to_array() }
    }
}

impl std::fmt::Display for PlainRay {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // Debug of an f32 is the shortest text that reads back as the same number.
        write!(f, "{:?} along {:?}", self.origin, self.direction)
    }
}

impl Tally {
    /// A ray of which only counts whether it failed.
    #[inline]
    pub fn count(&mut self, failed: bool, ray: &Ray, order: u64) {
        self.tried += 1;
        if failed {
            self.failed += 1;
            self.offer(Worst { value: None, ray: ray.into(), order });
        }
    }

    /// A ray with a measured value, which must not be more than `limit`.
    #[inline]
    pub fn measure(&mut self, value: f64, limit: f64, ray: &Ray, order: u64) {
        self.tried += 1;
        self.failed += u64::from(value > limit || value.is_nan());
        let value = if value.is_nan() { f64::INFINITY } else { value };
        if self.worst.is_none_or(|w| w.value.is_some_and(|v| value > v)) {
            self.offer(Worst { value: Some(value), ray: ray.into(), order });
        }
    }

    /// Keeps the larger value, of equals the one of the earlier ray.
    fn offer(&mut self, new: Worst) {
        let better = |old: Worst| match (new.value, old.value) {
            (Some(n), Some(o)) if n != o => n > o,
            _ => new.order < old.order,
        };
        if self.worst.is_none_or(better) {
            self.worst = Some(new);
        }
    }

    /// Both together, in any order the same.
    pub fn merged(mut self, o: &Tally) -> Tally {
        self.tried += o.tried;
        self.failed += o.failed;
        self.aside += o.aside;
        if let Some(worst) = o.worst {
            self.offer(worst);
        }
        self
    }

    /// Where nothing failed: more than this share cannot fail, with 95 % confidence (the "rule of three").
    pub fn upper_bound(&self) -> Option<f64> {
        (self.failed == 0 && self.tried > 0).then(|| 3.0 / self.tried as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn tallies_merge_in_any_order_and_rays_read_back() {
        let ray = Ray::new(Vec3::new(0.1, -1e-7, 3.0), Vec3::X, 0);
        let mut parts = Vec::new();
        for (order, value) in [(7, 0.5), (3, 2.5), (9, 2.5), (1, f64::NAN)] {
            let mut t = Tally::default();
            t.measure(value, 1.0, &ray, order);
            parts.push(t);
        }
        let merge = |list: &[Tally]| list.iter().fold(Tally::default(), |a, b| a.merged(b));
        let all = merge(&parts);
        assert_eq!((all.tried, all.failed, all.worst.unwrap().order), (4, 3, 1));
        assert_eq!(merge(&parts[..3]).worst.unwrap().order, 3);
        parts.reverse();
        assert_eq!(merge(&parts), all);
        assert_eq!(parts[3].upper_bound(), Some(3.0));
        let text = PlainRay::from(&ray).to_string();
        assert_eq!(text, "[0.1, -1e-7, 3.0] along [1.0, 0.0, 0.0]");
    }
}
