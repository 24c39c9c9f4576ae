//! A bus of python-can as a port.
//!
//! The bus is Python code. In the thread that waits for an exchange it would also run signal
//! handlers, while the exchange holds the port. So one thread receives and another one sends.

use std::collections::VecDeque;
use std::io::{Error, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use motorlink::port::{CanLink, Evented, Link, PortError};
use motorlink_proto::can::CanFrame;
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::shared::Owner;
use crate::sim::Port;

/// Time after which a bus that accepts no frame makes a send fail.
const SEND_TIMEOUT: Duration = Duration::from_secs(1);
/// Longest wait in `recv`. After it the reader checks whether it has to end.
const TURN: Duration = Duration::from_millis(100);
/// Time in which a bus may return frames that it received before it was opened.
const BABBLE: Duration = Duration::from_millis(100);

/// A bus of python-can, for `motorlink.rmd.open` and `motorlink.aio.rmd.open`.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct CanPort {
    bus: Arc<PythonCan>,
}

/// A port that can be opened as a CAN bus.
#[derive(FromPyObject)]
pub(crate) enum AnyPort<'py> {
    Can(Py<CanPort>),
    Other(Port<'py>),
}

#[pymethods]
impl CanPort {
    /// `bus` receives and sends; `message` is the class of its messages.
    #[new]
    fn new(bus: Py<PyAny>, message: Py<PyAny>, name: String) -> Self {
        CanPort { bus: Arc::new(PythonCan { bus, message, name }) }
    }

    /// The name in messages.
    #[getter]
    pub(crate) fn name(&self) -> &str {
        &self.bus.name
    }

    fn __repr__(&self) -> String {
        format!("<CanPort {}>", self.bus.name)
    }
}

impl CanPort {
    /// Starts the threads that receive and send.
    pub(crate) fn start(&self) -> PyResult<Threads> {
        let (bell, ringer) = UnixStream::pair()?;
        bell.set_nonblocking(true)?;
        ringer.set_nonblocking(true)?;
        let hub = Arc::new(Hub {
            bus: Arc::clone(&self.bus),
            state: Mutex::new(State::default()),
            changed: Condvar::new(),
            bell,
            ringer,
        });
        let (reader, writer) = (Arc::clone(&hub), Arc::clone(&hub));
        let threads = [thread::spawn(move || reader.read()), thread::spawn(move || writer.write())];
        Ok(Threads { hub, threads: Mutex::new(threads.into()), owner: Owner::new() })
    }
}

/// The threads of a bus. They end soon after this is dropped.
pub(crate) struct Threads {
    hub: Arc<Hub>,
    threads: Mutex<Vec<JoinHandle<()>>>,
    owner: Owner,
}

impl Threads {
    /// What opens a link: the first one, and another one after each failure.
    pub(crate) fn links(&self) -> impl FnMut() -> PythonCanLink + Send + 'static {
        let hub = Arc::clone(&self.hub);
        move || PythonCanLink::new(Arc::clone(&hub))
    }

    /// Ends the threads and waits for their end. After it the owner may shut the bus down.
    pub(crate) fn end(&self) {
        if self.owner.is_here() {
            self.hub.end();
            let threads =
                std::mem::take(&mut *self.threads.lock().unwrap_or_else(PoisonError::into_inner));
            threads.into_iter().for_each(|thread| drop(thread.join()));
        }
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        if self.owner.is_here() {
            self.hub.end();
        }
    }
}

/// State that the threads of a bus share with its link.
struct Hub {
    bus: Arc<PythonCan>,
    state: Mutex<State>,
    changed: Condvar,
    /// Readable if something was received.
    bell: UnixStream,
    ringer: UnixStream,
}

#[derive(Default)]
struct State {
    /// Number of the link in use. Failures of earlier links are ignored.
    link: u64,
    reader: Reader,
    inbox: VecDeque<Result<CanFrame, PortError>>,
    outbox: VecDeque<CanFrame>,
    is_ended: bool,
}

/// State of the receiving thread.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
enum Reader {
    /// The bus failed. It is idle until the next frame is sent.
    #[default]
    Paused,
    /// Drops what the bus received before. Nothing is sent meanwhile.
    Draining,
    Receiving,
}

impl Hub {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(
        &self,
        state: MutexGuard<'a, State>,
        until: impl Fn(&State) -> bool,
    ) -> MutexGuard<'a, State> {
        let waited = self.changed.wait_while(state, |state| !state.is_ended && !until(state));
        waited.unwrap_or_else(PoisonError::into_inner)
    }

    fn end(&self) {
        self.lock().is_ended = true;
        self.changed.notify_all();
    }

    /// Receives until the end.
    fn read(&self) {
        loop {
            let state = self.wait(self.lock(), |state| state.reader != Reader::Paused);
            let (link, drains) = (state.link, state.reader == Reader::Draining);
            if state.is_ended {
                return;
            }
            drop(state);
            let came = if drains { self.drain() } else { self.bus.receive(TURN) };
            let mut state = self.lock();
            match came {
                Ok(None) if drains => state.reader = Reader::Receiving,
                Ok(None) => continue,
                Err(_) if drains => state.reader = Reader::Paused,
                Err(_) if link != state.link => continue,
                came => {
                    if came.is_err() {
                        state.reader = Reader::Paused;
                    }
                    state.inbox.extend(came.transpose());
                }
            }
            self.ring();
        }
    }

    /// Drops what the bus received before.
    fn drain(&self) -> Result<Option<CanFrame>, PortError> {
        let began = Instant::now();
        while began.elapsed() < BABBLE && self.bus.receive(Duration::ZERO)?.is_some() {}
        Ok(None)
    }

    /// Sends until the end.
    fn write(&self) {
        loop {
            let ready =
                |state: &State| !state.outbox.is_empty() && state.reader != Reader::Draining;
            let mut state = self.wait(self.lock(), ready);
            if state.is_ended {
                return;
            }
            let (link, frame) = (state.link, state.outbox.pop_front());
            state.reader = Reader::Receiving;
            drop(state);
            self.changed.notify_all();
            let Some(Err(error)) = frame.map(|frame| self.bus.send(&frame)) else { continue };
            let mut state = self.lock();
            if link == state.link {
                state.inbox.push_back(Err(error));
                self.ring();
            }
        }
    }

    fn ring(&self) {
        // If the pipe is full, the reader is woken up already.
        let _ = (&self.ringer).write(&[0]);
        self.changed.notify_all();
    }
}

struct PythonCan {
    bus: Py<PyAny>,
    message: Py<PyAny>,
    name: String,
}

impl PythonCan {
    fn send(&self, frame: &CanFrame) -> Result<(), PortError> {
        let sent = Python::attach(|py| -> PyResult<()> {
            let fields = PyDict::new(py);
            fields.set_item(intern!(py, "arbitration_id"), frame.id())?;
            fields.set_item(intern!(py, "is_extended_id"), frame.is_extended())?;
            fields.set_item(intern!(py, "is_remote_frame"), frame.is_remote())?;
            fields.set_item(intern!(py, "dlc"), frame.len())?;
            if !frame.is_remote() {
                fields.set_item(intern!(py, "data"), PyBytes::new(py, frame.data()))?;
            }
            let message = self.message.bind(py).call((), Some(&fields))?;
            let send = intern!(py, "send");
            self.bus.bind(py).call_method1(send, (message, SEND_TIMEOUT.as_secs_f64()))?;
            Ok(())
        });
        sent.map_err(|error| self.failed(error))
    }

    /// The next frame, if one arrives in time.
    fn receive(&self, timeout: Duration) -> Result<Option<CanFrame>, PortError> {
        let came = Python::attach(|py| {
            let recv = intern!(py, "recv");
            let message = self.bus.bind(py).call_method1(recv, (timeout.as_secs_f64(),))?;
            if message.is_none() { Ok(None) } else { frame(&message) }
        });
        came.map_err(|error| self.failed(error))
    }

    fn failed(&self, error: PyErr) -> PortError {
        PortError::Io { port: self.name.clone(), source: Error::other(error).into() }
    }
}

/// The frame of a message of python-can. `None` for frames that this bus sent itself, for errors of
/// the controller, and for CAN FD.
fn frame(message: &Bound<'_, PyAny>) -> PyResult<Option<CanFrame>> {
    let py = message.py();
    let is = |name| message.getattr(name)?.is_truthy();
    let foreign = is(intern!(py, "is_rx"))?
        && !is(intern!(py, "is_error_frame"))?
        && !is(intern!(py, "is_fd"))?;
    if !foreign {
        return Ok(None);
    }
    let id = message.getattr(intern!(py, "arbitration_id"))?.extract()?;
    let extended = is(intern!(py, "is_extended_id"))?;
    if is(intern!(py, "is_remote_frame"))? {
        let length = message.getattr(intern!(py, "dlc"))?.extract()?;
        return Ok(Some(CanFrame::remote_frame(id, extended, length)));
    }
    let data: Vec<u8> = message.getattr(intern!(py, "data"))?.extract()?;
    Ok(Some(CanFrame::data_frame(id, extended, &data)))
}

/// A bus in use, until it fails.
pub(crate) struct PythonCanLink(Arc<Hub>);

impl PythonCanLink {
    fn new(hub: Arc<Hub>) -> Self {
        let mut state = hub.lock();
        state.link += 1;
        state.inbox.clear();
        state.outbox.clear();
        if state.reader == Reader::Paused {
            state.reader = Reader::Draining;
            hub.changed.notify_all();
        }
        drop(state);
        PythonCanLink(hub)
    }
}

impl Link for PythonCanLink {}

impl CanLink for PythonCanLink {
    /// A failure to send is returned by the next receive.
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.0.lock().outbox.push_back(*frame);
        self.0.changed.notify_all();
        Ok(())
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        let hub = &self.0;
        let end = timeout.and_then(|timeout| Instant::now().checked_add(timeout));
        let mut state = hub.lock();
        loop {
            if let Some(came) = state.inbox.pop_front() {
                return came.map(Some);
            }
            if state.is_ended {
                return Err(PortError::Closed(hub.bus.name.clone()));
            }
            // From now on each received frame wakes the reader.
            while (&hub.bell).read(&mut [0; 64]).is_ok_and(|size| size == 64) {}
            let left = end.map(|end| end.saturating_duration_since(Instant::now()));
            if left == Some(Duration::ZERO) {
                return Ok(None);
            }
            let waited = hub.changed.wait_timeout(state, left.unwrap_or(TURN));
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

impl Evented for PythonCanLink {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        Some(self.0.bell.as_fd())
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        Ok(false)
    }
}
