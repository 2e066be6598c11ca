//! Pictures of a page.

use super::Picture;
use crate::color::{Rgb, linear_to_srgb};
use crate::error::{Error, Result};
use crate::image::tonemap::Look;
use crate::render::film::Film;

impl Picture {
    /// From display-linear colours, row by row, `size` pixels across and down.
    ///
    /// # Errors
    /// [`Error::Internal`] where they are not as many as that, which is a fault of ours.
    pub fn of_colors(size: [u32; 2], colors: impl Iterator<Item = Rgb>, caption: String) -> Result<Self> {
        let byte = |v: f32| (linear_to_srgb(v.clamp(0.0, 1.0)) * 255.0).round() as u8;
        let bytes: Vec<u8> = colors.flat_map(|c| [c.r, c.g, c.b].map(byte)).collect();
        let fail = |e: png::EncodingError| Error::Internal(format!("cannot write a picture: {e}"));
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, size[0], size[1]);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header().map_err(fail)?;
        writer.write_image_data(&bytes).map_err(fail)?;
        writer.finish().map_err(fail)?;
        Ok(Picture { png: file, caption, pixelated: true })
    }

    /// A film as it is usually shown.
    ///
    /// # Errors
    /// See [`Picture::of_colors`].
    pub fn of_film(film: &Film, caption: String) -> Result<Self> {
        let (window, look) = (film.window(), Look::default());
        let colors = window.pixels().map(|(x, y)| look.apply(film.mean(x, y)));
        Picture::of_colors([window.width(), window.height()], colors, caption)
    }
}
