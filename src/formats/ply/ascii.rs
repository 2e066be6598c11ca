//! The body of an ascii PLY. Files with one record a line, as all writers make them, are read in parallel; what
//! that reader does not like goes to the general one, which splits at blanks only and gives each error its line.
//! What even that cannot make sense of is tried once more with the rest of each line passed over: some writers put
//! more into a line than they declare.

use super::faces::Faces;
use super::header::{Element, Kind};
use super::words::read_words;
use super::{Columns, Plan, Role, Tables, Text, is_far_away};
use crate::base::mesh_data::Positions;
use crate::error::Result;
use fast_float2::FastFloat;
use rayon::prelude::*;

/// Lines that one task reads.
const PIECE: usize = 1 << 14;
/// Bytes in which line ends are counted together.
const BLOCK: usize = 1 << 16;

/// Reads all elements.
pub fn read(plan: &Plan, text: Text) -> Result<Tables> {
    if let Some(tables) = read_lines(plan, text) {
        return Ok(tables);
    }
    let by_words = read_words(plan, text, false);
    // Words left over mean that some line held more than was declared, unless reading by lines finds the same.
    if matches!(by_words, Ok((_, true))) {
        return by_words.map(|(tables, _)| tables);
    }
    match read_words(plan, text, true) {
        Ok((tables, _)) => Ok(tables),
        Err(_) => by_words.map(|(tables, _)| tables),
    }
}

/// The fast reader; `None` where the file needs the general one, be it odd or damaged.
fn read_lines(plan: &Plan, text: Text) -> Option<Tables> {
    let lines = Lines::new(&text.bytes[text.body..]);
    let mut tables = Tables::new(plan);
    let mut line = 0;
    for (element, role) in &plan.elements {
        // An element without properties is written as so many empty lines, or none; let words decide.
        if element.properties.is_empty() {
            return None;
        }
        let pieces = lines.pieces(line, element.count)?;
        match *role {
            Role::Vertices(columns) => read_vertices(element, columns, &pieces, &mut tables)?,
            Role::Faces { indices, wedge_uvs: None } => {
                let read = |piece: &&[u8]| face_piece(plan, element, indices, piece);
                let parts: Option<Vec<Faces>> = pieces.par_iter().map(read).collect();
                parts?.into_iter().for_each(|part| tables.faces.append(part));
            }
            Role::Faces { .. } | Role::Strips { .. } => return None,
            Role::Skip => {}
        }
        line += element.count;
    }
    Some(tables)
}

/// Where the lines of a text start.
struct Lines<'a> {
    text: &'a [u8],
    /// Line ends before each block, and in all.
    before: Vec<usize>,
}

impl<'a> Lines<'a> {
    fn new(text: &'a [u8]) -> Self {
        let ends = |block: &[u8]| block.iter().filter(|&&b| b == b'\n').count();
        let counts: Vec<usize> = text.par_chunks(BLOCK).map(ends).collect();
        let mut before = vec![0];
        before.extend(counts.iter().scan(0, |sum, count| {
            *sum += count;
            Some(*sum)
        }));
        Lines { text, before }
    }

    /// Byte at which line `line` (from 0) starts; the text's end counts as one more start.
    fn start(&self, line: usize) -> Option<usize> {
        if line == 0 {
            return Some(0);
        }
        let ends = *self.before.last()?;
        if line > ends {
            // The last line may lack its end.
            return (line == ends + 1 && !self.text.ends_with(b"\n")).then_some(self.text.len());
        }
        // The block that holds the end of the line before.
        let block = self.before.partition_point(|&ends| ends < line) - 1;
        let from = block * BLOCK;
        let nth = line - self.before[block] - 1;
        let mut ends = self.text[from..].iter().enumerate().filter(|(_, b)| **b == b'\n');
        ends.nth(nth).map(|(i, _)| from + i + 1)
    }

    /// `count` lines from `line` on, in pieces of [`PIECE`] lines (the last may be shorter).
    fn pieces(&self, line: usize, count: usize) -> Option<Vec<&'a [u8]>> {
        let firsts = (0..count).step_by(PIECE);
        firsts
            .map(|first| {
                let end = (first + PIECE).min(count);
                self.text.get(self.start(line + first)?..self.start(line + end)?)
            })
            .collect()
    }
}

/// A position's component, in the precision in which it is kept.
trait Component: FastFloat + Copy + Default + Send + Into<f64> {
    fn keep(positions: Vec<[Self; 3]>) -> Positions;
    fn to_f32(self) -> f32;
}

impl Component for f32 {
    fn keep(positions: Vec<[f32; 3]>) -> Positions {
        Positions::F32(positions)
    }
    fn to_f32(self) -> f32 {
        self
    }
}

impl Component for f64 {
    fn keep(positions: Vec<[f64; 3]>) -> Positions {
        Positions::F64(positions)
    }
    fn to_f32(self) -> f32 {
        self as f32
    }
}

fn read_vertices(element: &Element, columns: Columns, pieces: &[&[u8]], tables: &mut Tables) -> Option<()> {
    if columns.single {
        let positions = read_columns::<f32>(element, columns, pieces, tables)?;
        if !is_far_away(&positions) {
            tables.positions = f32::keep(positions);
            return Some(());
        }
    }
    tables.positions = f64::keep(read_columns::<f64>(element, columns, pieces, tables)?);
    Some(())
}

/// What one task fills.
struct VertexPiece<'a, T> {
    text: &'a [u8],
    positions: &'a mut [[T; 3]],
    normals: &'a mut [[f32; 3]],
    uvs: &'a mut [[f32; 2]],
}

fn read_columns<T: Component>(
    element: &Element,
    columns: Columns,
    pieces: &[&[u8]],
    tables: &mut Tables,
) -> Option<Vec<[T; 3]>> {
    let count = element.count;
    let mut positions = vec![[T::default(); 3]; count];
    tables.normals = vec![[0.0; 3]; if columns.normal.is_some() { count } else { 0 }];
    tables.uvs = vec![[0.0; 2]; if columns.uv.is_some() { count } else { 0 }];
    let mut rows = RowReader { wanted: vec![false; element.properties.len()] };
    let uv = columns.uv.iter().flatten();
    for &i in columns.position.iter().chain(columns.normal.iter().flatten()).chain(uv) {
        rows.wanted[i] = true;
    }
    // Lists among the numbers of a vertex are for the general reader.
    element.stride()?;
    let mut tasks = Vec::new();
    let (mut p, mut n, mut t) = (&mut positions[..], &mut tables.normals[..], &mut tables.uvs[..]);
    for text in pieces {
        tasks.push(VertexPiece {
            text,
            positions: take_piece(&mut p),
            normals: take_piece(&mut n),
            uvs: take_piece(&mut t),
        });
    }
    tasks.into_par_iter().map(|task| rows.fill(columns, task)).collect::<Option<()>>()?;
    Some(positions)
}

fn take_piece<'a, T>(rest: &mut &'a mut [T]) -> &'a mut [T] {
    let all = std::mem::take(rest);
    let (piece, left) = all.split_at_mut(all.len().min(PIECE));
    *rest = left;
    piece
}

/// Reads lines of numbers, parsing only those that are wanted.
struct RowReader {
    wanted: Vec<bool>,
}

impl RowReader {
    fn fill<T: Component>(&self, columns: Columns, task: VertexPiece<T>) -> Option<()> {
        let mut cursor = Cursor { rest: task.text };
        let mut row = vec![T::default(); self.wanted.len()];
        for i in 0..task.positions.len() {
            for (value, wanted) in row.iter_mut().zip(&self.wanted) {
                if *wanted {
                    *value = cursor.float()?;
                } else {
                    cursor.skip()?;
                }
            }
            cursor.end_line()?;
            task.positions[i] = columns.position.map(|k| row[k]);
            if let (Some(at), Some(normal)) = (columns.normal, task.normals.get_mut(i)) {
                *normal = at.map(|k| row[k].to_f32());
            }
            if let (Some(at), Some(uv)) = (columns.uv, task.uvs.get_mut(i)) {
                *uv = at.map(|k| row[k].to_f32());
            }
        }
        Some(())
    }
}

fn face_piece(plan: &Plan, element: &Element, indices: usize, text: &[u8]) -> Option<Faces> {
    let mut faces = Faces::new(plan.vertices, PIECE.min(element.count));
    let mut cursor = Cursor { rest: text };
    let mut corners = Vec::new();
    while !cursor.rest.is_empty() {
        for (i, property) in element.properties.iter().enumerate() {
            match property.kind {
                Kind::List { .. } => {
                    let length = cursor.integer()?;
                    corners.clear();
                    for _ in 0..length {
                        if i == indices {
                            corners.push(cursor.integer()?);
                        } else {
                            cursor.skip()?;
                        }
                    }
                    if i == indices {
                        faces.push(&corners).ok()?;
                    }
                }
                Kind::Number(_) => cursor.skip()?,
            }
        }
        cursor.end_line()?;
    }
    Some(faces)
}

/// A place in a text of lines; every method returns `None` where the text is not as expected.
struct Cursor<'a> {
    rest: &'a [u8],
}

impl Cursor<'_> {
    #[inline(always)]
    fn skip_blanks(&mut self) {
        while let [b' ' | b'\t', rest @ ..] = self.rest {
            self.rest = rest;
        }
    }

    /// Whether a number ends here.
    #[inline(always)]
    fn at_gap(&self) -> Option<()> {
        matches!(self.rest, [] | [b' ' | b'\t' | b'\n' | b'\r', ..]).then_some(())
    }

    #[inline(always)]
    fn float<T: FastFloat>(&mut self) -> Option<T> {
        self.skip_blanks();
        let (value, length) = fast_float2::parse_partial(self.rest).ok()?;
        self.rest = &self.rest[length..];
        self.at_gap()?;
        Some(value)
    }

    /// A number of digits only, below 2^32.
    #[inline(always)]
    fn integer(&mut self) -> Option<u32> {
        self.skip_blanks();
        let before = self.rest.len();
        let mut value = 0u64;
        while let [digit @ b'0'..=b'9', rest @ ..] = self.rest {
            value = value.wrapping_mul(10).wrapping_add(u64::from(digit - b'0'));
            self.rest = rest;
        }
        self.at_gap()?;
        // Ten digits have not wrapped.
        let digits = before - self.rest.len();
        if (1..=10).contains(&digits) { u32::try_from(value).ok() } else { None }
    }

    #[inline(always)]
    fn skip(&mut self) -> Option<()> {
        self.skip_blanks();
        let before = self.rest.len();
        while let [1..=8 | 11 | 12 | 14..=31 | 33..=255, rest @ ..] = self.rest {
            self.rest = rest;
        }
        (self.rest.len() < before).then_some(())
    }

    #[inline(always)]
    fn end_line(&mut self) -> Option<()> {
        while let [b' ' | b'\t' | b'\r', rest @ ..] = self.rest {
            self.rest = rest;
        }
        match self.rest {
            [] => Some(()),
            [b'\n', rest @ ..] => {
                self.rest = rest;
                Some(())
            }
            _ => None,
        }
    }
}
