//! The pieces of a file put together, in file order.

use super::blocks::Blocks;
use super::columns::Corners;
use super::corners::before_start;
use super::face_materials::FaceMaterials;
use super::numbers::first_word;
use super::statements::{self, Arities, KINDS, Piece};
use crate::base::mesh_data::Repairs;
use crate::error::{Error, Place, Result};
use crate::memory;
use rayon::prelude::*;
use std::path::Path;

/// All that an OBJ file says, every index checked.
pub struct Tables {
    /// Vertex positions.
    pub positions: Vec<[f64; 3]>,
    /// Texture coordinates.
    pub uvs: Vec<[f32; 2]>,
    /// Normals.
    pub normals: Vec<[f32; 3]>,
    /// Of all faces.
    pub corners: Corners,
    /// Corners of each face.
    pub arities: Arities,
    /// Which face has which material.
    pub materials: FaceMaterials,
    /// What the `mtllib` statements say.
    pub libraries: Vec<String>,
    /// Faces and elements that were left out.
    pub repairs: Repairs,
    /// The highest index used by kind, and where: a face may stand before its vertices.
    highest: [(i64, Place); 3],
    /// Lines so far.
    lines: usize,
    path: Box<Path>,
}

/// A block and what stands in it.
struct Read {
    text: Vec<u8>,
    piece: Piece,
}

impl Tables {
    /// Reads a file: while some threads parse blocks, one puts together those before and reads those to come.
    /// The result, be it an error, does not depend on the number of threads.
    ///
    /// # Errors
    /// [`Error::Content`] with the place of the first wrong statement, or that of the highest index that points
    /// nowhere; those of reading.
    pub fn read(path: &Path, mut blocks: Blocks) -> Result<Tables> {
        // Two for each thread even out what one takes longer.
        let at_once = 2 * rayon::current_num_threads();
        let mut tables = Tables::new(path);
        let mut texts = blocks.next(at_once)?;
        let mut parsed = Vec::new();
        let mut unreadable = None;
        while !(texts.is_empty() && parsed.is_empty()) {
            // The tables grow by less than the blocks' text, and hold what came before when a vector is moved.
            let text: usize = texts.iter().map(Vec::len).sum();
            drop(memory::room(3 * text as u64, || format!("{}: the mesh", path.display()))?);
            let parse = |text: Vec<u8>| Read { piece: statements::read(&text), text };
            let (now, next) = rayon::join(
                || texts.into_par_iter().map(parse).collect(),
                || {
                    parsed.into_iter().try_for_each(|read| tables.append(read))?;
                    Ok(if unreadable.is_none() { blocks.next(at_once) } else { Ok(Vec::new()) })
                },
            );
            parsed = now;
            // What is wrong with the text before comes first.
            texts = next?.unwrap_or_else(|e| {
                unreadable = Some(e);
                Vec::new()
            });
        }
        unreadable.map_or(Ok(()), Err)?;
        tables.check()?;
        tables.corners.compact();
        Ok(tables)
    }

    fn new(path: &Path) -> Self {
        Tables {
            positions: Vec::new(),
            uvs: Vec::new(),
            normals: Vec::new(),
            corners: Corners::default(),
            arities: Arities::default(),
            materials: FaceMaterials::default(),
            libraries: Vec::new(),
            repairs: Repairs::default(),
            highest: Default::default(),
            lines: 0,
            path: path.into(),
        }
    }

    /// Positions, texture coordinates and normals so far.
    pub fn counts(&self) -> [usize; 3] {
        [self.positions.len(), self.uvs.len(), self.normals.len()]
    }

    fn append(&mut self, Read { text, mut piece }: Read) -> Result<()> {
        self.settle(&text, &mut piece)?;
        if let Some(problem) = &piece.problem {
            return Err(self.fail(&text, problem.at, problem.message.clone()));
        }
        self.positions.append(&mut piece.positions);
        self.uvs.append(&mut piece.uvs);
        self.normals.append(&mut piece.normals);
        self.arities.append(&piece.arities);
        self.corners.append(piece.corners);
        for (kind, highest) in piece.highest.into_iter().enumerate() {
            // What is there already need not be looked at again.
            if highest.index > self.highest[kind].0 && highest.index > self.counts()[kind] as i64 {
                self.highest[kind] = (highest.index, self.place(&text, highest.at));
            }
        }
        let mut faces = 0;
        for (before, at, name) in piece.switches {
            let added = self.materials.add_faces(before - faces);
            added.map_err(|message| self.fail(&text, at, message))?;
            faces = before;
            self.materials.switch_to(name);
        }
        let added = self.materials.add_faces(piece.arities.faces - faces);
        added.map_err(|message| self.fail(&text, text.len(), message))?;
        self.libraries.append(&mut piece.libraries);
        self.repairs.not_surface += piece.not_surface;
        self.repairs.bad_faces += piece.bad_faces;
        self.lines += piece.lines;
        Ok(())
    }

    /// Turns indices that count back into those that count from the start.
    fn settle(&self, text: &[u8], piece: &mut Piece) -> Result<()> {
        let before = self.counts();
        for relative in &piece.relative {
            let count = (before[relative.kind] + relative.count) as i64;
            let index = count + 1 + relative.index;
            if index < 1 {
                let word = first_word(&text[relative.at..]);
                return Err(self.fail(text, relative.at, before_start(word, count)));
            }
            if let Some(corner) = relative.corner {
                piece.corners.set(corner, relative.kind, u32::try_from(index).unwrap_or(u32::MAX));
            }
        }
        Ok(())
    }

    /// Indices beyond the end of their list, and numbers beyond 32 bits.
    fn check(&self) -> Result<()> {
        for (i, kind) in KINDS.into_iter().enumerate() {
            let ((index, place), count) = (&self.highest[i], self.counts()[i]);
            // References to normals or texture coordinates of which there are none at all are left out.
            if *index > count as i64 && (i == 0 || count > 0) {
                let message = format!("there is no {kind} {index}; the file has {count}");
                return Err(Error::Content { place: place.clone(), message });
            }
        }
        if [self.corners.len(), self.positions.len(), self.uvs.len(), self.normals.len()]
            .iter()
            .any(|&n| n >= u32::MAX as usize)
        {
            return Err(Error::content(
                &self.path,
                "it has more corners or vertices than an index of 32 bits reaches",
            ));
        }
        Ok(())
    }

    fn fail(&self, text: &[u8], at: usize, message: String) -> Error {
        Error::Content { place: self.place(text, at), message }
    }

    /// The place of byte `at` of the block `text` that comes next.
    fn place(&self, text: &[u8], at: usize) -> Place {
        let before = &text[..at.min(text.len())];
        let line = memchr::memrchr(b'\n', before).map_or(before, |end| &before[end + 1..]);
        Place {
            path: self.path.to_path_buf(),
            line: 1 + self.lines + memchr::memchr_iter(b'\n', before).count(),
            column: 1 + String::from_utf8_lossy(line).chars().count(),
        }
    }
}
