//! What is known of a picture's noise: several independent pictures of the same pixels.

use crate::error::{Error, Result};
use crate::image::picture::{Picture, SampleKind};
use crate::render::film::Film;
use crate::render::film_layers::HALVES;

/// What may be taken as independent of each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spread {
    /// Pixels, and replicates: ours, whose samples stay in their pixel and have points of their own. The variance of a sum
    /// over pixels is then the sum of theirs.
    Pixels,
    /// Whole pictures alone: foreign ones, where a filter may spread a sample over pixels, or one sequence serve them all.
    /// The variance of a sum over pixels is that of the sums of the pictures.
    Pictures,
}

/// How a picture came to be, as far as it says so.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Origin {
    /// Seed of its random choices.
    pub seed: Option<u64>,
    /// Samples a pixel that were asked for.
    pub spp: Option<u64>,
    /// Kind of points.
    pub sampler: Option<String>,
}

/// One of several independent pictures of the same.
#[derive(Debug, Clone, PartialEq)]
struct Part {
    means: Vec<[f32; 3]>,
    /// Samples by pixel, 0 where there is none; nothing where all pixels of all parts count alike.
    counts: Option<Vec<f32>>,
}

/// Means of the pixels, and their numbers of samples where these are not all alike.
pub type Values = (Vec<[f32; 3]>, Option<Vec<f32>>);

/// Replicates of a picture: at least two.
#[derive(Debug, Clone, PartialEq)]
pub struct Replicates {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// What is independent.
    pub spread: Spread,
    /// How it came to be; the first one's where it is several pictures.
    pub origin: Origin,
    /// The relative distance of neighbouring numbers in the file: values that differ by less may be the same.
    pub digits: f32,
    /// Number of the object that each pixel shows, from 1; 0 where there is none. Nothing where that is not known.
    pub objects: Option<Vec<u32>>,
    parts: Vec<Part>,
}

impl Origin {
    /// From a picture's metadata as our renders write it.
    pub fn of(picture: &Picture) -> Self {
        let text = |key: &str| picture.metadata.iter().find(|(k, _)| k == key).map(|(_, v)| v.clone());
        let number = |key: &str| text(key).and_then(|v| v.parse().ok());
        Origin { seed: number("seed"), spp: number("spp"), sampler: text("sampler") }
    }
}

impl Replicates {
    /// The two halves of a film that was rendered with moments by [`crate::sampler::Sampler::OwenSobol`] or independent
    /// points. Pixels without samples in either half have no spread and are left out.
    pub fn of_film(film: &Film, origin: Origin) -> Self {
        let window = film.window();
        let halves: Vec<_> = window.pixels().map(|(x, y)| film.halves(x, y)).collect();
        let part = |h: usize| Part {
            means: halves.iter().map(|p| p.map_or([0.0; 3], |p| p[h].mean.map(|v| v as f32))).collect(),
            counts: Some(halves.iter().map(|p| p.map_or(0.0, |p| p[h].count as f32)).collect()),
        };
        Replicates {
            size: [window.width() as usize, window.height() as usize],
            spread: Spread::Pixels,
            origin,
            digits: f32::EPSILON,
            objects: None,
            parts: vec![part(0), part(1)],
        }
    }

    /// From all planes of a picture of ours that has layer `halves`; `None` if it has not.
    pub fn of_halves(picture: &Picture) -> Option<Self> {
        let plane = |name: String| picture.plane(&name).map(|p| p.data.as_slice());
        let part = |half: &str| {
            let channel = |c: &str| plane(format!("{HALVES}.{half}.{c}"));
            let [r, g, b, n] = [channel("R")?, channel("G")?, channel("B")?, channel("N")?];
            let means = r.iter().zip(g).zip(b).map(|((&r, &g), &b)| [r, g, b]).collect();
            Some(Part { means, counts: Some(n.to_vec()) })
        };
        Some(Replicates {
            parts: vec![part("a")?, part("b")?],
            origin: Origin::of(picture),
            digits: f32::EPSILON,
            spread: Spread::Pixels,
            size: [picture.width, picture.height],
            objects: objects(picture),
        })
    }

    /// From several pictures of the same scene, of which each is a replicate: their halves where all have them, else they
    /// themselves. Names are for messages.
    ///
    /// # Errors
    /// Less than two; sizes that differ; pictures without channels R, G, B or Y; two that are the same.
    pub fn of_pictures(pictures: &[(String, Picture)]) -> Result<Self> {
        let Some((first_name, first)) = pictures.first() else {
            return Err(Error::Usage("no picture to take replicates from".into()));
        };
        for (name, p) in pictures {
            if [p.width, p.height] != [first.width, first.height] {
                let [a, b] = [first, p].map(|p| format!("{}x{}", p.width, p.height));
                return Err(Error::Usage(format!(
                    "{name} is {b} and {first_name} is {a}: replicates are pictures of the same pixels"
                )));
            }
        }
        let halves: Option<Vec<Replicates>> =
            pictures.iter().map(|(_, p)| Replicates::of_halves(p)).collect();
        let all = match halves {
            Some(halves) => {
                let parts = halves.iter().flat_map(|h| h.parts.clone()).collect();
                let first = halves.into_iter().next();
                first.map(|first| Replicates { parts, ..first })
            }
            None => None,
        };
        let all = match all {
            Some(all) => all,
            None if pictures.len() < 2 => {
                return Err(Error::Usage(format!(
                    "{first_name} says nothing of its noise: render it with --aov halves, or give several pictures of the \
                     same scene with other seeds, a comma between their names, and --tiles"
                )));
            }
            None => Replicates {
                size: [first.width, first.height],
                spread: Spread::Pictures,
                origin: Origin::of(first),
                digits: digits(first),
                objects: objects(first),
                parts: pictures.iter().map(|(name, p)| whole(name, p)).collect::<Result<_>>()?,
            },
        };
        all.check_different(pictures)?;
        Ok(all)
    }

    /// Replicates that are the same picture would make its noise look small.
    fn check_different(&self, pictures: &[(String, Picture)]) -> Result<()> {
        let per_picture = self.parts.len() / pictures.len().max(1);
        for j in 1..pictures.len() {
            for i in 0..j {
                let noise = self.parts[i * per_picture].means.iter().flatten().any(|v| *v != 0.0);
                if noise && self.parts[i * per_picture].means == self.parts[j * per_picture].means {
                    return Err(Error::Usage(format!(
                        "{} and {} are the same picture: replicates need other seeds",
                        pictures[i].0, pictures[j].0
                    )));
                }
            }
        }
        Ok(())
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.parts.len()
    }

    /// Whether there is none, which is not made.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// Mean and weight of a pixel in one of them; a weight of 0 where there is no sample.
    #[inline]
    pub fn value(&self, part: usize, pixel: usize) -> ([f64; 3], f64) {
        let part = &self.parts[part];
        let weight = part.counts.as_ref().map_or(1.0, |c| f64::from(c[pixel]));
        (part.means[pixel].map(f64::from), weight)
    }

    /// Samples of all pixels and parts; `None` where that is not known.
    pub fn samples(&self) -> Option<f64> {
        let of = |p: &Part| p.counts.as_ref().map(|c| c.iter().map(|n| f64::from(*n)).sum::<f64>());
        self.parts.iter().map(of).sum()
    }

    /// The same with every value of some pixels multiplied: a known bias, for tests.
    pub fn scaled(mut self, factors: [f64; 3], wanted: impl Fn(usize) -> bool) -> Self {
        for part in &mut self.parts {
            for (_, mean) in part.means.iter_mut().enumerate().filter(|(i, _)| wanted(*i)) {
                for (v, factor) in mean.iter_mut().zip(factors) {
                    *v = (f64::from(*v) * factor) as f32;
                }
            }
        }
        self
    }

    /// From values of a program's own: by replicate, the pixels' means and numbers of samples (0: none).
    ///
    /// # Panics
    /// If there are less than two, or lengths are not that of the size.
    pub fn of_values(size: [usize; 2], spread: Spread, parts: Vec<Values>) -> Self {
        let pixels = size[0] * size[1];
        assert!(parts.len() >= 2, "one picture has no spread");
        let part = |(means, counts): Values| {
            assert!(means.len() == pixels && counts.as_ref().is_none_or(|c| c.len() == pixels));
            Part { means, counts }
        };
        Replicates {
            size,
            spread,
            origin: Origin::default(),
            digits: f32::EPSILON,
            objects: None,
            parts: parts.into_iter().map(part).collect(),
        }
    }
}

/// The unnamed layer's colour, or its grey.
fn whole(name: &str, picture: &Picture) -> Result<Part> {
    let plane = |c: &str| picture.plane(c).map(|p| p.data.as_slice());
    let grey = || plane("Y").map(|y| [y, y, y]);
    let colour = [plane("R"), plane("G"), plane("B")];
    let [r, g, b] = match colour {
        [Some(r), Some(g), Some(b)] => [r, g, b],
        _ => grey().ok_or_else(|| {
            Error::Usage(format!("{name}: a test for bias reads channels R, G and B, or Y, and finds none"))
        })?,
    };
    let means = r.iter().zip(g).zip(b).map(|((&r, &g), &b)| [r, g, b]).collect();
    Ok(Part { means, counts: None })
}

fn digits(picture: &Picture) -> f32 {
    let half =
        picture.planes.iter().any(|p| p.kind == SampleKind::Half && ["R", "Y"].contains(&p.name.as_str()));
    // Eleven significant bits of a half.
    if half { 1.0 / 1024.0 } else { f32::EPSILON }
}

fn objects(picture: &Picture) -> Option<Vec<u32>> {
    let plane = picture.plane("id.V")?;
    Some(plane.data.iter().map(|v| if *v >= 1.0 { v.round() as u32 } else { 0 }).collect())
}
