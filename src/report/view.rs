//! From a report's parts to what the template walks over: charts become places on the page, pictures data URIs, and
//! pictures that are neighbours one row.

use super::bars::{COLORS, DrawnGroup};
use super::lines::Drawn;
use super::table::Table;
use super::viewer::Drawn as DrawnViewer;
use super::{Block, Picture, Section};
use crate::error::Result;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Serialize;

/// A section to be walked over.
#[derive(Serialize)]
pub(super) struct SectionView<'a> {
    heading: &'a str,
    blocks: Vec<BlockView<'a>>,
}

#[derive(Serialize)]
struct PictureView<'a> {
    uri: String,
    caption: &'a str,
    pixelated: bool,
}

#[derive(Serialize)]
struct Legend<'a> {
    name: &'a str,
    color: usize,
}

#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum BlockView<'a> {
    Prose { paragraphs: Vec<&'a str> },
    Table { table: &'a Table },
    Bars { caption: &'a str, legend: Vec<Legend<'a>>, groups: Vec<DrawnGroup<'a>> },
    Lines { caption: &'a str, x: &'a str, y: &'a str, drawn: Drawn<'a> },
    Pictures { pictures: Vec<PictureView<'a>> },
    Viewer { viewer: DrawnViewer },
    Details { summary: &'a str, open: bool, items: &'a [String], blocks: Vec<BlockView<'a>> },
}

pub(super) fn section(s: &Section) -> Result<SectionView<'_>> {
    Ok(SectionView { heading: &s.heading, blocks: blocks(&s.blocks)? })
}

fn blocks(list: &[Block]) -> Result<Vec<BlockView<'_>>> {
    let mut out = Vec::new();
    for block in list {
        let view = match block {
            Block::Prose(text) => {
                let paragraphs = text.split("\n\n").map(str::trim).filter(|p| !p.is_empty());
                BlockView::Prose { paragraphs: paragraphs.collect() }
            }
            Block::Table(table) => BlockView::Table { table },
            Block::Bars(b) => {
                let named = if b.series.len() > 1 { b.series.as_slice() } else { &[] };
                let legend = named.iter().enumerate().map(|(i, name)| Legend { name, color: i % COLORS });
                BlockView::Bars { caption: &b.caption, legend: legend.collect(), groups: b.drawn() }
            }
            Block::Lines(l) => {
                BlockView::Lines { caption: &l.caption, x: &l.x.label, y: &l.y.label, drawn: l.drawn() }
            }
            Block::Picture(p) => {
                if let Some(BlockView::Pictures { pictures }) = out.last_mut() {
                    pictures.push(picture(p));
                    continue;
                }
                BlockView::Pictures { pictures: vec![picture(p)] }
            }
            Block::Viewer(v) => BlockView::Viewer { viewer: v.drawn()? },
            Block::Details(d) => BlockView::Details {
                summary: &d.summary,
                open: d.open,
                items: &d.items,
                blocks: blocks(&d.blocks)?,
            },
        };
        out.push(view);
    }
    Ok(out)
}

fn picture(p: &Picture) -> PictureView<'_> {
    let uri = format!("data:image/png;base64,{}", STANDARD.encode(&p.png));
    PictureView { uri, caption: &p.caption, pixelated: p.pixelated }
}
