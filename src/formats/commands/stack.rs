//! The stack of transforms, each multiplied from the right, as in OpenGL.

use super::statements::Statement;
use crate::error::Result;
use glam::{DAffine3, DVec3};

/// Transforms; the last is the present one.
pub struct TransformStack {
    below: Vec<DAffine3>,
    top: DAffine3,
}

/// Deeper than any scene and shallow enough for any memory.
const MOST: usize = 1 << 16;

impl Default for TransformStack {
    fn default() -> Self {
        TransformStack { below: Vec::new(), top: DAffine3::IDENTITY }
    }
}

impl TransformStack {
    /// Commands that [`TransformStack::apply`] takes.
    pub const WORDS: [&'static str; 5] = ["translate", "scale", "rotate", "pushTransform", "popTransform"];

    /// The present transform.
    pub fn top(&self) -> DAffine3 {
        self.top
    }

    /// Does what a statement says; false if it is none of [`TransformStack::WORDS`].
    ///
    /// # Errors
    /// Bad numbers; a pop without a push; a stack that is too deep.
    pub fn apply(&mut self, s: &mut Statement) -> Result<bool> {
        match s.word {
            "translate" => self.multiply(DAffine3::from_translation(DVec3::from_array(s.vector()?))),
            "scale" => self.multiply(DAffine3::from_scale(DVec3::from_array(s.vector()?))),
            "rotate" => {
                let axis = DVec3::from_array(s.vector()?);
                let degrees = s.number()?;
                // Scaled first: the length of a very long or short vector over- or underflows.
                let Some(axis) = (axis / axis.abs().max_element()).try_normalize() else {
                    return Err(s.error("`rotate` takes an axis that is not zero, then degrees"));
                };
                self.multiply(DAffine3::from_axis_angle(axis, degrees.to_radians()));
            }
            "pushTransform" if self.below.len() >= MOST => {
                return Err(s.error(format!("more than {MOST} transforms are pushed")));
            }
            "pushTransform" => self.below.push(self.top),
            "popTransform" => match self.below.pop() {
                Some(below) => self.top = below,
                None => return Err(s.error("`popTransform` without a `pushTransform` before it")),
            },
            _ => return Ok(false),
        }
        Ok(true)
    }

    fn multiply(&mut self, by: DAffine3) {
        self.top *= by;
    }
}
