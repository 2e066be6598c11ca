//! Where a ray may meet a primitive: as the oracle has it, and with all that rounding can make of it.

use super::leaf_ray::LeafRay;
use super::triangle::TriangleTest;
use crate::accel::accepted;
use crate::base::geometry::Leaf;
use crate::base::hit::Hit;
use crate::base::shape::{LocalRay, Shape};
use crate::math::bounds::{U32, U64, gamma};
use serde::Serialize;

/// Why two careful kernels may decide differently.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Doubt {
    /// An edge function is zero within its bound: the ray passes through an edge or a corner.
    Edge,
    /// The ray grazes a curved shape, or runs along the plane of a triangle.
    Grazing,
    /// The hit lies at tnear or tfar within the bound of its distance.
    RangeEnd,
    /// Two hits lie within the bounds of their distances of each other.
    Tie,
}

impl Doubt {
    /// All, in the order of listings.
    pub const ALL: [Doubt; 4] = [Doubt::Edge, Doubt::Grazing, Doubt::RangeEnd, Doubt::Tie];

    /// For people.
    pub fn text(self) -> &'static str {
        match self {
            Doubt::Edge => "through an edge or corner",
            Doubt::Grazing => "grazing",
            Doubt::RangeEnd => "at the end of the ray",
            Doubt::Tie => "two surfaces at one distance",
        }
    }
}

/// A place where a ray may meet a primitive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Distance in double precision, lengths of the direction.
    pub t: f64,
    /// How far a kernel's t may be off; may be infinite.
    pub reach: f64,
    /// Whether the oracle meets it, range of t included.
    pub met: bool,
    /// Why a kernel may say otherwise; none where every careful kernel must meet it.
    pub doubt: Option<Doubt>,
}

impl Crossing {
    /// Whether no careful kernel may miss it.
    pub fn is_sure(&self) -> bool {
        self.met && self.doubt.is_none()
    }

    /// Weighs the range of t: none where it surely lies outside.
    fn in_range(mut self, ray: &LocalRay) -> Option<Self> {
        let (near, far) = (self.t - self.reach, self.t + self.reach);
        if far < ray.tnear || near > ray.tfar {
            return None;
        }
        if !(near >= ray.tnear && far <= ray.tfar) {
            self.doubt = self.doubt.or(Some(Doubt::RangeEnd));
        }
        Some(self)
    }
}

/// A primitive to look at.
#[derive(Clone, Copy)]
pub struct Primitive<'a> {
    /// Its leaf.
    pub leaf: &'a Leaf,
    /// Path of the leaf.
    pub path: u64,
    /// Number within the leaf's shape.
    pub prim: u32,
    /// The ray's key, for hit filters.
    pub key: u32,
}

impl Primitive<'_> {
    /// Calls `each` with every place where the ray may meet the primitive; not at all where no careful kernel may.
    pub fn crossings(&self, at: &LeafRay, mut each: impl FnMut(Crossing)) {
        let mut each = |c: Crossing| {
            let Some(c) = c.in_range(&at.ray) else { return };
            let hit = Hit { t: c.t as f32, prim: self.prim, path: self.path };
            if accepted(self.leaf, &at.ray, &hit, self.key) {
                each(c);
            }
        };
        let shape = &*self.leaf.shape;
        match shape.triangles() {
            Some(mesh) => {
                if let Some(test) = TriangleTest::new(at, mesh.corners(self.prim)) {
                    each(of_triangle(shape, self.prim, at, &test));
                }
            }
            None => of_shape(shape, self.prim, at, each),
        }
    }
}

fn of_triangle(shape: &dyn Shape, prim: u32, at: &LeafRay, test: &TriangleTest) -> Crossing {
    let met = shape.intersect(&at.ray, prim);
    let doubt = match (test.is_surely_inside(), test.reach.is_finite()) {
        (_, false) => Some(Doubt::Grazing),
        (false, true) => Some(Doubt::Edge),
        (true, true) => None,
    };
    Crossing { t: met.unwrap_or(test.t), reach: test.reach, met: met.is_some(), doubt }
}

/// Crossings of one primitive that are looked at: a quadric has two.
const MAX_CROSSINGS: usize = 16;
/// Rays around the one in question.
const RING: usize = 8;

/// All t within `range` at which the ray meets a primitive, in growing order.
fn all(shape: &dyn Shape, prim: u32, ray: &LocalRay, range: [f64; 2]) -> Vec<f64> {
    let mut list = Vec::new();
    let mut rest = LocalRay { tnear: range[0], tfar: range[1], ..*ray };
    while let Some(t) = shape.intersect(&rest, prim).filter(|_| list.len() < MAX_CROSSINGS) {
        list.push(t);
        rest.tnear = t.next_up();
    }
    list
}

/// Any shape that kernels test by its own double-precision code. What is rounded is the way of the ray into its space,
/// and the tests of boxes that lead to it, which are off by gamma(8) of how far its box reaches from the origin. So
/// the same is asked of rays all around that are off by as much, and more by a third so that the ring
/// has no gaps: where they disagree on how many crossings there are, the ray grazes.
fn of_shape(shape: &dyn Shape, prim: u32, at: &LeafRay, mut each: impl FnMut(Crossing)) {
    let ray = &at.ray;
    let b = shape.primitive_bounds(prim);
    let span = (b.center().as_dvec3() - ray.o).length() + f64::from(b.radius());
    let length = ray.d.length();
    let spread =
        at.origin_error.length() + span / length * at.direction_error.length() + f64::from(gamma(8)) * span;
    // The box bounds the crossings, whatever the range asked: shapes are asked a little beyond it at both ends.
    let room = 4.0 * spread / length;
    let range = [ray.tnear - room, ray.tfar + room];
    let own = all(shape, prim, ray, range);
    let Some(along) = ray.d.try_normalize() else { return };
    let aside = along.any_orthonormal_vector() * (spread * 4.0 / 3.0);
    let up = along.cross(aside);
    let ring: Vec<Vec<f64>> = (0..RING)
        .map(|i| {
            let angle = i as f64 * std::f64::consts::TAU / RING as f64;
            let o = ray.o + aside * angle.cos() + up * angle.sin();
            all(shape, prim, &LocalRay { o, ..*ray }, range)
        })
        .collect();
    let met = |t: f64| t >= ray.tnear && t <= ray.tfar;
    let rounding = |t: f64| 2.0 * f64::from(U32) * t.abs() + 64.0 * U64 * span / length;
    if ring.iter().all(|r| r.len() == own.len()) {
        for (i, &t) in own.iter().enumerate() {
            let reach = ring.iter().map(|r| (r[i] - t).abs()).fold(0.0, f64::max);
            each(Crossing { t, reach: reach + rounding(t), met: met(t), doubt: None });
        }
        return;
    }
    let any = || ring.iter().flatten().chain(&own).copied();
    let (low, high) = (any().fold(f64::INFINITY, f64::min), any().fold(f64::NEG_INFINITY, f64::max));
    let doubt = Some(Doubt::Grazing);
    let own = if own.is_empty() { vec![0.5 * (low + high)] } else { own };
    for t in own.iter().copied() {
        let found = shape.intersect(ray, prim).is_some();
        let reach = (t - low).max(high - t) + rounding(t);
        each(Crossing { t, reach, met: found && met(t), doubt });
    }
}
