//! Pixels that are no numbers: counted, located, left out.

use super::pair::Planes;
use rayon::prelude::*;
use serde::Serialize;

/// Places that are told.
const TOLD: usize = 5;

/// What one picture has of them.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct Invalid {
    /// Pixels with a NaN in any channel.
    pub nan: usize,
    /// Further pixels with an infinity.
    pub infinite: usize,
    /// The first of both, row by row: x and y.
    pub first: Vec<[usize; 2]>,
}

impl Invalid {
    /// Looks for them, and marks them in `counted`; `origin` is where the planes' left top pixel stands.
    pub fn mark(planes: &Planes, width: usize, origin: [usize; 2], counted: &mut [bool]) -> Self {
        let mut found = Invalid::default();
        // Almost always there is none, which all threads find out together.
        let finite = |p: &Vec<f32>| p.par_chunks(1 << 16).all(|part| part.iter().all(|v| v.is_finite()));
        if planes.iter().all(finite) {
            return found;
        }
        for (i, counted) in counted.iter_mut().enumerate() {
            let values = || planes.iter().map(|p| p[i]);
            if values().all(f32::is_finite) {
                continue;
            }
            *counted = false;
            match values().any(f32::is_nan) {
                true => found.nan += 1,
                false => found.infinite += 1,
            }
            if found.first.len() < TOLD {
                found.first.push([origin[0] + i % width, origin[1] + i / width]);
            }
        }
        found
    }

    /// Pixels in all.
    pub fn count(&self) -> usize {
        self.nan + self.infinite
    }

    /// "3 pixels are NaN and 1 infinite, at (4, 5), (6, 7), ...", or nothing where there is none.
    pub fn describe(&self) -> Option<String> {
        if self.count() == 0 {
            return None;
        }
        let kinds = [(self.nan, "NaN"), (self.infinite, "infinite")];
        let kinds: Vec<String> =
            kinds.iter().filter(|k| k.0 > 0).map(|(n, what)| format!("{n} {what}")).collect();
        let places: Vec<String> = self.first.iter().map(|[x, y]| format!("({x}, {y})")).collect();
        let more = if self.count() > self.first.len() { ", ..." } else { "" };
        Some(format!("pixels that are no numbers: {}, at {}{more}", kinds.join(", "), places.join(", ")))
    }
}
