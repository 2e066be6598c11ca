//! The statements of an OBJ file as `tobj` can take them: a reader that hands out one line after another.

use super::corners::{Corner, parse_corner};
use super::face_materials::FaceMaterials;
use crate::base::mesh_data::Repairs;
use crate::error::{Error, Result};
use std::borrow::Cow;
use std::io::{BufRead, Read};
use std::path::Path;

/// What is done with the texture coordinates, or the normals, of all corners.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Treatment {
    /// Handed on as they are.
    #[default]
    Keep,
    /// Only some corners have one: the others refer to a zero put before all.
    FillIn,
    /// Corners refer to some, but the file defines none: left out.
    LeaveOut,
}

/// How faces are rewritten; not at all if both are kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Rewrite {
    /// Of texture coordinates.
    pub uvs: Treatment,
    /// Of normals.
    pub normals: Treatment,
}

/// What a corner refers to.
const KINDS: [&str; 3] = ["position", "texture coordinate", "normal"];
/// The statements that define those, and the numbers each needs.
const STATEMENTS: [(&str, usize); 3] = [("v", 3), ("vt", 2), ("vn", 3)];

/// A reader of the cleaned text, and what it saw on the way.
pub struct ObjLines<'a> {
    path: &'a Path,
    text: &'a [u8],
    /// Start of the next line, the number of lines before it, and that of the current statement.
    at: usize,
    lines: usize,
    line: usize,
    rewrite: Rewrite,
    /// The current line as handed out, and how much of it has been taken.
    out: Cow<'a, [u8]>,
    taken: usize,
    error: Option<Error>,
    /// Statements `v`, `vt`, `vn` so far.
    counts: [i64; 3],
    /// The highest index used, from 1, and its line: a face may stand before its vertices.
    highest: [(i64, usize); 3],
    /// Corners of all faces, and those of them that have each attribute.
    corners: u64,
    given: [u64; 3],
    faces: usize,
    repairs: Repairs,
    materials: FaceMaterials,
    libraries: Vec<String>,
}

/// What becomes of a statement.
enum Verdict {
    Keep,
    Drop,
    Replace(Vec<u8>),
}

impl<'a> ObjLines<'a> {
    /// Over the text of a file; `path` is for messages.
    pub fn new(path: &'a Path, text: &'a [u8], rewrite: Rewrite) -> Self {
        let uv = if rewrite.uvs == Treatment::FillIn { "vt 0 0\n" } else { "" };
        let normal = if rewrite.normals == Treatment::FillIn { "vn 0 0 0\n" } else { "" };
        ObjLines {
            path,
            text,
            at: 0,
            lines: 0,
            line: 0,
            rewrite,
            out: Cow::Owned(format!("{uv}{normal}").into_bytes()),
            taken: 0,
            error: None,
            counts: [0; 3],
            highest: [(0, 0); 3],
            corners: 0,
            given: [0; 3],
            faces: 0,
            repairs: Repairs::default(),
            materials: FaceMaterials::default(),
            libraries: Vec::new(),
        }
    }

    /// The error that stopped the reading, or an index beyond the end of its list.
    pub fn check(&mut self) -> Result<()> {
        if let Some(error) = self.error.take() {
            return Err(error);
        }
        for (i, kind) in KINDS.into_iter().enumerate() {
            let ((index, line), count) = (self.highest[i], self.counts[i]);
            // References to normals or texture coordinates of which there are none at all are left out.
            if index > count && (i == 0 || count > 0) {
                let message = format!("there is no {kind} {index}; the file has {count}");
                return Err(Error::content_at(self.path, line, 0, message));
            }
        }
        if self.corners > u64::from(u32::MAX) {
            return Err(Error::content(self.path, "it has more corners than an index of 32 bits reaches"));
        }
        Ok(())
    }

    /// An error at the current line.
    pub fn fail(&self, message: impl Into<String>) -> Error {
        Error::content_at(self.path, self.line, 0, message)
    }

    /// How faces must be rewritten; if at all, the file must be read again.
    pub fn rewrite_needed(&self) -> Rewrite {
        let treatment = |kind: usize| match self.given[kind] {
            0 => Treatment::Keep,
            _ if self.counts[kind] == 0 => Treatment::LeaveOut,
            given if given < self.corners => Treatment::FillIn,
            _ => Treatment::Keep,
        };
        Rewrite { uvs: treatment(1), normals: treatment(2) }
    }

    /// Corners whose texture coordinate was filled in, and those with an attribute left out. (Normals filled in are
    /// counted where they are computed.)
    pub fn changed_corners(&self) -> u64 {
        let left_out = |treatment, given| if treatment == Treatment::LeaveOut { given } else { 0 };
        let filled = if self.rewrite.uvs == Treatment::FillIn { self.corners - self.given[1] } else { 0 };
        filled + left_out(self.rewrite.uvs, self.given[1]) + left_out(self.rewrite.normals, self.given[2])
    }

    /// Faces handed out.
    pub fn faces(&self) -> usize {
        self.faces
    }

    /// Vertex positions in the file.
    pub fn positions(&self) -> i64 {
        self.counts[0]
    }

    /// Faces and elements that were left out.
    pub fn repairs(&self) -> Repairs {
        self.repairs
    }

    /// What the `mtllib` statements say.
    pub fn libraries(&self) -> &[String] {
        &self.libraries
    }

    /// Which face has which material.
    pub fn materials(&self) -> &FaceMaterials {
        &self.materials
    }

    /// Goes to the next line that `tobj` is to see. At the end, or after an error, that is an empty one.
    fn advance(&mut self) {
        self.taken = 0;
        self.out = Cow::Borrowed(b"");
        while self.error.is_none() && self.at < self.text.len() {
            let statement = self.next_statement();
            match self.judge(&statement) {
                Ok(Verdict::Drop) => {}
                Ok(Verdict::Keep) => {
                    self.out = statement;
                    return;
                }
                Ok(Verdict::Replace(line)) => {
                    self.out = Cow::Owned(line);
                    return;
                }
                Err(message) => self.error = Some(self.fail(message)),
            }
        }
    }

    /// The next line; where it ends in a backslash, with those that continue it.
    fn next_statement(&mut self) -> Cow<'a, [u8]> {
        self.line = self.lines + 1;
        let first = self.next_line();
        // A backslash at the end of a comment is part of it.
        if !is_continued(first)
            || has_comment(first)
            || !matches!(first.trim_ascii_start(), [b'v' | b'f' | b'l' | b'p', ..])
        {
            return Cow::Borrowed(first);
        }
        let mut whole = Vec::new();
        let mut part = first;
        while is_continued(part) && self.at < self.text.len() {
            whole.extend_from_slice(part.trim_ascii_end().strip_suffix(b"\\").unwrap_or(part));
            whole.push(b' ');
            part = self.next_line();
        }
        whole.extend_from_slice(part.trim_ascii_end().strip_suffix(b"\\").unwrap_or(part.trim_ascii_end()));
        whole.push(b'\n');
        Cow::Owned(whole)
    }

    /// The next line with its end.
    fn next_line(&mut self) -> &'a [u8] {
        let rest = &self.text[self.at..];
        let length = rest.iter().position(|&b| b == b'\n').map_or(rest.len(), |end| end + 1);
        self.at += length;
        self.lines += 1;
        &rest[..length]
    }

    fn judge(&mut self, statement: &[u8]) -> Result<Verdict, String> {
        let line = statement.trim_ascii();
        let (keyword, rest) =
            line.split_at(line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len()));
        match keyword {
            b"v" => self.vector(0, rest),
            b"vt" => self.vector(1, rest),
            b"vn" => self.vector(2, rest),
            b"f" | b"fo" => self.face(rest),
            b"usemtl" => {
                self.materials.switch_to(text_of(rest));
                Ok(Verdict::Drop)
            }
            b"mtllib" => {
                self.libraries.push(text_of(rest));
                Ok(Verdict::Drop)
            }
            b"l" | b"p" | b"curv" | b"curv2" | b"surf" => {
                self.repairs.not_surface += 1;
                Ok(Verdict::Drop)
            }
            _ => Ok(Verdict::Drop),
        }
    }

    /// `v x y z`, also with a weight or a colour behind, neither of which we use; `vt u [v [w]]`; `vn x y z`.
    fn vector(&mut self, kind: usize, rest: &[u8]) -> Result<Verdict, String> {
        let (keyword, needed) = STATEMENTS[kind];
        self.counts[kind] += 1;
        let found = words(rest).count();
        let plain =
            found == needed && words(rest).all(|w| w.is_ascii() && !w.contains(&b'#')) && !has_comment(rest);
        if plain {
            return Ok(Verdict::Keep);
        }
        // The second of two texture coordinates is 0 where absent, by the format's description.
        let optional = usize::from(kind == 1);
        if found < needed - optional {
            return Err(format!("a {} needs {needed} numbers, here are {found}", KINDS[kind]));
        }
        let mut line = keyword.as_bytes().to_vec();
        for word in words(rest).chain([&b"0"[..]; 1]).take(needed) {
            line.push(b' ');
            // What the C runtime of Windows writes for a NaN (1.#QNAN, -1.#IND) or an infinity.
            line.extend_from_slice(if word.contains(&b'#') { b"nan" } else { word });
        }
        line.push(b'\n');
        Ok(Verdict::Replace(line))
    }

    fn face(&mut self, rest: &[u8]) -> Result<Verdict, String> {
        let mut corners = 0;
        let mut given = [0; 3];
        let rewriting = self.rewrite != Rewrite::default() || has_comment(rest);
        let mut line = if rewriting { b"f".to_vec() } else { Vec::new() };
        for word in words(rest) {
            let corner = parse_corner(word, self.counts)?;
            corners += 1;
            for kind in 0..3 {
                given[kind] += u64::from(corner[kind] != 0);
                if corner[kind] > self.highest[kind].0 {
                    self.highest[kind] = (corner[kind], self.line);
                }
            }
            if rewriting {
                self.write_corner(corner, &mut line);
            }
        }
        if corners < 3 {
            self.repairs.bad_faces += 1;
            return Ok(Verdict::Drop);
        }
        self.corners += corners;
        for (sum, count) in self.given.iter_mut().zip(given) {
            *sum += count;
        }
        self.faces += 1;
        self.materials.count_face()?;
        line.push(b'\n');
        Ok(if rewriting { Verdict::Replace(line) } else { Verdict::Keep })
    }

    /// A corner with indices from the start of the file; the zero put before all has number 1.
    fn write_corner(&self, corner: Corner, line: &mut Vec<u8>) {
        let [position, uv, normal] = corner;
        let number = |index: i64, treatment| match (index, treatment) {
            (_, Treatment::LeaveOut) | (0, Treatment::Keep) => String::new(),
            (index, Treatment::Keep) => index.to_string(),
            (index, Treatment::FillIn) => (index + 1).to_string(),
        };
        let (uv, normal) = (number(uv, self.rewrite.uvs), number(normal, self.rewrite.normals));
        line.extend_from_slice(format!(" {position}/{uv}/{normal}").as_bytes());
    }
}

impl Read for ObjLines<'_> {
    fn read(&mut self, buf: &mut [u8]) -> std::io::Result<usize> {
        let taken = self.fill_buf()?.read(buf)?;
        self.consume(taken);
        Ok(taken)
    }
}

impl BufRead for ObjLines<'_> {
    fn fill_buf(&mut self) -> std::io::Result<&[u8]> {
        if self.taken == self.out.len() {
            self.advance();
        }
        Ok(&self.out[self.taken..])
    }

    fn consume(&mut self, amount: usize) {
        self.taken += amount;
    }
}

/// The words of a statement up to a comment.
fn words(rest: &[u8]) -> impl Iterator<Item = &[u8]> {
    rest.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).take_while(|word| word[0] != b'#')
}

/// A comment starts a word; a `#` within one does not start a comment.
fn has_comment(rest: &[u8]) -> bool {
    rest.contains(&b'#') && rest.split(u8::is_ascii_whitespace).any(|word| word.starts_with(b"#"))
}

fn is_continued(line: &[u8]) -> bool {
    line.trim_ascii_end().ends_with(b"\\")
}

/// A name, which may hold blanks; bytes that are not UTF-8 become the same mark in every file.
fn text_of(rest: &[u8]) -> String {
    String::from_utf8_lossy(rest.trim_ascii()).into_owned()
}
