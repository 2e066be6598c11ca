//! L3: the scene, as plain data ([`desc`]) and as built ([`Scene`]), immutable from then on.

pub mod build;
pub mod desc;
pub mod features;
mod groups;
mod looks;
pub mod registry;

use crate::base::camera::{Camera, FilmSize};
use crate::base::geometry::Geometry;
use crate::base::hit::{Hit, HitBatch};
use crate::base::intersectable::Intersectable;
use crate::base::lanes::LANES;
use crate::base::light::{GuidedLight, Light, LightSampler, PathEnd, Receiver};
use crate::base::material::Material;
use crate::base::ray::{Ray, RayBatch};
use crate::base::shape::Dropped;
use crate::base::space::RenderSpace;
use crate::base::vertex::{Origin, Vertex, local_ray};
use crate::base::vertices::{Met, Vertices};
use crate::color::Rgb;
use desc::Background;
use features::Features;
use glam::Vec3;
use std::collections::HashMap;
use std::sync::Arc;

/// A scene ready to be traced; owns everything, and workers borrow it.
pub struct Scene {
    /// What the kernel was given.
    pub geometry: Arc<Geometry>,
    /// The ray kernel.
    pub kernel: Box<dyn Intersectable>,
    /// Objects, as leaves name them.
    pub objects: Vec<Object>,
    /// All lights.
    pub lights: Lights,
    /// The camera, in render space.
    pub camera: Arc<dyn Camera>,
    /// The film that the camera was placed for: a render of another size would see another part of the scene.
    pub film: FilmSize,
    /// What camera rays that meet nothing show.
    pub background: Background,
    /// From world to render space.
    pub space: RenderSpace,
    /// What this scene needs, decided once.
    pub features: Features,
    /// What was counted while building.
    pub report: BuildReport,
}

/// A placed object's look and name. Objects of one group that is placed many times are one object.
pub struct Object {
    /// Name in the scene file, or made up from its kind.
    pub name: String,
    /// Materials by slot; never empty.
    pub materials: Vec<Arc<dyn Material>>,
    /// Their names and kinds, for people: "clay (diffuse)".
    pub looks: Vec<String>,
}

/// The lights of a scene and the choice between them.
pub struct Lights {
    /// In a fixed order.
    pub list: Vec<Arc<dyn Light>>,
    /// Chooses among `list`.
    pub sampler: Box<dyn LightSampler>,
    /// Those that paths which leave the scene end on.
    pub at_infinity: Vec<u32>,
    /// Whether a material of each object emits.
    pub emitting_objects: Vec<bool>,
    /// The light of each emitting leaf, by instance path.
    pub by_path: HashMap<u64, u32>,
    /// What the first of `list` are, for people; those after them are emitting leaves.
    pub kinds: Vec<String>,
}

/// Counts and times of a build.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct BuildReport {
    /// Triangles handed to the kernel, each instanced mesh once.
    pub triangles: u64,
    /// Other primitives handed to the kernel.
    pub procedurals: u64,
    /// Groups, the root among them.
    pub groups: usize,
    /// Leaf paths: placements of shapes, instances counted each.
    pub paths: u64,
    /// Primitives left out because no ray can hit them.
    pub dropped: Dropped,
    /// Bytes of meshes and other shapes.
    pub geometry_bytes: u64,
    /// Seconds spent on shapes and their places.
    pub scene_seconds: f64,
    /// Seconds that pictures, materials and lights took, beside the kernel.
    pub look_seconds: f64,
    /// Seconds the kernel took to build.
    pub kernel_seconds: f64,
}

/// Rays, what they met, and their width per unit of distance.
#[derive(Clone, Copy)]
pub struct Meetings<'a> {
    /// The rays.
    pub rays: &'a RayBatch,
    /// As many hits.
    pub hits: &'a HitBatch,
    /// Width per unit of distance.
    pub spread: f32,
}

/// Fewer hits of a shape than this are worked out one by one: all lanes together cost as much whatever they hold.
const FEW: usize = 4;

impl Scene {
    /// The surface point of a hit; `spread` is the width of the ray per unit of distance.
    #[inline]
    pub fn vertex(&self, ray: &Ray, hit: Hit, spread: f32) -> Vertex {
        let found = self.geometry.resolve(hit.path);
        let placement = found.placement.as_ref();
        let local = local_ray(ray, placement);
        let surface = found.leaf.shape.refine(&local, hit.prim, hit.t, self.features.needs);
        let material = &self.objects[found.leaf.object as usize].materials;
        let slot = if material.len() > 1 { found.leaf.shape.material_slot(hit.prim) } else { 0 };
        Vertex::new(
            ray,
            &surface,
            placement,
            Origin { hit, object: found.leaf.object, slot: slot as u32, spread },
        )
    }

    /// The surface points of the first of the hits `which` (none of them a miss), in lanes of `out`, and how many they
    /// are: at least 1, if there is any. The same bits as from [`Scene::vertex`].
    pub fn vertices(&self, met: &Meetings, which: &[u32], out: &mut Vertices) -> usize {
        let Meetings { rays, hits, spread } = *met;
        let Some(&first) = which.first() else { return 0 };
        let path = hits.path[first as usize];
        let same = which.iter().take(LANES).take_while(|i| hits.path[**i as usize] == path);
        let n = same.count();
        if n < FEW {
            for (lane, &i) in which[..n].iter().enumerate() {
                let i = i as usize;
                let hit = Hit { t: hits.t[i], prim: hits.prim[i], path };
                out.set(lane, &self.vertex(&rays.get(i), hit, spread));
            }
            return n;
        }
        let found = self.geometry.resolve(path);
        let met = Met {
            shape: &*found.leaf.shape,
            placement: found.placement.as_ref(),
            object: found.leaf.object,
            many_slots: self.objects[found.leaf.object as usize].materials.len() > 1,
            spread,
            needs: self.features.needs,
        };
        out.find(rays, hits, &which[..n], &met);
        n
    }

    /// The material at a vertex.
    #[inline]
    pub fn material(&self, v: &Vertex) -> &dyn Material {
        self.material_of(v.object, v.slot)
    }

    /// The material in a slot of an object.
    #[inline]
    pub fn material_of(&self, object: u32, slot: u32) -> &dyn Material {
        self.objects[object as usize].materials[slot as usize].as_ref()
    }
}

impl Lights {
    /// The light at infinity that takes surfaces into account, if there is one, and its index.
    #[inline]
    pub fn guided(&self) -> Option<(u32, &dyn GuidedLight)> {
        self.at_infinity.iter().find_map(|&i| self.list[i as usize].guided().map(|g| (i, g)))
    }

    /// The light that a vertex lies on.
    #[inline]
    pub fn of_vertex(&self, v: &Vertex) -> Option<u32> {
        // Most vertices lie on nothing that emits, and need not be looked for.
        if self.is_emitting(v.object) { self.by_path.get(&v.path).copied() } else { None }
    }

    /// Whether a material of an object emits.
    #[inline]
    pub fn is_emitting(&self, object: u32) -> bool {
        self.emitting_objects.get(object as usize).is_some_and(|emits| *emits)
    }

    /// What paths which leave the scene end on, if it is the same in all directions.
    pub fn le_everywhere(&self) -> Option<Rgb> {
        let mut each = self.at_infinity.iter().map(|&i| self.list[i as usize].le_everywhere());
        each.try_fold(Rgb::BLACK, |sum, le| Some(sum + le?))
    }

    /// Whether that varies without detail in these directions; see [`Light::is_smooth`].
    pub fn is_smooth(&self, axis: Vec3, half_angle: f32) -> bool {
        let constant_or_smooth = |l: &dyn Light| l.le_everywhere().is_some() || l.is_smooth(axis, half_angle);
        self.at_infinity.iter().all(|&i| constant_or_smooth(&*self.list[i as usize]))
    }

    /// Density per solid angle with which light sampling from `from` finds `end` on `light`, choice of light included.
    #[inline]
    pub fn pdf(&self, light: u32, end: &PathEnd, from: &Receiver) -> f32 {
        // One light needs no choice.
        let pmf = if self.list.len() == 1 { 1.0 } else { self.sampler.pmf(from, light) };
        pmf * self.list[light as usize].pdf_li(from, end)
    }
}
