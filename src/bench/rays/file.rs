//! Ray sets on disk, so that other programs, versions and days run exactly the same rays.
//!
//! Little endian throughout: `SKYLRAYS`, version u32 (1), triangles u64, other primitives u64, bounds 6 x f32 (min,
//! max), number of sets u32 (5); then per set its kind u32, number of batches u32 and the length of each, u32; then,
//! batch after batch, the columns ox oy oz dx dy dz tnear tfar (f32) and key (u32).

use super::sets::{RayKind, RaySets, SceneKey, count};
use crate::base::ray::RayBatch;
use crate::error::{Error, Result};
use crate::image::write::write_file;
use crate::math::aabb::Aabb;
use glam::Vec3;
use std::path::Path;

const MAGIC: &[u8; 8] = b"SKYLRAYS";
const VERSION: u32 = 1;

/// Bytes of a ray.
const RAY: usize = 9 * 4;
/// Most rays of a file, all kinds together: 9.7 GB.
const MAX_RAYS: usize = 1 << 28;
/// Most rays of a batch.
const MAX_BATCH: usize = 1 << 16;

/// Writes the sets, whole or not at all.
///
/// # Errors
/// [`Error::File`] where that cannot be done.
pub fn save(path: &Path, sets: &RaySets) -> Result<()> {
    write_file(path, &to_bytes(sets))
}

/// Reads sets that were made for `scene`.
///
/// # Errors
/// [`Error::File`] if the file cannot be read; [`Error::Content`] if it is no such file, was cut short, holds a ray that
/// is not valid, or was made for another scene.
pub fn load(path: &Path, scene: &SceneKey) -> Result<RaySets> {
    let size = std::fs::metadata(path).map_err(|e| Error::file(path, "open", e))?.len();
    if size > (MAX_RAYS * RAY + (1 << 24)) as u64 {
        return Err(Error::content(path, format!("{size} bytes is too long for a file of rays")));
    }
    let bytes = std::fs::read(path).map_err(|e| Error::file(path, "read", e))?;
    let sets = from_bytes(&bytes).map_err(|m| Error::content(path, m))?;
    if sets.scene != *scene {
        let tell = |k: &SceneKey| {
            let (b, n) = (k.bounds, k.triangles);
            format!("{n} triangles, {} other primitives, bounds {} to {}", k.procedurals, b.min, b.max)
        };
        let (old, new) = (tell(&sets.scene), tell(scene));
        return Err(Error::content(path, format!("these rays are for another scene: {old}; here are {new}")));
    }
    Ok(sets)
}

/// The file's content.
pub fn to_bytes(sets: &RaySets) -> Vec<u8> {
    let rays: usize = sets.sets.iter().map(|s| count(s)).sum();
    let mut out = Vec::with_capacity(rays * RAY + 256);
    out.extend(MAGIC);
    out.extend(VERSION.to_le_bytes());
    out.extend(sets.scene.triangles.to_le_bytes());
    out.extend(sets.scene.procedurals.to_le_bytes());
    for v in [sets.scene.bounds.min, sets.scene.bounds.max] {
        v.to_array().iter().for_each(|x| out.extend(x.to_le_bytes()));
    }
    out.extend((RayKind::ALL.len() as u32).to_le_bytes());
    for kind in RayKind::ALL {
        let batches = sets.of(kind);
        out.extend((kind as u32).to_le_bytes());
        out.extend((batches.len() as u32).to_le_bytes());
        batches.iter().for_each(|b| out.extend((b.len() as u32).to_le_bytes()));
        for b in batches {
            for column in [&b.ox, &b.oy, &b.oz, &b.dx, &b.dy, &b.dz, &b.tnear, &b.tfar] {
                column.iter().for_each(|x| out.extend(x.to_le_bytes()));
            }
            b.key.iter().for_each(|k| out.extend(k.to_le_bytes()));
        }
    }
    out
}

/// What is left to read.
struct Input<'a>(&'a [u8]);

impl<'a> Input<'a> {
    fn take(&mut self, n: usize) -> Result<&'a [u8], String> {
        let (head, rest) = self.0.split_at_checked(n).ok_or("the file ends before its last ray")?;
        self.0 = rest;
        Ok(head)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], String> {
        Ok(self.take(N)?.try_into().expect("as long as asked for"))
    }

    fn u32(&mut self) -> Result<u32, String> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    fn u64(&mut self) -> Result<u64, String> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    fn vec3(&mut self) -> Result<Vec3, String> {
        let mut x = || Ok::<_, String>(f32::from_bits(self.u32()?));
        Ok(Vec3::new(x()?, x()?, x()?))
    }

    /// So many words. Bytes are there before anything is allocated for them.
    fn words(&mut self, n: usize) -> Result<impl Iterator<Item = u32> + use<'a>, String> {
        let bytes = self.take(n * 4)?;
        Ok(bytes.chunks_exact(4).map(|b| u32::from_le_bytes(b.try_into().expect("four bytes"))))
    }
}

/// The sets, or what is wrong with the file.
pub fn from_bytes(bytes: &[u8]) -> Result<RaySets, String> {
    let mut input = Input(bytes);
    if input.take(MAGIC.len()).ok() != Some(MAGIC) {
        return Err("this is no file of rays: it does not begin with SKYLRAYS".into());
    }
    let version = input.u32()?;
    if version != VERSION {
        return Err(format!("version {version} of the format is not known; known: {VERSION}"));
    }
    let (triangles, procedurals) = (input.u64()?, input.u64()?);
    let bounds = Aabb { min: input.vec3()?, max: input.vec3()? };
    let number = input.u32()?;
    if number as usize != RayKind::ALL.len() {
        return Err(format!("{number} sets of rays; there must be {}", RayKind::ALL.len()));
    }
    let mut sets: [Vec<RayBatch>; 5] = Default::default();
    for kind in RayKind::ALL {
        let found = input.u32()?;
        if found != kind as u32 {
            return Err(format!("a set of kind {found} where {} ({}) must be", kind as u32, kind.name()));
        }
        sets[kind as usize] = read_set(&mut input, kind)?;
    }
    match input.0.len() {
        0 => Ok(RaySets { scene: SceneKey { triangles, procedurals, bounds }, sets }),
        n => Err(format!("{n} bytes stand behind the last ray")),
    }
}

fn read_set(input: &mut Input, kind: RayKind) -> Result<Vec<RayBatch>, String> {
    let number = input.u32()? as usize;
    let lengths: Vec<usize> = input.words(number)?.map(|n| n as usize).collect();
    if lengths.iter().any(|n| !(1..=MAX_BATCH).contains(n)) {
        return Err(format!("a batch of {} rays does not have 1 to {MAX_BATCH}", kind.name()));
    }
    let mut batches = Vec::new();
    for n in lengths {
        let mut b = RayBatch::default();
        let columns =
            [&mut b.ox, &mut b.oy, &mut b.oz, &mut b.dx, &mut b.dy, &mut b.dz, &mut b.tnear, &mut b.tfar];
        for column in columns {
            *column = input.words(n)?.map(f32::from_bits).collect();
        }
        b.key = input.words(n)?.collect();
        if let Some(i) = (0..n).find(|&i| !b.get(i).is_valid()) {
            let at = count(&batches) + i;
            return Err(format!("ray {at} of {} is not valid: {:?}", kind.name(), b.get(i)));
        }
        batches.push(b);
    }
    Ok(batches)
}
