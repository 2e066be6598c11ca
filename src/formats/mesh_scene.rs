//! A mesh alone is a scene: one object under a midday sky, in a neutral or in its own materials. The scene has no
//! camera, which frames the bounds.

use crate::base::mesh_data::{MeshData, MeshMaterial};
use crate::base::registry::{Node, Params, Value};
use crate::error::{Place, Result};
use crate::formats::NamedFiles;
use crate::formats::files::Files;
use crate::scene::desc::{Content, Named, ObjectDesc, SceneDesc, SkyDesc};
use glam::DAffine3;
use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

/// The sky over a mesh alone.
const SKY: &str = "midday";

/// Loads a mesh as a scene.
///
/// # Errors
/// Those of [`crate::formats::load_mesh`]. A picture of its material library that cannot be read costs a warning.
pub fn load(path: &Path) -> Result<SceneDesc> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut files = Files::of(path, NamedFiles::Read);
    let place = Place::default();
    loop {
        let mesh = files.mesh(&name, &place)?;
        let mut scene =
            SceneDesc { sky: Some(SkyDesc::new(node(SKY, Params::new()))), ..SceneDesc::default() };
        let materials = material_library(&name, &mesh, &mut files, &mut scene)?;
        let shape = node("mesh", Params::new().with("path", Value::Mesh(mesh)));
        scene.objects.push(ObjectDesc {
            name: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
            content: Content::Shape(shape),
            materials,
            transform: DAffine3::IDENTITY,
            place: Place { path: path.to_owned(), ..Place::default() },
        });
        if !files.read_noted()? {
            return Ok(scene);
        }
    }
}

/// Adds a mesh's own materials to the scene, once for each `label`, and returns their names by slot.
pub(crate) fn material_library(
    label: &str,
    mesh: &Arc<MeshData>,
    files: &mut Files,
    scene: &mut SceneDesc,
) -> Result<Vec<String>> {
    let mut names: Vec<String> = Vec::with_capacity(mesh.materials.len());
    let mut seen = HashSet::new();
    for (slot, m) in mesh.materials.iter().enumerate() {
        let name = if seen.insert(&m.name) {
            format!("{label}:{}", m.name)
        } else {
            format!("{label}:{}#{slot}", m.name)
        };
        names.push(name);
    }
    if names.first().is_none_or(|first| scene.materials.iter().any(|m| m.name == *first)) {
        return Ok(names);
    }
    for (name, m) in names.iter().zip(&mesh.materials) {
        let value = diffuse(m, files);
        scene.materials.push(Named { name: name.clone(), value, place: Place::default() });
    }
    Ok(names)
}

/// Where a library names neither colour nor a picture that can be used: as the neutral material.
const UNSAID: [f32; 3] = [0.8; 3];

/// The picture alone where there is one: libraries of many programs say black or gray beside it.
fn diffuse(m: &MeshMaterial, files: &mut Files) -> Node {
    // More than all light cannot be sent back, whatever the library says.
    let color = m.diffuse.map(|color| color.map(|c| c.clamp(0.0, 1.0)));
    let plain = color.unwrap_or(UNSAID);
    let picture = m.diffuse_map.as_ref().and_then(|path| files.optional_image(path, plain));
    let albedo = match (picture, color) {
        (Some(image), _) => {
            Value::Node(Box::new(node("image", Params::new().with("path", Value::Image(image)))))
        }
        (None, Some(color)) => Value::Numbers(color.map(f64::from).to_vec()),
        (None, None) => return node("diffuse", Params::new()),
    };
    node("diffuse", Params::new().with("albedo", albedo))
}

fn node(kind: &str, params: Params) -> Node {
    Node { kind: kind.to_owned(), params, place: Place::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::mesh_data::{Positions, Repairs};

    #[test]
    fn libraries_become_materials_once() {
        let dir = tempfile::tempdir().unwrap();
        let material = |name: &str, diffuse, map: Option<&str>| MeshMaterial {
            name: name.into(),
            diffuse,
            diffuse_map: map.map(|m| dir.path().join(m)),
        };
        let materials = vec![
            material("red", Some([0.5, 0.0, 2.0]), None),
            material("red", None, None),
            material("lost", Some([0.1; 3]), Some("gone.png")),
        ];
        let mesh = Arc::new(MeshData {
            positions: Positions::F32(Vec::new()),
            normals: Vec::new(),
            uvs: Vec::new(),
            indices: Vec::new(),
            material_ids: Vec::new(),
            materials,
            repairs: Repairs::default(),
        });
        let mut files = Files::of(&dir.path().join("a.obj"), NamedFiles::Read);
        let mut scene = SceneDesc::default();
        for _ in 0..2 {
            let names = material_library("m.obj", &mesh, &mut files, &mut scene).unwrap();
            assert_eq!(names, ["m.obj:red", "m.obj:red#1", "m.obj:lost"]);
        }
        assert_eq!(scene.materials.len(), 3);
        let albedo = |i: usize| scene.materials[i].value.params.color_or("albedo", [0.7; 3]).unwrap();
        assert_eq!(albedo(0), crate::color::Rgb::new(0.5, 0.0, 1.0));
        assert_eq!(albedo(1), crate::color::Rgb::new(0.7, 0.7, 0.7));
        assert_eq!(albedo(2), crate::color::Rgb::new(0.1, 0.1, 0.1));
    }
}
