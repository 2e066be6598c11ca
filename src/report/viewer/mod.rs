//! Pictures to be looked at side by side, under a wipe, in turn, as maps of their errors, down to the pixel.
//!
//! The page holds their values, not pictures of them: exposure and tone map are sliders, and the pointer reads numbers.

pub(super) mod pack;
#[cfg(test)]
mod tests;

use crate::base::pixel_rect::PixelRect;
use crate::error::{Error, Result};
use crate::image::false_color::FalseColour;
use crate::render::film::Film;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use pack::{Packed, pack, pack_map};
use serde::Serialize;

/// A reference and pictures that are held against it, all of one size.
#[derive(Debug, Clone, Default)]
pub struct Viewer {
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// What is added to the coordinates that are shown: where the left top pixel stands in the whole picture.
    pub origin: [usize; 2],
    /// The reference first, then at least one test.
    pub pictures: Vec<Viewed>,
    /// Errors pixel by pixel that the page cannot work out by itself.
    pub maps: Vec<ErrorMap>,
    /// Where to look first.
    pub regions: Vec<Region>,
    /// Whether values are kept to the last bit, whatever it takes.
    pub lossless: bool,
    /// Whether values are encoded for a display; else they are radiance.
    pub encoded: bool,
}

/// A picture of a [`Viewer`].
#[derive(Debug, Clone, Default)]
pub struct Viewed {
    /// Short: of the file, or of the kernel.
    pub name: String,
    /// Row by row, the top row first. Any floats, those that are no numbers too.
    pub rgb: Vec<[f32; 3]>,
    /// How it came to be: name and value.
    pub facts: Vec<(String, String)>,
}

/// One number a pixel: 0 is no error.
#[derive(Debug, Clone, Default)]
pub struct ErrorMap {
    /// The measure's name.
    pub metric: String,
    /// What it is, shown where the pointer rests.
    pub help: String,
    /// Which picture it is of, from 1.
    pub test: usize,
    /// Row by row, at least 0.
    pub values: Vec<f32>,
    /// What has the brightest colour; the largest value where it is none.
    pub high: Option<f32>,
}

/// A rectangle to fly to.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Region {
    /// What is wrong there.
    pub label: String,
    /// In which picture, from 1.
    pub test: usize,
    /// Left, top, width, height in pixels of these pictures.
    pub rect: [usize; 4],
}

/// What the script is told.
#[derive(Serialize)]
struct Config<'a> {
    size: [usize; 2],
    origin: [usize; 2],
    encoded: bool,
    pictures: Vec<PictureConfig<'a>>,
    maps: Vec<MapConfig<'a>>,
    regions: &'a [Region],
    /// 256 colours, three bytes each, in base64.
    scale: String,
}

#[derive(Serialize)]
struct PictureConfig<'a> {
    name: &'a str,
    format: &'static str,
    /// Pixels that the format cannot hold, with their values as text, as records have neither NaN nor infinity.
    exceptions: Vec<(usize, [String; 3])>,
    /// Largest error made by the format, as a part of a pixel's largest channel.
    error: f32,
}

#[derive(Serialize)]
struct MapConfig<'a> {
    metric: &'a str,
    help: &'a str,
    test: usize,
    high: f32,
}

/// A viewer as the template has it.
#[derive(Serialize)]
pub(super) struct Drawn {
    /// For the script; nothing in it ends the element that holds it.
    config: String,
    /// Planes, deflated, in base64: of the pictures, then of the maps.
    data: Vec<String>,
    label: String,
    encoded: bool,
    /// Names and facts, for people.
    pictures: Vec<PictureFacts>,
    /// Below the viewer: what the page holds.
    note: String,
}

#[derive(Serialize)]
struct PictureFacts {
    name: String,
    facts: Vec<(String, String)>,
}

impl Viewed {
    /// A film, in radiance.
    pub fn of_film(name: String, film: &Film) -> Self {
        let rgb = film.window().pixels().map(|(x, y)| film.mean(x, y)).map(|c| [c.r, c.g, c.b]);
        Viewed { name, rgb: rgb.collect(), facts: Vec::new() }
    }
}

impl Viewer {
    /// Pictures of a part of a film, the reference first.
    pub fn of_window(window: PixelRect, pictures: Vec<Viewed>) -> Self {
        let size = [window.width(), window.height()].map(|v| v as usize);
        Viewer { size, origin: [window.x0, window.y0].map(|v| v as usize), pictures, ..Viewer::default() }
    }

    /// What the page holds of it.
    ///
    /// # Errors
    /// [`Error::Internal`] where pictures are not of the viewer's size, which is a fault of ours.
    pub(super) fn drawn(&self) -> Result<Drawn> {
        let pixels = self.size[0] * self.size[1];
        let fits = self.pictures.iter().all(|p| p.rgb.len() == pixels);
        if !fits || self.pictures.len() < 2 || self.maps.iter().any(|m| m.values.len() != pixels) {
            return Err(Error::Internal("a viewer whose pictures are of another size than itself".into()));
        }
        let packed: Vec<Packed> =
            self.pictures.iter().map(|p| pack(&p.rgb, self.encoded, self.lossless)).collect();
        let mut data: Vec<String> = packed.iter().map(|p| STANDARD.encode(&p.bytes)).collect();
        let mut maps = Vec::new();
        for map in &self.maps {
            let largest = map.values.iter().copied().filter(|v| v.is_finite()).fold(0.0, f32::max);
            let high = map.high.unwrap_or(largest).max(f32::MIN_POSITIVE);
            data.push(STANDARD.encode(pack_map(&map.values, high)));
            maps.push(MapConfig { metric: &map.metric, help: &map.help, test: map.test, high });
        }
        let text = |v: f32| v.to_string();
        let pictures = self.pictures.iter().zip(&packed).map(|(p, packed)| PictureConfig {
            name: &p.name,
            format: packed.format.name(),
            exceptions: packed.exceptions.iter().map(|(i, v)| (*i, v.map(text))).collect(),
            error: packed.error,
        });
        let scale = (0..=255u8).flat_map(|i| FalseColour::Inferno.at(f32::from(i) / 255.0));
        let scale: Vec<u8> = scale.map(|v| (v * 255.0).round() as u8).collect();
        let config = Config {
            size: self.size,
            origin: self.origin,
            encoded: self.encoded,
            pictures: pictures.collect(),
            maps,
            regions: &self.regions,
            scale: STANDARD.encode(scale),
        };
        let config = serde_json::to_string(&config)
            .map_err(|e| Error::Internal(format!("cannot write the viewer: {e}")))?;
        let error = packed.iter().map(|p| p.error).fold(0.0, f32::max);
        let note = match error {
            0.0 => "The page holds every value to the last bit.".to_owned(),
            e => format!(
                "The page holds colours of nine bits a channel under a common exponent: within {:.2} % of a pixel's largest channel.",
                100.0 * e
            ),
        };
        // Only strings hold such a sign, where it may stand as an escape.
        let facts = |p: &Viewed| PictureFacts { name: p.name.clone(), facts: p.facts.clone() };
        Ok(Drawn {
            config: config.replace('<', "\\u003c"),
            data,
            label: self.label(),
            encoded: self.encoded,
            pictures: self.pictures.iter().map(facts).collect(),
            note,
        })
    }

    fn label(&self) -> String {
        let names: Vec<&str> = self.pictures.iter().map(|p| p.name.as_str()).collect();
        format!("Pictures: {}", names.join(", "))
    }
}
