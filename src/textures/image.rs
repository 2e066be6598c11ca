//! A picture over the unit square of uv.

use crate::base::image_data::{ImageData, LINEAR8_TO_LINEAR, SRGB8_TO_LINEAR, Texels};
use crate::base::registry::{ParamKind, ParamSpec, Params, Row, Value};
use crate::base::texture::Texture;
use crate::color::Rgb;
use crate::error::Result;
use crate::textures::mip;
use glam::Vec2;
use std::sync::{Arc, OnceLock};

const MAX_SCALE: f64 = 1e6;

pub(super) const ROW: Row<dyn Texture> = Row {
    kind: "image",
    doc: "a picture over the unit square of uv, its first row at v = 1",
    params: &[
        ParamSpec { name: "path", kind: ParamKind::Image, default: None, doc: "the picture's file" },
        ParamSpec {
            name: "filter",
            kind: ParamKind::Choice(&["bilinear", "trilinear", "nearest"]),
            default: Some("bilinear"),
            doc: "trilinear also averages over the ray's footprint, for a third more memory; nearest blends nothing",
        },
        ParamSpec {
            name: "wrap",
            kind: ParamKind::Choice(&["repeat", "clamp", "mirror"]),
            default: Some("repeat"),
            doc: "what lies beyond the unit square",
        },
        ParamSpec {
            name: "encoding",
            kind: ParamKind::Choice(&["srgb", "linear"]),
            default: Some("srgb"),
            doc: "how 8-bit values are to be read; floats are linear always",
        },
        ParamSpec {
            name: "uv_scale",
            kind: ParamKind::Vector2,
            default: Some("1"),
            doc: "copies per unit of u and of v; negative flips, 0 is refused; up to 1e6",
        },
        ParamSpec {
            name: "uv_offset",
            kind: ParamKind::Vector2,
            default: Some("0"),
            doc: "added to uv after the scale; up to 1e6",
        },
    ],
    build: |p| Ok(Arc::new(ImageTexture::from_params(p)?)),
    samples,
};

fn samples() -> Vec<Params> {
    let bytes = |w: usize, h: usize| -> Vec<[u8; 4]> {
        (0..w * h).map(|i| [i * 71 % 256, i * 37 % 256, i * 113 % 256, 255].map(|v| v as u8)).collect()
    };
    let image = |width, height, texels| Value::image(ImageData { width, height, texels });
    let floats = (0..35).map(|i| [i as f32, 0.25, (i * i % 7) as f32]).collect();
    vec![
        Params::new().with("path", image(5, 3, Texels::Srgb8(bytes(5, 3)))),
        Params::new()
            .with("path", image(6, 7, Texels::Linear8(bytes(6, 7))))
            .with("wrap", Value::Text("mirror".into()))
            .with("uv_scale", Value::Numbers(vec![-2.25, 1.5]))
            .with("uv_offset", Value::Numbers(vec![0.4, -3.3])),
        Params::new()
            .with("path", image(7, 5, Texels::F32(floats)))
            .with("filter", Value::Text("trilinear".into()))
            .with("wrap", Value::Text("clamp".into()))
            .with("uv_scale", Value::Number(1.75))
            .with("uv_offset", Value::Number(-0.5)),
        Params::new()
            .with("path", image(1, 1, Texels::Srgb8(vec![[255, 128, 0, 0]])))
            .with("encoding", Value::Text("linear".into())),
        Params::new()
            .with("path", image(6, 7, Texels::Linear8(bytes(6, 7))))
            .with("filter", Value::Text("nearest".into()))
            .with("wrap", Value::Text("mirror".into()))
            .with("uv_scale", Value::Numbers(vec![-2.25, 1.5]))
            .with("uv_offset", Value::Numbers(vec![0.4, -3.3])),
        Params::new()
            .with("path", image(5, 3, Texels::Srgb8(bytes(5, 3))))
            .with("filter", Value::Text("nearest".into()))
            .with("wrap", Value::Text("clamp".into()))
            .with("uv_scale", Value::Number(1.75))
            .with("uv_offset", Value::Number(-0.5)),
        Params::new()
            .with("path", image(5, 3, Texels::Srgb8(bytes(5, 3))))
            .with("filter", Value::Text("nearest".into()))
            .with("uv_offset", Value::Number(0.3)),
    ]
}

/// What lies beyond the unit square.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wrap {
    Repeat,
    Clamp,
    Mirror,
}

/// How texels become a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Blend {
    /// Linearly between the centres of neighbours.
    Linear,
    /// Not at all: each texel fills its own square.
    None,
}

/// Two neighbouring texels along an axis and the weight of the second.
struct Tap {
    i0: usize,
    i1: usize,
    f: f32,
}

/// `x.floor()` without a library call where the target has no instruction for it; exact for |x| < 2^31.
#[inline]
fn floor(x: f32) -> f32 {
    let t = x as i32 as f32;
    if t > x { t - 1.0 } else { t }
}

impl Wrap {
    /// Where `s` falls among `n` texels that span [0, 1], in [0, n]. Any `s` is allowed, even NaN, which counts as 0.
    #[inline]
    fn position(self, s: f32, n: usize) -> f32 {
        let s = match self {
            Wrap::Repeat => s - floor(s),
            Wrap::Clamp => s,
            Wrap::Mirror => (s - 2.0 * floor(0.5 * s + 0.5)).abs(),
        };
        // `max` turns NaN into 0, where `clamp` would keep it.
        (s.max(0.0) * n as f32).min(n as f32)
    }

    /// The texel that `s` falls on.
    #[inline]
    fn nearest(self, s: f32, n: usize) -> usize {
        (self.position(s, n) as usize).min(n - 1)
    }

    /// The texels around `s`.
    #[inline]
    fn tap(self, s: f32, n: usize) -> Tap {
        let x = self.position(s, n) - 0.5;
        let low = floor(x);
        let i = low as i32;
        let last = n - 1;
        let (before, after) = if self == Wrap::Repeat { (last, 0) } else { (0, last) };
        Tap {
            i0: if i < 0 { before } else { (i as usize).min(last) },
            i1: if i >= last as i32 { after } else { (i + 1) as usize },
            f: x - low,
        }
    }

    /// Adds to `weights` what each of the texels that span [0, 1] contributes to the integral from `a` to `b`.
    fn integrate(self, a: f64, b: f64, blend: Blend, weights: &mut [f64]) {
        let n = weights.len();
        // Between the centres of neighbours (without blending: between their edges) the filter is linear, so that the
        // middle of a stretch stands for all of it; whole periods count each texel alike.
        let (mut a, mut b) = (a, b);
        match self {
            Wrap::Repeat | Wrap::Mirror => {
                let period = if self == Wrap::Repeat { 1.0 } else { 2.0 };
                let whole = ((b - a) / period).floor() * period;
                weights.iter_mut().for_each(|w| *w += whole / n as f64);
                b -= whole;
                let shift = (a / period).floor() * period;
                (a, b) = (a - shift, b - shift);
            }
            Wrap::Clamp => {
                weights[0] += (b.min(0.0) - a).max(0.0);
                weights[n - 1] += (b - a.max(1.0)).max(0.0);
                (a, b) = (a.clamp(0.0, 1.0), b.clamp(0.0, 1.0));
            }
        }
        let knot = if blend == Blend::Linear { 0.5 } else { 0.0 };
        let mut from = a;
        while from < b {
            let next = ((from * n as f64 - knot).floor() + 1.0 + knot) / n as f64;
            let to = if next > from { next.min(b) } else { b };
            let middle = (0.5 * (from + to)) as f32;
            match blend {
                Blend::Linear => {
                    let tap = self.tap(middle, n);
                    weights[tap.i0] += (to - from) * (1.0 - tap.f as f64);
                    weights[tap.i1] += (to - from) * tap.f as f64;
                }
                Blend::None => weights[self.nearest(middle, n)] += to - from,
            }
            from = to;
        }
    }
}

/// A picture with the curve that decodes its bytes.
struct Level {
    image: Arc<ImageData>,
    curve: &'static [f32; 256],
}

impl Level {
    #[inline]
    fn bilinear(&self, s: Vec2, wrap: Wrap) -> Rgb {
        let (w, h) = (self.image.width, self.image.height);
        let x = wrap.tap(s.x, w);
        let y = wrap.tap(s.y, h);
        // The top row comes first, and v points up.
        let (r0, r1) = ((h - 1 - y.i0) * w, (h - 1 - y.i1) * w);
        let i = [r0 + x.i0, r0 + x.i1, r1 + x.i0, r1 + x.i1];
        let [a, b, c, d] = match &self.image.texels {
            Texels::Srgb8(t) | Texels::Linear8(t) => {
                i.map(|i| Rgb::from([0, 1, 2].map(|c| self.curve[t[i][c] as usize])))
            }
            Texels::F32(t) => i.map(|i| Rgb::from(t[i])),
        };
        a.lerp(b, x.f).lerp(c.lerp(d, x.f), y.f)
    }

    #[inline]
    fn nearest(&self, s: Vec2, wrap: Wrap) -> Rgb {
        let (w, h) = (self.image.width, self.image.height);
        let i = (h - 1 - wrap.nearest(s.y, h)) * w + wrap.nearest(s.x, w);
        match &self.image.texels {
            Texels::Srgb8(t) | Texels::Linear8(t) => {
                Rgb::from([0, 1, 2].map(|c| self.curve[t[i][c] as usize]))
            }
            Texels::F32(t) => Rgb::from(t[i]),
        }
    }
}

struct ImageTexture {
    /// The picture, then each half the size of the one before; one alone unless trilinear.
    levels: Vec<Level>,
    blend: Blend,
    wrap: Wrap,
    scale: Vec2,
    offset: Vec2,
    mean: OnceLock<Rgb>,
}

impl ImageTexture {
    fn from_params(p: &Params) -> Result<Self> {
        let image = p.image("path")?;
        let texels = match &image.texels {
            Texels::Srgb8(t) | Texels::Linear8(t) => t.len(),
            Texels::F32(t) => t.len(),
        };
        if texels == 0 || image.width.checked_mul(image.height) != Some(texels) {
            return Err(p.error("path", "holds no whole picture"));
        }
        let curve = match (p.text_or("encoding", "")?, &image.texels) {
            ("linear", _) | ("", Texels::Linear8(_)) => &*LINEAR8_TO_LINEAR,
            _ => &*SRGB8_TO_LINEAR,
        };
        let wrap = match p.text_or("wrap", "repeat")? {
            "clamp" => Wrap::Clamp,
            "mirror" => Wrap::Mirror,
            _ => Wrap::Repeat,
        };
        let mut levels = vec![Level { image: image.clone(), curve }];
        let filter = p.text_or("filter", "bilinear")?;
        let blend = if filter == "nearest" { Blend::None } else { Blend::Linear };
        if filter == "trilinear" {
            levels.extend(mip::chain(&image, curve).into_iter().map(|image| Level { image, curve }));
        }
        let pair = |name: &str, default: f64| -> Result<Vec2> {
            let v = p.vector2_or(name, [default; 2])?;
            if v.iter().any(|s| s.abs() > MAX_SCALE) {
                return Err(p.error(name, format!("is outside {} to {MAX_SCALE}", -MAX_SCALE)));
            }
            Ok(Vec2::new(v[0] as f32, v[1] as f32))
        };
        let (scale, offset) = (pair("uv_scale", 1.0)?, pair("uv_offset", 0.0)?);
        if scale.x == 0.0 || scale.y == 0.0 {
            return Err(p.error("uv_scale", "must not be 0"));
        }
        Ok(ImageTexture { levels, blend, wrap, scale, offset, mean: OnceLock::new() })
    }

    /// The exact integral of the filtered picture over the unit square of uv.
    fn integral(&self) -> Rgb {
        let axis = |scale: f32, offset: f32, n: usize| {
            let (a, b) = (offset as f64, offset as f64 + scale as f64);
            let mut weights = vec![0.0; n];
            self.wrap.integrate(a.min(b), a.max(b), self.blend, &mut weights);
            weights.iter_mut().for_each(|w| *w /= scale.abs() as f64);
            weights
        };
        let level = &self.levels[0];
        let (w, h) = (level.image.width, level.image.height);
        let columns = axis(self.scale.x, self.offset.x, w);
        let rows = axis(self.scale.y, self.offset.y, h);
        let mut sum = [0f64; 3];
        for (y, row) in rows.iter().rev().enumerate() {
            for (x, column) in columns.iter().enumerate() {
                let i = y * w + x;
                let texel = match &level.image.texels {
                    Texels::Srgb8(t) | Texels::Linear8(t) => [0, 1, 2].map(|c| level.curve[t[i][c] as usize]),
                    Texels::F32(t) => t[i],
                };
                sum.iter_mut().zip(texel).for_each(|(s, v)| *s += row * column * v as f64);
            }
        }
        Rgb::from(sum.map(|s| s as f32))
    }
}

impl Texture for ImageTexture {
    fn eval(&self, uv: Vec2, footprint: f32) -> Rgb {
        let s = uv * self.scale + self.offset;
        if self.blend == Blend::None {
            return self.levels[0].nearest(s, self.wrap);
        }
        let last = self.levels.len() - 1;
        if last == 0 || footprint <= 0.0 {
            return self.levels[0].bilinear(s, self.wrap);
        }
        // Williams, "Pyramidal Parametrics", SIGGRAPH 1983: the level whose texels are as wide as the footprint.
        let base = &self.levels[0].image;
        let texels = (self.scale.abs() * Vec2::new(base.width as f32, base.height as f32)).max_element();
        let level = (footprint * texels).max(1.0).log2().min(last as f32);
        let (low, f) = (level as usize, level.fract());
        let fine = self.levels[low].bilinear(s, self.wrap);
        if f == 0.0 {
            return fine;
        }
        fine.lerp(self.levels[low + 1].bilinear(s, self.wrap), f)
    }

    fn uses_footprint(&self) -> bool {
        self.levels.len() > 1
    }

    fn mean(&self) -> Rgb {
        *self.mean.get_or_init(|| self.integral())
    }
}

#[cfg(test)]
mod tests;
