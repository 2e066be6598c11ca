//! Light that arrives after one scattering: [`super::path`] with a depth of 1.

use super::Integrator;
use super::path::{EACH_LIGHT, LIGHT_SAMPLING, PathTracer};
use crate::base::registry::{Params, Row};
use std::sync::Arc;

/// The registry row.
pub const ROW: Row<dyn Integrator> = Row {
    kind: "direct",
    doc: "light that arrives after one scattering, from all lights",
    params: &[LIGHT_SAMPLING, EACH_LIGHT],
    build: |p| {
        let light_sampling = p.bool_or("light_sampling", true)?;
        let each_light = p.bool_or("each_light", false)?;
        let roulette_depth = u32::MAX;
        Ok(Arc::new(PathTracer { max_depth: 1, roulette_depth, light_sampling, each_light, mis: true }))
    },
    samples: || vec![Params::new()],
};
