//! The contact sheet: every complete scene and mesh of the shared data, small, with its name.

use super::font;
use super::picture::Pixels;
use super::shot::{self, Wish};
use skylit::color::Rgb;
use skylit::error::{Error, Result};
use skylit::image::picture::{Picture, SampleKind};
use skylit::image::write::{WriteOptions, check_writable, write_picture};
use std::path::{Path, PathBuf};

/// Of a picture, pixels.
const CELL: [usize; 2] = [192, 144];
/// Letters are drawn this many times as large.
const ZOOM: usize = 2;
const LINES: usize = 2;
const ACROSS: usize = 8;
const SPP: u32 = 16;

/// Folders whose files are wrong on purpose; scenes with files that could not be had; files without any surface, which
/// `skylit render` refuses with a word.
const LEFT_OUT: &[&str] = &[
    "malformed",
    "FinalDragon.scene",
    "scene2.scene",
    "objparsetest.scene",
    "point_cloud.obj",
    "testline.obj",
    "invalid-face-definition.obj",
    "invalid-relative-texture-index.obj",
    "line-prim.obj",
    "lines.obj",
    "empty.obj",
    "face_in_group_name.obj",
    "points_ascii_with_lists.ply",
    "points_bin.ply",
];
const KINDS: &[&str] = &["obj", "ply", "scene", "test"];

/// Renders all into one picture; says whether every file could be rendered.
///
/// # Errors
/// A sheet that cannot be written, or with nothing to show.
pub fn make(data: &Path, filter: &str, out: &Path, threads: usize) -> Result<bool> {
    check_writable(out)?;
    let mut files = Vec::new();
    find(data, &mut files);
    files.retain(|f| f.to_string_lossy().contains(filter));
    if files.is_empty() {
        return Err(Error::Usage(format!("{}: no scene and no mesh there", data.display())));
    }
    let cell = [CELL[0], CELL[1] + LINES * ZOOM * font::CELL[1]];
    let (across, down) = (ACROSS.min(files.len()), files.len().div_ceil(ACROSS));
    let mut sheet = Sheet::new(across * (cell[0] + 4), down * (cell[1] + 4));
    let mut good = true;
    for (i, file) in files.iter().enumerate() {
        let at = [i % ACROSS * (cell[0] + 4) + 2, i / ACROSS * (cell[1] + 4) + 2];
        let name = file.strip_prefix(data).unwrap_or(file).to_string_lossy().replace('\\', "/");
        match small(file, threads) {
            Ok(picture) => sheet.paste(&picture, at),
            Err(e) => {
                good = false;
                eprintln!("failed: {e}");
                sheet.cross(at);
            }
        }
        eprintln!("{} of {}: {name}", i + 1, files.len());
        sheet.label(&name, [at[0], at[1] + CELL[1]]);
    }
    sheet.write(out)?;
    Ok(good)
}

/// Scenes and meshes below a folder, sorted.
fn find(folder: &Path, files: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
    paths.sort();
    for path in paths {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let plain = name.trim_end_matches(".zst").trim_end_matches(".gz");
        if LEFT_OUT.contains(&plain) {
            continue;
        }
        let kind = Path::new(plain).extension().unwrap_or_default().to_string_lossy().to_lowercase();
        if path.is_dir() {
            find(&path, files);
        } else if KINDS.contains(&kind.as_str()) {
            files.push(path);
        }
    }
}

/// Rendered as `skylit render FILE -o out.png` does, at a size that fits.
fn small(file: &Path, threads: usize) -> Result<Pixels> {
    let desc = skylit::formats::load(file)?;
    let size = desc.film.size.map(|v| v as usize);
    let scale = f64::min(CELL[0] as f64 / size[0] as f64, CELL[1] as f64 / size[1] as f64);
    let size = size.map(|v| ((v as f64 * scale).round() as u32).max(1));
    let spp = desc.render.spp.unwrap_or(SPP).min(SPP);
    let wish = Wish { size: Some(size), spp: Some(spp), threads, ..Wish::default() };
    Ok(shot::pixels(&shot::render_desc(desc, &wish)?))
}

struct Sheet {
    width: usize,
    height: usize,
    planes: [Vec<f32>; 3],
}

impl Sheet {
    fn new(width: usize, height: usize) -> Self {
        Sheet { width, height, planes: [0, 1, 2].map(|_| vec![0.02; width * height]) }
    }

    fn set(&mut self, [x, y]: [usize; 2], value: Rgb) {
        if x < self.width && y < self.height {
            let value = value.to_array();
            (0..3).for_each(|c| self.planes[c][y * self.width + x] = value[c]);
        }
    }

    fn paste(&mut self, picture: &Pixels, at: [usize; 2]) {
        for (i, p) in picture.data.iter().enumerate() {
            self.set([at[0] + i % picture.width, at[1] + i / picture.width], Rgb::from(*p));
        }
    }

    /// In the place of a picture that could not be made.
    fn cross(&mut self, at: [usize; 2]) {
        for x in 0..CELL[0] {
            let y = x * CELL[1] / CELL[0];
            self.set([at[0] + x, at[1] + y], Rgb::new(0.8, 0.0, 0.0));
            self.set([at[0] + x, at[1] + CELL[1] - 1 - y], Rgb::new(0.8, 0.0, 0.0));
        }
    }

    /// The end of a name, on as many lines as there are.
    fn label(&mut self, name: &str, at: [usize; 2]) {
        let letters: Vec<char> = name.chars().collect();
        let fits = CELL[0] / (ZOOM * font::CELL[0]);
        let shown = &letters[letters.len().saturating_sub(LINES * fits)..];
        for (line, part) in shown.chunks(fits).enumerate() {
            let top = at[1] + line * ZOOM * font::CELL[1];
            font::draw(&part.iter().collect::<String>(), |x, y| {
                for (dx, dy) in (0..ZOOM).flat_map(|dx| (0..ZOOM).map(move |dy| (dx, dy))) {
                    self.set([at[0] + ZOOM * x + dx, top + ZOOM * y + dy], Rgb::WHITE);
                }
            });
        }
    }

    fn write(self, out: &Path) -> Result<()> {
        let mut picture = Picture::new(self.width, self.height);
        for (name, plane) in ["R", "G", "B"].into_iter().zip(self.planes) {
            picture.push(name, SampleKind::Float, plane);
        }
        write_picture(out, &picture, &WriteOptions::default())
    }
}
