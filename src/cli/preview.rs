//! `--preview`: the growing picture on the terminal, in place, with a line of progress below.

mod blocks;
mod shrink;
mod terminal;

use super::canvas::{Canvas, Fetched};
use super::interrupt;
use super::progress::Bar;
use crate::base::pixel_rect::PixelRect;
use crate::error::{Error, Result};
use crate::image::tonemap::Look;
use clap::ValueEnum;
use icy_sixel::{EncodeOptions, sixel_encode};
use shrink::{Dots, Pixels};
use std::io::{IsTerminal, Write, stderr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};
use terminal::Window;

/// How dots get onto the terminal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum PreviewKind {
    /// Sixels where the terminal says that it shows them, else half-block characters.
    Auto,
    /// Two dots a character.
    Blocks,
    /// Pixels.
    Sixel,
}

/// Time between two pictures: a few a second.
const BLOCKS_EVERY: Duration = Duration::from_millis(250);
/// A larger picture with a palette of its own, which takes some ten milliseconds.
const SIXELS_EVERY: Duration = Duration::from_millis(500);
/// Most pixels across of a picture by sixels.
const MOST_SIXELS: usize = 800;

/// A picture that is being shown.
pub struct Preview {
    canvas: Arc<Canvas>,
    painter: JoinHandle<()>,
}

/// Whether stderr is a terminal; says so if it is not.
pub fn can_show() -> bool {
    let is_terminal = stderr().is_terminal();
    if !is_terminal {
        log::warn!("--preview needs a terminal on stderr: nothing is shown");
    }
    is_terminal
}

impl Preview {
    /// Begins, on a terminal. The bar is told of, not drawn.
    ///
    /// # Errors
    /// No room for the pixels, no thread.
    pub fn start(kind: PreviewKind, window: PixelRect, look: Look, bar: Arc<Bar>) -> Result<Self> {
        let sixel = match kind {
            PreviewKind::Auto => terminal::has_sixel(),
            PreviewKind::Blocks => false,
            PreviewKind::Sixel => true,
        };
        let canvas = Arc::new(Canvas::new(window)?);
        let painter = Painter {
            canvas: canvas.clone(),
            pixels: Pixels::new(window),
            look,
            bar,
            form: if sixel { Form::Sixel } else { Form::Blocks { true_colour: terminal::has_true_colour() } },
            drawn: None,
            stopped: Arc::default(),
        };
        let started = thread::Builder::new().name("preview".into()).spawn(move || painter.run());
        let painter = started.map_err(|e| Error::Internal(format!("cannot start a thread: {e}")))?;
        Ok(Preview { canvas, painter })
    }

    /// A tile of the film.
    pub fn put(&self, rect: PixelRect, means: &[[f32; 4]]) {
        self.canvas.put(rect, means);
    }

    /// Shows the last state, and leaves the terminal as it was below it.
    pub fn finish(self) {
        self.canvas.close();
        if self.painter.join().is_err() {
            log::warn!("--preview: the drawing thread fell");
        }
    }
}

#[derive(Clone, Copy)]
enum Form {
    Blocks { true_colour: bool },
    Sixel,
}

/// Where the last picture stands.
#[derive(Clone, Copy, PartialEq)]
struct Drawn {
    window: Window,
    rows: usize,
}

/// The thread that draws.
struct Painter {
    canvas: Arc<Canvas>,
    pixels: Pixels,
    look: Look,
    bar: Arc<Bar>,
    form: Form,
    drawn: Option<Drawn>,
    /// Nothing may be drawn any more.
    stopped: Arc<AtomicBool>,
}

/// Beginning and end of what a terminal shall show at once (DEC private mode 2026; others pass over it).
const AT_ONCE: [&str; 2] = ["\x1b[?2026h", "\x1b[?2026l"];
const HIDE_CURSOR: &str = "\x1b[?25l";
/// Also the usual colours.
const RESTORE: &str = "\x1b[0m\x1b[?25h";

impl Painter {
    fn run(mut self) {
        let stopped = self.stopped.clone();
        interrupt::before_exit(move || {
            // By the lock of the stream, which the caller waits for: after a whole picture, and before any other.
            let mut out = stderr().lock();
            stopped.store(true, Ordering::Relaxed);
            let _ = write!(out, "{}{RESTORE}", AT_ONCE[1]);
        });
        let every = match self.form {
            Form::Blocks { .. } => BLOCKS_EVERY,
            Form::Sixel => SIXELS_EVERY,
        };
        self.write(HIDE_CURSOR);
        let mut part = Vec::new();
        let mut ends = false;
        while !ends {
            let next = Instant::now() + every;
            loop {
                let left = next.saturating_duration_since(Instant::now());
                match self.canvas.fetch(u32::MAX / 2, left, &mut part) {
                    Fetched::Pixels(rect) => self.pixels.set(rect, &part),
                    Fetched::Nothing => {}
                    Fetched::End => ends = true,
                }
                if ends || left.is_zero() {
                    break;
                }
            }
            let picture = self.picture(ends);
            self.write(&picture);
        }
        self.write(RESTORE);
        interrupt::before_exit(|| {});
    }

    /// All of it or nothing. A terminal that is gone takes nothing, and that is nobody's loss.
    fn write(&self, text: &str) {
        let mut out = stderr().lock();
        if !self.stopped.load(Ordering::Relaxed) {
            let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
        }
    }

    /// The text that draws the present state over the last, and the line of progress, or its absence at the end.
    fn picture(&mut self, ends: bool) -> String {
        let window = Window::now();
        let mut out = AT_ONCE[0].to_owned();
        // After the window has changed its size nobody knows where the last picture stands.
        match self.drawn.filter(|d| d.window == window) {
            Some(Drawn { rows, .. }) => out += &format!("\r\x1b[{rows}A"),
            None => out += "\r\x1b[J",
        }
        // A row for the line of progress, and one for the prompt.
        let rows = window.rows.saturating_sub(2).max(1);
        let rows = match self.form {
            Form::Blocks { true_colour } => {
                // The last column is left alone: what stands there makes some terminals break the line.
                let size = self.pixels.fit([(window.columns - 1).max(1), rows * 2], 1.0);
                let lines = blocks::lines(&self.pixels.dots(size, &self.look), true_colour);
                lines.iter().for_each(|line| out += &format!("{line}\x1b[K\r\n"));
                lines.len()
            }
            Form::Sixel => {
                let [width, height] = window.cell;
                let most = [(window.columns * width).min(MOST_SIXELS), rows * height];
                let dots = self.pixels.dots(self.pixels.fit(most, 1.0), &self.look);
                let rows = dots.height.div_ceil(height);
                // Room first, as terminals differ in where the cursor is after a picture.
                out +=
                    &format!("{}\x1b[{rows}A\x1b7{}\x1b8\x1b[{rows}B\r", "\r\n".repeat(rows), sixels(&dots));
                rows
            }
        };
        if !ends {
            let line: String = self.bar.line().chars().take((window.columns - 1).max(1)).collect();
            out += &line;
        }
        out += "\x1b[K";
        out += AT_ONCE[1];
        self.drawn = Some(Drawn { window, rows });
        out
    }
}

/// Nothing is drawn where nothing is known.
fn sixels(dots: &Dots) -> String {
    let rgba: Vec<u8> = dots.list.iter().flat_map(|d| d.map_or([0; 4], |[r, g, b]| [r, g, b, 255])).collect();
    if dots.list.iter().all(Option::is_none) {
        return String::new();
    }
    sixel_encode(&rgba, dots.width, dots.height, &EncodeOptions::default()).unwrap_or_default()
}
