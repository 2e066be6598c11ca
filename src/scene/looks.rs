//! What is seen of a scene's shapes: pictures, materials and lights. Made beside the kernel, which asks for none of it;
//! a picture is decoded only where an object, a light or the sky that stays shows it.

use super::desc::{Named, SceneDesc};
use super::features::Features;
use super::registry::Registry;
use super::{Lights, Object};
use crate::base::deferred::Deferred;
use crate::base::geometry::Geometry;
use crate::base::image_data::ImageData;
use crate::base::light::{Extent, Light};
use crate::base::material::Material;
use crate::base::registry::{Node, Params, Value, build as build_node, find};
use crate::base::space::RenderSpace;
use crate::error::{Error, Place, Result, unknown_name};
use crate::lights::area::{self, AreaLight};
use crate::memory;
use crate::{lights, skyboxes};
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// More emitting placements than this are refused: each is a light with a table of its own.
const MAX_AREA_LIGHTS: usize = 1 << 20;

/// What stands for an object that names no material.
const NEUTRAL: &str = "diffuse";

/// The scene's materials before their pictures are decoded.
pub(super) struct MaterialTable {
    numbers: HashMap<String, usize>,
}

/// An object whose shape is placed.
pub(super) struct PlacedObject {
    pub name: String,
    /// By slot, as numbers in the table; none for the neutral material.
    pub materials: Vec<usize>,
    pub place: Place,
}

impl MaterialTable {
    /// Finds what is wrong with the materials, but for their pictures, before any shape is placed.
    pub fn check(desc: &SceneDesc, registry: &Registry) -> Result<Self> {
        let mut numbers = HashMap::new();
        for (number, Named { name, value, place }) in desc.materials.iter().enumerate() {
            find("material", &registry.materials, value)?;
            for texture in value.params.list.iter().filter_map(|p| as_node(&p.value)) {
                find("texture", &registry.textures, texture)?;
            }
            if pictures(value).is_empty() {
                build_material(value, registry)?;
            }
            if numbers.insert(name.clone(), number).is_some() {
                let message = format!("there are two materials named \"{name}\"");
                return Err(Error::Content { place: place.clone(), message });
            }
        }
        Ok(MaterialTable { numbers })
    }

    /// The number of the material that `place` names.
    pub fn find(&self, name: &str, place: &Place) -> Result<usize> {
        self.numbers.get(name).copied().ok_or_else(|| Error::Content {
            place: place.clone(),
            message: unknown_name("material", name, self.numbers.keys().map(String::as_str)),
        })
    }
}

fn as_node(value: &Value) -> Option<&Node> {
    match value {
        Value::Node(node) => Some(node),
        _ => None,
    }
}

/// Materials by slot of every object, lights, and what of them the render needs.
pub(super) struct Looks {
    pub objects: Vec<Object>,
    pub lights: Lights,
    pub features: Features,
}

impl Looks {
    /// Decodes the pictures that are used, and builds the materials of `objects` and all lights.
    pub fn build(
        desc: &SceneDesc,
        objects: Vec<PlacedObject>,
        (geometry, space): (&Geometry, &RenderSpace),
        registry: &Registry,
    ) -> Result<Self> {
        let mut used: Vec<usize> = objects.iter().flat_map(|o| o.materials.iter().copied()).collect();
        used.sort_unstable();
        used.dedup();
        let materials = used.iter().map(|&m| &desc.materials[m].value);
        decode(materials.chain(desc.sky.iter().map(|s| &s.node)).chain(&desc.lights))?;
        let mut built: HashMap<usize, Arc<dyn Material>> = HashMap::new();
        for m in used {
            built.insert(m, build_material(&desc.materials[m].value, registry)?);
        }
        let dressed = objects.into_iter().map(|o| dress(o, desc, &built, registry));
        let objects = dressed.collect::<Result<Vec<_>>>()?;
        let lights = gather_lights(&Placed { geometry, objects: &objects, space }, desc, registry)?;
        let features = Features {
            needs: objects.iter().flat_map(|o| &o.materials).fold(Default::default(), |n, m| m.needs().or(n)),
            emitting_surfaces: !lights.by_path.is_empty(),
            many_lights: lights.list.len() > 1,
            sampled_lights: lights.list.iter().any(|l| l.is_sampled()),
            material_slots: objects.iter().any(|o| o.materials.len() > 1),
        };
        Ok(Looks { objects, lights, features })
    }
}

fn dress(
    object: PlacedObject,
    desc: &SceneDesc,
    built: &HashMap<usize, Arc<dyn Material>>,
    registry: &Registry,
) -> Result<Object> {
    let mut materials: Vec<Arc<dyn Material>> = object.materials.iter().map(|m| built[m].clone()).collect();
    let look = |m: &Named<Node>| format!("{} ({})", m.name, m.value.kind);
    let mut looks: Vec<String> = object.materials.iter().map(|m| look(&desc.materials[*m])).collect();
    if materials.is_empty() {
        let neutral = Node { kind: NEUTRAL.into(), params: Params::new(), place: object.place };
        materials.push(build_node("material", &registry.materials, &neutral)?);
        looks.push(NEUTRAL.to_owned());
    }
    Ok(Object { name: object.name, materials, looks })
}

/// A material, every nested texture built first.
fn build_material(node: &Node, registry: &Registry) -> Result<Arc<dyn Material>> {
    let mut node = node.clone();
    for p in &mut node.params.list {
        if let Value::Node(texture) = &p.value {
            p.value = Value::Texture(build_node("texture", &registry.textures, texture)?);
        }
    }
    build_node("material", &registry.materials, &node)
}

/// A picture of a node, or six.
enum Pictures<'a> {
    Image(&'a Deferred<ImageData>),
    Faces(&'a Deferred<[ImageData; 6]>),
}

impl Pictures<'_> {
    /// Of what takes the work of decoding.
    fn address(&self) -> usize {
        match self {
            Pictures::Image(image) => image.origin().address(),
            Pictures::Faces(faces) => faces.origin().address(),
        }
    }

    fn decode(&self) -> Result<()> {
        match self {
            Pictures::Image(image) => image.get().map(drop),
            Pictures::Faces(faces) => faces.get().map(drop),
        }
    }
}

/// All pictures of a node and of those within it.
fn pictures(node: &Node) -> Vec<Pictures<'_>> {
    let mut all = Vec::new();
    for p in &node.params.list {
        match &p.value {
            Value::Image(image) => all.push(Pictures::Image(image)),
            Value::Faces(faces) => all.push(Pictures::Faces(faces)),
            Value::Node(node) => all.extend(pictures(node)),
            _ => {}
        }
    }
    all
}

/// Decodes the pictures of these nodes side by side, each once.
///
/// # Errors
/// That of the first picture, in the order of the nodes, that cannot be decoded.
fn decode<'a>(nodes: impl Iterator<Item = &'a Node>) -> Result<()> {
    let mut seen = HashSet::new();
    let all: Vec<Pictures> = nodes.flat_map(pictures).filter(|p| seen.insert(p.address())).collect();
    let outcomes: Vec<Result<()>> = all.par_iter().map(Pictures::decode).collect();
    outcomes.into_iter().collect()
}

/// What lights have to know of the scene they shine on.
struct Placed<'a> {
    geometry: &'a Geometry,
    objects: &'a [Object],
    space: &'a RenderSpace,
}

fn gather_lights(placed: &Placed, desc: &SceneDesc, registry: &Registry) -> Result<Lights> {
    let (mut list, mut kinds): (Vec<Arc<dyn Light>>, Vec<String>) = Default::default();
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
        kinds.push(format!("sky ({})", sky.node.kind));
    }
    for node in &desc.lights {
        let source = build_node("light", &registry.lights, node)?;
        list.push(source.place(placed.space)?);
        kinds.push(format!("light {} ({})", list.len() - 1, node.kind));
    }
    let mut shines = list.iter().map(|light| !light.is_black());
    kinds.retain(|_| shines.next().unwrap_or(true));
    list.retain(|light| !light.is_black());
    let mut by_path = HashMap::new();
    let emits = |o: &Object| o.materials.iter().any(|m| m.emitter().is_some());
    let emitting_objects: Vec<bool> = placed.objects.iter().map(emits).collect();
    if emitting_objects.contains(&true) {
        add_area_lights(placed.geometry, placed.objects, &mut list, &mut by_path)?;
    }
    let at_infinity = (0..list.len() as u32).filter(|&i| list[i as usize].at_infinity()).collect();
    let bounds = placed.geometry.root().bounds;
    let extent = Extent { center: bounds.center(), radius: bounds.radius().max(1e-3) };
    let name = desc.render.light_sampler.as_deref().unwrap_or(lights::sampler::NAMES[0].0);
    let sampler = lights::sampler::by_name(name, &list, &extent)?;
    Ok(Lights { list, sampler, at_infinity, emitting_objects, by_path, kinds })
}

/// One light for every placement of an emitting leaf, its shape baked into render space for sampling.
fn add_area_lights(
    geometry: &Geometry,
    objects: &[Object],
    list: &mut Vec<Arc<dyn Light>>,
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
        let light = shape.and_then(|shape| {
            let primitives = shape.primitive_count();
            let bytes = u64::from(primitives) * area::BYTES_PER_PRIMITIVE;
            let _room = memory::room(bytes, || format!("a lamp of {primitives} primitives"))?;
            Ok(AreaLight::new(shape, materials.clone()))
        });
        let light = match light {
            Ok(light) => light,
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
