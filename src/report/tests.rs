//! Pages: whole, escaped, and without a word to the network.

use super::bars::{Bar, BarGroup, Bars};
use super::lines::{Axis, Line, Lines, short};
use super::table::{Cell, Column, Table, Tone};
use super::*;

/// What would break a page that does not escape it.
const HOSTILE: &str = r#"<script>alert("x")</script> & 'q' </style> {{ title }}"#;

/// The smallest picture that is one.
const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Every component, with `text` wherever text can stand.
fn page(text: &str) -> Report {
    let t = || text.to_owned();
    let table = Table::new([Column::text(t()).help(t()), Column::number(t())])
        .caption(t())
        .row([Cell::from(t()), Cell::number(1.5, t()).tone(Tone::Good)])
        .row([Cell::none()]);
    let bar = |value, spread| Bar { label: t(), value, text: t(), spread, series: 1 };
    let bars = Bars {
        caption: t(),
        series: vec![t(), t()],
        groups: vec![BarGroup { label: t(), bars: vec![bar(2.0, Some([1.5, 4.0])), bar(f64::NAN, None)] }],
    };
    let points = vec![[1e5, 2.0], [1e6, 30.0], [f64::NAN, 1.0], [0.0, 1.0]];
    let lines = Lines {
        caption: t(),
        x: Axis { label: t(), log: true },
        y: Axis { label: t(), log: true },
        series: vec![Line { name: t(), points }, Line::default()],
    };
    let picture = Picture { png: PNG.to_vec(), caption: t(), pixelated: true };
    let inside = Details { blocks: vec![table.clone().into()], ..Details::list(t(), [t(), t()]) };
    let details = Details { open: true, blocks: vec![inside.into()], ..Details::list(t(), []) };
    let section = Section::new(t()).prose(format!("{text}\n\n{text}")).with(table).with(bars).with(lines);
    let section = section.with(picture.clone()).with(picture).with(details);
    Report::new(t())
        .subtitle(t())
        .verdict(Verdict::bad(t()))
        .machine(&Machine::here())
        .fact(t(), t())
        .section(section)
}

/// The tags of a page in order, script and style left out.
fn tags(html: &str) -> Vec<&str> {
    let mut all = Vec::new();
    let mut rest = html;
    while let Some(at) = rest.find('<') {
        rest = &rest[at + 1..];
        let end = rest.find('>').expect("every tag is closed");
        let tag = &rest[..end];
        assert!(!tag.contains('<'), "a tag within a tag: {tag}");
        all.push(tag);
        rest = &rest[end + 1..];
        for raw in ["script", "style"] {
            if tag == raw {
                rest = &rest[rest.find(&format!("</{raw}")).expect("closed")..];
            }
        }
    }
    all
}

/// Panics unless every element is closed, in the order that they were opened.
fn assert_balanced(html: &str) {
    let mut open: Vec<&str> = Vec::new();
    for tag in tags(html) {
        if let Some(closed) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(closed), "closed out of order");
            continue;
        }
        let element = tag.split_whitespace().next().unwrap_or_default();
        assert_eq!(tag.matches('"').count() % 2, 0, "quotes in {tag}");
        if !["!doctype", "meta", "img"].contains(&element) {
            open.push(element);
        }
    }
    assert!(open.is_empty(), "left open: {open:?}");
}

#[test]
fn pages_are_well_formed_whatever_the_text() {
    for text in ["plain", "", HOSTILE, "]]> --> \u{0} \u{202e}"] {
        assert_balanced(&page(text).to_html().unwrap());
    }
    assert_balanced(&Report::default().to_html().unwrap());
}

#[test]
fn text_is_never_markup() {
    let plain = tags(&page("plain").to_html().unwrap()).len();
    let html = page(HOSTILE).to_html().unwrap();
    assert_eq!(tags(&html).len(), plain, "hostile text adds no tag");
    assert!(!html.contains("<script>alert"));
    assert!(html.contains("&lt;script&gt;alert"));
    assert!(html.contains("{{ title }}"), "text is no template either");
}

#[test]
fn pages_need_nothing_beside_themselves() {
    let html = page("plain").to_html().unwrap();
    for reach in ["http://", "https://", "//", "url(", "@import", "<link", "src=\"/", "href"] {
        let all: Vec<_> = html.match_indices(reach).collect();
        // Two slashes start a comment of the script.
        let harmless = |at: usize| reach == "//" && html[at..].starts_with("// ");
        assert!(all.iter().all(|(at, _)| harmless(*at)), "{reach}");
    }
    assert!(html.contains("src=\"data:image/png;base64,iVBORw0KGgo=\""), "pictures are inside");
    assert_eq!(html.matches("class=\"pictures\"").count(), 1, "neighbours stand in one row");
}

#[test]
fn bars_are_as_long_as_their_values() {
    let html = page("plain").to_html().unwrap();
    // The longest whisker, 4, fills the chart: the bar of 2 is half of it, and no number has no length.
    assert!(html.contains("width=\"50.0%\"") && html.contains("width=\"0.0%\""));
    assert!(html.contains("x1=\"37.5%\" x2=\"100.0%\""));
}

#[test]
fn axes_have_marks_however_short_they_are() {
    for log in [false, true] {
        for ends in [[66.8, 70.3], [1.0, 3.0], [1e3, 9e8], [5.0, 5.0]] {
            let points = ends.map(|v| [v, v]).to_vec();
            let axis = || Axis { label: String::new(), log };
            let series = vec![Line { name: String::new(), points }];
            let lines = Lines { caption: String::new(), x: axis(), y: axis(), series };
            let html = Report::new("").section(Section::new("").with(lines)).to_html().unwrap();
            assert!(html.matches("text-anchor=\"end\"").count() >= 3, "{ends:?}, log: {log}");
        }
    }
}

#[test]
fn numbers_on_axes_are_short() {
    let all = [0.0, 0.02, 1.0, 1500.0, 2e7, 3e9, 1e-5, 5e13];
    assert_eq!(all.map(short), ["0", "0.02", "1", "1.5k", "20M", "3G", "1e-5", "5e13"]);
}

#[test]
fn tables_stand_in_columns_on_a_terminal() {
    let table = Table::new([Column::text("kernel"), Column::number("Mrays/s"), Column::text("note")])
        .row([Cell::from("embree"), Cell::number(10.25, "10.25"), Cell::from("é")])
        .row([Cell::from("b"), Cell::number(0.5, "0.50")]);
    let expected = "kernel  Mrays/s  note\nembree    10.25  é\nb          0.50\n";
    assert_eq!(table.to_text(), expected);
}
