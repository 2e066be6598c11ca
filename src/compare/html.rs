//! A page for people: the figures, what they mean, and the pictures to be looked at.

use super::comparison::{Comparison, Figure};
use super::metrics::{self, Better};
use super::open::Source;
use super::pair::{Pair, Planes, Side, Space};
use super::present::{figures, overview, remarks};
use super::statistics::StatisticalResult;
use crate::report::machine::Machine;
use crate::report::table::Table;
use crate::report::viewer::{ErrorMap, Region, Viewed, Viewer};
use crate::report::{Block, Report, Section, Verdict};
use std::path::Path;

/// A comparison with its pictures.
pub struct Shown {
    /// What came out.
    pub comparison: Comparison,
    /// Values of the reference.
    pub reference: Vec<[f32; 3]>,
    /// Values of the test.
    pub test: Vec<[f32; 3]>,
    /// How either came to be: name and value.
    pub facts: [Vec<(String, String)>; 2],
    /// Whether the difference is more than noise.
    pub tested: Option<Tested>,
}

/// What a page shows of a test.
pub struct Tested {
    /// In words, whole, regions and tiles in a table, p-values in bars.
    section: Section,
    /// How surely each tile differs.
    map: Vec<f32>,
}

/// Tiles of this or less are drawn in the brightest colour: -log10 of a p-value.
const SUREST: f32 = 8.0;

impl Tested {
    fn new(result: &StatisticalResult) -> Self {
        let mut section = Section::new("Is one of them biased?").prose(format!(
            "{}.\n\nDesign: {}. Tiles of {} pixels a side; {}.",
            result.sentence,
            result.design_text(),
            result.tile,
            result.uniformity_text()
        ));
        section = section.with(result.table()).with(result.families_table());
        if result.uniformity.is_some() {
            section = section.with(result.histogram());
        }
        if let Some(e) = &result.equivalence {
            section = section.prose(e.sentence.clone());
        }
        Tested { section, map: result.p_map() }
    }
}

/// Facts that a picture's file tells of how it was made; the rest is too long to be read.
const FACTS: [&str; 14] = [
    "command",
    "software",
    "Software",
    "version",
    "scene",
    "seed",
    "spp",
    "samples",
    "integrator",
    "sampler",
    "kernel",
    "seconds",
    "comments",
    "Comment",
];

impl Shown {
    /// Keeps what a page needs.
    pub fn new(
        comparison: Comparison,
        pair: &Pair,
        [reference, test]: [&Source; 2],
        tested: Option<&StatisticalResult>,
    ) -> Self {
        let facts = |s: &Source| {
            let picture = &s.loaded.picture;
            let mut all = vec![("file".to_owned(), s.path.display().to_string())];
            all.extend(picture.metadata.iter().filter(|(k, _)| FACTS.contains(&k.as_str())).cloned());
            all
        };
        Shown {
            reference: colors(pair, Side::Reference),
            test: colors(pair, Side::Test),
            facts: [facts(reference), facts(test)],
            tested: tested.map(Tested::new),
            comparison,
        }
    }
}

/// Three values a pixel of whatever channels there are: the first three, or one three times. What did not count is NaN, which no
/// colour stands for.
fn colors(pair: &Pair, side: Side) -> Vec<[f32; 3]> {
    let planes: &Planes = pair.planes(side);
    let plane = |c: usize| &planes[c.min(planes.len() - 1)];
    let [r, g, b] = [plane(0), plane(1), plane(2)];
    let value = |i: usize| if pair.counts(i) { [r[i], g[i], b[i]] } else { [f32::NAN; 3] };
    (0..pair.pixels()).map(value).collect()
}

/// The page of some comparisons. Those of one reference and size stand in one viewer.
pub fn report(shown: &[Shown], machine: &Machine, lossless: bool) -> Report {
    let all: Vec<&Comparison> = shown.iter().map(|s| &s.comparison).collect();
    let references: Vec<&str> = all.iter().map(|c| c.reference.as_str()).collect();
    let one = references.windows(2).all(|w| w[0] == w[1]);
    let subtitle = match (shown, one) {
        ([only], _) => format!("{} against {}", only.comparison.test, only.comparison.reference),
        (many, true) => format!("{} pictures against {}", many.len(), many[0].comparison.reference),
        (many, false) => format!("{} pairs of pictures", many.len()),
    };
    let mut report = Report::new("Comparison").subtitle(subtitle).verdict(verdict(&all)).machine(machine);
    let mut rest = shown;
    while let Some(first) = rest.first() {
        let alike = |s: &&Shown| {
            let (a, b) = (&s.comparison, &first.comparison);
            a.reference == b.reference && a.size == b.size && a.origin == b.origin && a.space == b.space
        };
        let count = rest.iter().take_while(alike).count().max(1);
        let (group, others) = rest.split_at(count);
        report = report.section(pictures(group, lossless));
        rest = others;
    }
    report = report.section(numbers(shown));
    shown.iter().filter_map(|s| s.tested.as_ref()).fold(report, |r, t| r.section(t.section.clone()))
}

/// One sentence about all of them.
fn verdict(all: &[&Comparison]) -> Verdict {
    if all.iter().all(|c| c.identical) {
        return Verdict::ok("The pictures are equal, to the last bit of every value that counts.");
    }
    if let [only] = all {
        if let Some(cause) = &only.cause {
            let share = 100.0 * cause.explains;
            return Verdict::bad(format!("Likely cause: {} ({share:.0} % of the difference).", cause.text));
        }
        let of = |name: &str| only.value(name);
        let root = |v: f64| format!("{:.3} %", 100.0 * v.sqrt());
        let percent = of("relmse").map(|v| match of("relmse-trimmed").filter(|t| 2.0 * t < v) {
            Some(trimmed) => {
                let rest = root(trimmed);
                format!("relative RMSE {}, of all but a thousandth of the pixels {rest}", root(v))
            }
            None => format!("relative RMSE {}", root(v)),
        });
        let flip = of("flip").map(|v| format!("FLIP {v:.4}"));
        let parts: Vec<String> = [percent, flip].into_iter().flatten().collect();
        let text = if parts.is_empty() { "The pictures differ".to_owned() } else { parts.join(", ") };
        return Verdict::neutral(format!("{text}."));
    }
    let equal = all.iter().filter(|c| c.identical).count();
    Verdict::neutral(format!("{} pictures compared, {equal} of them equal to their reference.", all.len()))
}

/// Names that tell pictures apart: files without what all their folders have in common.
fn short(path: &str, alone: bool) -> String {
    let file = Path::new(path);
    match (alone, file.file_name()) {
        (true, Some(name)) => name.to_string_lossy().into_owned(),
        _ => path.to_owned(),
    }
}

fn pictures(group: &[Shown], lossless: bool) -> Section {
    let first = &group[0];
    let c = &first.comparison;
    let mut names: Vec<String> =
        std::iter::once(&c.reference).chain(group.iter().map(|s| &s.comparison.test)).cloned().collect();
    let files: Vec<String> = names.iter().map(|n| short(n, true)).collect();
    let unique = files.iter().collect::<std::collections::BTreeSet<_>>().len() == files.len();
    if unique {
        names = files;
    }
    let viewed = |name: &String, rgb: &Vec<[f32; 3]>, facts: &Vec<(String, String)>| Viewed {
        name: name.clone(),
        rgb: rgb.clone(),
        facts: facts.clone(),
    };
    let mut pictures = vec![viewed(&names[0], &first.reference, &first.facts[0])];
    let tests = group.iter().zip(&names[1..]);
    pictures.extend(tests.map(|(s, name)| viewed(name, &s.test, &s.facts[1])));
    let maps = group.iter().enumerate().flat_map(|(i, s)| maps(s, i + 1));
    let regions = group.iter().enumerate().flat_map(|(i, s)| regions(&s.comparison, i + 1, group.len() > 1));
    let viewer = Viewer {
        size: c.size,
        origin: c.origin,
        pictures,
        maps: maps.collect(),
        regions: regions.collect(),
        lossless,
        encoded: c.space == Space::Display.name(),
    };
    let heading =
        if group.len() == 1 { "Pictures".to_owned() } else { format!("Pictures against {}", names[0]) };
    Section::new(heading).with(viewer)
}

/// Maps that the page cannot work out of the values itself.
fn maps(shown: &Shown, test: usize) -> Vec<ErrorMap> {
    let mut all: Vec<ErrorMap> = shown.comparison.figures.iter().filter_map(|f| map(f, test)).collect();
    // A test is of whole pictures.
    if let Some(t) = shown.tested.as_ref().filter(|t| t.map.len() == shown.test.len()) {
        let help = "-log10 of the probability that chance alone brings as much as in this tile: 2 is one in a hundred".into();
        let values = t.map.clone();
        all.push(ErrorMap { metric: "-log10 p".into(), help, test, values, high: Some(SUREST) });
    }
    all
}

fn map(figure: &Figure, test: usize) -> Option<ErrorMap> {
    let metric = metrics::REGISTRY.iter().find(|m| m.name == figure.metric)?;
    let values = figure.map.clone().filter(|_| ["ssim", "flip", "hdr-flip"].contains(&metric.name))?;
    let turned = if metric.better == Better::Higher { "1 - " } else { "" };
    let name = format!("{turned}{}", metric.title);
    Some(ErrorMap { metric: name, help: metric.doc.to_owned(), test, values, high: Some(1.0) })
}

fn regions(c: &Comparison, test: usize, many: bool) -> impl Iterator<Item = Region> + '_ {
    let named = move |label: String| if many { format!("{}: {label}", short(&c.test, true)) } else { label };
    let told = if many { 3 } else { 8 };
    c.worst.iter().take(told).map(move |r| {
        let [x, y] = r.at;
        let [left, top] = [x - c.origin[0], y - c.origin[1]];
        let label = format!("({x}, {y}): {:.1} % of the relative squared error", 100.0 * r.share);
        Region { label: named(label), test, rect: [left, top, r.size[0], r.size[1]] }
    })
}

/// Figures with an explanation of each where the pointer rests.
fn numbers(shown: &[Shown]) -> Section {
    let mut section = Section::new("Figures");
    let explained = |mut table: Table, c: &Comparison| {
        for (row, figure) in table.rows.iter_mut().zip(&c.figures) {
            let metric = metrics::REGISTRY.iter().find(|m| m.name == figure.metric);
            row[0].help = metric.map_or(String::new(), |m| m.doc.to_owned());
        }
        table
    };
    if let [only] = shown {
        let c = &only.comparison;
        section = section.with(explained(figures(c), c));
        let text: Vec<String> = remarks(c);
        return section.with(Block::Prose(text.join("\n\n")));
    }
    let all: Vec<Comparison> = shown.iter().map(|s| s.comparison.clone()).collect();
    section = section.with(overview(&all));
    for c in &all {
        let inside = crate::report::Details {
            summary: format!("{} against {}", c.test, c.reference),
            open: false,
            items: remarks(c),
            blocks: vec![explained(figures(c), c).into()],
        };
        section = section.with(inside);
    }
    section
}
