//! A tree over emitters, by which one is chosen for a receiver: near, bright and turned towards it.
//!
//! Conty Estevez and Kulla, "Importance Sampling of Many Lights with Adaptive Tree Splitting", HPG 2018, without the
//! splitting: the bounds, the cost by which the tree is built, and the importance of a node. At each node one child is
//! taken in proportion to what it may bring. A choice costs two importances a level.

use crate::base::light::{EmitterBounds, Receiver};
use crate::math::aabb::Aabb;
use glam::Vec3;
use std::f32::consts::PI;

/// A tree over at least one emitter with power.
pub struct LightTree {
    /// Depth first: the first child of a node follows it.
    nodes: Vec<Node>,
    /// By emitter: which child to take at each level from the root, the first level in the lowest bit, under a bit that
    /// marks the end. 0 for emitters without power, which are in no leaf.
    trails: Vec<u64>,
}

/// An emitter or a pair of nodes, by what bounds it.
#[derive(Debug, Clone, Copy)]
struct Node {
    center: Vec3,
    /// Of the sphere around the bounds.
    radius: f32,
    axis: Vec3,
    /// Cosine and sine of how far normals spread about the axis.
    spread: [f32; 2],
    /// Cosine of how far from its normal an emitter shines.
    cos_reach: f32,
    two_sided: bool,
    power: f32,
    next: Next,
}

#[derive(Debug, Clone, Copy)]
enum Next {
    Emitter(u32),
    /// Where the second child is.
    Second(u32),
}

/// An emitter chosen, and what is left of the number it was chosen by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TreeChoice {
    /// Which emitter.
    pub emitter: u32,
    /// Probability of the choice, more than 0.
    pub pmf: f64,
    /// The number rescaled to [0, 1), uniform again.
    pub du: f64,
}

/// Cosine of max(a - b, 0), of angles in [0, pi] by their cosines and sines; and its sine.
#[inline]
fn angle_less([cos_a, sin_a]: [f32; 2], [cos_b, sin_b]: [f32; 2]) -> [f32; 2] {
    if cos_a > cos_b {
        return [1.0, 0.0];
    }
    [cos_a * cos_b + sin_a * sin_b, (sin_a * cos_b - cos_a * sin_b).max(0.0)]
}

#[inline]
fn with_sine(cos: f32) -> [f32; 2] {
    [cos, (1.0 - cos * cos).max(0.0).sqrt()]
}

/// Angles that rounding might hide: what is beyond a limit by less than this cosine still counts.
const SLACK: f32 = 1e-3;

/// Least share of what power over distance squared says that an emitter at its limits has.
const GRAZING: f32 = 0.02;

/// A cosine for a whole node, from that of its middle and the largest it may have. The largest alone lets wide nodes seem
/// brighter than near ones at every level, which a lamp of a thousand pieces close to a wall multiplies.
#[inline]
fn between(middle: f32, largest: f32) -> f32 {
    0.7 * middle.max(0.0) + 0.3 * largest
}

impl Node {
    fn new(b: &EmitterBounds, next: Next) -> Node {
        Node {
            center: b.bounds.center(),
            // A rounding of the centre, outwards.
            radius: b.bounds.radius() + b.bounds.max_abs() * f32::EPSILON,
            axis: b.axis,
            spread: with_sine(b.cos_spread.clamp(-1.0, 1.0)),
            cos_reach: b.cos_reach,
            two_sided: b.two_sided,
            power: b.power,
            next,
        }
    }

    /// An estimate of what the node may bring; 0 only if nothing of it can arrive.
    #[inline]
    fn importance(&self, at: &Receiver) -> f32 {
        let to = at.p - self.center;
        let (d2, r2) = (to.length_squared(), self.radius * self.radius);
        // Inside of its sphere all is possible, and it is as far away as it is wide.
        if d2 <= r2 * 1.0001 {
            return self.power / r2.max(f32::MIN_POSITIVE);
        }
        let d = d2.sqrt();
        let w = to / d;
        let sin_b = (self.radius / d).min(1.0);
        let seen = [(1.0 - sin_b * sin_b).sqrt(), sin_b];
        let cos = self.axis.dot(w);
        let off = with_sine(if self.two_sided { cos.abs() } else { cos });
        let middle = angle_less(off, self.spread);
        let leaves = angle_less(middle, seen)[0];
        if leaves < self.cos_reach - SLACK {
            return 0.0;
        }
        let leaves = between(middle[0], leaves);
        // Shining alike in all directions up to its reach, or by the cosine (Lambert): nothing is lost by the latter.
        let mut value = self.power / d2 * leaves.max(GRAZING);
        for n in [at.ng, at.ns] {
            if n == Vec3::ZERO {
                continue;
            }
            let middle = with_sine(-n.dot(w));
            let arrives = angle_less(middle, seen)[0];
            if arrives < -SLACK {
                return 0.0;
            }
            if n == at.ns {
                value *= between(middle[0], arrives).max(GRAZING);
            }
            if at.ns == at.ng {
                break;
            }
        }
        value
    }
}

impl LightTree {
    /// Of the emitters with power. None if there are none.
    pub fn new(emitters: &[EmitterBounds]) -> Option<Self> {
        let usable = |b: &EmitterBounds| b.power > 0.0 && b.power < f32::INFINITY && b.bounds.is_finite();
        let mut items: Vec<u32> =
            (0..emitters.len() as u32).filter(|&i| usable(&emitters[i as usize])).collect();
        if items.is_empty() {
            return None;
        }
        let mut tree = LightTree { nodes: Vec::new(), trails: vec![0; emitters.len()] };
        tree.nodes.reserve_exact(2 * items.len() - 1);
        tree.build(emitters, &mut items, Trail { bits: 0, depth: 0 });
        Some(tree)
    }

    /// Appends the tree of `items`, and returns its bounds.
    fn build(&mut self, all: &[EmitterBounds], items: &mut [u32], trail: Trail) -> EmitterBounds {
        let place = self.nodes.len();
        if let [one] = *items {
            let b = all[one as usize];
            self.nodes.push(Node::new(&b, Next::Emitter(one)));
            self.trails[one as usize] = trail.bits | 1 << trail.depth;
            return b;
        }
        let middle = split(all, items, trail.depth);
        let (first, second) = items.split_at_mut(middle);
        self.nodes.push(Node::new(&all[first[0] as usize], Next::Second(0)));
        let depth = trail.depth + 1;
        let a = self.build(all, first, Trail { bits: trail.bits, depth });
        let next = Next::Second(self.nodes.len() as u32);
        let b = self.build(all, second, Trail { bits: trail.bits | 1 << trail.depth, depth });
        let both = union(&a, &b);
        self.nodes[place] = Node::new(&both, next);
        both
    }

    /// The chance of the second child.
    #[inline]
    fn second(&self, node: usize, second: u32, at: &Receiver) -> Option<f64> {
        let a = f64::from(self.nodes[node + 1].importance(at).min(f32::MAX));
        let b = f64::from(self.nodes[second as usize].importance(at).min(f32::MAX));
        let sum = a + b;
        // NaN, too, from a receiver that is nowhere.
        if sum > 0.0 { Some(b / sum) } else { None }
    }

    /// Chooses by `u` in [0, 1); None if no emitter can bring anything.
    pub fn sample(&self, at: &Receiver, mut u: f64) -> Option<TreeChoice> {
        let (mut node, mut pmf) = (0, 1.0);
        loop {
            match self.nodes[node].next {
                Next::Emitter(emitter) => {
                    return (pmf > 0.0).then_some(TreeChoice { emitter, pmf, du: u.min(ONE_MINUS) });
                }
                Next::Second(second) => {
                    let q = self.second(node, second, at)?;
                    // The first child has what is left, so that both are what `pmf` says, to the bit.
                    let p = 1.0 - q;
                    if u < p {
                        (node, pmf, u) = (node + 1, pmf * p, u / p);
                    } else {
                        (node, pmf, u) = (second as usize, pmf * q, (u - p) / q);
                    }
                }
            }
        }
    }

    /// The probability with which [`LightTree::sample`] chooses an emitter there.
    pub fn pmf(&self, at: &Receiver, emitter: u32) -> f64 {
        let mut trail = self.trails.get(emitter as usize).copied().unwrap_or(0);
        if trail == 0 {
            return 0.0;
        }
        let (mut node, mut pmf) = (0, 1.0);
        while let Next::Second(second) = self.nodes[node].next {
            let Some(q) = self.second(node, second, at) else { return 0.0 };
            match trail & 1 {
                0 => (node, pmf) = (node + 1, pmf * (1.0 - q)),
                _ => (node, pmf) = (second as usize, pmf * q),
            }
            trail >>= 1;
        }
        pmf
    }
}

/// Largest f64 below one.
const ONE_MINUS: f64 = 1.0 - f64::EPSILON / 2.0;

#[derive(Clone, Copy)]
struct Trail {
    bits: u64,
    depth: u32,
}

/// From here on nodes are halved, so that trails of 2^31 emitters fit.
const HALVE: u32 = 30;

/// Sorts items about the best of a few planes, and returns how many are below it: at least one on each side.
fn split(all: &[EmitterBounds], items: &mut [u32], depth: u32) -> usize {
    const BUCKETS: usize = 12;
    let center = |i: u32| all[i as usize].bounds.center();
    let mut span = Aabb::EMPTY;
    items.iter().for_each(|&i| span.extend(center(i)));
    let size = span.size();
    let mut best = (f32::INFINITY, 0, 0);
    if depth < HALVE {
        for axis in (0..3).filter(|&axis| size[axis] > 0.0) {
            let mut buckets = [None::<EmitterBounds>; BUCKETS];
            for &i in items.iter() {
                let b = &mut buckets[bucket(center(i)[axis], &span, axis, BUCKETS)];
                *b = Some(b.map_or(all[i as usize], |b| union(&b, &all[i as usize])));
            }
            // Long sides are cut first (Conty Estevez and Kulla, section 4.2).
            let long = size.max_element() / size[axis];
            let join = |acc: &mut Option<EmitterBounds>, b: &Option<EmitterBounds>| {
                *acc = match (*acc, b) {
                    (Some(a), Some(b)) => Some(union(&a, b)),
                    (a, b) => a.or(*b),
                };
                acc.as_ref().map_or(0.0, cost)
            };
            let mut below = None;
            let lower = buckets.each_ref().map(|b| join(&mut below, b));
            let mut above = None;
            for k in (1..BUCKETS).rev() {
                let c = (join(&mut above, &buckets[k]) + lower[k - 1]) * long;
                if c < best.0 && above.is_some() && buckets[..k].iter().any(Option::is_some) {
                    best = (c, axis, k);
                }
            }
        }
    }
    let (cost, axis, k) = best;
    if cost < f32::INFINITY {
        items.sort_by_key(|&i| bucket(center(i)[axis], &span, axis, BUCKETS));
        return items.partition_point(|&i| bucket(center(i)[axis], &span, axis, BUCKETS) < k);
    }
    let axis = size.max_position();
    let middle = items.len() / 2;
    items
        .select_nth_unstable_by(middle, |&i, &j| center(i)[axis].total_cmp(&center(j)[axis]).then(i.cmp(&j)));
    middle
}

fn bucket(x: f32, span: &Aabb, axis: usize, count: usize) -> usize {
    let f = (x - span.min[axis]) / span.size()[axis];
    ((f * count as f32) as usize).min(count - 1)
}

/// Conty Estevez and Kulla, eq. 1: power, area of the bounds, and solid angle that emission covers.
fn cost(b: &EmitterBounds) -> f32 {
    let spread = b.cos_spread.clamp(-1.0, 1.0).acos();
    let w = (spread + b.cos_reach.clamp(-1.0, 1.0).acos()).min(PI);
    let [cos, sin] = with_sine(spread.cos());
    let covered = 2.0 * PI * (1.0 - cos)
        + 0.5 * PI * (2.0 * w * sin - (spread - 2.0 * w).cos() - 2.0 * spread * sin + cos);
    // A flat or pointlike box has an area, too: it still matters how much power is in it.
    let size = b.bounds.size();
    b.power * covered * (b.bounds.surface_area() + 1e-3 * size.length_squared() + f32::MIN_POSITIVE)
}

/// What bounds both. Cones: the smallest that holds both.
pub fn union(a: &EmitterBounds, b: &EmitterBounds) -> EmitterBounds {
    let (wide, narrow) = if a.cos_spread <= b.cos_spread { (a, b) } else { (b, a) };
    let [wide_angle, narrow_angle] = [wide, narrow].map(|c| c.cos_spread.clamp(-1.0, 1.0).acos());
    // From differences: an arc cosine of nearly 1 has few digits.
    let between = 2.0 * (0.5 * (wide.axis - narrow.axis).length()).min(1.0).asin();
    let (axis, spread) = if between + narrow_angle <= wide_angle {
        (wide.axis, wide_angle)
    } else {
        let spread = 0.5 * (wide_angle + between + narrow_angle);
        let turn = spread - wide_angle;
        let across = (narrow.axis - wide.axis * wide.axis.dot(narrow.axis)).try_normalize();
        match across {
            Some(x) if spread < PI => (wide.axis * turn.cos() + x * turn.sin(), spread),
            _ => (wide.axis, PI),
        }
    };
    EmitterBounds {
        bounds: a.bounds.union(b.bounds),
        axis: axis.normalize(),
        // Roundings of some angles, outwards.
        cos_spread: if spread >= PI { -1.0 } else { (spread + 1e-5).min(PI).cos() },
        cos_reach: a.cos_reach.min(b.cos_reach),
        two_sided: a.two_sided || b.two_sided,
        power: a.power + b.power,
    }
}

#[cfg(test)]
mod tests;
