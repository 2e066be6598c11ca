//! What the formats of one command a line share: statements, the transform stack, looks, and triangles on their way
//! into meshes.

pub(super) mod looks;
pub(super) mod soup;
pub(super) mod stack;
pub(super) mod statements;
#[cfg(test)]
mod tests;

use crate::base::registry::{Node, Param, Params, Value};
use crate::error::{Error, Place, Result};
use crate::formats::Fit;
use crate::formats::native::check_film;
use crate::scene::desc::{Content, Loss, ObjectDesc, SceneDesc};
use glam::{DAffine3, DVec3};
use looks::Look;
use soup::Soup;
use stack::TransformStack;
use statements::Statement;
use std::path::{Path, PathBuf};

/// How a text looks to a format of commands: the first command that is in one of `own` and `others` and not in both
/// decides; with none, any that all such formats have makes it possible.
pub(super) fn fit(text: &[u8], own: &[&str], others: &[&str]) -> Fit {
    let mut fit = Fit::Foreign;
    for line in text.split(|b| *b == b'\n') {
        let word = line.trim_ascii_start().split(u8::is_ascii_whitespace).next().unwrap_or_default();
        let Ok(word) = std::str::from_utf8(word) else { continue };
        match (own.contains(&word), others.contains(&word)) {
            (true, false) => return Fit::Sure,
            (false, true) => return Fit::Foreign,
            (true, true) => fit = Fit::Possible,
            (false, false) if SHARED.iter().any(|words| words.contains(&word)) => fit = Fit::Possible,
            (false, false) => {}
        }
    }
    fit
}

/// Commands of every such format.
const SHARED: [&[&str]; 3] = [&TransformStack::WORDS, &Look::WORDS, &Soup::WORDS];

/// A node made of a statement.
pub(super) fn node(kind: &str, place: &Place, params: Vec<(&str, Value)>) -> Node {
    let list =
        params.into_iter().map(|(name, value)| Param { name: name.to_owned(), value, place: place.clone() });
    let params = Params { list: list.collect(), place: place.clone() };
    Node { kind: kind.to_owned(), params, place: place.clone() }
}

/// Three numbers as a parameter.
pub(super) fn numbers(v: [f64; 3]) -> Value {
    Value::Numbers(v.to_vec())
}

/// A shape of one look, placed.
pub(super) fn object(shape: Node, material: &str, transform: DAffine3) -> ObjectDesc {
    ObjectDesc {
        name: String::new(),
        place: shape.place.clone(),
        content: Content::Shape(shape),
        materials: vec![material.to_owned()],
        transform,
    }
}

/// `size W H`.
pub(super) fn film_size(s: &mut Statement) -> Result<[u32; 2]> {
    let size = [s.integer(1, i64::from(u32::MAX))? as u32, s.integer(1, i64::from(u32::MAX))? as u32];
    check_film(size).map_err(|m| s.error(m))?;
    Ok(size)
}

/// `camera EYE(3) CENTER(3) UP(3) FOV`, the vertical angle of view as the program takes it.
pub(super) fn camera(s: &mut Statement, fov: impl Fn(f64) -> f64) -> Result<Node> {
    let [eye, look_at, up] = [s.vector()?, s.vector()?, s.vector()?];
    let fov_deg = fov(s.number()?);
    let params = vec![
        ("eye", numbers(eye)),
        ("look_at", numbers(look_at)),
        ("up", numbers(up)),
        ("fov_deg", Value::Number(fov_deg)),
    ];
    Ok(node("perspective", &s.place(), params))
}

/// A radius of more than 0.
pub(super) fn radius(s: &mut Statement) -> Result<f64> {
    match s.number()? {
        r if r > 0.0 => Ok(r),
        r => Err(s.error(format!("`{}` takes a radius of more than 0, not {r}", s.word))),
    }
}

/// Constant, linear and quadratic terms, not all 0.
pub(super) fn attenuation(s: &mut Statement) -> Result<[f64; 3]> {
    let terms = s.color()?;
    if terms == [0.0; 3] {
        return Err(s.error("`attenuation` takes three numbers that are not all 0"));
    }
    Ok(terms)
}

/// The command line says where a picture goes.
pub(super) fn output(s: &mut Statement, scene: &mut SceneDesc) {
    let named = s.remainder("a picture").unwrap_or_default();
    let what = format!("the picture's name, {named}: it is given when rendering");
    scene.losses.push(Loss { section: "film", place: s.place(), what });
}

/// `point POSITION(3) COLOR(3)`, with the attenuation that holds, or `directional DIRECTION(3) COLOR(3)`. Both take the
/// present transform.
pub(super) fn light(s: &mut Statement, top: DAffine3, attenuation: [f64; 3]) -> Result<Node> {
    let place = s.place();
    let (at, color) = (DVec3::from_array(s.vector()?), s.color()?);
    if s.word == "point" {
        let params = vec![
            ("position", numbers(top.transform_point3(at).to_array())),
            ("intensity", numbers(color)),
            ("attenuation", numbers(attenuation)),
        ];
        return Ok(node("point", &place, params));
    }
    // The file says where the light is; ours say where it shines.
    let direction = -top.transform_vector3(at);
    if direction.length_squared() == 0.0 {
        return Err(s.error("`directional` takes a direction that is not zero, then a colour"));
    }
    let params = vec![("direction", numbers(direction.to_array())), ("irradiance", numbers(color))];
    Ok(node("directional", &place, params))
}

/// How far up from the scene's folder its files are looked for: the programs of these formats were started in a folder
/// above it.
const FOLDERS_UP: usize = 3;

/// The file or folder that a statement at `place` names: relative to the scene's folder, or to one above it.
pub(super) fn locate(scene: &Path, named: &str, place: &Place) -> Result<PathBuf> {
    let folder = scene.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut tried = folder.to_owned();
    for _ in 0..=FOLDERS_UP {
        // In full: whoever opens it may have another idea of where names start from. A device or a pipe may never end.
        if let Ok(path) = tried.join(named).canonicalize()
            && (path.is_file() || path.is_dir())
        {
            return Ok(path);
        }
        tried.push("..");
    }
    let up = format!("{} or the {FOLDERS_UP} folders above it", folder.display());
    Err(Error::file(Path::new(named), "open", format!("there is no such file in {up} (named at {place})")))
}
