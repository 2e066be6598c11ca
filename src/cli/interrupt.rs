//! Ctrl-C: at once, but never in the middle of a file.

use signal_hook::consts::{SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::flag;
use signal_hook::iterator::Signals;
use signal_hook::low_level;
use std::sync::{Arc, Mutex, PoisonError};

/// Held while files are written.
static WRITING: Mutex<()> = Mutex::new(());

/// What is still to be done when the process is interrupted.
static BEFORE_EXIT: Mutex<Option<Box<dyn Fn() + Send>>> = Mutex::new(None);

/// Does this, in the place of what was to be done so far, when the process is interrupted.
pub fn before_exit(work: impl Fn() + Send + 'static) {
    *BEFORE_EXIT.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(work));
}

/// Ends the process at the first SIGINT or SIGTERM with 128 plus the signal's number (130 for Ctrl-C), as shells do.
/// Files being written are finished first. No destructors run: those of native libraries must not, under worker
/// threads that still trace.
pub fn listen() {
    // Heard, the limit on a file's size is an error of the write, which is told and tidied up after; unheard, it kills.
    if let Err(e) = flag::register(SIGXFSZ, Arc::default()) {
        log::debug!("cannot listen for SIGXFSZ: {e}");
    }
    let Ok(mut signals) = Signals::new([SIGINT, SIGTERM]) else { return };
    std::thread::spawn(move || {
        if let Some(signal) = signals.forever().next() {
            let _writing = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(work) = &*BEFORE_EXIT.lock().unwrap_or_else(PoisonError::into_inner) {
                work();
            }
            eprintln!("\nskylit: interrupted");
            low_level::exit(128 + signal);
        }
    });
}

/// Writes files without being interrupted.
pub fn hold_off<T>(write: impl FnOnce() -> T) -> T {
    let _writing = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
    write()
}
