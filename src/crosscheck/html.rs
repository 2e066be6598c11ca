//! A crosscheck as a page: the verdict, the counts, each kernel's picture against the first, and the places.

use super::Crosscheck;
use super::compare::Style;
use super::summary::{Line, Summary};
use crate::base::pixel_rect::PixelRect;
use crate::error::Result;
use crate::report::machine::Machine;
use crate::report::table::{Cell, Column, Table, Tone};
use crate::report::viewer::{ErrorMap, Region, Viewed, Viewer};
use crate::report::{Block, Details, Picture, Report, Section, Verdict};
use std::collections::HashSet;

/// Differences in the page's table; the record has all that are kept.
const LISTED: usize = 200;
/// Places that the viewer flies to.
const FLOWN_TO: usize = 24;
/// Pixels of all pictures together up to which the page keeps them bit for bit: some 20 MB.
const LOSSLESS: usize = 1_500_000;
/// A mark where rounding explains a difference.
const EXPLAINED: f32 = 0.5;

/// The page.
///
/// # Errors
/// [`crate::error::Error::Internal`] where a picture or the page cannot be made, which is a fault of ours.
pub fn page(check: &Crosscheck, summary: &Summary, machine: &Machine, input: &str) -> Result<String> {
    let verdict = match summary.passed {
        true => Verdict::ok(summary.verdict.clone()),
        false => Verdict::bad(summary.verdict.clone()),
    };
    let rays = format!(
        "{} camera, {} bounce, {} shadow rays; each asked of every kernel, alone and in a batch",
        summary.camera_rays, summary.bounce_rays, summary.shadow_rays
    );
    let mut report = Report::new("Crosscheck").subtitle(input).verdict(verdict).machine(machine);
    for k in &summary.kernels {
        report = report.fact(k.name.clone(), k.describe.clone());
    }
    report = report.section(
        Section::new("Rays")
            .prose(rays)
            .with(classes(summary))
            .with(scores(summary))
            .prose(
                "An answer is explained by rounding if a careful kernel in single precision may give it: the ray passes \
                through an edge or corner, grazes, meets something within the bound of tnear or tfar, or two surfaces within \
                the bounds of their distances. The bounds are derived for each ray and primitive. What is left is wrong.",
            ),
    );
    report.section(pictures(check)?).section(differences(summary)).to_html()
}

fn count(n: u64, bad: bool) -> Cell {
    let tone = match (n, bad) {
        (0, _) => Tone::Dim,
        (_, true) => Tone::Bad,
        _ => Tone::Plain,
    };
    Cell::number(n as f64, n.to_string()).tone(tone)
}

fn classes(s: &Summary) -> Block {
    if s.classes.is_empty() {
        return Block::Prose("No two answers differ.".into());
    }
    let mut table = Table::new([
        Column::text("difference"),
        Column::number("explained").help("by rounding"),
        Column::number("not explained"),
    ]);
    for c in &s.classes {
        table.push([Cell::from(c.class.text()), count(c.explained, false), count(c.unexplained, true)]);
    }
    table.into()
}

fn scores(s: &Summary) -> Table {
    let mut table = Table::new([
        Column::text("kernel"),
        Column::text("asked"),
        Column::number("as the oracle").help("of the rays on which not all agree"),
        Column::text("else by rounding"),
        Column::text("wrong"),
    ])
    .caption("Answers to the rays on which not all agree");
    for k in &s.kernels {
        for (style, score) in Style::ALL.into_iter().zip([&k.single, &k.batch]) {
            let wrong = Cell::from(score.wrong_text());
            table.push([
                Cell::from(k.name.as_str()),
                Cell::from(style.text()),
                count(score.right, false),
                Cell::from(score.explained_text()),
                if score.wrong_total() > 0 { wrong.tone(Tone::Bad) } else { wrong.tone(Tone::Dim) },
            ]);
        }
    }
    table
}

fn pictures(check: &Crosscheck) -> Result<Section> {
    let p = &check.pictures;
    let mut section = Section::new("Pictures");
    if let [only] = p.films.as_slice() {
        return Ok(section.with(Picture::of_film(only, check.names[0].clone())?));
    }
    for d in &p.against_first {
        let names = format!("{} against {}", d.name, check.names[0]);
        section = section.prose(match d.pixels.len() {
            0 => format!("{names}: the same bits in every pixel."),
            n => format!("{names}: {n} pixels differ, by {} at most.", d.largest),
        });
    }
    let Some(first) = p.films.first() else { return Ok(section) };
    let window = first.window();
    let shown = check.names.iter().zip(&p.films).zip(&check.kernels).map(|((name, film), kernel)| Viewed {
        facts: vec![("kernel".to_owned(), kernel.clone())],
        ..Viewed::of_film(name.clone(), film)
    });
    let places = Places::new(check, window);
    let pixels = window.area() * p.films.len();
    Ok(section.with(Viewer {
        maps: (1..p.films.len()).flat_map(|test| places.map(test)).collect(),
        regions: places.regions(),
        lossless: pixels <= LOSSLESS,
        ..Viewer::of_window(window, shown.collect())
    }))
}

/// Pixels in which kernels differ, the worst first, each once.
struct Places<'a> {
    window: PixelRect,
    /// Pixel, picture (from 1), whether rounding explains it, and what differs.
    all: Vec<([u32; 2], usize, bool, &'a str)>,
}

impl<'a> Places<'a> {
    fn new(check: &'a Crosscheck, window: PixelRect) -> Self {
        // Of every difference the first picture that is held against the reference will do.
        let on_rays = check.differences.iter().filter_map(|d| {
            let explained = d.judgement.is_explained();
            Some((d.source?.pixel, 1, explained, d.judgement.class.text()))
        });
        let against = check.pictures.against_first.iter().enumerate();
        let orphans = against
            .flat_map(|(i, d)| d.unexplained.iter().map(move |p| (*p, i + 1, false, "no ray differs there")));
        let mut all: Vec<_> = on_rays.chain(orphans).collect();
        // What nothing explains has the first word of a pixel.
        all.sort_by_key(|place| place.2);
        let mut seen = HashSet::new();
        all.retain(|([x, y], ..)| window.contains(*x, *y) && seen.insert([*x, *y]));
        Places { window, all }
    }

    /// A mark on each pixel; none where there is none.
    fn map(&self, test: usize) -> Option<ErrorMap> {
        if self.all.is_empty() {
            return None;
        }
        let mut values = vec![0.0f32; self.window.area()];
        for ([x, y], _, explained, _) in &self.all {
            // Three pixels wide, so that one is seen.
            for (dx, dy) in (0..9).map(|i| (i % 3, i / 3)) {
                let (x, y) = ((x + dx).wrapping_sub(1), (y + dy).wrapping_sub(1));
                if self.window.contains(x, y) {
                    let value = &mut values[self.window.index(x, y)];
                    *value = value.max(if *explained { EXPLAINED } else { 1.0 });
                }
            }
        }
        let metric = "kernels differ".to_owned();
        let help = format!(
            "pixels with a ray on which kernels differ, and those beside them: {EXPLAINED} where rounding explains it, 1 where \
             nothing does"
        );
        Some(ErrorMap { metric, help, test, values, high: Some(1.0) })
    }

    fn regions(&self) -> Vec<Region> {
        let region = |([x, y], test, explained, what): &([u32; 2], usize, bool, &str)| Region {
            label: format!(
                "({x}, {y}): {what}{}",
                if *explained { ", by rounding" } else { ", NOT EXPLAINED" }
            ),
            test: *test,
            rect: [(x - self.window.x0) as usize, (y - self.window.y0) as usize, 1, 1],
        };
        self.all.iter().take(FLOWN_TO).map(region).collect()
    }
}

fn differences(s: &Summary) -> Section {
    let section = Section::new("Differences");
    if s.differences.is_empty() {
        return section.prose("There is none.");
    }
    let mut table =
        Table::new(["difference", "where", "why", "answers", "oracle", "to ask it again"].map(Column::text));
    for d in s.differences.iter().take(LISTED) {
        table.push(row(d));
    }
    let hidden = s.differences.len().saturating_sub(LISTED);
    let section = match hidden {
        0 => section,
        n => {
            section.prose(format!("The first {LISTED}, the worst first; the record by --json has {n} more."))
        }
    };
    let all =
        Details { summary: "All of them".into(), open: true, items: Vec::new(), blocks: vec![table.into()] };
    section.with(all)
}

fn row(d: &Line) -> [Cell; 6] {
    let answers = d.answers.iter().map(|a| format!("{}: {}", a.who.join(", "), a.says));
    let tone = if d.explained { Tone::Plain } else { Tone::Bad };
    [
        Cell::from(d.class.text()),
        Cell::from(d.place()),
        Cell::from(d.reason.text()).tone(tone),
        Cell::from(answers.collect::<Vec<_>>().join("; ")),
        Cell::from(d.truth.as_str()),
        Cell::from(d.replay.as_str()),
    ]
}
