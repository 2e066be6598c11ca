//! Writing a mesh as binary little-endian PLY.

use crate::base::mesh_data::{MeshData, Positions};
use crate::error::{Error, Result};
use std::io::{BufWriter, Write};
use std::path::Path;

/// Writes `mesh` as binary little-endian PLY: positions in their own precision, normals and texture coordinates
/// (`u v`) where there are any, triangles as `uchar`/`int` lists. Materials have no place in a PLY and are left out.
/// The file appears whole or not at all.
///
/// # Errors
/// [`Error::File`] if the file cannot be written.
pub fn write_ply(path: &Path, mesh: &MeshData) -> Result<()> {
    let fail = |e: std::io::Error| Error::file(path, "write", e);
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // What a plain `create` asks for; the user's umask takes its share.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let file = builder.tempfile_in(folder).map_err(fail)?;
    let mut out = BufWriter::with_capacity(1 << 20, file);
    write_ply_to(&mut out, mesh).map_err(fail)?;
    let file = out.into_inner().map_err(|e| fail(e.into_error()))?;
    file.as_file().sync_all().map_err(fail)?;
    file.persist(path).map_err(|e| fail(e.error))?;
    Ok(())
}

/// As [`write_ply`], to any writer; buffer it.
///
/// # Errors
/// Those of the writer.
pub fn write_ply_to(out: &mut impl Write, mesh: &MeshData) -> std::io::Result<()> {
    let kind = match mesh.positions {
        Positions::F32(_) => "float",
        Positions::F64(_) => "double",
    };
    writeln!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {}", mesh.positions.len())?;
    for name in ["x", "y", "z"] {
        writeln!(out, "property {kind} {name}")?;
    }
    let attributes: [(bool, &[&str]); 2] =
        [(!mesh.normals.is_empty(), &["nx", "ny", "nz"]), (!mesh.uvs.is_empty(), &["u", "v"])];
    for name in attributes.iter().filter(|(has, _)| *has).flat_map(|(_, names)| *names) {
        writeln!(out, "property float {name}")?;
    }
    writeln!(out, "element face {}\nproperty list uchar int vertex_indices\nend_header", mesh.indices.len())?;
    for i in 0..mesh.positions.len() {
        match &mesh.positions {
            Positions::F32(p) => write_floats(out, &p[i])?,
            Positions::F64(p) => p[i].iter().try_for_each(|c| out.write_all(&c.to_le_bytes()))?,
        }
        if let Some(normal) = mesh.normals.get(i) {
            write_floats(out, normal)?;
        }
        if let Some(uv) = mesh.uvs.get(i) {
            write_floats(out, uv)?;
        }
    }
    for triangle in &mesh.indices {
        let mut record = [3u8; 13];
        for (i, index) in triangle.iter().enumerate() {
            record[1 + 4 * i..5 + 4 * i].copy_from_slice(&index.to_le_bytes());
        }
        out.write_all(&record)?;
    }
    Ok(())
}

fn write_floats(out: &mut impl Write, values: &[f32]) -> std::io::Result<()> {
    values.iter().try_for_each(|c| out.write_all(&c.to_le_bytes()))
}
