//! From a description to a scene: groups are measured and recentred in double precision, shapes placed, and the kernel
//! built while `scene::looks` makes what is seen of them. Everything open goes through the families' registry tables.

use super::desc::{ObjectDesc, SceneDesc};
use super::groups::{GroupPlan, PlannedGroup, PlannedShape, build_sources, plan_groups};
use super::looks::{Looks, MaterialTable, PlacedObject};
use super::registry::Registry;
use super::{BuildReport, Scene};
use crate::accel;
use crate::base::camera::{CameraSource, FilmSize};
use crate::base::geometry::{Child, Geometry, Group, Leaf};
use crate::base::intersectable::KernelOptions;
use crate::base::registry::build as build_node;
use crate::cameras;
use crate::error::{Error, Result};
use crate::math::aabb::DAabb;
use glam::DAffine3;
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// What is chosen beside the scene itself.
#[derive(Debug, Clone)]
pub struct BuildOptions {
    /// Name of the kernel, or `auto`.
    pub backend: String,
    /// See [`KernelOptions`].
    pub kernel: KernelOptions,
}

impl Default for BuildOptions {
    fn default() -> Self {
        BuildOptions { backend: "auto".into(), kernel: KernelOptions::default() }
    }
}

/// Builds a scene of the kinds that this crate registers.
///
/// # Errors
/// Those of [`build_with`].
pub fn build(desc: SceneDesc, options: &BuildOptions) -> Result<Scene> {
    build_with(desc, options, &Registry::default())
}

/// Builds a scene of the kinds in `registry`.
///
/// # Errors
/// [`Error::Content`] at the place of a node whose kind, parameters or references cannot be used; [`Error::Usage`] for
/// a scene with nothing to show, an unknown kernel, or more than can be represented.
pub fn build_with(mut desc: SceneDesc, options: &BuildOptions, registry: &Registry) -> Result<Scene> {
    let start = Instant::now();
    if desc.objects.is_empty() && desc.sky.is_none() && desc.lights.is_empty() {
        return Err(Error::Usage("the scene is empty: it has no object, no light and no sky".into()));
    }
    let materials = MaterialTable::check(&desc, registry)?;
    let sources = build_sources(&mut desc, &registry.shapes)?;
    let plan = plan_groups(&desc, sources)?;
    let space = plan.render_space();
    let [width, height] = desc.film.size;
    let film = FilmSize { width, height };
    let camera = build_camera(&desc, &plan, film, registry)?.place(&space, film)?;
    let mut objects = ObjectTable { materials: &materials, objects: Vec::new() };
    let mut report = BuildReport { groups: plan.groups.len(), ..BuildReport::default() };
    let has_objects = plan.has_objects;
    let geometry = Arc::new(place_groups(plan, &mut objects, &mut report)?);
    match desc.objects.first() {
        Some(first) if has_objects && geometry.root().paths == 0 => {
            let message = format!("nothing in the scene can be rendered: left out are {}", report.dropped);
            return Err(Error::Content { place: first.place.clone(), message });
        }
        Some(_) => {}
        None => log::warn!("the scene has no object: the picture shows what is behind objects"),
    }
    let objects = objects.objects;
    report.paths = geometry.root().paths;
    report.scene_seconds = start.elapsed().as_secs_f64();
    let kernel = || timed(|| accel::build_kernel(&options.backend, geometry.clone(), &options.kernel));
    let looks = || timed(|| Looks::build(&desc, objects, (&geometry, &space), registry));
    // The kernel asks for shapes alone: pictures are decoded and lights gathered beside it.
    let ((kernel, kernel_seconds), (looks, look_seconds)) = rayon::join(kernel, looks);
    (report.kernel_seconds, report.look_seconds) = (kernel_seconds, look_seconds);
    let (kernel, Looks { objects, lights, features }) = (kernel?, looks?);
    Ok(Scene {
        geometry,
        kernel,
        objects,
        lights,
        camera,
        film,
        background: desc.background,
        space,
        features,
        report,
    })
}

/// What `work` gives, and the seconds it took.
fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = Instant::now();
    let value = work();
    (value, start.elapsed().as_secs_f64())
}

fn build_camera(
    desc: &SceneDesc,
    plan: &GroupPlan,
    film: FilmSize,
    registry: &Registry,
) -> Result<Arc<dyn CameraSource>> {
    let framed;
    let node = match &desc.camera {
        Some(node) => node,
        None => {
            framed = cameras::frame(&plan.world_bounds(), &|d| plan.support(d), &desc.view, film);
            &framed
        }
    };
    build_node("camera", &registry.cameras, node)
}

/// The scene's objects as they are found, with their materials.
struct ObjectTable<'a> {
    materials: &'a MaterialTable,
    objects: Vec<PlacedObject>,
}

impl ObjectTable<'_> {
    fn add(&mut self, o: &ObjectDesc, kind: &str) -> Result<u32> {
        let number = self.objects.len();
        let name = if o.name.is_empty() { format!("{kind} {number}") } else { o.name.clone() };
        let materials =
            o.materials.iter().map(|m| self.materials.find(m, &o.place)).collect::<Result<_>>()?;
        self.objects.push(PlacedObject { name, materials, place: o.place.clone() });
        Ok(number as u32)
    }
}

/// Places every shape in its group's recentred space.
fn place_groups(plan: GroupPlan, objects: &mut ObjectTable, report: &mut BuildReport) -> Result<Geometry> {
    let mut geometry = Geometry::default();
    let to_local: Vec<DAffine3> = plan.groups.iter().map(|g| g.to_local).collect();
    for group in plan.groups {
        let PlannedGroup { shapes, children, to_local: to_group, .. } = group;
        let mut out = place_shapes(shapes, &to_group, objects, report)?;
        for c in &children {
            let child = &geometry.groups[c.group];
            if child.paths == 0 {
                continue;
            }
            let to_parent = to_group * c.transform * to_local[c.group].inverse();
            let first_path = out.paths;
            out.paths = out.paths.checked_add(child.paths).ok_or_else(|| Error::Content {
                place: c.place.clone(),
                message: "groups within groups make more than 2^64 placed shapes".into(),
            })?;
            let bounds = DAabb::from(child.bounds).transformed(&to_parent).to_f32();
            out.bounds = out.bounds.union(bounds);
            let from_parent = to_parent.inverse();
            out.children.push(Child { group: c.group, to_parent, from_parent, first_path });
        }
        geometry.groups.push(out);
    }
    Ok(geometry)
}

/// The leaves of one group.
fn place_shapes(
    shapes: Vec<PlannedShape>,
    to_group: &DAffine3,
    objects: &mut ObjectTable,
    report: &mut BuildReport,
) -> Result<Group> {
    let placed = shapes
        .into_par_iter()
        .map(|s| Ok((s.object, s.kind, s.source.place(&(*to_group * s.transform))?)))
        .collect::<Result<Vec<_>>>()?;
    let mut out = Group::default();
    for (object, kind, placed) in placed {
        report.dropped = report.dropped + placed.dropped;
        let shape = placed.shape;
        if shape.primitive_count() == 0 {
            log::warn!("{kind} {}: nothing of it can be hit; left out are {}", object.name, placed.dropped);
            continue;
        }
        report.geometry_bytes += shape.memory();
        match shape.triangles() {
            Some(t) => report.triangles += t.indices.len() as u64,
            None => report.procedurals += shape.primitive_count() as u64,
        }
        out.bounds = out.bounds.union(shape.bounds());
        let object = objects.add(object, kind)?;
        out.leaves.push(Leaf { shape, filter: None, object });
    }
    out.paths = out.leaves.len() as u64;
    Ok(out)
}
