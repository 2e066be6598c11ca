//! What most likely sets two pictures apart, where it is one of the usual slips: a flip, a shift by a pixel, a constant
//! factor, a curve, colours in another order.
//!
//! Each slip is done to the reference, on a few hundred thousand of its pixels; the one after which least of the difference is
//! left is named, if it takes away most of it. Differences are held against the sizes of both values, so that single bright
//! pixels have no say.

use super::pair::{Pair, Space};
use crate::color::{linear_to_srgb, srgb_to_linear};
use rayon::prelude::*;
use serde::Serialize;

/// A slip that explains a difference.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cause {
    /// "the test is the reference, flipped left to right".
    pub text: String,
    /// How much of the difference is gone when it is undone: from 0 to 1.
    pub explains: f64,
}

/// A slip that explains less is none.
const LEAST: f64 = 0.6;
/// Pixels that are looked at, roughly.
const LOOKED_AT: usize = 200_000;
/// The farthest shift that is tried, pixels.
const FARTHEST: isize = 3;
/// How much more a later slip in the list must explain: simple ones come first.
const MARGIN: f64 = 0.01;

/// From an index to where its value is taken from, or none outside of the picture.
type Place = Box<dyn Fn(usize, usize) -> Option<usize> + Sync>;
/// From the reference's value to the test's, by channel.
type Curve = Box<dyn Fn(usize, f32) -> f32 + Sync>;

/// Something that may have happened.
struct Slip {
    text: String,
    place: Option<Place>,
    curve: Option<Curve>,
    /// From which of the reference's channels each of the test's is.
    order: Option<[usize; 3]>,
}

impl Slip {
    fn new(text: impl Into<String>) -> Self {
        Slip { text: text.into(), place: None, curve: None, order: None }
    }

    fn moved(
        text: impl Into<String>,
        place: impl Fn(usize, usize) -> Option<usize> + Sync + 'static,
    ) -> Self {
        Slip { place: Some(Box::new(place)), ..Slip::new(text) }
    }

    fn curved(text: impl Into<String>, curve: impl Fn(usize, f32) -> f32 + Sync + 'static) -> Self {
        Slip { curve: Some(Box::new(curve)), ..Slip::new(text) }
    }
}

/// The most likely cause, if one explains most of the difference.
pub fn likely(pair: &Pair) -> Option<Cause> {
    let rows = Rows::new(pair);
    let before = rows.difference(pair, &Slip::new(""));
    if before == 0.0 {
        return None;
    }
    let slips = places(pair).into_iter().chain(orders(pair)).chain(curves(pair, &rows));
    let mut best: Option<Cause> = None;
    for slip in slips {
        let explains = 1.0 - rows.difference(pair, &slip) / before;
        let beats = best.as_ref().is_none_or(|b| explains > b.explains + MARGIN);
        if explains >= LEAST && beats {
            best = Some(Cause { text: slip.text, explains });
        }
    }
    best
}

/// The pixels that are looked at: whole rows would be alike, so columns are moved from row to row.
struct Rows {
    step: usize,
    floor: f32,
}

impl Rows {
    fn new(pair: &Pair) -> Self {
        let step = ((pair.pixels() / LOOKED_AT) as f64).sqrt().floor().max(1.0) as usize;
        let rows = Rows { step, floor: 0.0 };
        let sizes = rows.indices(pair).map(|i| f64::from(pair.reference[0][i].abs()));
        let (sum, count) = sizes.fold((0.0, 0usize), |(s, n), v| (s + v, n + 1));
        // Differences far below the picture's own level are none.
        Rows { floor: (0.01 * sum / count.max(1) as f64) as f32, ..rows }
    }

    /// Row-major indices of pixels that count.
    fn indices<'a>(&'a self, pair: &'a Pair) -> impl Iterator<Item = usize> + 'a {
        let [w, h] = pair.size;
        let row =
            move |y: usize| (y * 7 / self.step % self.step..w).step_by(self.step).map(move |x| y * w + x);
        (0..h).step_by(self.step).flat_map(row).filter(|i| pair.counts(*i))
    }

    /// The mean of |a - b| / (|a| + |b|), a being the reference after a slip.
    fn difference(&self, pair: &Pair, slip: &Slip) -> f64 {
        let [w, h] = pair.size;
        let rows: Vec<usize> = (0..h).step_by(self.step).collect();
        let sums: Vec<(f64, usize)> = rows
            .par_iter()
            .map(|y| {
                let mut sum = (0.0, 0);
                for x in (y * 7 / self.step % self.step..w).step_by(self.step) {
                    let to = y * w + x;
                    let from = match &slip.place {
                        Some(place) => place(x, *y),
                        None => Some(to),
                    };
                    let Some(from) = from.filter(|from| pair.counts(to) && pair.counts(*from)) else {
                        continue;
                    };
                    for c in 0..pair.channels.len() {
                        let source = slip.order.map_or(c, |o| o[c]);
                        let mut a = pair.reference[source][from];
                        if let Some(curve) = &slip.curve {
                            a = curve(c, a);
                        }
                        let b = pair.test[c][to];
                        let size = a.abs() + b.abs() + self.floor;
                        sum.0 += if size > 0.0 { f64::from((a - b).abs() / size) } else { 0.0 };
                        sum.1 += 1;
                    }
                }
                sum
            })
            .collect();
        // In order of rows: the same on any number of threads.
        let (sum, count) = sums.into_iter().fold((0.0, 0), |(s, n), (a, b)| (s + a, n + b));
        if count == 0 { f64::INFINITY } else { sum / count as f64 }
    }
}

fn places(pair: &Pair) -> Vec<Slip> {
    let [w, h] = pair.size;
    let at = move |x: usize, y: usize| Some(y * w + x);
    let mut all = vec![
        Slip::moved("the test is flipped left to right", move |x, y| at(w - 1 - x, y)),
        Slip::moved("the test is flipped upside down", move |x, y| at(x, h - 1 - y)),
        Slip::moved("the test is turned by 180 degrees", move |x, y| at(w - 1 - x, h - 1 - y)),
    ];
    if w == h {
        all.push(Slip::moved("rows and columns of the test are exchanged", move |x, y| at(y, x)));
        all.push(Slip::moved("the test is turned by 90 degrees to the right", move |x, y| at(y, h - 1 - x)));
        all.push(Slip::moved("the test is turned by 90 degrees to the left", move |x, y| at(w - 1 - y, x)));
    }
    let mut shifts: Vec<[isize; 2]> =
        (-FARTHEST..=FARTHEST).flat_map(|dy| (-FARTHEST..=FARTHEST).map(move |dx| [dx, dy])).collect();
    shifts.retain(|s| *s != [0, 0]);
    shifts.sort_by_key(|s| s[0].abs() + s[1].abs());
    for [dx, dy] in shifts {
        let from = move |x: usize, y: usize| {
            let (x, y) = (x.checked_add_signed(-dx)?, y.checked_add_signed(-dy)?);
            (x < w && y < h).then_some(y * w + x)
        };
        all.push(Slip::moved(format!("the test is shifted by {}", shift_text(dx, dy)), from));
    }
    all
}

fn shift_text(dx: isize, dy: isize) -> String {
    let part = |d: isize, [back, forth]: [&str; 2]| {
        let unit = if d.abs() == 1 { "pixel" } else { "pixels" };
        format!("{} {unit} {}", d.abs(), if d < 0 { back } else { forth })
    };
    let parts = [(dx, ["to the left", "to the right"]), (dy, ["up", "down"])];
    let parts: Vec<String> = parts.into_iter().filter(|(d, _)| *d != 0).map(|(d, w)| part(d, w)).collect();
    parts.join(" and ")
}

fn orders(pair: &Pair) -> Vec<Slip> {
    if pair.channels.len() != 3 {
        return Vec::new();
    }
    let orders = [[2, 1, 0], [1, 0, 2], [0, 2, 1], [1, 2, 0], [2, 0, 1]];
    let text = |o: [usize; 3]| {
        let names: Vec<&str> = o.iter().map(|c| pair.channels[*c].as_str()).collect();
        format!("the test's channels stand in the order {}", names.join(" "))
    };
    orders.map(|o| Slip { order: Some(o), ..Slip::new(text(o)) }).into_iter().collect()
}

/// Slips of values; factors and powers are fitted.
fn curves(pair: &Pair, rows: &Rows) -> Vec<Slip> {
    let mut all = Vec::new();
    let factors: Vec<f32> = (0..pair.channels.len()).map(|c| factor(pair, rows, c)).collect();
    let middle = median(factors.clone());
    if middle > 0.0 && middle.is_finite() {
        all.push(Slip::curved(factor_text(middle), move |_, v| v * middle));
    }
    if pair.space == Space::Linear {
        if pair.reference.iter().flatten().any(|v| *v > 1.0) {
            all.push(Slip::curved("the test is cut off at 1", |_, v| v.clamp(0.0, 1.0)));
        }
        all.push(Slip::curved("the test is sRGB-encoded, the reference linear", |_, v| linear_to_srgb(v)));
        all.push(Slip::curved("the reference is sRGB-encoded, the test linear", |_, v| {
            if v <= 1.0 { srgb_to_linear(v.max(0.0)) } else { v }
        }));
    }
    let equal = factors.iter().all(|f| (f / middle - 1.0).abs() < 0.01);
    if !equal && factors.iter().all(|f| *f > 0.0 && f.is_finite()) {
        let named: Vec<String> =
            pair.channels.iter().zip(&factors).map(|(n, f)| format!("{n} by {f:.4}")).collect();
        let text = format!("the test's channels are scaled: {}", named.join(", "));
        all.push(Slip::curved(text, move |c, v| v * factors[c]));
    }
    if let Some((power, scale)) = power(pair, rows) {
        let named = [2.2f32, 1.0 / 2.2, 2.4, 1.0 / 2.4, 1.8, 1.0 / 1.8];
        let known = named.into_iter().find(|k| (power / k - 1.0).abs() < 0.01);
        let text = match known {
            Some(k) if k < 1.0 => format!("the test is encoded by gamma {:.1}", 1.0 / k),
            Some(k) => format!("the test is decoded by gamma {k:.1}"),
            None => format!("the test is the reference to the power {power:.3}, times {scale:.3}"),
        };
        all.push(Slip::curved(text, move |_, v| scale * v.max(0.0).powf(power)));
    }
    let offset = median(rows.indices(pair).map(|i| pair.test[0][i] - pair.reference[0][i]).collect());
    if offset != 0.0 {
        all.push(Slip::curved(format!("a constant is added to the test: {offset:.4}"), move |_, v| {
            v + offset
        }));
    }
    all
}

/// The middle ratio of test to reference where both have light.
fn factor(pair: &Pair, rows: &Rows, channel: usize) -> f32 {
    let (r, t) = (&pair.reference[channel], &pair.test[channel]);
    let bright = rows.indices(pair).filter(|i| r[*i] > rows.floor && t[*i] > 0.0);
    median(bright.map(|i| t[i] / r[i]).collect())
}

/// The power and factor of a line through logarithms; none where that is about 1 or there is too little to see.
fn power(pair: &Pair, rows: &Rows) -> Option<(f32, f32)> {
    let (r, t) = (&pair.reference[0], &pair.test[0]);
    let bright = rows.indices(pair).filter(|i| r[*i] > rows.floor && t[*i] > 0.0);
    let points: Vec<[f64; 2]> = bright.map(|i| [f64::from(r[i]).ln(), f64::from(t[i]).ln()]).collect();
    let n = points.len() as f64;
    let mean = [0, 1].map(|a| points.iter().map(|p| p[a]).sum::<f64>() / n);
    let moment = |a: usize, b: usize| points.iter().map(|p| (p[a] - mean[a]) * (p[b] - mean[b])).sum::<f64>();
    let power = moment(0, 1) / moment(0, 0);
    let usable = points.len() > 16 && power.is_finite() && (power - 1.0).abs() > 0.02;
    usable.then(|| (power as f32, (mean[1] - power * mean[0]).exp() as f32))
}

/// Factors that mean something.
fn factor_text(f: f32) -> String {
    use std::f32::consts::{FRAC_1_PI, PI};
    let near = |k: f32| (f / k - 1.0).abs() < 2e-3;
    let named = [
        (PI, "pi"),
        (FRAC_1_PI, "1/pi"),
        (2.0 * PI, "2 pi"),
        (4.0 * PI, "4 pi"),
        (0.5 * FRAC_1_PI, "1/(2 pi)"),
        (0.25 * FRAC_1_PI, "1/(4 pi)"),
        (255.0, "255"),
        (1.0 / 255.0, "1/255"),
        (683.0, "683 (lumens a watt)"),
        (1.0 / 683.0, "1/683 (lumens a watt)"),
    ];
    if let Some((_, name)) = named.into_iter().find(|(k, _)| near(*k)) {
        return format!("the test is {name} times the reference");
    }
    let stops = f.log2().round();
    if stops != 0.0 && stops.abs() <= 24.0 && near(stops.exp2()) {
        let unit = if stops.abs() == 1.0 { "stop" } else { "stops" };
        return format!("the test's exposure is {stops:+} {unit} ({f:.4} times the reference)");
    }
    format!("the test is {f:.4} times the reference")
}

/// 0 of nothing.
fn median(mut values: Vec<f32>) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}
