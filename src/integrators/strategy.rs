//! How light at infinity is found from a surface: by asking the light, by going on as the surface scatters, or by both.

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

/// What each object's materials count as.
#[derive(Debug)]
pub struct Classes {
    /// Index into `by_slot` of an object's first material; one more than there are objects.
    first_slot: Arc<[u32]>,
    by_slot: Vec<u32>,
}

impl Classes {
    /// By object and slot, in the order of the scene's table of objects.
    pub fn by_object(objects: impl Iterator<Item = Vec<u32>>) -> Self {
        let (mut first_slot, mut by_slot) = (vec![0], Vec::new());
        for slots in objects {
            by_slot.extend(slots);
            first_slot.push(by_slot.len() as u32);
        }
        Classes { first_slot: first_slot.into(), by_slot }
    }

    /// Of an object's material, if there is one.
    pub fn of(&self, object: u32, slot: u32) -> Option<usize> {
        let first = *self.first_slot.get(object as usize)?;
        self.by_slot.get((first + slot) as usize).map(|class| *class as usize)
    }
}

/// The strategy of every surface.
#[derive(Debug, Clone, Default)]
pub struct Strategies {
    /// Where the table says nothing.
    usual: Strategy,
    /// See [`Classes`]; empty where there is no table.
    first_slot: Arc<[u32]>,
    by_slot: Arc<[Strategy]>,
}

impl Strategies {
    /// The same everywhere.
    pub fn uniform(strategy: Strategy) -> Self {
        Strategies { usual: strategy, ..Strategies::default() }
    }

    /// By class.
    pub fn by_class(classes: &Classes, strategies: &[Strategy]) -> Self {
        let by_slot = classes.by_slot.iter().map(|class| strategies[*class as usize]).collect();
        Strategies { usual: Strategy::default(), first_slot: classes.first_slot.clone(), by_slot }
    }

    /// That of what is in no table.
    pub fn usual(&self) -> Strategy {
        self.usual
    }

    /// That of the points of an object's material.
    #[inline]
    pub fn of(&self, object: u32, slot: u32) -> Strategy {
        let first = self.first_slot.get(object as usize).map_or(0, |f| *f as usize);
        self.by_slot.get(first + slot as usize).copied().unwrap_or(self.usual)
    }
}
