//! Tables, a chart and a map of what was found.

use super::pair::{Design, Reason};
use super::verdict::{percent, signed};
use super::{Outcome, Place, Region, Share, StatisticalResult};
use crate::report::bars::{Bar, BarGroup, Bars};
use crate::report::table::{Cell, Column, Table, Tone};

/// Tiles of a table: those that are most surely different.
const LISTED: usize = 10;

impl StatisticalResult {
    /// Whole, objects and the tiles that stand out.
    pub fn table(&self) -> Table {
        let mut table = Table::new([
            Column::text("where"),
            Column::number("pixels").help("pixels with noise known in both pictures"),
            Column::number("difference")
                .help("of luminance: test less reference, over the reference, with its 95 % interval"),
            Column::number("from"),
            Column::number("to"),
            Column::number("red"),
            Column::number("green"),
            Column::number("blue"),
            Column::number("p")
                .help("how often chance alone brings as much or more, in any mixture of channels"),
            Column::number("would see")
                .help("bias of all channels alike that this test would have seen with 95 % probability"),
            Column::number("within").help("both are the same within this share, with 95 % confidence"),
            Column::text("verdict"),
        ]);
        table.push(row(&self.whole));
        self.regions.iter().for_each(|r| table.push(row(r)));
        let mut tiles: Vec<&Region> = self.tiles.iter().filter(|t| t.rejected).collect();
        tiles.sort_by(|a, b| a.p.unwrap_or(0.0).total_cmp(&b.p.unwrap_or(0.0)));
        tiles.into_iter().take(LISTED).for_each(|r| table.push(row(r)));
        table
    }

    /// The families and their part in the verdict.
    pub fn families_table(&self) -> Table {
        let mut table = Table::new([
            Column::text("tests of"),
            Column::number("tests"),
            Column::number("weight").help("share of the verdict's level"),
            Column::number("p").help("of all its tests together (Simes)"),
        ]);
        for f in &self.families {
            table.push([
                Cell::from(f.name),
                Cell::number(f.tests as f64, f.tests.to_string()),
                Cell::number(f.weight, format!("{:.2}", f.weight)),
                p_cell(Some(f.p)),
            ]);
        }
        table
    }

    /// For a terminal: the sentence, the tables, what p-values look like.
    pub fn to_text(&self) -> String {
        let mut text = format!("{}\n", self.sentence);
        if let Some(e) = &self.equivalence {
            text += &format!("{}\n", e.sentence);
        }
        text += &format!("\n{}\n{}", self.table().to_text(), self.families_table().to_text());
        if let Some(u) = &self.uniformity {
            text += &format!("\np-values of {} tiles: {}\n", u.values, self.uniformity_text());
        }
        text += &format!("design: {}\n", self.design_text());
        text
    }

    /// Whether p-values of tiles are those of pictures without a difference.
    pub fn uniformity_text(&self) -> String {
        match &self.uniformity {
            None => "too few tiles to tell".into(),
            Some(u) if u.p >= self.alpha => {
                format!("uniform, as without a difference (Kolmogorov p {:.2})", u.p)
            }
            // Few pixels have the noise, or numbers of samples are unlike.
            Some(u) if self.whole.finding.careful.is_some() && self.outcome == Outcome::NoDifference => {
                format!("not uniform (Kolmogorov p {:.1e}): the test is careful here", u.p)
            }
            Some(u) => format!("not uniform (Kolmogorov p {:.1e})", u.p),
        }
    }

    /// What is random in what, and why that was taken.
    pub fn design_text(&self) -> String {
        let [a, b] = self.replicates;
        let what = match self.design {
            Design::Independent => format!("independent, {a} and {b} replicates"),
            Design::Paired => format!("paired, {a} pairs of replicates"),
        };
        let why = match self.reason {
            Reason::Apart => "no sign of a common seed",
            Reason::SameSeed => "both name the same seed",
            Reason::SameNoise => "their noise goes together",
            Reason::Told => "as was asked",
        };
        let dealt = match self.deals {
            0 => String::new(),
            n => format!("; halves dealt anew {n} times"),
        };
        format!("{what}: {why}{dealt}")
    }

    /// p-values of tiles by twentieths, for a report: alike where there is no difference.
    pub fn histogram(&self) -> Bars {
        let bars = self.uniformity.iter().flat_map(|u| {
            u.histogram.iter().enumerate().map(|(i, n)| Bar {
                label: format!("{:.2}", i as f64 / u.histogram.len() as f64),
                value: *n as f64,
                text: n.to_string(),
                ..Bar::default()
            })
        });
        Bars {
            caption: "p-values of tiles, from 0 to 1 in twentieths: all alike where nothing differs".into(),
            series: Vec::new(),
            groups: vec![BarGroup { label: String::new(), bars: bars.collect() }],
        }
    }

    /// By pixel, for a heat map: the signed difference of its tile's luminance in standard errors where the tile is rejected,
    /// 0 where it is not, NaN where it has nothing to say.
    pub fn map(&self) -> Vec<f32> {
        self.by_tile(|t| match (t.p, t.rejected) {
            (None, false) => f32::NAN,
            (_, false) => 0.0,
            (_, true) => {
                let c = t.finding.contrasts[3];
                // Where hue alone differs, or nothing varies, there is no such number: the distance then, and the sign.
                let z = if c.error > 0.0 { c.difference / c.error } else { 0.0 };
                let far = t.finding.t2.sqrt();
                let size = if z.abs() > 3.0 { z.abs() } else { far.max(3.0) };
                size.min(1e6).copysign(c.difference) as f32
            }
        })
    }

    /// By pixel, for a heat map: -log10 of its tile's p; NaN where it has none.
    pub fn p_map(&self) -> Vec<f32> {
        self.by_tile(|t| match (t.p, t.exact) {
            (_, true) => 300.0,
            (Some(p), _) => -(p.max(1e-300).log10()) as f32,
            (None, _) => f32::NAN,
        })
    }

    fn by_tile(&self, value: impl Fn(&Region) -> f32) -> Vec<f32> {
        let [width, height] = self.size;
        let mut plane = vec![f32::NAN; width * height];
        for tile in &self.tiles {
            if let Place::Tile { x0, y0, x1, y1 } = tile.place {
                let value = value(tile);
                (y0..y1).for_each(|y| plane[y * width + x0..y * width + x1].fill(value));
            }
        }
        plane
    }
}

fn p_cell(p: Option<f64>) -> Cell {
    match p {
        None => Cell::none(),
        Some(p) if p < 1e-4 => Cell::number(p, format!("{p:.1e}")),
        Some(p) => Cell::number(p, format!("{p:.4}")),
    }
}

fn row(r: &Region) -> [Cell; 12] {
    let share = |s: &Option<Share>, of: fn(&Share) -> f64| match s {
        Some(s) => Cell::number(of(s), signed(of(s))),
        None => Cell::none(),
    };
    let plain = |v: Option<f64>| match v {
        Some(v) => Cell::number(v, percent(v)),
        None => Cell::none(),
    };
    let verdict = match (r.exact, r.rejected, r.p) {
        (true, ..) => Cell::from("exact difference").tone(Tone::Bad),
        (_, true, _) => Cell::from("different").tone(Tone::Bad),
        (_, _, None) => Cell::from("no noise").tone(Tone::Dim),
        _ if r.place == Place::Whole => Cell::from(""),
        _ => Cell::from("not found different"),
    };
    [
        Cell::from(r.place.text()),
        Cell::number(r.pixels as f64, r.pixels.to_string()),
        share(&r.luminance, |s| s.value),
        share(&r.luminance, |s| s.low),
        share(&r.luminance, |s| s.high),
        share(&r.channels[0], |s| s.value),
        share(&r.channels[1], |s| s.value),
        share(&r.channels[2], |s| s.value),
        p_cell(r.p),
        plain(r.detectable),
        plain(r.within),
        verdict,
    ]
}
