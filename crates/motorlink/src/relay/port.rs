//! The port that a relay holds.

use std::os::fd::BorrowedFd;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use motorlink_link::port::{ByteLink, CanLink, Evented, Link, PortError, PortName};
use motorlink_link::reopening::{BackOff, FULL, Opener, Reopening};
use motorlink_link::serve::Server;
use motorlink_proto::can::CanFrame;

/// The longest turn while the port is closed and tried again and again.
const REOPEN_PERIOD: Duration = Duration::from_millis(50);

/// A port that is opened again when it went away. Several hold it, one uses it at a time.
pub(super) struct Port<L>(Arc<Mutex<Reopening<L>>>);

impl<L> Clone for Port<L> {
    fn clone(&self) -> Self {
        Port(Arc::clone(&self.0))
    }
}

impl<L: Link + Evented + 'static> Port<L> {
    pub(super) fn open(name: &PortName, open: Opener<L>) -> Result<Self, PortError> {
        let back_off = BackOff { cap: Duration::from_millis(500), ..BackOff::default() };
        Ok(Port(Arc::new(Mutex::new(Reopening::open(&name.to_string(), open, back_off)?))))
    }

    /// A turn of the server that ends when the port has something as well; whether the port is open.
    pub(super) fn turn(&self, server: &mut Server, most: Duration) -> Result<bool, PortError> {
        let mut port = self.lock();
        let descriptor = port.link().ok().map(|(link, _)| link.descriptor());
        let is_open = descriptor.is_some();
        let most = if is_open { most } else { most.min(REOPEN_PERIOD) };
        let descriptor: Option<BorrowedFd<'_>> = descriptor.flatten();
        server.turn(most, descriptor)?;
        Ok(is_open)
    }

    /// Does something with the link, which is closed when that fails.
    pub(super) fn with<T>(
        &self,
        act: impl FnOnce(&mut L) -> Result<T, PortError>,
    ) -> Result<T, PortError> {
        let mut port = self.lock();
        let done = port.link().and_then(|(link, _)| act(link));
        if done.is_err() {
            port.close();
        }
        done
    }

    /// As [`with`](Self::with), for what has to leave before anything else is done.
    fn put(&self, act: impl FnOnce(&mut L) -> Result<(), PortError>) -> Result<(), PortError> {
        self.with(|link| {
            act(link)?;
            while link.flush()? {
                std::thread::sleep(FULL);
            }
            Ok(())
        })
    }

    pub(super) fn name(&self) -> String {
        self.lock().name.to_string()
    }

    /// Why nothing can be sent.
    pub(super) fn closed(&self) -> PortError {
        PortError::Closed(self.name())
    }

    /// What opens this port for a client, while it is open itself.
    pub(super) fn opener<T: ?Sized + 'static>(&self, form: fn(Self) -> Box<T>) -> Opener<Box<T>>
    where
        L: Send,
    {
        let port = self.clone();
        Box::new(move || {
            let is_open = port.lock().link().is_ok();
            if is_open { Ok(form(port.clone())) } else { Err(port.closed()) }
        })
    }

    fn lock(&self) -> MutexGuard<'_, Reopening<L>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<L: Link> Link for Port<L> {}

impl<L: ByteLink + Evented + 'static> ByteLink for Port<L> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.put(|link| link.write(bytes))
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        self.with(|link| link.read(buffer, timeout))
    }
}

impl<L: CanLink + Evented + 'static> CanLink for Port<L> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.put(|link| link.send(frame))
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        self.with(|link| link.receive(timeout))
    }
}
