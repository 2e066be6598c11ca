//! How far guesses about pixels are believed: where the first samples are few, or rare events make the noise, what neighbours
//! show is mostly chance, and going by it makes the picture worse than going by nothing.
//!
//! So guesses are tried where the truth is known better (cross-validation: Stone 1974): pixels of one colour of the
//! chessboard are foretold from those that touch them by a corner, which are of that colour too, and what each plan would
//! leave of the noise that they have shown themselves is added up. The answer holds for the other colour, whose pixels have
//! had no part in it.

use super::dealer::{Dealer, Guess, Plan};
use super::note::Kind;
use super::{Notes, colour};
use rayon::prelude::*;

/// What is tried, from most to least; a third was never the best.
const TRUSTS: [f64; 3] = [1.0, 2.0 / 3.0, 0.0];
/// Squared errors fall as numbers to this power: measured, 1.1 to 1.3 (benches/README.md).
const SLOPE: f64 = 1.15;
/// What even numbers may leave over others and are kept: their points are in one piece, and noise lies where rays have more
/// in their way than is counted. Twice as much was no better.
const BONUS: f64 = 0.95;
/// Pixels of the same colour that touch by a corner, and those next to them.
const CORNERS: [(i32, i32); 12] = [
    (-1, -1),
    (1, -1),
    (-1, 1),
    (1, 1),
    (-1, -3),
    (1, -3),
    (-3, -1),
    (3, -1),
    (-3, 1),
    (3, 1),
    (-1, 3),
    (1, 3),
];

/// So many pixels of a colour tell.
const ENOUGH: usize = 1 << 14;

impl Notes {
    /// How far guesses that come from the pixels of a colour are to be believed, as these pixels themselves say.
    pub(super) fn trust(&self, of: usize, costs: [f64; 2], dealer: &Dealer) -> f64 {
        let mean = self.mean_of(of);
        let every = (self.rect.area() / 2).div_ceil(ENOUGH).max(1);
        let rows = (self.rect.y0..self.rect.y1).into_par_iter().step_by(every);
        let of_row = |y: u32| {
            let places = (self.rect.x0..self.rect.x1).filter(move |x| colour(*x, y) == of);
            places.filter_map(move |x| {
                let note = &self.list[self.rect.index(x, y)];
                if note.kind == Kind::Bare {
                    return None;
                }
                let (guess, unit) = self.guess((x, y), &CORNERS, mean, costs, dealer);
                // In black surroundings a unit has no bounds.
                let error = if note.variance > 0.0 { f64::from(note.variance) * unit } else { 0.0 };
                Some((guess, error))
            })
        };
        let tried: Vec<(Guess, f64)> = rows.flat_map_iter(of_row).collect();
        let falls: [f64; 32] = std::array::from_fn(|doublings| (-SLOPE * doublings as f64).exp2());
        let left = |trust: f64| {
            if trust == 0.0 {
                let all: f64 = tried.iter().map(|(_, error)| error).sum();
                return BONUS * all * f64::from(dealer.spp).powf(-SLOPE);
            }
            let plan: Plan = dealer.plan(tried.iter().map(|(guess, _)| guess), trust);
            let of_pixel =
                |(guess, error): &(Guess, f64)| error * falls[dealer.count(&plan, guess).ilog2() as usize];
            tried.iter().map(of_pixel).sum()
        };
        let all = TRUSTS.map(left);
        let best = (0..TRUSTS.len()).reduce(|a, b| if all[b] < all[a] { b } else { a });
        best.map_or(1.0, |best| TRUSTS[best])
    }
}
