//! The progress bar: what is done, time left, samples per second. Drawn on a terminal alone.

use super::target_args::percent;
use crate::render::Progress;
use crate::render::adaptive::Reached;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use std::fmt::Write;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Shows a render's progress.
pub struct Bar {
    bar: ProgressBar,
    done: AtomicU64,
    /// The most samples that will be taken.
    total: AtomicU64,
    started: Instant,
    /// With a limit the bar counts time, since nobody knows how many samples that will be.
    limit: Option<Duration>,
    /// What a render to a target has come to.
    error: Mutex<String>,
}

/// Often enough to look alive, seldom enough to cost nothing.
const DRAWS_PER_SECOND: u8 = 8;

impl Bar {
    /// Nothing is drawn if `quiet`, or where stderr is no terminal.
    pub fn new(quiet: bool, limit: Option<Duration>) -> Self {
        let target = if quiet {
            ProgressDrawTarget::hidden()
        } else {
            ProgressDrawTarget::stderr_with_hz(DRAWS_PER_SECOND)
        };
        let bar = ProgressBar::with_draw_target(None, target);
        Bar {
            bar,
            done: AtomicU64::new(0),
            total: AtomicU64::new(0),
            started: Instant::now(),
            limit,
            error: Mutex::default(),
        }
    }

    /// In a line, for those who draw it themselves.
    pub fn line(&self) -> String {
        let elapsed = self.started.elapsed().as_secs_f64();
        let done = self.done.load(Ordering::Relaxed) as f64;
        let part = match self.limit {
            Some(limit) => elapsed / limit.as_secs_f64(),
            None => done / self.total.load(Ordering::Relaxed).max(1) as f64,
        };
        let part = part.min(1.0);
        let error = self.error.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let left = elapsed * (1.0 / part.max(1e-9) - 1.0);
        let left = if part > 0.0 { format!("  {left:.0} s left") } else { String::new() };
        format!("render {:3.0} %  {}{error}{left}", part * 100.0, self.rate())
    }

    /// Takes it off the screen.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn rate(&self) -> String {
        let seconds = self.started.elapsed().as_secs_f64().max(1e-3);
        format!("{:.2} Msamples/s", self.done.load(Ordering::Relaxed) as f64 / seconds * 1e-6)
    }
}

impl Progress for Bar {
    fn begin(&self, samples: u64) {
        self.total.store(samples, Ordering::Relaxed);
        if self.bar.is_hidden() {
            return;
        }
        let percent = |state: &ProgressState, out: &mut dyn Write| {
            let _ = write!(out, "{:3.0} %", state.fraction() * 100.0);
        };
        let template = "render {bar:32} {part}  {msg}  {eta} left";
        if let Ok(style) = ProgressStyle::with_template(template) {
            self.bar.set_style(style.with_key("part", percent));
        }
        self.bar.set_length(self.limit.map_or(samples, |t| t.as_millis() as u64));
    }

    fn advance(&self, samples: u64) {
        let done = self.done.fetch_add(samples, Ordering::Relaxed) + samples;
        if self.bar.is_hidden() {
            return;
        }
        match self.limit {
            Some(_) => self.bar.set_position(self.started.elapsed().as_millis() as u64),
            None => self.bar.set_position(done),
        }
        let error = self.error.lock().unwrap_or_else(PoisonError::into_inner);
        self.bar.set_message(self.rate() + &error);
    }

    fn reached(&self, reached: &Reached, target: f64) {
        let text = format!(", error {} of {}", percent(reached.at_most), percent(target));
        *self.error.lock().unwrap_or_else(PoisonError::into_inner) = text;
        if self.limit.is_none() && target > 0.0 {
            // The squared error falls as the samples grow.
            let done = self.done.load(Ordering::Relaxed);
            let needed = done as f64 * (reached.at_most / target).powi(2).max(1.0);
            self.total.store(needed as u64, Ordering::Relaxed);
            self.bar.set_length(needed as u64);
        }
    }
}
