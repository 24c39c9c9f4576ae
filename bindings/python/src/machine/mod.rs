//! Clients for event loops: they are driven in steps, none of which waits.

mod rmd;
mod st;

pub(crate) use rmd::RmdMachine;
pub(crate) use st::StMachine;

use std::os::fd::{AsRawFd, BorrowedFd};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::error::closed;

/// What a machine drives, until it is closed. Only its opening and closing wait, and they may do so
/// in another thread; everything else belongs to the thread of the event loop.
struct Driven<T> {
    state: Mutex<Option<T>>,
    port: String,
}

impl<T: Send> Driven<T> {
    fn new(state: T, port: String) -> Self {
        Driven { state: Mutex::new(Some(state)), port }
    }

    /// A step, which does not wait.
    fn step<R>(&self, py: Python<'_>, step: impl FnOnce(&mut T) -> PyResult<R>) -> PyResult<R> {
        let mut state = self.state.try_lock().map_err(|_| {
            PyRuntimeError::new_err(format!("{} is being opened or closed", self.port))
        })?;
        step(state.as_mut().ok_or_else(|| closed(py, &self.port))?)
    }

    /// What may wait, while other Python threads run.
    fn detached<R: Send>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(&mut T) -> R + Send,
    ) -> PyResult<R> {
        let done = py.detach(|| self.lock().as_mut().map(act));
        done.ok_or_else(|| closed(py, &self.port))
    }

    /// Ends it; nothing the second time.
    fn take(&self) -> Option<T> {
        self.lock().take()
    }

    fn lock(&self) -> MutexGuard<'_, Option<T>> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A descriptor as Python knows it; `None` where there is nothing to watch.
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
