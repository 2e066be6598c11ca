//! Layers beside the picture, read from the surfaces that the camera sees.

use super::film_layers;
use crate::base::intersectable::QueryKind;
use crate::base::ray::Ray;
use crate::error::{Error, Result, unknown_name};
use crate::integrators::FirstHit;
use crate::scene::Scene;

/// How a pixel's values are brought together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Combine {
    /// Mean over the samples that hit something.
    Mean,
    /// What the ray through the pixel's centre meets, for values that cannot be averaged. No sample's: which object a sample
    /// met tells something of the sample, and pixels that are chosen by it have another mean.
    Centre,
}

/// A registered layer.
pub struct AovRow {
    /// Name on the command line and prefix of its channels in a file.
    pub name: &'static str,
    /// One line for `skylit list`.
    pub doc: &'static str,
    /// Channel suffixes, at most four.
    pub channels: &'static [&'static str],
    /// Whether half precision would lose what matters.
    pub full_precision: bool,
    /// See [`Combine`].
    pub combine: Combine,
    /// The value at a surface that the camera sees; as many entries count as there are channels.
    pub eval: fn(&FirstHit, &Scene) -> [f32; 4],
}

/// Every layer that reads such surfaces. [`film_layers`] holds those of the film itself.
pub static REGISTRY: &[AovRow] = &[
    AovRow {
        name: "albedo",
        doc: "reflectance of the first surface, for denoisers",
        channels: &["R", "G", "B"],
        full_precision: false,
        combine: Combine::Mean,
        eval: |h, _| [h.albedo.r, h.albedo.g, h.albedo.b, 0.0],
    },
    AovRow {
        name: "normal",
        doc: "unit shading normal in world axes, towards the viewer's side",
        channels: &["X", "Y", "Z"],
        full_precision: false,
        combine: Combine::Mean,
        eval: |h, _| {
            let n = h.vertex.receiver().ns;
            [n.x, n.y, n.z, 0.0]
        },
    },
    AovRow {
        name: "depth",
        doc: "distance from the camera along the ray, metres",
        channels: &["Z"],
        full_precision: true,
        combine: Combine::Mean,
        eval: |h, scene| [scene.space.world_length(f64::from(h.vertex.t)) as f32, 0.0, 0.0, 0.0],
    },
    AovRow {
        name: "position",
        doc: "point in world space, metres",
        channels: &["X", "Y", "Z"],
        full_precision: true,
        combine: Combine::Mean,
        eval: |h, scene| {
            let p = scene.space.world_point(h.vertex.p.as_dvec3()).as_vec3();
            [p.x, p.y, p.z, 0.0]
        },
    },
    AovRow {
        name: "id",
        doc: "number of the object at the pixel's centre, from 1 in the order of `skylit info`; 0 where there is none",
        channels: &["V"],
        full_precision: true,
        combine: Combine::Centre,
        eval: |h, _| [h.vertex.object as f32 + 1.0, 0.0, 0.0, 0.0],
    },
    AovRow {
        name: "visits",
        doc: "nodes, leaves and primitives that the kernel visits for the camera ray; 0 where it does not count",
        channels: &["nodes", "leaves", "primitives"],
        full_precision: true,
        combine: Combine::Mean,
        eval: |h, scene| {
            let v = &h.vertex;
            // The camera ray again, from its end: for a count, roundings do not matter.
            let ray = Ray::new(v.p + v.wo * v.t, -v.wo, 0);
            let n = scene.kernel.visits(&ray, QueryKind::Closest).unwrap_or_default();
            [n.nodes as f32, n.leaves as f32, n.primitives as f32, 0.0]
        },
    },
];

/// Finds layers by their names; the film's own are left out.
pub fn find(names: &[&str]) -> Result<Vec<&'static AovRow>> {
    let known = || REGISTRY.iter().map(|r| r.name).chain(film_layers::REGISTRY.iter().map(|f| f.name));
    let mut rows = Vec::new();
    for &name in names {
        match REGISTRY.iter().find(|r| r.name == name) {
            Some(row) => rows.push(row),
            None if film_layers::REGISTRY.iter().any(|f| f.name == name) => {}
            None => return Err(Error::Usage(unknown_name("layer", name, known()))),
        }
    }
    Ok(rows)
}
