//! The statements of a piece of an OBJ file, read without knowledge of what stands before it.

use super::columns::Corners;
use super::corners::{parse_corner, short_corner};
use super::numbers::{first_word, number};

/// What a corner refers to.
pub const KINDS: [&str; 3] = ["position", "texture coordinate", "normal"];
/// What statements that define those look like.
const FORMS: [&str; 3] = [
    "a position is \"v x y z\" with three numbers",
    "a texture coordinate is \"vt u v\" with numbers",
    "a normal is \"vn x y z\" with three numbers",
];

/// What is wrong, and the byte of the piece at which it stands.
#[derive(Debug)]
pub struct Problem {
    /// From the start of the piece.
    pub at: usize,
    /// Completes "file:line:column: ".
    pub message: String,
}

/// An index of a face that counts back from the statements so far, of which those before the piece are not known.
#[derive(Debug)]
pub struct Relative {
    /// Its corner, by number in the piece; `None` if that was left out.
    pub corner: Option<usize>,
    /// 0 position, 1 texture coordinate, 2 normal.
    pub kind: usize,
    /// As it stands there, negative.
    pub index: i64,
    /// Statements of its kind so far, within the piece.
    pub count: usize,
    /// Where its corner stands.
    pub at: usize,
}

/// The highest index of a kind that a face uses, from 1, and where its corner stands.
#[derive(Debug, Default, Clone, Copy)]
pub struct Highest {
    /// 0 if there is none.
    pub index: i64,
    /// From the start of the piece.
    pub at: usize,
}

/// What stands in a piece, up to its end or the first problem.
#[derive(Debug, Default)]
pub struct Piece {
    /// `v`, in double precision as the text may need it.
    pub positions: Vec<[f64; 3]>,
    /// `vt`
    pub uvs: Vec<[f32; 2]>,
    /// `vn`
    pub normals: Vec<[f32; 3]>,
    /// Of the faces with at least three.
    pub corners: Corners,
    /// Corners of each such face.
    pub arities: Arities,
    /// In file order.
    pub relative: Vec<Relative>,
    /// By kind, of indices that count from the start.
    pub highest: [Highest; 3],
    /// `usemtl` statements: the number of faces before each, where it stands, and its name.
    pub switches: Vec<(usize, usize, String)>,
    /// What `mtllib` statements say.
    pub libraries: Vec<String>,
    /// Points, lines and curves.
    pub not_surface: u64,
    /// Faces with fewer than three corners.
    pub bad_faces: u64,
    /// Lines read.
    pub lines: usize,
    /// What ended the reading early.
    pub problem: Option<Problem>,
}

/// How many corners each face has; no list while all have three.
#[derive(Debug, Default)]
pub struct Arities {
    /// Faces in all.
    pub faces: usize,
    /// By face; empty while all have three.
    pub list: Vec<u32>,
}

impl Arities {
    fn push(&mut self, corners: usize) {
        if corners != 3 || !self.list.is_empty() {
            self.list.resize(self.faces, 3);
            self.list.push(corners as u32);
        }
        self.faces += 1;
    }

    /// Adds those of `other`.
    pub fn append(&mut self, other: &Arities) {
        if !self.list.is_empty() || !other.list.is_empty() {
            self.list.resize(self.faces, 3);
            self.list.extend_from_slice(&other.list);
            self.list.resize(self.faces + other.faces, 3);
        }
        self.faces += other.faces;
    }
}

/// Reads `text`, which starts and ends with whole statements.
pub fn read(text: &[u8]) -> Piece {
    let mut reader = Reader { piece: Piece::default(), start: 0 };
    let mut at = 0;
    while at < text.len() {
        reader.start = at;
        let mut line = next_line(text, &mut at);
        reader.piece.lines += 1;
        let joined;
        if is_continued(line) && can_be_continued(line) {
            reader.piece.lines += pass_continuations(text, line, &mut at);
            joined = without_continuations(&text[reader.start..at]);
            line = &joined;
        }
        if let Err(problem) = reader.statement(line) {
            reader.piece.problem = Some(Problem { at: reader.start + problem.at, ..problem });
            break;
        }
    }
    reader.piece
}

/// The line at `at` without its end; steps behind it.
fn next_line<'a>(text: &'a [u8], at: &mut usize) -> &'a [u8] {
    let rest = &text[*at..];
    let length = memchr::memchr(b'\n', rest).unwrap_or(rest.len());
    *at = (*at + length + 1).min(text.len());
    &rest[..length]
}

/// Whether a line ends in a backslash.
#[inline(always)]
pub fn is_continued(line: &[u8]) -> bool {
    match line {
        [.., last] if last.is_ascii_whitespace() => line.trim_ascii_end().ends_with(b"\\"),
        [.., last] => *last == b'\\',
        [] => false,
    }
}

/// A backslash at the end of a comment, or of a name, is part of it.
fn can_be_continued(line: &[u8]) -> bool {
    let has_comment = line.split(u8::is_ascii_whitespace).any(|word| word.starts_with(b"#"));
    !has_comment && matches!(line.trim_ascii_start(), [b'v' | b'f' | b'l' | b'p', ..])
}

/// Steps behind the lines that continue `line`; returns how many.
fn pass_continuations(text: &[u8], line: &[u8], at: &mut usize) -> usize {
    let (mut line, mut count) = (line, 0);
    while is_continued(line) && *at < text.len() {
        line = next_line(text, at);
        count += 1;
    }
    count
}

/// The same text with blanks for the ends of lines and the backslashes before them: each word keeps its place.
fn without_continuations(text: &[u8]) -> Vec<u8> {
    let mut joined = Vec::with_capacity(text.len());
    for line in text.split_inclusive(|&b| b == b'\n') {
        let kept = if is_continued(line) {
            let end = line.trim_ascii_end();
            &end[..end.len() - 1]
        } else {
            line.strip_suffix(b"\n").unwrap_or(line)
        };
        joined.extend_from_slice(kept);
        joined.resize(joined.len() + line.len() - kept.len(), b' ');
    }
    joined
}

struct Reader {
    piece: Piece,
    /// Where the current statement starts.
    start: usize,
}

impl Reader {
    /// Reads a statement; the place of a problem is from its start.
    #[inline(always)]
    fn statement(&mut self, line: &[u8]) -> Result<(), Problem> {
        let start = skip_blanks(line, 0);
        match line[start..] {
            [b'v', b' ' | b'\t', ..] => self.position(line, start + 1),
            [b'v', b'n', b' ' | b'\t', ..] => self.normal(line, start + 2),
            [b'v', b't', b' ' | b'\t', ..] => self.uv(line, start + 2),
            [b'f', b' ' | b'\t', ..] => self.face(line, start + 1),
            [] | [b'#', ..] => Ok(()),
            _ => self.other(line, start),
        }
    }

    #[cold]
    fn other(&mut self, line: &[u8], start: usize) -> Result<(), Problem> {
        let keyword = first_word(&line[start..]);
        let behind = start + keyword.len();
        match keyword {
            b"v" => return self.position(line, behind),
            b"vn" => return self.normal(line, behind),
            b"vt" => return self.uv(line, behind),
            b"f" | b"fo" => return self.face(line, behind),
            b"usemtl" => {
                let place = (self.piece.arities.faces, self.start + start);
                self.piece.switches.push((place.0, place.1, text_of(&line[behind..])));
            }
            b"mtllib" => self.piece.libraries.push(text_of(&line[behind..])),
            b"l" | b"p" | b"curv" | b"curv2" | b"surf" => self.piece.not_surface += 1,
            _ => {}
        }
        Ok(())
    }

    fn position(&mut self, line: &[u8], behind: usize) -> Result<(), Problem> {
        self.piece.positions.push(vector(0, line, behind)?);
        Ok(())
    }

    fn uv(&mut self, line: &[u8], behind: usize) -> Result<(), Problem> {
        self.piece.uvs.push(vector(1, line, behind)?.map(|c| c as f32));
        Ok(())
    }

    fn normal(&mut self, line: &[u8], behind: usize) -> Result<(), Problem> {
        self.piece.normals.push(vector(2, line, behind)?.map(|c| c as f32));
        Ok(())
    }

    fn face(&mut self, line: &[u8], behind: usize) -> Result<(), Problem> {
        let (first, relative) = (self.piece.corners.len(), self.piece.relative.len());
        let mut at = behind;
        loop {
            at = skip_blanks(line, at);
            if matches!(line[at..], [] | [b'#', ..]) {
                break;
            }
            if let Some((corner, length)) = short_corner(&line[at..]) {
                self.raise(corner.map(i64::from), at);
                self.piece.corners.push(corner);
                at += length;
            } else {
                let word = first_word(&line[at..]);
                self.odd_corner(word, at)?;
                at += word.len();
            }
        }
        let count = self.piece.corners.len() - first;
        if count >= 3 {
            self.piece.arities.push(count);
        } else {
            self.piece.corners.truncate(first);
            self.piece.relative[relative..].iter_mut().for_each(|r| r.corner = None);
            self.piece.bad_faces += 1;
        }
        Ok(())
    }

    /// A corner with signs or very long numbers.
    #[cold]
    fn odd_corner(&mut self, word: &[u8], at: usize) -> Result<(), Problem> {
        let corner = parse_corner(word).map_err(|message| Problem { at, message })?;
        let counts = [self.piece.positions.len(), self.piece.uvs.len(), self.piece.normals.len()];
        for (kind, (&index, &count)) in corner.iter().zip(&counts).enumerate().filter(|(_, (i, _))| **i < 0) {
            let corner = Some(self.piece.corners.len());
            self.piece.relative.push(Relative { corner, kind, index, count, at: self.start + at });
        }
        self.raise(corner, at);
        // A number that is too large is an error in the end, by `highest`; a negative one is set later.
        let stored = corner.map(|i| u32::try_from(i.unsigned_abs()).unwrap_or(u32::MAX));
        self.piece.corners.push_unsettled(stored);
        Ok(())
    }

    #[inline(always)]
    fn raise(&mut self, corner: [i64; 3], at: usize) {
        for (highest, index) in self.piece.highest.iter_mut().zip(corner) {
            if index > highest.index {
                *highest = Highest { index, at: self.start + at };
            }
        }
    }
}

#[inline(always)]
fn skip_blanks(line: &[u8], mut at: usize) -> usize {
    while line.get(at).is_some_and(u8::is_ascii_whitespace) {
        at += 1;
    }
    at
}

/// The numbers behind the keyword of a `v`, `vt` or `vn`: also with a weight, a colour or a comment behind them, none
/// of which we use.
#[inline(always)]
fn vector<const N: usize>(kind: usize, line: &[u8], behind: usize) -> Result<[f64; N], Problem> {
    let mut values = [0.0; N];
    let mut at = behind;
    for value in &mut values {
        at = skip_blanks(line, at);
        match number(&line[at..]) {
            Some((number, length)) => (*value, at) = (number, at + length),
            None => return odd_vector(kind, line, behind),
        }
    }
    Ok(values)
}

/// The same for what is short, odd or wrong.
#[cold]
fn odd_vector<const N: usize>(kind: usize, line: &[u8], behind: usize) -> Result<[f64; N], Problem> {
    let mut values = [0.0; N];
    let mut at = skip_blanks(line, behind);
    let mut found = 0;
    let mut problem = None;
    while at < line.len() && line[at] != b'#' {
        let word = first_word(&line[at..]);
        if let Some(value) = values.get_mut(found) {
            match number(word) {
                Some((number, _)) => *value = number,
                // What the C runtime of Windows writes for a NaN (1.#QNAN, -1.#IND) or an infinity.
                None if word.contains(&b'#') => *value = f64::NAN,
                None => {
                    problem
                        .get_or_insert(Problem { at, message: format!("{}: {}", FORMS[kind], shown(word)) });
                }
            }
        }
        found += 1;
        at = skip_blanks(line, at + word.len());
    }
    // The second of two texture coordinates is 0 where absent, by the format's description.
    let needed = if kind == 1 { 1 } else { N };
    if found < needed {
        let message = format!("a {} needs {N} numbers, here are {found}", KINDS[kind]);
        return Err(Problem { at: skip_blanks(line, 0), message });
    }
    problem.map_or(Ok(values), Err)
}

fn shown(word: &[u8]) -> String {
    let text = String::from_utf8_lossy(&word[..word.len().min(40)]);
    format!("\"{}\" is none", text.escape_debug())
}

/// A name, which may hold blanks; bytes that are not UTF-8 become the same mark in every file.
fn text_of(rest: &[u8]) -> String {
    String::from_utf8_lossy(rest.trim_ascii()).into_owned()
}
