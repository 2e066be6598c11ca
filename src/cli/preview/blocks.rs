//! Pictures by characters that are half a cell high: two dots a cell, its upper half in the colour of the letter, the lower
//! one in that of the ground.

use super::shrink::{Dot, Dots};
use std::fmt::Write;

/// U+2580, the upper half.
const UPPER: char = '\u{2580}';
/// U+2584, the lower half.
const LOWER: char = '\u{2584}';

/// A row of text for every two rows of dots, without line ends.
pub fn lines(dots: &Dots, true_colour: bool) -> Vec<String> {
    let mut rows = dots.list.chunks_exact(dots.width);
    let mut out = Vec::new();
    while let Some(upper) = rows.next() {
        let lower = rows.next();
        let mut line = String::new();
        let mut last = None;
        for (i, dot) in upper.iter().enumerate() {
            let pair = (*dot, lower.and_then(|row| row[i]));
            if last != Some(pair) {
                let (letter, ground) = if pair.0.is_some() { pair } else { (pair.1, pair.0) };
                colour(&mut line, 38, letter, true_colour);
                colour(&mut line, 48, ground, true_colour);
                last = Some(pair);
            }
            // Halves of one colour need no letter, whose edges some fonts leave open. What is not known is a gap, not half
            // a letter in the terminal's own colour.
            line.push(match pair {
                (upper, lower) if upper == lower => ' ',
                (Some(_), _) => UPPER,
                (None, _) => LOWER,
            });
        }
        line.push_str("\x1b[0m");
        out.push(line);
    }
    out
}

/// The colour of letters (38) or of the ground (48).
fn colour(line: &mut String, what: u8, dot: Dot, true_colour: bool) {
    // A string takes everything.
    let _ = match dot {
        None => write!(line, "\x1b[{}m", what + 1),
        Some([r, g, b]) if true_colour => write!(line, "\x1b[{what};2;{r};{g};{b}m"),
        Some(c) => write!(line, "\x1b[{what};5;{}m", nearest(c)),
    };
}

/// Levels of the colour cube of terminals with 256 colours, as xterm has them.
const LEVELS: [u8; 6] = [0, 95, 135, 175, 215, 255];

/// The colour of a terminal with 256 that is nearest: of the cube (16 on, red the slowest) or the 24 grays (232 on: 8, 18,
/// ... 238). The first 16 are the user's own.
fn nearest(c: [u8; 3]) -> u8 {
    let distance = |o: [u8; 3]| -> u32 { (0..3).map(|i| u32::from(c[i].abs_diff(o[i])).pow(2)).sum() };
    let level = |v: u8| (0..6).min_by_key(|&i| LEVELS[i].abs_diff(v)).unwrap_or(0);
    let cube = c.map(level);
    let mean = c.iter().map(|v| u32::from(*v)).sum::<u32>() / 3;
    let gray = (mean.saturating_sub(3) / 10).min(23) as u8;
    match distance([8 + 10 * gray; 3]) < distance(cube.map(|i| LEVELS[i])) {
        true => 232 + gray,
        false => 16 + (36 * cube[0] + 6 * cube[1] + cube[2]) as u8,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_of_256_colours_is_found() {
        for (i, r) in LEVELS.into_iter().enumerate() {
            assert_eq!(nearest([r, 0, 255]), 16 + 36 * i as u8 + 5);
        }
        assert_eq!([nearest([8; 3]), nearest([127; 3]), nearest([238; 3])], [232, 244, 255]);
        // Against all of them.
        let all = (16..=255u8).map(|i| match i {
            232.. => [8 + 10 * (i - 232); 3],
            _ => [(i - 16) / 36, (i - 16) / 6 % 6, (i - 16) % 6].map(|v| LEVELS[usize::from(v)]),
        });
        let all: Vec<[u8; 3]> = all.collect();
        for n in 0..4096u32 {
            let c = [n % 16, n / 16 % 16, n / 256].map(|v| (v * 17) as u8);
            let far = |o: &[u8; 3]| (0..3).map(|i| u32::from(c[i].abs_diff(o[i])).pow(2)).sum::<u32>();
            let best = all.iter().map(far).min();
            assert_eq!(Some(far(&all[usize::from(nearest(c) - 16)])), best, "{c:?}");
        }
    }
}
