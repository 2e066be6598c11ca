//! A kernel that keeps what another is asked and answers.

use crate::base::hit::{Hit, HitBatch};
use crate::base::intersectable::{Intersectable, Nothing};
use crate::base::ray::{Coherence, Ray, RayBatch};
use crate::error::{Error, Result};
use crate::math::aabb::Aabb;
use crate::scene::Scene;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Kernels have forms for packets of rays, which a render's batches fill: fewer rays are asked over and over.
const PACKET: usize = 16;

/// What a kernel said of a ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Answer {
    /// The closest hit.
    Closest(Option<Hit>),
    /// Whether anything is in the way.
    Blocked(bool),
}

/// See the module.
#[derive(Default)]
pub struct Asked {
    inner: OnceLock<Box<dyn Intersectable>>,
    log: Mutex<Vec<(Ray, Answer)>>,
}

impl Asked {
    /// Takes the place of a scene's kernel.
    ///
    /// # Errors
    /// None that a caller can mend.
    pub fn instead_of_kernel(scene: &mut Scene) -> Result<Arc<Asked>> {
        let asked = Arc::new(Asked::default());
        let kernel = std::mem::replace(&mut scene.kernel, Box::new(asked.clone()));
        let set = asked.inner.set(kernel);
        set.map_err(|_| Error::Internal("a kernel stands there already".into()))?;
        Ok(asked)
    }

    /// What was asked since the last time, in order.
    pub fn take(&self) -> Vec<(Ray, Answer)> {
        std::mem::take(&mut *self.log.lock().unwrap_or_else(PoisonError::into_inner))
    }

    fn kernel(&self) -> &dyn Intersectable {
        // Nothing is asked before it is set.
        self.inner.get().map_or(&Nothing, |k| &**k)
    }

    /// Only of a few rays together is anything kept: those of one path, and not those of a pilot.
    fn keep(&self, rays: &RayBatch, answer: impl Fn(usize) -> Answer) {
        if rays.len() <= PACKET {
            let mut log = self.log.lock().unwrap_or_else(PoisonError::into_inner);
            log.extend((0..rays.len()).map(|i| (rays.get(i), answer(i))));
        }
    }
}

/// These rays, as many as a packet takes.
fn filled(rays: &RayBatch) -> RayBatch {
    let mut packet = rays.clone();
    if !rays.is_empty() {
        (0..)
            .map(|i| rays.get(i % rays.len()))
            .take(PACKET.saturating_sub(rays.len()))
            .for_each(|r| packet.push(&r));
    }
    packet
}

impl Intersectable for Arc<Asked> {
    fn bounds(&self) -> Aabb {
        self.kernel().bounds()
    }

    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.kernel().intersect(ray)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.kernel().occluded(ray)
    }

    fn intersect_batch(&self, rays: &RayBatch, hits: &mut HitBatch, coherence: Coherence) {
        self.kernel().intersect_batch(&filled(rays), hits, coherence);
        hits.t.truncate(rays.len());
        hits.prim.truncate(rays.len());
        hits.path.truncate(rays.len());
        self.keep(rays, |i| Answer::Closest(hits.get(i)));
    }

    fn occluded_batch(&self, rays: &RayBatch, blocked: &mut Vec<bool>, coherence: Coherence) {
        self.kernel().occluded_batch(&filled(rays), blocked, coherence);
        blocked.truncate(rays.len());
        self.keep(rays, |i| Answer::Blocked(blocked[i]));
    }

    fn memory(&self) -> u64 {
        self.kernel().memory()
    }

    fn describe(&self) -> String {
        self.kernel().describe()
    }

    fn take_failure(&self) -> Result<()> {
        self.kernel().take_failure()
    }
}
