//! The growing picture, handed from the threads that render to one that shows it. What was not fetched yet is replaced by
//! what is newer, so nobody waits for a slow display, and the last state of every tile is there to be fetched.

use crate::base::pixel_rect::PixelRect;
use crate::error::Result;
use crate::memory::{self, Room};
use crate::render::film::TILE_SIDE;
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// See the module.
pub struct Canvas {
    window: PixelRect,
    state: Mutex<State>,
    changed: Condvar,
    _room: Room,
}

struct State {
    /// Of the window, row by row.
    pixels: Vec<[f32; 4]>,
    /// Tiles that wait, the oldest first; those that were fetched with a neighbour may still be among them.
    queue: VecDeque<u32>,
    /// Whether a tile waits, by number.
    waits: Vec<bool>,
    closed: bool,
}

/// What there was to fetch.
#[derive(Debug, PartialEq)]
pub enum Fetched {
    /// These pixels changed.
    Pixels(PixelRect),
    /// Nothing new.
    Nothing,
    /// Nothing new, and nothing will come.
    End,
}

impl Canvas {
    /// Black, for the tiles of a film's window.
    ///
    /// # Errors
    /// No room for 16 bytes a pixel.
    pub fn new(window: PixelRect) -> Result<Self> {
        let bytes = window.area() as u64 * size_of::<[f32; 4]>() as u64;
        let room = memory::room(bytes, || format!("a view of {} x {}", window.width(), window.height()))?;
        let tiles = window.tiles(TILE_SIDE).count();
        let state = State {
            pixels: vec![[0.0; 4]; window.area()],
            queue: VecDeque::with_capacity(tiles),
            waits: vec![false; tiles],
            closed: false,
        };
        Ok(Canvas { window, state: Mutex::new(state), changed: Condvar::new(), _room: room })
    }

    fn across(&self) -> u32 {
        self.window.width().div_ceil(TILE_SIDE)
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Puts a tile of the film there.
    pub fn put(&self, rect: PixelRect, pixels: &[[f32; 4]]) {
        let [column, row] = [rect.x0 - self.window.x0, rect.y0 - self.window.y0].map(|v| v / TILE_SIDE);
        let number = row * self.across() + column;
        let mut state = self.lock();
        if state.closed {
            return;
        }
        for (y, from) in (rect.y0..rect.y1).zip(pixels.chunks_exact(rect.width() as usize)) {
            let at = self.window.index(rect.x0, y);
            state.pixels[at..at + from.len()].copy_from_slice(from);
        }
        if !std::mem::replace(&mut state.waits[number as usize], true) {
            state.queue.push_back(number);
        }
        drop(state);
        self.changed.notify_one();
    }

    /// No more will be put there.
    pub fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }

    /// Fetches what has waited longest, with up to `most` - 1 tiles to its right that wait as well; waits for something to
    /// come, but no longer than that.
    pub fn fetch(&self, most: u32, patience: Duration, out: &mut Vec<[f32; 4]>) -> Fetched {
        let mut state = self.lock();
        if state.queue.is_empty() && !state.closed {
            let waited =
                self.changed.wait_timeout_while(state, patience, |s| s.queue.is_empty() && !s.closed);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        let state = &mut *state;
        let waiting = |state: &mut State| loop {
            let number = state.queue.pop_front()?;
            if state.waits[number as usize] {
                return Some(number);
            }
        };
        let Some(first) = waiting(state) else {
            return if state.closed { Fetched::End } else { Fetched::Nothing };
        };
        let end = (first + most).min((first / self.across() + 1) * self.across());
        let mut number = first;
        while number < end && state.waits[number as usize] {
            state.waits[number as usize] = false;
            number += 1;
        }
        let corner =
            |column: u32, row: u32| [self.window.x0 + column * TILE_SIDE, self.window.y0 + row * TILE_SIDE];
        let (column, row) = (first % self.across(), first / self.across());
        let ([x0, y0], [x1, y1]) = (corner(column, row), corner(column + number - first, row + 1));
        let rect = PixelRect::new(x0, y0, x1, y1).intersection(&self.window);
        out.clear();
        for y in rect.y0..rect.y1 {
            let at = self.window.index(rect.x0, y);
            out.extend_from_slice(&state.pixels[at..at + rect.width() as usize]);
        }
        Fetched::Pixels(rect)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nothing is waited for.
    const NOW: Duration = Duration::ZERO;

    #[test]
    fn the_last_state_of_every_tile_is_fetched_once() {
        let window = PixelRect::new(3, 5, 3 + 40, 5 + 20);
        let canvas = Canvas::new(window).expect("room");
        let mut pixels = Vec::new();
        assert_eq!(canvas.fetch(8, NOW, &mut pixels), Fetched::Nothing);
        let tiles: Vec<PixelRect> = window.tiles(TILE_SIDE).collect();
        // Each twice: what came first is never seen.
        for (i, rect) in tiles.iter().chain(&tiles).enumerate() {
            canvas.put(*rect, &vec![[i as f32; 4]; rect.area()]);
        }
        canvas.close();
        canvas.put(tiles[0], &vec![[99.0; 4]; tiles[0].area()]);
        let mut seen = vec![f32::NAN; window.area()];
        let mut fetches = 0;
        while let Fetched::Pixels(rect) = canvas.fetch(2, NOW, &mut pixels) {
            assert_eq!(pixels.len(), rect.area());
            for ((x, y), p) in rect.pixels().zip(&pixels) {
                let before = std::mem::replace(&mut seen[window.index(x, y)], p[0]);
                assert!(before.is_nan(), "({x}, {y}) twice");
            }
            fetches += 1;
        }
        // Three tiles a row, at most two at once.
        assert_eq!(fetches, 4);
        assert_eq!(canvas.fetch(2, NOW, &mut pixels), Fetched::End);
        for (i, rect) in tiles.iter().enumerate() {
            for (x, y) in rect.pixels() {
                assert_eq!(seen[window.index(x, y)], (tiles.len() + i) as f32);
            }
        }
    }
}
