//! Light that arrives after one scattering: [`super::path`] with a depth of 1.

use super::Integrator;
use super::path::{EACH_LIGHT, LIGHT_SAMPLING, PathTracer, STRATEGY, strategy_param};
use super::strategy::Strategies;
use crate::base::registry::{Params, Row};
use std::sync::Arc;

/// The registry row.
pub const ROW: Row<dyn Integrator> = Row {
    kind: "direct",
    doc: "light that arrives after one scattering, from all lights",
    params: &[LIGHT_SAMPLING, EACH_LIGHT, STRATEGY],
    build: |p| {
        let strategy = strategy_param(p)?;
        Ok(Arc::new(PathTracer {
            max_depth: 1,
            roulette_depth: u32::MAX,
            light_sampling: p.bool_or("light_sampling", true)?,
            each_light: p.bool_or("each_light", false)?,
            mis: true,
            strategies: Strategies::uniform(strategy.unwrap_or_default()),
            auto_strategy: strategy.is_none(),
        }))
    },
    samples: || vec![Params::new()],
};
