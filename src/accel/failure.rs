//! What goes wrong inside a query, kept for [`Intersectable::take_failure`](crate::base::intersectable::Intersectable).

use crate::error::{Error, Result};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

/// The first failure inside code that a query calls (shapes, filters). A query has no way to return one.
#[derive(Default)]
pub(in crate::accel) struct Failure {
    failed: AtomicBool,
    message: Mutex<Option<String>>,
}

impl Failure {
    /// Runs a callback's work. A panic must not unwind into Embree: it is kept, and the callback reports nothing.
    #[inline]
    pub(in crate::accel) fn guard(&self, work: impl FnOnce()) {
        // What a panic leaves half-done are ray records of a render that is about to fail.
        if let Err(panic) = catch_unwind(AssertUnwindSafe(work)) {
            self.record(panic_text(&*panic));
        }
    }

    fn record(&self, text: String) {
        let mut message = self.message.lock().unwrap_or_else(PoisonError::into_inner);
        message.get_or_insert(text);
        self.failed.store(true, Ordering::Release);
    }

    /// The failure since the last call, if any.
    pub(in crate::accel) fn take(&self) -> Result<()> {
        if !self.failed.swap(false, Ordering::AcqRel) {
            return Ok(());
        }
        let message = self.message.lock().unwrap_or_else(PoisonError::into_inner).take();
        Err(Error::Internal(message.unwrap_or_else(|| "unknown failure in a ray query".to_owned())))
    }
}

/// What `panic!` was given.
fn panic_text(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().copied();
    let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    format!("panic in a shape or hit filter: {}", text.unwrap_or("(no message)"))
}
