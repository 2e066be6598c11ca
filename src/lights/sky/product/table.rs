//! Probabilities of about a thousand cells, laid out as a square that numbers are mapped to.
//!
//! Rows of equal probability, exactly, so that stratified numbers stay stratified: where a cell has more than what is left of
//! a row, the next rows have the rest of it. In a row cells are found without a branch.

use super::place::Places;

/// Rows: few enough that cells are as small across as along, and a power of two, as points are even for.
const ROWS: usize = 16;
/// What probabilities within a row are multiples of one over.
const UNITS: i16 = i16::MAX;
/// Where the search for an entry begins is known for so many parts of a row, each of 2^`PART` units ...
const PARTS: usize = 16;
const PART: u32 = 11;
/// ... and from there it passes so many entries at once: what a vector register holds, and mostly all that there are.
const AT_ONCE: usize = 16;

/// See the module. Probabilities are exact multiples of their units, and whatever has weight has at least one.
pub(super) struct Table {
    /// For each part of each row, the first entry that may lie in it.
    firsts: [u16; ROWS * PARTS],
    /// Running sums of units over the entries of a row, after a zero; padded with all of them.
    ends: Box<[i16]>,
    /// The cells of the entries, above them the bits that tell how they lie, and above those the units of all entries of
    /// the cell: one load for whoever draws it.
    cells: Box<[u32]>,
    /// All units of each cell.
    units: Box<[u32]>,
    /// Sum of the weights.
    pub total: f32,
    /// Sum of what the weights would be if nothing else found the light.
    pub whole: f32,
}

/// Bits for the number of a cell.
const CELL: u32 = 10;
pub(super) const MOST_CELLS: usize = 1 << CELL;
pub(super) const SWAPPED: u32 = 1 << CELL;
pub(super) const FIRST_BACK: u32 = 2 << CELL;
pub(super) const SECOND_BACK: u32 = 4 << CELL;
const LIE: u32 = SWAPPED | FIRST_BACK | SECOND_BACK;
/// Where the units begin: the rest is room enough for all of them.
const ABOVE: u32 = CELL + 3;
const _: () = assert!((ROWS as u64 * UNITS as u64) << ABOVE <= 1 << 32);
/// The probability of a unit.
const UNIT: f64 = 1.0 / (UNITS as f64 * ROWS as f64);

/// A cell as far as it lies in a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Entry {
    /// The units of the row that it begins with.
    pub from: i16,
    /// The first unit after it.
    pub to: i16,
    /// See [`Table::cells`].
    cell: u32,
}

impl Entry {
    /// The number of the cell.
    #[inline(always)]
    pub fn cell(self) -> usize {
        self.cell as usize % MOST_CELLS
    }

    /// How it lies, see [`Places::lie`].
    #[inline(always)]
    pub fn lie(self) -> u32 {
        self.cell & LIE
    }

    /// Units of the whole cell.
    #[inline(always)]
    pub fn units(self) -> u32 {
        self.cell >> ABOVE
    }
}

/// Where two numbers in [0, 1) fall among rows and units.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    pub row: i32,
    pub unit: i32,
    /// How far in its row and in units, both with what is left.
    pub at: [f64; 2],
}

impl Spot {
    /// The second finds a row, the first an entry of it.
    #[inline(always)]
    pub fn new(u: [f64; 2]) -> Self {
        // Below the last end, rounding and all.
        const MOST: f64 = 1.0 - 8.0 * f64::EPSILON;
        let inside = |u: f64| if u < 0.0 { 0.0 } else { u };
        let [x, y] = u.map(|u| if u > MOST { MOST } else { inside(u) });
        let (x, y) = (x * f64::from(UNITS), y * ROWS as f64);
        let (unit, row) = (whole(x), whole(y));
        Spot { row, unit, at: [x, y - f64::from(row)] }
    }
}

/// The whole part of a number in [0, 2^31), by way of the bits of 2^52 + x, which vectors have: a conversion as Rust
/// defines it is done one by one.
#[inline(always)]
fn whole(x: f64) -> i32 {
    const ONES: f64 = 4_503_599_627_370_496.0;
    let rounded = x + ONES;
    rounded.to_bits() as i32 - i32::from(rounded - ONES > x)
}

/// The probability of so many units.
#[inline(always)]
pub(super) fn probability(units: u32) -> f64 {
    f64::from(units as i32) * UNIT
}

/// What is left of both numbers, in [0, 1], for the sides of a cell that lies so.
#[inline(always)]
pub(super) fn rest(at: [f64; 2], from: f64, width: f64, lie: u32) -> [f64; 2] {
    let (x, y) = ((at[0] - from) / width, at[1]);
    let swapped = lie & SWAPPED != 0;
    let (a, b) = (if swapped { y } else { x }, if swapped { x } else { y });
    let a = if lie & FIRST_BACK != 0 { 1.0 - a } else { a };
    let b = if lie & SECOND_BACK != 0 { 1.0 - b } else { b };
    [a, b]
}

/// What was found.
#[derive(Debug, Clone, Copy)]
pub(super) struct Found {
    pub cell: usize,
    /// What is left of both numbers, in [0, 1], for the cell's sides.
    pub u: [f64; 2],
}

/// A cell, or as much of it as there is in a row.
struct Piece {
    cell: u16,
    weight: f64,
}

/// Cells as they lie along an axis, those of one place by number. Byte by byte, as comparisons take branches that nobody
/// can foretell.
fn ordered(lit: &[u16], at: &[u16]) -> Vec<u16> {
    let mut keys: Vec<u32> = lit.iter().map(|&i| u32::from(at[i as usize]) << 16 | u32::from(i)).collect();
    let mut sorted = vec![0; keys.len()];
    for shift in [16, 24] {
        let byte = |key: u32| (key >> shift) as usize & 0xff;
        let mut starts = [0u16; 257];
        keys.iter().for_each(|&key| starts[byte(key) + 1] += 1);
        (1..256).for_each(|i| starts[i] += starts[i - 1]);
        for &key in &keys {
            let start = &mut starts[byte(key)];
            sorted[*start as usize] = key;
            *start += 1;
        }
        std::mem::swap(&mut keys, &mut sorted);
    }
    keys.into_iter().map(|key| key as u16).collect()
}

/// Cuts the lit cells, as they lie along y, into rows of equal weight, in which they lie as they do along x.
fn rows(lit: &[u16], weights: &[f32], places: &Places) -> Option<[Vec<Piece>; ROWS]> {
    let by_y = ordered(lit, &places.y);
    let weight = |cell: u16| f64::from(weights[cell as usize]);
    let total: f64 = by_y.iter().map(|&cell| weight(cell)).sum();
    if !(total > 0.0 && total.is_finite()) {
        return None;
    }
    let mut froms = vec![0.0; weights.len()];
    let mut sum = 0.0;
    for &cell in &by_y {
        froms[cell as usize] = sum;
        sum += weight(cell);
    }
    let (size, over_size) = (total / ROWS as f64, ROWS as f64 / total);
    let row_of = |at: f64| ((at * over_size) as usize).min(ROWS - 1);
    let mut rows: [Vec<Piece>; ROWS] = std::array::from_fn(|_| Vec::with_capacity(lit.len() / (ROWS / 2)));
    for cell in ordered(lit, &places.x) {
        let from = froms[cell as usize];
        let to = from + weight(cell);
        let (first, last) = (row_of(from), row_of(to));
        let mut is_lost = true;
        for (row, pieces) in (first..).zip(&mut rows[first..=last]) {
            let end = if row + 1 == ROWS { f64::INFINITY } else { (row + 1) as f64 * size };
            let weight = to.min(end) - from.max(row as f64 * size);
            if weight > 0.0 {
                pieces.push(Piece { cell, weight });
                is_lost = false;
            }
        }
        // What is lost beside the others' sum is not without weight.
        if is_lost {
            rows[first].push(Piece { cell, weight: size * f64::EPSILON });
        }
    }
    Some(rows)
}

/// Running sums of the pieces in whole units.
fn quantise(pieces: &[Piece], mut put: impl FnMut(u16, i16)) {
    let total: f64 = pieces.iter().map(|p| p.weight).sum();
    let scale = f64::from(UNITS) / total;
    let (mut sum, mut last) = (0.0, 0);
    for (after, p) in (0..pieces.len() as i16).rev().zip(pieces) {
        sum += p.weight;
        let ideal = (sum * scale + 0.5) as i16;
        last = if after == 0 { UNITS } else { ideal.clamp(last + 1, UNITS - after) };
        put(p.cell, last);
    }
}

impl Table {
    /// Of cells, at most [`MOST_CELLS`], with weights that are not negative. None if all weights are zero.
    pub fn new(weights: &[f32], places: &Places) -> Option<Box<Self>> {
        let lit: Vec<u16> = (0..weights.len() as u16).filter(|i| weights[*i as usize] > 0.0).collect();
        let rows = rows(&lit, weights, places)?;
        let mut firsts = [0; ROWS * PARTS];
        let room = rows.iter().map(|row| row.len() + AT_ONCE).sum();
        let (mut ends, mut cells) = (Vec::with_capacity(room), Vec::with_capacity(room));
        let mut units = vec![0u32; weights.len()];
        for (firsts, row) in firsts.chunks_exact_mut(PARTS).zip(&rows) {
            ends.push(0);
            cells.push(0);
            let (mut last, mut part) = (0, 0);
            quantise(row, |cell, end| {
                while part < PARTS && end > (part << PART) as i16 {
                    firsts[part] = ends.len() as u16;
                    part += 1;
                }
                ends.push(end);
                cells.push(u32::from(cell) | places.lie[cell as usize]);
                units[cell as usize] += (end - last) as u32;
                last = end;
            });
            // The last entry is never passed; those after it may be looked at with it.
            ends.resize(ends.len() + AT_ONCE - 1, UNITS);
            cells.resize(ends.len(), 0);
        }
        cells.iter_mut().for_each(|cell| *cell |= units[*cell as usize % MOST_CELLS] << ABOVE);
        let total = lit.iter().map(|&i| f64::from(weights[i as usize])).sum::<f64>() as f32;
        Some(Box::new(Table {
            firsts,
            ends: ends.into(),
            cells: cells.into(),
            units: units.into(),
            total,
            whole: total,
        }))
    }

    /// The entry of a spot.
    #[inline(always)]
    pub fn entry(&self, row: i32, unit: i32) -> Entry {
        let mut at = self.firsts[row as usize % ROWS * PARTS + (unit as usize >> PART) % PARTS] as usize;
        loop {
            // By signs: counted as truths they would be moved one by one.
            let left: i16 = self.ends[at..at + AT_ONCE].iter().map(|end| (unit as i16 - end) >> 15).sum();
            at = at + AT_ONCE - usize::from(left.unsigned_abs());
            if left < 0 {
                return Entry { from: self.ends[at - 1], to: self.ends[at], cell: self.cells[at] };
            }
        }
    }

    /// The cell for two numbers in [0, 1).
    #[inline]
    pub fn find(&self, u: [f64; 2]) -> Found {
        let spot = Spot::new(u);
        let entry = self.entry(spot.row, spot.unit);
        let from = f64::from(entry.from);
        Found { cell: entry.cell(), u: rest(spot.at, from, f64::from(entry.to) - from, entry.lie()) }
    }

    /// The probability of a cell.
    #[inline]
    pub fn pmf(&self, cell: usize) -> f64 {
        probability(self.units(cell))
    }

    /// The units of a cell.
    #[inline(always)]
    pub fn units(&self, cell: usize) -> u32 {
        self.units[cell]
    }

    /// Bytes held.
    pub fn memory(&self) -> usize {
        size_of_val(self) + size_of_val(&*self.ends) + size_of_val(&*self.cells) + size_of_val(&*self.units)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::TestRng;

    const ONE_MINUS: f64 = 1.0 - f64::EPSILON / 2.0;

    fn anywhere(rng: &mut TestRng, n: usize) -> Places {
        let mut axis = || (0..n).map(|_| (rng.vec2().x * 65535.0) as u16).collect();
        Places { x: axis(), y: axis(), lie: vec![0; n] }
    }

    #[test]
    fn cells_are_sorted_by_place_and_then_by_number() {
        let mut rng = TestRng::new(3);
        for n in [0u16, 1, 2, 300, 1024] {
            // Few places, so that many are alike, of both bytes.
            let at: Vec<u16> = (0..n).map(|_| ((rng.bits() % 64) * 1021) as u16).collect();
            let lit: Vec<u16> = (0..n).filter(|i| i % 3 != 1).collect();
            let mut want = lit.clone();
            want.sort_by_key(|&i| at[i as usize]);
            assert_eq!(ordered(&lit, &at), want, "{n}");
        }
    }

    #[test]
    fn numbers_are_shared_out_as_the_probabilities_say() {
        let mut rng = TestRng::new(5);
        for n in [1usize, 2, 31, 32, 33, 700, 1024] {
            // Of all magnitudes, some zero.
            let weights: Vec<f32> =
                (0..n).map(|i| if i % 5 == 3 { 0.0 } else { 10f32.powf(8.0 * rng.vec2().x - 4.0) }).collect();
            let mut places = anywhere(&mut rng, n);
            places.lie.iter_mut().zip(0..).for_each(|(lie, i)| *lie = (i % 8) * SWAPPED);
            let table = Table::new(&weights, &places).unwrap();
            let sum: f64 = (0..n).map(|i| table.pmf(i)).sum();
            // Whole units.
            assert!((sum - 1.0).abs() < 1e-6, "{n}: {sum}");
            let total: f64 = weights.iter().map(|w| f64::from(*w)).sum();
            let unit = 1.0 / (ROWS as f64 * f64::from(UNITS));
            for (i, w) in weights.iter().enumerate() {
                let (p, w) = (table.pmf(i), f64::from(*w));
                assert_eq!(p > 0.0, w > 0.0, "{n} {i}");
                // What the least of others are given is taken from it, in each row that it is in.
                let slack = unit * n as f64 * ROWS as f64;
                assert!((p - w / total).abs() <= slack, "{n} {i}: {p} {}", w / total);
            }
            // Over a fine grid of numbers each cell is found as often as its probability says: exactly so along x, where a
            // point stands for a unit.
            let mut counts = vec![0u32; n];
            for k in 0..ROWS as u32 * UNITS as u32 {
                let (row, x) = (k / UNITS as u32, k % UNITS as u32);
                let u = [(f64::from(x) + 0.5) / f64::from(UNITS), (f64::from(row) + 0.5) / ROWS as f64];
                let found = table.find(u);
                assert!(found.u.iter().all(|u| (0.0..=1.0).contains(u)), "{found:?}");
                counts[found.cell] += 1;
            }
            for (i, c) in counts.iter().enumerate() {
                assert!((f64::from(*c) * unit - table.pmf(i)).abs() <= 1e-7 * table.pmf(i), "{n} {i}");
            }
            for corner in [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]] {
                assert!(table.pmf(table.find(corner.map(|c: f64| c.min(ONE_MINUS))).cell) > 0.0);
            }
        }
        assert!(Table::new(&[], &Places::default()).is_none());
        assert!(Table::new(&[0.0; 40], &anywhere(&mut rng, 40)).is_none());
    }

    #[test]
    fn probabilities_of_like_weights_are_theirs_to_a_few_thousandths() {
        let mut rng = TestRng::new(7);
        let weights: Vec<f32> =
            (0..1024).map(|i| if i % 2 == 0 { 0.0 } else { 0.3 + rng.vec2().x }).collect();
        let places = anywhere(&mut rng, 1024);
        let table = Table::new(&weights, &places).unwrap();
        let total: f64 = weights.iter().map(|w| f64::from(*w)).sum();
        for (i, w) in weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
            let ratio = table.pmf(i) / (f64::from(*w) / total);
            // A unit of rounding at either end of a cell, in each of two rows, of the 300 or more of the least.
            assert!((ratio - 1.0).abs() < 4.0 / 300.0, "{i}: {ratio}");
        }
    }

    #[test]
    fn half_of_all_is_half_of_the_rows() {
        let mut weights = vec![1.0; 64];
        weights[20] = 63.0;
        let places = Places {
            x: (0..64).map(|i| i % 8).collect(),
            y: (0..64).map(|i| i / 8).collect(),
            lie: vec![0; 64],
        };
        let table = Table::new(&weights, &places).unwrap();
        assert!((table.pmf(20) - 0.5).abs() < 1e-3);
        // Of 32 numbers, one in each of 32 strips, 16 are its own but for the two rows that it shares.
        let of = |k: u32| table.find([0.5, (f64::from(k) + 0.5) / 32.0]).cell == 20;
        let hits = (0..32).filter(|k| of(*k)).count();
        assert!((14..=18).contains(&hits), "{hits}");
    }
}
