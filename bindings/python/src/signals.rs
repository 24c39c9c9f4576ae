//! Signals during a wait: their Python handlers run, and may use the bus.

use std::cell::Cell;
use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// Longest delay of a signal, such as Ctrl-C.
const LOOK: Duration = Duration::from_millis(20);

thread_local! {
    /// Whether the thread is one of ours: it runs no signal handlers, and never waits for Python.
    static IS_OURS: Cell<bool> = const { Cell::new(false) };
}

/// Does something in a thread that Python does not know.
pub(crate) fn without_python<T>(act: impl FnOnce() -> T) -> T {
    IS_OURS.set(true);
    let done = act();
    IS_OURS.set(false);
    done
}

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
        move || match deaf.load(Ordering::Relaxed) || IS_OURS.get() {
            true => Ok(()),
            false => Ok(Python::attach(|py| py.check_signals())?),
        }
    }
}

/// Does something that takes long, in a thread of its own. Signal handlers run meanwhile. If one raises,
/// the result is not used.
pub(crate) fn attended<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    let (tell, mut told) = mpsc::channel();
    // After a signal the result is not used.
    std::thread::Builder::new().spawn(move || drop(tell.send(work())))?;
    loop {
        let heard;
        (heard, told) = py.detach(move || (told.recv_timeout(LOOK), told));
        match heard {
            Ok(done) => return Ok(done),
            Err(RecvTimeoutError::Timeout) => py.check_signals()?,
            Err(RecvTimeoutError::Disconnected) => {
                return Err(PyRuntimeError::new_err("a thread of motorlink has ended early"));
            }
        }
    }
}
