//! One program against others over all scenes: how many times as long they take to the same error.

use super::analyse::{Curve, SpeedUp, speed_up};
use super::measure::PixelSet;
use super::record::{Record, SceneRecord};
use crate::report::table::{Cell, Column, Table, Tone};

/// What another program needs for a scene with the best of its settings.
struct Best<'a> {
    settings: &'a str,
    gain: SpeedUp,
}

/// The best that `other` has against the first series of `own`.
fn best<'a>(own: &SceneRecord, other: &'a SceneRecord, set: PixelSet) -> Option<Best<'a>> {
    let first = Curve::new(own.series.first()?, &own.reference, set);
    let all = other.series.iter().filter_map(|series| {
        let gain = speed_up(&Curve::new(series, &other.reference, set), &first)?;
        Some(Best { settings: &series.name, gain })
    });
    all.min_by(|a, b| a.gain.ratio.value.total_cmp(&b.gain.ratio.value))
}

/// A line a scene of the first record, a column a further record: times that its best series takes, over that of the first
/// record's first series, to the same error; last the geometric means. None where there is nothing to compare with.
pub fn table(records: &[&Record], set: PixelSet) -> Option<Table> {
    let (own, others) = records.split_first()?;
    if others.is_empty() {
        return None;
    }
    let mut columns = vec![Column::text("scene")];
    columns.extend(others.iter().map(|r| {
        Column::number(r.program.clone())
            .help("times as long to the same relMSE, with the best of its settings; 95 % bootstrap interval")
    }));
    columns.push(Column::number("best").help("the least of the line"));
    let mut table = Table::new(columns);
    let mut logs: Vec<Vec<f64>> = vec![Vec::new(); others.len() + 1];
    for scene in &own.scenes {
        let found = others.iter().map(|r| {
            let theirs = r.scenes.iter().find(|s| s.name == scene.name && s.size == scene.size)?;
            best(scene, theirs, set)
        });
        let found: Vec<Option<Best>> = found.collect();
        let least = found.iter().flatten().map(|b| b.gain.ratio.value).min_by(f64::total_cmp);
        let Some(least) = least else { continue };
        let mut cells = vec![Cell::from(scene.name.as_str())];
        for (log, b) in logs.iter_mut().zip(&found) {
            log.extend(b.as_ref().map(|b| b.gain.ratio.value.ln()));
            cells.push(b.as_ref().map_or(Cell::none(), gain_cell));
        }
        logs[others.len()].push(least.ln());
        cells.push(Cell::number(least, format!("{least:.2}")));
        table.push(cells);
    }
    let means = logs.iter().map(|logs| {
        let mean = (logs.iter().sum::<f64>() / logs.len() as f64).exp();
        if logs.is_empty() { Cell::none() } else { Cell::number(mean, format!("{mean:.2}")) }
    });
    table.push(std::iter::once(Cell::from("geometric mean")).chain(means).collect::<Vec<_>>());
    Some(table)
}

fn gain_cell(b: &Best) -> Cell {
    let r = b.gain.ratio;
    let about = if b.gain.beyond { "~" } else { "" };
    let text = format!("{about}{:.2} [{:.2}, {:.2}] {}", r.value, r.low, r.high, b.settings);
    Cell::number(r.value, text).tone(match r {
        r if r.low > 1.0 => Tone::Good,
        r if r.high < 1.0 => Tone::Bad,
        _ => Tone::Plain,
    })
}
