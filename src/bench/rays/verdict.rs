//! Whether a measurement is slower than an earlier one, beyond noise: for people who let a machine watch speed.

use super::record::{Cell, Record};
use crate::error::{Error, Result};
use serde::{Deserialize, Serialize};

/// A difference counts from so many combined spreads on...
const SPREADS: f64 = 3.0;
/// ... and if it is at least this part of the older figure: less than that no user would notice, and a machine that
/// shares its caches drifts by as much.
const LEAST: f64 = 0.05;

/// Of fewer rounds the spread is itself mostly noise.
const FEW: usize = 5;

/// A row's figures for one workload, then and now.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// [`Record::key`].
    pub row: String,
    /// Name of the workload.
    pub workload: String,
    /// Mrays/s then.
    pub old: f64,
    /// Mrays/s now.
    pub new: f64,
    /// What could be noise: three combined spreads, Mrays/s.
    pub noise: f64,
    /// What it comes to.
    pub judgement: Judgement,
}

/// What a change comes to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Judgement {
    /// Beyond noise, and by 5 % at least.
    Slower,
    /// Beyond noise, and by 5 % at least.
    Faster,
    /// Neither.
    Same,
}

/// All changes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// What both records have.
    pub changes: Vec<Change>,
    /// Rows of the older record that the newer one has not.
    pub missing: Vec<String>,
    /// What else differs, so that figures mean less: machine, threads, rays.
    pub caveats: Vec<String>,
}

/// Compares a record with an older one.
///
/// # Errors
/// [`Error::Usage`] if they are of different scenes, or have no figure in common.
pub fn compare(old: &Record, new: &Record) -> Result<Comparison> {
    let primitives = |r: &Record| (r.scene.triangles, r.scene.procedurals);
    if primitives(old) != primitives(new) {
        let tell = |r: &Record| format!("{} ({} triangles)", r.scene.input, r.scene.triangles);
        let (old, new) = (tell(old), tell(new));
        return Err(Error::Usage(format!("the baseline is of another scene: {old}; measured is {new}")));
    }
    let mut out = Comparison { changes: Vec::new(), missing: Vec::new(), caveats: caveats(old, new) };
    for old_row in &old.rows {
        let key = old.key(old_row);
        let Some(new_row) = new.rows.iter().find(|r| new.key(r) == key) else {
            out.missing.push(key);
            continue;
        };
        for (w, old_cell) in old.workloads.iter().zip(&old_row.cells) {
            let at = new.workloads.iter().position(|n| n.name == w.name);
            let new_cell = at.and_then(|i| new_row.cells[i].as_ref());
            if let (Some(a), Some(b)) = (old_cell, new_cell) {
                out.changes.push(change(key.clone(), w.name.clone(), a, b));
            }
        }
    }
    match out.changes.is_empty() {
        true => Err(Error::Usage("the baseline has no row in common with what was measured".into())),
        false => Ok(out),
    }
}

fn change(row: String, workload: String, old: &Cell, new: &Cell) -> Change {
    let noise = SPREADS * old.spread().hypot(new.spread());
    let by = new.mrays - old.mrays;
    let judgement = match by.abs() > noise && by.abs() >= LEAST * old.mrays {
        true if by < 0.0 => Judgement::Slower,
        true => Judgement::Faster,
        false => Judgement::Same,
    };
    Change { row, workload, old: old.mrays, new: new.mrays, noise, judgement }
}

fn caveats(old: &Record, new: &Record) -> Vec<String> {
    let embree = |r: &Record| r.machine.embree.as_ref().map_or("none".to_owned(), |e| e.version.clone());
    let facts = [
        ("processor", old.machine.cpu.clone(), new.machine.cpu.clone()),
        ("threads", old.threads.to_string(), new.threads.to_string()),
        ("instructions", old.machine.simd.clone(), new.machine.simd.clone()),
        ("Embree", embree(old), embree(new)),
        ("rays", old.rays.clone(), new.rays.clone()),
    ];
    let differ = facts.into_iter().filter(|(_, a, b)| a != b);
    let mut all: Vec<String> = differ.map(|(what, a, b)| format!("{what}: {a} then, {b} now")).collect();
    let rounds = old.rounds.min(new.rounds);
    if rounds < FEW {
        all.push(format!("{rounds} rounds hardly tell what noise is: --rounds {FEW} or more do"));
    }
    all
}

impl Comparison {
    /// Changes of one kind, the largest first.
    pub fn of(&self, judgement: Judgement) -> Vec<&Change> {
        let mut list: Vec<&Change> = self.changes.iter().filter(|c| c.judgement == judgement).collect();
        list.sort_by(|a, b| (b.new / b.old).ln().abs().total_cmp(&(a.new / a.old).ln().abs()));
        list
    }

    /// One sentence; whether it is good news stands in [`Comparison::passed`].
    pub fn sentence(&self) -> String {
        let [slower, faster] = [Judgement::Slower, Judgement::Faster].map(|j| self.of(j));
        let n = self.changes.len();
        let tell = |c: &&Change| {
            format!(
                "{} / {}: {:.2} -> {:.2} Mrays/s ({:+.1} %)",
                c.row,
                c.workload,
                c.old,
                c.new,
                c.percent()
            )
        };
        match (slower.first(), faster.first()) {
            (Some(worst), _) => {
                format!(
                    "{} of {n} figures are slower than the baseline beyond noise; worst: {}",
                    slower.len(),
                    tell(worst)
                )
            }
            (None, Some(best)) => {
                format!(
                    "none of {n} figures is slower than the baseline; {} are faster, most: {}",
                    faster.len(),
                    tell(best)
                )
            }
            (None, None) => format!("all {n} figures are as fast as the baseline, within noise"),
        }
    }

    /// Whether nothing is slower.
    pub fn passed(&self) -> bool {
        self.changes.iter().all(|c| c.judgement != Judgement::Slower)
    }
}

impl Change {
    /// Of the older figure.
    pub fn percent(&self) -> f64 {
        100.0 * (self.new / self.old - 1.0)
    }
}
