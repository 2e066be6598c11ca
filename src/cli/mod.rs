//! L5: the command line, one file a verb. Results go to stdout, progress and logs to stderr.

mod args;
mod bench;
mod bench_error;
mod canvas;
mod check;
mod compare;
mod convert;
mod crosscheck;
mod denoise;
mod explain;
mod info;
mod interrupt;
mod list;
mod live;
mod manual;
mod output;
mod preview;
mod progress;
mod render;
mod rounds;
mod scene_args;
mod sky_arg;
mod statistical_args;
mod summary;
mod target_args;
mod watch;

use crate::error::{Error, Result};
use crate::memory;
use args::{Threads, amount};
use clap::builder::ArgPredicate;
use clap::error::ErrorKind;
use clap::{ArgAction, Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use log::LevelFilter;
use std::io::{ErrorKind as IoErrorKind, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;
use std::sync::Mutex;

/// Renders large triangle meshes and quadrics under skies, fast and accurately, on the CPU.
#[derive(Parser)]
#[command(name = "skylit", version = VERSION, long_version = LONG_VERSION, arg_required_else_help = true)]
#[command(after_help = "A mesh alone is a scene: skylit render dragon.ply -o dragon.png")]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
    #[command(flatten)]
    common: Common,
}

const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("SKYLIT_GIT"), ")");
const LONG_VERSION: &str = concat!(
    env!("CARGO_PKG_VERSION"),
    "\ncommit: ",
    env!("SKYLIT_GIT"),
    "\ntarget: ",
    env!("SKYLIT_TARGET"),
    "\nfeatures: ",
    env!("SKYLIT_FEATURES"),
    "\nEmbree: ",
    env!("SKYLIT_EMBREE"),
);

/// Flags of every verb.
#[derive(Args)]
struct Common {
    /// Threads to use: a number, half or max [default: max]
    #[arg(long, global = true, value_name = "N|half|max", help_heading = "Every verb")]
    threads: Option<Threads>,
    /// The most memory to use, such as 500M or 8G; what would take more is an error before it is loaded [default: no limit]
    #[arg(long, global = true, value_name = "BYTES", value_parser = |s: &str| amount(s, 1 << 20..=1 << 50))]
    #[arg(help_heading = "Every verb")]
    max_memory: Option<u64>,
    /// Nothing on stderr but errors
    #[arg(long, short, global = true, help_heading = "Every verb")]
    quiet: bool,
    /// More on stderr; twice for details
    #[arg(long, short, global = true, action = ArgAction::Count, help_heading = "Every verb")]
    verbose: u8,
}

#[derive(Subcommand)]
enum Verb {
    /// Render a scene or a mesh to pictures
    Render(Box<render::RenderArgs>),
    /// Say what is in a scene or a mesh, what it needs and what it will cost
    Info(Box<info::InfoArgs>),
    /// Measure: how fast kernels answer the same rays, how fast renders come near the truth
    Bench(Box<bench::BenchArgs>),
    /// Hold pictures against a reference: figures, likely causes, a page to look at
    Compare(Box<compare::CompareArgs>),
    /// Send every ray of a render through every kernel, judge the differences, and compare the pictures
    Crosscheck(Box<crosscheck::CrosscheckArgs>),
    /// Certify that rays neither leak, nor meet what they left, nor jump over what is near, on every kernel
    Check(Box<check::CheckArgs>),
    /// Write scenes of other programs as native ones, pictures as others, skies in other layouts
    Convert(convert::ConvertArgs),
    /// List every registered kind with its parameters
    List(list::ListArgs),
    /// Print the completions of a shell
    Completions(manual::CompletionsArgs),
    /// Print the manual page
    Man(manual::ManArgs),
}

/// Parses the command line, runs the verb, and turns failures into one line on stderr and an exit code.
pub fn main() -> ExitCode {
    keep_panics_quiet();
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(())) => ExitCode::SUCCESS,
        Ok(Err(Failure::Clap(e))) => report_usage(&e),
        Ok(Err(Failure::Error(e))) => report(&e),
        Err(_) => report(&Error::Internal(panic_message())),
    }
}

enum Failure {
    Clap(clap::Error),
    Error(Error),
}

impl From<Error> for Failure {
    fn from(e: Error) -> Self {
        Failure::Error(e)
    }
}

fn run() -> Result<(), Failure> {
    let words = command().try_get_matches();
    let cli = words.and_then(|w| Cli::from_arg_matches(&w)).map_err(Failure::Clap)?;
    start_log(&cli.common);
    interrupt::listen();
    if let Some(bytes) = cli.common.max_memory {
        memory::set_limit(bytes);
    }
    let threads = cli.common.threads.unwrap_or(Threads::Max).count();
    let started = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
    started.map_err(|e| Error::Internal(format!("cannot start {threads} threads: {e}")))?;
    let setting = Setting { threads, quiet: cli.common.quiet };
    match &cli.verb {
        Verb::Render(args) => render::run(args, &setting)?,
        Verb::Info(args) => info::run(args, &setting)?,
        Verb::Bench(args) => bench::run(args, &setting)?,
        Verb::Compare(args) => compare::run(args, &setting)?,
        Verb::Crosscheck(args) => crosscheck::run(args, &setting)?,
        Verb::Check(args) => check::run(args, &setting)?,
        Verb::Convert(args) => convert::run(args, &setting)?,
        Verb::List(args) => list::run(args)?,
        Verb::Completions(args) => manual::completions(args)?,
        Verb::Man(args) => manual::man(args)?,
    }
    Ok(())
}

/// What the flags of every verb come to.
struct Setting {
    threads: usize,
    quiet: bool,
}

fn start_log(common: &Common) {
    let level = match (common.quiet, common.verbose) {
        (true, _) => LevelFilter::Error,
        (false, 0) => LevelFilter::Warn,
        (false, 1) => LevelFilter::Info,
        (false, _) => LevelFilter::Debug,
    };
    let mut log = env_logger::Builder::new();
    log.filter_level(LevelFilter::Warn.min(level)).filter_module("skylit", level);
    log.format(|out, r| match r.level() {
        log::Level::Warn => writeln!(out, "skylit: warning: {}", r.args()),
        level => writeln!(out, "skylit: {}: {}", level.as_str().to_lowercase(), r.args()),
    });
    log.init();
}

/// Writes results to stdout. A reader that has seen enough (`| head`) is no failure.
fn print(text: &[u8]) -> Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text).and_then(|()| out.flush()) {
        Err(e) if e.kind() != IoErrorKind::BrokenPipe => Err(Error::file("stdout".as_ref(), "write", e)),
        _ => Ok(()),
    }
}

fn report(e: &Error) -> ExitCode {
    eprintln!("skylit: error: {e}");
    ExitCode::from(e.exit_code())
}

/// Help and version that were asked for go to stdout with code 0, everything else to stderr with code 2.
fn report_usage(e: &clap::Error) -> ExitCode {
    match e.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            match print(e.render().to_string().as_bytes()) {
                Ok(()) => ExitCode::SUCCESS,
                Err(e) => report(&e),
            }
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            eprint!("{}", e.render());
            ExitCode::from(2)
        }
        _ => {
            eprint!("skylit: {}", e.render());
            ExitCode::from(2)
        }
    }
}

static PANIC: Mutex<Option<String>> = Mutex::new(None);

/// A panic is a fault of ours: its place and message become the one line of the error, the first one's if several
/// threads fall. With RUST_BACKTRACE set the usual report comes as well.
fn keep_panics_quiet() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |info| {
        let payload = info.payload();
        let text = payload.downcast_ref::<&str>().copied();
        let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str));
        let what = text.unwrap_or("panic").replace('\n', " ");
        let at = info.location().map_or(String::new(), |l| format!(" ({}:{})", l.file(), l.line()));
        if let Ok(mut first) = PANIC.lock() {
            first.get_or_insert(format!("{what}{at}; please report this"));
        }
        if std::env::var_os("RUST_BACKTRACE").is_some_and(|v| v != "0") {
            usual(info);
        }
    }));
}

fn panic_message() -> String {
    PANIC.lock().ok().and_then(|mut m| m.take()).unwrap_or_else(|| "panic".into())
}

/// The whole command.
fn command() -> clap::Command {
    // Where sizes are given, what is generated need not be.
    let input = |a: clap::Arg| {
        let generated = a.required(false).required_unless_present("triangles");
        generated.default_value_if("triangles", ArgPredicate::IsPresent, "knot")
    };
    Cli::command().mut_subcommand("bench", |b| b.mut_subcommand("rays", |r| r.mut_arg("input", input)))
}
