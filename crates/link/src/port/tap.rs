//! Taps: observers of a port's traffic.

use std::os::fd::BorrowedFd;
use std::time::Duration;

use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;

use super::error::PortError;
use super::event::Evented;
use super::link::{ByteLink, CanLink, Link};
use crate::clock::Clock;
use crate::direction::Direction;

/// Passes every chunk of a byte line, or every frame of a CAN bus, to an observer.
///
/// The observer gets the direction, the time since the tap was made, and the bytes or the frame. What
/// is sent is passed after the port accepted it.
#[derive(Debug)]
pub struct Tap<L, F> {
    link: L,
    observer: F,
    time: Stopwatch,
}

impl<B: ByteLink, F: FnMut(Direction, Duration, &[u8]) + Send> Tap<B, F> {
    /// Wraps a byte line.
    pub fn bytes(link: B, observer: F) -> Self {
        Tap { time: Stopwatch::on(&link), link, observer }
    }

    /// Wraps a byte line, which has this clock from now on. Times are those since the clock's 0.
    pub fn bytes_by(clock: Clock, link: B, observer: F) -> Self {
        Tap { time: Stopwatch(clock, Instant(0)), link, observer }
    }
}

impl<C: CanLink, F: FnMut(Direction, Duration, &CanFrame) + Send> Tap<C, F> {
    /// Wraps a CAN bus.
    pub fn frames(link: C, observer: F) -> Self {
        Tap { time: Stopwatch::on(&link), link, observer }
    }

    /// Wraps a CAN bus, which has this clock from now on. Times are those since the clock's 0.
    pub fn frames_by(clock: Clock, link: C, observer: F) -> Self {
        Tap { time: Stopwatch(clock, Instant(0)), link, observer }
    }
}

impl<L: Link, F: Send> Link for Tap<L, F> {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.link)
    }

    fn clock(&self) -> Option<Clock> {
        Some(self.time.0.clone())
    }
}

impl<B: ByteLink, F: FnMut(Direction, Duration, &[u8]) + Send> ByteLink for Tap<B, F> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        let at = self.time.elapsed();
        self.link.write(bytes)?;
        (self.observer)(Direction::Sent, at, bytes);
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        let len = self.link.read(buffer, timeout)?;
        if len > 0 {
            (self.observer)(Direction::Received, self.time.elapsed(), &buffer[..len]);
        }
        Ok(len)
    }
}

impl<C: CanLink, F: FnMut(Direction, Duration, &CanFrame) + Send> CanLink for Tap<C, F> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        let at = self.time.elapsed();
        self.link.send(frame)?;
        (self.observer)(Direction::Sent, at, frame);
        Ok(())
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        let frame = self.link.receive(timeout)?;
        if let Some(frame) = &frame {
            (self.observer)(Direction::Received, self.time.elapsed(), frame);
        }
        Ok(frame)
    }
}

impl<L: Evented, F> Evented for Tap<L, F> {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.link.descriptor()
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        self.link.flush()
    }

    fn discard(&mut self) -> Result<(), PortError> {
        self.link.discard()
    }
}

/// Time since a tap was made.
#[derive(Debug)]
struct Stopwatch(Clock, Instant);

impl Stopwatch {
    fn on(link: &impl Link) -> Self {
        let clock = link.clock().unwrap_or_default();
        let now = clock.now();
        Stopwatch(clock, now)
    }

    fn elapsed(&self) -> Duration {
        self.0.now().since(self.1).into()
    }
}
