//! What is kept of a measurement, as JSON has it.

use super::kernels::KernelInfo;
use crate::error::{Error, Result};
use crate::report::machine::Machine;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Of a record of this kind, in [`Record::kind`].
pub const KIND: &str = "skylit bench rays";
/// Of this form, in [`Record::version`].
pub const VERSION: u32 = 1;

/// A measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// [`KIND`].
    pub kind: String,
    /// [`VERSION`].
    pub version: u32,
    /// On what.
    pub machine: Machine,
    /// Of the other program, if there was one.
    pub peer: Option<Machine>,
    /// Threads that traced.
    pub threads: usize,
    /// Rounds that were timed, after one that was not.
    pub rounds: usize,
    /// What was traced.
    pub scene: SceneInfo,
    /// Identifies the rays: hexadecimal.
    pub rays: String,
    /// What was asked, in the order of the cells.
    pub workloads: Vec<WorkloadInfo>,
    /// What was built.
    pub kernels: Vec<KernelInfo>,
    /// The row that others are compared with: index into `rows`.
    pub reference: usize,
    /// Kernels by form.
    pub rows: Vec<Row>,
    /// What kernels that count did.
    pub visits: Vec<VisitInfo>,
}

/// What was traced.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SceneInfo {
    /// File, or the name of the generated shape.
    pub input: String,
    /// Triangles, each instanced mesh once.
    pub triangles: u64,
    /// Other primitives.
    pub procedurals: u64,
    /// Primitives with every placement counted.
    pub placed_primitives: u64,
    /// Bytes of the geometry, which all kernels share.
    pub geometry_bytes: u64,
}

/// What was asked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WorkloadInfo {
    /// Its name.
    pub name: String,
    /// One line for people.
    pub doc: String,
    /// Number of rays.
    pub rays: usize,
    /// Part of them that the reference says meet something, 0 to 1.
    pub hit_part: f64,
    /// Rays of the sample that the oracle was asked for.
    pub oracle_rays: usize,
}

/// A kernel in one form of call.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Index into [`Record::kernels`].
    pub kernel: usize,
    /// Name of the form.
    pub form: String,
    /// By workload; none where the form does not fit, or there are no rays.
    pub cells: Vec<Option<Cell>>,
}

/// A row's figures for one workload.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Millions of rays a second, all threads together: the median of the rounds.
    pub mrays: f64,
    /// The slowest round.
    pub min: f64,
    /// The fastest round.
    pub max: f64,
    /// Median absolute deviation from the median, in the same unit.
    pub mad: f64,
    /// Seconds of each round, in order.
    pub seconds: Vec<f64>,
    /// Median over that of the reference row.
    pub ratio: Option<f64>,
    /// Answers that differ from the reference row's.
    pub differs: Differences,
    /// Answers that differ from the oracle's, within the sample.
    pub oracle: Option<Differences>,
}

/// Answers that differ.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Differences {
    /// One says hit, the other miss.
    pub hit: u64,
    /// Both say hit, of another primitive or placement. Coincident surfaces do so by right.
    pub primitive: u64,
}

/// What a kernel did for a ray, on average.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct VisitInfo {
    /// Index into [`Record::kernels`].
    pub kernel: usize,
    /// Index into [`Record::workloads`].
    pub workload: usize,
    /// Inner nodes opened.
    pub nodes: f64,
    /// Leaves opened.
    pub leaves: f64,
    /// Primitives tested.
    pub primitives: f64,
}

/// Normal noise has a standard deviation of so many median absolute deviations.
const SIGMAS_PER_MAD: f64 = 1.4826;

impl Cell {
    /// Of `rays` rays in each of these times, of which there is at least one.
    pub fn new(rays: usize, seconds: Vec<f64>) -> Self {
        let speeds: Vec<f64> = seconds.iter().map(|s| rays as f64 * 1e-6 / s.max(1e-9)).collect();
        let mrays = median(speeds.clone());
        let mad = median(speeds.iter().map(|s| (s - mrays).abs()).collect());
        let min = speeds.iter().copied().fold(f64::INFINITY, f64::min);
        let max = speeds.iter().copied().fold(0.0, f64::max);
        Cell { mrays, min, max, mad, seconds, ratio: None, differs: Differences::default(), oracle: None }
    }

    /// The spread of a round as a standard deviation, estimated so that a disturbed round counts little.
    pub fn spread(&self) -> f64 {
        self.mad * SIGMAS_PER_MAD
    }
}

impl Differences {
    /// All together.
    pub fn total(&self) -> u64 {
        self.hit + self.primitive
    }
}

/// The middle one, or the mean of the two in the middle; 0 of none.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => 0.0,
        n if n % 2 == 1 => values[n / 2],
        n => (values[n / 2 - 1] + values[n / 2]) * 0.5,
    }
}

impl Record {
    /// What a row is, whatever the versions: "embree robust single", "peer embree robust batch".
    pub fn key(&self, row: &Row) -> String {
        row_key(&self.kernels[row.kernel], &row.form)
    }

    /// The row's kernel as people read it: "embree 3.13.5 robust", "embree 4.4.0 robust (peer)".
    pub fn kernel_label(&self, kernel: usize) -> String {
        let k = &self.kernels[kernel];
        // Some kernels name the instruction set themselves.
        let simd = k.simd.as_ref().filter(|s| !k.name.contains(s.as_str()));
        let simd = simd.map_or(String::new(), |s| format!(" {s}"));
        format!("{}{simd}{}", k.name, if k.peer { " (peer)" } else { "" })
    }

    /// Geometric mean of a row's ratios to the reference; none if there is nothing to compare.
    pub fn mean_ratio(&self, row: &Row) -> Option<f64> {
        let ratios: Vec<f64> = row.cells.iter().flatten().filter_map(|c| c.ratio).collect();
        let mean = ratios.iter().map(|r| r.ln()).sum::<f64>() / ratios.len() as f64;
        (!ratios.is_empty()).then(|| mean.exp())
    }

    /// As JSON text.
    ///
    /// # Errors
    /// [`Error::Internal`] if it cannot be written, which is a fault of ours.
    pub fn to_json(&self) -> Result<String> {
        to_json(self)
    }

    /// Reads a record.
    ///
    /// # Errors
    /// [`Error::File`] if the file cannot be read; [`Error::Content`] if it is no such record.
    pub fn load(path: &Path) -> Result<Record> {
        let size = std::fs::metadata(path).map_err(|e| Error::file(path, "open", e))?.len();
        if size > MAX_BYTES {
            return Err(Error::content(path, format!("{size} bytes is too long for a record")));
        }
        let text = std::fs::read_to_string(path).map_err(|e| Error::file(path, "read", e))?;
        let record: Record = serde_json::from_str(&text).map_err(|e| {
            Error::content_at(path, e.line(), e.column(), format!("this is no record of `bench rays`: {e}"))
        })?;
        if record.kind != KIND || record.version != VERSION {
            let found = format!("\"{}\" version {}", record.kind, record.version);
            return Err(Error::content(path, format!("{found}; known: \"{KIND}\" version {VERSION}")));
        }
        record.check().map_err(|m| Error::content(path, m))?;
        Ok(record)
    }

    /// Whether all numbers of other entries name one.
    fn check(&self) -> Result<(), String> {
        let rows_fit =
            self.rows.iter().all(|r| r.kernel < self.kernels.len() && r.cells.len() == self.workloads.len());
        let visits_fit =
            self.visits.iter().all(|v| v.kernel < self.kernels.len() && v.workload < self.workloads.len());
        match rows_fit && visits_fit && self.reference < self.rows.len().max(1) {
            true => Ok(()),
            false => Err("rows, kernels and workloads of the record do not fit together".into()),
        }
    }
}

/// Longer records are not read.
const MAX_BYTES: u64 = 64 << 20;

/// Any record as JSON text.
///
/// # Errors
/// [`Error::Internal`] if it cannot be written, which is a fault of ours.
pub fn to_json(value: &impl Serialize) -> Result<String> {
    let text = serde_json::to_string_pretty(value);
    text.map(|t| t + "\n").map_err(|e| Error::Internal(format!("cannot write the record: {e}")))
}

/// See [`Record::key`].
pub fn row_key(k: &KernelInfo, form: &str) -> String {
    let peer = if k.peer { "peer " } else { "" };
    let simd = k.simd.as_ref().map_or(String::new(), |s| format!("{s} "));
    format!("{peer}{} {} {simd}{form}", k.backend, k.mode)
}
