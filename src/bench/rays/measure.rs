//! Runs every row over the same rays, in turn.
//!
//! Workload by workload: each row once to warm up (its answers are compared then), then rounds of all rows, forwards
//! and backwards in turn, so that whatever drifts meets all rows alike. The clock runs while all threads trace, and
//! stands while rays are laid out.

use super::agree::{self, Oracle};
use super::forms::{Answers, CallForm, Pass};
use super::kernels::{Built, Choice, KernelInfo};
use super::peer::{Peer, PeerRow};
use super::record::{Cell, KIND, Record, Row, SceneInfo, VERSION, VisitInfo, WorkloadInfo, row_key};
use super::sets::{RaySets, WORKLOADS, Workload, count, placed_primitives};
use crate::base::ray::RayBatch;
use crate::bench::Progress;
use crate::error::{Error, Result};
use crate::report::machine::Machine;
use crate::scene::Scene;
use rayon::prelude::*;
use std::time::Instant;

/// What is measured, and how.
pub struct Setup<'a> {
    /// What the record calls the scene.
    pub input: String,
    /// The scene; its own kernel is not asked.
    pub scene: &'a Scene,
    /// The rays.
    pub sets: &'a RaySets,
    /// Which kernels and forms.
    pub choice: &'a Choice,
    /// Timed rounds, at least 1.
    pub rounds: usize,
    /// Threads that trace, at least 1: those of the global pool.
    pub threads: usize,
    /// Key of the row that others are compared with; none for single rays through robust Embree, or the first row.
    pub reference: Option<String>,
}

/// Kernels that are built, and what they are asked with.
pub struct Bench<'a> {
    setup: &'a Setup<'a>,
    built: Vec<Built>,
    /// Index of the kernel, and the form.
    rows: Vec<(usize, &'static CallForm)>,
}

/// Batches of a piece that a thread takes at once: long enough to hide the taking, short enough to share evenly.
const PIECE: usize = 16;

impl<'a> Bench<'a> {
    /// Builds the kernels.
    ///
    /// # Errors
    /// Names that nothing has; a kernel that cannot be built.
    pub fn new(setup: &'a Setup<'a>, progress: &dyn Progress) -> Result<Self> {
        let (variants, forms) = (setup.choice.variants()?, setup.choice.forms()?);
        let mut built = Vec::with_capacity(variants.len());
        for v in &variants {
            progress.step(&format!("build {}", v.backend));
            built.push(Built::new(v, &setup.scene.geometry)?);
        }
        let mut rows = Vec::new();
        for (k, kernel) in built.iter().enumerate() {
            let fits = |f: &&CallForm| WORKLOADS.iter().any(|w| f.fits(kernel, w));
            rows.extend(forms.iter().copied().filter(fits).map(|f| (k, f)));
        }
        Ok(Bench { setup, built, rows })
    }

    /// Of the kernels.
    pub fn kernels(&self) -> Vec<KernelInfo> {
        self.built.iter().map(|b| b.info.clone()).collect()
    }

    /// Kernel and name of the form, by row.
    pub fn rows(&self) -> Vec<PeerRow> {
        self.rows.iter().map(|(kernel, f)| PeerRow { kernel: *kernel, form: f.name.to_owned() }).collect()
    }

    /// The rays of a workload laid out for a row; none where the form does not fit.
    fn lay_out<'b>(&'b self, row: usize, work: &Workload) -> Option<Vec<Pass<'b>>> {
        let (kernel, form) = self.rows.get(row)?;
        let (built, batches) = (&self.built[*kernel], self.setup.sets.of(work.kind));
        if batches.is_empty() || !form.fits(built, work) {
            return None;
        }
        let piece = (batches.len() / (8 * self.setup.threads)).clamp(1, PIECE);
        let pieces: Vec<&'b [RayBatch]> = batches.chunks(piece).collect();
        pieces.into_par_iter().map(|p| form.lay_out(built, p, work)).collect()
    }

    /// Seconds that all threads together need for a workload; none where the form does not fit.
    ///
    /// # Errors
    /// A failure inside the kernel.
    pub fn time(&self, row: usize, work: &Workload) -> Result<Option<f64>> {
        let Some(mut passes) = self.lay_out(row, work) else { return Ok(None) };
        let start = Instant::now();
        if self.setup.threads == 1 {
            passes.iter_mut().for_each(Pass::run);
        } else {
            passes.par_iter_mut().with_max_len(1).for_each(Pass::run);
        }
        let seconds = start.elapsed().as_secs_f64();
        self.built[self.rows[row].0].kernel().take_failure()?;
        Ok(Some(seconds))
    }

    /// The answers of a row to a workload, in the order of the rays; none where the form does not fit.
    ///
    /// # Errors
    /// A failure inside the kernel.
    pub fn answers(&self, row: usize, work: &Workload) -> Result<Option<Answers>> {
        let Some(mut passes) = self.lay_out(row, work) else { return Ok(None) };
        let found: Vec<Answers> = passes.par_iter_mut().with_max_len(1).map(Pass::answers).collect();
        self.built[self.rows[row].0].kernel().take_failure()?;
        let mut all = Answers::default();
        found.into_iter().for_each(|a| all.append(a));
        Ok(Some(all))
    }
}

/// All rows, those of another program last.
struct Rows<'a> {
    bench: &'a Bench<'a>,
    peer: Option<&'a mut Peer>,
}

impl Rows<'_> {
    fn time(&mut self, row: usize, work: &Workload) -> Result<Option<f64>> {
        let own = self.bench.rows.len();
        match &mut self.peer {
            Some(peer) if row >= own => peer.time(row - own, work.name),
            _ => self.bench.time(row, work),
        }
    }

    fn answers(&mut self, row: usize, work: &Workload) -> Result<Option<Answers>> {
        let own = self.bench.rows.len();
        match &mut self.peer {
            Some(peer) if row >= own => {
                peer.answers(row - own, work.name, count(self.bench.setup.sets.of(work.kind)))
            }
            _ => self.bench.answers(row, work),
        }
    }
}

/// Measures all rows, those of `peer` among them.
///
/// # Errors
/// A failure inside a kernel or of the peer; a reference that no row has.
pub fn measure(bench: &Bench, mut peer: Option<Peer>, progress: &dyn Progress) -> Result<Record> {
    let setup = bench.setup;
    let mut kernels = bench.kernels();
    let mut rows: Vec<Row> = Vec::new();
    let add = |first: usize, list: Vec<PeerRow>, rows: &mut Vec<Row>| {
        rows.extend(list.into_iter().map(|r| Row {
            kernel: first + r.kernel,
            form: r.form,
            cells: Vec::new(),
        }));
    };
    add(0, bench.rows(), &mut rows);
    if let Some(p) = &peer {
        add(kernels.len(), p.hello.rows.clone(), &mut rows);
        kernels.extend(p.hello.kernels.iter().map(|k| KernelInfo { peer: true, ..k.clone() }));
    }
    let reference = find_reference(setup.reference.as_deref(), &kernels, &rows)?;
    let peer_machine = peer.as_ref().map(|p| p.hello.machine.clone());
    let mut record = Record {
        kind: KIND.into(),
        version: VERSION,
        machine: Machine::here(),
        peer: peer_machine,
        threads: setup.threads,
        rounds: setup.rounds,
        scene: scene_info(setup),
        rays: format!("{:016x}", setup.sets.digest()),
        workloads: Vec::new(),
        kernels,
        reference,
        rows,
        visits: Vec::new(),
    };
    progress.begin((WORKLOADS.len() * (setup.rounds + 1) * record.rows.len()) as u64);
    let mut all = Rows { bench, peer: peer.as_mut() };
    for work in WORKLOADS {
        measure_workload(&mut all, work, &mut record, progress)?;
    }
    Ok(record)
}

fn scene_info(setup: &Setup) -> SceneInfo {
    let report = &setup.scene.report;
    SceneInfo {
        input: setup.input.clone(),
        triangles: report.triangles,
        procedurals: report.procedurals,
        placed_primitives: placed_primitives(&setup.scene.geometry),
        geometry_bytes: report.geometry_bytes,
    }
}

fn find_reference(wanted: Option<&str>, kernels: &[KernelInfo], rows: &[Row]) -> Result<usize> {
    let keys: Vec<String> = rows.iter().map(|r| row_key(&kernels[r.kernel], &r.form)).collect();
    let of = |key: &str| keys.iter().position(|k| k == key);
    match wanted {
        Some(w) => of(w).ok_or_else(|| {
            Error::Usage(crate::error::unknown_name("row", w, keys.iter().map(String::as_str)))
        }),
        None if rows.is_empty() => {
            Err(Error::Usage("no kernel has any of the forms that were chosen".into()))
        }
        None => Ok(of("embree robust single").unwrap_or(0)),
    }
}

/// The reference row's answers; where its form does not fit, those of the first row whose form does.
fn expected_answers(
    rows: &mut Rows,
    work: &Workload,
    reference: usize,
    number: usize,
) -> Result<Option<Answers>> {
    for row in std::iter::once(reference).chain(0..number) {
        if let Some(answers) = rows.answers(row, work)? {
            return Ok(Some(answers));
        }
    }
    Ok(None)
}

fn measure_workload(
    rows: &mut Rows,
    work: &Workload,
    record: &mut Record,
    progress: &dyn Progress,
) -> Result<()> {
    let setup = rows.bench.setup;
    let batches = setup.sets.of(work.kind);
    let (n, number) = (count(batches), record.rows.len());
    let oracle = Oracle::ask(setup.scene, batches, work);
    let expected = expected_answers(rows, work, record.reference, number)?;
    let label = |record: &Record, row: usize| format!("{}: {}", work.name, record.key(&record.rows[row]));
    let mut compared = Vec::with_capacity(number);
    for row in 0..number {
        progress.step(&label(record, row));
        compared.push(rows.answers(row, work)?.map(|a| {
            let differs = expected.as_ref().map(|e| agree::compare(&a, e)).unwrap_or_default();
            (differs, oracle.compare(&a))
        }));
    }
    let mut seconds: Vec<Vec<f64>> = vec![Vec::with_capacity(setup.rounds); number];
    for round in 0..setup.rounds {
        for i in 0..number {
            let row = if round % 2 == 0 { i } else { number - 1 - i };
            progress.step(&label(record, row));
            seconds[row].extend(rows.time(row, work)?);
        }
    }
    let speed = |s: &[f64]| Cell::new(n, s.to_vec()).mrays;
    let of_reference = Some(&seconds[record.reference]).filter(|s| !s.is_empty()).map(|s| speed(s));
    for ((row, seconds), compared) in record.rows.iter_mut().zip(seconds).zip(compared) {
        row.cells.push(compared.filter(|_| !seconds.is_empty()).map(|(differs, oracle)| {
            let cell = Cell::new(n, seconds);
            Cell { ratio: of_reference.map(|r| cell.mrays / r), differs, oracle, ..cell }
        }));
    }
    let index = record.workloads.len();
    for (k, built) in rows.bench.built.iter().enumerate() {
        if let Some([nodes, leaves, primitives]) = agree::visits(built.kernel(), batches, work.query) {
            record.visits.push(VisitInfo { kernel: k, workload: index, nodes, leaves, primitives });
        }
    }
    record.workloads.push(WorkloadInfo {
        name: work.name.into(),
        doc: work.doc.into(),
        rays: n,
        hit_part: expected.map_or(0.0, |e| e.hits() as f64 / n.max(1) as f64),
        oracle_rays: oracle.rays.len(),
    });
    Ok(())
}
