//! The reader that takes every PLY there is, one number after another. The faster ones step back to it.

use super::header::{Element, Kind, Property, Scalar};
use super::{Columns, Plan, Role, Tables, is_far_away};
use crate::base::mesh_data::Positions;
use crate::error::{Error, Result};

/// A stream of numbers.
pub trait Values {
    /// The next number. The error completes "vertex 3 of 8: ...".
    fn number(&mut self, kind: Scalar) -> Result<f64, String>;
    /// Tells that a new record starts.
    fn start_record(&mut self) {}
    /// Whether so many numbers of this type can still follow.
    fn can_hold(&self, count: usize, kind: Scalar) -> bool;
    /// An error at the place of the number read last.
    fn fail(&mut self, message: String) -> Error;
}

/// Reads one element and adds what it says to `tables`.
pub fn read_element(
    plan: &Plan,
    element: &Element,
    role: Role,
    values: &mut impl Values,
    tables: &mut Tables,
) -> Result<()> {
    // Without properties there is nothing to read, however many records are promised.
    if element.properties.is_empty() {
        return Ok(());
    }
    let mut reader =
        Records { element, values, row: vec![0.0; element.properties.len()], lists: Default::default() };
    match role {
        Role::Vertices(columns) => read_vertices(plan, columns, &mut reader, tables),
        Role::Faces { indices, wedge_uvs } => reader.each([Some(indices), wedge_uvs], |lists| {
            let [indices, uvs] = lists;
            let mut corners: Vec<u32> = Vec::with_capacity(indices.len());
            for &index in indices.iter() {
                // Negative numbers too are out of range.
                if !(0.0..f64::from(plan.vertices)).contains(&index) {
                    return Err(index);
                }
                corners.push(index as u32);
            }
            if let Some(wedges) = &mut tables.wedges {
                wedges.split_corners(&mut corners, uvs);
            }
            tables.faces.push(&corners).map_err(|bad| bad.0)
        }),
        Role::Strips { indices } => reader.each([Some(indices), None], |[indices, _]| {
            let indices: Vec<i64> = indices.iter().map(|&i| i as i64).collect();
            tables.faces.push_strips(&indices).map_err(|bad| bad.0)
        }),
        Role::Skip => reader.each([None, None], |_| Ok(())),
    }
    .map_err(|problem| match problem {
        Problem::At(record, message) => {
            values.fail(format!("{} {record} of {}: {message}", element.name, element.count))
        }
        Problem::BadIndex(record, index) => values.fail(format!(
            "{} {record} of {}: there is no vertex {index}; the file has {}, counted from 0",
            element.name, element.count, plan.vertices
        )),
    })
}

enum Problem {
    At(usize, String),
    BadIndex(usize, f64),
}

/// The records of one element.
struct Records<'a, V> {
    element: &'a Element,
    values: &'a mut V,
    /// The numbers of the current record; lists leave a zero.
    row: Vec<f64>,
    /// The wanted lists of the current record.
    lists: [Vec<f64>; 2],
}

impl<V: Values> Records<'_, V> {
    /// Reads every record and hands the two wanted lists to `take`, which may refuse an index.
    fn each(
        &mut self,
        wanted: [Option<usize>; 2],
        mut take: impl FnMut(&[Vec<f64>; 2]) -> Result<(), f64>,
    ) -> Result<(), Problem> {
        for record in 0..self.element.count {
            self.read(wanted).map_err(|message| Problem::At(record, message))?;
            take(&self.lists).map_err(|index| Problem::BadIndex(record, index))?;
        }
        Ok(())
    }

    fn read(&mut self, wanted: [Option<usize>; 2]) -> Result<(), String> {
        self.values.start_record();
        for list in &mut self.lists {
            list.clear();
        }
        for (i, property) in self.element.properties.iter().enumerate() {
            match property.kind {
                Kind::Number(kind) => self.row[i] = self.values.number(kind)?,
                Kind::List { length, item } => {
                    let length = self.list_length(property, length, item)?;
                    let slot = wanted.iter().position(|&w| w == Some(i));
                    for _ in 0..length {
                        let value = self.values.number(item)?;
                        if let Some(slot) = slot {
                            self.lists[slot].push(value);
                        }
                    }
                }
            }
        }
        Ok(())
    }

    fn list_length(&mut self, property: &Property, length: Scalar, item: Scalar) -> Result<usize, String> {
        let length = self.values.number(length)?;
        if length.fract() != 0.0 || length < 0.0 {
            return Err(format!("{length} is no length of the list {}", property.name));
        }
        if !self.values.can_hold(length as usize, item) {
            return Err(format!(
                "the list {} of {length} numbers goes beyond the end of the file",
                property.name
            ));
        }
        Ok(length as usize)
    }
}

fn read_vertices(
    plan: &Plan,
    columns: Columns,
    records: &mut Records<impl Values>,
    tables: &mut Tables,
) -> Result<(), Problem> {
    let count = plan.vertices as usize;
    let mut positions = Vec::with_capacity(count);
    tables.normals.reserve(if columns.normal.is_some() { count } else { 0 });
    tables.uvs.reserve(if columns.uv.is_some() { count } else { 0 });
    for record in 0..count {
        records.read([None, None]).map_err(|message| Problem::At(record, message))?;
        let row = &records.row;
        positions.push(columns.position.map(|i| row[i]));
        tables.normals.extend(columns.normal.map(|at| at.map(|i| row[i] as f32)));
        tables.uvs.extend(columns.uv.map(|at| at.map(|i| row[i] as f32)));
    }
    let in_text = plan.format == super::Format::Ascii;
    tables.positions = if columns.single && !(in_text && is_far_away(&positions)) {
        Positions::F32(positions.iter().map(|p| p.map(|c| c as f32)).collect())
    } else {
        Positions::F64(positions)
    };
    Ok(())
}
