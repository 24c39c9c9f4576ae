//! Links with a time limit: a host that would wait without end gets an error.
#![allow(dead_code, reason = "a host has a line or a bus")]

use motorlink::Clock;
use motorlink::port::{ByteLink, CanLink, PortError};
use motorlink_link::serve::{Station, StationLink};
use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;

/// More time than any correct host needs for a scenario.
const END: Instant = Instant(60_000_000);

/// A link to a station on virtual time.
pub struct Finite<S, T> {
    link: StationLink<S, T>,
    clock: Clock,
}

impl<S, T> Finite<S, T> {
    pub fn new(station: S) -> Self {
        let clock = Clock::virtual_time();
        Finite { link: StationLink::new(station, clock.clone()), clock }
    }

    pub fn now(&self) -> Instant {
        self.clock.now()
    }

    fn alive(&self) -> Result<(), PortError> {
        match self.now() < END {
            true => Ok(()),
            false => Err(PortError::Closed("a minute is over".to_owned())),
        }
    }

    fn left(&self, until: Instant) -> Option<std::time::Duration> {
        Some(until.min(END).since(self.now()).into())
    }
}

impl<S: Station<u8> + Send> Finite<S, u8> {
    pub fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.alive()?;
        self.link.write(bytes)
    }

    /// The bytes received until a moment.
    pub fn receive(&mut self, until: Instant) -> Result<Vec<u8>, PortError> {
        let mut buffer = [0; 1024];
        let wait = self.left(until);
        let size = self.link.read(&mut buffer, wait)?;
        self.alive()?;
        Ok(buffer[..size].to_vec())
    }
}

impl<S: Station<CanFrame> + Send> Finite<S, CanFrame> {
    pub fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.alive()?;
        CanLink::send(&mut self.link, frame)
    }

    /// The next frame received until a moment.
    pub fn receive(&mut self, until: Instant) -> Result<Option<CanFrame>, PortError> {
        let wait = self.left(until);
        let received = CanLink::receive(&mut self.link, wait)?;
        self.alive()?;
        Ok(received)
    }
}
