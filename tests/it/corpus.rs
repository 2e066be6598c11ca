//! Bytes from outside, and what every reader promises of them (the checks of the fuzz targets): the corpora that the
//! fuzzer grew, and small good files with a bit changed or the end cut off. Nothing here may panic.

#[path = "../../fuzz/src/targets.rs"]
mod targets;

use crate::common::shared;
use crate::seeds::{Seed, seeds};
use std::fs;
use std::path::{Path, PathBuf};
use targets::{TARGETS, run};

/// Where the corpora lie, a folder a target.
fn corpora() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus")
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut all: Vec<PathBuf> = fs::read_dir(folder)
        .unwrap_or_else(|e| panic!("{}: {e}", folder.display()))
        .map(|entry| entry.expect("readable").path())
        .collect();
    all.sort();
    all
}

#[test]
fn every_file_of_the_corpora_loads_or_is_refused_with_a_message() {
    for target in TARGETS {
        let files = files(&corpora().join(target));
        // Few and small, so that this costs seconds and the repository little.
        assert!((1..=80).contains(&files.len()), "{target}: {} files", files.len());
        let bytes: Vec<Vec<u8>> = files.iter().map(|f| fs::read(f).expect("readable")).collect();
        assert!(bytes.iter().map(Vec::len).sum::<usize>() <= 200 << 10, "{target} is too large");
        let accepted = bytes.iter().filter(|b| run(target, b)).count();
        assert!(accepted > 0, "{target}: the corpus has nothing good");
    }
}

#[test]
fn every_seed_is_a_good_file() {
    for seed in seeds() {
        assert!(run(seed.target, &seed.bytes), "{} {}", seed.target, seed.name);
    }
    for target in TARGETS {
        assert!(seeds().iter().any(|s| s.target == target), "{target} has no seed");
    }
}

/// Constants of Knuth's MMIX generator.
struct Draw(u64);

impl Draw {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 33) as usize % n.max(1)
    }
}

/// Truncations at `cuts` places, and as many changes of one bit.
fn damage(target: &str, good: &[u8], cuts: usize, draw: &mut Draw) {
    for i in 0..cuts {
        // All places of a small file, else at even distances.
        run(target, &good[..i * good.len() / cuts]);
        let mut bytes = good.to_vec();
        if let Some(byte) = bytes.get_mut(draw.below(good.len())) {
            *byte ^= 1 << draw.below(8);
            run(target, &bytes);
        }
    }
}

#[test]
fn damaged_seeds_are_refused_or_read_but_never_worse() {
    let mut draw = Draw(1);
    for Seed { target, bytes, .. } in seeds() {
        damage(target, &bytes, bytes.len().min(100), &mut draw);
    }
}

/// The target that reads a file of this name.
fn target_of(path: &Path) -> Option<&'static str> {
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    Some(match extension.as_str() {
        "obj" => "obj",
        "mtl" => "mtl",
        "ply" => "ply",
        "scene" => "seed",
        "test" => "course",
        "png" => "png",
        "jpg" | "jpeg" => "jpg",
        "hdr" => "hdr",
        "exr" => "exr",
        "tif" | "tiff" => "tiff",
        "pfm" => "pfm",
        "gz" => "gzip",
        "zst" => "zstd",
        _ => return None,
    })
}

/// All files below a folder.
fn below(folder: &Path) -> Vec<PathBuf> {
    files(folder).into_iter().flat_map(|p| if p.is_dir() { below(&p) } else { vec![p] }).collect()
}

#[test]
fn small_files_of_others_are_read_or_refused_whole_and_damaged() {
    /// Bytes of a file: larger ones are cut in other tests, or would cost minutes here.
    const MOST: u64 = 1 << 16;
    let mut draw = Draw(2);
    for (folder, least) in [("meshes/malformed", 12), ("meshes/awkward-obj", 30), ("scenes", 20)] {
        let Some(folder) = shared(folder) else { return };
        let mut tried = 0;
        for path in below(&folder) {
            let small = fs::metadata(&path).is_ok_and(|m| m.len() <= MOST);
            if let (true, Some(target)) = (small, target_of(&path)) {
                let bytes = fs::read(&path).expect("readable");
                run(target, &bytes);
                damage(target, &bytes, 10, &mut draw);
                tried += 1;
            }
        }
        assert!(tried >= least, "{}: {tried} files", folder.display());
    }
}

/// Writes the seeds for the fuzzer, below the folder that `SKYLIT_SEEDS` names.
#[test]
#[ignore = "writes files: SKYLIT_SEEDS=fuzz/seeds cargo test --test it write_the_seeds -- --ignored"]
fn write_the_seeds() {
    let folder = std::env::var_os("SKYLIT_SEEDS").map(PathBuf::from).expect("SKYLIT_SEEDS names a folder");
    for Seed { target, name, bytes } in seeds() {
        let folder = folder.join(target);
        fs::create_dir_all(&folder).expect("a folder");
        fs::write(folder.join(name), bytes).expect("written");
    }
}
