//! What a comparison must not miss: `relmse=1e-3`.

use super::comparison::Comparison;
use super::metrics::{self, Better, Metric};
use std::str::FromStr;

/// A measure with the figure at which it fails.
#[derive(Clone, Copy)]
pub struct Limit {
    metric: &'static Metric,
    value: f64,
}

impl FromStr for Limit {
    type Err = String;

    fn from_str(s: &str) -> Result<Self, String> {
        let (name, value) = s.split_once('=').ok_or("takes METRIC=VALUE, such as relmse=1e-3")?;
        let metric = metrics::named(name).map_err(|e| e.to_string())?;
        let number: Option<f64> = value.parse().ok().filter(|v: &f64| v.is_finite());
        let value = number.ok_or_else(|| format!("\"{value}\" is no number"))?;
        Ok(Limit { metric, value })
    }
}

impl Limit {
    /// For `--fail-above`.
    ///
    /// # Errors
    /// A measure of which more is better.
    pub fn above(s: &str) -> Result<Self, String> {
        let limit: Limit = s.parse()?;
        match limit.metric.better {
            Better::Higher => {
                Err(format!("more {} is nearer: --fail-below {s} is meant?", limit.metric.title))
            }
            _ => Ok(limit),
        }
    }

    /// For `--fail-below`.
    ///
    /// # Errors
    /// A measure of which less is better.
    pub fn below(s: &str) -> Result<Self, String> {
        let limit: Limit = s.parse()?;
        match limit.metric.better {
            Better::Higher => Ok(limit),
            _ => Err(format!("less {} is nearer: --fail-above {s} is meant?", limit.metric.title)),
        }
    }

    /// The measure that it needs.
    pub fn metric(&self) -> &'static Metric {
        self.metric
    }

    /// Words for it where it is missed. Where there is no figure, it is.
    pub fn missed(&self, c: &Comparison) -> Option<String> {
        let (name, limit) = (self.metric.name, self.value);
        let Some(value) = c.value(name) else {
            let figure = c.figures.iter().find(|f| f.metric == name);
            let why = figure.map_or("not taken", |f| f.note.as_str());
            return Some(format!("{}: there is no {name}: {why}", c.test));
        };
        match self.metric.better {
            Better::Higher if value < limit => Some(format!("{}: {name} {value} is below {limit}", c.test)),
            Better::Lower if value > limit => Some(format!("{}: {name} {value} is above {limit}", c.test)),
            Better::Zero if value.abs() > limit => {
                Some(format!("{}: {name} {value} is farther from 0 than {limit}", c.test))
            }
            _ => None,
        }
    }
}
