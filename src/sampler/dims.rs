//! Which dimension serves which decision: camera slots first, then a fixed number per path depth.
//!
//! Because a decision's dimension follows from its depth and name alone, compaction, sorting and batching of paths
//! change no number. Where a decision is taken `k` times per sample (extra light samples), keep its dimension and
//! use the index `sample * k + i`: the extra points then refine the same stratification.

/// A dimension (of a pair of numbers) of the sample space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Dim(pub(crate) u32);

/// The decisions taken at each path vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(u32)]
pub enum Slot {
    /// Which light to sample (first number; the second is free).
    LightPick,
    /// Where on the light, or which sky direction.
    LightUv,
    /// The direction a material samples.
    BsdfUv,
    /// Which lobe of a material (first number) and Russian roulette (second).
    LobeAndRoulette,
    /// Which half of the strategies a vertex tries, or any other choice of the integrator.
    Strategy,
    /// Distance in a medium.
    Medium,
}

/// Slots reserved per depth; a new [`Slot`] below this number changes no picture.
const SLOTS_PER_DEPTH: u32 = 8;
/// Slots reserved for the camera.
const CAMERA_SLOTS: u32 = 4;

impl Dim {
    /// Position inside the pixel's filter.
    pub const FILTER: Dim = Dim(0);
    /// Position on the lens.
    pub const LENS: Dim = Dim(1);
    /// Shutter time (first number).
    pub const TIME: Dim = Dim(2);

    /// The dimension of decision `slot` at path depth `depth` (the camera's hit has depth 1).
    #[inline(always)]
    pub const fn at(depth: u32, slot: Slot) -> Dim {
        Dim(CAMERA_SLOTS.wrapping_add(depth.wrapping_mul(SLOTS_PER_DEPTH)).wrapping_add(slot as u32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_decisions_share_a_dimension() {
        let slots = [
            Slot::LightPick,
            Slot::LightUv,
            Slot::BsdfUv,
            Slot::LobeAndRoulette,
            Slot::Strategy,
            Slot::Medium,
        ];
        let mut dims = vec![Dim::FILTER, Dim::LENS, Dim::TIME];
        for depth in 0..100 {
            dims.extend(slots.map(|slot| Dim::at(depth, slot)));
        }
        let n = dims.len();
        dims.sort();
        dims.dedup();
        assert_eq!(dims.len(), n);
    }
}
