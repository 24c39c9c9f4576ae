//! Signals during a wait: their Python handlers run, and may use the bus.

use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use pyo3::prelude::*;

/// Whether the waits of a bus ignore signals.
#[derive(Clone, Default)]
pub(crate) struct Deafness(Arc<AtomicBool>);

impl Deafness {
    /// Does something that no signal may interrupt. Handlers run afterwards.
    pub(crate) fn during<T>(&self, act: impl FnOnce() -> T) -> T {
        self.0.store(true, Ordering::Relaxed);
        let done = act();
        self.0.store(false, Ordering::Relaxed);
        done
    }

    /// What a waiting bus calls: it runs the handlers of pending signals in the main thread. If a
    /// handler raises, the wait ends.
    pub(crate) fn look(
        &self,
    ) -> impl Fn() -> Result<(), Box<dyn Error + Send + Sync>> + Send + Sync + 'static {
        let deaf = Arc::clone(&self.0);
        move || match deaf.load(Ordering::Relaxed) {
            true => Ok(()),
            false => Ok(Python::attach(|py| py.check_signals())?),
        }
    }
}
