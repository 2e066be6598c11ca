//! L2: ray kernels. One file (or folder) a kernel, and one row in [`KERNELS`].

#[cfg(all(feature = "bvh", feature = "embree"))]
mod auto;
pub mod brute;
#[cfg(feature = "bvh")]
pub mod bvh;
#[cfg(feature = "embree")]
pub mod embree;
#[cfg(any(feature = "bvh", feature = "embree"))]
mod failure;
#[cfg(feature = "bvh")]
pub mod obvhs;
#[cfg(any(feature = "bvh", feature = "embree"))]
mod tame;
#[cfg(test)]
mod tests;

use crate::base::geometry::{Geometry, Leaf};
use crate::base::hit::Hit;
use crate::base::intersectable::{Intersectable, KernelOptions};
use crate::base::ray::Ray;
use crate::base::shape::LocalRay;
use crate::error::{Error, Result, unknown_name};
use crate::memory;
use glam::DAffine3;
use std::sync::Arc;

/// Builds a kernel over a geometry that has at least its root group.
pub type BuildKernel = fn(Arc<Geometry>, &KernelOptions) -> Result<Box<dyn Intersectable>>;

/// A kernel that can be asked for by name.
pub struct KernelRow {
    /// Its name on the command line.
    pub name: &'static str,
    /// One line for people.
    pub doc: &'static str,
    /// Most bytes that it takes for each primitive while it is built, measured on 3,000,000 triangles.
    pub build_bytes: u64,
    /// Builds it.
    pub build: BuildKernel,
}

/// All kernels of this build. Where there is no choice to make, `auto` is the first.
pub const KERNELS: &[KernelRow] = &[
    #[cfg(feature = "bvh")]
    bvh::ROW,
    #[cfg(feature = "embree")]
    embree::ROW,
    #[cfg(feature = "bvh")]
    obvhs::ROW,
    brute::ROW,
];

/// Builds the kernel of this name; "auto" is the in-house one, unless Embree is found to be faster. Errors for an unknown name, and where the kernel
/// cannot hold the geometry.
pub fn build_kernel(
    name: &str,
    geometry: Arc<Geometry>,
    o: &KernelOptions,
) -> Result<Box<dyn Intersectable>> {
    if geometry.groups.is_empty() {
        return Err(Error::Internal("a geometry without its root group".to_owned()));
    }
    let row = KERNELS.iter().find(|k| k.name == name).or_else(|| KERNELS.first().filter(|_| name == "auto"));
    let known = ["auto"].into_iter().chain(KERNELS.iter().map(|k| k.name));
    let row = row.ok_or_else(|| Error::Usage(unknown_name("backend", name, known)))?;
    // Of `auto` the in-house one is built first, and Embree answers for its own.
    let primitives =
        geometry.groups.iter().flat_map(|g| &g.leaves).map(|l| u64::from(l.shape.primitive_count()));
    let primitives: u64 = primitives.sum();
    let what = || format!("a ray kernel over {primitives} primitives");
    let _room = memory::room(primitives.saturating_mul(row.build_bytes), what)?;
    #[cfg(all(feature = "bvh", feature = "embree"))]
    if name == "auto" {
        return auto::build(geometry, o);
    }
    (row.build)(geometry, o)
}

impl LocalRay {
    /// A ray of render space in double precision.
    #[inline]
    fn from_ray(r: &Ray) -> Self {
        let (o, d) = (r.o.as_dvec3(), r.d.as_dvec3());
        LocalRay { o, d, tnear: f64::from(r.tnear), tfar: f64::from(r.tfar) }
    }

    /// The same segment in another space; t keeps its meaning.
    #[inline]
    fn transformed(&self, by: &DAffine3) -> Self {
        LocalRay { o: by.transform_point3(self.o), d: by.transform_vector3(self.d), ..*self }
    }

    /// Rounded to single precision.
    fn to_ray(self, key: u32) -> Ray {
        let (o, d) = (self.o.as_vec3(), self.d.as_vec3());
        Ray { o, d, tnear: self.tnear as f32, tfar: self.tfar as f32, key }
    }
}

/// Whether the leaf's filter lets a hit of `ray` (in the space of the leaf's group) stand. The filter sees a ray that
/// ends at the hit, as what lies beyond differs from kernel to kernel.
pub fn accepted(leaf: &Leaf, ray: &LocalRay, hit: &Hit, key: u32) -> bool {
    leaf.filter.as_ref().is_none_or(|f| f.accept(&Ray { tfar: hit.t, ..ray.to_ray(key) }, hit))
}

/// Crossings of one primitive that a filter may refuse before the primitive counts as missed: quadrics have two.
const MAX_CROSSINGS: usize = 16;

/// The first crossing of a primitive that its leaf's filter lets stand, by the shape's own test in double precision.
#[inline]
fn first_crossing(leaf: &Leaf, ray: &LocalRay, prim: u32, path: u64, key: u32) -> Option<f64> {
    let mut t = leaf.shape.intersect(ray, prim)?;
    if leaf.filter.is_none() {
        return Some(t);
    }
    for _ in 0..MAX_CROSSINGS {
        if accepted(leaf, ray, &Hit { t: t as f32, prim, path }, key) {
            return Some(t);
        }
        t = leaf.shape.intersect(&LocalRay { tnear: t.next_up(), ..*ray }, prim)?;
    }
    None
}
