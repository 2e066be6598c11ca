//! An ascii PLY as words between blanks, each with its line: slower than reading lines, and takes anything.

use super::general::{Values, read_element};
use super::header::Scalar;
use super::{Plan, Tables, Text};
use crate::error::{Error, Result};
use std::path::Path;

/// Reads all elements: the tables, and whether nothing but blanks follows them.
pub fn read_words(plan: &Plan, text: Text, by_line: bool) -> Result<(Tables, bool)> {
    let mut tables = Tables::new(plan);
    let mut words = Words {
        path: plan.path,
        bytes: text.bytes,
        at: text.body,
        last: text.body,
        by_line,
        records: 0,
        odd_lines: 0,
    };
    for (element, role) in &plan.elements {
        read_element(plan, element, *role, &mut words, &mut tables)?;
    }
    tables.odd_lines = words.odd_lines;
    Ok((tables, words.bytes[words.at..].trim_ascii().is_empty()))
}

/// The words of a text.
struct Words<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    /// Behind the word read last, and its start.
    at: usize,
    last: usize,
    /// Whether each record starts a line and what stands behind it is passed over.
    by_line: bool,
    records: u64,
    /// Lines in which something was.
    odd_lines: u64,
}

impl Values for Words<'_> {
    fn start_record(&mut self) {
        if self.by_line && self.records > 0 {
            let rest = &self.bytes[self.at..];
            let length = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
            self.odd_lines += u64::from(!rest[..length].trim_ascii().is_empty());
            self.at += length;
        }
        self.records += 1;
    }

    fn number(&mut self, _kind: Scalar) -> Result<f64, String> {
        let rest = &self.bytes[self.at..];
        self.last = self.at + rest.iter().position(|b| !b.is_ascii_whitespace()).unwrap_or(rest.len());
        let rest = &self.bytes[self.last..];
        let word = &rest[..rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len())];
        self.at = self.last + word.len();
        if word.is_empty() {
            return Err("the file is cut short here".to_string());
        }
        parse_number(word).ok_or_else(|| {
            let shown = &word[..word.len().min(40)];
            format!("\"{}\" is no number", String::from_utf8_lossy(shown).escape_debug())
        })
    }

    fn can_hold(&self, count: usize, _kind: Scalar) -> bool {
        // Each number takes a blank and a digit.
        count <= (self.bytes.len() - self.at) / 2
    }

    fn fail(&mut self, message: String) -> Error {
        let line = 1 + self.bytes[..self.last].iter().filter(|&&b| b == b'\n').count();
        Error::content_at(self.path, line, 0, message)
    }
}

/// A number, also as the C runtime of Windows writes those that are none: `-nan(ind)`, `1.#INF`, `-1.#IND`.
fn parse_number(word: &[u8]) -> Option<f64> {
    if let Ok(value) = fast_float2::parse(word) {
        return Some(value);
    }
    let lower = word.to_ascii_lowercase();
    let (sign, rest) = match lower.strip_prefix(b"-") {
        Some(rest) => (-1.0, rest),
        None => (1.0, lower.strip_prefix(b"+").unwrap_or(&lower)),
    };
    if rest.starts_with(b"1.#inf") {
        Some(sign * f64::INFINITY)
    } else if rest.starts_with(b"1.#") || rest.starts_with(b"nan(") {
        Some(f64::NAN)
    } else {
        None
    }
}
