//! Pictures as they are compared: three channels a pixel, linear or after the encoding of the reference.

use skylit::base::image_data::{Encoding as Stored, Texels};
use skylit::base::pixel_rect::PixelRect;
use skylit::color::linear_to_srgb;
use skylit::error::{Error, Result};
use skylit::image::read::read_image;
use std::path::Path;

/// How a reference holds radiance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Encoding {
    /// Floats, as they are.
    Linear,
    /// 8 bits: radiance times 255, clipped and rounded down.
    Course,
    /// As `Course`, of radiance to the power of 1 / 2.2.
    Gamma22,
    /// 8 bits by the sRGB curve, rounded to the nearest.
    Srgb,
}

impl Encoding {
    /// A value of the reference's kind: radiance, or 0 to 255.
    pub fn encode(self, radiance: f32) -> f32 {
        let clipped = radiance.clamp(0.0, 1.0);
        match self {
            Encoding::Linear => radiance,
            Encoding::Course => (clipped * 255.0).floor(),
            Encoding::Gamma22 => (clipped.powf(1.0 / 2.2) * 255.0).floor(),
            Encoding::Srgb => (linear_to_srgb(clipped) * 255.0).round(),
        }
    }
}

/// Values of a picture, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Pixels {
    /// In pixels.
    pub width: usize,
    /// In pixels.
    pub height: usize,
    /// `width * height` values of three channels.
    pub data: Vec<[f32; 3]>,
}

impl Pixels {
    /// A reference file, its values untouched: radiance of a float file, 0 to 255 of one of bytes.
    ///
    /// # Errors
    /// Those of [`read_image`].
    pub fn read(path: &Path) -> Result<Pixels> {
        let image = read_image(path, Some(Stored::Linear))?;
        let bytes = |t: &Vec<[u8; 4]>| t.iter().map(|&[r, g, b, _]| [r, g, b].map(f32::from)).collect();
        let data = match &image.texels {
            Texels::F32(t) => t.clone(),
            Texels::Linear8(t) | Texels::Srgb8(t) => bytes(t),
        };
        Ok(Pixels { width: image.width, height: image.height, data })
    }

    /// The part inside a window.
    ///
    /// # Errors
    /// Where the window does not lie inside.
    pub fn cropped(&self, window: PixelRect) -> Result<Pixels> {
        let [x0, y0, x1, y1] = [window.x0, window.y0, window.x1, window.y1].map(|v| v as usize);
        if x1 > self.width || y1 > self.height || x0 >= x1 || y0 >= y1 {
            let size = format!("{}x{}", self.width, self.height);
            return Err(Error::Usage(format!("{window:?} does not lie inside of a reference of {size}")));
        }
        let rows = (y0..y1).flat_map(|y| &self.data[y * self.width + x0..y * self.width + x1]);
        Ok(Pixels { width: x1 - x0, height: y1 - y0, data: rows.copied().collect() })
    }

    /// Mean of each channel, summed in double.
    pub fn means(&self) -> [f64; 3] {
        let sum = |c: usize| self.data.iter().map(|p| f64::from(p[c])).sum::<f64>();
        [0, 1, 2].map(|c| sum(c) / self.data.len().max(1) as f64)
    }
}
