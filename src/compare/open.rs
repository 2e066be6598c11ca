//! From files to a [`Pair`]: the same part, the same channels, one space.

use super::invalid::Invalid;
use super::pair::{Pair, Planes, Space};
use crate::base::image_data::Encoding;
use crate::color::{linear_to_srgb, srgb_to_linear};
use crate::error::{Error, Result};
use crate::image::load::{LoadOptions, Loaded, Stored, load};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// A picture with its name.
#[derive(Debug)]
pub struct Source {
    /// The file.
    pub path: PathBuf,
    /// What it holds.
    pub loaded: Loaded,
}

impl Source {
    /// Reads a file.
    ///
    /// # Errors
    /// See [`load`].
    pub fn read(path: &Path, options: &LoadOptions) -> Result<Self> {
        Ok(Source { path: path.to_owned(), loaded: load(path, options)? })
    }

    fn size(&self) -> [usize; 2] {
        [self.loaded.picture.width, self.loaded.picture.height]
    }

    fn names(&self) -> Vec<&str> {
        self.loaded.picture.planes.iter().map(|p| p.name.as_str()).collect()
    }
}

/// Which part of two pictures is compared, and how.
#[derive(Debug, Clone, Default)]
pub struct PairOptions {
    /// Channels by name; colours, or else all channels, where it is none.
    pub channels: Option<Vec<String>>,
    /// A part of the picture.
    pub crop: Option<Crop>,
    /// Pixels of the whole picture that count.
    pub mask: Option<Mask>,
    /// Both are multiplied by two to this power.
    pub exposure: f32,
    /// Where figures are taken; none is `Display` where both files hold whole numbers, else `Linear`.
    pub space: Option<Space>,
}

/// A part of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Crop {
    /// x0, x1, y0, y1 as fractions of width and height.
    Fractions([f64; 4]),
    /// Left, top, width, height in pixels.
    Pixels([usize; 4]),
}

/// Pixels that count.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mask {
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// Row by row.
    pub counted: Vec<bool>,
}

/// A pair with what is to be said of it.
#[derive(Debug)]
pub struct Opened {
    /// To be compared.
    pub pair: Pair,
    /// Of the reference and the test: what was left out.
    pub invalid: [Invalid; 2],
    /// What the reader should know of how the two were brought together.
    pub notes: Vec<String>,
}

/// Rows and columns of a picture.
#[derive(Debug, Clone, Copy)]
struct Window {
    origin: [usize; 2],
    size: [usize; 2],
}

/// Brings two pictures together.
///
/// # Errors
/// Pictures of different sizes (unless they are parts of one frame that overlap), or without channels in common; a crop
/// without pixels; a mask of another size; no pixel that counts.
pub fn open(reference: &Source, test: &Source, options: &PairOptions) -> Result<Opened> {
    let mut notes = Vec::new();
    let window = common_window(reference, test, &mut notes)?;
    let window = match options.crop {
        Some(crop) => cropped(window, crop)?,
        None => window,
    };
    let names = common_channels(reference, test, options, &mut notes)?;
    let both_whole = [reference, test].iter().all(|s| s.loaded.stored != Stored::Float);
    let space = options.space.unwrap_or(if both_whole { Space::Display } else { Space::Linear });
    let is_color = names == ["R", "G", "B"] || names == ["Y"];
    let sides = [reference, test];
    let mut planes: [Planes; 2] = sides.map(|s| {
        let plane = |name: &String| values(s, name, window, is_color.then_some(space), options.exposure);
        names.iter().map(plane).collect()
    });
    let pixels = window.size[0] * window.size[1];
    let mut counted = match &options.mask {
        Some(mask) => masked(mask, reference, window)?,
        None => vec![true; pixels],
    };
    let invalid = [0, 1].map(|i| Invalid::mark(&planes[i], window.size[0], window.origin, &mut counted));
    let all = counted.iter().all(|c| *c);
    if !all {
        for plane in planes.iter_mut().flatten() {
            plane.iter_mut().zip(&counted).filter(|(_, c)| !**c).for_each(|(v, _)| *v = 0.0);
        }
    }
    if counted.iter().all(|c| !*c) {
        return Err(Error::content(
            &test.path,
            "no pixel is left to compare: none is finite in both pictures and inside of the mask",
        ));
    }
    let mut pair = Pair::new(window.size, names, space, planes, (!all).then_some(counted));
    pair.origin = window.origin;
    Ok(Opened { pair, invalid, notes })
}

/// The part that both pictures have.
fn common_window(reference: &Source, test: &Source, notes: &mut Vec<String>) -> Result<Window> {
    let [r, t] = [&reference.loaded.picture, &test.loaded.picture];
    let (rs, ts) = (reference.size(), test.size());
    if rs == ts && (r.origin == t.origin || r.frame != t.frame) {
        return Ok(Window { origin: r.origin, size: rs });
    }
    if r.frame == t.frame {
        let from = [0, 1].map(|a| r.origin[a].max(t.origin[a]));
        let to = [0, 1].map(|a| (r.origin[a] + rs[a]).min(t.origin[a] + ts[a]));
        if from[0] < to[0] && from[1] < to[1] {
            let size = [to[0] - from[0], to[1] - from[1]];
            notes.push(format!(
                "the pictures are different parts of one frame: compared over the {}x{} pixels from ({}, {}) that both have",
                size[0], size[1], from[0], from[1]
            ));
            return Ok(Window { origin: from, size });
        }
    }
    let text = format!(
        "is {}x{}, and the reference {} is {}x{}{}",
        ts[0],
        ts[1],
        reference.path.display(),
        rs[0],
        rs[1],
        resolution(rs, ts)
    );
    Err(Error::content(&test.path, text))
}

/// What two sizes may mean.
fn resolution(r: [usize; 2], t: [usize; 2]) -> String {
    let ratio = [0, 1].map(|a| t[a] as f64 / r[a] as f64);
    if r == [t[1], t[0]] {
        return ": turned by a quarter? Pictures of equal size can be compared".into();
    }
    if (ratio[0] / ratio[1] - 1.0).abs() < 0.01 {
        return format!(
            ": the same picture at {:.3} times the resolution? Render both at one --size",
            ratio[0]
        );
    }
    ": pictures of equal size can be compared".into()
}

fn cropped(window: Window, crop: Crop) -> Result<Window> {
    let [w, h] = window.size;
    let [x0, x1, y0, y1] = match crop {
        Crop::Fractions([x0, x1, y0, y1]) => {
            let at = |f: f64, n: usize| (f * n as f64).ceil() as usize;
            [at(x0, w), at(x1, w), at(y0, h), at(y1, h)]
        }
        Crop::Pixels([x, y, cw, ch]) => [x, x.saturating_add(cw), y, y.saturating_add(ch)],
    };
    if x0 >= x1 || y0 >= y1 || x1 > w || y1 > h {
        return Err(Error::Usage(format!(
            "--crop asks for columns {x0}..{x1} and rows {y0}..{y1} of a picture of {w}x{h} pixels"
        )));
    }
    Ok(Window { origin: [window.origin[0] + x0, window.origin[1] + y0], size: [x1 - x0, y1 - y0] })
}

/// Names of the channels to compare.
fn common_channels(
    reference: &Source,
    test: &Source,
    options: &PairOptions,
    notes: &mut Vec<String>,
) -> Result<Vec<String>> {
    let (r, t) = (reference.names(), test.names());
    let has = |source: &Source, name: &str| plane_index(source, name).is_some();
    let lacks = |source: &Source, name: &str| {
        let known = source.names().join(", ");
        Err(Error::content(&source.path, format!("has no channel \"{name}\"; has: {known}")))
    };
    if let Some(wanted) = &options.channels {
        for source in [reference, test] {
            if let Some(name) = wanted.iter().find(|n| !has(source, n)) {
                return lacks(source, name);
            }
        }
        return Ok(wanted.clone());
    }
    let colors = ["R", "G", "B"];
    let is_color = |s: &Source| colors.iter().all(|c| has(s, c));
    if r == ["Y"] && t == ["Y"] {
        return Ok(vec!["Y".into()]);
    }
    if is_color(reference) && is_color(test) {
        let gray = [("reference", &r), ("test", &t)].into_iter().find(|(_, n)| !n.contains(&"R"));
        if let Some((which, _)) = gray {
            notes.push(format!("the {which} is gray: its one channel stands for red, green and blue"));
        }
        return Ok(colors.map(String::from).to_vec());
    }
    let common: Vec<String> = r.iter().filter(|n| t.contains(n)).map(|n| n.to_string()).collect();
    if common.is_empty() {
        let text = format!(
            "has channels {}, and the reference {} has {}: none in common",
            t.join(", "),
            reference.path.display(),
            r.join(", ")
        );
        return Err(Error::content(&test.path, text));
    }
    if common.len() < r.len().max(t.len()) {
        notes.push(format!("compared over the channels that both have: {}", common.join(", ")));
    }
    Ok(common)
}

/// The plane of a channel; a gray picture's one plane is every colour.
fn plane_index(source: &Source, name: &str) -> Option<usize> {
    let names = source.names();
    let at = |wanted: &str| names.iter().position(|n| *n == wanted);
    // Beside X it is a coordinate.
    let is_gray = ["R", "G", "B"].contains(&name) && !names.contains(&"X");
    at(name).or_else(|| if is_gray { at("Y") } else { None })
}

/// One channel's values within a window, brought into the space where they are colours.
fn values(source: &Source, name: &str, window: Window, space: Option<Space>, exposure: f32) -> Vec<f32> {
    let picture = &source.loaded.picture;
    let plane = &picture.planes[plane_index(source, name).unwrap_or(0)].data;
    // A picture of another frame is taken from its own left top pixel on.
    let inside = (0..2).all(|a| {
        let at = window.origin[a].wrapping_sub(picture.origin[a]);
        at <= source.size()[a] - window.size[a]
    });
    let from = if inside { [0, 1].map(|a| window.origin[a] - picture.origin[a]) } else { [0, 0] };
    let curve = space.and_then(|space| Curve::new(source.loaded.stored, space, exposure));
    let mut out = vec![0.0; window.size[0] * window.size[1]];
    out.par_chunks_mut(window.size[0]).enumerate().for_each(|(y, row)| {
        let start = (from[1] + y) * picture.width + from[0];
        row.copy_from_slice(&plane[start..start + row.len()]);
        if let Some(curve) = &curve {
            row.iter_mut().for_each(|v| *v = curve.at(*v));
        }
    });
    out
}

/// From stored values to those of a space.
enum Curve {
    /// Of whole numbers: by number.
    Table { largest: f32, values: Vec<f32> },
    /// Of floats.
    Function { scale: f32, encode: bool },
}

impl Curve {
    /// None where nothing is to be done.
    fn new(stored: Stored, space: Space, exposure: f32) -> Option<Curve> {
        let scale = exposure.exp2();
        let encode = space == Space::Display;
        match stored {
            Stored::Float if scale == 1.0 && !encode => None,
            Stored::Float => Some(Curve::Function { scale, encode }),
            Stored::Integer { bits, encoding } => {
                let stays = match encoding {
                    Encoding::Srgb => encode,
                    Encoding::Linear => !encode,
                };
                if stays && scale == 1.0 {
                    return None;
                }
                let largest = ((1u32 << bits) - 1) as f32;
                let value = |i: u32| {
                    let v = i as f32 / largest;
                    let linear = scale * if encoding == Encoding::Srgb { srgb_to_linear(v) } else { v };
                    if encode { linear_to_srgb(linear) } else { linear }
                };
                Some(Curve::Table { largest, values: (0..1u32 << bits).map(value).collect() })
            }
        }
    }

    fn at(&self, v: f32) -> f32 {
        match self {
            Curve::Table { largest, values } => {
                let i = (v * largest).round() as usize;
                values[i.min(values.len() - 1)]
            }
            // The curve would hide what is no number.
            Curve::Function { .. } if !v.is_finite() => v,
            Curve::Function { scale, encode: true } => linear_to_srgb(v * scale),
            Curve::Function { scale, encode: false } => v * scale,
        }
    }
}

/// The part of a mask that lies in the window.
fn masked(mask: &Mask, reference: &Source, window: Window) -> Result<Vec<bool>> {
    let size = reference.size();
    if mask.size != size {
        let [w, h] = mask.size;
        return Err(Error::Usage(format!(
            "the mask is {w}x{h}, and the reference {}x{} pixels",
            size[0], size[1]
        )));
    }
    let origin = reference.loaded.picture.origin;
    let from = [0, 1].map(|a| window.origin[a].saturating_sub(origin[a]));
    let rows = (0..window.size[1]).map(|y| (from[1] + y) * size[0] + from[0]);
    let counted: Vec<bool> =
        rows.flat_map(|start| mask.counted[start..start + window.size[0]].iter().copied()).collect();
    if counted.iter().all(|c| !*c) {
        return Err(Error::Usage("the mask leaves no pixel to compare".into()));
    }
    Ok(counted)
}

impl Mask {
    /// Bright pixels of a picture (more than half of white in any channel).
    ///
    /// # Errors
    /// See [`load`].
    pub fn of_picture(path: &Path) -> Result<Mask> {
        let picture = load(path, &LoadOptions::default())?.picture;
        let shown = picture.planes.iter().filter(|p| p.name != "A");
        let mut counted = vec![false; picture.width * picture.height];
        shown.for_each(|p| counted.iter_mut().zip(&p.data).for_each(|(c, v)| *c |= *v > 0.5));
        Ok(Mask { size: [picture.width, picture.height], counted })
    }

    /// Pixels of one object, by the layer `id` of a picture.
    ///
    /// # Errors
    /// See [`load`]; an object that no pixel shows.
    pub fn of_object(path: &Path, object: u32) -> Result<Mask> {
        let picture = load(path, &LoadOptions { layer: Some("id".into()), ..LoadOptions::default() })
            .map_err(|e| match e {
                Error::Content { place, message } => {
                    let message =
                        format!("{message}; --object needs the layer that `render --aov id` writes");
                    Error::Content { place, message }
                }
                other => other,
            })?
            .picture;
        let ids = &picture.planes[0].data;
        let counted: Vec<bool> = ids.iter().map(|v| *v == object as f32).collect();
        if counted.iter().all(|c| !*c) {
            let largest = ids.iter().copied().fold(0f32, f32::max);
            let text = format!("no pixel shows object {object}; the largest number there is {largest}");
            return Err(Error::content(path, text));
        }
        Ok(Mask { size: [picture.width, picture.height], counted })
    }
}
