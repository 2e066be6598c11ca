//! Objects: what is placed, of which material, where.

use super::Reader;
use super::transform::transform;
use super::tree::{Data, Source, Table, Tree};
use super::values::Section;
use crate::base::mesh_data::MeshData;
use crate::base::registry::{Node, Value};
use crate::error::{Result, unknown_name};
use crate::formats::mesh_scene::material_library;
use crate::scene::desc::{Content, ObjectDesc};
use glam::DAffine3;
use std::collections::HashSet;
use std::sync::Arc;

const KEYS: &[&str] = &["name", "shape", "group", "material", "materials", "transform"];

/// The names that objects may refer to. They may stand anywhere in the file.
pub(super) struct Names<'t> {
    materials: HashSet<&'t str>,
    groups: HashSet<&'t str>,
}

impl<'t> Names<'t> {
    pub fn of(source: &Source, root: &'t Table) -> Result<Self> {
        let names = |section: &str| -> Result<HashSet<&'t str>> {
            match root.get(section) {
                None => Ok(HashSet::new()),
                Some(v) => Ok(source.table(section, v)?.entries.iter().map(|e| e.key.as_str()).collect()),
            }
        };
        Ok(Names { materials: names("materials")?, groups: names("groups")? })
    }
}

/// A name that `v` must be one of; hints list them in order.
fn known(source: &Source, what: &str, v: &Tree, names: &HashSet<&str>) -> Result<String> {
    let name = source.text(what, v)?;
    if names.contains(name) {
        return Ok(name.to_owned());
    }
    let mut list: Vec<&str> = names.iter().copied().collect();
    list.sort_unstable();
    Err(source.error(v.at, unknown_name(what, name, list)))
}

impl Reader<'_, '_> {
    /// An object of the root or of a group.
    pub(super) fn object(&mut self, v: &Tree, names: &Names) -> Result<ObjectDesc> {
        let families = self.families;
        let section = Section::new(self.source, "an object", v, KEYS)?;
        let name = section.read("name", |s, k, v| Ok(s.text(k, v)?.to_owned()))?.unwrap_or_default();
        let group = section.read("group", |s, k, v| known(s, k, v, &names.groups))?;
        let mut materials = Vec::new();
        if let Some(name) = section.read("material", |s, k, v| known(s, k, v, &names.materials))? {
            materials.push(name);
        }
        if let Some(v) = section.table.get("materials") {
            if !materials.is_empty() {
                return Err(self.source.error(v.at, "an object has `material` or `materials`, not both"));
            }
            for m in self.source.list("materials", v)? {
                materials.push(known(self.source, "material", m, &names.materials)?);
            }
        }
        let transform = section.read("transform", transform)?.unwrap_or(DAffine3::IDENTITY);
        let content = match (section.table.get("shape"), group) {
            (Some(shape), None) => {
                let node = self.node(&families.shapes, shape, &[])?;
                if let Some(mesh) = mesh_of(&node) {
                    materials = self.slots(&section, v, &mesh, materials)?;
                }
                Content::Shape(node)
            }
            (None, Some(group)) if materials.is_empty() => Content::Group(group),
            (None, Some(_)) => {
                let message = "a group's objects have their own materials: it takes none here";
                return Err(self.source.error(v.at, message));
            }
            _ => return Err(self.source.error(v.at, "an object has either a `shape` or a `group`")),
        };
        Ok(ObjectDesc { name, content, materials, transform, place: self.source.place(v.at) })
    }

    /// A mesh's materials by slot: those the scene names, or else those of its own library.
    fn slots(
        &mut self,
        section: &Section,
        at: &Tree,
        mesh: &Arc<MeshData>,
        given: Vec<String>,
    ) -> Result<Vec<String>> {
        if !given.is_empty() {
            let slots = mesh.materials.len().max(1);
            if given.len() > 1 && given.len() != slots && !mesh.indices.is_empty() {
                let message = format!(
                    "`materials` names {}, but the mesh has {slots}: {}",
                    given.len(),
                    slot_names(mesh)
                );
                return Err(self
                    .source
                    .error(section.table.get("materials").map_or(at.at, |v| v.at), message));
            }
            return Ok(given);
        }
        let label = section.table.get("shape").and_then(file_name).unwrap_or_else(|| "mesh".into());
        material_library(&label, mesh, self.files, &mut self.scene)
    }
}

fn slot_names(mesh: &MeshData) -> String {
    mesh.materials.iter().map(|m| m.name.as_str()).collect::<Vec<_>>().join(", ")
}

fn mesh_of(node: &Node) -> Option<Arc<MeshData>> {
    node.params.list.iter().find_map(|p| match &p.value {
        Value::Mesh(mesh) => Some(mesh.clone()),
        _ => None,
    })
}

/// The `path` of a shape's table.
fn file_name(shape: &Tree) -> Option<String> {
    match &shape.data {
        Data::Table(t) => match &t.get("path")?.data {
            Data::Text(path) => Some(path.clone()),
            _ => None,
        },
        _ => None,
    }
}
