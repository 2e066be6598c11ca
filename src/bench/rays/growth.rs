//! How build time, memory and speed grow with the number of triangles: the same shape, generated in several sizes.

use super::kernels::Choice;
use super::measure::{Bench, Setup, measure};
use super::record::Record;
use super::sets::{RaySets, check_scene};
use crate::base::registry::{Node, Params, Value};
use crate::bench::Progress;
use crate::error::{Error, Result, unknown_name};
use crate::formats::families::Families;
use crate::scene::build::{BuildOptions, build};
use crate::scene::desc::{Content, ObjectDesc, SceneDesc, SkyDesc};
use glam::DAffine3;

/// The parameter that says how large a generated shape is.
const TRIANGLES: &str = "triangles";
/// What shines on it, as on any mesh alone.
const SKY: &str = "midday";

/// What is grown.
pub struct Growth<'a> {
    /// Kind of a shape that takes `triangles`.
    pub shape: String,
    /// About how many triangles, each more than 0.
    pub sizes: Vec<u64>,
    /// Rays of each kind.
    pub count: usize,
    /// See [`Setup::choice`].
    pub choice: &'a Choice,
    /// See [`Setup::rounds`].
    pub rounds: usize,
    /// See [`Setup::threads`].
    pub threads: usize,
    /// See [`Setup::reference`].
    pub reference: Option<String>,
}

/// Kinds of shapes that can be grown.
pub fn shapes() -> Vec<&'static str> {
    let shapes = &Families::registered().shapes.kinds;
    shapes.iter().filter(|k| k.params.iter().any(|p| p.name == TRIANGLES)).map(|k| k.name).collect()
}

/// The sky over what has none of its own, from which shadow rays take their directions.
pub fn default_sky() -> SkyDesc {
    SkyDesc::new(Node { kind: SKY.to_owned(), ..Node::default() })
}

/// A scene of one generated shape.
///
/// # Errors
/// [`Error::Usage`] for a kind that cannot be grown.
pub fn scene_of(shape: &str, triangles: u64) -> Result<SceneDesc> {
    let known = shapes();
    if !known.contains(&shape) {
        return Err(Error::Usage(unknown_name("shape that --triangles can generate", shape, known)));
    }
    let params = Params::new().with(TRIANGLES, Value::Number(triangles as f64));
    let node = Node { kind: shape.to_owned(), params, ..Node::default() };
    let object = ObjectDesc {
        name: shape.to_owned(),
        content: Content::Shape(node),
        materials: Vec::new(),
        transform: DAffine3::IDENTITY,
        place: Default::default(),
    };
    Ok(SceneDesc { sky: Some(default_sky()), objects: vec![object], ..SceneDesc::default() })
}

/// Measures every size, the smallest first.
///
/// # Errors
/// A size that the shape does not come in; those of [`measure`].
pub fn grow(growth: &Growth, progress: &dyn Progress) -> Result<Vec<Record>> {
    let mut sizes = growth.sizes.clone();
    sizes.sort_unstable();
    sizes.dedup();
    let one = |&size: &u64| {
        progress.step(&format!("make {} of {size} triangles", growth.shape));
        let mut options = BuildOptions::default();
        options.kernel.threads = growth.threads;
        let mut scene = build(scene_of(&growth.shape, size)?, &options)?;
        check_scene(&scene)?;
        let sets = RaySets::generate(&scene, growth.count)?;
        // The kernel that found where rays leave from would only hold memory.
        scene.kernel = Box::new(super::sets::oracle(&scene));
        let setup = Setup {
            input: growth.shape.clone(),
            scene: &scene,
            sets: &sets,
            choice: growth.choice,
            rounds: growth.rounds,
            threads: growth.threads,
            reference: growth.reference.clone(),
        };
        let bench = Bench::new(&setup, progress)?;
        measure(&bench, None, progress)
    };
    sizes.iter().map(one).collect()
}
