//! What all fuzz targets share: `targets` is also what the tests of the crate replay the corpora through.

mod targets;

use std::sync::Once;

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
    static LOGGER: Once = Once::new();
    LOGGER.call_once(|| {
        log::set_logger(&Sink).expect("no other logger");
        log::set_max_level(log::LevelFilter::Info);
    });
    let _accepted = targets::run(target, data);
}
