//! What a search does, counted, or not.

use super::simd::{Available, Job, Portable, enter};
use crate::base::intersectable::Visits;

/// Counts what a search does, or nothing.
pub(super) trait Counter {
    fn node(&mut self) {}
    fn leaf(&mut self, _primitives: impl FnOnce() -> u64) {}

    /// Runs a search that is counted by this.
    fn enter<J: Job>(level: Available, job: J) -> J::Output;
}

impl Counter for () {
    #[inline(always)]
    fn enter<J: Job>(level: Available, job: J) -> J::Output {
        enter(level, job)
    }
}

/// Counting has no hurry, and each set of instructions is another copy of the walk to compile. (Boxes are culled by the
/// same bounds whatever the instructions, so that counts differ by roundings alone.)
impl Counter for Visits {
    fn enter<J: Job>(_level: Available, job: J) -> J::Output {
        job.run::<Portable>()
    }

    fn node(&mut self) {
        self.nodes += 1;
    }
    fn leaf(&mut self, primitives: impl FnOnce() -> u64) {
        self.leaves += 1;
        self.primitives += primitives();
    }
}
