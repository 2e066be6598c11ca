//! The body of a binary PLY, of either byte order: tables without lists column by column, faces in one loop.

use super::faces::{BadIndex, Faces};
use super::general::{Values, read_element};
use super::header::{Element, Format, Kind, Scalar};
use super::{Columns, Plan, Role, Tables};
use crate::base::mesh_data::Positions;
use crate::error::{Error, Result};
use std::path::Path;

/// Reads all elements.
pub fn read(plan: &Plan) -> Result<Tables> {
    let mut tables = Tables::new(plan);
    let big = plan.format == Format::BigEndian;
    let mut bytes = Bytes { path: plan.path, bytes: plan.bytes, at: plan.body, big };
    for (element, role) in &plan.elements {
        match (*role, element.stride()) {
            (Role::Vertices(columns), Some(stride)) => {
                read_vertices(columns, element, bytes.take_table(element, stride)?, big, &mut tables);
            }
            (_, Some(stride)) => {
                bytes.take_table(element, stride)?;
            }
            (Role::Faces { indices, wedge_uvs: None }, None) if lists(element) == 1 => {
                read_faces(plan, element, indices, &mut bytes, &mut tables.faces)?;
            }
            (_, None) => read_element(plan, element, *role, &mut bytes, &mut tables)?,
        }
    }
    Ok(tables)
}

fn lists(element: &Element) -> usize {
    element.properties.iter().filter(|p| matches!(p.kind, Kind::List { .. })).count()
}

/// The bytes of a file and how far they are read.
struct Bytes<'a> {
    path: &'a Path,
    bytes: &'a [u8],
    at: usize,
    big: bool,
}

impl<'a> Bytes<'a> {
    /// All records of an element without lists.
    fn take_table(&mut self, element: &Element, stride: usize) -> Result<&'a [u8]> {
        let rest = &self.bytes[self.at..];
        let table = element.count.checked_mul(stride).and_then(|size| rest.get(..size)).ok_or_else(|| {
            let whole = rest.len() / stride.max(1);
            self.fail(format!(
                "cut short: {whole} of {} records of {} are there",
                element.count, element.name
            ))
        })?;
        self.at += table.len();
        Ok(table)
    }
}

impl Values for Bytes<'_> {
    fn number(&mut self, kind: Scalar) -> Result<f64, String> {
        let value = self.bytes[self.at..].get(..kind.size()).ok_or("the file is cut short here")?;
        self.at += kind.size();
        Ok(number_at(value, 0, kind, self.big))
    }

    fn can_hold(&self, count: usize, kind: Scalar) -> bool {
        count <= (self.bytes.len() - self.at) / kind.size()
    }

    fn fail(&self, message: String) -> Error {
        Error::content(self.path, format!("{message} (at byte {})", self.at))
    }
}

/// The number of type `kind` at byte `at`; an `f64` holds each exactly. Panics if the bytes end before.
#[inline(always)]
fn number_at(bytes: &[u8], at: usize, kind: Scalar, big: bool) -> f64 {
    #[inline(always)]
    fn take<const N: usize>(bytes: &[u8], at: usize, big: bool) -> [u8; N] {
        let mut value = [0; N];
        value.copy_from_slice(&bytes[at..at + N]);
        if big {
            value.reverse();
        }
        value
    }
    match kind {
        Scalar::I8 => f64::from(bytes[at] as i8),
        Scalar::U8 => f64::from(bytes[at]),
        Scalar::I16 => f64::from(i16::from_le_bytes(take(bytes, at, big))),
        Scalar::U16 => f64::from(u16::from_le_bytes(take(bytes, at, big))),
        Scalar::I32 => f64::from(i32::from_le_bytes(take(bytes, at, big))),
        Scalar::U32 => f64::from(u32::from_le_bytes(take(bytes, at, big))),
        Scalar::F32 => f64::from(f32::from_le_bytes(take(bytes, at, big))),
        Scalar::F64 => f64::from_le_bytes(take(bytes, at, big)),
    }
}

fn read_vertices(columns: Columns, element: &Element, table: &[u8], big: bool, tables: &mut Tables) {
    let table = Table { element, bytes: table, stride: element.stride().unwrap_or(1).max(1), big };
    tables.positions = if columns.single {
        Positions::F32(table.columns_f32(columns.position))
    } else {
        Positions::F64(table.columns(columns.position))
    };
    if let Some(normal) = columns.normal {
        tables.normals = table.columns_f32(normal);
    }
    if let Some(uv) = columns.uv {
        tables.uvs = table.columns_f32(uv);
    }
}

/// Records without lists.
struct Table<'a> {
    element: &'a Element,
    bytes: &'a [u8],
    stride: usize,
    big: bool,
}

impl Table<'_> {
    /// The named properties of each record as floats.
    fn columns_f32<const N: usize>(&self, properties: [usize; N]) -> Vec<[f32; N]> {
        let is_f32 = |&i: &usize| self.element.properties[i].kind == Kind::Number(Scalar::F32);
        if self.big || !properties.iter().all(is_f32) {
            let wide: Vec<[f64; N]> = self.columns(properties);
            return wide.into_iter().map(|row| row.map(|c| c as f32)).collect();
        }
        let offsets = properties.map(|i| self.element.offset(i));
        let first = offsets[0];
        let adjacent = offsets.iter().enumerate().all(|(i, &offset)| offset == first + 4 * i);
        if adjacent && cfg!(target_endian = "little") {
            // One copy of the record's piece: the usual layout of the usual file.
            let size = size_of::<[f32; N]>();
            let mut out = vec![[0f32; N]; self.element.count];
            for (row, record) in out.iter_mut().zip(self.bytes.chunks_exact(self.stride)) {
                bytemuck::cast_slice_mut(&mut row[..]).copy_from_slice(&record[first..first + size]);
            }
            return out;
        }
        let record_columns =
            |record: &[u8]| offsets.map(|at| number_at(record, at, Scalar::F32, false) as f32);
        self.bytes.chunks_exact(self.stride).map(record_columns).collect()
    }

    /// The named properties of each record.
    fn columns<const N: usize>(&self, properties: [usize; N]) -> Vec<[f64; N]> {
        let places = properties.map(|i| match self.element.properties[i].kind {
            Kind::Number(kind) => (self.element.offset(i), kind),
            Kind::List { .. } => unreachable!("a column is chosen from properties that are numbers"),
        });
        let record_columns = |record: &[u8]| places.map(|(at, kind)| number_at(record, at, kind, self.big));
        self.bytes.chunks_exact(self.stride).map(record_columns).collect()
    }
}

/// Faces whose one list is that of their vertices.
fn read_faces(
    plan: &Plan,
    element: &Element,
    indices: usize,
    bytes: &mut Bytes,
    faces: &mut Faces,
) -> Result<()> {
    let Kind::List { length, item } = element.properties[indices].kind else {
        unreachable!("chosen as a list of integers")
    };
    let before = element.offset(indices);
    let after = element.offset(element.properties.len()) - before - length.size();
    let loop_ = FaceLoop { data: bytes.bytes, big: bytes.big, before, after, length, item };
    let mut at = bytes.at;
    let fail = |record: usize, at: usize, what: String| {
        Error::content(plan.path, format!("face {record} of {}: {what} (at byte {at})", element.count))
    };
    let mut corners = Vec::new();
    for record in 0..element.count {
        let result = loop_.next(&mut at, &mut corners, faces);
        match result {
            Ok(()) => {}
            Err(FaceProblem::CutShort) => {
                return Err(fail(record, at, "the file is cut short here".to_string()));
            }
            Err(FaceProblem::BadLength(length)) => {
                return Err(fail(record, at, format!("{length} is no length of a list")));
            }
            Err(FaceProblem::BadIndex(index)) => {
                let what =
                    format!("there is no vertex {index}; the file has {}, counted from 0", plan.vertices);
                return Err(fail(record, at, what));
            }
        }
    }
    bytes.at = at;
    Ok(())
}

enum FaceProblem {
    CutShort,
    BadLength(f64),
    BadIndex(f64),
}

impl From<BadIndex> for FaceProblem {
    fn from(bad: BadIndex) -> Self {
        FaceProblem::BadIndex(bad.0)
    }
}

/// The layout of a face record.
struct FaceLoop<'a> {
    data: &'a [u8],
    big: bool,
    /// Bytes of the properties before and after the list.
    before: usize,
    after: usize,
    length: Scalar,
    item: Scalar,
}

impl FaceLoop<'_> {
    /// Reads the record at byte `at` and steps past it.
    #[inline(always)]
    fn next(&self, at: &mut usize, corners: &mut Vec<u32>, faces: &mut Faces) -> Result<(), FaceProblem> {
        let head = self.before + self.length.size();
        let rest = &self.data[*at..];
        if rest.len() < head {
            return Err(FaceProblem::CutShort);
        }
        let length = number_at(rest, self.before, self.length, self.big);
        if length < 0.0 {
            return Err(FaceProblem::BadLength(length));
        }
        let length = length as usize;
        let size = self.item.size();
        let list = rest[head..].get(..length.saturating_mul(size)).ok_or(FaceProblem::CutShort)?;
        *at += head + list.len() + self.after;
        if *at > self.data.len() {
            *at = self.data.len();
            return Err(FaceProblem::CutShort);
        }
        let four_bytes = matches!(self.item, Scalar::I32 | Scalar::U32);
        if length == 3 && four_bytes && !self.big {
            // A negative index, read as unsigned, is out of range too.
            let index = |i: usize| u32::from_le_bytes([list[i], list[i + 1], list[i + 2], list[i + 3]]);
            let triangle = [index(0), index(4), index(8)];
            return faces.push_triangle(triangle).map_err(|bad| self.signed(bad));
        }
        corners.clear();
        for i in 0..length {
            let index = number_at(list, i * size, self.item, self.big);
            if index < 0.0 {
                return Err(FaceProblem::BadIndex(index));
            }
            corners.push(index as u32);
        }
        Ok(faces.push(corners)?)
    }

    /// The index as the file means it.
    fn signed(&self, bad: BadIndex) -> FaceProblem {
        let signed = self.item == Scalar::I32;
        FaceProblem::BadIndex(if signed { f64::from(bad.0 as u32 as i32) } else { bad.0 })
    }
}
