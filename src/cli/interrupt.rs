//! Ctrl-C: at once.

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use signal_hook::low_level;

/// Ends the process at the first SIGINT or SIGTERM with 128 plus the signal's number (130 for Ctrl-C), as shells do.
///  No destructors run: those of native libraries must not, under worker
/// threads that still trace.
pub fn listen() {
    let Ok(mut signals) = Signals::new([SIGINT, SIGTERM]) else { return };
    std::thread::spawn(move || {
        if let Some(signal) = signals.forever().next() {
            eprintln!("\nskylit: interrupted");
            low_level::exit(128 + signal);
        }
    });
}
