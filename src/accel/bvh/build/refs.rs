//! Primitives as a build sorts them.

use glam::Vec4;

/// A box whose fourth lanes mean nothing, for vector code.
#[derive(Debug, Clone, Copy)]
pub(super) struct Box4 {
    pub(super) lo: Vec4,
    pub(super) hi: Vec4,
}

impl Box4 {
    pub(super) const EMPTY: Box4 = Box4 { lo: Vec4::INFINITY, hi: Vec4::NEG_INFINITY };

    #[inline(always)]
    pub(super) fn grow(&mut self, lo: Vec4, hi: Vec4) {
        // What was there comes second: it stays where the fourth lane, an id, happens to be NaN.
        self.lo = lo.min(self.lo);
        self.hi = hi.max(self.hi);
    }

    #[inline(always)]
    pub(super) fn union(self, o: Box4) -> Box4 {
        Box4 { lo: self.lo.min(o.lo), hi: self.hi.max(o.hi) }
    }

    /// Half of the surface area; 0 for the empty box.
    #[inline(always)]
    pub(super) fn half_area(&self) -> f32 {
        let d = (self.hi - self.lo).max(Vec4::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    }
}

/// What a primitive is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// A triangle of a mesh: its leaf, and its number.
    Triangle(u32, u32),
    /// A primitive tested by its shape: likewise.
    Shape(u32, u32),
    /// A child of the group.
    Instance(u32),
}

/// A primitive with its box: 32 bytes, as a build moves these about.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub(super) struct Ref {
    /// Lower corner; the fourth lane holds the bits of kind and leaf.
    lo: Vec4,
    /// Upper corner; the fourth lane holds the bits of the primitive.
    hi: Vec4,
}

const LEAF_BITS: u32 = 30;
/// The most leaves of a group.
pub(super) const MAX_LEAVES: usize = 1 << LEAF_BITS;

impl Ref {
    pub(super) fn new(b: &crate::math::aabb::Aabb, kind: Kind) -> Self {
        let (tag, leaf, prim) = match kind {
            Kind::Triangle(leaf, prim) => (0, leaf, prim),
            Kind::Shape(leaf, prim) => (1, leaf, prim),
            Kind::Instance(child) => (2, child, 0),
        };
        Ref {
            lo: b.min.extend(f32::from_bits(tag << LEAF_BITS | leaf)),
            hi: b.max.extend(f32::from_bits(prim)),
        }
    }

    pub(super) fn kind(&self) -> Kind {
        let (word, prim) = (self.lo.w.to_bits(), self.hi.w.to_bits());
        let leaf = word & ((1 << LEAF_BITS) - 1);
        match word >> LEAF_BITS {
            0 => Kind::Triangle(leaf, prim),
            1 => Kind::Shape(leaf, prim),
            _ => Kind::Instance(leaf),
        }
    }

    /// A number that is the same for primitives of one kind.
    pub(super) fn tag(&self) -> u32 {
        self.lo.w.to_bits() >> LEAF_BITS
    }

    #[inline(always)]
    pub(super) fn lo(&self) -> Vec4 {
        self.lo
    }

    #[inline(always)]
    pub(super) fn hi(&self) -> Vec4 {
        self.hi
    }

    /// Twice the middle of the box.
    #[inline(always)]
    pub(super) fn center2(&self) -> Vec4 {
        // The fourth lanes are ids; a sum of those may be NaN, which nothing reads.
        self.lo + self.hi
    }
}
