//! PLY: ascii, binary little- and big-endian; any number types, unknown properties and elements skipped.
//!
//! Taken from a file: `vertex` with `x y z`, normals `nx ny nz`, texture coordinates `u v`, `s t` or
//! `texture_u texture_v`; `face` with `vertex_indices` or `vertex_index` and texture coordinates by corner
//! (`texcoord`); triangle strips in `tristrips`. Source: Greg Turk, "The PLY Polygon File Format", 1994.
//!
//! An index out of range is an error and not mended: it means that the file is damaged.

mod ascii;
mod binary;
mod faces;
mod general;
mod header;
mod stream;
mod wedges;
mod words;
mod write;

pub use write::{write_ply, write_ply_to};

use crate::base::mesh_data::{MeshData, Positions, Repairs};
use crate::error::{Error, Result};
use crate::formats::source::Source;
use crate::memory;
use faces::Faces;
use header::{Element, Format, Header, Kind};
use std::path::Path;
use stream::Stream;
use wedges::Wedges;

/// Coordinates this many times larger than the mesh are taken from text in double precision, even where the header
/// says `float`: at 64 the step of an `f32` is 1e-5 of the mesh's size, and the text may well hold more digits.
const FAR_AWAY: f64 = 64.0;

/// The properties of a vertex that we take.
#[derive(Debug, Clone, Copy)]
struct Columns {
    position: [usize; 3],
    normal: Option<[usize; 3]>,
    uv: Option<[usize; 2]>,
    /// Whether an `f32` holds every position exactly.
    single: bool,
}

/// What an element is to us; numbers are those of properties.
#[derive(Debug, Clone, Copy)]
enum Role {
    Vertices(Columns),
    Faces { indices: usize, wedge_uvs: Option<usize> },
    Strips { indices: usize },
    Skip,
}

/// A header understood.
struct Plan<'a> {
    path: &'a Path,
    format: Format,
    elements: Vec<(Element, Role)>,
    vertices: u32,
}

/// A file of text: all its bytes, and where the values start.
#[derive(Clone, Copy)]
struct Text<'a> {
    bytes: &'a [u8],
    body: usize,
}

/// What stands in the tables of a file.
struct Tables {
    positions: Positions,
    normals: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    faces: Faces,
    wedges: Option<Wedges>,
    /// Lines of text with more in them than the header declares.
    odd_lines: u64,
}

impl Tables {
    fn new(plan: &Plan) -> Self {
        let faces = |role: &Role| matches!(role, Role::Faces { .. });
        let count = plan.elements.iter().filter(|(_, role)| faces(role)).map(|(e, _)| e.count).sum();
        let has_wedges =
            plan.elements.iter().any(|(_, role)| matches!(role, Role::Faces { wedge_uvs: Some(_), .. }));
        Tables {
            positions: Positions::F32(Vec::new()),
            normals: Vec::new(),
            uvs: Vec::new(),
            faces: Faces::new(if has_wedges { u32::MAX } else { plan.vertices }, count),
            wedges: has_wedges.then(|| Wedges::new(plan.vertices)),
            odd_lines: 0,
        }
    }
}

/// Reads a PLY file from memory; `path` is for messages.
///
/// # Errors
/// [`Error::Content`] for a damaged file (in text with the line), and where there is no surface.
pub fn parse(path: &Path, bytes: &[u8]) -> Result<MeshData> {
    read(path, Source::of_bytes(path, bytes))
}

/// As [`parse`], from a file. A binary one is read piece by piece: memory holds the tables and not the file.
///
/// # Errors
/// As [`parse`], and those of reading.
pub fn read(path: &Path, mut source: Source) -> Result<MeshData> {
    let mut bytes = Vec::new();
    // What the header promises is held against the size, so where that is not known all must be read first.
    let size = match source.size() {
        Some(size) => {
            source.fill(&mut bytes, header::MAX_HEADER)?;
            size
        }
        None => {
            source.read_rest(&mut bytes)?;
            bytes.len() as u64
        }
    };
    let header = header::parse(path, &bytes, size)?;
    let body = header.body;
    let plan = plan(path, header)?;
    let room = memory::room(plan.bytes(), || format!("{}: the mesh", path.display()))?;
    let tables = match plan.format {
        Format::Ascii => {
            source.read_rest(&mut bytes)?;
            ascii::read(&plan, Text { bytes: &bytes, body })?
        }
        Format::LittleEndian | Format::BigEndian => {
            binary::read(&plan, Stream::new(path, source, bytes, body, size))?
        }
    };
    drop(room);
    assemble(&plan, tables)
}

impl Plan<'_> {
    /// About the bytes of the tables.
    fn bytes(&self) -> u64 {
        let of = |(e, role): &(Element, Role)| {
            let each = match role {
                Role::Vertices(c) => {
                    let position = if c.single { 12 } else { 24 };
                    position + c.normal.map_or(0, |_| 12) + c.uv.map_or(0, |_| 8)
                }
                Role::Faces { .. } => 12,
                Role::Strips { .. } | Role::Skip => 0,
            };
            (e.count as u64).saturating_mul(each)
        };
        self.elements.iter().map(of).fold(0, u64::saturating_add)
    }
}

/// Elements that the mesh is made of.
const TAKEN: [&str; 3] = ["vertex", "face", "tristrips"];

fn plan(path: &Path, header: Header) -> Result<Plan<'_>> {
    let fail = |message: String| Error::content(path, message);
    let mut vertices = None;
    let mut elements: Vec<(Element, Role)> = Vec::new();
    for element in header.elements {
        let name = element.name.as_str();
        if TAKEN.contains(&name) && elements.iter().any(|(e, _)| e.name == name) {
            return Err(fail(format!("there are two {name} elements")));
        }
        let role = match name {
            "vertex" => {
                vertices = Some(u32::try_from(element.count).map_err(|_| {
                    fail(format!("{} vertices are more than an index of 32 bits reaches", element.count))
                })?);
                Role::Vertices(columns(&element).map_err(fail)?)
            }
            "face" => {
                Role::Faces { indices: index_list(&element).map_err(fail)?, wedge_uvs: wedge_list(&element) }
            }
            "tristrips" => Role::Strips { indices: index_list(&element).map_err(fail)? },
            _ => Role::Skip,
        };
        elements.push((element, role));
    }
    let vertices = vertices.ok_or_else(|| fail("there is no vertex element, so no surface".to_string()))?;
    let surface = |(e, role): &(Element, Role)| match role {
        Role::Faces { .. } | Role::Strips { .. } => e.count,
        Role::Vertices(_) | Role::Skip => 0,
    };
    if elements.iter().map(surface).sum::<usize>() == 0 {
        return Err(fail(match vertices {
            0 => "it holds no vertices and no faces".to_string(),
            n => format!("it holds {n} points and no faces; a surface is needed (face or tristrips)"),
        }));
    }
    if elements.iter().any(|(e, role)| matches!(role, Role::Strips { .. }) && e.count > 0) {
        leave_out_wedges(path, &mut elements);
    }
    Ok(Plan { path, format: header.format, elements, vertices })
}

/// Texture coordinates by corner split vertices, and strips, which have none, would be left with the old ones.
fn leave_out_wedges(path: &Path, elements: &mut [(Element, Role)]) {
    for (_, role) in elements {
        if let Role::Faces { wedge_uvs, .. } = role
            && wedge_uvs.take().is_some()
        {
            log::warn!("{}: texture coordinates by corner beside tristrips are left out", path.display());
        }
    }
}

fn columns(element: &Element) -> Result<Columns, String> {
    let number =
        |name: &str| element.find(name).filter(|&i| matches!(element.properties[i].kind, Kind::Number(_)));
    let three = |names: [&str; 3]| Some([number(names[0])?, number(names[1])?, number(names[2])?]);
    let two = |names: [&str; 2]| Some([number(names[0])?, number(names[1])?]);
    let position = three(["x", "y", "z"]).ok_or_else(|| "the vertex element lacks x, y or z".to_string())?;
    let fits = |&i: &usize| matches!(element.properties[i].kind, Kind::Number(kind) if kind.fits_f32());
    Ok(Columns {
        position,
        normal: three(["nx", "ny", "nz"]),
        uv: [["u", "v"], ["s", "t"], ["texture_u", "texture_v"]].into_iter().find_map(two),
        single: position.iter().all(fits),
    })
}

fn index_list(element: &Element) -> Result<usize, String> {
    let name = &element.name;
    let found = element
        .find("vertex_indices")
        .or_else(|| element.find("vertex_index"))
        .ok_or_else(|| format!("the {name} element has neither vertex_indices nor vertex_index"))?;
    match element.properties[found].kind {
        Kind::List { item, .. } if item.is_integer() => Ok(found),
        _ => Err(format!("{} of the {name} element is no list of integers", element.properties[found].name)),
    }
}

fn wedge_list(element: &Element) -> Option<usize> {
    element.find("texcoord").filter(|&i| matches!(element.properties[i].kind, Kind::List { .. }))
}

fn assemble(plan: &Plan, tables: Tables) -> Result<MeshData> {
    let edges = plan.elements.iter().filter(|(e, _)| e.name == "edge" && !e.properties.is_empty());
    let edges = edges.map(|(e, _)| e.count as u64).sum();
    let mut repairs = Repairs { not_surface: edges, ..Repairs::default() };
    let Tables { mut positions, mut normals, mut uvs, faces, wedges, odd_lines } = tables;
    repairs.bad_attributes += odd_lines;
    if let Some(wedges) = wedges {
        repairs.bad_attributes += wedges.bad_lists();
        wedges.split_vertices(&mut positions, &mut normals, &mut uvs);
    }
    if faces.is_empty() {
        let message = format!("none of its faces has three corners; it holds {} points", positions.len());
        return Err(Error::content(plan.path, message));
    }
    let what = || format!("{}: its polygons as triangles", plan.path.display());
    let _room = memory::room(faces.bytes_of_triangles(), what)?;
    let indices = faces.triangulate(|i| positions.get(i as usize), &mut repairs);
    let mut mesh =
        MeshData { positions, normals, uvs, indices, material_ids: vec![], materials: vec![], repairs };
    mesh.mend_normals();
    Ok(mesh)
}

/// Whether coordinates are so large against the mesh that an `f32` would blur it. Non-finite ones count for nothing.
fn is_far_away<T: Copy + Into<f64>>(positions: &[[T; 3]]) -> bool {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for p in positions {
        for axis in 0..3 {
            let c: f64 = p[axis].into();
            if c.is_finite() {
                low[axis] = low[axis].min(c);
                high[axis] = high[axis].max(c);
            }
        }
    }
    let axes = || low.iter().zip(&high).filter(|(low, high)| low <= high);
    let size = axes().map(|(low, high)| high - low).fold(0.0, f64::max);
    axes().any(|(low, high)| low.abs().max(high.abs()) > FAR_AWAY * size)
}

#[cfg(test)]
mod tests;
