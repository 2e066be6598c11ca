//! Two pictures of equal size, brought into one space, with the pixels that count.

use crate::color::linear_to_srgb;
use rayon::prelude::*;
use std::sync::OnceLock;

/// What the numbers of a pair are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Space {
    /// Radiance, or anything else that is not encoded for a display.
    Linear,
    /// Encoded by the sRGB curve, from 0 to 1: what 8-bit pictures hold.
    Display,
}

impl Space {
    /// For tables.
    pub fn name(self) -> &'static str {
        match self {
            Space::Linear => "linear",
            Space::Display => "display",
        }
    }
}

/// One of the two pictures: a plane a channel, `width * height` values each, the top row first.
pub type Planes = Vec<Vec<f32>>;

/// A reference and a picture that is held against it.
#[derive(Debug)]
pub struct Pair {
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// Where its left top pixel stands in the pictures, pixels.
    pub origin: [usize; 2],
    /// Names of the channels, such as `R G B`.
    pub channels: Vec<String>,
    /// What the values are.
    pub space: Space,
    /// Whether the channels are colours, which a display can show.
    pub is_color: bool,
    /// The reference; finite wherever a pixel counts, 0 elsewhere.
    pub reference: Planes,
    /// The other one, likewise.
    pub test: Planes,
    /// Which pixels count; all where it is none.
    pub counted: Option<Vec<bool>>,
    /// Luminance, or the only channel, or the mean of all; made when first asked for.
    gray: [OnceLock<Vec<f32>>; 2],
    /// Encoded for a display; made when first asked for.
    display: [OnceLock<Planes>; 2],
}

/// Which of the two.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// What is taken for true.
    Reference,
    /// What is examined.
    Test,
}

/// Pixels that are worked on together.
pub(super) const CHUNK: usize = 1 << 14;

impl Pair {
    /// Planes of `size` pixels. Colours are channels `R G B`, or one `Y`.
    pub fn new(
        size: [usize; 2],
        channels: Vec<String>,
        space: Space,
        [reference, test]: [Planes; 2],
        counted: Option<Vec<bool>>,
    ) -> Self {
        debug_assert!(reference.iter().chain(&test).all(|p| p.len() == size[0] * size[1]));
        let is_color = channels == ["R", "G", "B"] || channels == ["Y"];
        let (gray, display) = Default::default();
        Pair { size, origin: [0; 2], channels, space, is_color, reference, test, counted, gray, display }
    }

    /// Pixels, whether they count or not.
    pub fn pixels(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// Pixels that count.
    pub fn count(&self) -> usize {
        self.counted.as_ref().map_or(self.pixels(), |c| c.iter().filter(|c| **c).count())
    }

    /// Whether the pixel of this row-major index counts.
    #[inline]
    pub fn counts(&self, at: usize) -> bool {
        self.counted.as_ref().is_none_or(|c| c[at])
    }

    /// One of the two.
    pub fn planes(&self, side: Side) -> &Planes {
        match side {
            Side::Reference => &self.reference,
            Side::Test => &self.test,
        }
    }

    /// One value a pixel: luminance of colours (Rec. 709 weights), else the mean of the channels.
    pub fn gray(&self, side: Side) -> &[f32] {
        let planes = self.planes(side);
        if let [only] = planes.as_slice() {
            return only;
        }
        let equal = vec![1.0 / planes.len() as f32; planes.len()];
        let weights = if self.is_color { vec![0.2126, 0.7152, 0.0722] } else { equal };
        self.gray[side as usize].get_or_init(|| {
            let mut out = vec![0.0; self.pixels()];
            out.par_chunks_mut(CHUNK).enumerate().for_each(|(i, out)| {
                for (plane, weight) in planes.iter().zip(&weights) {
                    let values = &plane[i * CHUNK..i * CHUNK + out.len()];
                    out.iter_mut().zip(values).for_each(|(o, v)| *o += weight * v);
                }
            });
            out
        })
    }

    /// Colours as a display shows them: sRGB-encoded, clipped to 0..1; made when first asked for. What is no colour stays as
    /// it is.
    pub fn display_planes(&self, side: Side) -> &Planes {
        if !self.is_color || self.space == Space::Display {
            return self.planes(side);
        }
        self.display[side as usize].get_or_init(|| curved(self.planes(side), linear_to_srgb))
    }

    /// Red, green and blue as a display shows them; one plane three times where there is but one. None where channels are no
    /// colours.
    pub fn display_colors(&self, side: Side) -> Option<[&[f32]; 3]> {
        self.is_color.then(|| three(self.display_planes(side)))
    }

    /// Red, green and blue in the pair's own space, likewise.
    pub fn colors(&self, side: Side) -> Option<[&[f32]; 3]> {
        self.is_color.then(|| three(self.planes(side)))
    }
}

fn three(planes: &Planes) -> [&[f32]; 3] {
    [0, 1, 2].map(|c| &planes[c.min(planes.len() - 1)][..])
}

fn curved(planes: &Planes, curve: fn(f32) -> f32) -> Planes {
    let plane = |p: &Vec<f32>| p.par_iter().with_min_len(CHUNK).map(|v| curve(*v)).collect();
    planes.iter().map(plane).collect()
}
