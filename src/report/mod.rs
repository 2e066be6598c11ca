//! L4: what the measuring verbs say. A [`Report`] becomes one HTML page that needs nothing beside itself: style, script
//! and pictures are inside of it, and it opens from a disk without a network. The same [`Table`] also prints on a
//! terminal, and [`machine::Machine`] says in every record on what the figures were taken.
//!
//! ```
//! use skylit::report::{Block, Report, Section, Verdict, table::{Cell, Column, Table}};
//! let table = Table::new([Column::text("kernel"), Column::number("Mrays/s").help("millions of rays a second")])
//!     .row([Cell::from("brute"), Cell::number(0.5, "0.50")]);
//! let page = Report::new("Rays")
//!     .verdict(Verdict::ok("all kernels agree"))
//!     .section(Section::new("Speed").with(Block::Prose("Each figure is a median.".into())).with(table));
//! assert!(page.to_html()?.contains("all kernels agree"));
//! # Ok::<(), skylit::Error>(())
//! ```

pub mod bars;
pub mod lines;
pub mod machine;
mod picture;
pub mod table;
#[cfg(test)]
mod tests;
mod view;
pub mod viewer;

use crate::error::{Error, Result};
use bars::Bars;
use lines::Lines;
use machine::Machine;
use minijinja::Environment;
use serde::Serialize;
use table::Table;
use viewer::Viewer;

/// A page. All text is plain: what HTML would read as markup is escaped.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Report {
    /// Of the page and its window.
    pub title: String,
    /// One line below it: what was examined.
    pub subtitle: String,
    /// What came out, in one sentence.
    pub verdict: Option<Verdict>,
    /// How it was taken: name and value; see [`Report::machine`].
    pub record: Vec<(String, String)>,
    /// The body.
    pub sections: Vec<Section>,
}

/// What came out.
#[derive(Debug, Clone, Serialize)]
pub struct Verdict {
    /// Colours the banner.
    pub outcome: Outcome,
    /// One sentence.
    pub text: String,
}

/// How a verdict is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// As it should be.
    Ok,
    /// Not as it should be.
    Bad,
    /// No judgement.
    Neutral,
}

impl Verdict {
    /// As it should be.
    pub fn ok(text: impl Into<String>) -> Self {
        Verdict { outcome: Outcome::Ok, text: text.into() }
    }

    /// Not as it should be.
    pub fn bad(text: impl Into<String>) -> Self {
        Verdict { outcome: Outcome::Bad, text: text.into() }
    }

    /// No judgement.
    pub fn neutral(text: impl Into<String>) -> Self {
        Verdict { outcome: Outcome::Neutral, text: text.into() }
    }
}

/// A part of the page under its heading.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Section {
    /// The heading.
    pub heading: String,
    /// What stands below it, in order.
    pub blocks: Vec<Block>,
}

/// A piece of a section.
#[derive(Debug, Clone, Serialize)]
#[serde(tag = "kind", content = "content", rename_all = "lowercase")]
pub enum Block {
    /// Text; an empty line parts paragraphs.
    Prose(String),
    /// A table that sorts by a click on a heading.
    Table(Table),
    /// Horizontal bars in groups.
    Bars(Bars),
    /// Curves.
    Lines(Lines),
    /// A picture. Neighbours stand side by side where there is room.
    Picture(Picture),
    /// Pictures to be looked at in many ways.
    #[serde(skip)]
    Viewer(Viewer),
    /// What is shown when asked for.
    Details(Details),
}

/// A picture with its caption.
#[derive(Debug, Clone, Serialize)]
pub struct Picture {
    /// A whole PNG file.
    #[serde(skip)]
    pub png: Vec<u8>,
    /// Below the picture, and read out in its place.
    pub caption: String,
    /// Whether enlarged pixels stay squares.
    pub pixelated: bool,
}

/// A summary that opens.
#[derive(Debug, Clone, Serialize)]
pub struct Details {
    /// Always seen.
    pub summary: String,
    /// Whether it is open from the start.
    pub open: bool,
    /// Lines of a list, before the blocks.
    pub items: Vec<String>,
    /// What else stands inside.
    pub blocks: Vec<Block>,
}

impl Details {
    /// A closed list.
    pub fn list(summary: impl Into<String>, items: impl IntoIterator<Item = String>) -> Self {
        Details {
            summary: summary.into(),
            open: false,
            items: items.into_iter().collect(),
            blocks: Vec::new(),
        }
    }
}

impl From<Table> for Block {
    fn from(t: Table) -> Self {
        Block::Table(t)
    }
}

impl From<Bars> for Block {
    fn from(b: Bars) -> Self {
        Block::Bars(b)
    }
}

impl From<Lines> for Block {
    fn from(l: Lines) -> Self {
        Block::Lines(l)
    }
}

impl From<Picture> for Block {
    fn from(p: Picture) -> Self {
        Block::Picture(p)
    }
}

impl From<Viewer> for Block {
    fn from(v: Viewer) -> Self {
        Block::Viewer(v)
    }
}

impl From<Details> for Block {
    fn from(d: Details) -> Self {
        Block::Details(d)
    }
}

impl Section {
    /// Without blocks.
    pub fn new(heading: impl Into<String>) -> Self {
        Section { heading: heading.into(), blocks: Vec::new() }
    }

    /// One more block.
    pub fn with(mut self, block: impl Into<Block>) -> Self {
        self.blocks.push(block.into());
        self
    }

    /// One more block of text.
    pub fn prose(self, text: impl Into<String>) -> Self {
        self.with(Block::Prose(text.into()))
    }
}

impl Report {
    /// Without content.
    pub fn new(title: impl Into<String>) -> Self {
        Report { title: title.into(), ..Report::default() }
    }

    /// What was examined.
    pub fn subtitle(mut self, text: impl Into<String>) -> Self {
        self.subtitle = text.into();
        self
    }

    /// What came out.
    pub fn verdict(mut self, verdict: Verdict) -> Self {
        self.verdict = Some(verdict);
        self
    }

    /// Appends the machine's facts to the record.
    pub fn machine(mut self, machine: &Machine) -> Self {
        self.record.extend(machine.facts());
        self
    }

    /// Appends a fact to the record.
    pub fn fact(mut self, name: impl Into<String>, value: impl Into<String>) -> Self {
        self.record.push((name.into(), value.into()));
        self
    }

    /// One more section.
    pub fn section(mut self, section: Section) -> Self {
        self.sections.push(section);
        self
    }

    /// The page.
    ///
    /// # Errors
    /// [`Error::Internal`] if the template fails, which is a fault of ours.
    pub fn to_html(&self) -> Result<String> {
        let fail = |e: minijinja::Error| Error::Internal(format!("cannot write the report: {e:#}"));
        let mut environment = Environment::new();
        environment.set_undefined_behavior(minijinja::UndefinedBehavior::Strict);
        // The ending `.html` is what switches the escaping on.
        environment.add_template("page.html", include_str!("page.html")).map_err(fail)?;
        environment.add_template("blocks.html", include_str!("blocks.html")).map_err(fail)?;
        let page = environment.get_template("page.html").map_err(fail)?;
        let content = Page {
            title: &self.title,
            subtitle: &self.subtitle,
            verdict: self.verdict.as_ref(),
            record: &self.record,
            sections: self.sections.iter().map(view::section).collect::<Result<_>>()?,
            css: include_str!("page.css"),
            js: scripts(),
            version: env!("CARGO_PKG_VERSION"),
        };
        page.render(minijinja::value::Serde(&content)).map_err(fail)
    }
}

/// What the template is given.
#[derive(Serialize)]
struct Page<'a> {
    title: &'a str,
    subtitle: &'a str,
    verdict: Option<&'a Verdict>,
    record: &'a [(String, String)],
    sections: Vec<view::SectionView<'a>>,
    css: &'a str,
    js: String,
    version: &'a str,
}

/// All of the page's script.
fn scripts() -> String {
    let parts = [
        include_str!("page.js"),
        include_str!("viewer/values.js"),
        include_str!("viewer/viewer.js"),
        include_str!("viewer/controls.js"),
    ];
    parts.concat()
}
