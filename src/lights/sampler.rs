//! Which light to ask.

use crate::base::light::{ChosenLight, Extent, Light, LightSampler, Receiver};
use crate::error::{Error, Result, unknown_name};
use crate::sampling::distribution::Distribution1D;
use std::sync::Arc;

/// Names of the light samplers, the default first.
pub const NAMES: &[&str] = &["power", "uniform"];

/// The least part of an even share that any light has: what the power says wrongly (a weak lamp next to the
/// surface) then costs no more than this factor.
const LEAST_SHARE: f64 = 0.1;

/// Chooses with the same probabilities everywhere. Every light has a probability of more than 0.
pub struct FixedLightSampler {
    /// None if there is no light.
    choices: Option<Distribution1D>,
}

impl FixedLightSampler {
    /// By name: see [`NAMES`].
    pub fn by_name(name: &str, lights: &[Arc<dyn Light>], extent: &Extent) -> Result<Self> {
        match name {
            "power" => Ok(Self::power(lights, extent)),
            "uniform" => Ok(Self::uniform(lights.len())),
            _ => Err(Error::Usage(unknown_name("light sampler", name, NAMES.iter().copied()))),
        }
    }

    /// Every light alike.
    pub fn uniform(lights: usize) -> Self {
        FixedLightSampler { choices: Distribution1D::new(std::iter::repeat_n(1.0, lights)) }
    }

    /// By power, mixed with a tenth of an even share. Lights at infinity count with their power through a disc as
    /// large as the scene (its extent), which is what they can bring to it: the power of a lamp inside counts in
    /// full, so both are on one scale.
    pub fn power(lights: &[Arc<dyn Light>], extent: &Extent) -> Self {
        let powers: Vec<f64> = lights
            .iter()
            .map(|l| match f64::from(l.power(extent)) {
                p if p > 0.0 && p.is_finite() => p,
                _ => 0.0,
            })
            .collect();
        let total: f64 = powers.iter().sum();
        if total <= 0.0 {
            return Self::uniform(lights.len());
        }
        let even = LEAST_SHARE / lights.len() as f64;
        let weights = powers.iter().map(|p| (1.0 - LEAST_SHARE) * p / total + even);
        FixedLightSampler { choices: Distribution1D::new(weights) }
    }
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
