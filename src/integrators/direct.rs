//! Light that arrives after one scattering: [`super::path`] with a depth of 1.

use super::Integrator;
use super::path::{LIGHT_SAMPLING, PathTracer};
use crate::base::registry::{Params, Row};
use std::sync::Arc;

/// The registry row.
pub const ROW: Row<dyn Integrator> = Row {
    kind: "direct",
    doc: "light that arrives after one scattering, from all lights",
    params: &[LIGHT_SAMPLING],
    build: |p| {
        let light_sampling = p.bool_or("light_sampling", true)?;
        Ok(Arc::new(PathTracer { max_depth: 1, roulette_depth: u32::MAX, light_sampling, mis: true }))
    },
    samples: || vec![Params::new()],
};
