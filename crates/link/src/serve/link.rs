//! Links to stations in this process.

use std::os::fd::BorrowedFd;
use std::time::Duration;

use motorlink_proto::can::CanFrame;

use super::station::{Station, Traffic};
use crate::Clock;
use crate::port::{ByteLink, CanLink, Evented, Link, PortError};

/// The link to a station in this process, without a port. Bytes (`T` is `u8`) and frames (`T` is
/// [`CanFrame`]) have no transmission time. Waits poll the station.
#[derive(Debug)]
pub struct StationLink<S, T> {
    station: S,
    clock: Clock,
    /// Received data that were not read yet.
    received: Vec<T>,
}

impl<S, T> StationLink<S, T> {
    /// A link to `station` on `clock`.
    pub fn new(station: S, clock: Clock) -> Self {
        StationLink { station, clock, received: Vec::with_capacity(256) }
    }
}

impl<S: Station<T>, T: Traffic> StationLink<S, T> {
    /// Waits until the station has sent something.
    fn wait(&mut self, timeout: Option<Duration>) {
        let end = self.clock.end_of(timeout);
        loop {
            let (now, due) = (self.clock.now(), self.station.deadline());
            if due.is_some_and(|due| due <= now) {
                self.station.poll(now, &mut self.received);
            }
            if !self.received.is_empty() || end.is_some_and(|end| end <= now) {
                return;
            }
            match self.station.deadline().into_iter().chain(end).min() {
                Some(next) => self.clock.wait(next),
                None => std::thread::park(),
            }
        }
    }
}

impl<S: Send, T: Send> Link for StationLink<S, T> {
    fn clock(&self) -> Option<Clock> {
        Some(self.clock.clone())
    }

    fn is_fresh(&self) -> bool {
        true
    }
}

impl<S: Station<u8> + Send> ByteLink for StationLink<S, u8> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.station.receive(self.clock.now(), bytes, &mut self.received);
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        self.wait(timeout);
        let size = buffer.len().min(self.received.len());
        buffer[..size].copy_from_slice(&self.received[..size]);
        self.received.drain(..size);
        Ok(size)
    }
}

impl<S: Station<CanFrame> + Send> CanLink for StationLink<S, CanFrame> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.station.receive(self.clock.now(), &[*frame], &mut self.received);
        Ok(())
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        self.wait(timeout);
        Ok((!self.received.is_empty()).then(|| self.received.remove(0)))
    }
}

/// The station answers at once, so an event loop needs no descriptor.
impl<S: Send, T: Send> Evented for StationLink<S, T> {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        Ok(false)
    }
}
