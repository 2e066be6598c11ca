//! What a scene needs, decided once when it is built; stages that nothing needs are skipped.

use crate::base::shape::Needs;

/// Facts about a scene that select what is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Features {
    /// What the materials read of a vertex; shapes compute nothing else.
    pub needs: Needs,
    /// Whether any surface emits. If none does, the last ray of a path only asks whether it leaves the scene: any
    /// hit ends it, and the point is not needed.
    pub emitting_surfaces: bool,
    /// Whether there is more than one light, so that one must be chosen.
    pub many_lights: bool,
    /// Whether any light can be sampled: a sky that is the same everywhere is best left to scattered rays.
    pub sampled_lights: bool,
    /// Whether any object has more than one material.
    pub material_slots: bool,
}
