//! L2: skies, one file a kind.

mod atmosphere;
mod baked;
mod constant;
pub mod cube;
mod cylinder;
mod daylight;
mod dome;
mod gradient;
mod nebula;
mod night;
mod noise;
pub mod presets;
mod spectrum;
pub mod sphere;
mod texel;
mod tiles;

use crate::base::registry::{ParamKind, ParamSpec, Params, Row};
use crate::base::skybox::Skybox;
use crate::error::Result;
use glam::DVec3;

/// Every kind of sky.
pub static REGISTRY: &[Row<dyn Skybox>] =
    &[constant::ROW, cube::ROW, daylight::ROW, gradient::ROW, nebula::ROW, night::ROW, sphere::ROW];

/// How the values of an 8-bit picture are meant. Whoever reads the picture obeys it; a sky is given texels that know.
const ENCODING: ParamSpec = ParamSpec {
    name: "encoding",
    kind: ParamKind::Choice(&["srgb", "linear"]),
    default: Some("srgb"),
    doc: "how 8-bit values are meant; HDR and EXR are always linear",
};

const fn number(
    name: &'static str,
    range: (f64, f64),
    default: &'static str,
    doc: &'static str,
) -> ParamSpec {
    ParamSpec { name, kind: ParamKind::Number { min: range.0, max: range.1 }, default: Some(default), doc }
}

const fn integer(
    name: &'static str,
    range: (i64, i64),
    default: &'static str,
    doc: &'static str,
) -> ParamSpec {
    ParamSpec { name, kind: ParamKind::Integer { min: range.0, max: range.1 }, default: Some(default), doc }
}

/// A whole number that sizes memory and so is checked here too.
fn size(p: &Params, name: &str, default: f64, largest: f64) -> Result<usize> {
    match p.number_or(name, default)? {
        v if (1.0..=largest).contains(&v) => Ok(v as usize),
        v => Err(p.error(name, format!("{v} is outside 1 to {largest}"))),
    }
}

/// The unit vector at an elevation and an azimuth (from +x towards +z), both in degrees.
fn toward(p: &Params, names: [&str; 2], defaults: [f64; 2]) -> Result<DVec3> {
    let elevation = p.number_or(names[0], defaults[0])?.clamp(-90.0, 90.0).to_radians();
    let azimuth = p.number_or(names[1], defaults[1])?.clamp(-360.0, 360.0).to_radians();
    let r = elevation.cos();
    Ok(DVec3::new(r * azimuth.cos(), elevation.sin(), r * azimuth.sin()).normalize())
}

#[cfg(test)]
mod tests;
