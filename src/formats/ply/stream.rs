//! The bytes of a binary PLY, of which only a window is in memory.

use super::binary::number_at;
use super::general::Values;
use super::header::{Element, Scalar};
use crate::error::{Error, Result};
use crate::formats::source::Source;
use std::path::Path;

/// Bytes read at once, unless one record is longer.
const WINDOW: usize = 1 << 18;

/// A file of known size that is read from start to end.
pub struct Stream<'a> {
    path: &'a Path,
    source: Source<'a>,
    window: Vec<u8>,
    /// What is taken of the window, and bytes before it.
    at: usize,
    before: u64,
    size: u64,
    /// Why reading failed, where only a message could be handed on.
    failure: Option<Error>,
}

impl<'a> Stream<'a> {
    /// Goes on behind the first `at` of `bytes`, which were read from `source`.
    pub fn new(path: &'a Path, source: Source<'a>, bytes: Vec<u8>, at: usize, size: u64) -> Self {
        Stream { path, source, window: bytes, at, before: 0, size, failure: None }
    }

    /// What is in memory of the bytes to come.
    #[inline(always)]
    pub fn rest(&self) -> &[u8] {
        &self.window[self.at..]
    }

    /// Steps past `count` bytes of [`Stream::rest`].
    #[inline(always)]
    pub fn pass(&mut self, count: usize) {
        self.at += count;
    }

    /// Makes [`Stream::rest`] longer; false at the end of the file.
    ///
    /// # Errors
    /// Those of [`Source::fill`].
    #[cold]
    pub fn more(&mut self) -> Result<bool> {
        self.before += self.at as u64;
        self.window.drain(..self.at);
        self.at = 0;
        // Doubling, so that a long record is looked at but a few times.
        let count = WINDOW.max(self.window.len());
        Ok(self.source.fill(&mut self.window, count)? > 0)
    }

    /// Bytes not yet taken.
    fn left(&self) -> u64 {
        self.size.saturating_sub(self.before + self.at as u64)
    }

    /// Hands out all records of an element without lists, many at a time.
    ///
    /// # Errors
    /// [`Error::Content`] if the file ends before, those of [`Source::fill`].
    pub fn records(&mut self, element: &Element, stride: usize, mut take: impl FnMut(&[u8])) -> Result<()> {
        if stride == 0 {
            return Ok(());
        }
        let mut left = element.count;
        let there = self.left() / stride as u64;
        while left > 0 {
            let whole = (self.rest().len() / stride).min(left);
            if there < element.count as u64 || whole == 0 && !self.more()? {
                let message =
                    format!("cut short: {there} of {} records of {} are there", element.count, element.name);
                return Err(self.error(&message));
            }
            take(&self.rest()[..whole * stride]);
            self.pass(whole * stride);
            left -= whole;
        }
        Ok(())
    }

    /// An error at the byte that comes next.
    pub fn error(&self, message: &str) -> Error {
        Error::content(self.path, format!("{message} (at byte {})", self.before + self.at as u64))
    }
}

/// The numbers of a stream.
pub struct Numbers<'a, 'b> {
    /// Where they stand.
    pub stream: &'a mut Stream<'b>,
    /// Whether the most significant byte comes first.
    pub big: bool,
}

impl Values for Numbers<'_, '_> {
    fn number(&mut self, kind: Scalar) -> Result<f64, String> {
        let size = kind.size();
        while self.stream.rest().len() < size {
            match self.stream.more() {
                Ok(true) => {}
                Ok(false) => return Err("the file is cut short here".to_string()),
                Err(e) => {
                    self.stream.failure = Some(e);
                    return Err(String::new());
                }
            }
        }
        let value = number_at(self.stream.rest(), 0, kind, self.big);
        self.stream.pass(size);
        Ok(value)
    }

    fn can_hold(&self, count: usize, kind: Scalar) -> bool {
        count as u64 <= self.stream.left() / kind.size() as u64
    }

    fn fail(&mut self, message: String) -> Error {
        self.stream.failure.take().unwrap_or_else(|| self.stream.error(&message))
    }
}
