//! A bus of python-can as a port.

use std::io::{Error, Read, Write};
use std::os::fd::{AsFd, BorrowedFd};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use motorlink::port::{CanLink, EventCan, Evented, PortError};
use motorlink_proto::rmd::CanFrame;
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::sim::Port;

/// How long a bus may take no frame at all before a sending fails.
const SEND_TIMEOUT: Duration = Duration::from_secs(1);
/// How soon the reader of a bus notices that nobody listens any more, and how long a wait keeps
/// Python's signals waiting.
const TURN: Duration = Duration::from_millis(100);

/// A bus of python-can, for `motorlink.rmd.open` and `motorlink.aio.rmd.open`.
#[pyclass(frozen, module = "motorlink._core")]
pub(crate) struct CanPort {
    bus: Arc<PythonCan>,
}

/// What is opened as a CAN bus.
#[derive(FromPyObject)]
pub(crate) enum AnyPort<'py> {
    Can(Py<CanPort>),
    Other(Port<'py>),
}

#[pymethods]
impl CanPort {
    /// `bus`: what receives and sends; `message`: the class of its messages.
    #[new]
    fn new(bus: Py<PyAny>, message: Py<PyAny>, name: String) -> Self {
        CanPort { bus: Arc::new(PythonCan { bus, message, name }) }
    }

    /// What messages call it.
    #[getter]
    pub(crate) fn name(&self) -> &str {
        &self.bus.name
    }

    fn __repr__(&self) -> String {
        format!("<CanPort {}>", self.bus.name)
    }
}

impl CanPort {
    /// For a client that waits.
    pub(crate) fn link(&self) -> Box<dyn CanLink> {
        Box::new(Link(Arc::clone(&self.bus)))
    }

    /// For an event loop: a thread receives. It ends soon after the link was dropped.
    pub(crate) fn event_link(&self) -> PyResult<(Box<dyn EventCan>, JoinHandle<()>)> {
        let (bell, ringer) = UnixStream::pair()?;
        bell.set_nonblocking(true)?;
        ringer.set_nonblocking(true)?;
        let (inbox, frames) = channel();
        let is_dropped = Arc::new(AtomicBool::new(false));
        let (bus, ends) = (Arc::clone(&self.bus), Arc::clone(&is_dropped));
        let thread = std::thread::spawn(move || {
            while !ends.load(Ordering::Relaxed) {
                let Some(came) = bus.receive(TURN).transpose() else { continue };
                let failed = came.is_err();
                if inbox.send(came).is_err() {
                    return;
                }
                // A bell that takes no more rings already.
                let _ = (&ringer).write(&[0]);
                if failed {
                    return;
                }
            }
        });
        let bus = Arc::clone(&self.bus);
        Ok((Box::new(Pump { bus, frames, bell, is_dropped }), thread))
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

    /// The next frame, if one comes in time.
    fn receive(&self, timeout: Duration) -> Result<Option<CanFrame>, PortError> {
        let came = Python::attach(|py| {
            let recv = intern!(py, "recv");
            let message = self.bus.bind(py).call_method1(recv, (timeout.as_secs_f64(),))?;
            if message.is_none() { Ok(None) } else { frame(&message) }
        });
        came.map_err(|error| self.failed(error))
    }

    fn failed(&self, error: PyErr) -> PortError {
        PortError::Io { port: self.name.clone(), source: Error::other(error) }
    }
}

/// A message of python-can; nothing where it is no frame of another node: what this bus sent itself,
/// an error of the controller, CAN FD.
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

/// Waits in the bus itself.
struct Link(Arc<PythonCan>);

impl CanLink for Link {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.0.send(frame)
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        let deadline = timeout.and_then(|timeout| Instant::now().checked_add(timeout));
        loop {
            let left = deadline.map(|end| end.saturating_duration_since(Instant::now()));
            let came = self.0.receive(left.map_or(TURN, |left| left.min(TURN)))?;
            if came.is_some() || left == Some(Duration::ZERO) {
                return Ok(came);
            }
        }
    }
}

/// Takes what a thread received.
struct Pump {
    bus: Arc<PythonCan>,
    frames: Receiver<Result<CanFrame, PortError>>,
    /// Readable when there are frames.
    bell: UnixStream,
    is_dropped: Arc<AtomicBool>,
}

impl Pump {
    fn gone(&self) -> PortError {
        PortError::Closed { port: self.bus.name.clone() }
    }
}

impl CanLink for Pump {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.bus.send(frame)
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        if let Ok(came) = self.frames.try_recv() {
            return came.map(Some);
        }
        // Silenced before it is looked again, so that it rings for whatever comes after.
        while (&self.bell).read(&mut [0; 64]).is_ok_and(|size| size == 64) {}
        let came = match timeout {
            Some(Duration::ZERO) => match self.frames.try_recv() {
                Err(TryRecvError::Empty) => return Ok(None),
                came => came.map_err(|_| self.gone()),
            },
            timeout => match self.frames.recv_timeout(timeout.unwrap_or(Duration::MAX)) {
                Err(RecvTimeoutError::Timeout) => return Ok(None),
                came => came.map_err(|_| self.gone()),
            },
        };
        came?.map(Some)
    }
}

impl Evented for Pump {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        Some(self.bell.as_fd())
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        Ok(false)
    }
}

impl Drop for Pump {
    fn drop(&mut self) {
        self.is_dropped.store(true, Ordering::Relaxed);
    }
}
