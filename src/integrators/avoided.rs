//! Rays that a path tracer without second thoughts would trace, and that were not: a shadow ray to each light that is to be
//! sampled and a scattered ray, for each surface point at which paths may go on.

use serde::Serialize;

/// Surface points, and rays that were not traced from them, by cause. For every render, `candidates` is the sum of shadow rays,
/// scattered rays and [`Avoided::rays`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct Avoided {
    /// Surface points at which paths may go on.
    pub points: u64,
    /// Rays that such a path tracer would trace from them.
    pub candidates: u64,
    /// Shadow rays: the light sample is black, hardly anything is left for it beside what scattered rays find, or the surface
    /// scatters none of it to the viewer.
    pub dark_samples: u64,
    /// Shadow rays: light is found by scattered rays alone, as on mirrors or under skies that are left to them.
    pub scattered_alone: u64,
    /// Scattered rays: light samples have counted all that they would find.
    pub lit_alone: u64,
    /// Scattered rays: nothing is scattered that way, or it is absorbed.
    pub absorbed: u64,
    /// Scattered rays: Russian roulette.
    pub roulette: u64,
}

impl Avoided {
    /// Adds another count.
    pub fn add(&mut self, o: &Avoided) {
        self.points += o.points;
        self.candidates += o.candidates;
        self.dark_samples += o.dark_samples;
        self.scattered_alone += o.scattered_alone;
        self.lit_alone += o.lit_alone;
        self.absorbed += o.absorbed;
        self.roulette += o.roulette;
    }

    /// Rays of all causes.
    pub fn rays(&self) -> u64 {
        self.dark_samples + self.scattered_alone + self.lit_alone + self.absorbed + self.roulette
    }
}
