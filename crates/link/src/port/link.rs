//! The two kinds of links.

use std::time::Duration;

use motorlink_proto::can::CanFrame;

use super::error::PortError;
use crate::clock::Clock;

/// A line that carries bytes both ways.
pub trait ByteLink: Send {
    /// Writes all of `bytes`, with one system call where the kernel takes them at once.
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError>;

    /// Reads what is there, waiting at most `timeout` (`None`: without limit) for the first byte.
    /// `Ok(0)` means that nothing came in time. A signal does not end the wait: who wants to look
    /// at a flag now and then passes a short `timeout`, or wraps the link in one that does so and
    /// gives up with [`PortError::Io`] of the kind `Interrupted`.
    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError>;

    /// The clock that its waits go by, where that is not the machine's. A wrapper has that of the
    /// link within.
    fn clock(&self) -> Option<Clock> {
        None
    }

    /// Whether nothing that a former user of the port asked can be answered on it, because the drives
    /// came with it. A wrapper has that of the link within.
    fn is_fresh(&self) -> bool {
        false
    }
}

/// A CAN bus.
pub trait CanLink: Send {
    /// Hands `frame` to the bus.
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError>;

    /// The next frame from the bus, waiting at most `timeout` (`None`: without limit). Frames that
    /// this link sent are not among them.
    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError>;

    /// As [`ByteLink::clock`].
    fn clock(&self) -> Option<Clock> {
        None
    }

    /// As [`ByteLink::is_fresh`].
    fn is_fresh(&self) -> bool {
        false
    }

    /// Why frames may not get to the bus, as far as an adapter tells. A wrapper has that of the link
    /// within.
    fn trouble(&self) -> Option<&'static str> {
        None
    }
}

impl<B: ByteLink + ?Sized> ByteLink for Box<B> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        (**self).write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        (**self).read(buffer, timeout)
    }

    fn clock(&self) -> Option<Clock> {
        (**self).clock()
    }

    fn is_fresh(&self) -> bool {
        (**self).is_fresh()
    }
}

impl<C: CanLink + ?Sized> CanLink for Box<C> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        (**self).send(frame)
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        (**self).receive(timeout)
    }

    fn clock(&self) -> Option<Clock> {
        (**self).clock()
    }

    fn is_fresh(&self) -> bool {
        (**self).is_fresh()
    }

    fn trouble(&self) -> Option<&'static str> {
        (**self).trouble()
    }
}
