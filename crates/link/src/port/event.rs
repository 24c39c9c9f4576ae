//! Ports for event loops, which must not block.

use std::os::fd::BorrowedFd;

use super::error::PortError;
use super::link::{ByteLink, CanLink};

/// The functions of a port that an event loop needs. Reads that do not block are reads with a
/// timeout of zero.
pub trait Evented {
    /// The descriptor that becomes readable when there are received data. A port without one has
    /// its answer at once.
    fn descriptor(&self) -> Option<BorrowedFd<'_>>;

    /// Sends queued data that the port did not accept at once. Returns whether some are still
    /// queued.
    fn flush(&mut self) -> Result<bool, PortError>;

    /// Drops written data that were not sent yet, if possible. Their end may be part of a request.
    fn discard(&mut self) -> Result<(), PortError> {
        Ok(())
    }
}

impl<E: Evented + ?Sized> Evented for Box<E> {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        (**self).descriptor()
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        (**self).flush()
    }

    fn discard(&mut self) -> Result<(), PortError> {
        (**self).discard()
    }
}

/// A byte line with non-blocking writes. Bytes that the port does not accept at once are queued for
/// [`Evented::flush`], and for the next read or write.
pub trait EventBytes: ByteLink + Evented {}

/// A CAN bus with non-blocking sends, like the writes of [`EventBytes`].
pub trait EventCan: CanLink + Evented {}

impl<T: ByteLink + Evented> EventBytes for T {}
impl<T: CanLink + Evented> EventCan for T {}
