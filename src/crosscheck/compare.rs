//! A kernel that asks several, answers like one of them, and keeps the rays on which they differ.

use super::judge::Answer;
use super::oracle::find;
use crate::base::geometry::Geometry;
use crate::base::hit::{Hit, HitBatch};
use crate::base::intersectable::{Intersectable, QueryKind};
use crate::base::ray::{Coherence, Ray, RayBatch};
use crate::error::Result;
use crate::math::aabb::Aabb;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};

/// A kernel under its name.
#[derive(Clone)]
pub struct Contender {
    /// Its name in the table of kernels, or any other.
    pub name: String,
    /// The kernel.
    pub kernel: Arc<dyn Intersectable>,
}

/// How a kernel was asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Style {
    /// One ray at a time.
    Single,
    /// The whole batch.
    Batch,
}

impl Style {
    /// Both, in the order in which answers stand: each kernel's one after the other.
    pub const ALL: [Style; 2] = [Style::Single, Style::Batch];

    /// For people.
    pub fn text(self) -> &'static str {
        match self {
            Style::Single => "single",
            Style::Batch => "batch",
        }
    }
}

/// A ray on which kernels differ, or on which an answer cannot be right.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// The ray, in render space.
    pub ray: Ray,
    /// What was asked.
    pub query: QueryKind,
    /// Single and batch of the first kernel, of the second, ...
    pub answers: Vec<Answer>,
    /// Primitives that kernels name for the closest hit; of any-hit queries, what they answer when asked for it.
    pub named: Vec<Hit>,
}

/// What a thread has seen since it was last asked.
#[derive(Default)]
pub struct Seen {
    /// Rays compared.
    pub rays: u64,
    /// The cases, in order.
    pub cases: Vec<Case>,
    /// Cases beyond the most that are kept, which nobody will look at.
    pub lost: u64,
}

/// Cases that a thread keeps between two questions: more than a tile's rays at usual settings.
const MAX_CASES: usize = 1 << 16;

#[derive(Default)]
struct Slot {
    seen: Seen,
    hits: Vec<HitBatch>,
    blocked: Vec<Vec<bool>>,
    answers: Vec<Answer>,
}

/// See the module. What a thread of the present rayon pool sees is kept for that thread to fetch
/// ([`Comparing::take_seen`]).
pub struct Comparing {
    geometry: Arc<Geometry>,
    contenders: Vec<Contender>,
    answering: AtomicUsize,
    slots: Vec<Mutex<Slot>>,
}

impl Comparing {
    /// Over at least one kernel, for a pool of so many threads. The first answers.
    pub fn new(geometry: Arc<Geometry>, contenders: Vec<Contender>, threads: usize) -> Self {
        assert!(!contenders.is_empty(), "nothing to compare");
        let slots = (0..threads.max(1)).map(|_| Mutex::default()).collect();
        Comparing { geometry, contenders, answering: AtomicUsize::new(0), slots }
    }

    /// Lets kernel `k` answer from now on.
    pub fn set_answering(&self, k: usize) {
        self.answering.store(k.min(self.contenders.len() - 1), Ordering::Relaxed);
    }

    /// What the calling thread has seen since it last asked.
    pub fn take_seen(&self) -> Seen {
        std::mem::take(&mut self.slot().seen)
    }

    fn slot(&self) -> MutexGuard<'_, Slot> {
        // A thread outside of the pool shares the first slot, which costs it nothing but order.
        let i = rayon::current_thread_index().unwrap_or(0) % self.slots.len();
        self.slots[i].lock().unwrap_or_else(|e| e.into_inner())
    }

    fn chosen(&self) -> (usize, &dyn Intersectable) {
        let k = self.answering.load(Ordering::Relaxed);
        (k, &*self.contenders[k].kernel)
    }

    /// Whether all name the same (or nothing), and each distance is one that a careful kernel may say.
    fn all_agree(&self, ray: &Ray, answers: &[Answer]) -> bool {
        let first = answers[0].named();
        if answers.iter().any(|a| a.named() != first) {
            return false;
        }
        let Some((path, prim)) = first else { return true };
        let mut agreed = false;
        if let Some((primitive, local)) = find(&self.geometry, ray, path, prim) {
            primitive.crossings(&local, |c| {
                let mut distances = answers.iter().filter_map(hit_of).map(|h| f64::from(h.t));
                agreed |= distances.all(|t| (t - c.t).abs() <= c.reach);
            });
        }
        agreed
    }

    fn compare_closest(&self, rays: &RayBatch, slot: &mut Slot) {
        let Slot { seen, hits, answers, .. } = slot;
        for i in 0..rays.len() {
            let ray = rays.get(i);
            answers.clear();
            for (c, batch) in self.contenders.iter().zip(&*hits) {
                answers.push(Answer::Closest(c.kernel.intersect(&ray)));
                answers.push(Answer::Closest(batch.get(i)));
            }
            if !self.all_agree(&ray, answers) {
                let named = answers.iter().filter_map(hit_of).collect();
                seen.keep(|| Case { ray, query: QueryKind::Closest, answers: answers.clone(), named });
            }
        }
        seen.rays += rays.len() as u64;
    }

    fn compare_any(&self, rays: &RayBatch, slot: &mut Slot) {
        let Slot { seen, blocked, answers, .. } = slot;
        for i in 0..rays.len() {
            let ray = rays.get(i);
            answers.clear();
            for (c, batch) in self.contenders.iter().zip(&*blocked) {
                answers.push(Answer::Any(c.kernel.occluded(&ray)));
                answers.push(Answer::Any(batch[i]));
            }
            if answers.windows(2).any(|w| w[0] != w[1]) {
                let named = self.contenders.iter().filter_map(|c| c.kernel.intersect(&ray)).collect();
                seen.keep(|| Case { ray, query: QueryKind::Any, answers: answers.clone(), named });
            }
        }
        seen.rays += rays.len() as u64;
    }
}

impl Seen {
    fn keep(&mut self, case: impl FnOnce() -> Case) {
        if self.cases.len() < MAX_CASES {
            self.cases.push(case());
        } else {
            self.lost += 1;
        }
    }
}

fn hit_of(answer: &Answer) -> Option<Hit> {
    match answer {
        Answer::Closest(hit) => *hit,
        Answer::Any(_) => None,
    }
}

impl Intersectable for Comparing {
    fn bounds(&self) -> Aabb {
        self.chosen().1.bounds()
    }

    /// Compared as a batch of one.
    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let (mut rays, mut hits) = (RayBatch::default(), HitBatch::default());
        rays.push(ray);
        self.intersect_batch(&rays, &mut hits, Coherence::Incoherent);
        hits.get(0)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        let (mut rays, mut blocked) = (RayBatch::default(), Vec::new());
        rays.push(ray);
        self.occluded_batch(&rays, &mut blocked, Coherence::Incoherent);
        blocked[0]
    }

    fn intersect_batch(&self, rays: &RayBatch, hits: &mut HitBatch, coherence: Coherence) {
        let mut slot = self.slot();
        slot.hits.resize_with(self.contenders.len(), HitBatch::default);
        for (c, batch) in self.contenders.iter().zip(&mut slot.hits) {
            c.kernel.intersect_batch(rays, batch, coherence);
        }
        self.compare_closest(rays, &mut slot);
        hits.clone_from(&slot.hits[self.chosen().0]);
    }

    fn occluded_batch(&self, rays: &RayBatch, blocked: &mut Vec<bool>, coherence: Coherence) {
        let mut slot = self.slot();
        slot.blocked.resize_with(self.contenders.len(), Vec::new);
        for (c, batch) in self.contenders.iter().zip(&mut slot.blocked) {
            c.kernel.occluded_batch(rays, batch, coherence);
        }
        self.compare_any(rays, &mut slot);
        blocked.clone_from(&slot.blocked[self.chosen().0]);
    }

    fn memory(&self) -> u64 {
        self.contenders.iter().map(|c| c.kernel.memory()).sum()
    }

    fn describe(&self) -> String {
        let names: Vec<String> = self.contenders.iter().map(|c| c.kernel.describe()).collect();
        names.join(" against ")
    }

    fn take_failure(&self) -> Result<()> {
        self.contenders.iter().try_for_each(|c| c.kernel.take_failure())
    }
}

/// A kernel that others hold, too, as the kernel of a scene.
pub struct Shared<K: ?Sized>(pub Arc<K>);

impl<K: Intersectable + ?Sized> Intersectable for Shared<K> {
    fn bounds(&self) -> Aabb {
        self.0.bounds()
    }

    fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.0.intersect(ray)
    }

    fn occluded(&self, ray: &Ray) -> bool {
        self.0.occluded(ray)
    }

    fn intersect_batch(&self, rays: &RayBatch, hits: &mut HitBatch, coherence: Coherence) {
        self.0.intersect_batch(rays, hits, coherence);
    }

    fn occluded_batch(&self, rays: &RayBatch, blocked: &mut Vec<bool>, coherence: Coherence) {
        self.0.occluded_batch(rays, blocked, coherence);
    }

    fn memory(&self) -> u64 {
        self.0.memory()
    }

    fn describe(&self) -> String {
        self.0.describe()
    }

    fn take_failure(&self) -> Result<()> {
        self.0.take_failure()
    }
}
