//! The two kinds of links.

use std::time::Duration;

use motorlink_proto::can::CanFrame;

use super::error::PortError;
use crate::clock::Clock;

/// The common functions of serial lines and CAN buses. A wrapper implements
/// [`within`](Self::within); the other functions then forward to the wrapped link.
pub trait Link: Send {
    /// The link that this one wraps.
    fn within(&self) -> Option<&dyn Link> {
        None
    }

    /// The clock of its waits; `None` means the machine's clock.
    fn clock(&self) -> Option<Clock> {
        self.within()?.clock()
    }

    /// Whether there are no pending replies to a former user of the port, because the drives were
    /// started with it.
    fn is_fresh(&self) -> bool {
        self.within().is_some_and(Link::is_fresh)
    }

    /// Why sent data may not reach the drives, if an adapter reported it.
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

    /// Reads received bytes. Waits at most `timeout` for the first byte (`None` means no limit).
    /// `Ok(0)` means that no byte came in time. A signal does not end the wait. To check a flag
    /// periodically, pass a short `timeout`, or wrap the link in one that returns [`PortError::Io`]
    /// of the kind `Interrupted`.
    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError>;
}

/// A CAN bus.
pub trait CanLink: Link {
    /// Sends `frame` on the bus.
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError>;

    /// The next frame from the bus. Waits at most `timeout` (`None` means no limit). Frames sent by
    /// this link are not returned.
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
