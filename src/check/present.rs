//! The certificate as tables: short for a terminal, in full for a page.

use super::certificate::{Certificate, Check, Entry, Row, Standing};
use super::tally::Tally;
use super::topology::Hole;
use crate::report::machine::Machine;
use crate::report::table::{Cell, Column, Table, Tone};
use crate::report::{Block, Details, Report, Section, Verdict};

/// Holes that are listed on a terminal; the page and the JSON have all of them.
const HOLES_SHOWN: usize = 8;

impl Certificate {
    /// For a terminal: meshes, the worst of each check over all placements, what was broken, the verdict.
    pub fn to_text(&self) -> String {
        let mut out = format!("{}\n", self.input);
        for k in &self.kernels {
            out += &format!("kernel {}: {}\n", k.name, k.version);
        }
        for m in &self.meshes {
            out += &format!("\n{}\n", self.mesh_line(m));
            for h in m.topology.holes.iter().take(HOLES_SHOWN) {
                out += &format!("  {}\n", hole_line(h));
            }
            let more = m.topology.holes.len().saturating_sub(HOLES_SHOWN);
            if more > 0 {
                out += &format!("  and {more} shorter ones\n");
            }
        }
        out += &format!("\n{}\n", self.table(&self.summary()).to_text());
        for (row, e) in self.broken() {
            out += &format!("broken: {}\n", broken_line(row, e));
        }
        self.notes.iter().for_each(|n| out += &format!("note: {n}\n"));
        out + &format!("verdict: {}\n", self.verdict())
    }

    fn mesh_line(&self, m: &super::certificate::MeshFacts) -> String {
        let t = &m.topology;
        let state = match (m.closed, t.holes.len()) {
            (true, _) => "closed".to_owned(),
            (false, 1) => "open, 1 hole".to_owned(),
            (false, n) => format!("open, {n} holes"),
        };
        let counts = [
            (t.boundary_edges, "boundary edges"),
            (t.non_manifold_edges, "edges of more than two faces"),
            (t.inconsistent_edges, "edges whose faces disagree on outside"),
            (t.duplicate_faces, "duplicate faces"),
            (t.slivers, "slivers of more than 1:1000"),
            (m.dropped, "triangles left out (without area or not finite)"),
        ];
        let mut line = format!(
            "mesh {}: {state}; {} triangles, {} vertices, {} parts",
            m.body, t.triangles, t.vertices, t.components
        );
        for (n, what) in counts.into_iter().filter(|c| c.0 > 0) {
            line += &format!(", {n} {what}");
        }
        if m.points_inside == 0 {
            line += "; no point inside was found, so leaks were not tried";
        }
        line
    }

    /// Rows that sum each check of each body over all placements; the placement named is that of the worst ray, where
    /// there is one.
    pub fn summary(&self) -> Vec<Row> {
        let mut short: Vec<Row> = Vec::new();
        for row in &self.rows {
            let Some(sum) = short.iter_mut().find(|s| s.check == row.check && s.body == row.body) else {
                short.push(row.clone());
                continue;
            };
            for e in &row.entries {
                match sum.entries.iter_mut().find(|s| s.kernel == e.kernel) {
                    Some(s) => join(s, e, &row.placement, &mut sum.placement),
                    None => sum.entries.push(e.clone()),
                }
            }
        }
        for row in short.iter_mut().filter(|r| r.entries.iter().all(|e| e.tally.worst.is_none())) {
            "all".clone_into(&mut row.placement);
        }
        short
    }

    /// A line for each row, with a column for each kernel.
    pub fn table(&self, rows: &[Row]) -> Table {
        let kernels = self.kernels.iter().map(|k| {
            Column::text(k.name.as_str()).help(
                "failed of tried; where nothing failed, the share that could have \
                 escaped at 95 %; the worst value; what that means",
            )
        });
        let first =
            [Column::text("check"), Column::text("shape"), Column::text("placement, or that of the worst")];
        let mut table = Table::new(first.into_iter().chain(kernels));
        for row in rows {
            let cells = self.kernels.iter().map(|k| {
                let entry = row.entries.iter().find(|e| e.kernel == k.name);
                entry.map_or_else(Cell::none, |e| cell(row.check, e))
            });
            let name = match row.check.limit() {
                Some(limit) => format!("{} (at most {limit})", row.check.name()),
                None => row.check.name().to_owned(),
            };
            let first = [Cell::from(name), Cell::from(row.body.as_str()), Cell::from(row.placement.as_str())];
            table.push(first.into_iter().chain(cells));
        }
        table
    }

    /// The page.
    pub fn report(&self, machine: &Machine) -> Report {
        let verdict = match self.broken().next() {
            None => Verdict::ok(self.verdict()),
            Some(_) => Verdict::bad(self.verdict()),
        };
        let mut meshes = Section::new("Meshes");
        for m in &self.meshes {
            meshes = meshes.prose(self.mesh_line(m));
            if !m.topology.holes.is_empty() {
                let holes = m.topology.holes.iter().map(hole_line);
                meshes = meshes.with(Details::list(format!("Holes of {}, longest first", m.body), holes));
            }
        }
        let broken: Vec<String> = self.broken().map(|(r, e)| broken_line(r, e)).collect();
        let mut sums = Section::new("In short").prose(PROMISES).with(self.table(&self.summary()));
        if !broken.is_empty() {
            let mut list = Details::list("Broken promises", broken);
            list.open = true;
            sums = sums.with(list);
        }
        if !self.notes.is_empty() {
            sums = sums.with(Details::list("Not checked", self.notes.iter().cloned()));
        }
        let worst = self.rows.iter().flat_map(|r| r.entries.iter().filter_map(move |e| worst_line(r, e)));
        let full = Section::new("Placement by placement")
            .with(self.table(&self.rows))
            .with(Block::from(Details::list("The rays that show the worst, in render space", worst)));
        Report::new("Certificate of numerical stability")
            .subtitle(self.input.as_str())
            .verdict(verdict)
            .fact("rays of each kind and kernel", self.rays.to_string())
            .fact("seed", self.seed.to_string())
            .machine(machine)
            .section(sums)
            .section(meshes)
            .section(full)
    }
}

const PROMISES: &str = "Promised by every kernel: no spawned ray meets the surface it left, none jumps over a sheet four \
    bounds away, origins are moved by no more than twice the bound, and points lie within it. The in-house kernel \
    and the oracle promise to be watertight. Embree's robust mode is known to leak at vertices and edges: its leaks are \
    reported.\n\nWhere nothing failed in n rays, the share that fails is less than 3/n with 95 % confidence. Rays from \
    inside that leave through a hole are set aside.";

fn join(sum: &mut Entry, e: &Entry, placement: &str, named: &mut String) {
    let rank = |s: Standing| match s {
        Standing::Untried => 0,
        Standing::Reported => 1,
        Standing::Kept => 2,
        Standing::Broken => 3,
    };
    let old = sum.tally;
    sum.tally = old.merged(&e.tally);
    if sum.tally.worst != old.worst && sum.tally.worst.map(|w| w.value) != old.worst.map(|w| w.value) {
        placement.clone_into(named);
    }
    if rank(e.standing) > rank(sum.standing) {
        sum.standing = e.standing;
    }
}

fn cell(check: Check, e: &Entry) -> Cell {
    let t = &e.tally;
    let tone = match e.standing {
        Standing::Kept => Tone::Good,
        Standing::Broken => Tone::Bad,
        Standing::Reported if t.failed > 0 => Tone::Plain,
        Standing::Reported | Standing::Untried => Tone::Dim,
    };
    Cell { text: cell_text(check, t, e.standing), value: Some(t.failed as f64), tone, ..Cell::default() }
}

fn cell_text(check: Check, t: &Tally, standing: Standing) -> String {
    if t.tried == 0 {
        return if t.aside > 0 { format!("- ({} set aside)", t.aside) } else { "-".into() };
    }
    let mut text = format!("{} of {}", t.failed, t.tried);
    match (t.upper_bound(), check.limit()) {
        (Some(share), None) => text += &format!(" (< {share:.0e})"),
        (None, _) if t.failed * 10_000 >= t.tried => {
            text += &format!(" ({:.2} %)", 100.0 * t.failed as f64 / t.tried as f64);
        }
        _ => {}
    }
    if let Some(value) = t.worst.and_then(|w| w.value) {
        text += &format!(", worst {value:.2}");
    }
    if t.aside > 0 {
        text += &format!(", {} aside", t.aside);
    }
    text + match standing {
        Standing::Kept => "  ok",
        Standing::Broken => "  BROKEN",
        Standing::Reported | Standing::Untried => "",
    }
}

fn hole_line(h: &Hole) -> String {
    let [x, y, z] = h.place;
    format!("hole of {} edges, {:.4e} around, at ({x:.5}, {y:.5}, {z:.5})", h.corners.len(), h.length)
}

fn broken_line(row: &Row, e: &Entry) -> String {
    let t = &e.tally;
    let first = format!("{}, {}, {}, {}: ", e.kernel, row.check.name(), row.body, row.placement);
    let ray = t.worst.map_or(String::new(), |w| format!("; ray {}", w.ray));
    first + &cell_text(row.check, t, e.standing) + &ray
}

/// The ray that shows the worst of what is measured or failed.
fn worst_line(row: &Row, e: &Entry) -> Option<String> {
    let worst = e.tally.worst?;
    let value = worst.value.map_or(String::new(), |v| format!(" {v:.4}"));
    Some(format!("{}, {}, {}, {}{value}: {}", e.kernel, row.check.name(), row.body, row.placement, worst.ray))
}
