//! Windowed moments of two planes, a tile of pixels at a time, so that what is kept between the passes along rows and along
//! columns stays in the second-level cache.

use crate::math::simd::{self, Kernel};

/// Width and height of a tile, pixels.
pub(super) const TILE: [usize; 2] = [512, 64];

/// What is averaged under the window: a, b, a^2 + b^2, a b.
const FIELDS: usize = 4;

/// A tile's work.
#[derive(Clone, Copy)]
pub(super) struct Tile<'a> {
    /// Of the planes.
    pub size: [usize; 2],
    /// Left top pixel.
    pub at: [usize; 2],
    /// Both.
    pub planes: [&'a [f32]; 2],
    /// Of the window, from its middle outwards.
    pub weights: &'a [f64],
    /// What variances are multiplied by.
    pub norm: f64,
    /// C1 and C2 of the paper.
    pub constants: [f64; 2],
}

/// What a tile comes to.
#[derive(Default)]
pub(super) struct Part {
    /// For each row, sums of similarity and of its structure over pixels whose window lies inside of the picture.
    pub rows: Vec<[f64; 2]>,
    /// Similarity, row by row, if it is wanted.
    pub map: Vec<f32>,
}

/// The pixel that a coordinate means beyond the borders: mirrored, the border pixel twice (d c b a | a b c d | d c b a).
fn mirrored(i: isize, n: usize) -> usize {
    let period = 2 * n as isize;
    let i = i.rem_euclid(period);
    (if i >= n as isize { period - 1 - i } else { i }) as usize
}

impl Tile<'_> {
    /// Works on rows from top to bottom; rows that were averaged along themselves are kept in a ring.
    pub fn similarity(&self, radius: usize, wants_map: bool) -> Part {
        let width = TILE[0].min(self.size[0] - self.at[0]);
        let height = TILE[1].min(self.size[1] - self.at[1]);
        let taps = 2 * radius + 1;
        let mut ring: Vec<Fields> = (0..taps).map(|_| Fields::new(width)).collect();
        let mut padded = Fields::new(width + 2 * radius);
        let mut means = Fields::new(width);
        let mut part = Part::default();
        let mut values = [vec![0.0; width], vec![0.0; width]];
        for step in 0..height + 2 * radius {
            let y = mirrored((self.at[1] + step) as isize - radius as isize, self.size[1]);
            self.gather(y, radius, &mut padded);
            simd::dispatch(AlongRow { padded: &padded, weights: self.weights, out: &mut ring[step % taps] });
            let Some(row) = step.checked_sub(2 * radius) else { continue };
            let middle = (step - radius) % taps;
            let rows = (ring.as_slice(), middle);
            let [similarity, structure] = &mut values;
            simd::dispatch(AlongColumn { rows, weights: self.weights, out: &mut means });
            let (norm, constants) = (self.norm, self.constants);
            simd::dispatch(Formula { means: &means, norm, constants, similarity, structure });
            if wants_map {
                part.map.extend(similarity.iter().map(|v| *v as f32));
            }
            part.rows.push(self.inside(row, radius, [similarity, structure]));
        }
        part
    }

    /// A row of the planes and their products, with what lies beside the tile.
    fn gather(&self, y: usize, radius: usize, out: &mut Fields) {
        let [w, _] = self.size;
        let rows = self.planes.map(|p| &p[y * w..(y + 1) * w]);
        let (left, count) = (self.at[0] as isize - radius as isize, out.0[0].len());
        let whole = left >= 0 && left as usize + count <= w;
        let [a, b, squares, product] = &mut out.0;
        for (to, row) in [&mut *a, &mut *b].into_iter().zip(rows) {
            if whole {
                let from = &row[left as usize..][..count];
                to.iter_mut().zip(from).for_each(|(t, v)| *t = f64::from(*v));
            } else {
                to.iter_mut()
                    .enumerate()
                    .for_each(|(i, t)| *t = f64::from(row[mirrored(left + i as isize, w)]));
            }
        }
        for (((a, b), s), p) in a.iter().zip(b.iter()).zip(squares).zip(product) {
            *s = a * a + b * b;
            *p = a * b;
        }
    }

    /// Sums over the pixels of a row whose window lies inside.
    fn inside(&self, row: usize, radius: usize, values: [&[f64]; 2]) -> [f64; 2] {
        let [w, h] = self.size;
        let y = self.at[1] + row;
        if y < radius || y + radius >= h {
            return [0.0; 2];
        }
        let from = radius.saturating_sub(self.at[0]).min(values[0].len());
        let to = (w - radius).saturating_sub(self.at[0]).clamp(from, values[0].len());
        values.map(|v| v[from..to].iter().sum())
    }
}

/// A row of each field.
pub(super) struct Fields([Vec<f64>; FIELDS]);

impl Fields {
    fn new(width: usize) -> Self {
        Fields(std::array::from_fn(|_| vec![0.0; width]))
    }
}

/// Averages along a row.
struct AlongRow<'a> {
    padded: &'a Fields,
    weights: &'a [f64],
    out: &'a mut Fields,
}

impl Kernel for AlongRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let radius = self.weights.len() - 1;
        for (from, to) in self.padded.0.iter().zip(&mut self.out.0) {
            let n = to.len();
            let middle = &from[radius..radius + n];
            for (t, m) in to.iter_mut().zip(middle) {
                *t = self.weights[0] * m;
            }
            for (k, weight) in self.weights.iter().enumerate().skip(1) {
                let (left, right) = (&from[radius - k..radius - k + n], &from[radius + k..radius + k + n]);
                for ((t, l), r) in to.iter_mut().zip(left).zip(right) {
                    *t += weight * (l + r);
                }
            }
        }
    }
}

/// Averages along columns, of the rows of a ring around one of them.
struct AlongColumn<'a> {
    rows: (&'a [Fields], usize),
    weights: &'a [f64],
    out: &'a mut Fields,
}

impl Kernel for AlongColumn<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let (ring, middle) = self.rows;
        let taps = ring.len();
        for (field, to) in self.out.0.iter_mut().enumerate() {
            for (t, m) in to.iter_mut().zip(&ring[middle].0[field]) {
                *t = self.weights[0] * m;
            }
            for (k, weight) in self.weights.iter().enumerate().skip(1) {
                let (upper, lower) =
                    (&ring[(middle + taps - k) % taps].0[field], &ring[(middle + k) % taps].0[field]);
                for ((t, u), l) in to.iter_mut().zip(upper).zip(lower) {
                    *t += weight * (u + l);
                }
            }
        }
    }
}

/// Equation 13 of the paper, and its part without the means.
struct Formula<'a> {
    means: &'a Fields,
    norm: f64,
    constants: [f64; 2],
    similarity: &'a mut [f64],
    structure: &'a mut [f64],
}

impl Kernel for Formula<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let [a, b, squares, product] = &self.means.0;
        let [c1, c2] = self.constants;
        let out = self.similarity.iter_mut().zip(self.structure);
        for ((((a, b), s), p), (similarity, structure)) in a.iter().zip(b).zip(squares).zip(product).zip(out)
        {
            let means = a * a + b * b;
            let variances = self.norm * (s - means);
            let covariance = self.norm * (p - a * b);
            let fit = (2.0 * covariance + c2) / (variances + c2);
            *structure = fit;
            *similarity = fit * ((2.0 * (a * b) + c1) / (means + c1));
        }
    }
}
