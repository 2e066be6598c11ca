//! A crosscheck as a page: the verdict, the counts, each kernel's picture, their difference, and the places.

use super::compare::Style;
use super::summary::{Line, Summary};
use super::{Crosscheck, Difference};
use crate::color::Rgb;
use crate::error::Result;
use crate::image::tonemap::Look;
use crate::render::film::Film;
use crate::report::machine::Machine;
use crate::report::table::{Cell, Column, Table, Tone};
use crate::report::{Block, Details, Picture, Report, Section, Verdict};

/// Differences in the page's table; the record has all that are kept.
const LISTED: usize = 200;

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
    let Some(first) = p.films.first() else { return Ok(section) };
    for (name, film) in check.names.iter().zip(&p.films) {
        section = section.with(Picture::of_film(film, name.clone())?);
    }
    for (d, film) in p.against_first.iter().zip(p.films.iter().skip(1)) {
        let names = format!("{} - {}", d.name, check.names[0]);
        if d.pixels.is_empty() {
            section = section.prose(format!("{names}: the same bits in every pixel."));
            continue;
        }
        let scale = if d.largest > 0.0 { 1.0 / d.largest } else { 0.0 };
        let apart =
            |(a, b): (Rgb, Rgb)| Rgb::new((a.r - b.r).abs(), (a.g - b.g).abs(), (a.b - b.b).abs()) * scale;
        let text = format!(
            "{names}: {} pixels differ. Sizes of the differences, black is none and white is {}",
            d.pixels.len(),
            d.largest
        );
        section = section.with(picture(first, colors(first).zip(colors(film)).map(apart), text)?);
    }
    if !p.marked.is_empty() {
        section = section.with(places(check, first)?);
    }
    Ok(section)
}

fn colors(film: &Film) -> impl Iterator<Item = Rgb> + '_ {
    film.window().pixels().map(|(x, y)| film.mean(x, y))
}

/// Grey, with a mark on each pixel that holds a difference.
fn places(check: &Crosscheck, film: &Film) -> Result<Picture> {
    let grey = |c: Rgb| {
        let l = Look::default().apply(c).luminance() * 0.4;
        Rgb::new(l, l, l)
    };
    let mut colors: Vec<Rgb> = colors(film).map(grey).collect();
    let window = film.window();
    let mut mark = |[x, y]: [u32; 2], color: Rgb| {
        // Three pixels wide, so that one is seen.
        for (dx, dy) in (0..9).map(|i| (i % 3, i / 3)) {
            let (x, y) = ((x + dx).wrapping_sub(1), (y + dy).wrapping_sub(1));
            if window.contains(x, y) {
                colors[window.index(x, y)] = color;
            }
        }
    };
    let amber = Rgb::new(1.0, 0.5, 0.0);
    check.pictures.marked.iter().for_each(|p| mark(*p, amber));
    let bad = |d: &&Difference| !d.judgement.is_explained();
    let sources = check.differences.iter().filter(bad).filter_map(|d| d.source);
    let orphans = check.pictures.against_first.iter().flat_map(|d| d.unexplained.iter().copied());
    sources.map(|s| s.pixel).chain(orphans).for_each(|p| mark(p, Rgb::new(1.0, 0.0, 0.0)));
    let text = "Where kernels differ on a ray: orange where rounding explains it, red where nothing does";
    picture(film, colors.into_iter(), text.into())
}

/// Display-linear colours of a film's pixels.
fn picture(film: &Film, colors: impl Iterator<Item = Rgb>, caption: String) -> Result<Picture> {
    Picture::of_colors([film.window().width(), film.window().height()], colors, caption)
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
