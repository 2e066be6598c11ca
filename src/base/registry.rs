//! How kinds are registered: a row a kind, with its parameters declared, so that scene files, `skylit list`, hints
//! and errors all derive from one place.

use crate::base::deferred::Deferred;
use crate::base::image_data::ImageData;
use crate::base::mesh_data::MeshData;
use crate::base::texture::Texture;
use crate::error::{Error, Place, Result, unknown_name};
use std::sync::Arc;

/// What a parameter takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ParamKind {
    /// true or false.
    Bool,
    /// A number in a closed range.
    Number {
        /// Smallest.
        min: f64,
        /// Largest.
        max: f64,
    },
    /// A whole number in a closed range.
    Integer {
        /// Smallest.
        min: i64,
        /// Largest.
        max: i64,
    },
    /// Three numbers.
    Vector,
    /// Two numbers, or one for both.
    Vector2,
    /// Three numbers of at least 0, or one for all, linear Rec. 709.
    Color,
    /// A colour, or a table that describes a texture.
    Texture,
    /// One of these words.
    Choice(&'static [&'static str]),
    /// Free text.
    Text,
    /// The path of a picture, read when the scene file is.
    Image,
    /// The path of a folder of six faces, a cross or a strip: read as six square pictures.
    CubeFaces,
    /// The path of a mesh.
    Mesh,
}

/// A parameter that a kind declares.
#[derive(Debug, Clone, Copy)]
pub struct ParamSpec {
    /// Name in scene files; angles end in `_deg`.
    pub name: &'static str,
    /// What it takes.
    pub kind: ParamKind,
    /// Its default, as it would be written; None if it must be given.
    pub default: Option<&'static str>,
    /// One line: meaning and unit.
    pub doc: &'static str,
}

/// A parameter's value.
#[derive(Clone)]
pub enum Value {
    /// true or false.
    Bool(bool),
    /// Any number.
    Number(f64),
    /// A list of numbers.
    Numbers(Vec<f64>),
    /// A word or text.
    Text(String),
    /// A nested node, such as a texture, before it is built.
    Node(Box<Node>),
    /// A picture, decoded when it is asked for.
    Image(Deferred<ImageData>),
    /// Six square pictures in the order +X -X +Y -Y +Z -Z, decoded when they are asked for.
    Faces(Deferred<[ImageData; 6]>),
    /// A mesh.
    Mesh(Arc<MeshData>),
    /// A built texture, put in place of its node by the scene builder.
    Texture(Arc<dyn Texture>),
}

impl Value {
    /// A picture that is in memory.
    pub fn image(image: ImageData) -> Self {
        Value::Image(Deferred::ready(image))
    }

    /// Six cube faces that are in memory.
    pub fn faces(faces: [ImageData; 6]) -> Self {
        Value::Faces(Deferred::ready(faces))
    }
}

/// Open plain data: what a scene file says of one thing.
#[derive(Clone, Default)]
pub struct Node {
    /// Which row of its family.
    pub kind: String,
    /// Its parameters.
    pub params: Params,
    /// Where it stands.
    pub place: Place,
}

/// One named value and where it stands.
#[derive(Clone)]
pub struct Param {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: Value,
    /// Where it stands.
    pub place: Place,
}

/// The parameters of a node. The getters return the declared type or an error that names the place; a row's
/// constructor may assume that [`check`] has passed.
#[derive(Clone, Default)]
pub struct Params {
    /// In file order.
    pub list: Vec<Param>,
    /// Where the node stands, for errors about what is missing.
    pub place: Place,
}

impl Params {
    /// No parameters.
    pub fn new() -> Self {
        Params::default()
    }

    /// With one more parameter; for scenes made in code.
    pub fn with(mut self, name: &str, value: Value) -> Self {
        self.list.push(Param { name: name.to_owned(), value, place: Place::default() });
        self
    }

    /// The value of `name`, if given.
    pub fn get(&self, name: &str) -> Option<&Value> {
        self.list.iter().find(|p| p.name == name).map(|p| &p.value)
    }

    /// An error at the place of parameter `name` (of the node, if it is missing).
    pub fn error(&self, name: &str, message: impl Into<String>) -> Error {
        let place = self.list.iter().find(|p| p.name == name).map_or(&self.place, |p| &p.place);
        Error::Content { place: place.clone(), message: format!("`{name}`: {}", message.into()) }
    }

    fn missing(&self, name: &str) -> Error {
        self.error(name, "is missing")
    }

    /// A number, or `default`.
    pub fn number_or(&self, name: &str, default: f64) -> Result<f64> {
        match self.get(name) {
            None => Ok(default),
            Some(Value::Number(v)) if v.is_finite() => Ok(*v),
            Some(_) => Err(self.error(name, "takes a finite number")),
        }
    }

    /// A number that must be given.
    pub fn number(&self, name: &str) -> Result<f64> {
        self.get(name).ok_or_else(|| self.missing(name))?;
        self.number_or(name, 0.0)
    }

    /// A truth value, or `default`.
    pub fn bool_or(&self, name: &str, default: bool) -> Result<bool> {
        match self.get(name) {
            None => Ok(default),
            Some(Value::Bool(v)) => Ok(*v),
            Some(_) => Err(self.error(name, "takes true or false")),
        }
    }

    /// Three numbers, or `default`.
    pub fn vector_or(&self, name: &str, default: [f64; 3]) -> Result<[f64; 3]> {
        match self.get(name) {
            None => Ok(default),
            Some(Value::Numbers(v)) if v.len() == 3 && v.iter().all(|x| x.is_finite()) => {
                Ok([v[0], v[1], v[2]])
            }
            Some(_) => Err(self.error(name, "takes three finite numbers")),
        }
    }

    /// Two numbers (one stands for both), or `default`.
    pub fn vector2_or(&self, name: &str, default: [f64; 2]) -> Result<[f64; 2]> {
        match self.get(name) {
            None => Ok(default),
            Some(Value::Number(v)) if v.is_finite() => Ok([*v; 2]),
            Some(Value::Numbers(v)) if v.len() == 2 && v.iter().all(|x| x.is_finite()) => Ok([v[0], v[1]]),
            Some(_) => Err(self.error(name, "takes two finite numbers, or one for both")),
        }
    }

    /// Three numbers that must be given.
    pub fn vector(&self, name: &str) -> Result<[f64; 3]> {
        self.get(name).ok_or_else(|| self.missing(name))?;
        self.vector_or(name, [0.0; 3])
    }

    /// A colour (three numbers of at least 0, or one), or `default`.
    pub fn color_or(&self, name: &str, default: [f64; 3]) -> Result<crate::color::Rgb> {
        let v = match self.get(name) {
            None => default,
            Some(Value::Number(v)) => [*v; 3],
            Some(Value::Numbers(v)) if v.len() == 3 => [v[0], v[1], v[2]],
            Some(_) => return Err(self.error(name, "takes a colour: three numbers, or one")),
        };
        if v.iter().any(|x| !x.is_finite() || *x < 0.0 || *x > f32::MAX as f64) {
            return Err(self.error(name, "takes finite numbers of at least 0"));
        }
        Ok(crate::color::Rgb::from(v.map(|x| x as f32)))
    }

    /// A word, or `default`.
    pub fn text_or<'a>(&'a self, name: &str, default: &'a str) -> Result<&'a str> {
        match self.get(name) {
            None => Ok(default),
            Some(Value::Text(v)) => Ok(v),
            Some(_) => Err(self.error(name, "takes text")),
        }
    }

    /// A built texture or a colour, or `default`.
    pub fn texture_or(&self, name: &str, default: [f64; 3]) -> Result<TextureOrColor> {
        match self.get(name) {
            Some(Value::Texture(t)) => Ok(TextureOrColor::Texture(t.clone())),
            _ => Ok(TextureOrColor::Color(self.color_or(name, default)?)),
        }
    }

    /// A picture that must be given; decodes it.
    pub fn image(&self, name: &str) -> Result<Arc<ImageData>> {
        match self.get(name) {
            Some(Value::Image(v)) => v.get(),
            Some(_) => Err(self.error(name, "takes a picture")),
            None => Err(self.missing(name)),
        }
    }

    /// Six cube faces that must be given; decodes them.
    pub fn faces(&self, name: &str) -> Result<Arc<[ImageData; 6]>> {
        match self.get(name) {
            Some(Value::Faces(v)) => v.get(),
            Some(_) => Err(self.error(name, "takes six cube faces")),
            None => Err(self.missing(name)),
        }
    }

    /// A mesh that must be given.
    pub fn mesh(&self, name: &str) -> Result<Arc<MeshData>> {
        match self.get(name) {
            Some(Value::Mesh(v)) => Ok(v.clone()),
            Some(_) => Err(self.error(name, "takes a mesh")),
            None => Err(self.missing(name)),
        }
    }
}

/// A parameter of kind [`ParamKind::Texture`], built.
#[derive(Clone)]
pub enum TextureOrColor {
    /// The same everywhere.
    Color(crate::color::Rgb),
    /// Varies.
    Texture(Arc<dyn Texture>),
}

/// A registered kind of a family whose members are built as `T`.
pub struct Row<T: ?Sized + 'static> {
    /// Name in scene files and on the command line.
    pub kind: &'static str,
    /// One line for `skylit list`.
    pub doc: &'static str,
    /// The parameters it takes.
    pub params: &'static [ParamSpec],
    /// Builds one.
    pub build: fn(&Params) -> Result<Arc<T>>,
    /// Parameter sets that the family's tests run through: at least one.
    pub samples: fn() -> Vec<Params>,
}

// By hand: a derive would ask the same of `T`.
impl<T: ?Sized> Clone for Row<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T: ?Sized> Copy for Row<T> {}

/// Finds a row by the node's kind, and checks the node's parameters against it.
pub fn find<'a, T: ?Sized>(family: &str, table: &'a [Row<T>], node: &Node) -> Result<&'a Row<T>> {
    let row = table.iter().find(|r| r.kind == node.kind).ok_or_else(|| Error::Content {
        place: node.place.clone(),
        message: unknown_name(family, &node.kind, table.iter().map(|r| r.kind)),
    })?;
    check(row.kind, row.params, &node.params)?;
    Ok(row)
}

/// Finds a row and builds the node.
pub fn build<T: ?Sized>(family: &str, table: &[Row<T>], node: &Node) -> Result<Arc<T>> {
    (find(family, table, node)?.build)(&node.params)
}

/// Checks names and ranges of parameters against their declaration.
pub fn check(kind: &str, specs: &[ParamSpec], params: &Params) -> Result<()> {
    for p in &params.list {
        let Some(spec) = specs.iter().find(|s| s.name == p.name) else {
            return Err(Error::Content {
                place: p.place.clone(),
                message: unknown_name(
                    &format!("parameter of \"{kind}\""),
                    &p.name,
                    specs.iter().map(|s| s.name),
                ),
            });
        };
        check_range(spec, params)?;
    }
    match specs.iter().find(|s| s.default.is_none() && params.get(s.name).is_none()) {
        Some(s) => Err(Error::Content {
            place: params.place.clone(),
            message: format!("\"{kind}\" needs `{}`: {}", s.name, s.doc),
        }),
        None => Ok(()),
    }
}

fn check_range(spec: &ParamSpec, params: &Params) -> Result<()> {
    let name = spec.name;
    match spec.kind {
        ParamKind::Bool => params.bool_or(name, false).map(drop),
        ParamKind::Number { min, max } => match params.number(name)? {
            v if (min..=max).contains(&v) => Ok(()),
            v => Err(params.error(name, format!("{v} is outside {min} to {max}"))),
        },
        ParamKind::Integer { min, max } => match params.number(name)? {
            v if v.fract() == 0.0 && v >= min as f64 && v <= max as f64 => Ok(()),
            v => Err(params.error(name, format!("takes a whole number from {min} to {max}, not {v}"))),
        },
        ParamKind::Vector => params.vector(name).map(drop),
        ParamKind::Vector2 => params.vector2_or(name, [0.0; 2]).map(drop),
        ParamKind::Color => params.color_or(name, [0.0; 3]).map(drop),
        ParamKind::Texture => match params.get(name) {
            Some(Value::Texture(_) | Value::Node(_)) => Ok(()),
            _ => params.color_or(name, [0.0; 3]).map(drop),
        },
        ParamKind::Choice(words) => {
            let word = params.text_or(name, "")?;
            if words.contains(&word) {
                return Ok(());
            }
            Err(params.error(name, unknown_name("word", word, words.iter().copied())))
        }
        ParamKind::Text => params.text_or(name, "").map(drop),
        // These may be decoded only when they are used.
        ParamKind::Image if matches!(params.get(name), Some(Value::Image(_))) => Ok(()),
        ParamKind::CubeFaces if matches!(params.get(name), Some(Value::Faces(_))) => Ok(()),
        ParamKind::Image => params.image(name).map(drop),
        ParamKind::CubeFaces => params.faces(name).map(drop),
        ParamKind::Mesh => params.mesh(name).map(drop),
    }
}
