//! What all fuzz targets share: `targets` is also what the tests of the crate replay the corpora through.

mod targets;

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind, set_hook};
use std::sync::{Mutex, Once, PoisonError};

/// What the last panic said.
static LAST_PANIC: Mutex<String> = Mutex::new(String::new());

/// Makes the text of every message, so that a failure there is found, and drops it.
struct Sink;

impl log::Log for Sink {
    fn enabled(&self, _: &log::Metadata) -> bool {
        true
    }

    fn log(&self, record: &log::Record) {
        std::hint::black_box(record.args().to_string());
    }

    fn flush(&self) {}
}

/// One run of a target.
///
/// # Panics
/// Where a reader breaks what it promises.
pub fn run(target: &str, data: &[u8]) {
    static START: Once = Once::new();
    START.call_once(|| {
        log::set_logger(&Sink).expect("no other logger");
        log::set_max_level(log::LevelFilter::Info);
        // The fuzzer's own hook ends the process at once; panics of libraries that the readers catch are no finds.
        set_hook(Box::new(|info| {
            *LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner) =
                format!("{info}\n{}", std::backtrace::Backtrace::force_capture());
        }));
    });
    if let Err(panic) = catch_unwind(AssertUnwindSafe(|| targets::run(target, data))) {
        eprintln!("{}", LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner));
        resume_unwind(panic);
    }
}
