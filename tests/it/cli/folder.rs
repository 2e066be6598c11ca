//! A folder with small inputs, and runs of the binary in it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A folder of its own, gone when dropped.
pub struct Folder(tempfile::TempDir);

/// What a run came to.
pub struct Run {
    pub code: i32,
    pub stdout: String,
    pub stderr: String,
}

/// The cheapest picture, so that only what is tested takes time.
pub const QUICK: &str = "--size 8x6 --spp 1 --sky constant --threads 1";

/// Two triangles of the corners (0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 1).
const TRIANGLES: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
    property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0\n1 0 0\n0 1 0\n1 1 1\n3 0 1 2\n3 1 3 2\n";

pub const SCENE: &str = r#"
[film]
size = [8, 6]
[render]
spp = 2
[camera]
type = "perspective"
eye = [0.3, 0.3, 4.0]
look_at = [0.3, 0.3, 0.0]
[sky]
type = "constant"
[materials.clay]
type = "diffuse"
albedo = [0.5, 0.4, 0.3]
[[objects]]
name = "tri"
shape = { type = "mesh", path = "tri.ply" }
material = "clay"
"#;

impl Run {
    /// Fails with `code` and one line of error on stderr that holds each of `words`.
    #[track_caller]
    pub fn refuses(&self, code: i32, words: &[&str]) {
        assert_eq!(self.code, code, "{}", self.stderr);
        let errors = self.stderr.matches("skylit: error: ").count();
        assert_eq!(errors, 1, "{}", self.stderr);
        assert!(!self.stderr.contains("panicked"), "{}", self.stderr);
        for w in words {
            assert!(self.stderr.contains(w), "wanted {w:?} in {}", self.stderr);
        }
    }

    #[track_caller]
    pub fn succeeds(self) -> Self {
        assert_eq!(self.code, 0, "{}", self.stderr);
        self
    }
}

impl Folder {
    /// With `tri.ply` and `scene.toml`.
    pub fn new() -> Self {
        let folder = Folder(tempfile::tempdir().unwrap());
        folder.write("tri.ply", TRIANGLES);
        folder.write("scene.toml", SCENE);
        folder
    }

    pub fn path(&self) -> &Path {
        self.0.path()
    }

    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        let path = self.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }

    pub fn json(&self, name: &str) -> serde_json::Value {
        serde_json::from_str(&fs::read_to_string(self.path().join(name)).unwrap()).unwrap()
    }

    /// All files below, sorted.
    pub fn listing(&self) -> Vec<PathBuf> {
        fn walk(dir: &Path, out: &mut Vec<PathBuf>) {
            for entry in fs::read_dir(dir).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() { walk(&path, out) } else { out.push(path) }
            }
        }
        let mut out = Vec::new();
        walk(self.path(), &mut out);
        out.sort();
        out
    }

    /// The files' names, sorted.
    pub fn names(&self) -> Vec<String> {
        self.listing().iter().map(|p| p.file_name().unwrap().to_string_lossy().into_owned()).collect()
    }

    /// `skylit` in the folder with these words.
    pub fn command(&self, command: &str) -> Command {
        let mut c = Command::new(env!("CARGO_BIN_EXE_skylit"));
        c.current_dir(self.path()).args(command.split_whitespace());
        c.env_remove("RUST_BACKTRACE").env("NO_COLOR", "1");
        c
    }

    /// Runs it. To be ended by a signal is a failure of every test.
    #[track_caller]
    pub fn run(&self, command: &str) -> Run {
        let output = self.command(command).output().unwrap();
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let code = output.status.code().unwrap_or_else(|| panic!("{command}: {}", output.status));
        Run { code, stdout: text(&output.stdout), stderr: text(&output.stderr) }
    }

    /// Runs it; it must refuse and leave no file behind.
    #[track_caller]
    pub fn refuses(&self, command: &str, code: i32, words: &[&str]) {
        let before = self.listing();
        self.run(command).refuses(code, words);
        assert_eq!(self.listing(), before);
    }
}
