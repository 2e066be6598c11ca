//! On what, and with what, figures were taken.

use crate::math::simd;
use serde::{Deserialize, Serialize};
use std::fs;
use std::num::NonZero;

/// The facts that a record of figures starts with. What the system does not tell is "unknown".
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// Model name of the processor.
    pub cpu: String,
    /// Threads that it runs at once, as far as this process may use them.
    pub threads: usize,
    /// Instruction set that run-time dispatch chose: "avx512".
    pub simd: String,
    /// Bytes of memory; 0 if not known.
    pub memory: u64,
    /// "Debian GNU/Linux 12 (bookworm), Linux 6.1.0".
    pub os: String,
    /// Of this program.
    pub skylit: String,
    /// The commit that it was built from.
    pub commit: String,
    /// Target triple and features that it was compiled for.
    pub target: String,
    /// Whether it was compiled without optimisation or with debug assertions, which no figure should be.
    pub debug: bool,
    /// The Embree library in use.
    pub embree: Option<Embree>,
    /// The command line, arguments with blanks in quotes.
    pub command: String,
}

/// Which Embree.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Embree {
    /// "3.13.5", of the library that was loaded.
    pub version: String,
    /// File name of the library, as it was loaded.
    pub library: String,
    /// Whether the library was compiled with assertions, which cost time in every ray; not known where the loaded
    /// file cannot be found.
    pub assertions: Option<bool>,
}

impl Machine {
    /// This process.
    pub fn here() -> Self {
        let features = match env!("SKYLIT_FEATURES") {
            "" => String::new(),
            f => format!(" ({f})"),
        };
        Machine {
            cpu: cpu(),
            threads: std::thread::available_parallelism().map_or(1, NonZero::get),
            simd: simd::name(),
            memory: memory().unwrap_or(0),
            os: os(),
            skylit: env!("CARGO_PKG_VERSION").to_owned(),
            commit: env!("SKYLIT_GIT").to_owned(),
            target: format!("{}{features}", env!("SKYLIT_TARGET")),
            debug: cfg!(debug_assertions),
            embree: embree(),
            command: command(std::env::args_os().map(|a| a.to_string_lossy().into_owned())),
        }
    }

    /// Name and value, for people.
    pub fn facts(&self) -> Vec<(String, String)> {
        let mut all = vec![("processor", format!("{}, {} threads", self.cpu, self.threads))];
        if self.memory > 0 {
            all.push(("memory", format!("{:.1} GB", self.memory as f64 * 1e-9)));
        }
        let debug = if self.debug { ", WITH DEBUG ASSERTIONS" } else { "" };
        all.extend([
            ("instructions", self.simd.clone()),
            ("system", self.os.clone()),
            ("skylit", format!("{}, commit {}{debug}", self.skylit, self.commit)),
            ("target", self.target.clone()),
            ("Embree", self.embree.as_ref().map_or("none".to_owned(), Embree::describe)),
            ("command", self.command.clone()),
        ]);
        all.into_iter().map(|(k, v)| (k.to_owned(), v)).collect()
    }
}

impl Embree {
    /// "3.13.5, compiled with assertions (libembree3.so.3)".
    pub fn describe(&self) -> String {
        let how = match self.assertions {
            Some(true) => "compiled with assertions",
            Some(false) => "compiled without assertions",
            None => "with or without assertions: not known",
        };
        format!("{}, {how} ({})", self.version, self.library)
    }
}

#[cfg(feature = "embree")]
fn embree() -> Option<Embree> {
    let build = crate::accel::embree::library::loaded().ok()?;
    let library = build.path.as_ref().and_then(|p| p.file_name());
    Some(Embree {
        version: build.version,
        library: library.map_or("unknown".into(), |n| n.to_string_lossy().into_owned()),
        assertions: build.assertions,
    })
}

#[cfg(not(feature = "embree"))]
fn embree() -> Option<Embree> {
    None
}

/// The value behind `name` in a file of `name: value` or `name=value` lines.
fn value_of(path: &str, name: &str, separator: char) -> Option<String> {
    let text = fs::read_to_string(path).ok()?;
    let mut pairs = text.lines().filter_map(|l| l.split_once(separator));
    pairs.find(|(k, _)| k.trim() == name).map(|(_, v)| v.trim().trim_matches('"').to_owned())
}

fn cpu() -> String {
    value_of("/proc/cpuinfo", "model name", ':')
        .filter(|m| !m.is_empty())
        .unwrap_or_else(|| format!("unknown {}", std::env::consts::ARCH))
}

fn memory() -> Option<u64> {
    let kilobytes: u64 =
        value_of("/proc/meminfo", "MemTotal", ':')?.strip_suffix("kB")?.trim().parse().ok()?;
    Some(kilobytes * 1024)
}

fn os() -> String {
    let name = value_of("/etc/os-release", "PRETTY_NAME", '=').filter(|n| !n.is_empty());
    let kernel = fs::read_to_string("/proc/sys/kernel/osrelease").ok().map(|r| format!("Linux {}", r.trim()));
    match (name, kernel) {
        (Some(n), Some(k)) => format!("{n}, {k}"),
        (Some(one), None) | (None, Some(one)) => one,
        (None, None) => std::env::consts::OS.to_owned(),
    }
}

/// As a shell would read it again; the program by its name alone.
pub fn command(args: impl Iterator<Item = String>) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_=+,.:/@%^".contains(c);
    let quoted = |(i, arg): (usize, String)| {
        let arg = if i == 0 { arg.rsplit(['/', '\\']).next().unwrap_or("skylit").to_owned() } else { arg };
        match !arg.is_empty() && arg.chars().all(plain) {
            true => arg,
            false => format!("'{}'", arg.replace('\'', r"'\''")),
        }
    };
    args.enumerate().map(quoted).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_can_be_pasted_into_a_shell() {
        let words = ["/usr/bin/skylit", "bench", "my dragon.ply", "it's", "", "--size=4x4"].map(String::from);
        assert_eq!(command(words.into_iter()), r"skylit bench 'my dragon.ply' 'it'\''s' '' --size=4x4");
    }

    #[test]
    fn a_record_says_where_it_was_taken() {
        let here = Machine::here();
        assert!(here.threads >= 1 && !here.cpu.is_empty() && !here.simd.is_empty());
        assert_eq!(here.embree.is_some(), cfg!(feature = "embree"));
        let back: Machine = serde_json::from_str(&serde_json::to_string(&here).unwrap()).unwrap();
        assert_eq!(back, here);
        // The library is loaded, so on Linux its file is found and read.
        #[cfg(all(feature = "embree", target_os = "linux"))]
        assert!(here.embree.is_some_and(|e| e.assertions.is_some() && e.library.contains("embree")));
    }
}
