//! A bus that threads share, until one of them closes it.

use std::sync::{Arc, Mutex, PoisonError, RwLock};
use std::thread::{self, ThreadId};
use std::time::Duration;

use motorlink::port::Ending;
use pyo3::prelude::*;

use crate::error::{closed, elsewhere};

/// Time until a close notices that the last exchange is complete.
const TURN: Duration = Duration::from_millis(1);

/// The process that opened the bus. A forked process has a copy of its parent's memory and none of
/// its other threads: a lock that such a thread held is never released.
pub(crate) struct Owner(u32);

impl Owner {
    /// This process.
    pub(crate) fn new() -> Self {
        Owner(std::process::id())
    }

    /// Whether this is that process.
    pub(crate) fn is_here(&self) -> bool {
        self.0 == std::process::id()
    }
}

/// A client and its owner.
pub(crate) struct Shared<T> {
    line: RwLock<ClientState<T>>,
    /// Threads with exchanges that may start a motor.
    under_way: UnderWay,
    port: String,
    owner: Owner,
}

enum ClientState<T> {
    Open(Arc<T>),
    /// Motors are being stopped.
    Closing(Arc<T>),
    Closed,
}

impl<T: Send + Sync> Shared<T> {
    pub(crate) fn new(line: T, port: String) -> Self {
        let line = RwLock::new(ClientState::Open(Arc::new(line)));
        Shared { line, under_way: UnderWay::default(), port, owner: Owner::new() }
    }

    /// The port's name.
    pub(crate) fn port(&self) -> &str {
        &self.port
    }

    /// One exchange, while other Python threads run. An error after the close.
    pub(crate) fn exchange<R: Send>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(&T) -> R + Send,
    ) -> PyResult<R> {
        // Counted before the check: a close has closed the client by now, or waits for this thread.
        let _entered = self.under_way.enter();
        let line = self.get(py)?;
        Ok(py.detach(|| act(&line)))
    }

    /// The client, for calls that start no motor. An error after the close.
    pub(crate) fn get(&self, py: Python<'_>) -> PyResult<Arc<T>> {
        if !self.owner.is_here() {
            return Err(elsewhere(py, &self.port));
        }
        // Unlocked before the exception is created, because signal handlers can run there.
        let line = match &*self.line.read().unwrap_or_else(PoisonError::into_inner) {
            ClientState::Open(line) => Some(Arc::clone(line)),
            ClientState::Closing(_) | ClientState::Closed => None,
        };
        line.ok_or_else(|| closed(py, &self.port))
    }

    /// One exchange of a thread that is not Python's. `None` after the close: nothing is done.
    pub(crate) fn lend<R>(&self, act: impl FnOnce(&T) -> R) -> Option<R> {
        let _entered = self.under_way.enter();
        let line = match &*self.line.read().unwrap_or_else(PoisonError::into_inner) {
            ClientState::Open(line) => Arc::clone(line),
            ClientState::Closing(_) | ClientState::Closed => return None,
        };
        Some(act(&line))
    }

    /// Whether it is closed.
    pub(crate) fn is_closed(&self) -> bool {
        !matches!(*self.line.read().unwrap_or_else(PoisonError::into_inner), ClientState::Open(_))
    }

    /// Closes the client. `stop` stops the motors at once, and again after the exchanges of other
    /// threads, which may have started one. If this thread has an exchange under way, this is a
    /// signal handler, and `stop` must abandon that exchange. Returns the result of the last
    /// `stop`.
    ///
    /// If another thread closes it at the same time, both stop the motors. After the close, and in
    /// a process that did not open it, this does nothing.
    pub(crate) fn close<R: Send>(
        &self,
        py: Python<'_>,
        stop: impl Fn(&T) -> Vec<R> + Send + Sync,
    ) -> Vec<R> {
        if !self.owner.is_here() {
            return Vec::new();
        }
        py.detach(|| {
            let Some(line) = self.closing() else { return Vec::new() };
            let was_used = self.under_way.elsewhere();
            let mut stopped = stop(&line);
            if was_used {
                while self.under_way.elsewhere() {
                    thread::sleep(TURN);
                }
                stopped = stop(&line);
            }
            *self.line.write().unwrap_or_else(PoisonError::into_inner) = ClientState::Closed;
            stopped
        })
    }

    /// The client, for the thread that closes it.
    fn closing(&self) -> Option<Arc<T>> {
        let mut state = self.line.write().unwrap_or_else(PoisonError::into_inner);
        let (ClientState::Open(line) | ClientState::Closing(line)) = &*state else { return None };
        let line = Arc::clone(line);
        *state = ClientState::Closing(Arc::clone(&line));
        Some(line)
    }
}

/// The threads with exchanges, one entry for each exchange.
#[derive(Default)]
struct UnderWay(Mutex<Vec<ThreadId>>);

impl UnderWay {
    /// This thread has an exchange until the result is dropped.
    fn enter(&self) -> Entered<'_> {
        self.with(|threads| threads.push(thread::current().id()));
        Entered(self)
    }

    /// Whether another thread has one.
    fn elsewhere(&self) -> bool {
        let here = thread::current().id();
        self.with(|threads| threads.iter().any(|thread| *thread != here))
    }

    fn with<T>(&self, act: impl FnOnce(&mut Vec<ThreadId>) -> T) -> T {
        act(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

struct Entered<'a>(&'a UnderWay);

impl Drop for Entered<'_> {
    fn drop(&mut self) {
        let here = thread::current().id();
        self.0.with(|threads| {
            let place = threads.iter().position(|thread| *thread == here);
            place.map(|place| threads.swap_remove(place));
        });
    }
}

/// What a program that holds the port does when a client leaves: the arguments of `close`.
pub(crate) fn ending(stop: bool, off: bool) -> Ending {
    match (stop, off) {
        (false, _) => Ending::Nothing,
        (true, true) => Ending::Off,
        (true, false) => Ending::Stop,
    }
}
