//! Where within a cell light comes from, where cells are too large to tell: stars and the rims of clouds.
//!
//! Cells are halved again and again where that takes the most variance away, and a half is drawn as often as its light
//! says, the surface notwithstanding. What is left of a number after a choice goes on to the next (McCool and Harwood
//! 1997), so that even numbers stay even.

use super::partition::{Candidate, Patch, Rect, Sums};
use crate::lights::sky::plan::Level;
use rayon::prelude::*;
use std::collections::BinaryHeap;

/// Most halves of all cells together. A star takes ten or so.
pub(super) const MOST_HALVES: usize = 1 << 15;
/// What varies by less is drawn from evenly: its relative variance, a tenth of that of a surface half in the shade. (Halves
/// of all cells took a fifth of a render's time for a tenth less squared error, under a photographed sky.)
const RAGGED: f64 = 0.1;
/// Nor is a part halved whose variance is less than this part of all light.
const LEAST: f64 = 1e-6;

/// Two halves, or none.
#[derive(Debug, Clone, Copy)]
struct Fork {
    /// How often the first is drawn.
    first: f64,
    /// The cell of the grid that the second begins at. Without halves, the number of the patch.
    at: u32,
    /// Twice the number of the first half's node, and one more if the halves lie along x; 0 without halves.
    next: u32,
}

const LEAF: Fork = Fork { first: 1.0, at: 0, next: 0 };

/// The halves of all cells.
pub(super) struct Inner {
    /// Those of the cells themselves first.
    forks: Vec<Fork>,
    /// What is not halved any more; densities are those of what is drawn from a whole cell.
    patches: Vec<Patch>,
}

impl Inner {
    /// With so many halves at most.
    pub fn new(level: &Level, cells: &[Rect], most: usize) -> Self {
        let sums: Vec<Sums> = cells.par_iter().map(|r| r.sums(level)).collect();
        let total: f64 = sums.iter().map(|s| s.flux).sum();
        let candidate = |(node, (sums, rect)): (u32, (&Sums, &Rect))| {
            let gain = sums.spread(rect.cells());
            let is_ragged = gain > RAGGED * sums.flux && gain > LEAST * total;
            is_ragged.then_some(Candidate { gain, node, rect: *rect })
        };
        let mut heap: BinaryHeap<Candidate> =
            (0..).zip(sums.iter().zip(cells)).filter_map(candidate).collect();
        let mut forks = vec![LEAF; cells.len()];
        let mut parts: Vec<(Rect, f64)> = cells.iter().map(|&rect| (rect, 1.0)).collect();
        while forks.len() < cells.len() + most {
            let Some(c) = heap.pop() else { break };
            let Some(halves) = c.rect.halve(level, 0.0) else { continue };
            let next = forks.len() as u32;
            let first = halves.sums[0].flux / (halves.sums[0].flux + halves.sums[1].flux);
            let node = c.node as usize;
            forks[node] = Fork { first, at: halves.at, next: 2 * next + u32::from(halves.along_x) };
            for (k, rect) in halves.parts.into_iter().enumerate() {
                heap.extend(candidate((forks.len() as u32, (&halves.sums[k], &rect))));
                forks.push(LEAF);
                parts.push((rect, parts[node].1 * if k == 0 { first } else { 1.0 - first }));
            }
        }
        let mut patches = Vec::new();
        for (fork, (rect, probability)) in forks.iter_mut().zip(&parts).filter(|(f, _)| f.next == 0) {
            fork.at = patches.len() as u32;
            let whole = Patch::new(rect, &level.grid());
            patches.push(Patch { density: whole.density * probability, ..whole });
        }
        Inner { forks, patches }
    }

    /// Whether a cell has halves.
    pub fn is_divided(&self, cell: usize) -> bool {
        self.forks[cell].next != 0
    }

    /// What two numbers in [0, 1] lead to in a cell, and what is left of them.
    #[inline]
    pub fn draw(&self, cell: usize, mut u: [f64; 2]) -> (&Patch, [f64; 2]) {
        let mut fork = &self.forks[cell];
        while fork.next != 0 {
            let number = &mut u[usize::from(fork.next & 1 == 0)];
            let second = *number >= fork.first && fork.first < 1.0;
            // Rounding may carry a number to 1 or beyond.
            *number = match second {
                true => ((*number - fork.first) / (1.0 - fork.first)).min(1.0),
                false => (*number / fork.first).min(1.0),
            };
            fork = &self.forks[(fork.next / 2) as usize + usize::from(second)];
        }
        (&self.patches[fork.at as usize], u)
    }

    /// What a cell of the grid lies in, of a cell.
    #[inline]
    pub fn find(&self, cell: usize, [x, y]: [u32; 2]) -> &Patch {
        let mut fork = &self.forks[cell];
        while fork.next != 0 {
            let second = if fork.next & 1 == 1 { x >= fork.at } else { y >= fork.at };
            fork = &self.forks[(fork.next / 2) as usize + usize::from(second)];
        }
        &self.patches[fork.at as usize]
    }

    /// Bytes held.
    pub fn memory(&self) -> u64 {
        (size_of_val(&*self.forks) + size_of_val(&*self.patches)) as u64
    }
}
