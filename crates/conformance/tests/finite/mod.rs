//! A wire whose time runs out: a host that would wait for ever gets an error.

use motorlink::port::PortError;
use motorlink_conformance::wire::{Bus, Line};
use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;

/// Longer than any correct host takes for a scenario.
const END: Instant = Instant(60_000_000);

pub struct Finite<W>(W);

impl<W> Finite<W> {
    pub fn new(wire: W) -> Self {
        Finite(wire)
    }
}

fn alive(now: Instant) -> Result<(), PortError> {
    if now < END { Ok(()) } else { Err(PortError::Closed { port: "a minute is over".to_owned() }) }
}

impl<W: Line> Line for Finite<W> {
    fn now(&self) -> Instant {
        self.0.now()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        alive(self.0.now())?;
        self.0.send(bytes)
    }

    fn receive(&mut self, until: Instant) -> Result<Vec<u8>, PortError> {
        let received = self.0.receive(until.min(END))?;
        alive(self.0.now())?;
        Ok(received)
    }
}

impl<W: Bus> Bus for Finite<W> {
    fn now(&self) -> Instant {
        self.0.now()
    }

    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        alive(self.0.now())?;
        self.0.send(frame)
    }

    fn receive(&mut self, until: Instant) -> Result<Option<CanFrame>, PortError> {
        let received = self.0.receive(until.min(END))?;
        alive(self.0.now())?;
        Ok(received)
    }
}
