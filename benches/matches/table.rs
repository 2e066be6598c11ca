//! The table of matches: rows in Markdown, and their place in a page.

use skylit::error::{Error, Result};
use std::collections::HashMap;
use std::path::Path;

const BEGIN: &str = "<!-- matches: begin -->";
const END: &str = "<!-- matches: end -->";
const HEAD: &str = "| scene | reference | metric | value | limit | verdict |\n|---|---|---|---:|---|---|\n";

/// How a row ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Within its limit.
    Match,
    /// Beyond its limit.
    Miss,
    /// The scene could not be rendered, or the pictures not compared.
    Failed,
    /// There is nothing to compare with.
    Skipped,
}

/// A row.
#[derive(Debug, Clone)]
pub struct Row {
    /// Scene file.
    pub scene: &'static str,
    /// Reference file.
    pub reference: &'static str,
    /// What was measured, by which kernel.
    pub metric: String,
    /// The figure, or what went wrong.
    pub value: String,
    /// The limit and where it comes from.
    pub limit: String,
    /// How it ended.
    pub verdict: Verdict,
}

impl Row {
    /// The row in Markdown, with a line break.
    pub fn line(&self) -> String {
        let verdict = match self.verdict {
            Verdict::Match => "match",
            Verdict::Miss => "**miss**",
            Verdict::Failed => "**failed**",
            Verdict::Skipped => "skipped: no data",
        };
        let clean = |s: &str| s.replace('|', "\\|").replace('\n', " ");
        format!(
            "| {} | {} | {} | {} | {} | {verdict} |\n",
            self.scene,
            self.reference,
            clean(&self.metric),
            clean(&self.value),
            clean(&self.limit)
        )
    }
}

/// The heading of the table.
pub fn head() -> &'static str {
    HEAD
}

/// Puts rows between the two marker lines of a page. Pairs of scene and reference that were not run keep their old rows;
/// `order` names all pairs there are.
///
/// # Errors
/// A page that cannot be read or written, or without the marker lines.
pub fn write(page: &Path, rows: &[Row], order: &[[&'static str; 2]]) -> Result<()> {
    let text = std::fs::read_to_string(page).map_err(|e| Error::file(page, "read", e))?;
    let parts = text.split_once(BEGIN).and_then(|(a, rest)| rest.split_once(END).map(|(b, c)| [a, b, c]));
    let Some([before, old, after]) = parts else {
        return Err(Error::content(page, format!("the lines {BEGIN} and {END} are missing")));
    };
    let mut kept: HashMap<[String; 2], String> = HashMap::new();
    for line in old.lines() {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        if let [_, scene, reference, _, ..] = cells[..] {
            let lines = kept.entry([scene.to_owned(), reference.to_owned()]).or_default();
            *lines += line;
            lines.push('\n');
        }
    }
    let mut table = String::from(HEAD);
    for pair in order {
        let new: String = rows.iter().filter(|r| [r.scene, r.reference] == *pair).map(Row::line).collect();
        match kept.get(&pair.map(str::to_owned)) {
            Some(old) if new.is_empty() => table += old,
            _ => table += &new,
        }
    }
    let text = format!("{before}{BEGIN}\n{table}{END}{after}");
    skylit::image::write::write_file(page, text.as_bytes())
}
