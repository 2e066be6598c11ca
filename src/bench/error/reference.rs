//! The truth that errors are measured against: given as a picture, or rendered with many times the samples and kept.

use super::measure::{Noise, Sets, Truth};
use super::record::ReferenceRecord;
use crate::error::{Error, Result};
use crate::image::picture::{Picture, SampleKind};
use crate::image::read::read_planes;
use crate::image::write::{WriteOptions, write_picture};
use crate::render::dealing::Dealing;
use crate::render::{Progress, Renderer};
use crate::scene::Scene;
use std::path::{Path, PathBuf};

/// Seeds of references lie apart from those of runs.
const SEED: u64 = 0x0072_6566_6572_656e;

/// The truth and what is known of it.
pub struct Reference {
    /// The colours.
    pub truth: Truth,
    /// For the record.
    pub record: ReferenceRecord,
}

/// Where a reference is kept, and what it must say of itself to be taken from there.
pub struct Kept {
    /// The file.
    pub path: PathBuf,
    /// All that decides how it looks.
    pub key: String,
}

const KEY: &str = "reference-of";
const SPP: &str = "spp";

impl Reference {
    fn new(truth: Truth, spp: u64) -> Self {
        let noise: Option<Sets<Noise>> = truth.noise();
        let (luminance, surfaces) = (truth.luminance(), truth.surfaces());
        Reference { truth, record: ReferenceRecord { spp, luminance, surfaces, noise } }
    }

    /// A picture that somebody made. An EXR file of `skylit render --aov variance` says how noisy it is.
    ///
    /// # Errors
    /// A file that cannot be read, of another size, or without R, G and B; colours that are not finite.
    pub fn load(path: &Path, size: [u32; 2]) -> Result<Self> {
        Self::of_picture(path, &read_planes(path)?, size)
    }

    fn of_picture(path: &Path, picture: &Picture, size: [u32; 2]) -> Result<Self> {
        if [picture.width, picture.height] != size.map(|s| s as usize) {
            let [w, h] = size;
            let message = format!("is {}x{} pixels, and the film is {w}x{h}", picture.width, picture.height);
            return Err(Error::content(path, message));
        }
        let plane = |name: &str| picture.plane(name).map(|p| p.data.as_slice());
        let triple = |names: [&str; 3]| -> Option<Vec<[f32; 3]>> {
            let [r, g, b] = names.map(plane);
            Some(r?.iter().zip(g?).zip(b?).map(|((&r, &g), &b)| [r, g, b]).collect())
        };
        let rgb = triple(["R", "G", "B"])
            .ok_or_else(|| Error::content(path, "has no channels R, G and B".to_owned()))?;
        if !rgb.as_flattened().iter().all(|v| v.is_finite()) {
            return Err(Error::content(path, "has colours that are not finite".to_owned()));
        }
        let alpha = plane("A").map_or_else(|| vec![1.0; rgb.len()], <[f32]>::to_vec);
        let variance = triple(["variance.R", "variance.G", "variance.B"]);
        let spp = picture.metadata.iter().find(|(k, _)| k == SPP).and_then(|(_, v)| v.parse().ok());
        Ok(Reference::new(Truth { rgb, alpha, variance }, spp.unwrap_or(0)))
    }

    /// The one that is kept, if it is that; else rendered with `spp` samples a pixel, and kept.
    ///
    /// # Errors
    /// Those of rendering and of writing.
    pub fn make(
        scene: &Scene,
        renderer: &Renderer,
        spp: u32,
        kept: Option<&Kept>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        if let Some(found) = kept.and_then(|k| k.find(renderer.settings.size)) {
            return Ok(found);
        }
        let mut settings = renderer.settings.clone();
        settings.spp = spp;
        settings.seed = SEED;
        // What is on trial does not stand as judge.
        settings.skip_background = false;
        settings.outlines = Some(1);
        settings.dealing = Dealing::Even;
        settings.moments = true;
        let renderer = Renderer { integrator: renderer.integrator.clone(), settings };
        let film = renderer.render(scene, progress)?.film;
        let truth = Truth::of_film(&film);
        if let Some(kept) = kept {
            kept.keep(film.picture(SampleKind::Float), &truth, spp)?;
        }
        Ok(Reference::new(truth, u64::from(spp)))
    }
}

impl Kept {
    /// Nothing where it is not, or is another one: it will be made anew.
    fn find(&self, size: [u32; 2]) -> Option<Reference> {
        if !self.path.exists() {
            return None;
        }
        let picture = read_planes(&self.path).ok()?;
        let is_ours = picture.metadata.iter().any(|(k, v)| k == KEY && *v == self.key);
        is_ours.then(|| Reference::of_picture(&self.path, &picture, size).ok()).flatten()
    }

    fn keep(&self, mut picture: Picture, truth: &Truth, spp: u32) -> Result<()> {
        if let Some(folder) = self.path.parent() {
            std::fs::create_dir_all(folder).map_err(|e| Error::file(folder, "create", e))?;
        }
        for (c, name) in ["variance.R", "variance.G", "variance.B"].into_iter().enumerate() {
            if let Some(variance) = &truth.variance {
                picture.push(name, SampleKind::Float, variance.iter().map(|v| v[c]).collect());
            }
        }
        picture.metadata = vec![(KEY.to_owned(), self.key.clone()), (SPP.to_owned(), spp.to_string())];
        write_picture(&self.path, &picture, &WriteOptions::default())
    }
}
