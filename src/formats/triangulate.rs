//! Cutting polygons into triangles: a fan where that is right, ear clipping where the polygon is concave.

use glam::{DVec2, DVec3};

/// Steps (point-in-triangle tests and the like) after which polygons are cut no further by ears but by a fan: ear
/// clipping is quadratic, and a damaged file may hold one polygon of a million corners.
const MAX_STEPS: u64 = 1 << 28;
/// Steps that each corner adds to those. Polygons of so many corners pay for themselves, however many there are; a file
/// of thousands that are larger, and have no ears, takes a time that grows with its length and no faster.
const STEPS_PER_CORNER: u64 = 1 << 11;

/// Cuts one polygon after another; holds the scratch memory.
#[derive(Default)]
pub struct Triangulator {
    /// The polygon in its plane, counter-clockwise.
    points: Vec<DVec2>,
    /// Next and previous corner of those not yet cut off.
    next: Vec<usize>,
    prev: Vec<usize>,
    /// Corners that may lie inside another corner's triangle.
    reflex: Vec<usize>,
    /// Steps that the corners of all polygons so far added, and those that were taken.
    earned: u64,
    taken: u64,
}

impl Triangulator {
    /// Appends `corners.len() - 2` triangles to `out`, in the polygon's own sense of rotation, or none if there are
    /// fewer than three corners. Convex polygons become a fan from the first corner; a quadrilateral is cut along the
    /// diagonal from its first corner unless that lies outside. Polygons that cross themselves, or whose corners are
    /// not finite, are cut into as many triangles, in some way. Polygons need not be quite planar.
    pub fn cut(&mut self, corners: &[u32], position: impl Fn(u32) -> DVec3, out: &mut Vec<[u32; 3]>) {
        match *corners {
            [] | [_] | [_, _] => {}
            [a, b, c] => out.push([a, b, c]),
            [a, b, c, d] => {
                let p = [a, b, c, d].map(&position);
                if !fold_free(p[0], p[1], p[2], p[3]) && fold_free(p[1], p[2], p[3], p[0]) {
                    out.extend([[b, c, d], [b, d, a]]);
                } else {
                    out.extend([[a, b, c], [a, c, d]]);
                }
            }
            _ => {
                self.project(corners, position);
                if self.is_fan() {
                    fan(corners, out);
                } else {
                    self.clip_ears(corners, out);
                }
            }
        }
    }

    /// Drops the axis along which Newell's normal is longest, so that the polygon runs counter-clockwise.
    fn project(&mut self, corners: &[u32], position: impl Fn(u32) -> DVec3) {
        // Relative to the first corner: a georeferenced polygon keeps its digits.
        let origin = position(corners[0]);
        let local = |i: usize| position(corners[i % corners.len()]) - origin;
        let normal = (0..corners.len()).fold(DVec3::ZERO, |n, i| n + local(i).cross(local(i + 1)));
        let axis = normal.abs().max_position();
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let flip = normal[axis] < 0.0;
        self.points.clear();
        self.points.extend((0..corners.len()).map(|i| {
            let p = local(i);
            if flip { DVec2::new(p[v], p[u]) } else { DVec2::new(p[u], p[v]) }
        }));
    }

    /// Twice the signed area of a triangle of corners.
    fn area(&self, a: usize, b: usize, c: usize) -> f64 {
        (self.points[b] - self.points[a]).perp_dot(self.points[c] - self.points[a])
    }

    /// Every turn is to the left, and so is every triangle of the fan: convex, and wound once.
    fn is_fan(&self) -> bool {
        let n = self.points.len();
        (0..n).all(|i| self.area(i, (i + 1) % n, (i + 2) % n) > 0.0)
            && (1..n - 1).all(|i| self.area(0, i, i + 1) > 0.0)
    }

    /// Meisters, "Polygons have ears", 1975. Where rounding or a crossing leaves no proper ear, a corner is cut off
    /// all the same, a flat one first.
    fn clip_ears(&mut self, corners: &[u32], out: &mut Vec<[u32; 3]>) {
        let n = corners.len();
        self.next = (0..n).map(|i| (i + 1) % n).collect();
        self.prev = (0..n).map(|i| (i + n - 1) % n).collect();
        self.reflex = (0..n).filter(|&i| !self.turns_left(i)).collect();
        self.earned += STEPS_PER_CORNER * n as u64;
        let most = (MAX_STEPS + self.earned).saturating_sub(self.taken);
        let mut steps = 0;
        let mut left = n;
        let mut at = 0;
        let mut refused = 0;
        let mut second_best = None;
        while left > 3 && steps < most {
            if self.is_ear(at, &mut steps) || refused >= left {
                let ear = if refused >= left { second_best.unwrap_or(at) } else { at };
                out.push([corners[self.prev[ear]], corners[ear], corners[self.next[ear]]]);
                at = self.unlink(ear);
                steps += self.reflex.len() as u64;
                left -= 1;
                refused = 0;
                second_best = None;
            } else {
                if second_best.is_none() && self.area(self.prev[at], at, self.next[at]) == 0.0 {
                    second_best = Some(at);
                }
                refused += 1;
                at = self.next[at];
            }
        }
        self.taken += steps;
        let rest: Vec<u32> =
            std::iter::successors(Some(at), |&i| Some(self.next[i])).take(left).map(|i| corners[i]).collect();
        fan(&rest, out);
    }

    fn turns_left(&self, i: usize) -> bool {
        self.area(self.prev[i], i, self.next[i]) > 0.0
    }

    /// Takes corner `i` out of the ring; returns where to look for the next ear (two on, so that triangles spread
    /// round the polygon and do not become a sliver each).
    fn unlink(&mut self, i: usize) -> usize {
        let (p, n) = (self.prev[i], self.next[i]);
        self.next[p] = n;
        self.prev[n] = p;
        // A neighbour may have become convex; no corner becomes reflex by the cutting of an ear.
        let mut reflex = std::mem::take(&mut self.reflex);
        reflex.retain(|&r| r != i && !((r == p || r == n) && self.turns_left(r)));
        self.reflex = reflex;
        self.next[n]
    }

    fn is_ear(&self, i: usize, steps: &mut u64) -> bool {
        let (p, n) = (self.prev[i], self.next[i]);
        *steps += 1;
        if !self.turns_left(i) {
            return false;
        }
        *steps += self.reflex.len() as u64;
        let corners = [p, i, n].map(|k| self.points[k]);
        !self.reflex.iter().any(|&r| {
            // A corner at the same place as one of the triangle's (a bridge to a hole) does not block it.
            r != p
                && r != n
                && !corners.contains(&self.points[r])
                && self.area(p, i, r) >= 0.0
                && self.area(i, n, r) >= 0.0
                && self.area(n, p, r) >= 0.0
        })
    }
}

/// Whether the triangles abc and acd face the same way.
fn fold_free(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> bool {
    (b - a).cross(c - a).dot((c - a).cross(d - a)) > 0.0
}

fn fan(corners: &[u32], out: &mut Vec<[u32; 3]>) {
    if let [first, rest @ ..] = corners {
        out.extend(rest.windows(2).map(|edge| [*first, edge[0], edge[1]]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cuts the polygon and checks that the triangles tile it: as many as there must be, none turned over, and their
    /// areas sum to the polygon's (with no overturned triangle the sum is equal only if none overlap).
    fn check(points: &[DVec3]) -> Vec<[u32; 3]> {
        let corners: Vec<u32> = (0..points.len() as u32).collect();
        let mut out = vec![];
        Triangulator::default().cut(&corners, |i| points[i as usize], &mut out);
        assert_eq!(out.len(), points.len() - 2);
        let cross = |a: DVec3, b: DVec3, c: DVec3| (b - a).cross(c - a);
        let polygon = (1..points.len() - 1)
            .fold(DVec3::ZERO, |sum, i| sum + cross(points[0], points[i], points[i + 1]));
        let unit = polygon.normalize();
        let mut sum = 0.0;
        for t in &out {
            let area = cross(points[t[0] as usize], points[t[1] as usize], points[t[2] as usize]).dot(unit);
            // The tolerance is the rounding of corners placed on the plane.
            assert!(area >= -1e-9, "triangle {t:?} is turned over");
            sum += area;
        }
        // A few hundred additions of rounded areas.
        assert!((sum - polygon.length()).abs() < 1e-9 * polygon.length(), "{sum} {}", polygon.length());
        out
    }

    fn in_many_planes(points: &[(f64, f64)]) {
        let flat: Vec<DVec3> = points.iter().map(|&(x, y)| DVec3::new(x, y, 0.0)).collect();
        for turn in [0.0, 0.7, 1.6, 3.0, 4.0] {
            let rotation = glam::DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), turn);
            check(&flat.iter().map(|&p| rotation * p).collect::<Vec<_>>());
            check(&flat.iter().rev().map(|&p| rotation * p).collect::<Vec<_>>());
        }
        for start in 0..flat.len() {
            let mut rotated = flat.clone();
            rotated.rotate_left(start);
            check(&rotated);
        }
    }

    #[test]
    fn polygons_of_all_shapes_are_tiled() {
        in_many_planes(&[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]);
        // A dart, an L, a square with corners along its sides, a comb, a square ring cut open by a bridge.
        in_many_planes(&[(0.0, 0.0), (2.0, -1.0), (0.5, 0.0), (2.0, 1.0)]);
        in_many_planes(&[(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)]);
        in_many_planes(&[(0.0, 0.0), (0.5, 0.0), (1.0, 0.0), (1.0, 0.5), (1.0, 1.0), (0.3, 1.0), (0.0, 1.0)]);
        let mut comb = vec![(20.0, -1.0), (20.0, 0.0)];
        comb.extend((1..20).rev().map(|i| (i as f64, if i % 2 == 0 { 0.0 } else { 5.0 })));
        comb.extend([(0.0, 0.0), (0.0, -1.0)]);
        in_many_planes(&comb);
        let ring = [(0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (0.0, 3.0), (0.0, 0.0)];
        let hole = [(1.0, 1.0), (1.0, 2.0), (2.0, 2.0), (2.0, 1.0), (1.0, 1.0)];
        in_many_planes(&[&ring[..], &hole[..]].concat());
        let spiral = |i: usize, r: f64| {
            let a = i as f64 * 0.2;
            ((r + 0.1 * a) * a.cos(), (r + 0.1 * a) * a.sin())
        };
        let outer: Vec<_> = (0..120).map(|i| spiral(i, 1.3)).collect();
        let inner: Vec<_> = (0..120).rev().map(|i| spiral(i, 1.0)).collect();
        in_many_planes(&[outer, inner].concat());
    }

    #[test]
    fn convex_polygons_become_fans_also_far_from_the_origin() {
        let n = 12;
        let at = |i: usize, offset: f64| {
            let a = i as f64 / n as f64 * std::f64::consts::TAU;
            DVec3::new(offset + a.cos(), a.sin(), -offset)
        };
        for offset in [0.0, 4e6] {
            let out = check(&(0..n).map(|i| at(i, offset)).collect::<Vec<_>>());
            assert!(out.iter().enumerate().all(|(i, t)| *t == [0, i as u32 + 1, i as u32 + 2]));
        }
    }

    #[test]
    fn hopeless_polygons_still_give_their_count() {
        let mut cutter = Triangulator::default();
        let nan = DVec3::NAN;
        let cases: [&dyn Fn(u32) -> DVec3; 4] = [
            &|_| DVec3::ONE,
            &|i| DVec3::new(f64::from(i), 0.0, 0.0),
            &|i| if i % 3 == 0 { nan } else { DVec3::new(f64::from(i * i), f64::from(i), 0.0) },
            &|i| DVec3::new((f64::from(i) * 2.6).cos(), (f64::from(i) * 2.6).sin(), 0.0),
        ];
        for (k, position) in cases.iter().enumerate() {
            for n in [3u32, 4, 5, 6, 50] {
                let mut out = vec![];
                cutter.cut(&(0..n).collect::<Vec<_>>(), position, &mut out);
                assert_eq!(out.len() as u32, n - 2, "case {k}, {n} corners");
            }
        }
        let mut out = vec![];
        cutter.cut(&[1, 2], |_| DVec3::ZERO, &mut out);
        assert!(out.is_empty());
    }
}
