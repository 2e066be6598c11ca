//! A picture as its decoder hands it out: samples of one type, pixel by pixel.

use super::picture::{Picture, SampleKind};
use crate::base::image_data::{Encoding, ImageData, Texels};
use crate::color::srgb_to_linear;
use image::DynamicImage;

/// Samples of all channels, row-major from the top, channels side by side.
pub(super) enum Samples {
    U8(Vec<u8>),
    U16(Vec<u16>),
    F32(Vec<f32>),
}

/// A decoded picture of 1 to 4 channels: gray, gray and alpha, colour, colour and alpha.
pub(super) struct Raw {
    pub width: usize,
    pub height: usize,
    pub channels: usize,
    /// `width * height * channels` of them.
    pub samples: Samples,
}

impl Raw {
    /// Bits of whole numbers; nothing for floats.
    pub fn bits(&self) -> Option<u32> {
        match self.samples {
            Samples::U8(_) => Some(8),
            Samples::U16(_) => Some(16),
            Samples::F32(_) => None,
        }
    }

    /// Bare names of its channels.
    pub fn names(&self) -> &'static [&'static str] {
        match self.channels {
            1 => &["Y"],
            2 => &["Y", "A"],
            3 => &["R", "G", "B"],
            _ => &["R", "G", "B", "A"],
        }
    }

    /// A plane a channel; whole numbers are divided by the largest and stay encoded.
    pub fn into_picture(self) -> Picture {
        let mut picture = Picture::new(self.width, self.height);
        for (c, name) in self.names().iter().enumerate() {
            let of = c..;
            let data = match &self.samples {
                Samples::U8(v) => {
                    v[of].iter().step_by(self.channels).map(|&v| f32::from(v) / 255.0).collect()
                }
                Samples::U16(v) => {
                    v[of].iter().step_by(self.channels).map(|&v| f32::from(v) / 65535.0).collect()
                }
                Samples::F32(v) => v[of].iter().step_by(self.channels).copied().collect(),
            };
            picture.push(*name, SampleKind::Float, data);
        }
        picture
    }

    /// Texels of a texture or a sky; whole numbers are decoded as `encoding` says. Floats are as they stand.
    pub fn into_image(self, encoding: Encoding) -> ImageData {
        let n = self.channels;
        let texels = match self.samples {
            Samples::U8(v) => {
                let quads = v.chunks_exact(n).map(|p| {
                    let [r, g, b] = colour(p);
                    [r, g, b, if n.is_multiple_of(2) { p[n - 1] } else { u8::MAX }]
                });
                eight_bits(quads.collect(), encoding)
            }
            Samples::U16(v) => {
                let curve = curve16(encoding);
                Texels::F32(v.chunks_exact(n).map(|p| colour(p).map(|v| curve[usize::from(v)])).collect())
            }
            Samples::F32(v) if n == 3 => {
                // Reuses the allocation where its size allows.
                let copied = |(_, v): (_, Vec<f32>)| v.chunks_exact(3).map(colour).collect();
                Texels::F32(bytemuck::allocation::try_cast_vec(v).unwrap_or_else(copied))
            }
            Samples::F32(v) => Texels::F32(v.chunks_exact(n).map(colour).collect()),
        };
        ImageData { width: self.width, height: self.height, texels }
    }
}

/// Three values of a pixel of 1 to 4.
fn colour<T: Copy>(pixel: &[T]) -> [T; 3] {
    match pixel {
        [r, g, b, ..] => [*r, *g, *b],
        [y, ..] => [*y; 3],
        [] => unreachable!("a picture has channels"),
    }
}

pub(super) fn eight_bits(quads: Vec<[u8; 4]>, encoding: Encoding) -> Texels {
    match encoding {
        Encoding::Srgb => Texels::Srgb8(quads),
        Encoding::Linear => Texels::Linear8(quads),
    }
}

/// Linear value of every 16-bit number.
pub(super) fn curve16(encoding: Encoding) -> Vec<f32> {
    (0..=u16::MAX)
        .map(|v| f32::from(v) / 65535.0)
        .map(|v| if encoding == Encoding::Srgb { srgb_to_linear(v) } else { v })
        .collect()
}

/// What the `image` crate decoded.
impl From<DynamicImage> for Raw {
    fn from(picture: DynamicImage) -> Self {
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        let channels = usize::from(picture.color().channel_count());
        let samples = match picture {
            DynamicImage::ImageLuma8(i) => Samples::U8(i.into_raw()),
            DynamicImage::ImageLumaA8(i) => Samples::U8(i.into_raw()),
            DynamicImage::ImageRgb8(i) => Samples::U8(i.into_raw()),
            DynamicImage::ImageRgba8(i) => Samples::U8(i.into_raw()),
            DynamicImage::ImageLuma16(i) => Samples::U16(i.into_raw()),
            DynamicImage::ImageLumaA16(i) => Samples::U16(i.into_raw()),
            DynamicImage::ImageRgb16(i) => Samples::U16(i.into_raw()),
            DynamicImage::ImageRgba16(i) => Samples::U16(i.into_raw()),
            // Neither PNG nor JPEG holds floats.
            other => {
                let i = other.into_rgba32f();
                return Raw { width, height, channels: 4, samples: Samples::F32(i.into_raw()) };
            }
        };
        Raw { width, height, channels, samples }
    }
}
