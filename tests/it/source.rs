//! Just enough reading of Rust source to see what it uses.

use std::path::{Path, PathBuf};

/// Every Rust file below `dir`, in a fixed order.
pub fn rust_files(dir: &Path) -> Vec<PathBuf> {
    let mut all = Vec::new();
    let Ok(entries) = std::fs::read_dir(dir) else { return all };
    let mut entries: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            all.extend(rust_files(&path));
        } else if path.extension().is_some_and(|e| e == "rs") {
            all.push(path);
        }
    }
    all
}

/// The code alone: comments, strings and what `#[cfg(test)]` governs are blank; lines stay where they are.
pub fn production_code(text: &str) -> String {
    without_tests(&without_comments_and_strings(text))
}

/// Where the comment, string or character that starts at `i` ends; None if none starts there.
fn skip_from(s: &[u8], i: usize) -> Option<usize> {
    let find = |from: usize, what: &[u8]| {
        s[from..].windows(what.len()).position(|w| w == what).map_or(s.len(), |p| from + p)
    };
    let rest = &s[i..];
    if rest.starts_with(b"//") {
        return Some(find(i, b"\n"));
    }
    if rest.starts_with(b"/*") {
        let (mut depth, mut j) = (1, i + 2);
        while j < s.len() && depth > 0 {
            match &s[j..(j + 2).min(s.len())] {
                b"/*" => (depth, j) = (depth + 1, j + 2),
                b"*/" => (depth, j) = (depth - 1, j + 2),
                _ => j += 1,
            }
        }
        return Some(j);
    }
    let in_word = i > 0 && is_word(s[i - 1]);
    if !in_word && rest[0] == b'r' {
        let hashes = rest[1..].iter().take_while(|c| **c == b'#').count();
        if rest.get(1 + hashes) == Some(&b'"') {
            let end: Vec<u8> = std::iter::once(b'"').chain(std::iter::repeat_n(b'#', hashes)).collect();
            return Some((find(i + 2 + hashes, &end) + end.len()).min(s.len()));
        }
    }
    let quoted = |quote: u8| {
        let mut j = i + 1;
        while j < s.len() && s[j] != quote {
            j += if s[j] == b'\\' { 2 } else { 1 };
        }
        (j + 1).min(s.len())
    };
    match rest[0] {
        b'"' => Some(quoted(b'"')),
        // A lifetime is no character: those are escaped, or close after one character.
        b'\'' if rest.get(1) == Some(&b'\\') => Some(quoted(b'\'')),
        b'\'' => std::str::from_utf8(rest[1..rest.len().min(6)].split(|c| *c == b'\'').next()?)
            .ok()
            .filter(|c| c.chars().count() == 1)
            .map(|c| i + c.len() + 2),
        _ => None,
    }
}

fn is_word(c: u8) -> bool {
    c.is_ascii_alphanumeric() || c == b'_'
}

fn without_comments_and_strings(text: &str) -> String {
    let s = text.as_bytes();
    let mut out = Vec::with_capacity(s.len());
    let mut i = 0;
    while i < s.len() {
        let end = skip_from(s, i);
        let stop = end.unwrap_or(i + 1);
        out.extend(s[i..stop].iter().map(|&c| if end.is_none() || c == b'\n' { c } else { b' ' }));
        i = stop;
    }
    String::from_utf8_lossy(&out).into_owned()
}

fn without_tests(code: &str) -> String {
    const MARK: &str = "#[cfg(test)]";
    let mut out = code.to_owned();
    while let Some(start) = out.find(MARK) {
        // The item ends with the first `;` or the brace that closes its first one.
        let (mut depth, mut end) = (0, out.len());
        for (i, c) in out[start + MARK.len()..].char_indices() {
            let at_end = match c {
                '{' | '(' | '[' => {
                    depth += 1;
                    false
                }
                '}' | ')' | ']' => {
                    depth -= 1;
                    c == '}' && depth == 0
                }
                ';' => depth == 0,
                _ => false,
            };
            if at_end {
                end = start + MARK.len() + i + 1;
                break;
            }
        }
        let blank: String = out[start..end].chars().map(|c| if c == '\n' { c } else { ' ' }).collect();
        out.replace_range(start..end, &blank);
    }
    out
}

/// A word of the code and where it starts.
pub struct Word<'a> {
    /// The word.
    pub text: &'a str,
    /// Byte offset.
    pub at: usize,
}

/// All identifiers, keywords and numbers.
pub fn words(code: &str) -> Vec<Word<'_>> {
    let s = code.as_bytes();
    let mut all = Vec::new();
    let mut i = 0;
    while i < s.len() {
        let len = s[i..].iter().take_while(|c| is_word(**c)).count();
        if len > 0 {
            all.push(Word { text: &code[i..i + len], at: i });
        }
        i += len.max(1);
    }
    all
}

/// The line, from 1, of a byte offset.
pub fn line_of(code: &str, at: usize) -> usize {
    1 + code.as_bytes()[..at].iter().filter(|c| **c == b'\n').count()
}

/// The first names of what follows `prefix::`, such as `crate::`: one, or those of a braced list.
pub fn heads(after: &str) -> Vec<String> {
    let Some(rest) = after.trim_start().strip_prefix("::") else { return Vec::new() };
    let rest = rest.trim_start();
    let name = |s: &str| -> String { s.trim_start().chars().take_while(|c| is_word(*c as u8)).collect() };
    let Some(list) = rest.strip_prefix('{') else { return vec![name(rest)] };
    let mut all = vec![name(list)];
    let mut depth = 1;
    for (i, c) in list.char_indices() {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 1 => all.push(name(&list[i + 1..])),
            _ => {}
        }
        if depth == 0 {
            break;
        }
    }
    all.retain(|n| !n.is_empty());
    all
}

#[test]
fn comments_strings_and_tests_are_not_code() {
    let text = r####"
use crate::base::ray; // crate::cli
/* crate::cli /* nested */ crate::cli */
const A: &str = "crate::cli \" crate::cli";
const B: &str = r#"crate::cli " crate::cli"#;
const C: (char, char) = ('"', '\'');
fn f<'a>(x: &'a str) -> &'a str { x }
#[cfg(test)]
use crate::cli;
#[cfg(test)]
mod tests {
    fn g() { use crate::cli; }
}
use crate::{math::{frame, aabb}, color};
"####;
    let code = production_code(text);
    assert!(!code.contains("cli"), "{code}");
    assert_eq!(code.lines().count(), text.lines().count());
    let found: Vec<(usize, Vec<String>)> = words(&code)
        .iter()
        .filter(|w| w.text == "crate")
        .map(|w| (line_of(&code, w.at), heads(&code[w.at + 5..])))
        .collect();
    let want = [(2, vec!["base".to_owned()]), (14, vec!["math".to_owned(), "color".to_owned()])];
    assert_eq!(found, want);
}
