//! Rows of the tables, and the record that keeps them.

use serde::{Deserialize, Serialize};
use skylit::report::machine::Machine;
use std::fmt::{Display, Formatter, Result};
use std::path::PathBuf;

/// Pairs without a difference.
#[derive(Debug, Serialize, Deserialize)]
pub struct Rate {
    pub case: String,
    pub spp: [usize; 2],
    pub pairs: usize,
    pub different: usize,
    /// Two-sided binomial test of 1 %.
    pub binomial_p: f64,
    /// Verdicts of the whole picture's, the tiles' and the objects' tests alone.
    pub whole: usize,
    pub tiles: usize,
    pub objects: usize,
    pub tile_values: usize,
    /// Shares of tiles below 5 %, 1 % and 0.1 %.
    pub tiles_below: [f64; 3],
    pub kolmogorov_distance: f64,
    pub kolmogorov_p: f64,
    /// Whether the rate must be 1 %, and not only at most.
    pub exact: bool,
    pub passes: bool,
    pub seconds: f64,
}

/// Pairs with a difference.
#[derive(Debug, Serialize, Deserialize)]
pub struct Power {
    pub case: String,
    pub size: [u32; 2],
    pub spp: u32,
    pub pairs: usize,
    /// Pixels of the material.
    pub pixels: usize,
    /// Times the right object was found different.
    pub found: usize,
    pub different: usize,
    /// What the first pair said would have been seen with 95 %.
    pub promised: Option<f64>,
    /// One-sided binomial test of 95 %.
    pub binomial_p: f64,
    /// Whether that is no more than the bias: only then must it be found.
    pub is_promised: bool,
    pub passes: bool,
}

/// Pairs and a margin.
#[derive(Debug, Serialize, Deserialize)]
pub struct Margin {
    pub case: String,
    /// Difference over the margin.
    pub apart: f64,
    pub pairs: usize,
    pub equivalent: usize,
    pub different: usize,
    pub passes: bool,
}

fn percent(n: usize, of: usize) -> String {
    format!("{:.2} %", 100.0 * n as f64 / of as f64)
}

impl Rate {
    pub const HEADER: &str = "| pairs without a difference | samples | pairs | different | binomial p | whole | tiles | objects | \
         tiles below 5, 1, 0.1 % | Kolmogorov | p |\n|---|---|---|---|---|---|---|---|---|---|---|";
}

impl Display for Rate {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let share = |n: usize| percent(n, self.pairs);
        let [a, b, c] = self.tiles_below.map(|s| 100.0 * s);
        write!(
            f,
            "| {} | {}, {} | {} | {} | {:.3} | {} | {} | {} | {a:.2}, {b:.2}, {c:.3} | {:.4} | {:.2e} |{}",
            self.case,
            self.spp[0],
            self.spp[1],
            self.pairs,
            share(self.different),
            self.binomial_p,
            share(self.whole),
            share(self.tiles),
            share(self.objects),
            self.kolmogorov_distance,
            self.kolmogorov_p,
            if self.passes { "" } else { " not 1 %" },
        )
    }
}

impl Power {
    pub const HEADER: &str = "| one material changed | pixels | samples | its pixels | pairs | object found | different | promised |\n\
         |---|---|---|---|---|---|---|---|";
}

impl Display for Power {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let [w, h] = self.size;
        write!(
            f,
            "| {} | {w}x{h} | {} | {} | {} | {} | {} | {} |{}",
            self.case,
            self.spp,
            self.pixels,
            self.pairs,
            percent(self.found, self.pairs),
            percent(self.different, self.pairs),
            self.promised.map_or("-".into(), |p| format!("{:.2} %", 100.0 * p)),
            match (self.is_promised, self.passes) {
                (false, _) => " more noise than the promise allows",
                (_, false) => " less than 95 %",
                _ => "",
            },
        )
    }
}

impl Margin {
    pub const HEADER: &str = "| margin | apart by | pairs | equivalent | different |\n|---|---|---|---|---|";
}

impl Display for Margin {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        let share = |n: usize| percent(n, self.pairs);
        let (equivalent, different) = (share(self.equivalent), share(self.different));
        let miss = if self.passes { "" } else { " too many" };
        write!(
            f,
            "| {} | {} margins | {} | {equivalent} | {different} |{miss}",
            self.case, self.apart, self.pairs
        )
    }
}

/// All rows, with the machine of the last run.
#[derive(Default, Serialize, Deserialize)]
struct Record {
    machine: serde_json::Value,
    rates: Vec<Rate>,
    powers: Vec<Power>,
    margins: Vec<Margin>,
}

/// A record that is printed and written row by row, as all of it takes hours. Rows of the file that are not taken anew stay.
pub struct Book {
    path: Option<PathBuf>,
    record: Record,
    /// Whether every new row passes.
    pub passes: bool,
}

impl Book {
    /// Opens the record at `path`, where there may be none yet.
    pub fn open(path: Option<PathBuf>) -> Book {
        let text = path.as_ref().and_then(|p| std::fs::read(p).ok());
        let record: Option<Record> =
            text.map(|text| serde_json::from_slice(&text).expect("--json names a record of this benchmark"));
        let machine = serde_json::to_value(Machine::here()).expect("facts are text");
        Book { path, record: Record { machine, ..record.unwrap_or_default() }, passes: true }
    }

    pub fn rate(&mut self, row: Rate) {
        self.told(&row, row.passes);
        put(&mut self.record.rates, row, |r| (r.case.clone(), r.spp));
        self.write();
    }

    pub fn power(&mut self, row: Power) {
        self.told(&row, row.passes);
        put(&mut self.record.powers, row, |r| (r.case.clone(), r.size));
        self.write();
    }

    pub fn margin(&mut self, row: Margin) {
        self.told(&row, row.passes);
        put(&mut self.record.margins, row, |r| (r.case.clone(), r.apart.to_bits()));
        self.write();
    }

    fn told(&mut self, row: &dyn Display, passes: bool) {
        println!("{row}");
        self.passes &= passes;
    }

    fn write(&self) {
        if let Some(path) = &self.path {
            let text = serde_json::to_string_pretty(&self.record).expect("figures are text") + "\n";
            std::fs::write(path, text).expect("the record can be written");
        }
    }
}

/// In the place of the row of the same key, or else at the end.
fn put<R, K: PartialEq>(rows: &mut Vec<R>, row: R, key: impl Fn(&R) -> K) {
    match rows.iter().position(|r| key(r) == key(&row)) {
        Some(at) => rows[at] = row,
        None => rows.push(row),
    }
}
