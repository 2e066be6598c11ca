//! A crosscheck in words, for the terminal, and as a record.

use super::compare::Style;
use super::crossing::Doubt;
use super::judge::{Class, Fault, Ruling};
use super::locate::{RayKind, Source};
use super::replay::{name_of, say, write_ray};
use super::tally::{Score, Tally};
use super::{Crosscheck, Difference};
use crate::base::intersectable::QueryKind;
use crate::scene::Scene;
use serde::Serialize;
use std::fmt;

/// Differences that the text prints.
const PRINTED: usize = 10;

/// A crosscheck with all that people need to read it.
#[derive(Debug, Serialize)]
pub struct Summary {
    /// One line.
    pub verdict: String,
    /// Whether everything is explained.
    pub passed: bool,
    /// The kernels; the first is the one whose rays were asked.
    pub kernels: Vec<KernelLine>,
    /// Rays of the render.
    pub camera_rays: u64,
    /// Rays of the render.
    pub bounce_rays: u64,
    /// Rays of the render.
    pub shadow_rays: u64,
    /// Rays that all kernels were asked, each in two styles.
    pub compared: u64,
    /// Differences by class; classes without any are left out.
    pub classes: Vec<ClassLine>,
    /// Differences for which the oracle looked at every primitive; at the others it looked at those that kernels named.
    pub complete: u64,
    /// Differences that nobody looked at because there were too many.
    pub lost: u64,
    /// Pictures against the first.
    pub pictures: Vec<PictureLine>,
    /// The kept differences, the worst first.
    pub differences: Vec<Line>,
}

/// A kernel and how it fared where not all agreed.
#[derive(Debug, Serialize)]
pub struct KernelLine {
    /// Its name.
    pub name: String,
    /// With its version.
    pub describe: String,
    /// Asked ray by ray.
    pub single: Score,
    /// Asked by the batch.
    pub batch: Score,
}

/// Differences of one class.
#[derive(Debug, Serialize)]
pub struct ClassLine {
    /// The class.
    pub class: Class,
    /// Explained by rounding.
    pub explained: u64,
    /// Not explained.
    pub unexplained: u64,
}

/// One picture against the first.
#[derive(Debug, Serialize)]
pub struct PictureLine {
    /// The kernel.
    pub kernel: String,
    /// Pixels with other bits.
    pub differing: usize,
    /// Those among them where no hit differs.
    pub unexplained: usize,
    /// The largest difference of a channel.
    pub largest: f32,
}

/// One difference.
#[derive(Debug, Serialize)]
pub struct Line {
    /// How the answers differ.
    pub class: Class,
    /// Whether rounding explains it.
    pub explained: bool,
    /// The worst that the oracle says of an answer.
    pub reason: Ruling,
    /// Where the ray comes from, if that was found.
    pub source: Option<Source>,
    /// The left top of the tile.
    pub tile: [u32; 2],
    /// What was said, with who said it and the oracle's word.
    pub answers: Vec<AnswerLine>,
    /// What the oracle meets.
    pub truth: String,
    /// Whether it looked at every primitive.
    pub complete: bool,
    /// A command that asks this ray again.
    pub replay: String,
}

/// An answer of one or several kernels and styles.
#[derive(Debug, Serialize)]
pub struct AnswerLine {
    /// `embree`, or where its styles differ, `embree single`.
    pub who: Vec<String>,
    /// What it says.
    pub says: String,
    /// The oracle's word.
    pub ruling: Ruling,
}

impl Summary {
    /// `command` is the command line to which ` --ray ...` is appended to ask a ray again.
    pub fn new(c: &Crosscheck, scene: &Scene, command: &str) -> Self {
        let with_key = scene.geometry.groups.iter().flat_map(|g| &g.leaves).any(|l| l.filter.is_some());
        let replay = |d: &Difference| format!("{command} --ray {}", write_ray(&d.case.ray, with_key));
        let kernels = c.names.iter().zip(&c.kernels).zip(c.tally.scores.chunks(2));
        let kernels = kernels.map(|((name, describe), scores)| KernelLine {
            name: name.clone(),
            describe: describe.clone(),
            single: scores[0],
            batch: scores[1],
        });
        let classes = Class::ALL.into_iter().zip(c.tally.classes);
        let classes = classes.filter(|(_, n)| n[0] + n[1] > 0);
        let pictures = c.pictures.against_first.iter().map(|p| PictureLine {
            kernel: p.name.clone(),
            differing: p.pixels.len(),
            unexplained: p.unexplained.len(),
            largest: p.largest,
        });
        Summary {
            verdict: verdict(c),
            passed: c.passed(),
            kernels: kernels.collect(),
            camera_rays: c.rays.camera,
            bounce_rays: c.rays.scattered,
            shadow_rays: c.rays.shadow,
            compared: c.compared,
            classes: classes
                .map(|(class, [explained, unexplained])| ClassLine { class, explained, unexplained })
                .collect(),
            complete: c.tally.complete,
            lost: c.tally.lost,
            pictures: pictures.collect(),
            differences: c.differences.iter().map(|d| Line::new(d, &c.names, scene, replay(d))).collect(),
        }
    }
}

/// `1 difference`, `2 differences`.
fn plural(n: u64, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

fn verdict(c: &Crosscheck) -> String {
    let t: &Tally = &c.tally;
    let (all, bad) = (t.differences() + t.lost, t.unexplained());
    let rays = plural(c.compared, "ray");
    let pictures = match c.pictures.against_first.iter().map(|p| p.pixels.len() as u64).sum::<u64>() {
        0 if c.names.len() > 1 => "; the pictures are the same bit for bit".to_owned(),
        0 => String::new(),
        n => format!("; pictures differ in {}", plural(n, "pixel")),
    };
    if c.passed() {
        return match all {
            0 => format!("no difference on {rays}{pictures}"),
            n => format!("{} on {rays}, explained by rounding{pictures}", plural(n, "difference")),
        };
    }
    let mut parts = Vec::new();
    if bad > 0 {
        parts.push(format!("{bad} of {} on {rays} not explained", plural(all, "difference")));
    }
    if t.lost > 0 {
        parts.push(format!("{} beyond counting", plural(t.lost, "difference")));
    }
    match c.pictures.unexplained() as u64 {
        0 => {}
        n => parts.push(format!("{} of the pictures differ where no hit does", plural(n, "pixel"))),
    }
    parts.join("; ")
}

impl Line {
    fn new(d: &Difference, names: &[String], scene: &Scene, replay: String) -> Self {
        let mut answers: Vec<AnswerLine> = Vec::new();
        for (k, pair) in d.case.answers.chunks(2).enumerate() {
            let rulings = &d.judgement.rulings[2 * k..];
            let alike = pair[0] == pair[1];
            let one = |style: Style, i: usize| {
                let who = if alike { names[k].clone() } else { format!("{} {}", names[k], style.text()) };
                (who, say(scene, &pair[i]), rulings[i])
            };
            let two = [(Style::Single, 0), (Style::Batch, 1)];
            for (style, i) in two.into_iter().take(if alike { 1 } else { 2 }) {
                let (who, says, ruling) = one(style, i);
                match answers.iter_mut().find(|a| a.says == says && a.ruling == ruling) {
                    Some(a) => a.who.push(who),
                    None => answers.push(AnswerLine { who: vec![who], says, ruling }),
                }
            }
        }
        let truth = match (&d.judgement.truth, d.case.query) {
            (Some(t), QueryKind::Closest) => {
                format!("t {} {}", t.crossing.t, name_of(scene, t.path, t.prim))
            }
            (Some(t), QueryKind::Any) => format!("blocked by {}", name_of(scene, t.path, t.prim)),
            (None, QueryKind::Closest) => "nothing".into(),
            (None, QueryKind::Any) => "open".into(),
        };
        Line {
            class: d.judgement.class,
            explained: d.judgement.is_explained(),
            reason: d.judgement.reason(),
            source: d.source,
            tile: [d.tile.x0, d.tile.y0],
            answers,
            truth,
            complete: d.judgement.complete,
            replay,
        }
    }

    /// `pixel 12,7, sample 3, bounce ray of depth 2`.
    pub fn place(&self) -> String {
        match &self.source {
            Some(Source { pixel: [x, y], sample, depth, kind }) => {
                let depth =
                    if *kind == RayKind::Camera { String::new() } else { format!(" of depth {depth}") };
                format!("pixel {x},{y}, sample {sample}, {} ray{depth}", kind.text())
            }
            None => format!("tile at {},{}", self.tile[0], self.tile[1]),
        }
    }
}

impl Score {
    /// `12 (7 through an edge or corner, 5 grazing)`, or 0.
    fn list<'t>(total: u64, parts: impl Iterator<Item = (&'t str, u64)>) -> String {
        let parts: Vec<String> = parts.filter(|p| p.1 > 0).map(|(what, n)| format!("{n} {what}")).collect();
        if total == 0 { "0".into() } else { format!("{total} ({})", parts.join(", ")) }
    }

    /// What rounding explains, by reason.
    pub fn explained_text(&self) -> String {
        let parts = Doubt::ALL.iter().map(|d| d.text()).zip(self.explained);
        Score::list(self.explained_total(), parts)
    }

    /// What nothing explains, by fault.
    pub fn wrong_text(&self) -> String {
        Score::list(self.wrong_total(), Fault::ALL.iter().map(|f| f.text()).zip(self.wrong))
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for k in &self.kernels {
            writeln!(f, "kernel   {}: {}", k.name, k.describe)?;
        }
        let [c, b, s] = [self.camera_rays, self.bounce_rays, self.shadow_rays];
        writeln!(
            f,
            "rays     {c} camera, {b} bounce, {s} shadow; each asked of every kernel, single and in a batch"
        )?;
        for c in &self.classes {
            writeln!(f, "differ   {}: {} explained, {} not", c.class.text(), c.explained, c.unexplained)?;
        }
        if !self.classes.is_empty() {
            for k in &self.kernels {
                for (style, score) in Style::ALL.into_iter().zip([&k.single, &k.batch]) {
                    let (right, explained) = (score.right, score.explained_text());
                    let wrong = score.wrong_text();
                    let (name, style) = (&k.name, style.text());
                    writeln!(
                        f,
                        "oracle   {name} {style}: as the oracle {right}, else by rounding {explained}, wrong {wrong}"
                    )?;
                }
            }
            let all: u64 = self.classes.iter().map(|c| c.explained + c.unexplained).sum();
            let complete = self.complete;
            writeln!(f, "oracle   looked at every primitive for {complete} of {all} differences")?;
        }
        for p in &self.pictures {
            let first = self.kernels.first().map_or("", |k| k.name.as_str());
            match p.differing {
                0 => writeln!(f, "picture  {}: the bits of {first}'s", p.kernel)?,
                n => writeln!(
                    f,
                    "picture  {}: {} unlike {first}'s, by up to {}; without a differing hit: {}",
                    p.kernel,
                    plural(n as u64, "pixel"),
                    p.largest,
                    p.unexplained
                )?,
            }
        }
        for d in self.differences.iter().take(PRINTED) {
            let explained = if d.explained { "" } else { ", NOT EXPLAINED" };
            writeln!(f, "\n{} at {}: {}{explained}", d.class.text(), d.place(), d.reason.text())?;
            for a in &d.answers {
                writeln!(f, "  {}: {}", a.who.join(", "), a.says)?;
            }
            writeln!(f, "  oracle: {}", d.truth)?;
            writeln!(f, "  {}", d.replay)?;
        }
        if self.differences.len() > PRINTED {
            writeln!(f, "\nand {} more (--json or --html shows them)", self.differences.len() - PRINTED)?;
        }
        writeln!(f, "\nverdict  {}", self.verdict)
    }
}
