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

/// Passes every chunk of a byte line to an observer.
///
/// The observer gets the direction, the time since the tap was made, and the bytes. Sent bytes are
/// passed after the port accepted them.
#[derive(Debug)]
pub struct TapBytes<B, F> {
    link: B,
    observer: F,
    time: Stopwatch,
}

/// Passes every frame of a CAN port to an observer, like [`TapBytes`] for bytes.
#[derive(Debug)]
pub struct TapCan<C, F> {
    link: C,
    observer: F,
    time: Stopwatch,
}

impl<B: ByteLink, F: FnMut(Direction, Duration, &[u8]) + Send> TapBytes<B, F> {
    /// Wraps `link`.
    pub fn new(link: B, observer: F) -> Self {
        TapBytes { time: Stopwatch::on(link.clock().unwrap_or_default()), link, observer }
    }

    /// Wraps `link`, which has this clock from now on. Times are those since the clock's 0.
    pub fn by(clock: Clock, link: B, observer: F) -> Self {
        TapBytes { time: Stopwatch(clock, Instant(0)), link, observer }
    }
}

impl<C: CanLink, F: FnMut(Direction, Duration, &CanFrame) + Send> TapCan<C, F> {
    /// Wraps `link`.
    pub fn new(link: C, observer: F) -> Self {
        TapCan { time: Stopwatch::on(link.clock().unwrap_or_default()), link, observer }
    }

    /// Wraps `link`, which has this clock from now on. Times are those since the clock's 0.
    pub fn by(clock: Clock, link: C, observer: F) -> Self {
        TapCan { time: Stopwatch(clock, Instant(0)), link, observer }
    }
}

impl<B: ByteLink, F: FnMut(Direction, Duration, &[u8]) + Send> Link for TapBytes<B, F> {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.link)
    }

    fn clock(&self) -> Option<Clock> {
        Some(self.time.0.clone())
    }
}

impl<B: ByteLink, F: FnMut(Direction, Duration, &[u8]) + Send> ByteLink for TapBytes<B, F> {
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

impl<C: CanLink, F: FnMut(Direction, Duration, &CanFrame) + Send> Link for TapCan<C, F> {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.link)
    }

    fn clock(&self) -> Option<Clock> {
        Some(self.time.0.clone())
    }
}

impl<C: CanLink, F: FnMut(Direction, Duration, &CanFrame) + Send> CanLink for TapCan<C, F> {
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

impl<B: Evented, F> Evented for TapBytes<B, F> {
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

impl<C: Evented, F> Evented for TapCan<C, F> {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.link.descriptor()
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        self.link.flush()
    }
}

/// Time since a tap was made.
#[derive(Debug)]
struct Stopwatch(Clock, Instant);

impl Stopwatch {
    fn on(clock: Clock) -> Self {
        let now = clock.now();
        Stopwatch(clock, now)
    }

    fn elapsed(&self) -> Duration {
        self.0.now().since(self.1).into()
    }
}
