//! Nodes: tables with a `type`, whose parameters are read as the registry row of that type declares them.

use super::Reader;
use super::tree::{Data, Entry, Table, Tree};
use crate::base::image_data::Encoding;
use crate::base::registry::{Node, Param, ParamKind, ParamSpec, Params, Value, check};
use crate::error::{Result, unknown_name};
use crate::formats::families::{Family, Kind, describe};

/// `{ texture = "clay.png" }` is short for `{ type = "image", path = "clay.png" }`.
const PICTURE_KEY: &str = "texture";
const PICTURE: &str = "image";
const PICTURE_PATH: &str = "path";

/// A table that describes a node.
pub(super) struct NodeTable<'t> {
    pub table: &'t Table,
    pub at: usize,
    /// Keys that are not the node's own, read by the caller.
    pub others: &'t [&'t str],
}

impl Reader<'_, '_> {
    /// A node of `family` from a table with `type`.
    pub fn node(&mut self, family: &Family, v: &Tree, others: &[&str]) -> Result<Node> {
        let table = self.source.table(family.name, v)?;
        let Some(kind) = table.get("type") else {
            let known: Vec<&str> = family.names().collect();
            let message = format!("a {} needs a `type`: {}", family.name, known.join(", "));
            return Err(self.source.error(v.at, message));
        };
        let name = self.source.text("type", kind)?;
        let found = family.find(name).ok_or_else(|| self.source.error(kind.at, family.unknown(name)))?;
        self.node_of(found, NodeTable { table, at: v.at, others: &[others, &["type"]].concat() })
    }

    /// A node of a kind that is already known.
    pub fn node_of(&mut self, kind: &Kind, from: NodeTable) -> Result<Node> {
        let place = self.source.place(from.at);
        let mut params = Params { list: Vec::new(), place: place.clone() };
        let encoding = self.encoding(kind, from.table)?;
        for e in from.table.entries.iter().filter(|e| !from.others.contains(&e.key.as_str())) {
            match kind.params.iter().find(|s| s.name == e.key) {
                Some(spec) => params.list.push(Param {
                    name: e.key.clone(),
                    value: self.value(spec, e, encoding)?,
                    place: self.source.place(e.value.at),
                }),
                None if e.key == "encoding" && reads_pictures(kind) => {}
                None => return Err(self.unknown_parameter(kind, e, from.others)),
            }
        }
        check(kind.name, kind.params, &params)?;
        Ok(Node { kind: kind.name.to_owned(), params, place })
    }

    fn unknown_parameter(&self, kind: &Kind, e: &Entry, others: &[&str]) -> crate::Error {
        let known = kind.params.iter().map(|s| s.name).chain(others.iter().copied());
        let what = format!("parameter of \"{}\"", kind.name);
        self.source.error(e.key_at, unknown_name(&what, &e.key, known))
    }

    /// The curve of a node's 8-bit pictures; a kind may declare `encoding` itself, too.
    fn encoding(&self, kind: &Kind, table: &Table) -> Result<Option<Encoding>> {
        match table.get("encoding") {
            Some(v) if reads_pictures(kind) => {
                let word = self.source.word("encoding", v, &["srgb", "linear"])?;
                Ok(Some(if word == "linear" { Encoding::Linear } else { Encoding::Srgb }))
            }
            _ => Ok(None),
        }
    }

    fn value(&mut self, spec: &ParamSpec, e: &Entry, encoding: Option<Encoding>) -> Result<Value> {
        let (name, v, source) = (spec.name, &e.value, self.source);
        let place = || source.place(v.at);
        Ok(match spec.kind {
            ParamKind::Bool => Value::Bool(source.bool(name, v)?),
            ParamKind::Number { .. } => Value::Number(source.number(name, v)?),
            ParamKind::Integer { min, max } => Value::Number(source.integer(name, v, min, max)? as f64),
            ParamKind::Vector => Value::Numbers(source.vector(name, v)?.to_vec()),
            ParamKind::Vector2 => self.number_or_list(spec, v, 2)?,
            ParamKind::Color => self.number_or_list(spec, v, 3)?,
            ParamKind::Texture => match &v.data {
                Data::Table(table) => Value::Node(Box::new(self.texture(table, v)?)),
                _ => self.number_or_list(spec, v, 3)?,
            },
            ParamKind::Choice(words) => Value::Text(source.word(name, v, words)?.to_owned()),
            ParamKind::Text => Value::Text(source.text(name, v)?.to_owned()),
            ParamKind::Image => Value::Image(self.files.image(source.text(name, v)?, encoding, &place())?),
            ParamKind::CubeFaces => {
                Value::Faces(self.files.faces(source.text(name, v)?, encoding, &place())?)
            }
            ParamKind::Mesh => Value::Mesh(self.files.mesh(source.text(name, v)?, &place())?),
        })
    }

    fn number_or_list(&self, spec: &ParamSpec, v: &Tree, count: usize) -> Result<Value> {
        match v.data {
            Data::Integer(_) | Data::Float(_) => Ok(Value::Number(self.source.number(spec.name, v)?)),
            Data::List(_) => Ok(Value::Numbers(self.source.numbers(spec.name, v, &[count])?)),
            _ => {
                let message = format!("`{}` takes {}, not {}", spec.name, describe(spec.kind), v.describe());
                Err(self.source.error(v.at, message))
            }
        }
    }

    fn texture(&mut self, table: &Table, v: &Tree) -> Result<Node> {
        let families = self.families;
        let (Some(picture), Some(kind)) = (table.get(PICTURE_KEY), families.textures.find(PICTURE)) else {
            return self.node(&families.textures, v, &[]);
        };
        if table.get("type").is_some() || table.get(PICTURE_PATH).is_some() {
            let message =
                format!("`{PICTURE_KEY}` stands for `type` and `{PICTURE_PATH}`: give one or the other");
            return Err(self.source.error(picture.at, message));
        }
        let mut long = table.clone();
        long.entries.iter_mut().filter(|e| e.key == PICTURE_KEY).for_each(|e| e.key = PICTURE_PATH.into());
        self.node_of(kind, NodeTable { table: &long, at: v.at, others: &[] })
    }
}

fn reads_pictures(kind: &Kind) -> bool {
    kind.params.iter().any(|s| matches!(s.kind, ParamKind::Image | ParamKind::CubeFaces))
}
