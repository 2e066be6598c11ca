//! The kernel that is used when none is asked for: the in-house one, which is watertight, unless Embree is clearly faster
//! on this scene and machine, and it pays to find out.
//!
//! Finding out takes a build by Embree, so it is done only where the rays to come will take many times as long as
//! that. It is the one place where a clock decides anything; both kernels find the same primitives but for rays through
//! edges and grazing ones, so pictures are the same either way (`skylit crosscheck` holds them against each other).

use super::{bvh, embree};
use crate::base::geometry::{Geometry, Group};
use crate::base::hit::HitBatch;
use crate::base::intersectable::{Intersectable, KernelOptions};
use crate::base::ray::{Coherence, Ray, RayBatch};
use crate::error::Result;
use glam::Vec3;
use std::sync::Arc;
use std::time::Instant;

/// Rays a second and thread of the slower kernel, for the decision whether to find out; roughly.
const RAYS_PER_SECOND: f64 = 3e6;
/// Seconds a triangle that Embree takes to build, on one thread; roughly.
const BUILD_SECONDS: f64 = 5e-7;
/// Finding out may take this part of what the rays will take.
const WORTH: f64 = 0.02;
/// How much faster Embree has to be.
const MARGIN: f64 = 1.1;

/// Builds the kernel to use for a scene.
pub(super) fn build(geometry: Arc<Geometry>, o: &KernelOptions) -> Result<Box<dyn Intersectable>> {
    let ours = bvh::Kernel::new(geometry.clone(), o)?;
    let primitives: f64 = geometry.groups.iter().map(primitives).sum();
    let tracing = o.expected_rays as f64 / RAYS_PER_SECOND;
    if primitives * BUILD_SECONDS > WORTH * tracing || ours.bounds().is_empty() {
        return Ok(Box::new(ours));
    }
    let theirs = embree::Kernel::new(geometry, o)?;
    let ratio = compare(&ours, &theirs);
    log::info!("auto: {} takes {ratio:.2} times as long as {}", ours.describe(), theirs.describe());
    if ratio > MARGIN {
        return Ok(Box::new(theirs));
    }
    Ok(Box::new(ours))
}

fn primitives(g: &Group) -> f64 {
    let leaves: f64 = g.leaves.iter().map(|l| f64::from(l.shape.primitive_count())).sum();
    leaves + g.children.len() as f64
}

/// Batches a round, of 1,024 rays each; a few milliseconds.
const BATCHES: usize = 4;
/// Rounds; each kernel's fastest counts.
const ROUNDS: usize = 4;

/// The time that `a` takes for rays of all sorts, over that of `b`.
fn compare(a: &dyn Intersectable, b: &dyn Intersectable) -> f64 {
    let batches = rays(a);
    let mut fastest = [f64::INFINITY; 2];
    for round in 0..ROUNDS {
        for k in 0..2 {
            // In turn, so that whichever is first in a round is no better off.
            let which = (round + k) % 2;
            let seconds = time([a, b][which], &batches);
            fastest[which] = fastest[which].min(seconds);
        }
    }
    fastest[0] / fastest[1]
}

fn time(kernel: &dyn Intersectable, batches: &[(RayBatch, RayBatch)]) -> f64 {
    let (mut hits, mut blocked) = (HitBatch::default(), Vec::new());
    let start = Instant::now();
    for (bundle, scattered) in batches {
        kernel.intersect_batch(bundle, &mut hits, Coherence::Coherent);
        kernel.intersect_batch(scattered, &mut hits, Coherence::Incoherent);
        kernel.occluded_batch(scattered, &mut blocked, Coherence::Incoherent);
    }
    start.elapsed().as_secs_f64()
}

/// Bundles from outside, as a camera sends them, and rays that leave what those meet (where they meet nothing: chords of
/// the bounds), as a render goes on.
fn rays(kernel: &dyn Intersectable) -> Vec<(RayBatch, RayBatch)> {
    let bounds = kernel.bounds();
    let (center, size) = (bounds.center(), bounds.size());
    let mut state = 1u32;
    let mut random = || {
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        (state >> 8) as f32 / (1 << 24) as f32 - 0.5
    };
    let mut batches = Vec::new();
    let mut hits = HitBatch::default();
    for i in 0..BATCHES {
        let (mut bundle, mut scattered) = (RayBatch::default(), RayBatch::default());
        let eye = center + size.length() * [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE][i % 4];
        for k in 0..1024u32 {
            let at = center + size * 0.3 * Vec3::new((k % 32) as f32 / 32.0, (k / 32) as f32 / 32.0, 0.1);
            bundle.push(&Ray::new(eye, at - eye, k));
        }
        kernel.intersect_batch(&bundle, &mut hits, Coherence::Coherent);
        for k in 0..bundle.len() {
            let ray = bundle.get(k);
            let mut point = || Vec3::new(random(), random(), random()) * size;
            let (from, to) = match hits.get(k) {
                // Short of the surface, on the side that was seen.
                Some(hit) => (ray.o + ray.d * (hit.t * (1.0 - 1e-4)), point() - ray.d * 0.3),
                None => (center + point(), point()),
            };
            scattered.push(&Ray::new(from, to, ray.key));
        }
        batches.push((bundle, scattered));
    }
    batches
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::tests::world::{bumpy_sphere, leaf, one_group};

    #[test]
    fn few_rays_are_not_worth_a_second_build() {
        let geometry = one_group(vec![leaf(bumpy_sphere(40))]);
        let few = build(geometry.clone(), &KernelOptions::default()).expect("builds");
        assert!(few.describe().starts_with("bvh"), "{}", few.describe());
        // With many, either may win; both answer.
        let options = KernelOptions { expected_rays: 1 << 40, ..KernelOptions::default() };
        let many = build(geometry, &options).expect("builds");
        assert!(many.intersect(&Ray::new(Vec3::ZERO, Vec3::X, 0)).is_some());
    }
}
