//! Transforms: a list of steps, applied first to last.

use super::tree::{Data, Source, Tree};
use super::values::Section;
use crate::error::Result;
use glam::{DAffine3, DMat4, DQuat, DVec3};

const STEPS: &[&str] = &["scale", "rotate_deg", "axis", "translate", "matrix"];

/// Reads `[{ scale = 10.0 }, { rotate_deg = 45.0, axis = [0, 1, 0] }, { translate = [2, -1, 0] }]`.
pub(super) fn transform(source: &Source, name: &str, v: &Tree) -> Result<DAffine3> {
    let mut total = DAffine3::IDENTITY;
    for s in source.list(name, v)? {
        total = step(source, s)? * total;
    }
    if !total.is_finite() || total.matrix3.determinant() == 0.0 {
        return Err(source.error(v.at, "the transform has no inverse: it flattens everything or overflows"));
    }
    Ok(total)
}

fn step(source: &Source, v: &Tree) -> Result<DAffine3> {
    let section = Section::new(source, "a step of `transform`", v, STEPS)?;
    let has = |key: &str| section.table.get(key).is_some();
    let kinds = ["scale", "rotate_deg", "translate", "matrix"].iter().filter(|k| has(k)).count();
    if kinds != 1 || has("axis") != has("rotate_deg") {
        let wanted = "{ scale = }, { rotate_deg = , axis = }, { translate = } or { matrix = }";
        return Err(source.error(v.at, format!("a step of `transform` is one of {wanted}")));
    }
    if let Some(s) = section.read("scale", scale)? {
        return Ok(DAffine3::from_scale(s));
    }
    if let Some(t) = section.read("translate", Source::vector)? {
        return Ok(DAffine3::from_translation(DVec3::from(t)));
    }
    if let Some(m) = section.read("matrix", matrix)? {
        return Ok(m);
    }
    let degrees = section.read("rotate_deg", Source::number)?.unwrap_or(0.0);
    let axis = section.read("axis", axis)?.unwrap_or(DVec3::Y);
    Ok(rotation(axis, degrees))
}

/// Quarter turns are exact: a box turned by 90 degrees stays axis-aligned to the bit.
fn rotation(axis: DVec3, degrees: f64) -> DAffine3 {
    let quarters = (degrees / 90.0).rem_euclid(4.0);
    if quarters.fract() != 0.0 {
        return DAffine3::from_quat(DQuat::from_axis_angle(axis, degrees.to_radians()));
    }
    let (sin, cos) = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][quarters as usize];
    // Rodrigues' formula, column by column.
    let turn = |v: DVec3| v * cos + axis.cross(v) * sin + axis * (axis.dot(v) * (1.0 - cos));
    DAffine3::from_mat3(glam::DMat3::from_cols(turn(DVec3::X), turn(DVec3::Y), turn(DVec3::Z)))
}

fn scale(source: &Source, name: &str, v: &Tree) -> Result<DVec3> {
    let s = match v.data {
        Data::List(_) => DVec3::from(source.vector(name, v)?),
        _ => DVec3::splat(source.number(name, v)?),
    };
    if s.to_array().contains(&0.0) {
        return Err(source.error(v.at, "`scale` of 0 flattens everything: no factor may be 0"));
    }
    Ok(s)
}

fn axis(source: &Source, name: &str, v: &Tree) -> Result<DVec3> {
    let axis = DVec3::from(source.vector(name, v)?);
    axis.try_normalize().ok_or_else(|| source.error(v.at, "`axis` needs a direction, not a zero vector"))
}

/// Sixteen or twelve numbers, row by row; the last row of sixteen is 0 0 0 1.
fn matrix(source: &Source, name: &str, v: &Tree) -> Result<DAffine3> {
    let mut rows = source.numbers(name, v, &[12, 16])?;
    if rows.len() == 12 {
        rows.extend([0.0, 0.0, 0.0, 1.0]);
    }
    if rows[12..] != [0.0, 0.0, 0.0, 1.0] {
        return Err(source.error(v.at, "the last row of `matrix` must be 0, 0, 0, 1: it is not a projection"));
    }
    let m = DMat4::from_cols_slice(&rows).transpose();
    Ok(DAffine3::from_cols(
        m.x_axis.truncate(),
        m.y_axis.truncate(),
        m.z_axis.truncate(),
        m.w_axis.truncate(),
    ))
}
