//! Where the samples of the next round go.

use super::estimate::{ErrorSum, pixel_errors};
use crate::render::film::Film;
use rayon::prelude::*;

/// A pixel's error counts for its own tile up to so many times the mean of its neighbourhood. A normal deviate squared
/// exceeds that once in 200 times.
const SURPRISE: f64 = 8.0;

/// Every tile is taken to need at least this part of what a tile needs on average, as what it needs is only an estimate.
/// Samples go by the root of the need: an eighth of the average.
const LEAST_NEED: f64 = 1.0 / 64.0;

/// A round doubles the tiles where a ray gains at least this part of what it gains where it gains most. Doubling halves
/// the gain of a sample and doubles the samples: a quarter, so that each is doubled at most once.
const WORTH: f64 = 0.25;

/// A tile of the film on its way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tile {
    /// Column and row among the tiles.
    pub place: [usize; 2],
    /// Pixels.
    pub area: f64,
    /// Samples of each pixel.
    pub spp: u32,
    /// Rays traced for them.
    pub rays: u64,
}

/// What a tile would gain from more samples.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Need {
    /// Errors of its pixels as they are.
    pub own: ErrorSum,
    /// Sum of its pixels' relative variances of one sample, without surprises.
    pub rate: f64,
}

/// What every tile needs. `floor`: see [`super::estimate::floor_of`].
///
/// Variances are those of a single sample (error times samples), as tiles have had different numbers. What exceeds
/// `SURPRISE` times the mean of the 3 x 3 tiles around is taken from its pixel and shared by these tiles: where rays
/// find a lamp by chance, which of the tiles has had that chance says nothing of which needs samples, and to go by it
/// would leave those dark that have not (the bias of adaptive sampling, Kirk and Arvo 1991). When an eighth of the pixels
/// has met it, it is no surprise any more.
pub fn needs(film: &Film, tiles: &[Tile], floor: f64) -> Vec<Need> {
    let rects: Vec<_> = film.tiles().collect();
    let own: Vec<ErrorSum> =
        rects.par_iter().map(|&rect| ErrorSum::of(pixel_errors(film, rect, floor))).collect();
    let around = Neighbours::new(tiles);
    let rates: Vec<f64> = own.iter().zip(tiles).map(|(e, t)| e.sum * f64::from(t.spp)).collect();
    let caps = around.mean(&rates).map(|mean| SURPRISE * mean);
    let caps: Vec<f64> = caps.collect();
    let usual: Vec<f64> = (&rects, tiles, &caps)
        .into_par_iter()
        .map(|(&rect, tile, &cap)| {
            pixel_errors(film, rect, floor).map(|e| (e * f64::from(tile.spp)).min(cap)).sum()
        })
        .collect();
    let surprises: Vec<f64> = rates.iter().zip(&usual).map(|(rate, usual)| rate - usual).collect();
    let shared: Vec<f64> = around.mean(&surprises).collect();
    (0..tiles.len()).map(|i| Need { own: own[i], rate: usual[i] + shared[i] * tiles[i].area }).collect()
}

/// The 3 x 3 tiles around each.
struct Neighbours<'a> {
    tiles: &'a [Tile],
    across: usize,
}

impl<'a> Neighbours<'a> {
    fn new(tiles: &'a [Tile]) -> Self {
        Neighbours { tiles, across: tiles.iter().map(|t| t.place[0] + 1).max().unwrap_or(0) }
    }

    /// Of a value that is a sum over each tile's pixels: the mean a pixel of the neighbourhood.
    fn mean(&self, values: &[f64]) -> impl Iterator<Item = f64> {
        self.tiles.iter().map(|tile| {
            let (mut sum, mut area) = (0.0, 0.0);
            let [x, y] = tile.place;
            for row in y.saturating_sub(1)..=y + 1 {
                for column in x.saturating_sub(1)..(x + 2).min(self.across) {
                    let at = row * self.across + column;
                    if let Some(near) = self.tiles.get(at) {
                        sum += values[at];
                        area += near.area;
                    }
                }
            }
            sum / area
        })
    }
}

/// The tiles to be doubled next, those first where a ray gains most; none where all have `limit`: samples
/// that no pixel may exceed.
///
/// A tile whose single samples have relative variance s in all has error s / n after n samples a pixel; n more cost n c
/// rays and take s / 2n away. A ray gains s / (2 c n^2), and to keep that equal everywhere is the optimal allocation,
/// n as the root of s / c (Neyman 1934), with cost in rays, which are counted, and not in time.
pub fn worth_doubling(tiles: &[Tile], needs: &[Need], limit: u32) -> Vec<usize> {
    let sum = |of: fn(&Tile) -> f64| tiles.iter().map(of).sum::<f64>();
    let least = LEAST_NEED * needs.iter().map(|n| n.rate).sum::<f64>() / sum(|t| t.area);
    let gain = |i: usize| {
        let (t, n) = (&tiles[i], f64::from(tiles[i].spp.max(1)));
        let rays_a_sample = (t.rays as f64 / n).max(1.0);
        // Where nothing is known to be wrong anywhere, all are alike.
        let rate = if least > 0.0 { needs[i].rate.max(least * t.area) } else { t.area };
        rate / (n * n * rays_a_sample)
    };
    let mut list: Vec<(f64, usize)> =
        (0..tiles.len()).filter(|&i| tiles[i].spp < limit).map(|i| (gain(i), i)).collect();
    // Equal gains in the order of the tiles.
    list.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let best = list.first().map_or(0.0, |b| b.0);
    list.into_iter().take_while(|(gain, _)| *gain > WORTH * best).map(|(_, i)| i).collect()
}
