//! L2: skies, one file a kind.

mod constant;
pub mod cube;
mod cylinder;
mod gradient;
pub mod sphere;
mod texel;

use crate::base::registry::{ParamKind, ParamSpec, Row};
use crate::base::skybox::Skybox;

/// Every kind of sky.
pub static REGISTRY: &[Row<dyn Skybox>] = &[constant::ROW, cube::ROW, gradient::ROW, sphere::ROW];

/// How the values of an 8-bit picture are meant. Whoever reads the picture obeys it; a sky is given texels that know.
const ENCODING: ParamSpec = ParamSpec {
    name: "encoding",
    kind: ParamKind::Choice(&["srgb", "linear"]),
    default: Some("srgb"),
    doc: "how 8-bit values are meant; HDR and EXR are always linear",
};

#[cfg(test)]
mod tests;
