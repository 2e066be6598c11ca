//! A scene as plain data: what every file format produces and the scene builder reads.

use crate::base::registry::Node;
use crate::cameras::View;
use crate::color::Transfer;
use crate::error::Place;
use glam::DAffine3;

/// A whole scene. Families are named by their registry rows alone; nothing here knows a kind.
#[derive(Clone, Default)]
pub struct SceneDesc {
    /// The picture.
    pub film: FilmDesc,
    /// The camera; None frames the bounds of the scene from `view`.
    pub camera: Option<Node>,
    /// From where a camera that frames the bounds looks.
    pub view: View,
    /// How it is rendered, as far as the file says.
    pub render: RenderDesc,
    /// The sky; None is darkness.
    pub sky: Option<SkyDesc>,
    /// What camera rays that miss everything show.
    pub background: Background,
    /// Named materials.
    pub materials: Vec<Named<Node>>,
    /// Named groups.
    pub groups: Vec<Named<Vec<ObjectDesc>>>,
    /// What the root group holds.
    pub objects: Vec<ObjectDesc>,
    /// Lights beside the sky and emitting objects.
    pub lights: Vec<Node>,
    /// What of the file did not come over.
    pub losses: Vec<Loss>,
}

/// Something that a file says and a scene cannot.
#[derive(Debug, Clone, PartialEq)]
pub struct Loss {
    /// The section of a native scene where it would stand: "film", "render", ...
    pub section: &'static str,
    /// Where it stands in its file.
    pub place: Place,
    /// What it is, and what becomes of it.
    pub what: String,
}

/// Something with a name and a place in its file.
#[derive(Clone)]
pub struct Named<T> {
    /// The name others refer to it by.
    pub name: String,
    /// What it is.
    pub value: T,
    /// Where it stands.
    pub place: Place,
}

/// The picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilmDesc {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// The curve of 8-bit pictures of it.
    pub transfer: Transfer,
}

impl Default for FilmDesc {
    fn default() -> Self {
        FilmDesc { size: [1280, 720], transfer: Transfer::default() }
    }
}

/// Render settings that a scene file may give and a command line may override; None means the default.
#[derive(Clone, Default)]
pub struct RenderDesc {
    /// The integrator and its parameters.
    pub integrator: Option<Node>,
    /// Samples a pixel.
    pub spp: Option<u32>,
    /// Name of the point set.
    pub sampler: Option<String>,
    /// Name of the pixel filter.
    pub filter: Option<String>,
    /// Name of the light sampler.
    pub light_sampler: Option<String>,
    /// Seed of every random choice.
    pub seed: Option<u64>,
}

/// The sky and how it is placed and sampled.
#[derive(Clone)]
pub struct SkyDesc {
    /// The skybox.
    pub node: Node,
    /// Scales its radiance.
    pub intensity: f64,
    /// Turns it about +y, degrees.
    pub rotate_y_deg: f64,
    /// Name of the sampling method; None is the default.
    pub sampling: Option<String>,
}

impl SkyDesc {
    /// A sky as it is.
    pub fn new(node: Node) -> Self {
        SkyDesc { node, intensity: 1.0, rotate_y_deg: 0.0, sampling: None }
    }
}

/// What a camera ray that meets nothing shows. It changes no lighting.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Background {
    /// The sky; alpha is 0 there all the same.
    #[default]
    Sky,
    /// Nothing: black with alpha 0.
    Transparent,
    /// One radiance.
    Color([f32; 3]),
}

/// A placed object.
#[derive(Clone)]
pub struct ObjectDesc {
    /// For messages and ids; may be empty.
    pub name: String,
    /// What is placed.
    pub content: Content,
    /// Names of its materials by slot (a mesh with a material library has several slots; whoever reads the library
    /// adds its materials to the scene and lists them here). Empty takes the default material.
    pub materials: Vec<String>,
    /// From object space to that of the group (for the root: to world space).
    pub transform: DAffine3,
    /// Where it stands.
    pub place: Place,
}

/// What an object places.
#[derive(Clone)]
pub enum Content {
    /// A shape.
    Shape(Node),
    /// A group, by name.
    Group(String),
}
