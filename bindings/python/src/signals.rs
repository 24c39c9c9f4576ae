//! Waits that Ctrl-C ends: a port that looks for signals while nothing comes.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use motorlink::Clock;
use motorlink::port::{ByteLink, CanLink, PortError};
use motorlink_proto::rmd::CanFrame;
use pyo3::prelude::*;

/// How often signals are looked for.
pub(crate) const LOOK: Duration = Duration::from_millis(50);

/// Whether the waits of a port are deaf to signals.
#[derive(Clone, Default)]
pub(crate) struct Deafness(Arc<AtomicBool>);

impl Deafness {
    /// Does what no signal may keep from being done. Signals are obeyed afterwards.
    pub(crate) fn during<T>(&self, act: impl FnOnce() -> T) -> T {
        self.0.store(true, Ordering::Relaxed);
        let done = act();
        self.0.store(false, Ordering::Relaxed);
        done
    }

    /// Around a port.
    pub(crate) fn around<L>(&self, link: L) -> Attentive<L> {
        Attentive { link, deaf: self.clone() }
    }
}

/// A link whose waits end with the exception that a signal's handler raises.
pub(crate) struct Attentive<L> {
    link: L,
    deaf: Deafness,
}

impl<L> Attentive<L> {
    fn wait<T: PartialEq>(
        &mut self,
        timeout: Option<Duration>,
        nothing: T,
        mut receive: impl FnMut(&mut L, Option<Duration>) -> Result<T, PortError>,
    ) -> Result<T, PortError> {
        let mut left = timeout.unwrap_or(Duration::MAX);
        while left > LOOK {
            let came = receive(&mut self.link, Some(LOOK))?;
            if came != nothing {
                return Ok(came);
            }
            if !self.deaf.0.load(Ordering::Relaxed) {
                Python::attach(|py| py.check_signals()).map_err(interruption)?;
            }
            left -= LOOK;
        }
        receive(&mut self.link, Some(left))
    }
}

fn interruption(raised: PyErr) -> PortError {
    let source = io::Error::new(io::ErrorKind::Interrupted, raised);
    PortError::Io { port: "the wait".to_owned(), source }
}

impl<L: ByteLink> ByteLink for Attentive<L> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.link.write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        self.wait(timeout, 0, |link, timeout| link.read(buffer, timeout))
    }

    fn clock(&self) -> Option<Clock> {
        self.link.clock()
    }
}

impl<L: CanLink> CanLink for Attentive<L> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.link.send(frame)
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        self.wait(timeout, None, |link, timeout| link.receive(timeout))
    }

    fn clock(&self) -> Option<Clock> {
        self.link.clock()
    }
}
