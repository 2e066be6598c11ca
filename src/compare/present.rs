//! Figures for a terminal, for Markdown, for spreadsheets.

use super::comparison::{Comparison, Figure};
use super::metrics::{self, Metric};
use crate::report::table::{Align, Cell, Column, Table};
use std::fmt::Write;

/// Where the worst thousandth of the pixels has at least this share of the relative squared error, it is said.
const MADE_BY_FEW: f64 = 0.5;

/// Five digits that count, without an exponent where that is easy to read.
pub fn digits(v: f64) -> String {
    let size = v.abs();
    if v == 0.0 {
        return "0".into();
    }
    if !(1e-3..1e6).contains(&size) {
        return format!("{v:.4e}");
    }
    let before = size.log10().floor() as i32;
    format!("{v:.*}", (4 - before).clamp(0, 7) as usize)
}

/// A figure as a cell.
fn cell(figure: &Figure) -> Cell {
    match figure.value {
        Some(v) => Cell::number(v, digits(v)),
        None if figure.infinite => Cell::from("inf"),
        None => Cell::none(),
    }
}

/// The measure's name with its unit.
fn heading(metric: &Metric) -> String {
    match metric.unit {
        "" => metric.title.into(),
        unit => format!("{} ({unit})", metric.title),
    }
}

fn metric_of(figure: &Figure) -> Option<&'static Metric> {
    metrics::REGISTRY.iter().find(|m| m.name == figure.metric)
}

/// All figures of one pair: a row a measure, a column a channel.
pub fn figures(c: &Comparison) -> Table {
    let channels = if c.channels.len() > 1 { c.channels.as_slice() } else { &[] };
    let mut columns = vec![Column::text("metric"), Column::number("value")];
    columns.extend(channels.iter().map(Column::number));
    columns.push(Column::text("how"));
    let mut table = Table::new(columns);
    for figure in &c.figures {
        let Some(metric) = metric_of(figure) else { continue };
        let mut row = vec![Cell::from(heading(metric)), cell(figure)];
        let of_channel = |i: usize| figure.channels.get(i).map(|v| Cell::number(*v, digits(*v)));
        row.extend((0..channels.len()).map(|i| of_channel(i).unwrap_or_default()));
        row.push(Cell::from(figure.note.as_str()));
        table.push(row);
    }
    table
}

/// A row a pair, a column a measure.
pub fn overview(all: &[Comparison]) -> Table {
    let rows: Vec<&Metric> =
        all.first().map_or(Vec::new(), |c| c.figures.iter().filter_map(metric_of).collect());
    let columns = rows.iter().map(|m| Column::number(heading(m)).help(m.doc));
    let mut table = Table::new(std::iter::once(Column::text("test")).chain(columns));
    for c in all {
        table.push(std::iter::once(Cell::from(c.test.as_str())).chain(c.figures.iter().map(cell)));
    }
    table
}

/// Sentences about one pair: what was compared, what was left out, what may have happened.
pub fn remarks(c: &Comparison) -> Vec<String> {
    let whole = c.size[0] * c.size[1];
    let counted = if c.pixels == whole { String::new() } else { format!(", of which {} count", c.pixels) };
    let mut all = vec![format!(
        "{}x{} pixels{counted}; channels {}; {} values",
        c.size[0],
        c.size[1],
        c.channels.join(", "),
        c.space
    )];
    all.extend(c.notes.iter().cloned());
    if c.identical {
        all.push("the pictures are equal, to the last bit of every value that counts".into());
    }
    if let [Some(whole), Some(trimmed)] = ["relmse", "relmse-trimmed"].map(|m| c.value(m)) {
        let share = 1.0 - trimmed / whole;
        if share >= MADE_BY_FEW {
            all.push(format!("a thousandth of the pixels makes {:.1} % of relMSE", 100.0 * share));
        }
    }
    if let Some(cause) = &c.cause {
        all.push(format!("likely cause: {} ({:.0} % of the difference)", cause.text, 100.0 * cause.explains));
    }
    all
}

/// For a terminal.
pub fn text(all: &[Comparison]) -> String {
    let mut out = String::new();
    if let [only] = all {
        let _ = writeln!(out, "{} against {}", only.test, only.reference);
        remarks(only).iter().for_each(|r| out += &format!("  {r}\n"));
        out += &figures(only).to_text();
        if let Some(worst) = only.worst.first().filter(|_| !only.identical) {
            let [x, y] = worst.at;
            let _ = writeln!(
                out,
                "worst region: {}x{} pixels from ({x}, {y}): {:.0} % of the relative squared error",
                worst.size[0],
                worst.size[1],
                100.0 * worst.share
            );
        }
        return out;
    }
    for c in all {
        let said = remarks(c);
        let _ = writeln!(out, "{} against {}: {}", c.test, c.reference, said.join("; "));
    }
    out + &overview(all).to_text()
}

/// A table of GitHub's Markdown.
pub fn markdown(all: &[Comparison]) -> String {
    let table = if let [only] = all { figures(only) } else { overview(all) };
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let safe = |text: &str| text.replace('|', "\\|").replace('\n', " ");
    let mut out = line(table.columns.iter().map(|c| safe(&c.heading)).collect());
    let rule = |align: Align| if align == Align::Right { "---:" } else { "---" };
    out += &line(table.columns.iter().map(|c| rule(c.align).to_owned()).collect());
    for row in &table.rows {
        out += &line(row.iter().map(|c| safe(&c.text)).collect());
    }
    out
}

/// A line for each figure: of all channels, and of each. Numbers are written in full.
pub fn csv(all: &[Comparison]) -> String {
    let quoted = |text: &str| match text.contains(['"', ',', '\n']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    };
    let mut out = String::from("reference,test,metric,channel,value\n");
    for c in all {
        let files = format!("{},{}", quoted(&c.reference), quoted(&c.test));
        for f in &c.figures {
            let value = match f.value {
                Some(v) => v.to_string(),
                None if f.infinite => "inf".into(),
                None => continue,
            };
            let _ = writeln!(out, "{files},{},all,{value}", f.metric);
            for (name, v) in c.channels.iter().zip(&f.channels) {
                let _ = writeln!(out, "{files},{},{},{v}", f.metric, quoted(name));
            }
        }
    }
    out
}
