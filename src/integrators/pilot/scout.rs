//! Which pixels show which material.

use crate::base::camera::FilmSamples;
use crate::base::hit::HitBatch;
use crate::base::material::{Material, Prepared};
use crate::base::ray::{Coherence, RayBatch};
use crate::integrators::PilotPlan;
use crate::integrators::strategy::Classes;
use crate::scene::Scene;
use std::collections::HashMap;
use std::sync::Arc;

/// A kind of surface: those that share a material.
pub(super) struct Class<'a> {
    material: &'a Arc<dyn Material>,
    /// Whether it was seen, and scattered evenly wherever that was.
    pub is_even: bool,
    /// Where it was seen first by a camera ray.
    pub pixels: Vec<[u32; 2]>,
}

impl Class<'_> {
    /// Whether a strategy matters to it.
    pub fn scatters(&self) -> bool {
        !self.material.is_delta() && !self.material.is_black()
    }
}

/// What the pixels of a lattice show.
pub(super) struct Seen<'a> {
    pub classes: Vec<Class<'a>>,
    /// The classes of all objects and slots.
    pub of: Classes,
    /// Pixels in whose middle there is no surface.
    pub bare: Vec<[u32; 2]>,
    /// Pixels that outlines run through.
    pub outlined: Vec<[u32; 2]>,
}

impl<'a> Seen<'a> {
    /// Nothing yet.
    pub fn new(scene: &'a Scene) -> Self {
        let mut classes = Vec::new();
        let mut by_address = HashMap::new();
        let of = Classes::by_object(scene.objects.iter().map(|object| {
            let slots = object.materials.iter().map(|material| {
                *by_address.entry(Arc::as_ptr(material).cast::<()>()).or_insert_with(|| {
                    classes.push(Class { material, is_even: false, pixels: Vec::new() });
                    classes.len() as u32 - 1
                })
            });
            slots.collect()
        }));
        Seen { classes, of, bare: Vec::new(), outlined: Vec::new() }
    }

    /// Looks through the middles of `most` pixels or fewer; returns the rays that took.
    pub fn scout(&mut self, scene: &Scene, plan: &PilotPlan, most: usize) -> u64 {
        let rect = plan.pixels;
        let step = ((rect.area() as f64 / most.max(1) as f64).sqrt().ceil() as u32).max(1);
        let lattice = |from: u32, to: u32| (from + step / 2..to).step_by(step as usize);
        let pixels = lattice(rect.y0, rect.y1).flat_map(|y| lattice(rect.x0, rect.x1).map(move |x| [x, y]));
        let (outlined, pixels): (Vec<[u32; 2]>, Vec<[u32; 2]>) =
            pixels.partition(|[x, y]| (plan.is_outline)(*x, *y));
        self.outlined = outlined;
        let coordinate = |axis: usize| pixels.iter().map(|p| p[axis] as f32 + 0.5).collect::<Vec<f32>>();
        let (x, y, half) = (coordinate(0), coordinate(1), vec![0.5; pixels.len()]);
        let lens: &[f32] = if scene.camera.has_lens() { &half } else { &[] };
        let mut rays = RayBatch::default();
        rays.resize(pixels.len());
        scene.camera.fill_rays(&FilmSamples { x: &x, y: &y, lens_u: lens, lens_v: lens }, &mut rays);
        let mut hits = HitBatch::default();
        scene.kernel.intersect_batch(&rays, &mut hits, Coherence::Coherent);
        for (i, pixel) in pixels.iter().enumerate() {
            let Some(hit) = hits.get(i) else {
                self.bare.push(*pixel);
                continue;
            };
            let v = scene.vertex(&rays.get(i), hit, 0.0);
            let Some(number) = self.of.of(v.object, v.slot) else { continue };
            let class = &mut self.classes[number];
            let mut prepared = Prepared::default();
            class.material.prepare(&v, &mut prepared);
            let is_even = class.material.transmission().is_none()
                && class.material.scattering(&prepared).is_some_and(|s| s.facets == 0.0);
            class.is_even = is_even && (class.is_even || class.pixels.is_empty());
            class.pixels.push(*pixel);
        }
        pixels.len() as u64
    }
}
