//! Writing a scene in the native format, its meshes and pictures in a folder beside it.

use crate::base::image_data::{ImageData, Texels};
use crate::base::mesh_data::MeshData;
use crate::base::registry::{Node, Params, Value};
use crate::color::Transfer;
use crate::error::{Error, Result};
use crate::formats::ply::write_ply;
use crate::image::picture::{Picture, SampleKind};
use crate::image::write::{WriteOptions, write_file, write_picture};
use crate::scene::desc::{Background, Content, ObjectDesc, SceneDesc};
use glam::DAffine3;
use std::collections::HashMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use toml_edit::{Array, InlineTable, Value as Toml};

/// Names of a cube's faces in the order of [`Value::Faces`].
const FACES: [&str; 6] = ["+X", "-X", "+Y", "-Y", "+Z", "-Z"];

/// Writes `scene` to `path`, and what it holds of meshes and pictures into the folder `NAME_files` beside it. What the
/// scene's own file said and a scene cannot ([`SceneDesc::losses`]) stands as comments in the sections concerned.
///
/// # Errors
/// [`Error::File`] where something cannot be written.
pub fn write(path: &Path, scene: &SceneDesc) -> Result<()> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folder = format!("{stem}_files");
    let files =
        SideFiles { at: path.with_file_name(&folder), folder, written: HashMap::new(), counts: [0; 3] };
    let mut writer = Writer { scene, files, text: String::new() };
    writer.scene()?;
    write_file(path, writer.text.as_bytes())
}

struct Writer<'a> {
    scene: &'a SceneDesc,
    files: SideFiles,
    text: String,
}

/// Meshes and pictures, each written once however often it is named.
struct SideFiles {
    at: PathBuf,
    folder: String,
    /// Name by address.
    written: HashMap<usize, String>,
    /// Meshes, pictures and skies so far.
    counts: [usize; 3],
}

impl Writer<'_> {
    fn scene(&mut self) -> Result<()> {
        let scene = self.scene;
        self.section("film", "[film]");
        self.line("size", numbers(scene.film.size.map(f64::from)));
        match scene.film.transfer {
            Transfer::Srgb => {}
            Transfer::Gamma(1.0) => self.line("transfer", "linear".into()),
            Transfer::Gamma(gamma) => self.line("transfer", number(f64::from(gamma))),
        }
        if let Some(filter) = &scene.render.filter {
            self.line("filter", filter.as_str().into());
        }
        match scene.background {
            Background::Sky => {}
            Background::Transparent => self.line("background", "transparent".into()),
            Background::Color(c) => self.line("background", numbers(c.map(f64::from))),
        }
        if let Some(camera) = &scene.camera {
            self.section("camera", "[camera]");
            self.node(camera)?;
        }
        self.render()?;
        if let Some(sky) = &scene.sky {
            self.section("sky", "[sky]");
            self.node(&sky.node)?;
            if sky.intensity != 1.0 {
                self.line("intensity", number(sky.intensity));
            }
            if sky.rotate_y_deg != 0.0 {
                self.line("rotate_y_deg", number(sky.rotate_y_deg));
            }
            if let Some(sampling) = &sky.sampling {
                self.line("sampling", sampling.as_str().into());
            }
        }
        for (i, m) in scene.materials.iter().enumerate() {
            let head = format!("[materials.{}]", key(&m.name));
            self.section(if i == 0 { "materials" } else { "" }, &head);
            self.node(&m.value)?;
        }
        for group in &scene.groups {
            let _ = writeln!(self.text, "\n[groups.{}]", key(&group.name));
            for object in &group.value {
                let _ = writeln!(self.text, "[[groups.{}.objects]]", key(&group.name));
                self.object(object)?;
            }
        }
        for (i, object) in scene.objects.iter().enumerate() {
            self.section(if i == 0 { "objects" } else { "" }, "[[objects]]");
            self.object(object)?;
        }
        for (i, light) in scene.lights.iter().enumerate() {
            self.section(if i == 0 { "lights" } else { "" }, "[[lights]]");
            self.node(light)?;
        }
        Ok(())
    }

    fn render(&mut self) -> Result<()> {
        let render = &self.scene.render;
        self.section("render", "[render]");
        if let Some(integrator) = &render.integrator {
            self.line("integrator", integrator.kind.as_str().into());
            self.params(&integrator.params)?;
        }
        if let Some(spp) = render.spp {
            self.line("spp", i64::from(spp).into());
        }
        let names = [("sampler", &render.sampler), ("light_sampler", &render.light_sampler)];
        for (name, value) in names.into_iter().filter_map(|(n, v)| Some((n, v.as_deref()?))) {
            self.line(name, value.into());
        }
        if let Some(seed) = render.seed {
            self.line("seed", (seed as i64).into());
        }
        Ok(())
    }

    /// A section's heading, after comments on what it lost.
    fn section(&mut self, name: &str, heading: &str) {
        if !self.text.is_empty() {
            self.text.push('\n');
        }
        for loss in self.scene.losses.iter().filter(|l| l.section == name) {
            let _ = writeln!(
                self.text,
                "# lost from {}: {}",
                one_line(&loss.place.to_string()),
                one_line(&loss.what)
            );
        }
        let _ = writeln!(self.text, "{heading}");
    }

    fn line(&mut self, name: &str, value: Toml) {
        let _ = writeln!(self.text, "{} = {}", key(name), value.to_string().trim());
    }

    fn node(&mut self, node: &Node) -> Result<()> {
        self.line("type", node.kind.as_str().into());
        self.params(&node.params)
    }

    fn params(&mut self, params: &Params) -> Result<()> {
        for p in &params.list {
            let value = self.files.value(&p.value)?;
            self.line(&p.name, value);
        }
        if params.list.iter().any(|p| is_linear(&p.value)) && params.get("encoding").is_none() {
            self.line("encoding", "linear".into());
        }
        Ok(())
    }

    fn object(&mut self, object: &ObjectDesc) -> Result<()> {
        if !object.name.is_empty() {
            self.line("name", object.name.as_str().into());
        }
        match &object.content {
            Content::Shape(node) => {
                let table = self.files.table(node)?;
                self.line("shape", table.into());
            }
            Content::Group(name) => self.line("group", name.as_str().into()),
        }
        match object.materials.as_slice() {
            [] => {}
            [one] => self.line("material", one.as_str().into()),
            many => self.line("materials", many.iter().map(String::as_str).collect::<Array>().into()),
        }
        if object.transform != DAffine3::IDENTITY {
            let mut step = InlineTable::new();
            let m = object.transform;
            let rows = [0, 1, 2].map(|i| [m.x_axis[i], m.y_axis[i], m.z_axis[i], m.translation[i]]);
            step.insert("matrix", numbers(rows.into_iter().flatten()));
            self.line("transform", [Toml::from(step)].into_iter().collect::<Array>().into());
        }
        Ok(())
    }
}

impl SideFiles {
    fn value(&mut self, value: &Value) -> Result<Toml> {
        Ok(match value {
            Value::Bool(b) => (*b).into(),
            Value::Number(x) => number(*x),
            Value::Numbers(list) => numbers(list.iter().copied()),
            Value::Text(text) => text.as_str().into(),
            Value::Node(node) => self.table(node)?.into(),
            Value::Image(image) => self.image(&image.get()?)?.into(),
            Value::Faces(faces) => self.faces(&faces.get()?)?.into(),
            Value::Mesh(mesh) => self.mesh(mesh)?.into(),
            Value::Texture(_) => {
                return Err(Error::Internal("a texture was built before it was written".into()));
            }
        })
    }

    fn table(&mut self, node: &Node) -> Result<InlineTable> {
        let mut table = InlineTable::new();
        table.insert("type", node.kind.as_str().into());
        for p in &node.params.list {
            table.insert(&p.name, self.value(&p.value)?);
        }
        if node.params.list.iter().any(|p| is_linear(&p.value)) && node.params.get("encoding").is_none() {
            table.insert("encoding", "linear".into());
        }
        Ok(table)
    }

    /// The name of what stands at `address`, by `write` if it is new; `which` counter numbers it.
    fn once(
        &mut self,
        address: usize,
        which: usize,
        name: impl FnOnce(usize) -> String,
        write: impl FnOnce(&Path) -> Result<()>,
    ) -> Result<String> {
        if let Some(name) = self.written.get(&address) {
            return Ok(name.clone());
        }
        std::fs::create_dir_all(&self.at).map_err(|e| Error::file(&self.at, "create", e))?;
        self.counts[which] += 1;
        let file = name(self.counts[which]);
        write(&self.at.join(&file))?;
        let name = format!("{}/{file}", self.folder);
        self.written.insert(address, name.clone());
        Ok(name)
    }

    fn mesh(&mut self, mesh: &Arc<MeshData>) -> Result<String> {
        self.once(Arc::as_ptr(mesh) as usize, 0, |i| format!("mesh-{i}.ply"), |path| write_ply(path, mesh))
    }

    fn image(&mut self, image: &Arc<ImageData>) -> Result<String> {
        let ending = ending(image);
        self.once(
            Arc::as_ptr(image) as usize,
            1,
            |i| format!("picture-{i}.{ending}"),
            |p| write_image(p, image),
        )
    }

    fn faces(&mut self, faces: &Arc<[ImageData; 6]>) -> Result<String> {
        self.once(
            Arc::as_ptr(faces) as usize,
            2,
            |i| format!("sky-{i}"),
            |folder| {
                std::fs::create_dir_all(folder).map_err(|e| Error::file(folder, "create", e))?;
                faces.iter().zip(FACES).try_for_each(|(face, name)| {
                    write_image(&folder.join(format!("{name}.{}", ending(face))), face)
                })
            },
        )
    }
}

fn is_linear(value: &Value) -> bool {
    let linear = |image: &ImageData| matches!(image.texels, Texels::Linear8(_));
    match value {
        // They were decoded to be written; what could not be was an error there.
        Value::Image(image) => image.get().is_ok_and(|image| linear(&image)),
        Value::Faces(faces) => faces.get().is_ok_and(|faces| linear(&faces[0])),
        _ => false,
    }
}

fn ending(image: &ImageData) -> &'static str {
    if matches!(image.texels, Texels::F32(_)) { "exr" } else { "png" }
}

/// Bytes as they are, floats as floats.
fn write_image(path: &Path, image: &ImageData) -> Result<()> {
    match &image.texels {
        Texels::Srgb8(texels) | Texels::Linear8(texels) => {
            let mut png = Vec::new();
            let mut encoder = png::Encoder::new(&mut png, image.width as u32, image.height as u32);
            encoder.set_color(png::ColorType::Rgba);
            let fail = |e: png::EncodingError| Error::file(path, "write", e);
            let mut writer = encoder.write_header().map_err(fail)?;
            writer.write_image_data(texels.as_flattened()).map_err(fail)?;
            writer.finish().map_err(fail)?;
            write_file(path, &png)
        }
        Texels::F32(texels) => {
            let mut picture = Picture::new(image.width, image.height);
            for (i, name) in ["R", "G", "B"].into_iter().enumerate() {
                picture.push(name, SampleKind::Float, texels.iter().map(|t| t[i]).collect());
            }
            write_picture(path, &picture, &WriteOptions::default())
        }
    }
}

/// Whole numbers as such: some parameters take nothing else.
fn number(x: f64) -> Toml {
    if x.fract() == 0.0 && x.abs() < 1e15 { (x as i64).into() } else { x.into() }
}

fn numbers(list: impl IntoIterator<Item = f64>) -> Toml {
    list.into_iter().map(number).collect::<Array>().into()
}

/// A key, quoted where it must be.
fn key(name: &str) -> String {
    toml_edit::Key::new(name).to_string()
}

/// Text that cannot end a comment.
fn one_line(text: &str) -> String {
    text.replace(|c: char| c.is_control(), " ")
}
