//! Looks: what the commands before a shape say of its surface, each a material of the scene.

use super::statements::Statement;
use crate::base::registry::Node;
use crate::error::{Place, Result};
use crate::scene::desc::Named;
use std::collections::HashMap;

/// The terms that every such format has.
#[derive(Debug, Clone, PartialEq)]
pub struct Look {
    /// Shown without any light.
    pub ambient: [f64; 3],
    /// Diffuse reflectance.
    pub diffuse: [f64; 3],
    /// Colour of the highlight.
    pub specular: [f64; 3],
    /// Emitted.
    pub emission: [f64; 3],
    /// Exponent of the highlight.
    pub shininess: f64,
    /// What else there is to a format's looks.
    pub extra: Extra,
}

/// What some formats add.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Extra {
    /// A perfect mirror and nothing else.
    pub is_mirror: bool,
    /// Picture instead of the diffuse reflectance, as the file names it.
    pub texture: Option<String>,
    /// Whether v counts from the top row of that picture instead of the bottom one.
    pub v_down: bool,
    /// GGX facets of this width instead of the exponent.
    pub ggx_alpha: Option<f64>,
}

impl Default for Look {
    fn default() -> Self {
        Look {
            ambient: [0.0; 3],
            diffuse: [0.0; 3],
            specular: [0.0; 3],
            emission: [0.0; 3],
            shininess: 1.0,
            extra: Extra::default(),
        }
    }
}

impl Look {
    /// Commands that [`Look::apply`] takes.
    pub const WORDS: [&'static str; 5] = ["ambient", "diffuse", "specular", "emission", "shininess"];

    /// Does what a statement says; false if it is none of [`Look::WORDS`].
    pub fn apply(&mut self, s: &mut Statement) -> Result<bool> {
        match s.word {
            "ambient" => self.ambient = s.color()?,
            "diffuse" => self.diffuse = s.color()?,
            "specular" => self.specular = s.color()?,
            "emission" => self.emission = s.color()?,
            "shininess" => {
                let x = s.number()?;
                if !(0.0..=1e6).contains(&x) {
                    return Err(s.error(format!("`shininess` takes a number from 0 to 1e6, not {x}")));
                }
                self.shininess = x;
            }
            _ => return Ok(false),
        }
        Ok(true)
    }
}

/// The materials made so far: equal looks are one.
#[derive(Default)]
pub struct Looks {
    numbers: HashMap<String, usize>,
    /// For the scene.
    pub materials: Vec<Named<Node>>,
}

impl Looks {
    /// The name of a look's material, made by `make` when it is met first.
    pub fn name_of(
        &mut self,
        look: &Look,
        place: &Place,
        make: impl FnOnce() -> Result<Node>,
    ) -> Result<String> {
        // Its text tells two looks apart to the last bit of their numbers.
        let key = format!("{look:?}");
        let next = self.materials.len();
        let number = *self.numbers.entry(key).or_insert(next);
        if number == next {
            let value = make()?;
            self.materials.push(Named { name: format!("look-{}", next + 1), value, place: place.clone() });
        }
        Ok(self.materials[number].name.clone())
    }
}
