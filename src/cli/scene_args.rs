//! Flags that say what is rendered: the scene or mesh, its sky, and, for a mesh alone, how it is presented.

use super::args::{Background, Size, ViewAngles, number_in};
use super::sky_arg;
use crate::base::camera::FilmSize;
use crate::base::mesh_data::{MeshData, Positions, Repairs};
use crate::base::registry::{Node, Params, Value, build};
use crate::cameras::{View, frame_bounds};
use crate::error::{Error, Result, unknown_name};
use crate::formats::families::{Family, Kind};
use crate::formats::{Compat, LoadOptions};
use crate::math::aabb::DAabb;
use crate::scene::desc::{Content, Named, ObjectDesc, SceneDesc};
use crate::{formats, materials, shapes};
use clap::{Args, ValueEnum};
use glam::{DAffine3, DMat3, DVec3};
use std::path::PathBuf;
use std::sync::Arc;

/// What is rendered.
#[derive(Debug, Clone, Args)]
pub struct SceneArgs {
    /// Scene file (.toml, .scene, .test), or a mesh alone (.obj or .ply, also packed as .gz or .zst)
    #[arg(value_name = "SCENE|MESH")]
    pub input: PathBuf,
    /// For scenes of other programs: as those show them, or in radiometric units [default: exact]
    #[arg(long, value_name = "exact|physical")]
    compat: Option<CompatArg>,
    #[command(flatten)]
    sky: SkyArgs,
    #[command(flatten)]
    mesh: MeshArgs,
    /// Size of the picture in pixels
    #[arg(long, value_name = "WxH", help_heading = "Picture")]
    size: Option<Size>,
    /// What shows behind everything: sky, transparent, or a linear colour R,G,B
    #[arg(long, value_name = "sky|transparent|COLOR", help_heading = "Picture")]
    background: Option<Background>,
}

#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Sky")]
struct SkyArgs {
    /// The sky: a kind without parameters (see `skylit list sky`), a picture, or a folder of six faces
    #[arg(long, value_name = "PRESET|FILE|DIR")]
    sky: Option<String>,
    /// Factor on the sky's radiance
    #[arg(long, value_name = "X", value_parser = |s: &str| number_in(s, 0.0..=1e12))]
    sky_intensity: Option<f64>,
    /// Turn of the sky about the upright axis, degrees
    #[arg(long, value_name = "DEG", allow_hyphen_values = true, value_parser = |s: &str| number_in(s, -1e6..=1e6))]
    sky_rotate: Option<f64>,
    /// How 8-bit pictures of the sky are meant [default: srgb]
    #[arg(long, value_name = "srgb|linear", requires = "sky")]
    sky_encoding: Option<sky_arg::SkyEncoding>,
    /// How directions to the sky are sampled (see `skylit list sky-sampling`)
    #[arg(long, value_name = "NAME")]
    sky_sampling: Option<String>,
}

#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Mesh alone")]
struct MeshArgs {
    /// From where it is seen: degrees about the upright axis and above the horizon [default: 30,15]
    #[arg(long, value_name = "AZ,EL", allow_hyphen_values = true)]
    view: Option<ViewAngles>,
    /// Vertical angle of view, degrees [default: 35]
    #[arg(long, value_name = "DEG", value_parser = |s: &str| number_in(s, 0.01..=179.0))]
    fov: Option<f64>,
    /// The axis of the mesh that is upright [default: y]
    #[arg(long, value_name = "y|z")]
    up: Option<Up>,
    /// A material instead of the mesh's own (see `skylit list material`)
    #[arg(long, value_name = "NAME")]
    material: Option<String>,
    /// Puts a wide floor under it
    #[arg(long)]
    ground: bool,
    /// Facets instead of smooth shading
    #[arg(long)]
    flat: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Up {
    Y,
    Z,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum CompatArg {
    Exact,
    Physical,
}

impl From<CompatArg> for Compat {
    fn from(arg: CompatArg) -> Self {
        match arg {
            CompatArg::Exact => Compat::Exact,
            CompatArg::Physical => Compat::Physical,
        }
    }
}

impl SceneArgs {
    /// Loads the input and applies the flags.
    pub fn load(&self) -> Result<SceneDesc> {
        self.check()?;
        let is_mesh = formats::is_mesh_path(&self.input);
        if let (false, Some(flag)) = (is_mesh, self.mesh.given()) {
            let input = self.input.display();
            return Err(Error::Usage(format!(
                "{flag} is for a mesh alone, and {input} is a scene of its own"
            )));
        }
        let sky = self.sky.sky.as_deref().map(|s| sky_arg::load(s, self.sky.sky_encoding)).transpose()?;
        let compat = self.compat.map_or(Compat::default(), Compat::from);
        let options = LoadOptions { compat, ..LoadOptions::default() };
        let mut scene = formats::load_with(&self.input, &options)?;
        if let Some(node) = sky {
            let old = scene.sky.take();
            let mut new = crate::scene::desc::SkyDesc::new(node);
            new.sampling = old.and_then(|s| s.sampling);
            scene.sky = Some(new);
        }
        self.sky.adjust(&mut scene)?;
        if let Some(Size(size)) = self.size {
            scene.film.size = size;
        }
        if let Some(Background(b)) = self.background {
            scene.background = b;
        }
        if is_mesh {
            self.mesh.present(&mut scene)?;
        }
        Ok(scene)
    }

    /// What can be found wrong before anything is loaded.
    fn check(&self) -> Result<()> {
        if let Some(name) = &self.sky.sky_sampling {
            find(&formats::families::Families::registered().sky_sampling, name)?;
        }
        match &self.mesh.material {
            Some(name) => material(name).map(drop),
            None => Ok(()),
        }
    }
}

fn find<'f>(family: &'f Family, name: &str) -> Result<&'f Kind> {
    family.find(name).ok_or_else(|| Error::Usage(unknown_name(family.name, name, family.names())))
}

impl SkyArgs {
    fn adjust(&self, scene: &mut SceneDesc) -> Result<()> {
        let given = [
            (self.sky_intensity.is_some(), "--sky-intensity"),
            (self.sky_rotate.is_some(), "--sky-rotate"),
            (self.sky_sampling.is_some(), "--sky-sampling"),
        ];
        let Some(sky) = &mut scene.sky else {
            return match given.iter().find(|g| g.0) {
                Some((_, flag)) => {
                    Err(Error::Usage(format!("{flag} needs a sky: the scene has none; add --sky")))
                }
                None => Ok(()),
            };
        };
        sky.intensity = self.sky_intensity.unwrap_or(sky.intensity);
        sky.rotate_y_deg = self.sky_rotate.unwrap_or(sky.rotate_y_deg);
        sky.sampling = self.sky_sampling.clone().or(sky.sampling.take());
        Ok(())
    }
}

/// A material of default parameters.
fn material(name: &str) -> Result<Node> {
    let node = Node { kind: name.to_owned(), ..Node::default() };
    crate::base::registry::find("material", materials::REGISTRY, &node)?;
    Ok(node)
}

/// Half the side of the floor, in diagonals of the mesh's bounds: its edge is far out of most pictures.
const GROUND_REACH: f64 = 20.0;

impl MeshArgs {
    /// The first flag that was given.
    fn given(&self) -> Option<&'static str> {
        let flags = [
            (self.view.is_some(), "--view"),
            (self.fov.is_some(), "--fov"),
            (self.up.is_some(), "--up"),
            (self.material.is_some(), "--material"),
            (self.ground, "--ground"),
            (self.flat, "--flat"),
        ];
        flags.iter().find(|f| f.0).map(|f| f.1)
    }

    /// Dresses, turns and frames the one object of a mesh alone.
    fn present(&self, scene: &mut SceneDesc) -> Result<()> {
        let mut bounds = DAabb::EMPTY;
        for object in &mut scene.objects {
            if self.up == Some(Up::Z) {
                object.transform = z_up() * object.transform;
            }
            if self.material.is_some() {
                object.materials = vec![MATERIAL.to_owned()];
            }
            let Content::Shape(node) = &mut object.content else { continue };
            if self.flat {
                node.params.list.retain(|p| p.name != "normals");
                node.params = std::mem::take(&mut node.params).with("normals", Value::Text("flat".into()));
            }
            let source = build("shape", shapes::REGISTRY, node)?;
            bounds = bounds.union(source.bounds().transformed(&object.transform));
        }
        if let Some(name) = &self.material {
            let value = material(name)?;
            scene.materials.push(Named { name: MATERIAL.into(), value, place: Default::default() });
        }
        let usual = View::default();
        let view = View {
            azimuth_deg: self.view.map_or(usual.azimuth_deg, |v| v.azimuth_deg),
            elevation_deg: self.view.map_or(usual.elevation_deg, |v| v.elevation_deg),
            fov_deg: self.fov.unwrap_or(usual.fov_deg),
            ..usual
        };
        let [width, height] = scene.film.size;
        scene.camera = Some(frame_bounds(&bounds, &view, FilmSize { width, height }));
        if self.ground && bounds.is_finite() {
            scene.objects.push(ground(&bounds));
        }
        Ok(())
    }
}

/// The name under which `--material` stands among the scene's materials.
const MATERIAL: &str = "--material";

/// A quarter turn about x that puts +z where +y is.
fn z_up() -> DAffine3 {
    DAffine3::from_mat3(DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y))
}

/// Two triangles at the foot of `bounds`.
fn ground(bounds: &DAabb) -> ObjectDesc {
    let (center, reach) = (bounds.center(), GROUND_REACH * 2.0 * bounds.radius());
    let corner = |x: f64, z: f64| [center.x + x * reach, bounds.min.y, center.z + z * reach];
    let mesh = MeshData {
        positions: Positions::F64(vec![
            corner(-1.0, -1.0),
            corner(-1.0, 1.0),
            corner(1.0, 1.0),
            corner(1.0, -1.0),
        ]),
        normals: Vec::new(),
        uvs: Vec::new(),
        indices: vec![[0, 1, 2], [0, 2, 3]],
        material_ids: Vec::new(),
        materials: Vec::new(),
        repairs: Repairs::default(),
    };
    let params = Params::new().with("path", Value::Mesh(Arc::new(mesh)));
    ObjectDesc {
        name: "ground".into(),
        content: Content::Shape(Node { kind: "mesh".into(), params, ..Node::default() }),
        materials: Vec::new(),
        transform: DAffine3::IDENTITY,
        place: Default::default(),
    }
}
