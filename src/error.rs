//! The one error type, sorted by what the user can do about it (and so by exit code).

use std::borrow::Cow;
use std::fmt;
use std::path::{Path, PathBuf};

/// Every way a command can fail. The message says where, what, and what else was possible.
#[derive(Debug, Clone, thiserror::Error)]
pub enum Error {
    /// The command line or a parameter is wrong. Exit code 2.
    #[error("{0}")]
    Usage(String),
    /// A file was read, but what stands in it cannot be used. Exit code 2.
    #[error("{}{}", place.prefix(), clipped(message))]
    Content {
        /// Where it stands.
        place: Place,
        /// What is wrong, and what was possible instead.
        message: String,
    },
    /// A file cannot be opened, read or written. Exit code 3.
    #[error("{}: cannot {action}: {reason}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// "open", "read", "write", "create".
        action: &'static str,
        /// What the operating system says.
        reason: String,
    },
    /// A comparison, check or crosscheck came to an end and failed. Exit code 1.
    #[error("{0}")]
    Failed(String),
    /// A fault of ours or of a library below us. Exit code 4.
    #[error("internal failure: {0}")]
    Internal(String),
}

/// `Result` with this crate's [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// A place in a file: line and column count from 1; 0 means "not known".
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Place {
    /// The file.
    pub path: PathBuf,
    /// Line, from 1; 0 where the format has no lines or the place is not known.
    pub line: usize,
    /// Column in characters, from 1; 0 as above.
    pub column: usize,
}

impl Place {
    /// `scene.toml:14:3: `, or nothing if no file is known: scenes are made in code, too.
    fn prefix(&self) -> String {
        if self.path.as_os_str().is_empty() { String::new() } else { format!("{self}: ") }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.path.display())?;
        if self.line > 0 {
            write!(f, ":{}", self.line)?;
            if self.column > 0 {
                write!(f, ":{}", self.column)?;
            }
        }
        Ok(())
    }
}

impl Error {
    /// Content of `path` that cannot be used, place within it unknown.
    pub fn content(path: &Path, message: impl Into<String>) -> Self {
        Error::Content { place: Place { path: path.to_owned(), ..Place::default() }, message: message.into() }
    }

    /// Content at a line of `path` (from 1) that cannot be used.
    pub fn content_at(path: &Path, line: usize, column: usize, message: impl Into<String>) -> Self {
        Error::Content { place: Place { path: path.to_owned(), line, column }, message: message.into() }
    }

    /// A failed file operation; `action` completes "cannot ...".
    pub fn file(path: &Path, action: &'static str, reason: impl fmt::Display) -> Self {
        Error::File { path: path.to_owned(), action, reason: reason.to_string() }
    }

    /// The process exit code that this error means (README, "Exit codes").
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Failed(_) => 1,
            Error::Usage(_) | Error::Content { .. } => 2,
            Error::File { .. } => 3,
            Error::Internal(_) => 4,
        }
    }
}

/// Most characters of a message about content: it may quote a file's line, and that may be a megabyte long.
const MAX_MESSAGE: usize = 1000;

/// The message, or its beginning and its end.
fn clipped(message: &str) -> Cow<'_, str> {
    let count = message.chars().count();
    if count <= MAX_MESSAGE {
        return Cow::Borrowed(message);
    }
    let (head, tail) = (MAX_MESSAGE / 2, count - MAX_MESSAGE / 2);
    let text: String =
        message.chars().take(head).chain(" [...] ".chars()).chain(message.chars().skip(tail)).collect();
    Cow::Owned(text)
}

/// Most known names that a message lists.
const MAX_LISTED: usize = 32;

/// `unknown material "glas"; did you mean "glass"? known: diffuse, glass`
pub fn unknown_name<'a>(what: &str, name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    let shown: String = name.chars().take(60).collect();
    let mut text = format!("unknown {what} \"{shown}\"");
    match nearest(name, known.iter().copied()) {
        Some(k) => text += &format!("; did you mean \"{k}\"?"),
        None if !known.is_empty() => text += ";",
        None => {}
    }
    if !known.is_empty() {
        text += &format!(" known: {}", known[..known.len().min(MAX_LISTED)].join(", "));
    }
    if known.len() > MAX_LISTED {
        text += &format!(" and {} more", known.len() - MAX_LISTED);
    }
    text
}

/// The known name that `name` was most likely meant to be, if any is near: at most a third of it is wrong, and one
/// letter more.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // Of words as short as extensions a third and one is nearly all: no more than half.
    let far = |k: &str| {
        let length = k.len().max(name.len());
        (1 + length / 3).min(length / 2)
    };
    known
        .into_iter()
        // The lengths alone tell most apart, and keep the cost of a monstrous name small.
        .filter(|k| k.len().abs_diff(name.len()) <= far(k))
        .map(|k| (strsim::damerau_levenshtein(k, name), k))
        .filter(|(d, k)| *d <= far(k))
        .min()
        .map(|(_, k)| k)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_about_a_line_of_a_megabyte_is_short() {
        let line = "\u{fffd}".repeat(1 << 20);
        let text = Error::content_at(Path::new("a"), 3, 0, format!("\"{line}\" is no corner")).to_string();
        assert!(text.starts_with("a:3: \"\u{fffd}") && text.ends_with("\" is no corner"), "{text}");
        assert!(text.chars().count() < MAX_MESSAGE + 20);
    }

    #[test]
    fn hints_name_the_nearest_and_list_the_rest() {
        let known = ["diffuse", "glass", "mirror"];
        let text = unknown_name("material", "glas", known);
        assert_eq!(text, r#"unknown material "glas"; did you mean "glass"? known: diffuse, glass, mirror"#);
        let text = unknown_name("material", "quartz", known);
        assert_eq!(text, r#"unknown material "quartz"; known: diffuse, glass, mirror"#);
        let text = unknown_name("mesh file", "glb", ["obj", "ply"]);
        assert_eq!(text, r#"unknown mesh file "glb"; known: obj, ply"#);
        assert_eq!(unknown_name("material", "quartz", []), r#"unknown material "quartz""#);
        let text = unknown_name("material", &"long".repeat(1 << 18), known);
        assert!(text.len() < 200, "{text}");
    }
}
