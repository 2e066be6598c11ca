//! How light at infinity is found from a surface: by asking the light, by going on as the surface scatters, or by both.

use crate::base::pixel_rect::PixelRect;
use std::sync::Arc;

/// Most light samples of a surface point.
pub const MOST_SPLIT: u8 = 8;

/// Which ways of sampling a guided light (see [`crate::base::light::GuidedLight`]) are tried at a surface point. Each by
/// itself is unbiased.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Strategy {
    /// Both, joined by multiple importance sampling. So many of each where a path ends at its first surface, from 1 to
    /// [`MOST_SPLIT`]; else one.
    Both(u8),
    /// The light alone: scattered rays that meet it count nothing, and are not traced where they can meet nothing else.
    /// So many samples of it at the first surface that a path meets, from 1 to [`MOST_SPLIT`]; one at the others, and where
    /// there are other lights.
    Light(u8),
    /// The material alone: no shadow ray.
    Bsdf,
}

impl Default for Strategy {
    fn default() -> Self {
        Strategy::Both(1)
    }
}

impl Strategy {
    /// All of them with their names.
    pub const NAMES: [(&'static str, Strategy); 9] = [
        ("both", Strategy::Both(1)),
        ("both-2", Strategy::Both(2)),
        ("both-4", Strategy::Both(4)),
        ("both-8", Strategy::Both(8)),
        ("light", Strategy::Light(1)),
        ("light-2", Strategy::Light(2)),
        ("light-4", Strategy::Light(4)),
        ("light-8", Strategy::Light(8)),
        ("bsdf", Strategy::Bsdf),
    ];

    /// Whether light samples alone count.
    pub fn is_light(self) -> bool {
        matches!(self, Strategy::Light(_))
    }

    /// Whether a surface point that a camera ray meets takes several samples of the only light there is; `ends` says that
    /// paths end there.
    pub fn takes_several(self, ends: bool) -> bool {
        match self {
            Strategy::Light(n) => n > 1,
            Strategy::Both(n) => n > 1 && ends,
            Strategy::Bsdf => false,
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        Self::NAMES.iter().find(|n| n.1 == self).map_or("", |n| n.0)
    }

    /// That of this name.
    pub fn find(name: &str) -> Option<Self> {
        Self::NAMES.iter().find(|n| n.0 == name).map(|n| n.1)
    }
}

/// Side of the blocks of pixels whose surfaces may have strategies of their own: a multiple of the side of what is rendered
/// together.
pub const BLOCK_SIDE: u32 = 32;

/// What each object's materials count as.
#[derive(Debug, Default)]
pub struct Classes {
    /// Index into `by_slot` of an object's first material; one more than there are objects, or empty.
    first_slot: Vec<u32>,
    by_slot: Vec<u32>,
}

impl Classes {
    /// By object and slot, in the order of the scene's table of objects.
    pub fn by_object(objects: impl Iterator<Item = Vec<u32>>) -> Self {
        let mut all = Classes { first_slot: vec![0], by_slot: Vec::new() };
        for slots in objects {
            all.by_slot.extend(slots);
            all.first_slot.push(all.by_slot.len() as u32);
        }
        all
    }

    /// Of an object's material; what no class has, if nothing is known of it.
    #[inline]
    pub fn of(&self, object: u32, slot: u32) -> usize {
        let first = self.first_slot.get(object as usize).map_or(0, |f| *f as usize);
        self.by_slot.get(first + slot as usize).map_or(usize::MAX, |class| *class as usize)
    }
}

/// The strategy of every surface.
#[derive(Debug, Clone, Default)]
pub struct Strategies {
    /// Of what is in no class.
    usual: Strategy,
    classes: Arc<Classes>,
    /// Those of all classes, for each block of `pixels`, row by row; or once, for all pixels.
    rows: Arc<[Strategy]>,
    /// Strategies in a row.
    width: usize,
    /// The pixels that are cut into blocks; none where there is one row.
    pixels: PixelRect,
}

impl Strategies {
    /// The same everywhere.
    pub fn uniform(strategy: Strategy) -> Self {
        Strategies { usual: strategy, ..Strategies::default() }
    }

    /// By class.
    pub fn by_class(classes: Arc<Classes>, row: &[Strategy]) -> Self {
        Strategies { classes, rows: row.into(), width: row.len(), ..Strategies::default() }
    }

    /// By block of some pixels and class.
    ///
    /// # Panics
    /// Where there are not as many rows as blocks.
    pub fn by_block(classes: Arc<Classes>, pixels: PixelRect, rows: &[Strategy], width: usize) -> Self {
        assert_eq!(pixels.tiles(BLOCK_SIDE).count() * width, rows.len(), "a row for each block");
        Strategies { usual: Strategy::default(), classes, rows: rows.into(), width, pixels }
    }

    /// That of what is in no class.
    pub fn usual(&self) -> Strategy {
        self.usual
    }

    /// Those of the surfaces that paths from a pixel meet, and from all pixels of its block.
    pub fn around(&self, pixel: [u32; 2]) -> LocalStrategies<'_> {
        let block = if self.pixels.area() == 0 { 0 } else { block_of(&self.pixels, pixel) };
        let row = self.rows.get(block * self.width..(block + 1) * self.width).unwrap_or_default();
        LocalStrategies { usual: self.usual, classes: &self.classes, row }
    }
}

/// The number of a pixel's block, among those that some pixels are cut into; that of the nearest, if it is not among these.
pub fn block_of(pixels: &PixelRect, [x, y]: [u32; 2]) -> usize {
    let along = |at: u32, from: u32, to: u32| at.clamp(from, to - 1).saturating_sub(from) / BLOCK_SIDE;
    let across = pixels.width().div_ceil(BLOCK_SIDE) as usize;
    along(y, pixels.y0, pixels.y1) as usize * across + along(x, pixels.x0, pixels.x1) as usize
}

/// The strategies of a block.
#[derive(Clone, Copy)]
pub struct LocalStrategies<'a> {
    usual: Strategy,
    classes: &'a Classes,
    row: &'a [Strategy],
}

impl LocalStrategies<'_> {
    /// That of the points of an object's material.
    #[inline]
    pub fn of(&self, object: u32, slot: u32) -> Strategy {
        if self.row.is_empty() {
            return self.usual;
        }
        self.row.get(self.classes.of(object, slot)).copied().unwrap_or(self.usual)
    }
}
