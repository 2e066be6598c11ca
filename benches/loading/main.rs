//! How fast mesh files load, and how much memory that takes at most.
//!
//!     cargo bench --bench loading [-- --mb N] [--runs N] [--only NAME]
//!
//! Writes files of about 100 MB from a generated knot into a temporary folder and loads each with one and with two
//! threads; beside each load, in the same turn, a probe: the file read as a whole, once and for nothing. OBJ files are
//! also parsed by the crate `tobj`. Speeds are bytes of the file by the median of the runs; those by processor time, where
//! the system tells it, do not suffer from other programs on the machine. All files are in the system's cache.
//!
//! Memory is that of a process that loads one file and ends: its peak of resident memory, less what was resident
//! before, against the bytes of the mesh. No file is mapped, so all pages that count are the process' own.

mod files;

use files::{KINDS, Kind};
use skylit::base::mesh_data::{MeshData, Positions};
use skylit::formats::load_mesh;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

const THREADS: [usize; 2] = [1, 2];
/// How this program calls itself to measure memory.
const PEAK: &str = "--peak";

struct Options {
    megabytes: f64,
    runs: usize,
    only: String,
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    if let [flag, path, threads] = &args[..]
        && flag == PEAK
    {
        return print_peak(Path::new(path), threads.parse().expect("a number of threads"));
    }
    let mut o = Options { megabytes: 100.0, runs: 5, only: String::new() };
    for pair in args.chunks(2) {
        match pair {
            [flag, value] if flag == "--mb" => o.megabytes = value.parse().expect("--mb takes a number"),
            [flag, value] if flag == "--runs" => o.runs = value.parse().expect("--runs takes a number"),
            [flag, value] if flag == "--only" => o.only = value.clone(),
            _ => panic!("usage: [--mb N] [--runs N] [--only NAME]"),
        }
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    println!(
        "file            MB   threads      s (least to most)      MB/s  MB/s of cpu   x probe   x tobj   peak / mesh"
    );
    for kind in KINDS.iter().filter(|k| k.name.contains(&o.only)) {
        measure(kind, &kind.write(folder.path(), o.megabytes * 1e6), o.runs);
    }
}

/// Seconds of each run, by clock and by processor.
#[derive(Default)]
struct Times {
    clock: Vec<f64>,
    cpu: Vec<f64>,
}

impl Times {
    fn add(&mut self, work: impl FnOnce()) {
        let (start, cpu) = (Instant::now(), cpu_seconds());
        work();
        self.clock.push(start.elapsed().as_secs_f64());
        self.cpu.push(cpu_seconds() - cpu);
    }
}

fn median(times: &[f64]) -> f64 {
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

fn measure(kind: &Kind, path: &Path, runs: usize) {
    let megabytes = std::fs::metadata(path).expect("is there").len() as f64 * 1e-6;
    let pools = THREADS.map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("threads"));
    let (mut probe, mut tobj, mut loads) =
        (Times::default(), Times::default(), THREADS.map(|_| Times::default()));
    for _ in 0..runs {
        probe.add(|| drop(std::fs::read(path).expect("reads")));
        for (load, pool) in loads.iter_mut().zip(&pools) {
            load.add(|| drop(pool.install(|| load_mesh(path)).expect("loads")));
        }
        if path.extension().is_some_and(|e| e == "obj") {
            let options = tobj::LoadOptions { single_index: true, ..tobj::LoadOptions::default() };
            tobj.add(|| drop(tobj::load_obj(path, &options).expect("loads")));
        }
    }
    for (threads, load) in THREADS.into_iter().zip(&loads) {
        let seconds = median(&load.clock);
        let most = |sign: f64| sign * load.clock.iter().fold(f64::NEG_INFINITY, |a, t| a.max(sign * t));
        let faster = if tobj.clock.is_empty() { f64::NAN } else { median(&tobj.clock) / seconds };
        println!(
            "{:12} {megabytes:5.1}   {threads:7}   {seconds:6.3} ({:.3} to {:.3})   {:7.0}  {:11.0}   {:7.1}   {faster:6.1}   {}",
            kind.name,
            most(-1.0),
            most(1.0),
            megabytes / seconds,
            megabytes / median(&load.cpu),
            seconds / median(&probe.clock),
            peak(path, threads),
        );
    }
    println!(
        "{:12} {megabytes:5.1}     probe   {:6.3}                     {:7.0}",
        "",
        median(&probe.clock),
        megabytes / median(&probe.clock)
    );
}

/// What a process of its own says of its memory.
fn peak(path: &Path, threads: usize) -> String {
    let program = std::env::current_exe().expect("this program");
    let out = Command::new(program).args([PEAK.as_ref(), path.as_os_str()]).arg(threads.to_string()).output();
    String::from_utf8_lossy(&out.expect("runs").stdout).trim().to_owned()
}

fn print_peak(path: &Path, threads: usize) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    let before = status_mib("VmRSS:");
    let mesh = pool.install(|| load_mesh(path)).expect("loads");
    let size = bytes_of(&mesh) as f64 / f64::from(1 << 20);
    match (before, status_mib("VmHWM:")) {
        (Some(before), Some(peak)) => {
            println!("{:.2} ({:.1} / {size:.1} MiB)", (peak - before) / size, peak - before)
        }
        _ => println!("not known on this system"),
    }
}

/// Bytes of the arrays of a mesh.
fn bytes_of(mesh: &MeshData) -> usize {
    let positions = match &mesh.positions {
        Positions::F32(p) => size_of_val(&p[..]),
        Positions::F64(p) => size_of_val(&p[..]),
    };
    positions
        + size_of_val(&mesh.normals[..])
        + size_of_val(&mesh.uvs[..])
        + size_of_val(&mesh.indices[..])
        + size_of_val(&mesh.material_ids[..])
}

/// A line of what Linux says of this process.
fn status_mib(name: &str) -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix(name))?;
    line.split_ascii_whitespace().next()?.parse::<f64>().ok().map(|kib| kib / 1024.0)
}

/// Processor time of all threads so far, as Linux counts it; 0 elsewhere.
fn cpu_seconds() -> f64 {
    let Ok(threads) = std::fs::read_dir("/proc/self/task") else { return 0.0 };
    let nanoseconds = threads.flatten().filter_map(|t| {
        let times = std::fs::read_to_string(t.path().join("schedstat")).ok()?;
        times.split_ascii_whitespace().next()?.parse::<f64>().ok()
    });
    nanoseconds.sum::<f64>() * 1e-9
}
