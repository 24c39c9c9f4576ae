//! Clients for event loops: they advance in steps that do not wait.

mod rmd;
mod st;

pub(crate) use rmd::RmdEventClient;
pub(crate) use st::StEventClient;

use std::os::fd::{AsRawFd, BorrowedFd};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::error::{closed, elsewhere};
use crate::shared::Owner;

/// A client until it is closed. Only opening and closing may wait, and may run in another thread.
/// All else runs in the thread of the event loop.
struct Driven<T> {
    state: Mutex<Option<T>>,
    port: String,
    owner: Owner,
    closing: Mutex<()>,
}

impl<T: Send> Driven<T> {
    fn new(state: T, port: String) -> Self {
        Driven {
            state: Mutex::new(Some(state)),
            port,
            owner: Owner::new(),
            closing: Mutex::new(()),
        }
    }

    /// A step, which does not wait. It must not run Python code: a signal handler could run there
    /// and could not close what the step has locked.
    fn step<R>(&self, py: Python<'_>, step: impl FnOnce(&mut T) -> R) -> PyResult<R> {
        self.check_owner(py)?;
        let done = match self.state.try_lock() {
            Ok(mut state) => state.as_mut().map(step),
            Err(_) => {
                let why = format!("{} is being opened or closed", self.port);
                return Err(PyRuntimeError::new_err(why));
            }
        };
        done.ok_or_else(|| closed(py, &self.port))
    }

    /// A call that may wait, while other Python threads run.
    fn detached<R: Send>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(&mut T) -> R + Send,
    ) -> PyResult<R> {
        self.check_owner(py)?;
        let done = py.detach(|| self.lock().as_mut().map(act));
        done.ok_or_else(|| closed(py, &self.port))
    }

    /// Closes it, while other Python threads run. A second call waits for the first one and does
    /// nothing. In another process it does nothing.
    fn close<R: Send>(&self, py: Python<'_>, end: impl FnOnce(T) -> Vec<R> + Send) -> Vec<R> {
        if !self.owner.is_here() {
            return Vec::new();
        }
        py.detach(|| {
            let _closing = self.closing.lock().unwrap_or_else(PoisonError::into_inner);
            let state = self.lock().take();
            state.map_or_else(Vec::new, end)
        })
    }

    fn check_owner(&self, py: Python<'_>) -> PyResult<()> {
        if self.owner.is_here() { Ok(()) } else { Err(elsewhere(py, &self.port)) }
    }

    fn lock(&self) -> MutexGuard<'_, Option<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A descriptor as a Python integer; `None` without one.
fn fileno(descriptor: Option<BorrowedFd<'_>>) -> Option<i32> {
    descriptor.map(|fd| fd.as_raw_fd())
}

/// A wait in s.
fn seconds(wait: Option<Duration>) -> Option<f64> {
    wait.map(|wait| wait.as_secs_f64())
}

/// A value, or the exception in its place.
fn outcome(py: Python<'_>, result: PyResult<Py<PyAny>>) -> Py<PyAny> {
    result.unwrap_or_else(|error| error.into_value(py).into_any())
}
