//! Kinds that a program outside of the crate adds: the very files of the open-house test (tests/it/open_house), so
//! that the tests of each family run over them too.

#[path = "../../tests/it/open_house/light.rs"]
mod light;
#[path = "../../tests/it/open_house/material.rs"]
mod material;
#[path = "../../tests/it/open_house/shape.rs"]
mod shape;
#[path = "../../tests/it/open_house/sky.rs"]
mod sky;

use crate::scene::registry::Registry;

/// The crate's own kinds, and those from outside.
pub fn registry() -> Registry {
    let mut registry = Registry::default();
    registry.materials.push(material::ROW);
    registry.lights.push(light::ROW);
    registry.shapes.push(shape::ROW);
    registry.skies.push(sky::ROW);
    registry
}

#[test]
fn the_sky_from_outside_has_a_sound_row() {
    crate::testing::rows::check_rows("sky", &[sky::ROW]);
}
