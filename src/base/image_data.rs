//! A decoded picture: plain data, in the pixel format that keeps it small and exact.

use crate::color::{Rgb, srgb_to_linear};
use std::sync::LazyLock;

/// sRGB byte to linear value, exact to float rounding.
pub static SRGB8_TO_LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|i| srgb_to_linear(i as f32 / 255.0)));

/// byte / 255.
pub static LINEAR8_TO_LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|i| i as f32 / 255.0));

/// Pixel storage. Eight-bit pictures stay eight-bit (a 2048-texel cube map is 100 MB instead of 300).
#[derive(Debug, Clone, PartialEq)]
pub enum Texels {
    /// Encoded by the sRGB curve; alpha (linear) in the fourth byte.
    Srgb8(Vec<[u8; 4]>),
    /// Eight bits, linear.
    Linear8(Vec<[u8; 4]>),
    /// Linear Rec. 709 floats, no alpha.
    F32(Vec<[f32; 3]>),
}

/// How the values of an 8-bit picture are to be understood.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Encoding {
    /// The sRGB curve (the default for 8-bit files).
    #[default]
    Srgb,
    /// As they are (always so for HDR and EXR).
    Linear,
}

/// Row-major texels, the top row first. All values are finite and not negative (the reader guarantees it).
#[derive(Debug, Clone, PartialEq)]
pub struct ImageData {
    /// In pixels, at least 1.
    pub width: usize,
    /// In pixels, at least 1.
    pub height: usize,
    /// `width * height` texels.
    pub texels: Texels,
}

impl ImageData {
    /// Bytes of its texels.
    pub fn memory(&self) -> u64 {
        match &self.texels {
            Texels::Srgb8(t) | Texels::Linear8(t) => size_of_val(&t[..]) as u64,
            Texels::F32(t) => size_of_val(&t[..]) as u64,
        }
    }

    /// Linear value of a texel; `y` counts from the top.
    #[inline]
    pub fn texel(&self, x: usize, y: usize) -> Rgb {
        let i = y * self.width + x;
        match &self.texels {
            Texels::Srgb8(t) => decode8(&SRGB8_TO_LINEAR, t[i]),
            Texels::Linear8(t) => decode8(&LINEAR8_TO_LINEAR, t[i]),
            Texels::F32(t) => Rgb::from(t[i]),
        }
    }
}

#[inline]
fn decode8(curve: &[f32; 256], t: [u8; 4]) -> Rgb {
    Rgb::new(curve[t[0] as usize], curve[t[1] as usize], curve[t[2] as usize])
}
