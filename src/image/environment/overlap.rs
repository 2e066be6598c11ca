//! Solid angles that texels of a cube and cells of an equirectangular picture have in common, exactly.
//!
//! In the chart of longitude l and z = sin(latitude) areas are solid angles (Archimedes), and cells are rectangles. A
//! region's area is the integral of z dl along its upper borders, less that along its lower ones. So it is enough to walk
//! along parallels and along the lines of the cube's grid: each piece between two crossings belongs to the regions above
//! and below it (the way of SCRIP: P. Jones, "First- and Second-Order Conservative Remapping Schemes for Grids in
//! Spherical Coordinates", Monthly Weather Review 127, 1999, though with integrals in closed form). Meridians, and upright
//! lines of side faces, which are meridians too, add nothing.
//!
//! - A line t = c of a side face, l from its middle: tan(latitude) = c cos l, and z dl has the integral
//!   atan(c tan l / sqrt(1 + tan^2 l + c^2)).
//! - A line x = c of the upper face, l from the x axis: tan(latitude) = cos l / c; asin(sin l / sqrt(1 + c^2)).
//!
//! Both grids are alike above and below the equator, so only the upper half is walked.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// Where a line of the cube's grid crosses a meridian.
#[derive(Clone, Copy, Default)]
struct End {
    /// The row of cells there.
    row: usize,
    /// The integral up to there.
    integral: f64,
}

/// How many of 1, 2, ... `most` are `within`, of which the first ones are; near a guess.
fn counted(guess: usize, most: usize, within: impl Fn(usize) -> bool) -> usize {
    let mut at = guess;
    while at < most && within(at + 1) {
        at += 1;
    }
    while at > 0 && !within(at) {
        at -= 1;
    }
    at
}

/// Two grids on one sphere.
pub(super) struct Overlap {
    /// Cells around.
    w: usize,
    /// Cells from pole to pole.
    h: usize,
    /// Texels across a face.
    n: usize,
    /// Parallels between rows from the pole down to the equator: sine and tangent of their latitudes.
    sin: Vec<f64>,
    tan: Vec<f64>,
    /// Lines of a face's grid from its middle to its edge at 1; the first is 0, be there a line or not.
    lines: Vec<f64>,
}

impl Overlap {
    pub fn new(w: usize, h: usize, n: usize) -> Self {
        let latitudes: Vec<f64> = (0..=h / 2).map(|j| PI * (0.5 - j as f64 / h as f64)).collect();
        let mut sin: Vec<f64> = latitudes.iter().map(|p| p.sin()).collect();
        let mut tan: Vec<f64> = latitudes.iter().map(|p| p.tan()).collect();
        if h.is_multiple_of(2) {
            (sin[h / 2], tan[h / 2]) = (0.0, 0.0);
        }
        let first = if n.is_multiple_of(2) { 2 } else { 1 };
        let mut lines = vec![0.0];
        lines.extend((first..=n).step_by(2).map(|i| i as f64 / n as f64));
        Overlap { w, h, n, sin, tan, lines }
    }

    /// Strips of texels between the middle of a face and its edge, the first of them cut in half where `n` is odd.
    pub fn halves(&self) -> usize {
        self.lines.len() - 1
    }

    /// The texel, counted along the axis, of strip `k` on the positive side; on the other it is as far from the end.
    pub fn positive(&self, k: usize) -> usize {
        self.n / 2 + k
    }

    /// The strip of a coordinate of 0 to 1.
    fn strip(&self, v: f64) -> usize {
        let v = v * self.n as f64;
        let at = if self.n.is_multiple_of(2) { v * 0.5 } else { (v + 1.0) * 0.5 };
        (at as usize).min(self.halves() - 1)
    }

    /// The number of lines c, of those before the edge, that are `passed`; near the strip of `v`.
    ///
    /// Where a line touches a parallel, the place of their crossing is known to the root of the rounding error only. So
    /// both who walk there must take it, or neither: they ask the same question of the same numbers.
    fn passed(&self, v: f64, passed: impl Fn(f64) -> bool) -> usize {
        counted(self.strip(v), self.halves() - 1, |k| passed(self.lines[k]))
    }

    /// The row of a latitude above the equator whose tangent is about y / x: the number of parallels, by their tangents,
    /// that are `above` it.
    fn row(&self, y: f64, x: f64, above: impl Fn(f64) -> bool) -> usize {
        // The angle from the pole.
        let at = x.atan2(y) * self.h as f64 / PI;
        let most = (self.h - 1) / 2;
        counted((at as usize).min(most), most, |j| above(self.tan[j]))
    }

    fn column(&self, longitude: f64) -> usize {
        ((longitude / TAU + 0.5) * self.w as f64).floor().rem_euclid(self.w as f64) as usize % self.w
    }

    /// Meridians between columns, relative to `centre`, that lie within a range.
    fn meridians(&self, centre: f64, from: f64, to: f64) -> impl Iterator<Item = f64> {
        let w = self.w as f64;
        let at = |l: f64| ((l + centre) / TAU + 0.5) * w;
        let (first, last) = (at(from).ceil() as i64, at(to).floor() as i64);
        (first..=last).map(move |i| TAU * (i as f64 / w - 0.5) - centre)
    }

    /// Walks the upper half of a side face, between longitudes `from` and `to` off its middle, which is at `centre`.
    /// `emit` gets a texel's column (by growing longitude) and strip above the middle, a cell's column and row, and a part
    /// of the solid angle that they share; parts may be negative, sums are not.
    pub fn side(&self, centre: f64, [from, to]: [f64; 2], mut emit: impl FnMut([usize; 2], [usize; 2], f64)) {
        let n = self.n as f64;
        let mut cuts: Vec<f64> = self.meridians(centre, from, to).collect();
        cuts.extend((0..=self.n).map(|m| (2.0 * m as f64 / n - 1.0).atan()));
        cuts.extend([from, to, 0.0]);
        cuts.retain(|c| (from..=to).contains(c));
        cuts.sort_unstable_by(f64::total_cmp);
        let mut last = self.side_ends(cuts[0]);
        for pair in cuts.windows(2) {
            let ends = self.side_ends(pair[1]);
            let middle = 0.5 * (pair[0] + pair[1]);
            if pair[1] > pair[0] {
                let x = (((middle.tan() + 1.0) * 0.5 * n) as usize).min(self.n - 1);
                let column = self.column(middle + centre);
                // Away from the middle; no strip lies on both sides of it.
                let [a, b] = if middle > 0.0 { [pair[0], pair[1]] } else { [-pair[1], -pair[0]] };
                let [near, far] = if middle > 0.0 { [&last, &ends] } else { [&ends, &last] };
                let mut put = |strip, row, area| emit([x, strip], [column, row], area);
                self.side_lines([a, b], [near, far], &mut put);
                self.side_parallels([a, b], &mut put);
            }
            last = ends;
        }
    }

    fn side_integral(c: f64, tan: f64) -> f64 {
        (c * tan / (1.0 + tan * tan + c * c).sqrt()).atan()
    }

    fn side_ends(&self, longitude: f64) -> Vec<End> {
        let (tan, cos) = (longitude.abs().tan(), longitude.cos());
        let end = |c: f64| End {
            row: self.row(c * cos, 1.0, |t| t >= c * cos),
            integral: Self::side_integral(c, tan),
        };
        self.lines.iter().map(|&c| end(c)).collect()
    }

    /// Lines t = c: away from the middle they fall.
    fn side_lines(&self, [a, b]: [f64; 2], ends: [&[End]; 2], put: &mut impl FnMut(usize, usize, f64)) {
        for (k, (&from, &to)) in ends[0].iter().zip(ends[1]).enumerate().skip(1) {
            let mut done = from.integral;
            let mut piece = |row: usize, upto: f64| {
                put(k - 1, row, upto - done);
                if k < self.halves() {
                    put(k, row, done - upto);
                }
                done = upto;
            };
            for row in from.row..to.row {
                let l = (self.tan[row + 1] / self.lines[k]).min(1.0).acos().clamp(a, b);
                piece(row, Self::side_integral(self.lines[k], l.tan()));
            }
            piece(to.row, to.integral);
        }
    }

    /// Parallels: away from the middle they rise over the lines.
    fn side_parallels(&self, [a, b]: [f64; 2], put: &mut impl FnMut(usize, usize, f64)) {
        let (near, far) = (a.cos(), b.cos());
        let first = self.tan.partition_point(|t| *t >= near).max(1);
        for j in first..self.tan.len() {
            let (tan, sin) = (self.tan[j], self.sin[j]);
            let leaves = tan >= far;
            let end = if leaves { tan.acos().clamp(a, b) } else { b };
            let strip = |cos: f64| self.passed(tan / cos, |c| tan >= c * cos);
            let last = if leaves { self.halves() - 1 } else { strip(far) };
            let mut done = a;
            let mut piece = |strip: usize, upto: f64| {
                put(strip, j, sin * (upto - done));
                put(strip, j - 1, sin * (done - upto));
                done = upto;
            };
            for strip in strip(near)..last {
                piece(strip, (tan / self.lines[strip + 1]).min(1.0).acos().clamp(a, end));
            }
            piece(last, end);
        }
    }

    /// Walks a quarter of the upper face, between longitudes `from` and `to` off its first edge, which is at `start`.
    /// `emit` gets the strips of a texel along that edge and across it, and the rest as in [`Self::side`].
    pub fn top(&self, start: f64, [from, to]: [f64; 2], mut emit: impl FnMut([usize; 2], [usize; 2], f64)) {
        let mut cuts: Vec<f64> = self.meridians(start, from, to).collect();
        cuts.extend([from, to]);
        cuts.retain(|c| (from..=to).contains(c));
        cuts.sort_unstable_by(f64::total_cmp);
        let both = |l: f64| [self.top_ends(l), self.top_ends(FRAC_PI_2 - l)];
        let mut last = both(cuts[0]);
        for pair in cuts.windows(2) {
            let ends = both(pair[1]);
            let [a, b] = [pair[0], pair[1]];
            if b > a {
                let column = self.column(0.5 * (a + b) + start);
                let mut put = |x, y, row, area| emit([x, y], [column, row], area);
                self.top_lines([a, b], [&last[0], &ends[0]], &mut put);
                let mirrored = [FRAC_PI_2 - b, FRAC_PI_2 - a];
                self.top_lines(mirrored, [&ends[1], &last[1]], &mut |x, y, row, area| put(y, x, row, area));
                self.top_parallels([a, b], &mut put);
            }
            last = ends;
        }
    }

    fn top_integral(c: f64, sin: f64) -> f64 {
        (sin / (1.0 + c * c).sqrt()).asin()
    }

    fn top_end(&self, c: f64, sin: f64, cos: f64) -> End {
        End { row: self.row(cos, c, |t| c * t >= cos), integral: Self::top_integral(c, sin) }
    }

    /// Of the lines x = c that are within the face at this longitude; one more, for rounding.
    fn top_ends(&self, longitude: f64) -> Vec<End> {
        let (sin, cos) = longitude.sin_cos();
        let within = if longitude < FRAC_PI_4 { self.lines.len() } else { self.strip(cos / sin) + 2 };
        let end = |c: f64| self.top_end(c, sin, cos);
        self.lines.iter().take(within).map(|&c| end(c)).collect()
    }

    /// Lines x = c: with growing longitude they go away from the pole and across strips of the other axis.
    fn top_lines(&self, [a, b]: [f64; 2], ends: [&[End]; 2], put: &mut impl FnMut(usize, usize, usize, f64)) {
        for k in 1..self.lines.len().min(ends[0].len()) {
            let c = self.lines[k];
            let limit = (1.0 / c).atan();
            if a >= limit {
                break;
            }
            let leaves = b >= limit;
            let to = match ends[1].get(k) {
                Some(end) if !leaves => *end,
                _ => {
                    let (sin, cos) = limit.sin_cos();
                    self.top_end(c, sin, cos)
                }
            };
            let last = if leaves { self.halves() - 1 } else { self.strip(c * b.tan()) };
            let (mut row, mut y) = (ends[0][k].row, self.strip(c * a.tan()));
            let mut done = ends[0][k].integral;
            loop {
                // Sines of the longitudes of the next crossings.
                let parallel = (row < to.row).then(|| {
                    let cos = (c * self.tan[row + 1]).min(1.0);
                    ((1.0 - cos) * (1.0 + cos)).sqrt()
                });
                let line = (y < last).then(|| self.lines[y + 1] / self.lines[y + 1].hypot(c));
                let is_parallel = match (parallel, line) {
                    (Some(p), Some(l)) => p < l,
                    (p, _) => p.is_some(),
                };
                let next = if is_parallel { parallel } else { line };
                let upto = next.map_or(to.integral, |sin| Self::top_integral(c, sin));
                put(k - 1, y, row, done - upto);
                if k < self.halves() {
                    put(k, y, row, upto - done);
                }
                done = upto;
                match (next, is_parallel) {
                    (None, _) => break,
                    (_, true) => row += 1,
                    (_, false) => y += 1,
                }
            }
        }
    }

    /// Parallels are circles around the pole.
    fn top_parallels(&self, [a, b]: [f64; 2], put: &mut impl FnMut(usize, usize, usize, f64)) {
        // The pole itself, as wide as any parallel in this chart.
        put(0, 0, 0, b - a);
        for j in 1..self.tan.len() {
            let (tan, sin) = (self.tan[j], self.sin[j]);
            // Beyond the inscribed circle the edges cut it.
            let [from, to] = if tan < 1.0 { [a.max(tan.acos()), b.min(tan.asin())] } else { [a, b] };
            if from >= to {
                break;
            }
            let radius = 1.0 / tan;
            let strip = |cos: f64| self.passed(radius * cos, |c| c * tan < cos);
            let (mut x, mut y) = (strip(from.cos()), strip((FRAC_PI_2 - from).cos()));
            let (last_x, last_y) = (strip(to.cos()), strip((FRAC_PI_2 - to).cos()));
            let mut done = from;
            loop {
                let across = (x > last_x).then(|| (self.lines[x] * tan).min(1.0).acos());
                let along = (y < last_y).then(|| (self.lines[y + 1] * tan).min(1.0).asin());
                let is_across = match (across, along) {
                    (Some(p), Some(l)) => p < l,
                    (p, _) => p.is_some(),
                };
                let next = if is_across { across } else { along };
                let upto = next.map_or(to, |l| l.clamp(done, to));
                put(x, y, j, sin * (upto - done));
                put(x, y, j - 1, sin * (done - upto));
                done = upto;
                match (next, is_across) {
                    (None, _) => break,
                    (_, true) => x -= 1,
                    (_, false) => y += 1,
                }
            }
        }
    }
}
