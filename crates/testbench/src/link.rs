//! Links to drives inside the process.

use std::collections::VecDeque;
use std::os::fd::BorrowedFd;
use std::time::Duration;

use motorlink_link::Clock;
use motorlink_link::port::{ByteLink, CanLink, Evented, PortError};
use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;

use super::config::Station;
use super::drives::Stage;

/// The line of an ST drive. Bytes take no time on it.
pub(super) struct SimLine {
    stage: Stage,
    clock: Clock,
    received: VecDeque<u8>,
}

impl SimLine {
    pub(super) fn new(stage: Stage, clock: Clock) -> Self {
        SimLine { stage, clock, received: VecDeque::with_capacity(256) }
    }
}

impl ByteLink for SimLine {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        let now = self.clock.now();
        if let Some(station) = &mut self.stage.at(now).drives.st {
            station.receive(now, bytes, |reply| self.received.extend(reply));
        }
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        if self.received.is_empty() {
            let deadline = self.stage.last().drives.st.as_ref().and_then(Station::deadline);
            wait(&self.clock, deadline, timeout);
            let now = self.clock.now();
            if let Some(station) = &mut self.stage.at(now).drives.st {
                station.poll(now, |reply| self.received.extend(reply));
            }
        }
        let size = buffer.len().min(self.received.len());
        for (slot, byte) in buffer.iter_mut().zip(self.received.drain(..size)) {
            *slot = byte;
        }
        Ok(size)
    }

    fn clock(&self) -> Option<Clock> {
        Some(self.clock.clone())
    }

    fn is_fresh(&self) -> bool {
        true
    }
}

impl Evented for SimLine {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        Ok(false)
    }
}

/// The bus of RMD motors. Frames take no time on it.
pub(super) struct SimCan {
    stage: Stage,
    clock: Clock,
    received: VecDeque<CanFrame>,
}

impl SimCan {
    pub(super) fn new(stage: Stage, clock: Clock) -> Self {
        SimCan { stage, clock, received: VecDeque::with_capacity(64) }
    }
}

impl CanLink for SimCan {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        let now = self.clock.now();
        if let Some(bus) = &mut self.stage.at(now).drives.rmd {
            bus.receive(now, frame, |reply| self.received.push_back(reply));
        }
        Ok(())
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        if self.received.is_empty() {
            wait(&self.clock, None, timeout);
        }
        Ok(self.received.pop_front())
    }

    fn clock(&self) -> Option<Clock> {
        Some(self.clock.clone())
    }

    fn is_fresh(&self) -> bool {
        true
    }
}

/// Waits until `due`, or as long as `timeout` allows.
fn wait(clock: &Clock, due: Option<Instant>, timeout: Option<Duration>) {
    let end = timeout.map(|timeout| clock.now() + timeout.into());
    match due.into_iter().chain(end).min() {
        Some(end) => clock.wait(end),
        None => std::thread::park(),
    }
}

impl Evented for SimCan {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        None
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        Ok(false)
    }
}
