//! A kernel that hands on what it is asked, and keeps the rays.

use skylit::Result;
use skylit::base::hit::{Hit, HitBatch};
use skylit::base::intersectable::{Intersectable, Nothing};
use skylit::base::ray::{Coherence, Ray, RayBatch};
use skylit::math::aabb::Aabb;
use skylit::scene::Scene;
use std::sync::{Arc, Mutex};

/// What was asked of a batch.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Closest hits of coherent rays.
    Camera,
    /// Any hits.
    Shadow,
}

/// A batch as it was asked.
pub struct Recorded {
    pub kind: Kind,
    pub rays: RayBatch,
}

/// All batches, in the order in which they came.
#[derive(Clone, Default)]
pub struct Tape(Arc<Mutex<Vec<Arc<Recorded>>>>);

impl Tape {
    pub fn clear(&self) {
        self.0.lock().expect("no panic while recording").clear();
    }

    pub fn batches(&self) -> Vec<Arc<Recorded>> {
        self.0.lock().expect("no panic while recording").clone()
    }

    /// Rays of kind `k`, camera rays first.
    pub fn count(&self, k: usize) -> u64 {
        let kind = [Kind::Camera, Kind::Shadow][k];
        self.batches().iter().filter(|b| b.kind == kind).map(|b| b.rays.len() as u64).sum()
    }

    fn keep(&self, kind: Kind, rays: &RayBatch) {
        let batch = Arc::new(Recorded { kind, rays: rays.clone() });
        self.0.lock().expect("no panic while recording").push(batch);
    }
}

/// Puts itself before a scene's kernel for a while.
pub struct Recorder {
    tape: Tape,
}

impl Recorder {
    pub fn new() -> (Arc<Self>, Tape) {
        let tape = Tape::default();
        (Arc::new(Recorder { tape: tape.clone() }), tape)
    }

    /// Calls `f` with the scene, whose rays are recorded meanwhile.
    pub fn around(&self, scene: &mut Scene, f: impl FnOnce(&Scene)) {
        let kernel = std::mem::replace(&mut scene.kernel, Box::new(Nothing));
        let kernel: Arc<dyn Intersectable> = Arc::from(kernel);
        scene.kernel = Box::new(Recording { inner: kernel.clone(), tape: self.tape.clone() });
        f(scene);
        scene.kernel = Box::new(Shared(kernel));
    }
}

/// A kernel that others may hold, too.
struct Shared(Arc<dyn Intersectable>);

struct Recording {
    inner: Arc<dyn Intersectable>,
    tape: Tape,
}

macro_rules! hand_on {
    ($kernel:ident) => {
        fn bounds(&self) -> Aabb {
            self.$kernel().bounds()
        }

        fn intersect(&self, ray: &Ray) -> Option<Hit> {
            self.$kernel().intersect(ray)
        }

        fn occluded(&self, ray: &Ray) -> bool {
            self.$kernel().occluded(ray)
        }

        fn memory(&self) -> u64 {
            self.$kernel().memory()
        }

        fn describe(&self) -> String {
            self.$kernel().describe()
        }

        fn take_failure(&self) -> Result<()> {
            self.$kernel().take_failure()
        }
    };
}

impl Shared {
    fn kernel(&self) -> &dyn Intersectable {
        &*self.0
    }
}

impl Recording {
    fn kernel(&self) -> &dyn Intersectable {
        &*self.inner
    }
}

impl Intersectable for Shared {
    hand_on!(kernel);

    fn intersect_batch(&self, rays: &RayBatch, hits: &mut HitBatch, coherence: Coherence) {
        self.0.intersect_batch(rays, hits, coherence);
    }

    fn occluded_batch(&self, rays: &RayBatch, blocked: &mut Vec<bool>, coherence: Coherence) {
        self.0.occluded_batch(rays, blocked, coherence);
    }
}

impl Intersectable for Recording {
    hand_on!(kernel);

    fn intersect_batch(&self, rays: &RayBatch, hits: &mut HitBatch, coherence: Coherence) {
        self.tape.keep(Kind::Camera, rays);
        self.inner.intersect_batch(rays, hits, coherence);
    }

    fn occluded_batch(&self, rays: &RayBatch, blocked: &mut Vec<bool>, coherence: Coherence) {
        self.tape.keep(Kind::Shadow, rays);
        self.inner.occluded_batch(rays, blocked, coherence);
    }
}
