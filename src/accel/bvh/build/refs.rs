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
///
/// What it is stands in the fourth lanes, as the bits of numbers of ordinary size: vector code works on these lanes too,
/// and would be many times slower if they looked like numbers below the normal range.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub(super) struct Ref {
    /// Lower corner; the leaf or child, and a sign where it is no triangle.
    lo: Vec4,
    /// Upper corner; the primitive, and a sign where it is a child.
    hi: Vec4,
}

/// The bits of 2: with any of those below [`MAX_NUMBER`] a number from 2 to 2^65.
const ORDINARY: u32 = 1 << 30;
const SIGN: u32 = 1 << 31;
/// The most leaves or children of a group, and primitives of a leaf.
pub(super) const MAX_NUMBER: usize = 1 << 29;

impl Ref {
    pub(super) fn new(b: &crate::math::aabb::Aabb, kind: Kind) -> Self {
        let (lo, hi) = match kind {
            Kind::Triangle(leaf, prim) => (leaf, prim),
            Kind::Shape(leaf, prim) => (leaf | SIGN, prim),
            Kind::Instance(child) => (child | SIGN, SIGN),
        };
        Ref {
            lo: b.min.extend(f32::from_bits(lo | ORDINARY)),
            hi: b.max.extend(f32::from_bits(hi | ORDINARY)),
        }
    }

    pub(super) fn kind(&self) -> Kind {
        let (lo, hi) = (self.lo.w.to_bits(), self.hi.w.to_bits());
        let number = |w: u32| w & (MAX_NUMBER as u32 - 1);
        match (lo & SIGN != 0, hi & SIGN != 0) {
            (false, _) => Kind::Triangle(number(lo), number(hi)),
            (true, false) => Kind::Shape(number(lo), number(hi)),
            (true, true) => Kind::Instance(number(lo)),
        }
    }

    /// Whether two are of one kind.
    pub(super) fn is_like(&self, o: &Ref) -> bool {
        let signs = |r: &Ref| [r.lo.w.to_bits() & SIGN, r.hi.w.to_bits() & SIGN];
        signs(self) == signs(o)
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
        self.lo + self.hi
    }
}
