//! The text of a scene file as a tree in which every key and value knows where it stands.

use crate::error::{Error, Place, Result};
use std::path::Path;
use toml_edit::{Document, Item, Key, TableLike};

/// A scene file's text, for places and errors.
pub(super) struct Source<'a> {
    path: &'a Path,
    text: &'a str,
    line_starts: Vec<usize>,
}

/// A value.
#[derive(Clone)]
pub(super) struct Tree {
    /// Byte offset in the text.
    pub at: usize,
    /// What stands there.
    pub data: Data,
}

/// What a value is; tables and arrays of tables are the same whichever way they are written.
#[derive(Clone)]
pub(super) enum Data {
    Bool(bool),
    Integer(i64),
    Float(f64),
    Text(String),
    Date,
    List(Vec<Tree>),
    Table(Table),
}

/// Keys and values in the order of the file.
#[derive(Clone, Default)]
pub(super) struct Table {
    pub entries: Vec<Entry>,
}

/// A key with its value.
#[derive(Clone)]
pub(super) struct Entry {
    pub key: String,
    pub key_at: usize,
    pub value: Tree,
}

impl Table {
    pub fn get(&self, key: &str) -> Option<&Tree> {
        self.entries.iter().find(|e| e.key == key).map(|e| &e.value)
    }
}

impl Tree {
    /// For errors: "text", "a list of 3".
    pub fn describe(&self) -> String {
        match &self.data {
            Data::Bool(v) => v.to_string(),
            Data::Integer(v) => v.to_string(),
            Data::Float(v) => v.to_string(),
            Data::Text(v) if v.chars().count() <= 40 => format!("the text {v:?}"),
            Data::Text(_) => "text".into(),
            Data::Date => "a date".into(),
            Data::List(v) => format!("a list of {}", v.len()),
            Data::Table(_) => "a table".into(),
        }
    }
}

impl<'a> Source<'a> {
    /// Line starts are found once, so that a place costs a binary search.
    pub fn new(path: &'a Path, text: &'a str) -> Self {
        let line_starts = std::iter::once(0).chain(text.match_indices('\n').map(|(i, _)| i + 1)).collect();
        Source { path, text, line_starts }
    }

    /// Line and column of a byte offset; columns count characters.
    pub fn place(&self, at: usize) -> Place {
        let at = at.min(self.text.len());
        let line = self.line_starts.partition_point(|&start| start <= at);
        let before = self.text.get(self.line_starts[line - 1]..at).unwrap_or("");
        Place { path: self.path.to_owned(), line, column: before.chars().count() + 1 }
    }

    /// An error at a byte offset.
    pub fn error(&self, at: usize, message: impl Into<String>) -> Error {
        Error::Content { place: self.place(at), message: message.into() }
    }

    /// The text as a tree. Its depth is bounded by the TOML parser (80 a key, a header and a value).
    pub fn parse(&self) -> Result<Table> {
        let document = Document::parse(self.text).map_err(|e| {
            let message = e.message().trim().replace('\n', "; ");
            self.error(e.span().map_or(0, |s| s.start), message)
        })?;
        Ok(table(document.as_table(), 0))
    }
}

fn table(from: &dyn TableLike, at: usize) -> Table {
    let key_of = |name: &str| from.key(name).and_then(Key::span).map_or(at, |s| s.start);
    let entries = from.iter().map(|(name, item)| {
        let key_at = key_of(name);
        Entry { key: name.to_owned(), key_at, value: item_tree(item, key_at) }
    });
    Table { entries: entries.collect() }
}

fn item_tree(item: &Item, key_at: usize) -> Tree {
    // A table that only its dotted keys or its children's headers imply has no span: it stands where its key does.
    let at = item.span().map_or(key_at, |s| s.start);
    let data = match item {
        Item::None => Data::Table(Table::default()),
        Item::Value(v) => return value_tree(v, key_at),
        Item::Table(t) => Data::Table(table(t, at)),
        Item::ArrayOfTables(list) => {
            let each = |t: &toml_edit::Table| {
                let at = t.span().map_or(key_at, |s| s.start);
                Tree { at, data: Data::Table(table(t, at)) }
            };
            Data::List(list.iter().map(each).collect())
        }
    };
    Tree { at, data }
}

fn value_tree(value: &toml_edit::Value, key_at: usize) -> Tree {
    let at = value.span().map_or(key_at, |s| s.start);
    let data = match value {
        toml_edit::Value::String(v) => Data::Text(v.value().clone()),
        toml_edit::Value::Integer(v) => Data::Integer(*v.value()),
        toml_edit::Value::Float(v) => Data::Float(*v.value()),
        toml_edit::Value::Boolean(v) => Data::Bool(*v.value()),
        toml_edit::Value::Datetime(_) => Data::Date,
        toml_edit::Value::Array(list) => Data::List(list.iter().map(|v| value_tree(v, at)).collect()),
        toml_edit::Value::InlineTable(t) => Data::Table(table(t, at)),
    };
    Tree { at, data }
}
