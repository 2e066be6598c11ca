//! The header of a PLY file: elements and the types of their properties.
//!
//! Source: Greg Turk, "The PLY Polygon File Format", 1994.

use crate::error::{Error, Result, unknown_name};
use std::path::Path;

/// A header longer than this is none.
pub const MAX_HEADER: usize = 1 << 20;

/// How the values after the header are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Decimal text.
    Ascii,
    /// Binary, least significant byte first.
    LittleEndian,
    /// Binary, most significant byte first.
    BigEndian,
}

/// The type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scalar {
    /// `char`, `int8`
    I8,
    /// `uchar`, `uint8`
    U8,
    /// `short`, `int16`
    I16,
    /// `ushort`, `uint16`
    U16,
    /// `int`, `int32`
    I32,
    /// `uint`, `uint32`
    U32,
    /// `float`, `float32`
    F32,
    /// `double`, `float64`
    F64,
}

impl Scalar {
    const NAMES: [(&'static str, Scalar); 16] = [
        ("char", Scalar::I8),
        ("uchar", Scalar::U8),
        ("short", Scalar::I16),
        ("ushort", Scalar::U16),
        ("int", Scalar::I32),
        ("uint", Scalar::U32),
        ("float", Scalar::F32),
        ("double", Scalar::F64),
        ("int8", Scalar::I8),
        ("uint8", Scalar::U8),
        ("int16", Scalar::I16),
        ("uint16", Scalar::U16),
        ("int32", Scalar::I32),
        ("uint32", Scalar::U32),
        ("float32", Scalar::F32),
        ("float64", Scalar::F64),
    ];

    /// Bytes of one number in a binary file.
    pub fn size(self) -> usize {
        match self {
            Scalar::I8 | Scalar::U8 => 1,
            Scalar::I16 | Scalar::U16 => 2,
            Scalar::I32 | Scalar::U32 | Scalar::F32 => 4,
            Scalar::F64 => 8,
        }
    }

    /// Whether it counts, as the length of a list and indices must.
    pub fn is_integer(self) -> bool {
        !matches!(self, Scalar::F32 | Scalar::F64)
    }

    /// Whether every value of this type is exact in an `f32`.
    pub fn fits_f32(self) -> bool {
        !matches!(self, Scalar::F64 | Scalar::I32 | Scalar::U32)
    }
}

/// What one property of an element holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// One number.
    Number(Scalar),
    /// A length and so many numbers.
    List {
        /// Type of the length: an integer.
        length: Scalar,
        /// Type of each number.
        item: Scalar,
    },
}

impl Kind {
    /// Bytes in a binary file, at least.
    pub fn min_size(self) -> usize {
        match self {
            Kind::Number(kind) => kind.size(),
            Kind::List { length, .. } => length.size(),
        }
    }
}

/// One property of an element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Property {
    /// As the header spells it.
    pub name: String,
    /// Its type.
    pub kind: Kind,
}

/// A table of the file: `count` records of the same properties.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Element {
    /// `vertex`, `face`, `tristrips`, ...
    pub name: String,
    /// Records promised.
    pub count: usize,
    /// In file order.
    pub properties: Vec<Property>,
}

impl Element {
    /// The number of the property of this name.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.properties.iter().position(|p| p.name == name)
    }

    /// Bytes of a record in a binary file; `None` if it holds a list.
    pub fn stride(&self) -> Option<usize> {
        let is_list = |p: &Property| matches!(p.kind, Kind::List { .. });
        if self.properties.iter().any(is_list) { None } else { Some(self.min_stride()) }
    }

    /// Bytes of a record in a binary file with all lists empty.
    fn min_stride(&self) -> usize {
        self.properties.iter().map(|p| p.kind.min_size()).sum()
    }

    /// Byte offset of property `index` within a record without lists before it.
    pub fn offset(&self, index: usize) -> usize {
        self.properties[..index].iter().map(|p| p.kind.min_size()).sum()
    }
}

/// A header whose promised counts fit into the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Header {
    /// How the body is written.
    pub format: Format,
    /// Tables in file order.
    pub elements: Vec<Element>,
    /// Byte at which the body starts.
    pub body: usize,
}

/// Reads the header that `bytes` start with, at least [`MAX_HEADER`] of them or the whole file of `size` bytes. `path` is
/// for messages.
///
/// # Errors
/// [`Error::Content`] with the line for anything that is no PLY header, and if the file is too short for the counts
/// that the header promises: what is allocated afterwards is bounded by the file's length.
pub fn parse(path: &Path, bytes: &[u8], size: u64) -> Result<Header> {
    let mut lines = HeaderLines { path, bytes, at: 0, line: 0 };
    if lines.next()?.trim_ascii() != b"ply" {
        return Err(lines.fail("not a PLY file: its first line is not \"ply\""));
    }
    let mut format = None;
    let mut elements: Vec<Element> = Vec::new();
    loop {
        let text = String::from_utf8_lossy(lines.next()?);
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        match words[..] {
            ["end_header"] => break,
            [] | ["comment" | "obj_info", ..] => {}
            ["format", name, _version] => {
                format = Some(parse_format(name).map_err(|e| lines.fail(e))?);
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| {
                    lines.fail(format!("element {name}: \"{count}\" is not a number of records"))
                })?;
                elements.push(Element { name: name.to_string(), count, properties: Vec::new() });
            }
            ["property", ref rest @ ..] => {
                let property = parse_property(rest).map_err(|e| lines.fail(e))?;
                let element =
                    elements.last_mut().ok_or_else(|| lines.fail("a property before any element"))?;
                element.properties.push(property);
            }
            [word, ..] => {
                let known = ["comment", "element", "end_header", "format", "obj_info", "property"];
                let message = if known.contains(&word) {
                    format!("\"{}\" has the wrong number of words", text.trim())
                } else {
                    unknown_name("header line", word, known)
                };
                return Err(lines.fail(message));
            }
        }
    }
    let format = format.ok_or_else(|| lines.fail("the header has no format line"))?;
    let header = Header { format, elements, body: lines.at };
    check_size(path, &header, size.saturating_sub(header.body as u64))?;
    Ok(header)
}

fn parse_format(name: &str) -> Result<Format, String> {
    match name {
        "ascii" => Ok(Format::Ascii),
        "binary_little_endian" => Ok(Format::LittleEndian),
        "binary_big_endian" => Ok(Format::BigEndian),
        _ => Err(unknown_name("format", name, ["ascii", "binary_big_endian", "binary_little_endian"])),
    }
}

fn parse_scalar(name: &str) -> Result<Scalar, String> {
    let found = Scalar::NAMES.iter().find(|(known, _)| *known == name);
    found
        .map(|(_, kind)| *kind)
        .ok_or_else(|| unknown_name("type", name, Scalar::NAMES.iter().map(|(known, _)| *known)))
}

fn parse_property(words: &[&str]) -> Result<Property, String> {
    match *words {
        ["list", length, item, name] => {
            let kind = Kind::List { length: parse_scalar(length)?, item: parse_scalar(item)? };
            if !parse_scalar(length)?.is_integer() {
                return Err(format!("list {name}: its length has the type {length}, but must be an integer"));
            }
            Ok(Property { name: name.to_string(), kind })
        }
        [kind, name] => Ok(Property { name: name.to_string(), kind: Kind::Number(parse_scalar(kind)?) }),
        _ => Err("a property is \"property TYPE NAME\" or \"property list TYPE TYPE NAME\"".to_string()),
    }
}

/// Counts against the length of the body. In text a number takes at least a digit and a blank.
fn check_size(path: &Path, header: &Header, body: u64) -> Result<()> {
    let mut needed = 0u64;
    for element in &header.elements {
        let record = match header.format {
            Format::Ascii => 2 * element.properties.len(),
            _ => element.min_stride(),
        };
        needed = needed.saturating_add((element.count as u64).saturating_mul(record as u64));
        // The last number of a text needs no blank after it.
        if needed > body + 1 {
            return Err(Error::content(
                path,
                format!(
                    "cut short or damaged: the header promises {} records of {}, at least {needed} bytes up to there, \
                     but {body} follow it",
                    element.count, element.name
                ),
            ));
        }
    }
    Ok(())
}

/// Lines of the header, ended as the first one is: by LF, CR LF, or CR alone.
struct HeaderLines<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
    line: usize,
}

impl<'a> HeaderLines<'a> {
    fn next(&mut self) -> Result<&'a [u8]> {
        let rest = &self.bytes[self.at..self.bytes.len().min(MAX_HEADER)];
        self.line += 1;
        // A CR alone ends a line only in a file that starts "ply CR": after "end_header CR" binary data may
        // begin with the byte of an LF.
        let only_cr = self.bytes.starts_with(b"ply\r") && self.bytes.get(4) != Some(&b'\n');
        let end = if only_cr { b'\r' } else { b'\n' };
        let Some(length) = rest.iter().position(|&b| b == end) else {
            // A text file may end right after "end_header".
            if rest.trim_ascii() == b"end_header" {
                self.at = self.bytes.len();
                return Ok(rest);
            }
            return Err(self.fail(if self.line == 1 {
                "not a PLY file: its first line is not \"ply\""
            } else {
                "the header has no end: there is no line \"end_header\""
            }));
        };
        self.at += length + 1;
        Ok(&rest[..length])
    }

    fn fail(&self, message: impl Into<String>) -> Error {
        Error::content_at(self.path, self.line, 0, message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Header> {
        parse(Path::new("a.ply"), text.as_bytes(), text.len() as u64)
    }

    const GOOD: &str = "ply\nformat binary_big_endian 1.0\ncomment made by hand\nobj_info x\nelement vertex 2\n\
        property float x\nproperty list uint8 int32 l\nproperty uchar c\nend_header\n";

    #[test]
    fn a_header_reads_the_same_with_any_line_ending() {
        let body = "\n\0\r\0\0\0\0\0\0\0\0\0";
        for ending in ["\n", "\r\n", "\r"] {
            let head = GOOD.replace('\n', ending);
            let header = read(&(head.clone() + body)).unwrap();
            assert_eq!(header.format, Format::BigEndian);
            assert_eq!(header.body, head.len());
            let vertex = &header.elements[0];
            assert_eq!((vertex.count, vertex.stride(), vertex.min_stride()), (2, None, 6));
            assert_eq!(vertex.find("l"), Some(1));
            assert_eq!(vertex.properties[1].kind, Kind::List { length: Scalar::U8, item: Scalar::I32 });
        }
    }

    #[test]
    fn damaged_headers_are_refused_with_their_line() {
        let cases = [
            ("", "is not \"ply\""),
            ("plyx\n", "a.ply:1: not a PLY file"),
            ("ply\nformat ascii 1.0\n", "a.ply:3: the header has no end"),
            ("ply\nend_header\n", "no format line"),
            ("ply\nformat asci 1.0\nend_header\n", "did you mean \"ascii\"?"),
            (
                "ply\nformat ascii 1.0\nproperty float x\nend_header\n",
                "a.ply:3: a property before any element",
            ),
            ("ply\nformat ascii 1.0\nelement vertex -1\nend_header\n", "\"-1\" is not a number of records"),
            ("ply\nformat ascii 1.0\nelement vertex 99999999999999999999999\n", "is not a number of records"),
            ("ply\nformat ascii 1.0\nelement vertex 1\nproperty flaot x\n", "did you mean \"float\"?"),
            ("ply\nformat ascii 1.0\nelement vertex 1\nproperty list float int x\n", "must be an integer"),
            ("ply\nformat ascii 1.0\nelement vertex\n", "wrong number of words"),
            ("ply\nformat ascii 1.0\nelemant vertex 3\n", "did you mean \"element\"?"),
        ];
        for (text, want) in cases {
            let e = read(text).unwrap_err().to_string();
            assert!(e.contains(want), "{text:?}: {e}");
        }
    }

    #[test]
    fn promised_counts_are_held_against_the_length() {
        for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
            for count in ["4000000000", "18446744073709551615"] {
                let head = format!(
                    "ply\nformat {format} 1.0\nelement vertex {count}\nproperty float x\nproperty double y\nend_header\n"
                );
                let e = read(&head).unwrap_err().to_string();
                assert!(e.contains(&format!("promises {count} records of vertex")), "{e}");
            }
        }
    }
}
