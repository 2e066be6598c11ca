//! Tables: sorted by a click on a page, in columns on a terminal.

use serde::Serialize;

/// Rows under headings.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Table {
    /// Above the table; may be empty.
    pub caption: String,
    /// From left to right.
    pub columns: Vec<Column>,
    /// Each with a cell for every column; missing ones are empty.
    pub rows: Vec<Vec<Cell>>,
}

/// A column.
#[derive(Debug, Clone, Serialize)]
pub struct Column {
    /// Its name.
    pub heading: String,
    /// What the figures are, shown where the pointer rests; may be empty.
    pub help: String,
    /// To which side its cells stand.
    pub align: Align,
}

/// To which side.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Align {
    /// For text.
    Left,
    /// For numbers.
    Right,
}

/// A cell.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Cell {
    /// What is seen.
    pub text: String,
    /// What it sorts by; the text if there is none.
    pub value: Option<f64>,
    /// How it is meant.
    pub tone: Tone,
    /// An explanation, shown where the pointer rests or the keyboard's focus is; may be empty.
    pub help: String,
}

/// How a cell is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Tone {
    /// As it is.
    #[default]
    Plain,
    /// To be pleased about.
    Good,
    /// To be worried about.
    Bad,
    /// To be passed over.
    Dim,
}

impl Column {
    /// Of text, to the left.
    pub fn text(heading: impl Into<String>) -> Self {
        Column { heading: heading.into(), help: String::new(), align: Align::Left }
    }

    /// Of numbers, to the right.
    pub fn number(heading: impl Into<String>) -> Self {
        Column { align: Align::Right, ..Column::text(heading) }
    }

    /// What the figures are.
    pub fn help(mut self, text: impl Into<String>) -> Self {
        self.help = text.into();
        self
    }
}

impl Cell {
    /// A number as it is written; one that is not finite sorts as text.
    pub fn number(value: f64, text: impl Into<String>) -> Self {
        Cell { text: text.into(), value: value.is_finite().then_some(value), ..Cell::default() }
    }

    /// Where there is nothing to say.
    pub fn none() -> Self {
        Cell::from("-").tone(Tone::Dim)
    }

    /// What it is.
    pub fn help(mut self, text: impl Into<String>) -> Self {
        self.help = text.into();
        self
    }

    /// How it is meant.
    pub fn tone(mut self, tone: Tone) -> Self {
        self.tone = tone;
        self
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Cell { text: text.to_owned(), ..Cell::default() }
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Cell { text, ..Cell::default() }
    }
}

impl Table {
    /// Without rows.
    pub fn new(columns: impl IntoIterator<Item = Column>) -> Self {
        Table { caption: String::new(), columns: columns.into_iter().collect(), rows: Vec::new() }
    }

    /// What stands above it.
    pub fn caption(mut self, text: impl Into<String>) -> Self {
        self.caption = text.into();
        self
    }

    /// One more row.
    pub fn row(mut self, cells: impl IntoIterator<Item = Cell>) -> Self {
        self.push(cells);
        self
    }

    /// Appends a row.
    pub fn push(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// For a terminal: aligned columns, two blanks apart, a line per row, the headings first.
    pub fn to_text(&self) -> String {
        let text = |row: &[Cell], i: usize| row.get(i).map_or("", |c| c.text.as_str()).to_owned();
        let mut lines: Vec<Vec<String>> = vec![self.columns.iter().map(|c| c.heading.clone()).collect()];
        lines.extend(self.rows.iter().map(|r| (0..self.columns.len()).map(|i| text(r, i)).collect()));
        let width = |i: usize| lines.iter().map(|l| l[i].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        let mut out = String::new();
        if !self.caption.is_empty() {
            out += &format!("{}\n", self.caption);
        }
        for line in &lines {
            let mut row = String::new();
            for ((cell, width), column) in line.iter().zip(&widths).zip(&self.columns) {
                row += &match column.align {
                    Align::Left => format!("{cell:<width$}  "),
                    Align::Right => format!("{cell:>width$}  "),
                };
            }
            out += row.trim_end();
            out.push('\n');
        }
        out
    }
}
