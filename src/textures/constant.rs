//! The same colour everywhere.

use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::texture::Texture;
use crate::color::Rgb;
use crate::error::Result;
use glam::Vec2;
use std::sync::Arc;

pub(super) const ROW: Row<dyn Texture> = Row {
    kind: "constant",
    doc: "the same colour everywhere",
    params: &[ParamSpec {
        name: "value",
        kind: ParamKind::Color,
        default: Some("0.8"),
        doc: "the colour, linear Rec. 709",
    }],
    build: |p| Ok(Arc::new(Constant::from_params(p)?)),
    samples: || vec![Params::new(), Params::new().with("value", Value::Numbers(vec![0.1, 0.5, 3.0]))],
};

struct Constant {
    value: Rgb,
}

impl Constant {
    fn from_params(p: &Params) -> Result<Self> {
        Ok(Constant { value: p.color_or("value", [0.8; 3])? })
    }
}

impl Texture for Constant {
    fn eval(&self, _uv: Vec2, _footprint: f32) -> Rgb {
        self.value
    }

    fn constant(&self) -> Option<Rgb> {
        Some(self.value)
    }

    fn mean(&self) -> Rgb {
        self.value
    }
}
