//! Kernels with a flaw.

use crate::accel::brute::Brute;
use crate::base::hit::{Hit, HitBatch};
use crate::base::intersectable::Intersectable;
use crate::base::ray::{Coherence, Ray, RayBatch};
use crate::math::aabb::Aabb;
use std::collections::HashSet;

/// What is wrong.
pub enum Flaw {
    /// Distances are a ten-thousandth too long.
    Shift {
        /// In batches alone.
        batch_only: bool,
    },
    /// Every seventh primitive is not there.
    Drop,
    /// Every seventh primitive has the name of the one after the next.
    Swap,
    /// Rays of these keys meet nothing.
    Leak(HashSet<u32>),
}

/// The oracle with a flaw.
pub struct Faulty {
    inner: Brute,
    flaw: Flaw,
}

impl Faulty {
    pub fn new(inner: Brute, flaw: Flaw) -> Self {
        Faulty { inner, flaw }
    }

    fn closest(&self, ray: &Ray, in_batch: bool) -> Option<Hit> {
        let mut rest = *ray;
        loop {
            let hit = self.inner.intersect(&rest)?;
            let chosen = hit.prim % 7 == 3;
            match &self.flaw {
                Flaw::Shift { batch_only } if in_batch || !batch_only => {
                    return Some(Hit { t: hit.t * 1.0001, ..hit });
                }
                // On from behind it; nothing of these scenes lies nearer behind another.
                Flaw::Drop if chosen => rest.tnear = hit.t * (1.0 + 1e-5),
                Flaw::Swap if chosen => return Some(Hit { prim: hit.prim + 2, ..hit }),
                Flaw::Leak(keys) if keys.contains(&ray.key) => return None,
                _ => return Some(hit),
            }
        }
    }
}

impl Intersectable for Faulty {
    fn bounds(&self) -> Aabb {
        self.inner.bounds()
    }

    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.closest(ray, false)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.closest(ray, false).is_some()
    }

    fn intersect_batch(&self, rays: &RayBatch, hits: &mut HitBatch, _: Coherence) {
        hits.reset(rays.len());
        (0..rays.len()).for_each(|i| hits.set(i, self.closest(&rays.get(i), true)));
    }

    fn memory(&self) -> u64 {
        0
    }

    fn describe(&self) -> String {
        "faulty".into()
    }
}
