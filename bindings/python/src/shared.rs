//! A bus that threads share, until one of them closes it.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, PoisonError, RwLock};
use std::time::Duration;

use pyo3::prelude::*;

use crate::error::{closed, elsewhere};

/// How soon a close notices that the last exchange is over.
const TURN: Duration = Duration::from_millis(1);

/// What drives a line, and whose it is.
pub(crate) struct Shared<T> {
    line: RwLock<Option<Arc<T>>>,
    /// Exchanges that may set something moving.
    under_way: AtomicUsize,
    port: String,
    /// A fork has the descriptors of its parent, and locks that nobody will ever release.
    process: u32,
}

impl<T: Send + Sync> Shared<T> {
    pub(crate) fn new(line: T, port: String) -> Self {
        let (line, process) = (RwLock::new(Some(Arc::new(line))), std::process::id());
        Shared { line, under_way: AtomicUsize::new(0), port, process }
    }

    /// The port's name.
    pub(crate) fn port(&self) -> &str {
        &self.port
    }

    /// An exchange, while other Python threads run; an error once it was closed.
    pub(crate) fn exchange<R: Send>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(&T) -> R + Send,
    ) -> PyResult<R> {
        // Counted before it is known that the line is open: a close has either closed it, or waits.
        let _counted = Counted::new(&self.under_way);
        let line = self.get(py)?;
        Ok(py.detach(|| act(&line)))
    }

    /// The line, for what sets nothing moving; an error once it was closed.
    pub(crate) fn get(&self, py: Python<'_>) -> PyResult<Arc<T>> {
        if !self.is_ours() {
            return Err(elsewhere(py, &self.port));
        }
        let line = self.line.read().unwrap_or_else(PoisonError::into_inner);
        line.clone().ok_or_else(|| closed(py, &self.port))
    }

    /// Whether it was closed.
    pub(crate) fn is_closed(&self) -> bool {
        self.line.read().unwrap_or_else(PoisonError::into_inner).is_none()
    }

    /// Closes it: `stop` stops what moves, at once, and again when exchanges that were under way are
    /// over, for they may have set something moving. Gives what the last `stop` gave; again is no
    /// error. A process that did not open it only forgets it.
    pub(crate) fn close<R: Send>(
        &self,
        py: Python<'_>,
        stop: impl Fn(&T) -> Vec<R> + Send + Sync,
    ) -> Vec<R> {
        let line = self.line.write().unwrap_or_else(PoisonError::into_inner).take();
        let Some(line) = line else { return Vec::new() };
        if !self.is_ours() {
            std::mem::forget(line);
            return Vec::new();
        }
        py.detach(|| {
            let is_used = || self.under_way.load(Ordering::SeqCst) > 0;
            let was_used = is_used();
            let stopped = stop(&line);
            if !was_used {
                return stopped;
            }
            while is_used() {
                std::thread::sleep(TURN);
            }
            stop(&line)
        })
    }

    fn is_ours(&self) -> bool {
        self.process == std::process::id()
    }
}

/// One more, while it lives.
struct Counted<'a>(&'a AtomicUsize);

impl<'a> Counted<'a> {
    fn new(count: &'a AtomicUsize) -> Self {
        count.fetch_add(1, Ordering::SeqCst);
        Counted(count)
    }
}

impl Drop for Counted<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}
