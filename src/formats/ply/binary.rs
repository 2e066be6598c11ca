//! The body of a binary PLY, of either byte order: tables without lists column by column, faces in one loop.

use super::faces::{BadIndex, Faces};
use super::general::read_element;
use super::header::{Element, Format, Kind, Scalar};
use super::stream::{Numbers, Stream};
use super::{Columns, Plan, Role, Tables};
use crate::base::mesh_data::Positions;
use crate::error::Result;

/// Reads all elements.
pub fn read(plan: &Plan, mut stream: Stream) -> Result<Tables> {
    let mut tables = Tables::new(plan);
    let big = plan.format == Format::BigEndian;
    for (element, role) in &plan.elements {
        match (*role, element.stride()) {
            (Role::Vertices(columns), Some(stride)) => {
                read_vertices(columns, element, &mut stream, stride, big, &mut tables)?;
            }
            (_, Some(stride)) => stream.records(element, stride, |_| {})?,
            (Role::Faces { indices, wedge_uvs: None }, None) if lists(element) == 1 => {
                read_faces(plan, element, indices, &mut stream, &mut tables.faces)?;
            }
            (_, None) => {
                read_element(plan, element, *role, &mut Numbers { stream: &mut stream, big }, &mut tables)?;
            }
        }
    }
    Ok(tables)
}

fn lists(element: &Element) -> usize {
    element.properties.iter().filter(|p| matches!(p.kind, Kind::List { .. })).count()
}

/// The number of type `kind` at byte `at`; an `f64` holds each exactly. Panics if the bytes end before.
#[inline(always)]
pub fn number_at(bytes: &[u8], at: usize, kind: Scalar, big: bool) -> f64 {
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

fn read_vertices(
    columns: Columns,
    element: &Element,
    stream: &mut Stream,
    stride: usize,
    big: bool,
    tables: &mut Tables,
) -> Result<()> {
    let count = element.count;
    let room = |wanted: bool| if wanted { count } else { 0 };
    let (mut singles, mut doubles) =
        (Vec::with_capacity(room(columns.single)), Vec::with_capacity(room(!columns.single)));
    tables.normals.reserve_exact(room(columns.normal.is_some()));
    tables.uvs.reserve_exact(room(columns.uv.is_some()));
    stream.records(element, stride, |bytes| {
        let table = Table { element, bytes, stride, big };
        if columns.single {
            table.columns_f32(columns.position, &mut singles);
        } else {
            table.columns(columns.position, |row| doubles.push(row));
        }
        if let Some(normal) = columns.normal {
            table.columns_f32(normal, &mut tables.normals);
        }
        if let Some(uv) = columns.uv {
            table.columns_f32(uv, &mut tables.uvs);
        }
    })?;
    tables.positions = if columns.single { Positions::F32(singles) } else { Positions::F64(doubles) };
    Ok(())
}

/// Records without lists.
struct Table<'a> {
    element: &'a Element,
    bytes: &'a [u8],
    stride: usize,
    big: bool,
}

impl Table<'_> {
    /// Appends the named properties of each record as floats.
    fn columns_f32<const N: usize>(&self, properties: [usize; N], out: &mut Vec<[f32; N]>) {
        let is_f32 = |&i: &usize| self.element.properties[i].kind == Kind::Number(Scalar::F32);
        let first = self.element.offset(properties[0]);
        let offsets = properties.iter().map(|&i| self.element.offset(i));
        let adjacent = offsets.enumerate().all(|(i, offset)| offset == first + 4 * i);
        if !adjacent || !properties.iter().all(is_f32) || self.big || cfg!(target_endian = "big") {
            self.columns(properties, |row| out.push(row.map(|c| c as f32)));
            return;
        }
        // One copy of the record's piece: the usual layout of the usual file.
        out.extend(self.bytes.chunks_exact(self.stride).map(|record| {
            let mut row = [0f32; N];
            bytemuck::cast_slice_mut(&mut row[..])
                .copy_from_slice(&record[first..first + size_of::<[f32; N]>()]);
            row
        }));
    }

    /// Hands out the named properties of each record.
    fn columns<const N: usize>(&self, properties: [usize; N], mut take: impl FnMut([f64; N])) {
        let places = properties.map(|i| match self.element.properties[i].kind {
            Kind::Number(kind) => (self.element.offset(i), kind),
            Kind::List { .. } => unreachable!("a column is chosen from properties that are numbers"),
        });
        for record in self.bytes.chunks_exact(self.stride) {
            take(places.map(|(at, kind)| number_at(record, at, kind, self.big)));
        }
    }
}

/// Faces whose one list is that of their vertices.
fn read_faces(
    plan: &Plan,
    element: &Element,
    indices: usize,
    stream: &mut Stream,
    faces: &mut Faces,
) -> Result<()> {
    let Kind::List { length, item } = element.properties[indices].kind else {
        unreachable!("chosen as a list of integers")
    };
    let before = element.offset(indices);
    let after = element.offset(element.properties.len()) - before - length.size();
    let layout = FaceLayout { big: plan.format == Format::BigEndian, before, after, length, item };
    let mut corners = Vec::new();
    let mut record = 0;
    while record < element.count {
        let run = layout.triangles(stream.rest(), element.count - record, faces);
        stream.pass(run * layout.triangle());
        record += run;
        if record == element.count {
            break;
        }
        let problem = loop {
            match layout.read(stream.rest(), &mut corners, faces) {
                Ok(length) => {
                    stream.pass(length);
                    break None;
                }
                // Only the window may end here, and not the file.
                Err(FaceProblem::CutShort) if stream.more()? => {}
                Err(problem) => break Some(problem),
            }
        };
        let what = match problem {
            None => {
                record += 1;
                continue;
            }
            Some(FaceProblem::CutShort) => "the file is cut short here".to_string(),
            Some(FaceProblem::BadLength(length)) => format!("{length} is no length of a list"),
            Some(FaceProblem::BadIndex(index)) => {
                format!("there is no vertex {index}; the file has {}, counted from 0", plan.vertices)
            }
        };
        return Err(stream.error(&format!("face {record} of {}: {what}", element.count)));
    }
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
struct FaceLayout {
    big: bool,
    /// Bytes of the properties before and after the list.
    before: usize,
    after: usize,
    length: Scalar,
    item: Scalar,
}

impl FaceLayout {
    /// Bytes of a triangle.
    fn triangle(&self) -> usize {
        self.before + self.length.size() + 3 * self.item.size() + self.after
    }

    /// Reads the records that `bytes` start with, at most `most`, as long as they are whole triangles in the usual
    /// types and without fault; returns how many. What a file is full of is worth a loop without more in it.
    fn triangles(&self, bytes: &[u8], most: usize, faces: &mut Faces) -> usize {
        let four_bytes = matches!(self.item, Scalar::I32 | Scalar::U32);
        if self.length.size() != 1 || !four_bytes || self.big {
            return 0;
        }
        let mut count = 0;
        for record in bytes.chunks_exact(self.triangle()).take(most) {
            let Some(&[3, ref list @ ..]) = record[self.before..].first_chunk::<13>() else { break };
            // Written out: array::map is not always inlined.
            let index = |i: usize| u32::from_le_bytes([list[i], list[i + 1], list[i + 2], list[i + 3]]);
            let triangle = [index(0), index(4), index(8)];
            // A negative index, read as unsigned, is out of range too.
            if faces.push_triangle(triangle).is_err() {
                break;
            }
            count += 1;
        }
        count
    }

    /// Reads the record that `bytes` start with; returns its length.
    #[inline(always)]
    fn read(&self, bytes: &[u8], corners: &mut Vec<u32>, faces: &mut Faces) -> Result<usize, FaceProblem> {
        let head = self.before + self.length.size();
        if bytes.len() < head {
            return Err(FaceProblem::CutShort);
        }
        let length = number_at(bytes, self.before, self.length, self.big);
        if length < 0.0 {
            return Err(FaceProblem::BadLength(length));
        }
        let length = length as usize;
        let size = self.item.size();
        let list = bytes[head..].get(..length.saturating_mul(size)).ok_or(FaceProblem::CutShort)?;
        let whole = head + list.len() + self.after;
        if whole > bytes.len() {
            return Err(FaceProblem::CutShort);
        }
        corners.clear();
        for i in 0..length {
            let index = number_at(list, i * size, self.item, self.big);
            if index < 0.0 {
                return Err(FaceProblem::BadIndex(index));
            }
            corners.push(index as u32);
        }
        faces.push(corners)?;
        Ok(whole)
    }
}
