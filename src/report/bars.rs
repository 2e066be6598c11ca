//! Horizontal bars in groups, with their values and the spread of these.

use serde::Serialize;

/// A bar chart.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Bars {
    /// What is shown, with its unit.
    pub caption: String,
    /// Names of the series that [`Bar::series`] counts into; one name or none needs no legend.
    pub series: Vec<String>,
    /// From top to bottom.
    pub groups: Vec<BarGroup>,
}

/// Bars that belong together.
#[derive(Debug, Clone, Default, Serialize)]
pub struct BarGroup {
    /// Above them; may be empty.
    pub label: String,
    /// From top to bottom.
    pub bars: Vec<Bar>,
}

/// A bar.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Bar {
    /// Before it.
    pub label: String,
    /// Its length; negative and not finite ones are drawn as 0.
    pub value: f64,
    /// The value as it is written behind the bar.
    pub text: String,
    /// From where to where the value varied, for the whisker.
    pub spread: Option<[f64; 2]>,
    /// Its colour: index into [`Bars::series`].
    pub series: usize,
}

/// A bar in percent of the chart's width.
#[derive(Debug, Serialize)]
pub(super) struct DrawnBar<'a> {
    label: &'a str,
    text: &'a str,
    color: usize,
    width: f64,
    whisker: Option<[f64; 2]>,
}

/// A group as the template draws it.
#[derive(Debug, Serialize)]
pub(super) struct DrawnGroup<'a> {
    label: &'a str,
    bars: Vec<DrawnBar<'a>>,
}

/// Colours that the style sheet has.
pub(super) const COLORS: usize = 8;

/// Rounded to what a screen can show, so that pages stay small and the same everywhere.
pub(super) fn rounded(x: f64) -> f64 {
    (x * 100.0).round() / 100.0
}

impl Bars {
    pub(super) fn drawn(&self) -> Vec<DrawnGroup<'_>> {
        let ends = |b: &Bar| [b.value, b.spread.map_or(b.value, |s| s[1])];
        let all = self.groups.iter().flat_map(|g| g.bars.iter().flat_map(ends));
        let longest = all.filter(|v| v.is_finite()).fold(0.0, f64::max);
        let percent = |v: f64| {
            let part = if longest > 0.0 { v / longest } else { 0.0 };
            rounded(100.0 * if part.is_finite() { part.clamp(0.0, 1.0) } else { 0.0 })
        };
        let mut groups = Vec::with_capacity(self.groups.len());
        for g in &self.groups {
            let bars = g.bars.iter().map(|b| DrawnBar {
                label: &b.label,
                text: &b.text,
                color: b.series % COLORS,
                width: percent(b.value),
                whisker: b.spread.map(|s| s.map(percent)),
            });
            groups.push(DrawnGroup { label: &g.label, bars: bars.collect() });
        }
        groups
    }
}
