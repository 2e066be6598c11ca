//! The surface points of a depth, a few at a time.

use super::depth::Block;
use super::path::PathState;
use super::surface::{LastLook, Plain, Surface};
use crate::base::vertices::Vertices;
use crate::scene::{Meetings, Scene};
use std::ops::Range;

/// Fewer than this are not worth columns, which cost as much whatever they hold.
const FEW: usize = 4;

/// The surface points of a depth, a few at a time.
pub(super) struct Together<'a> {
    block: &'a Block<'a>,
    surfaces: Vec<Surface<'a>>,
    vertices: Vertices,
    look: LastLook<'a>,
    /// Hits whose points have been here.
    done: usize,
    /// Whether paths go on from them at all.
    goes_on: bool,
}

/// Some points: each by itself, then some that are alike, if there are any.
pub(super) struct Found<'f, 'a> {
    pub surfaces: &'f mut Vec<Surface<'a>>,
    pub alike: Option<Alike<'f, 'a>>,
}

/// Points of one plain material, in columns.
pub(super) struct Alike<'f, 'a> {
    pub vertices: &'f Vertices,
    pub plain: Plain<'a>,
    /// The number of the first among the hits of the depth.
    pub first: usize,
    /// How many.
    pub n: usize,
    /// Whether they are the last of the surfaces as well, as lights are to be asked from each.
    pub recorded: bool,
}

impl Alike<'_, '_> {
    /// Their numbers among the hits of the depth.
    pub fn range(&self) -> Range<usize> {
        self.first..self.first + self.n
    }
}

impl<'a> Together<'a> {
    pub fn new(block: &'a Block<'a>, goes_on: bool) -> Self {
        let (surfaces, vertices) = (Vec::with_capacity(Surface::AT_ONCE), Vertices::default());
        Together { block, surfaces, vertices, look: LastLook::default(), done: 0, goes_on }
    }

    /// Goes on to the next of the hits, None at their end. `state` tells the path of a ray.
    #[inline]
    pub fn next(
        &mut self,
        met: &Meetings,
        hits: &[u32],
        state: impl Fn(u32) -> PathState,
    ) -> Option<Found<'_, 'a>> {
        let scene: &'a Scene = self.block.scene;
        self.surfaces.clear();
        self.surfaces.reserve(Surface::AT_ONCE);
        let end = hits.len().min(self.done + Surface::AT_ONCE);
        let mut alike = None;
        while self.done < end && alike.is_none() {
            let which = &hits[self.done..end];
            let n = scene.vertices(met, which, &mut self.vertices);
            let slot = if self.goes_on && n >= FEW { self.vertices.look(n) } else { None };
            alike = slot.and_then(|slot| {
                let plain = self.look.plain(scene, slot)?;
                let recorded = !self.block.goes_by_columns(slot, &plain.look);
                Some((plain, self.done, n, recorded))
            });
            if alike.as_ref().is_none_or(|(.., recorded)| *recorded) {
                // By an iterator of known length, each is made where it stays.
                self.surfaces.extend(which[..n].iter().enumerate().map(|(lane, &i)| {
                    Surface::new(scene, &mut self.look, self.vertices.get(lane), state(i), self.done + lane)
                }));
            }
            self.done += n;
        }
        let Together { surfaces, vertices, .. } = self;
        let alike = alike.map(|(plain, first, n, recorded)| Alike { vertices, plain, first, n, recorded });
        (!surfaces.is_empty() || alike.is_some()).then_some(Found { surfaces, alike })
    }
}
