//! What a terminal is and can.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::getpgrp;
use rustix::termios::{
    LocalModes, OptionalActions, SpecialCodeIndex, tcgetattr, tcgetpgrp, tcgetwinsize, tcsetattr,
};
use std::io::{IsTerminal, Write, stderr, stdin};
use std::time::{Duration, Instant};

/// How long a terminal may take to answer: one over a slow line does, one that does not know the question never will.
const PATIENCE: Duration = Duration::from_millis(300);

/// A terminal's window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// Cells.
    pub columns: usize,
    /// Cells.
    pub rows: usize,
    /// Pixels of a cell, as far as the terminal says.
    pub cell: [usize; 2],
}

/// What is taken where the terminal does not say.
const USUAL: Window = Window { columns: 80, rows: 24, cell: [10, 20] };

impl Window {
    /// That of stderr.
    pub fn now() -> Self {
        let Ok(size) = tcgetwinsize(stderr()) else { return USUAL };
        let [columns, rows, width, height] =
            [size.ws_col, size.ws_row, size.ws_xpixel, size.ws_ypixel].map(usize::from);
        if columns == 0 || rows == 0 {
            return USUAL;
        }
        let cell = [width / columns, height / rows];
        Window { columns, rows, cell: if cell.contains(&0) { USUAL.cell } else { cell } }
    }
}

/// Whether the terminal takes colours of 24 bits, by what programs have agreed on.
pub fn has_true_colour() -> bool {
    std::env::var("COLORTERM").is_ok_and(|v| v == "truecolor" || v == "24bit")
}

/// Whether the terminal says that it shows sixels: attribute 4 among its primary device attributes (DEC STD 070; answers
/// look like `ESC [ ? 62 ; 4 c`). False where nobody answers.
pub fn has_sixel() -> bool {
    let asks = stdin().is_terminal() && stderr().is_terminal();
    // One in the background would be stopped for touching the terminal.
    if !asks || tcgetpgrp(stdin()).ok() != Some(getpgrp()) {
        return false;
    }
    let Ok(usual) = tcgetattr(stdin()) else { return false };
    let mut raw = usual.clone();
    raw.local_modes -= LocalModes::ICANON | LocalModes::ECHO;
    raw.special_codes[SpecialCodeIndex::VMIN] = 0;
    raw.special_codes[SpecialCodeIndex::VTIME] = 0;
    if tcsetattr(stdin(), OptionalActions::Now, &raw).is_err() {
        return false;
    }
    let answer = ask("\x1b[c");
    // Nothing can be done about a terminal that has gone.
    let _ = tcsetattr(stdin(), OptionalActions::Now, &usual);
    answer.is_some_and(|answer| shows_sixel(&answer))
}

/// What comes back, up to the `c` that ends it.
fn ask(question: &str) -> Option<String> {
    let mut out = stderr().lock();
    out.write_all(question.as_bytes()).and_then(|()| out.flush()).ok()?;
    let (start, mut answer) = (Instant::now(), Vec::new());
    while !answer.ends_with(b"c") && answer.len() < 256 {
        let left = Timespec::try_from(PATIENCE.checked_sub(start.elapsed())?).ok()?;
        let input = stdin();
        let mut wait = [PollFd::new(&input, PollFlags::IN)];
        if poll(&mut wait, Some(&left)).ok()? == 0 {
            return None;
        }
        let mut bytes = [0; 64];
        let n = rustix::io::read(&input, &mut bytes).ok()?;
        if n == 0 {
            return None;
        }
        answer.extend_from_slice(&bytes[..n]);
    }
    String::from_utf8(answer).ok()
}

fn shows_sixel(answer: &str) -> bool {
    let Some((_, list)) = answer.rsplit_once("\x1b[?") else { return false };
    // The first number is the kind of terminal.
    list.trim_end_matches('c').split(';').skip(1).any(|attribute| attribute == "4")
}

#[cfg(test)]
mod tests {
    use super::shows_sixel;

    #[test]
    fn attributes_are_read() {
        for yes in ["\x1b[?62;4;22c", "\x1b[?63;1;2;4c", "typed ahead\x1b[?65;4c"] {
            assert!(shows_sixel(yes), "{yes:?}");
        }
        for no in ["\x1b[?1;2c", "\x1b[?4;6c", "\x1b[?62;44;14c", "", "c"] {
            assert!(!shows_sixel(no), "{no:?}");
        }
    }
}
