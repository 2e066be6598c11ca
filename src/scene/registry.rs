//! The tables that a scene is built from: the kinds of this crate, and any that its user adds.

use crate::base::camera::CameraSource;
use crate::base::light::LightSource;
use crate::base::material::Material;
use crate::base::registry::Row;
use crate::base::shape::ShapeSource;
use crate::base::skybox::Skybox;
use crate::base::texture::Texture;
use crate::{cameras, lights, materials, shapes, skyboxes, textures};

/// One table of rows for each open family of a scene. The default holds what this crate registers; a program that
/// has kinds of its own adds their rows, builds scenes by [`super::build::build_with`] and reads scene files by
/// [`crate::formats::load_with`]:
///
/// ```
/// use skylit::base::registry::{Params, Row};
/// use skylit::base::texture::Texture;
/// use skylit::color::Rgb;
/// use skylit::scene::registry::Registry;
/// use std::sync::Arc;
///
/// struct Ramp;
///
/// impl Texture for Ramp {
///     fn eval(&self, uv: glam::Vec2, _footprint: f32) -> Rgb {
///         Rgb::splat(uv.x)
///     }
///     fn mean(&self) -> Rgb {
///         Rgb::splat(0.5)
///     }
/// }
///
/// let mut registry = Registry::default();
/// registry.textures.push(Row {
///     kind: "ramp",
///     doc: "grey that grows with u",
///     params: &[],
///     build: |_| Ok(Arc::new(Ramp)),
///     samples: || vec![Params::new()],
/// });
/// ```
///
/// Where two rows of a family have one name, the first is found: a kind of this crate cannot be replaced by accident.
#[derive(Clone)]
pub struct Registry {
    /// Shapes.
    pub shapes: Vec<Row<dyn ShapeSource>>,
    /// Materials.
    pub materials: Vec<Row<dyn Material>>,
    /// Textures.
    pub textures: Vec<Row<dyn Texture>>,
    /// Lights beside the sky.
    pub lights: Vec<Row<dyn LightSource>>,
    /// Skies.
    pub skies: Vec<Row<dyn Skybox>>,
    /// Cameras.
    pub cameras: Vec<Row<dyn CameraSource>>,
}

impl Default for Registry {
    fn default() -> Self {
        Registry {
            shapes: shapes::REGISTRY.to_vec(),
            materials: materials::REGISTRY.to_vec(),
            textures: textures::REGISTRY.to_vec(),
            lights: lights::REGISTRY.to_vec(),
            skies: skyboxes::REGISTRY.to_vec(),
            cameras: cameras::REGISTRY.to_vec(),
        }
    }
}
