//! Scenes of the student's renderer that this one grew from (`.scene`): one command a line, a stack of transforms, and
//! a look of its own. In [`Compat::Exact`] the pictures are those of that program, and these are its quirks:
//!
//! - a sphere's transform moves its centre and leaves its radius; an ellipsoid takes all of it;
//! - 8-bit pictures are read as linear, and written so;
//! - the angle of view is cut to a whole degree;
//! - a mesh without texture coordinates takes the barycentric ones of each triangle;
//! - v counts from the top row of a picture. So it does on spheres, whose v is 0 at the pole that points up: ours looks
//!   the same there, as our v is 1 at that pole and counts from the bottom;
//! - normals are not turned to the viewer;
//! - nothing is divided by pi, so that a sky lights pi times as bright as in radiometric units, and its `intensity`
//!   scales that light and not the sky that is seen;
//! - a single sample goes through the pixel's centre.
//!
//! In [`Compat::Physical`] the same scene is path-traced: reflection has its 1 / pi, emission lights others, ambient
//! terms and the sky's `intensity` are left out.

use super::commands::looks::{Look, Looks};
use super::commands::soup::Soup;
use super::commands::stack::TransformStack;
use super::commands::statements::{Skipped, Statement, for_each};
use super::commands::{
    attenuation, camera, film_size, fit, light, locate, node, numbers, object, output, radius,
};
use crate::base::image_data::Encoding;
use crate::base::registry::{Node, Value};
use crate::color::Transfer;
use crate::error::{Place, Result};
use crate::formats::files::Files;
use crate::formats::sky_files::load_sky;
use crate::formats::{Compat, LoadOptions, SceneFormat, SceneText};
use crate::scene::desc::{Loss, SceneDesc, SkyDesc};
use glam::{DAffine3, DVec3};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The format.
pub const FORMAT: SceneFormat = SceneFormat {
    extension: "scene",
    doc: "scenes of the renderer that skylit grew from",
    recognise: |text| fit(text, WORDS, super::cse168::WORDS),
    parse,
};

/// Commands beside those of transforms, looks and triangles.
pub(super) const WORDS: &[&str] = &[
    "size",
    "output",
    "maxdepth",
    "spp",
    "camera",
    "sph",
    "elp",
    "mesh",
    "OBJ",
    "directional",
    "point",
    "attenuation",
    "matType",
    "imageformat",
    "texture",
    "skybox",
];

fn parse(file: &SceneText, options: &LoadOptions) -> Result<SceneDesc> {
    let text = file.text()?;
    let mut files = Files::of(file.path, options.named_files);
    loop {
        let mut reader = Reader::new(file.path, options.compat, &mut files);
        for_each(file.path, text, |s| reader.statement(s))?;
        let (mut scene, sky) = reader.finish();
        // The text is read once more when the files that it names are there.
        if files.read_noted()? {
            continue;
        }
        if let Some(path) = sky.filter(|_| files.are_read()) {
            scene.sky = Some(SkyDesc::new(load_sky(&path, Some(Encoding::Linear))?));
        }
        return Ok(scene);
    }
}

/// Reads one text from top to bottom.
struct Reader<'a> {
    path: &'a Path,
    compat: Compat,
    files: &'a mut Files,
    scene: SceneDesc,
    stack: TransformStack,
    look: Look,
    looks: Looks,
    soup: Soup,
    attenuation: [f64; 3],
    max_depth: i64,
    sky: Option<PathBuf>,
    sky_light: f64,
    skipped: Skipped,
    /// What has no place among radiometric units.
    unphysical: Vec<Loss>,
}

impl<'a> Reader<'a> {
    fn new(path: &'a Path, compat: Compat, files: &'a mut Files) -> Self {
        let mut scene = SceneDesc::default();
        scene.film.size = [640, 480];
        scene.film.transfer = Transfer::Gamma(1.0);
        scene.render.spp = Some(1);
        scene.render.filter = Some("box".into());
        Reader {
            path,
            compat,
            files,
            scene,
            stack: TransformStack::default(),
            look: Look::default(),
            looks: Looks::default(),
            soup: Soup::default(),
            attenuation: [1.0, 0.0, 0.0],
            max_depth: 5,
            sky: None,
            sky_light: 1.0,
            skipped: Skipped::default(),
            unphysical: Vec::new(),
        }
    }

    fn statement(&mut self, s: &mut Statement) -> Result<()> {
        if self.soup.apply(s)? || self.stack.apply(s)? || self.look.apply(s)? {
            if s.word == "ambient" && self.look.ambient != [0.0; 3] {
                let what = "ambient terms, which no light explains".into();
                self.unphysical.push(Loss { section: "materials", place: s.place(), what });
            }
            return Ok(());
        }
        match s.word {
            "size" => self.scene.film.size = film_size(s)?,
            "output" => output(s, &mut self.scene),
            "maxdepth" => self.max_depth = s.integer(0, 4095)?,
            "spp" => self.scene.render.spp = Some(s.integer(1, i64::from(u32::MAX))? as u32),
            "camera" => self.scene.camera = Some(camera(s, f64::trunc)?),
            "sph" | "elp" => self.quadric(s)?,
            "mesh" => self.mesh(s)?,
            "OBJ" => self.obj(s)?,
            "directional" | "point" => {
                self.scene.lights.push(light(s, self.stack.top(), self.attenuation)?);
            }
            "attenuation" => self.attenuation = attenuation(s)?,
            "matType" => self.look.extra.is_mirror = s.choice(&["Normal", "Mirror"])? == "Mirror",
            // The files' own first bytes say what they are.
            "imageformat" => drop(s.choice(&["PNG", "JPG"])?),
            "texture" => {
                let named = s.remainder("the path of a picture, or None")?;
                self.look.extra.texture = (named != "None").then(|| named.to_owned());
            }
            "skybox" => self.skybox(s)?,
            _ => self.skipped.note(s),
        }
        Ok(())
    }

    fn quadric(&mut self, s: &mut Statement) -> Result<()> {
        let place = s.place();
        let center = s.vector()?;
        let radius = radius(s)?;
        let top = self.stack.top();
        let (center, transform) = match s.word {
            "sph" => (top.transform_point3(DVec3::from_array(center)).to_array(), DAffine3::IDENTITY),
            _ => (center, top),
        };
        let params = vec![("center", numbers(center)), ("radius", Value::Number(radius))];
        self.place(node("sphere", &place, params), transform)
    }

    /// The triangles since the last mesh, which may have a name that says nothing.
    fn mesh(&mut self, s: &mut Statement) -> Result<()> {
        let place = s.place();
        if !self.soup.has_triangles() {
            return Err(s.error("`mesh` without a `tri` since the last one: it would be empty"));
        }
        let (name, transform) = (s.next().unwrap_or_default().to_owned(), self.stack.top());
        for mesh in self.soup.take().collect::<Vec<_>>() {
            self.place(mesh_node(&place, Value::Mesh(Arc::new(mesh))), transform)?;
            self.scene.objects.last_mut().expect("it was just placed").name.clone_from(&name);
        }
        Ok(())
    }

    fn obj(&mut self, s: &mut Statement) -> Result<()> {
        let named = s.remainder("the path of an OBJ file")?;
        let place = s.place();
        let path = self.locate(named, &place)?;
        let mesh = self.files.mesh_at(&path, &place)?;
        self.place(mesh_node(&place, Value::Mesh(mesh)), self.stack.top())
    }

    fn place(&mut self, shape: Node, transform: DAffine3) -> Result<()> {
        let texture = match &self.look.extra.texture {
            Some(named) => Some(self.texture(&named.clone(), shape.kind == MESH, &shape.place)?),
            None => None,
        };
        self.look.extra.v_down = texture.is_some() && shape.kind == MESH;
        let (look, compat, at) = (&self.look, self.compat, &shape.place);
        let name = self.looks.name_of(look, at, || Ok(material(look, compat, texture, at)))?;
        self.scene.objects.push(object(shape, &name, transform));
        Ok(())
    }

    fn locate(&self, named: &str, place: &Place) -> Result<PathBuf> {
        if self.files.are_read() { locate(self.path, named, place) } else { Ok(PathBuf::from(named)) }
    }

    fn texture(&mut self, named: &str, v_down: bool, place: &Place) -> Result<Value> {
        let path = self.locate(named, place)?;
        let image = self.files.image_at(&path, Some(Encoding::Linear), place)?;
        let mut params = vec![("path", Value::Image(image)), ("filter", Value::Text("nearest".into()))];
        if v_down {
            params.push(("uv_scale", Value::Numbers(vec![1.0, -1.0])));
            params.push(("uv_offset", Value::Numbers(vec![0.0, 1.0])));
        }
        Ok(Value::Node(Box::new(node("image", place, params))))
    }

    /// `skybox PATH [INTENSITY]`; the path may have blanks.
    fn skybox(&mut self, s: &mut Statement) -> Result<()> {
        let text = s.remainder("a folder of pictures")?;
        let (named, intensity) = match text.rsplit_once(char::is_whitespace) {
            Some((before, last)) => match last.parse::<f64>() {
                Ok(x) if x.is_finite() && x >= 0.0 => (before.trim_end(), x),
                Ok(x) => return Err(s.error(format!("`skybox` takes an intensity of at least 0, not {x}"))),
                Err(_) => (text, 1.0),
            },
            None => (text, 1.0),
        };
        self.sky = Some(self.locate(named, &s.place())?);
        self.sky_light = intensity;
        if intensity != 1.0 {
            let what =
                format!("the sky's light is not scaled by {intensity}, which would leave the sky as it is");
            self.unphysical.push(Loss { section: "sky", place: s.place(), what });
        }
        Ok(())
    }

    fn finish(self) -> (SceneDesc, Option<PathBuf>) {
        let known = [&TransformStack::WORDS[..], &Look::WORDS, &Soup::WORDS, WORDS].concat();
        self.skipped.warn(&known);
        let mut scene = self.scene;
        scene.losses.extend(self.skipped.losses());
        if self.compat == Compat::Physical {
            scene.losses.extend(self.unphysical);
        }
        if self.soup.has_triangles() {
            log::warn!("{}: the triangles after the last `mesh` belong to none", self.path.display());
        }
        scene.materials = self.looks.materials;
        let place = Place { path: self.path.to_owned(), ..Place::default() };
        let depth = ("max_depth", Value::Number((self.max_depth + 1) as f64));
        scene.render.integrator = Some(match self.compat {
            Compat::Exact => {
                node("whitted", &place, vec![depth, ("sky_light", Value::Number(self.sky_light))])
            }
            Compat::Physical => node("path", &place, vec![depth]),
        });
        (scene, self.sky)
    }
}

/// The shape that has texture coordinates of its own.
const MESH: &str = "mesh";

fn mesh_node(place: &Place, mesh: Value) -> Node {
    node(MESH, place, vec![("path", mesh), ("missing_uv", Value::Text("barycentric".into()))])
}

fn material(look: &Look, compat: Compat, texture: Option<Value>, place: &Place) -> Node {
    if look.extra.is_mirror {
        return node("mirror", place, vec![("reflectance", Value::Number(1.0))]);
    }
    let exact = compat == Compat::Exact;
    // What is emitted lights nothing in that program: it is one more ambient term.
    let [a, e] = [look.ambient, look.emission];
    let (ambient, emission) = match exact {
        true => ([0, 1, 2].map(|i| a[i] + e[i]), [0.0; 3]),
        false => ([0.0; 3], e),
    };
    let params = vec![
        ("diffuse", texture.unwrap_or_else(|| numbers(look.diffuse))),
        ("specular", numbers(look.specular)),
        ("shininess", Value::Number(look.shininess)),
        ("ambient", numbers(ambient)),
        ("emission", numbers(emission)),
        ("units", Value::Text(if exact { "classic" } else { "radiometric" }.into())),
        ("two_sided", Value::Bool(!exact)),
    ];
    node("blinn-phong", place, params)
}
