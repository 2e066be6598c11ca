//! Another program of ours, such as one built against another Embree, that runs the same rays in turn with this one.
//!
//! It is started as `skylit bench rays-worker ...`, builds its kernels, and says what it has in one line of JSON
//! ([`Hello`]). For each line that it is sent (a request) it answers one (a reply), until its input ends.

use super::forms::Answers;
use super::kernels::KernelInfo;
use super::measure::Bench;
use super::sets::WORKLOADS;
use crate::base::hit::NO_PRIMITIVE;
use crate::error::{Error, Result};
use crate::image::write::write_file;
use crate::report::machine::Machine;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

/// Of the lines that are exchanged.
const PROTOCOL: u32 = 1;

/// A row: a kernel in one form.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct PeerRow {
    /// Index into the kernels.
    pub kernel: usize,
    /// Name of the form.
    pub form: String,
}

/// The first line of a worker.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Hello {
    /// [`PROTOCOL`].
    protocol: u32,
    /// What it is and runs on.
    pub machine: Machine,
    /// What it has built.
    pub kernels: Vec<KernelInfo>,
    /// What can be asked.
    pub rows: Vec<PeerRow>,
}

/// A line to a worker.
#[derive(Debug, Serialize, Deserialize)]
#[serde(tag = "ask", rename_all = "lowercase")]
enum Request {
    /// One timed pass.
    Run { row: usize, workload: String },
    /// One pass whose answers go to a file: per ray primitive u32 and path u64, little endian.
    Answers { row: usize, workload: String, file: PathBuf },
}

/// A line of a worker.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Reply {
    /// Of the pass; none where the form does not fit the workload.
    seconds: Option<f64>,
    /// What went wrong.
    error: Option<String>,
}

/// How long a worker may load and build, and how long it may take for one pass. Nothing that is measured here takes a
/// hundredth of it: what is silent for longer hangs.
const PATIENCE: [Duration; 2] = [Duration::from_secs(3600), Duration::from_secs(600)];
/// Longest line of a worker, in bytes.
const MAX_LINE: u64 = 1 << 20;

/// A worker that was started; it ends with this value.
pub struct Peer {
    /// What it said first.
    pub hello: Hello,
    program: PathBuf,
    child: Child,
    input: ChildStdin,
    lines: Receiver<std::io::Result<String>>,
    room: tempfile::TempDir,
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It may be in the middle of a pass that nobody waits for any more.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Peer {
    /// Starts `program` and waits until it has built its kernels.
    ///
    /// # Errors
    /// [`Error::File`] if it cannot be started; [`Error::Usage`] if it is no such program, or ends.
    pub fn start(program: &Path, args: &[OsString]) -> Result<Peer> {
        let room = tempfile::tempdir().map_err(|e| Error::file(&std::env::temp_dir(), "create", e))?;
        let mut command = Command::new(program);
        command.args(args).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().map_err(|e| Error::file(program, "start", e))?;
        let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(Error::Internal("a child without its pipes".into()));
        };
        let (tell, lines) = channel();
        std::thread::spawn(move || {
            let mut output = BufReader::new(output);
            loop {
                let mut line = String::new();
                let read = output.by_ref().take(MAX_LINE).read_line(&mut line);
                let ended = !matches!(read, Ok(1..)) || !line.ends_with('\n');
                if tell.send(read.map(|_| line)).is_err() || ended {
                    return;
                }
            }
        });
        let hello = receive(&lines, program, PATIENCE[0]);
        let hello: Hello = hello.inspect_err(|_| drop((child.kill(), child.wait())))?;
        let peer = Peer { hello, program: program.to_owned(), child, input, lines, room };
        let fits = peer.hello.rows.iter().all(|r| r.kernel < peer.hello.kernels.len());
        match peer.hello.protocol == PROTOCOL && fits {
            true => Ok(peer),
            false => Err(strange(program, "it speaks another version of the protocol")),
        }
    }

    fn ask(&mut self, request: &Request) -> Result<Option<f64>> {
        let mut line = serde_json::to_string(request).map_err(|e| Error::Internal(e.to_string()))?;
        line.push('\n');
        let sent = self.input.write_all(line.as_bytes()).and_then(|()| self.input.flush());
        sent.map_err(|e| strange(&self.program, &format!("it ended: {e}")))?;
        let reply: Reply = receive(&self.lines, &self.program, PATIENCE[1])?;
        match (reply.error, reply.seconds) {
            (Some(e), _) => Err(strange(&self.program, &e)),
            (None, Some(s)) if !(s.is_finite() && s >= 0.0) => {
                Err(strange(&self.program, "a time that is none"))
            }
            (None, seconds) => Ok(seconds),
        }
    }

    /// As [`Bench::time`].
    pub(super) fn time(&mut self, row: usize, workload: &str) -> Result<Option<f64>> {
        self.ask(&Request::Run { row, workload: workload.into() })
    }

    /// As [`Bench::answers`], of so many rays.
    pub(super) fn answers(&mut self, row: usize, workload: &str, rays: usize) -> Result<Option<Answers>> {
        let file = self.room.path().join("answers");
        if self.ask(&Request::Answers { row, workload: workload.into(), file: file.clone() })?.is_none() {
            return Ok(None);
        }
        let size = std::fs::metadata(&file).map_err(|e| Error::file(&file, "open", e))?.len();
        if size != rays as u64 * ANSWER as u64 {
            return Err(strange(&self.program, &format!("{size} bytes of answers to {rays} rays")));
        }
        let bytes = std::fs::read(&file).map_err(|e| Error::file(&file, "read", e))?;
        let mut answers = Answers::default();
        for b in bytes.chunks_exact(ANSWER) {
            let (prim, path) = b.split_at(4);
            let prim = u32::from_le_bytes(prim.try_into().expect("four bytes"));
            let path = u64::from_le_bytes(path.try_into().expect("eight bytes"));
            answers.push((prim != NO_PRIMITIVE).then_some((prim, path)));
        }
        Ok(Some(answers))
    }
}

/// Bytes of an answer in a file.
const ANSWER: usize = 12;

fn strange(program: &Path, what: &str) -> Error {
    Error::Usage(format!("--peer {}: {what}", program.display()))
}

fn receive<T: DeserializeOwned>(
    lines: &Receiver<std::io::Result<String>>,
    program: &Path,
    patience: Duration,
) -> Result<T> {
    let line = match lines.recv_timeout(patience) {
        Ok(Ok(line)) if !line.is_empty() => line,
        Ok(Err(e)) => return Err(strange(program, &e.to_string())),
        Err(RecvTimeoutError::Timeout) => return Err(strange(program, "it has been silent for too long")),
        Ok(Ok(_)) | Err(RecvTimeoutError::Disconnected) => {
            return Err(strange(program, "it ended without an answer"));
        }
    };
    serde_json::from_str(&line).map_err(|e| strange(program, &format!("it is no skylit with this verb: {e}")))
}

/// The worker's side: answers requests from `input` until that ends.
///
/// # Errors
/// [`Error::File`] if nobody listens any more.
pub fn serve(bench: &Bench, input: impl BufRead, mut output: impl Write) -> Result<()> {
    let hello =
        Hello { protocol: PROTOCOL, machine: Machine::here(), kernels: bench.kernels(), rows: bench.rows() };
    say(&mut output, &hello)?;
    for line in input.lines() {
        let line = line.map_err(|e| Error::file("stdin".as_ref(), "read", e))?;
        let done = serde_json::from_str(&line)
            .map_err(|e| Error::Usage(format!("a request that is none: {e}")))
            .and_then(|request| answer(bench, &request));
        let reply = match done {
            Ok(seconds) => Reply { seconds, error: None },
            Err(e) => Reply { seconds: None, error: Some(e.to_string()) },
        };
        say(&mut output, &reply)?;
    }
    Ok(())
}

fn say(output: &mut impl Write, what: &impl Serialize) -> Result<()> {
    let line = serde_json::to_string(what).map_err(|e| Error::Internal(e.to_string()))?;
    let sent = output.write_all((line + "\n").as_bytes()).and_then(|()| output.flush());
    sent.map_err(|e| Error::file("stdout".as_ref(), "write", e))
}

fn answer(bench: &Bench, request: &Request) -> Result<Option<f64>> {
    let (Request::Run { workload, .. } | Request::Answers { workload, .. }) = request;
    let known = WORKLOADS.iter().find(|w| w.name == workload.as_str());
    let work = known.ok_or_else(|| Error::Usage(format!("unknown workload \"{workload}\"")))?;
    match request {
        Request::Run { row, .. } => bench.time(*row, work),
        Request::Answers { row, file, .. } => {
            let Some(answers) = bench.answers(*row, work)? else { return Ok(None) };
            let mut bytes = Vec::with_capacity(answers.prim.len() * ANSWER);
            for (prim, path) in answers.prim.iter().zip(&answers.path) {
                bytes.extend(prim.to_le_bytes());
                bytes.extend(path.to_le_bytes());
            }
            write_file(file, &bytes)?;
            Ok(Some(0.0))
        }
    }
}
