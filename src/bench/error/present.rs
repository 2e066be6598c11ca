//! A measurement for people: tables for the terminal, a plot, and a page.

use super::analyse::{Curve, Estimate, Interval, Reach, SpeedUp, speed_up};
use super::measure::PixelSet;
use super::peers;
use super::record::{Record, ReferenceRecord, SceneRecord, Series};
use crate::report::lines::{Axis, Line, Lines};
use crate::report::table::{Cell, Column, Table, Tone};
use crate::report::viewer::Viewer;
use crate::report::{Details, Report, Section, Verdict};

/// Relative root mean square errors whose times are told.
const LEVELS: [f64; 3] = [0.05, 0.02, 0.01];

/// A series with the reference that it was measured against: its own.
struct Row<'a> {
    series: &'a Series,
    reference: &'a ReferenceRecord,
}

/// What several records hold of one scene.
pub struct Gathered<'a> {
    name: &'a str,
    size: [u32; 2],
    rows: Vec<Row<'a>>,
}

/// The scenes of the first record, each with all series of that name in any record.
pub fn gather<'a>(records: &[&'a Record]) -> Vec<Gathered<'a>> {
    let mut out: Vec<Gathered<'a>> = Vec::new();
    for (i, record) in records.iter().enumerate() {
        for SceneRecord { name, size, reference, series, .. } in &record.scenes {
            let rows = series.iter().map(|series| Row { series, reference });
            match out.iter_mut().find(|g| g.name == name) {
                Some(found) => found.rows.extend(rows),
                None if i == 0 => out.push(Gathered { name, size: *size, rows: rows.collect() }),
                None => {}
            }
        }
    }
    out
}

impl<'a> Gathered<'a> {
    fn curves(&self, set: PixelSet) -> Vec<(&'a str, Curve<'a>)> {
        let curve = |r: &Row<'a>| (r.series.name.as_str(), Curve::new(r.series, r.reference, set));
        self.rows.iter().map(curve).collect()
    }

    /// Every sample count of every series.
    pub fn points_table(&self, set: PixelSet) -> Table {
        let mut table = Table::new([
            Column::text("settings"),
            Column::number("spp").help("samples a pixel"),
            Column::number("s").help("seconds of rendering, median of the runs"),
            Column::number("MSE").help("mean over pixels and channels of the squared error"),
            Column::number("relMSE").help(
                "mean of (x - r)^2 / (r^2 + 0.01 m^2), m the mean luminance of the reference; its own noise taken off; 95 %",
            ),
            Column::number("bias %").help("mean error over mean luminance, 95 %: an honest method's spans 0"),
            Column::number("efficiency").help("1 / (relMSE x seconds)"),
        ]);
        for (name, curve) in self.curves(set) {
            for e in curve.estimates() {
                table.push(point_row(name, &e));
            }
        }
        table
    }

    /// A line a series: slope, times to an error, speed-up over the first.
    pub fn summary_table(&self, set: PixelSet) -> Table {
        let mut columns = vec![
            Column::text("settings"),
            Column::number("slope").help(
                "exponent with which the squared error falls with the samples; independent ones have -1",
            ),
        ];
        columns.extend(LEVELS.map(|l| {
            Column::number(format!("s to {:.0} %", 100.0 * l))
                .help("seconds to this root of relMSE; ~ where the measured points do not span it")
        }));
        columns.push(
            Column::number("speed-up").help(
                "times less time to the same relMSE than the first row, with its 95 % bootstrap interval",
            ),
        );
        let mut table = Table::new(columns);
        let curves = self.curves(set);
        for (i, (name, curve)) in curves.iter().enumerate() {
            let slope = curve.slope();
            let mut cells = vec![Cell::from(*name), Cell::number(slope, format!("{slope:.2}"))];
            cells.extend(LEVELS.map(|l| curve.time_to(l).map_or(Cell::none(), reach_cell)));
            let gain = if i == 0 { None } else { speed_up(&curves[0].1, curve) };
            cells.push(gain.map_or(Cell::none(), speed_cell));
            table.push(cells);
        }
        table
    }

    /// Error against time.
    pub fn plot(&self, set: PixelSet) -> Lines {
        let what = match set {
            PixelSet::All => "all pixels",
            PixelSet::Surfaces => "pixels that surfaces cover",
        };
        let [w, h] = self.size;
        let line = |(name, curve): (&str, Curve)| Line {
            name: name.to_owned(),
            points: curve.estimates().iter().map(|e| [e.seconds, e.relmse.value.sqrt()]).collect(),
        };
        Lines {
            caption: format!("{}: error against time, {w} x {h}, {what}", self.name),
            x: Axis { label: "seconds of rendering".into(), log: true },
            y: Axis { label: "relative root mean square error".into(), log: true },
            series: self.curves(set).into_iter().map(line).collect(),
        }
    }

    fn reference_line(&self) -> String {
        let Some(r) = self.rows.first().map(|r| r.reference) else { return String::new() };
        let noise = r.noise.map_or("its noise is not known and not taken off".to_owned(), |n| {
            format!("its own relMSE of {} is taken off", digits(n.all.relmse))
        });
        let spp = if r.spp > 0 { format!("{} samples a pixel", r.spp) } else { "given".to_owned() };
        format!("reference: {spp}; {noise}; surfaces cover {:.1} % of the pixels", 100.0 * r.surfaces)
    }
}

fn point_row(name: &str, e: &Estimate) -> Vec<Cell> {
    let bias = Interval { value: 100.0 * e.bias.value, low: 100.0 * e.bias.low, high: 100.0 * e.bias.high };
    let spans_zero = bias.low <= 0.0 && 0.0 <= bias.high;
    let half = |i: &Interval| 0.5 * (i.high - i.low);
    vec![
        Cell::from(name),
        Cell::number(e.spp as f64, e.spp.to_string()),
        Cell::number(e.seconds, digits(e.seconds)),
        Cell::number(e.mse, digits(e.mse)),
        Cell::number(
            e.relmse.value,
            format!("{} ±{:.0}%", digits(e.relmse.value), 100.0 * half(&e.relmse) / e.relmse.value),
        ),
        Cell::number(bias.value, format!("{:+.3} ±{:.3}", bias.value, half(&bias))).tone(if spans_zero {
            Tone::Plain
        } else {
            Tone::Bad
        }),
        Cell::number(e.efficiency, digits(e.efficiency)),
    ]
}

fn reach_cell(r: Reach) -> Cell {
    let text = format!("{}{}", if r.beyond { "~" } else { "" }, digits(r.seconds));
    Cell::number(r.seconds, text).tone(if r.beyond { Tone::Dim } else { Tone::Plain })
}

fn speed_cell(s: SpeedUp) -> Cell {
    let r = s.ratio;
    let about = if s.beyond { "~" } else { "" };
    let text = format!("{about}{:.2} [{:.2}, {:.2}] at {:.1} %", r.value, r.low, r.high, 100.0 * s.error);
    Cell::number(r.value, text).tone(match r {
        r if r.low > 1.0 => Tone::Good,
        r if r.high < 1.0 => Tone::Bad,
        _ => Tone::Plain,
    })
}

/// Three digits that count, in the usual or in scientific form.
fn digits(v: f64) -> String {
    match v.abs() {
        0.0 => "0".into(),
        a if (0.01..1e5).contains(&a) => {
            let decimals = (2 - a.log10().floor() as i32).max(0) as usize;
            format!("{v:.decimals$}")
        }
        a if a.is_finite() => format!("{v:.2e}"),
        _ => "-".into(),
    }
}

/// The whole of it for a terminal.
pub fn text(records: &[&Record], set: PixelSet) -> String {
    let mut out = String::new();
    for scene in gather(records) {
        let [w, h] = scene.size;
        out += &format!("{}, {w} x {h}; {}\n\n", scene.name, scene.reference_line());
        out += &scene.points_table(set).to_text();
        out += &format!("\n{}\n", scene.summary_table(set).to_text());
    }
    if let Some(table) = peers::table(records, set) {
        out += &format!("times as long to the same error\n\n{}\n", table.to_text());
    }
    out
}

/// The page. `shown` are pictures of each scene at about equal time, as far as there are any.
pub fn page(records: &[&Record], set: PixelSet, shown: Vec<Option<Viewer>>, report: Report) -> Report {
    let scenes = gather(records);
    let other = match set {
        PixelSet::All => PixelSet::Surfaces,
        PixelSet::Surfaces => PixelSet::All,
    };
    let names: Vec<&str> = scenes.iter().map(|s| s.name).collect();
    let mut report = report.subtitle(names.join(", ")).verdict(Verdict::neutral(verdict(&scenes, set)));
    if let Some(table) = peers::table(records, set) {
        report = report.section(Section::new("Times as long to the same error").with(table));
    }
    let shown = shown.into_iter().chain(std::iter::repeat(None));
    for (scene, viewer) in scenes.iter().zip(shown) {
        let mut section = Section::new(scene.name)
            .with(scene.plot(set))
            .with(scene.summary_table(set))
            .with(scene.points_table(set))
            .prose(scene.reference_line());
        if let Some(viewer) = viewer {
            section = section.prose("At about equal time:").with(viewer);
        }
        let summary = match other {
            PixelSet::All => "Over all pixels",
            PixelSet::Surfaces => "Over the pixels that surfaces cover",
        };
        let blocks = vec![
            scene.plot(other).into(),
            scene.summary_table(other).into(),
            scene.points_table(other).into(),
        ];
        let details = Details { summary: summary.into(), open: false, items: Vec::new(), blocks };
        report = report.section(section.with(details));
    }
    report
}

/// One sentence: who is fastest to the same error.
fn verdict(scenes: &[Gathered], set: PixelSet) -> String {
    let best = |g: &Gathered| -> Option<String> {
        let curves = g.curves(set);
        let (first, rest) = curves.split_first()?;
        let gains = rest.iter().filter_map(|(n, c)| Some((*n, speed_up(&first.1, c)?.ratio.value)));
        let (name, gain) = gains.max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(match gain > 1.0 {
            true => format!("{}: {name} needs {gain:.2} times less time than {}", g.name, first.0),
            false => format!("{}: nothing is faster than {}", g.name, first.0),
        })
    };
    let all: Vec<String> = scenes.iter().filter_map(best).collect();
    match all.is_empty() {
        true => "Error against time; there is nothing to compare with.".into(),
        false => format!("To the same error: {}.", all.join("; ")),
    }
}
