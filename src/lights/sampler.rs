//! Which light to ask.

use crate::base::light::{ChosenLight, EmitterBounds, Extent, Light, LightSampler, Receiver};
use crate::error::{Error, Result, unknown_name};
use crate::lights::tree::LightTree;
use crate::sampling::distribution::Distribution1D;
use std::sync::Arc;

/// Names of the light samplers with a line about each, the default first.
pub const NAMES: &[(&str, &str)] = &[
    ("tree", "by what each light may bring to the point that asks: power, distance and direction"),
    ("power", "by power alone"),
    ("uniform", "every light alike"),
];

/// Builds one by name: see [`NAMES`].
pub fn by_name(name: &str, lights: &[Arc<dyn Light>], extent: &Extent) -> Result<Box<dyn LightSampler>> {
    Ok(match name {
        "tree" => Box::new(TreeLightSampler::new(lights, extent)),
        "power" => Box::new(FixedLightSampler::power(lights, extent)),
        "uniform" => Box::new(FixedLightSampler::uniform(lights.len())),
        _ => return Err(Error::Usage(unknown_name("light sampler", name, NAMES.iter().map(|n| n.0)))),
    })
}

/// The least part of an even share that any light has: what the power says wrongly (a weak lamp next to the
/// surface) then costs no more than this factor.
const LEAST_SHARE: f64 = 0.1;

/// Chooses with the same probabilities everywhere. Every light has a probability of more than 0, but for those
/// that are never sampled, where it is by power.
pub struct FixedLightSampler {
    /// None if there is no light.
    choices: Option<Distribution1D>,
}

impl FixedLightSampler {
    /// Every light alike.
    pub fn uniform(lights: usize) -> Self {
        FixedLightSampler { choices: Distribution1D::new(std::iter::repeat_n(1.0, lights)) }
    }

    /// By power, mixed with a tenth of an even share. Lights at infinity count with their power through a disc as
    /// large as the scene (its extent), which is what they can bring to it: the power of a lamp inside counts in
    /// full, so both are on one scale.
    pub fn power(lights: &[Arc<dyn Light>], extent: &Extent) -> Self {
        FixedLightSampler { choices: Distribution1D::new(shares(lights, extent)) }
    }
}

/// By power, mixed with a tenth of an even share; even where no light has any. Together 1. Lights that are never sampled have
/// none.
fn shares(lights: &[Arc<dyn Light>], extent: &Extent) -> Vec<f64> {
    let usable = |p: f64| if p > 0.0 && p.is_finite() { p } else { 0.0 };
    let sampled = |l: &dyn Light| l.is_sampled().then(|| usable(f64::from(l.power(extent))));
    let powers: Vec<Option<f64>> = lights.iter().map(|l| sampled(&**l)).collect();
    let total: f64 = powers.iter().flatten().sum();
    let even = 1.0 / powers.iter().flatten().count() as f64;
    let share = |p: f64| (1.0 - LEAST_SHARE) * p / total + LEAST_SHARE * even;
    let of_light = |p: Option<f64>| p.map_or(0.0, |p| if total > 0.0 { share(p) } else { even });
    powers.into_iter().map(of_light).collect()
}

impl LightSampler for FixedLightSampler {
    fn sample(&self, _at: &Receiver, u: f32) -> Option<ChosenLight> {
        let choice = self.choices.as_ref()?.sample(f64::from(u));
        Some(ChosenLight { light: choice.index as u32, pmf: choice.pmf as f32 })
    }

    fn pmf(&self, _at: &Receiver, light: u32) -> f32 {
        self.choices.as_ref().map_or(0.0, |c| c.pmf(light as usize) as f32)
    }
}

/// Chooses lights with bounds by what they may bring to the receiver, all others (skies, suns) by power.
pub struct TreeLightSampler {
    /// The tree as a whole, then the others; None if there is no light.
    top: Option<Distribution1D>,
    tree: Option<LightTree>,
    /// The light of each emitter of the tree.
    bounded: Vec<u32>,
    /// Lights that are not in the tree.
    others: Vec<u32>,
    /// Where each light is.
    places: Vec<Place>,
}

#[derive(Clone, Copy)]
enum Place {
    Tree(u32),
    Other(u32),
}

impl TreeLightSampler {
    /// Of these lights, in a scene of this extent.
    pub fn new(lights: &[Arc<dyn Light>], extent: &Extent) -> Self {
        let all: Vec<Option<EmitterBounds>> =
            lights.iter().map(|l| l.bounds().filter(|b| b.power > 0.0 && b.power.is_finite())).collect();
        let indices = |in_tree: bool| {
            (0..).zip(&all).filter(|(_, b)| b.is_some() == in_tree).map(|(i, _)| i).collect::<Vec<u32>>()
        };
        let (bounded, others) = (indices(true), indices(false));
        let tree = LightTree::new(&all.iter().flatten().copied().collect::<Vec<_>>());
        let mut places = vec![Place::Other(0); lights.len()];
        for (i, &l) in (0..).zip(&bounded) {
            places[l as usize] = Place::Tree(i);
        }
        for (i, &l) in (0..).zip(&others) {
            places[l as usize] = Place::Other(i);
        }
        let shares = shares(lights, extent);
        let of_tree: f64 = bounded.iter().map(|&l| shares[l as usize]).sum();
        let top = std::iter::once(of_tree).chain(others.iter().map(|&l| shares[l as usize]));
        TreeLightSampler { top: Distribution1D::new(top), tree, bounded, others, places }
    }
}

impl LightSampler for TreeLightSampler {
    fn sample(&self, at: &Receiver, u: f32) -> Option<ChosenLight> {
        let choice = self.top.as_ref()?.sample(f64::from(u));
        match choice.index.checked_sub(1) {
            Some(i) => Some(ChosenLight { light: self.others[i], pmf: choice.pmf as f32 }),
            None => {
                let c = self.tree.as_ref()?.sample(at, choice.du)?;
                Some(ChosenLight {
                    light: self.bounded[c.emitter as usize],
                    pmf: (choice.pmf * c.pmf) as f32,
                })
            }
        }
    }

    fn pmf(&self, at: &Receiver, light: u32) -> f32 {
        let (Some(top), Some(place)) = (&self.top, self.places.get(light as usize)) else { return 0.0 };
        match *place {
            Place::Other(i) => top.pmf(i as usize + 1) as f32,
            Place::Tree(i) => {
                let tree = self.tree.as_ref().map_or(0.0, |t| t.pmf(at, i));
                (top.pmf(0) * tree) as f32
            }
        }
    }
}
