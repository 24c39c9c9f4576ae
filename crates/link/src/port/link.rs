//! The two kinds of links.

use std::time::Duration;

use motorlink_proto::can::CanFrame;

use super::error::PortError;
use crate::clock::Clock;

/// What serial lines and CAN buses have in common. A wrapper says what is [within](Self::within), and has
/// the rest from there.
pub trait Link: Send {
    /// The link that this one wraps.
    fn within(&self) -> Option<&dyn Link> {
        None
    }

    /// The clock that its waits go by, where that is not the machine's.
    fn clock(&self) -> Option<Clock> {
        self.within()?.clock()
    }

    /// Whether nothing that a former user of the port asked can be answered on it, because the drives
    /// came with it.
    fn is_fresh(&self) -> bool {
        self.within().is_some_and(Link::is_fresh)
    }

    /// Why what is sent may not get to the drives, as far as an adapter tells.
    fn trouble(&self) -> Option<&'static str> {
        self.within()?.trouble()
    }
}

impl<L: Link + ?Sized> Link for Box<L> {
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

/// A line that carries bytes both ways.
pub trait ByteLink: Link {
    /// Writes all of `bytes`, with one system call where the kernel takes them at once.
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError>;

    /// Reads what is there, waiting at most `timeout` (`None`: without limit) for the first byte.
    /// `Ok(0)` means that nothing came in time. A signal does not end the wait: who wants to look
    /// at a flag now and then passes a short `timeout`, or wraps the link in one that does so and
    /// gives up with [`PortError::Io`] of the kind `Interrupted`.
    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError>;
}

/// A CAN bus.
pub trait CanLink: Link {
    /// Hands `frame` to the bus.
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError>;

    /// The next frame from the bus, waiting at most `timeout` (`None`: without limit). Frames that
    /// this link sent are not among them.
    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError>;
}

impl<B: ByteLink + ?Sized> ByteLink for Box<B> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        (**self).write(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        (**self).read(buffer, timeout)
    }
}

impl<C: CanLink + ?Sized> CanLink for Box<C> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        (**self).send(frame)
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        (**self).receive(timeout)
    }
}
