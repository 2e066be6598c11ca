//! Typed values out of the tree, with errors that say what was wanted and what stands there.

use super::tree::{Data, Source, Table, Tree};
use crate::error::{Result, unknown_name};

/// What a table may hold, for errors: "a key of [film]".
pub(super) struct Section<'s, 'a> {
    pub source: &'s Source<'a>,
    pub table: &'s Table,
    /// How messages name it: "[film]", "an object".
    pub name: &'s str,
}

impl Source<'_> {
    fn expected(&self, name: &str, what: &str, found: &Tree) -> crate::error::Error {
        self.error(found.at, format!("`{name}` takes {what}, not {}", found.describe()))
    }

    /// A finite number.
    pub fn number(&self, name: &str, v: &Tree) -> Result<f64> {
        match v.data {
            Data::Integer(i) => Ok(i as f64),
            Data::Float(x) if x.is_finite() => Ok(x),
            _ => Err(self.expected(name, "a finite number", v)),
        }
    }

    /// A whole number from `min` to `max`.
    pub fn integer(&self, name: &str, v: &Tree, min: i64, max: i64) -> Result<i64> {
        match v.data {
            Data::Integer(i) if (min..=max).contains(&i) => Ok(i),
            _ if max == i64::MAX => Err(self.expected(name, &format!("a whole number of at least {min}"), v)),
            _ => Err(self.expected(name, &format!("a whole number from {min} to {max}"), v)),
        }
    }

    /// true or false.
    pub fn bool(&self, name: &str, v: &Tree) -> Result<bool> {
        match v.data {
            Data::Bool(b) => Ok(b),
            _ => Err(self.expected(name, "true or false", v)),
        }
    }

    /// Text that is not empty.
    pub fn text<'t>(&self, name: &str, v: &'t Tree) -> Result<&'t str> {
        match &v.data {
            Data::Text(t) if !t.is_empty() => Ok(t),
            _ => Err(self.expected(name, "text", v)),
        }
    }

    /// One of `words`.
    pub fn word<'t>(&self, name: &str, v: &'t Tree, words: &[&str]) -> Result<&'t str> {
        let word = self.text(name, v)?;
        if words.contains(&word) {
            return Ok(word);
        }
        Err(self.error(v.at, unknown_name(name, word, words.iter().copied())))
    }

    /// A list of finite numbers, of one of the lengths in `counts`.
    pub fn numbers(&self, name: &str, v: &Tree, counts: &[usize]) -> Result<Vec<f64>> {
        match &v.data {
            Data::List(list) if counts.contains(&list.len()) => {
                list.iter().map(|x| self.number(name, x)).collect()
            }
            _ => {
                let counts: Vec<String> = counts.iter().map(usize::to_string).collect();
                Err(self.expected(name, &format!("a list of {} numbers", counts.join(" or ")), v))
            }
        }
    }

    /// Three finite numbers.
    pub fn vector(&self, name: &str, v: &Tree) -> Result<[f64; 3]> {
        Ok(self.numbers(name, v, &[3])?.try_into().expect("its length was asked for"))
    }

    /// A list of anything.
    pub fn list<'t>(&self, name: &str, v: &'t Tree) -> Result<&'t [Tree]> {
        match &v.data {
            Data::List(list) => Ok(list),
            _ => Err(self.expected(name, "a list", v)),
        }
    }

    /// A table.
    pub fn table<'t>(&self, name: &str, v: &'t Tree) -> Result<&'t Table> {
        match &v.data {
            Data::Table(t) => Ok(t),
            _ => Err(self.expected(name, "a table", v)),
        }
    }
}

impl<'s, 'a> Section<'s, 'a> {
    /// The table that `v` must be, with no key but `keys`.
    pub fn new(source: &'s Source<'a>, name: &'s str, v: &'s Tree, keys: &[&str]) -> Result<Self> {
        let table = source.table(name, v)?;
        let section = Section { source, table, name };
        section.only(keys)?;
        Ok(section)
    }

    /// An error for the first key that is not among `keys`.
    pub fn only(&self, keys: &[&str]) -> Result<()> {
        match self.table.entries.iter().find(|e| !keys.contains(&e.key.as_str())) {
            None => Ok(()),
            Some(e) => {
                let what = format!("key of {}", self.name);
                Err(self.source.error(e.key_at, unknown_name(&what, &e.key, keys.iter().copied())))
            }
        }
    }

    /// The value of `key` read by `read`, if it is there.
    pub fn read<T>(
        &self,
        key: &str,
        read: impl FnOnce(&Source<'a>, &str, &'s Tree) -> Result<T>,
    ) -> Result<Option<T>> {
        self.table.get(key).map(|v| read(self.source, key, v)).transpose()
    }
}
