//! Light samples that wait for their shadow rays.

use super::escapes::Escapes;
use crate::base::ray::RayBatch;
use crate::color::Rgb;
use crate::scene::Scene;

/// A light sample that waits for its shadow ray.
#[derive(Clone, Copy)]
pub(super) struct Pending {
    /// What the path brings: radiance, or what radiance is to be multiplied by.
    pub value: Rgb,
    /// Index into the block.
    pub index: u32,
    /// The light that has to be asked for the radiance, if it did not say.
    pub ask: Option<u32>,
}

/// Shadow rays, as many as light samples, and whether they met anything.
#[derive(Clone, Copy)]
pub(super) struct ShadowRays<'a> {
    pub rays: &'a RayBatch,
    pub blocked: &'a [bool],
}

/// Adds what arrives to `li`, by index; lights at infinity that left their radiance open are asked for all of it together.
pub(super) fn add_arriving(
    scene: &Scene,
    pending: &[Pending],
    shadow: ShadowRays,
    escapes: &mut Escapes,
    li: &mut [Rgb],
) {
    let ShadowRays { rays, blocked } = shadow;
    // What they ask can be foretold, whether they are blocked cannot.
    let answered = pending.iter().zip(blocked).filter(|(p, _)| p.ask.is_none());
    for (p, _) in answered.filter(|(_, blocked)| !**blocked) {
        li[p.index as usize] += p.value;
    }
    for &light in &scene.lights.at_infinity {
        escapes.pick(rays, |i| !blocked[i] & (pending[i].ask == Some(light)));
        for e in escapes.ask(&*scene.lights.list[light as usize]) {
            let p = &pending[e.number as usize];
            li[p.index as usize] += p.value * e.le;
        }
    }
}
