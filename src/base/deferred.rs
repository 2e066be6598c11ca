//! What is made when it is first asked for: pictures, which may turn out not to be needed, and which are decoded while the
//! kernel is built.

use crate::error::Result;
use std::sync::{Arc, OnceLock};

/// A value that is there, or will be made at the first [`Deferred::get`] and then kept. Clones share it.
pub struct Deferred<T>(Arc<Inner<T>>);

struct Inner<T> {
    made: OnceLock<Result<Arc<T>>>,
    make: Option<Box<dyn Fn() -> Result<Arc<T>> + Send + Sync>>,
    /// What this one is made of, if that is a deferred value itself.
    origin: Option<Deferred<T>>,
}

impl<T> Clone for Deferred<T> {
    fn clone(&self) -> Self {
        Deferred(self.0.clone())
    }
}

impl<T: Send + Sync + 'static> Deferred<T> {
    /// What is there.
    pub fn ready(value: T) -> Self {
        Deferred(Arc::new(Inner { made: OnceLock::from(Ok(Arc::new(value))), make: None, origin: None }))
    }

    /// What `make` makes.
    pub fn new(make: impl Fn() -> Result<T> + Send + Sync + 'static) -> Self {
        let make = Box::new(move || make().map(Arc::new));
        Deferred(Arc::new(Inner { made: OnceLock::new(), make: Some(make), origin: None }))
    }

    /// The same, or `instead` where it cannot be made; that costs a warning, which ends in `consequence`.
    pub fn or(self, instead: T, consequence: &'static str) -> Self {
        let (origin, instead) = (self.clone(), Arc::new(instead));
        let make = Box::new(move || {
            Ok(self.get().unwrap_or_else(|e| {
                log::warn!("{e}; {consequence}");
                instead.clone()
            }))
        });
        Deferred(Arc::new(Inner { made: OnceLock::new(), make: Some(make), origin: Some(origin) }))
    }

    /// The value.
    ///
    /// # Errors
    /// That of making it, at every call.
    pub fn get(&self) -> Result<Arc<T>> {
        let Inner { made, make, .. } = &*self.0;
        if let (None, Some(make)) = (made.get(), make) {
            // Not inside of `get_or_init`, whose lock a thread pool may come back to while it waits for parts of the
            // work. Two that ask at once may so both make it, and keep one: whoever asks for many asks for each once.
            let value = make();
            return made.get_or_init(|| value).clone();
        }
        made.get()
            .cloned()
            .unwrap_or_else(|| Err(crate::error::Error::Internal("a value without a maker".into())))
    }

    /// The one that takes the work of this one: itself, unless it was made by [`Deferred::or`].
    pub fn origin(&self) -> &Self {
        self.0.origin.as_ref().map_or(self, Deferred::origin)
    }

    /// Tells apart what is not shared.
    pub fn address(&self) -> usize {
        Arc::as_ptr(&self.0) as *const () as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn it_is_made_once_when_asked_for() {
        let calls = Arc::new(AtomicUsize::new(0));
        let counted = calls.clone();
        let value = Deferred::new(move || Ok(counted.fetch_add(1, Ordering::Relaxed)));
        let (shared, other) = (value.clone(), value.clone().or(7, "nothing"));
        assert_eq!(calls.load(Ordering::Relaxed), 0);
        assert_eq!([value.get(), shared.get(), other.get()].map(|v| *v.expect("made")), [0; 3]);
        assert_eq!(calls.load(Ordering::Relaxed), 1);
        assert_eq!(other.origin().address(), shared.address());
    }

    #[test]
    fn a_failure_stays_one_and_may_be_stood_in_for() {
        let value = Deferred::<u8>::new(|| Err(Error::Usage("no".into())));
        assert!(value.get().is_err() && value.get().is_err());
        assert_eq!(*value.or(7, "seven is used").get().expect("another"), 7);
        assert_eq!(*Deferred::ready(3).get().expect("there"), 3);
    }
}
