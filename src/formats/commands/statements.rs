//! A text as statements: a word and its arguments a line, comments from `#` on.

use crate::error::{Error, Place, Result, nearest, unknown_name};
use crate::scene::desc::Loss;
use std::collections::BTreeMap;
use std::path::Path;

/// One line's statement; arguments are taken from it one by one.
pub struct Statement<'a> {
    path: &'a Path,
    /// The whole line.
    text: &'a str,
    line: usize,
    /// The command.
    pub word: &'a str,
    /// What is left of the line, without a comment.
    rest: &'a str,
    /// The argument taken last, for messages.
    last: &'a str,
}

/// Calls `each` for every statement of a text.
pub fn for_each<'a>(
    path: &'a Path,
    text: &'a str,
    mut each: impl FnMut(&mut Statement<'a>) -> Result<()>,
) -> Result<()> {
    for (i, text) in text.lines().enumerate() {
        let code = text.split('#').next().unwrap_or_default().trim();
        let (word, rest) = split(code);
        if !word.is_empty() {
            each(&mut Statement { path, text, line: i + 1, word, rest, last: word })?;
        }
    }
    Ok(())
}

/// The first word, and what follows it.
fn split(text: &str) -> (&str, &str) {
    let text = text.trim_start();
    let end = text.find(char::is_whitespace).unwrap_or(text.len());
    text.split_at(end)
}

impl<'a> Statement<'a> {
    /// Where the argument taken last stands (the command, if none was).
    pub fn place(&self) -> Place {
        // All words are slices of the line.
        let offset = (self.last.as_ptr() as usize).saturating_sub(self.text.as_ptr() as usize);
        let column = 1 + self.text.get(..offset).map_or(0, |before| before.chars().count());
        Place { path: self.path.to_owned(), line: self.line, column }
    }

    /// An error at that place.
    pub fn error(&self, message: impl Into<String>) -> Error {
        Error::Content { place: self.place(), message: message.into() }
    }

    /// The next word, if there is one.
    pub fn next(&mut self) -> Option<&'a str> {
        let (word, rest) = split(self.rest);
        (!word.is_empty()).then(|| {
            (self.last, self.rest) = (word, rest);
            word
        })
    }

    /// The next word, which must be there: `wanted` says what it is.
    pub fn word(&mut self, wanted: &str) -> Result<&'a str> {
        match self.next() {
            Some(word) => Ok(word),
            None => Err(self.error(format!("`{}` wants {wanted} here, and the line ends", self.word))),
        }
    }

    /// A finite number.
    pub fn number(&mut self) -> Result<f64> {
        let word = self.word("a number")?;
        let parsed = fast_float2::parse(word).or_else(|_| word.trim_start_matches('+').parse());
        match parsed {
            Ok(x) if f64::is_finite(x) => Ok(x),
            _ => Err(self.error(format!("`{}` takes finite numbers, not \"{}\"", self.word, short(word)))),
        }
    }

    /// Three numbers.
    pub fn vector(&mut self) -> Result<[f64; 3]> {
        Ok([self.number()?, self.number()?, self.number()?])
    }

    /// Three numbers of at least 0.
    pub fn color(&mut self) -> Result<[f64; 3]> {
        let mut color = [0.0; 3];
        for c in &mut color {
            *c = self.number()?;
            if *c < 0.0 || *c > f64::from(f32::MAX) {
                return Err(self.error(format!("`{}` takes colours of at least 0, not {c}", self.word)));
            }
        }
        Ok(color)
    }

    /// A whole number in a closed range.
    pub fn integer(&mut self, min: i64, max: i64) -> Result<i64> {
        let x = self.number()?;
        if x.fract() == 0.0 && x >= min as f64 && x <= max as f64 {
            return Ok(x as i64);
        }
        Err(self.error(format!("`{}` takes a whole number from {min} to {max}, not {x}", self.word)))
    }

    /// Index of a vertex, of which there are `count`.
    pub fn index(&mut self, count: usize) -> Result<u32> {
        let word = self.word("the number of a vertex")?;
        match word.parse::<u32>() {
            Ok(i) if (i as usize) < count => Ok(i),
            Ok(i) => {
                Err(self.error(format!("vertex {i} does not exist: {count} stand above, numbered from 0")))
            }
            Err(_) => {
                let word = short(word);
                Err(self.error(format!("`{}` takes numbers of vertices, not \"{word}\"", self.word)))
            }
        }
    }

    /// One of these words, in any case.
    pub fn choice(&mut self, known: &[&'static str]) -> Result<&'static str> {
        let word = self.word("a word")?;
        match known.iter().find(|k| k.eq_ignore_ascii_case(word)) {
            Some(k) => Ok(k),
            None => {
                let what = format!("word for `{}`", self.word);
                Err(self.error(unknown_name(&what, word, known.iter().copied())))
            }
        }
    }

    /// All that is left, such as a path with blanks; it must be something.
    pub fn remainder(&mut self, wanted: &str) -> Result<&'a str> {
        let text = self.rest.trim();
        self.word(wanted)?;
        self.rest = "";
        Ok(text)
    }
}

fn short(word: &str) -> String {
    word.chars().take(40).collect()
}

/// Commands that nobody knows: each is skipped, with one warning for all its lines.
#[derive(Default)]
pub struct Skipped {
    /// First place and count by word.
    words: BTreeMap<String, (Place, usize)>,
}

impl Skipped {
    /// Notes a statement.
    pub fn note(&mut self, s: &Statement) {
        // A file of garbage is not kept whole in memory: more words than any format has are not told apart.
        const MOST: usize = 64;
        let word = if self.words.len() < MOST { short(s.word) } else { "others".into() };
        self.words.entry(word).or_insert_with(|| (s.place(), 0)).1 += 1;
    }

    /// What was skipped, for whoever writes the scene anew.
    pub fn losses(&self) -> impl Iterator<Item = Loss> {
        self.words.iter().map(|(word, (place, count))| {
            let lines = if *count > 1 { format!(", {count} lines") } else { String::new() };
            Loss {
                section: "film",
                place: place.clone(),
                what: format!("the unknown command \"{word}\"{lines}"),
            }
        })
    }

    /// Logs what was skipped.
    pub fn warn(&self, known: &[&str]) {
        for (word, (place, count)) in &self.words {
            let hint = match nearest(word, known.iter().copied()) {
                Some(k) => format!("did you mean \"{k}\"?"),
                None => format!("known: {}", known.join(", ")),
            };
            let lines = if *count > 1 { format!(" (and {} lines more)", count - 1) } else { String::new() };
            log::warn!("{place}: unknown command \"{word}\" is skipped{lines}; {hint}");
        }
    }
}
