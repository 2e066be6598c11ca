//! A checkerboard of two colours.

use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::texture::Texture;
use crate::color::Rgb;
use crate::error::Result;
use glam::Vec2;
use std::sync::Arc;

const MAX_SCALE: f64 = 1e6;

pub(super) const ROW: Row<dyn Texture> = Row {
    kind: "checker",
    doc: "a checkerboard of two colours",
    params: &[
        ParamSpec {
            name: "a",
            kind: ParamKind::Color,
            default: Some("0.8"),
            doc: "colour of the square at uv (0, 0) and of every other one",
        },
        ParamSpec { name: "b", kind: ParamKind::Color, default: Some("0.2"), doc: "colour of the rest" },
        ParamSpec {
            name: "uv_scale",
            kind: ParamKind::Vector2,
            default: Some("8"),
            doc: "squares per unit of u and of v, up to 1e6",
        },
    ],
    build: |p| Ok(Arc::new(Checker::from_params(p)?)),
    samples: || {
        vec![
            Params::new(),
            Params::new()
                .with("a", Value::Numbers(vec![0.9, 0.1, 0.0]))
                .with("b", Value::Number(0.5))
                .with("uv_scale", Value::Numbers(vec![2.5, -1.25])),
        ]
    },
};

/// Point-sampled: its edges are smoothed by the samples of a pixel, not by the footprint.
struct Checker {
    a: Rgb,
    b: Rgb,
    scale: Vec2,
}

impl Checker {
    fn from_params(p: &Params) -> Result<Self> {
        let scale = p.vector2_or("uv_scale", [8.0; 2])?;
        if scale.iter().any(|s| s.abs() > MAX_SCALE) {
            return Err(p.error("uv_scale", format!("is outside {} to {MAX_SCALE}", -MAX_SCALE)));
        }
        Ok(Checker {
            a: p.color_or("a", [0.8; 3])?,
            b: p.color_or("b", [0.2; 3])?,
            scale: Vec2::new(scale[0] as f32, scale[1] as f32),
        })
    }
}

/// 1 or -1 by turns over unit intervals, 1 in [0, 1).
fn wave(x: f32) -> f32 {
    if x - 2.0 * (0.5 * x).floor() < 1.0 { 1.0 } else { -1.0 }
}

/// Mean of [`wave`] from 0 to `x`.
fn wave_mean(x: f32) -> f32 {
    if x == 0.0 {
        return 1.0;
    }
    // The integral of the wave is a triangle wave: the distance to the nearest even number. The wave is odd about
    // 0, so the mean over [x, 0] for a negative x is the negated one over [0, -x].
    let distance = (x - 2.0 * (0.5 * x).round()).abs();
    distance / x
}

impl Texture for Checker {
    fn eval(&self, uv: Vec2, _footprint: f32) -> Rgb {
        let s = uv * self.scale;
        if wave(s.x) * wave(s.y) > 0.0 { self.a } else { self.b }
    }

    fn mean(&self) -> Rgb {
        // The board is a product of two waves, so its mean is the product of their means.
        self.b.lerp(self.a, 0.5 + 0.5 * wave_mean(self.scale.x) * wave_mean(self.scale.y))
    }
}
