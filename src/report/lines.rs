//! Curves over linear or logarithmic axes.

use super::bars::{COLORS, rounded};
use crate::error::{Error, Result};
use serde::Serialize;

/// A chart of curves.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Lines {
    /// What is shown.
    pub caption: String,
    /// To the right.
    pub x: Axis,
    /// Upwards.
    pub y: Axis,
    /// The curves.
    pub series: Vec<Line>,
}

/// An axis.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Axis {
    /// What it measures, with its unit.
    pub label: String,
    /// Whether equal steps are equal factors; numbers that are not positive are left out then.
    pub log: bool,
}

/// A curve.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Line {
    /// In the legend.
    pub name: String,
    /// From left to right; those that are not finite are left out.
    pub points: Vec<[f64; 2]>,
}

/// Units of the drawing: its size, and the box that the curves stand in.
const SIZE: [f64; 2] = [720.0, 380.0];
const LEFT: f64 = 62.0;
const RIGHT: f64 = 18.0;
const TOP: f64 = 12.0;
const BOTTOM: f64 = 52.0;

/// A mark of an axis: its place and its number.
#[derive(Debug, Serialize)]
struct Tick {
    at: f64,
    text: String,
}

/// A point with what is told of it where the pointer rests.
#[derive(Debug, Serialize)]
struct Dot {
    x: f64,
    y: f64,
    text: String,
}

/// A curve as the template draws it.
#[derive(Debug, Serialize)]
struct Curve<'a> {
    name: &'a str,
    color: usize,
    path: String,
    dots: Vec<Dot>,
}

/// A chart as the template draws it.
#[derive(Debug, Serialize)]
pub(super) struct Drawn<'a> {
    size: [f64; 2],
    /// Left, top, right, bottom.
    frame: [f64; 4],
    x_ticks: Vec<Tick>,
    y_ticks: Vec<Tick>,
    curves: Vec<Curve<'a>>,
}

/// From numbers to places along one axis.
struct Scale {
    log: bool,
    from: f64,
    to: f64,
    start: f64,
    end: f64,
}

impl Scale {
    fn new(log: bool, values: impl Iterator<Item = f64>, [start, end]: [f64; 2]) -> Self {
        let (mut from, mut to) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
        if from > to {
            (from, to) = if log { (1.0, 10.0) } else { (0.0, 1.0) };
        }
        if log {
            // A little air, and never a range of nothing.
            (from, to) = (from / 1.15, to * 1.15);
        } else {
            from = from.min(0.0);
            to = if to > from { to + (to - from) * 0.05 } else { from + 1.0 };
        }
        Scale { log, from, to, start, end }
    }

    fn at(&self, v: f64) -> f64 {
        let f = |v: f64| if self.log { v.ln() } else { v };
        let part = (f(v) - f(self.from)) / (f(self.to) - f(self.from));
        rounded(self.start + part * (self.end - self.start))
    }

    fn ticks(&self) -> Vec<Tick> {
        let mut all = Vec::new();
        if self.log {
            let decades = (self.to / self.from).log10();
            let steps: &[f64] = match decades {
                d if d <= 3.0 => &[1.0, 2.0, 5.0],
                _ => &[1.0],
            };
            let every = if decades > 8.0 { (decades / 6.0).ceil() as i32 } else { 1 };
            let first = self.from.log10().floor() as i32;
            let last = self.to.log10().ceil() as i32;
            for decade in (first..=last).filter(|d| d % every == 0) {
                all.extend(steps.iter().map(|s| s * 10f64.powi(decade)));
            }
        }
        let inside = |v: &f64| (self.from..=self.to).contains(v);
        all.retain(inside);
        // Less than a factor of five or so is marked in equal steps on either axis.
        if all.len() < 3 {
            let step = nice_step((self.to - self.from) / 6.0);
            let first = (self.from / step).ceil() as i64;
            all = (first..first + 20).map(|i| i as f64 * step).filter(inside).collect();
        }
        all.into_iter().map(|v| Tick { at: self.at(v), text: short(v) }).collect()
    }
}

/// The smallest of 1, 2, 5 times a power of ten that is at least `step`.
fn nice_step(step: f64) -> f64 {
    let power = 10f64.powf(step.max(1e-300).log10().floor());
    let lead = step / power;
    power
        * if lead <= 1.0 {
            1.0
        } else if lead <= 2.0 {
            2.0
        } else if lead <= 5.0 {
            5.0
        } else {
            10.0
        }
}

/// `20M`, `1.5k`, `0.02`, `1e-5`: at most three digits that count.
pub fn short(v: f64) -> String {
    let trim = |v: f64| {
        let text = format!("{v:.3}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    };
    match v.abs() {
        0.0 => "0".into(),
        a if !(1e-3..1e12).contains(&a) => format!("{v:.0e}"),
        a if a >= 1e9 => trim(v * 1e-9) + "G",
        a if a >= 1e6 => trim(v * 1e-6) + "M",
        a if a >= 1e3 => trim(v * 1e-3) + "k",
        _ => trim(v),
    }
}

/// Colours of curves where no style sheet gives any: those of the pages in light.
const PALETTE: [&str; COLORS] =
    ["#2f6db5", "#e08a1e", "#2a9d78", "#b34b8e", "#6f5bd0", "#8a6d3b", "#d4533f", "#6b7684"];

/// Room for the caption above the chart.
const CAPTION: f64 = 26.0;
/// Room for a line of the legend below.
const LEGEND: f64 = 18.0;

#[derive(Serialize)]
struct Standing<'a> {
    caption: &'a str,
    x: &'a str,
    y: &'a str,
    top: f64,
    legend_at: f64,
    height: f64,
    colors: [&'a str; COLORS],
    drawn: Drawn<'a>,
}

impl Lines {
    /// The chart as a picture of its own, with caption and legend.
    ///
    /// # Errors
    /// [`Error::Internal`] if the template fails, which is a fault of ours.
    pub fn to_svg(&self) -> Result<String> {
        let legend_at = CAPTION + SIZE[1] + 8.0;
        let content = Standing {
            caption: &self.caption,
            x: &self.x.label,
            y: &self.y.label,
            top: CAPTION,
            legend_at,
            height: legend_at + LEGEND * self.series.len() as f64,
            colors: PALETTE,
            drawn: self.drawn(),
        };
        let fail = |e: minijinja::Error| Error::Internal(format!("cannot write the chart: {e:#}"));
        let mut environment = minijinja::Environment::new();
        // SVG wants the escapes that HTML does.
        environment.set_auto_escape_callback(|_| minijinja::AutoEscape::Html);
        environment.add_template("lines.svg", include_str!("lines.svg")).map_err(fail)?;
        let template = environment.get_template("lines.svg").map_err(fail)?;
        template.render(minijinja::value::Serde(&content)).map_err(fail)
    }

    pub(super) fn drawn(&self) -> Drawn<'_> {
        let fits = |axis: &Axis, v: f64| v.is_finite() && (!axis.log || v > 0.0);
        let visible = |l: &Line| -> Vec<[f64; 2]> {
            l.points.iter().copied().filter(|p| fits(&self.x, p[0]) && fits(&self.y, p[1])).collect()
        };
        let lines: Vec<_> = self.series.iter().map(visible).collect();
        let [right, bottom] = [SIZE[0] - RIGHT, SIZE[1] - BOTTOM];
        let x = Scale::new(self.x.log, lines.iter().flatten().map(|p| p[0]), [LEFT, right]);
        let y = Scale::new(self.y.log, lines.iter().flatten().map(|p| p[1]), [bottom, TOP]);
        let mut curves = Vec::new();
        for (i, (line, points)) in self.series.iter().zip(&lines).enumerate() {
            let dot = |p: &[f64; 2]| Dot {
                x: x.at(p[0]),
                y: y.at(p[1]),
                text: format!("{}: {} at {}", line.name, short(p[1]), short(p[0])),
            };
            let dots: Vec<Dot> = points.iter().map(dot).collect();
            let path: Vec<String> = dots.iter().map(|d| format!("{},{}", d.x, d.y)).collect();
            curves.push(Curve { name: &line.name, color: i % COLORS, path: path.join(" "), dots });
        }
        Drawn {
            size: SIZE,
            frame: [LEFT, TOP, right, bottom],
            x_ticks: x.ticks(),
            y_ticks: y.ticks(),
            curves,
        }
    }
}
