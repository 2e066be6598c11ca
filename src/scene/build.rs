//! From a description to a scene: groups are measured and recentred in double precision, shapes placed, lights
//! gathered, and the kernel built. Everything open goes through the families' registry tables.

use super::desc::{ObjectDesc, SceneDesc};
use super::features::Features;
use super::groups::{GroupPlan, PlannedGroup, PlannedShape, build_sources, plan_groups};
use super::registry::Registry;
use super::{BuildReport, Lights, Object, Scene};
use crate::accel;
use crate::base::camera::{CameraSource, FilmSize};
use crate::base::geometry::{Child, Geometry, Group, Leaf};
use crate::base::intersectable::KernelOptions;
use crate::base::light::Extent;
use crate::base::material::Material;
use crate::base::registry::{Node, Params, Value, build as build_node};
use crate::base::space::RenderSpace;
use crate::error::{Error, Result, unknown_name};
use crate::lights::area::AreaLight;
use crate::math::aabb::DAabb;
use crate::{cameras, lights, skyboxes};
use glam::DAffine3;
use rayon::prelude::*;
use std::collections::HashMap;
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

/// More emitting placements than this are refused: each is a light with a table of its own.
const MAX_AREA_LIGHTS: usize = 1 << 20;

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
    let named = build_materials(&desc, registry)?;
    let sources = build_sources(&mut desc, &registry.shapes)?;
    let plan = plan_groups(&desc, sources)?;
    let space = plan.render_space();
    let [width, height] = desc.film.size;
    let film = FilmSize { width, height };
    let camera = build_camera(&desc, &plan, film, registry)?.place(&space, film)?;
    let mut objects = ObjectTable { named: &named, registry, objects: Vec::new() };
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
    let root = geometry.root();
    report.paths = root.paths;
    let built = Placed { geometry: &geometry, objects: &objects, space: &space };
    let lights = gather_lights(&desc, &built, registry)?;
    let features = Features {
        needs: objects.iter().flat_map(|o| &o.materials).fold(Default::default(), |n, m| m.needs().or(n)),
        emitting_surfaces: !lights.by_path.is_empty(),
        many_lights: lights.list.len() > 1,
        material_slots: objects.iter().any(|o| o.materials.len() > 1),
    };
    report.scene_seconds = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let kernel = accel::build_kernel(&options.backend, geometry.clone(), &options.kernel)?;
    report.kernel_seconds = start.elapsed().as_secs_f64();
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

type Materials = HashMap<String, Arc<dyn Material>>;

fn build_materials(desc: &SceneDesc, registry: &Registry) -> Result<Materials> {
    let mut named = Materials::new();
    for m in &desc.materials {
        let node = with_textures(&m.value, registry)?;
        let built = build_node("material", &registry.materials, &node)?;
        if named.insert(m.name.clone(), built).is_some() {
            return Err(Error::Content {
                place: m.place.clone(),
                message: format!("there are two materials named \"{}\"", m.name),
            });
        }
    }
    Ok(named)
}

/// The node with every nested texture built.
fn with_textures(node: &Node, registry: &Registry) -> Result<Node> {
    let mut node = node.clone();
    for p in &mut node.params.list {
        if let Value::Node(texture) = &p.value {
            p.value = Value::Texture(build_node("texture", &registry.textures, texture)?);
        }
    }
    Ok(node)
}

/// The scene's objects as they are found, with their materials.
struct ObjectTable<'a> {
    named: &'a Materials,
    registry: &'a Registry,
    objects: Vec<Object>,
}

impl ObjectTable<'_> {
    fn add(&mut self, o: &ObjectDesc, kind: &str) -> Result<u32> {
        let mut materials = Vec::with_capacity(o.materials.len().max(1));
        for name in &o.materials {
            materials.push(self.named.get(name).cloned().ok_or_else(|| Error::Content {
                place: o.place.clone(),
                message: unknown_name("material", name, self.named.keys().map(String::as_str)),
            })?);
        }
        if materials.is_empty() {
            let neutral = Node { kind: "diffuse".into(), params: Params::new(), place: o.place.clone() };
            materials.push(build_node("material", &self.registry.materials, &neutral)?);
        }
        let number = self.objects.len();
        let name = if o.name.is_empty() { format!("{kind} {number}") } else { o.name.clone() };
        self.objects.push(Object { name, materials });
        Ok(self.objects.len() as u32 - 1)
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

/// What lights have to know of the scene they shine on.
struct Placed<'a> {
    geometry: &'a Geometry,
    objects: &'a [Object],
    space: &'a RenderSpace,
}

fn gather_lights(desc: &SceneDesc, placed: &Placed, registry: &Registry) -> Result<Lights> {
    let mut list: Vec<Arc<dyn crate::base::light::Light>> = Vec::new();
    if let Some(sky) = &desc.sky {
        let preset = skyboxes::presets::expand(&sky.node);
        let skybox = build_node("sky", &registry.skies, preset.as_ref().unwrap_or(&sky.node))?;
        list.push(Arc::new(lights::sky::SkyLight::new(
            skybox,
            &lights::sky::SkyOptions {
                intensity: sky.intensity,
                rotate_y_deg: sky.rotate_y_deg,
                sampling: sky.sampling.as_deref().map(str::parse).transpose()?.unwrap_or_default(),
            },
        )?));
    }
    for node in &desc.lights {
        let source = build_node("light", &registry.lights, node)?;
        list.push(source.place(placed.space)?);
    }
    let mut by_path = HashMap::new();
    if placed.objects.iter().flat_map(|o| &o.materials).any(|m| m.emitter().is_some()) {
        add_area_lights(placed.geometry, placed.objects, &mut list, &mut by_path)?;
    }
    let at_infinity = (0..list.len() as u32).filter(|&i| list[i as usize].at_infinity()).collect();
    let bounds = placed.geometry.root().bounds;
    let extent = Extent { center: bounds.center(), radius: bounds.radius().max(1e-3) };
    let name = desc.render.light_sampler.as_deref().unwrap_or(lights::sampler::NAMES[0].0);
    let sampler = lights::sampler::by_name(name, &list, &extent)?;
    Ok(Lights { list, sampler, at_infinity, by_path })
}

/// One light for every placement of an emitting leaf, its shape baked into render space for sampling.
fn add_area_lights(
    geometry: &Geometry,
    objects: &[Object],
    list: &mut Vec<Arc<dyn crate::base::light::Light>>,
    by_path: &mut HashMap<u64, u32>,
) -> Result<()> {
    let mut failure = None;
    geometry.for_each_path(&mut |path, leaf, placement| {
        let materials = &objects[leaf.object as usize].materials;
        if materials.iter().all(|m| m.emitter().is_none()) {
            return true;
        }
        let shape = match placement {
            None => Ok(leaf.shape.clone()),
            Some(p) => leaf.shape.transformed(&p.to_render),
        };
        let light = match shape {
            Ok(shape) => AreaLight::new(shape, materials.clone()),
            Err(e) => {
                failure = Some(e);
                return false;
            }
        };
        let Some(light) = light else { return true };
        if by_path.len() >= MAX_AREA_LIGHTS {
            failure = Some(Error::Usage(format!("more than {MAX_AREA_LIGHTS} emitting objects")));
            return false;
        }
        by_path.insert(path, list.len() as u32);
        list.push(Arc::new(light));
        true
    });
    failure.map_or(Ok(()), Err)
}
