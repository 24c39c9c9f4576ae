//! Ports for event loops, which must never wait inside one.

use std::os::fd::BorrowedFd;

use super::error::PortError;
use super::link::{ByteLink, CanLink};

/// What an event loop needs of a port beside reads that wait for nothing, which is what a timeout of
/// zero asks for.
pub trait Evented {
    /// What is readable when there is something to receive. A port without one has its answer as
    /// soon as it was asked.
    fn descriptor(&self) -> Option<BorrowedFd<'_>>;

    /// Sends what the port did not take at once; whether some of it is left still.
    fn flush(&mut self) -> Result<bool, PortError>;

    /// Drops what was written and has not left, where that can be done: the end of it may be a part
    /// of a request.
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

/// A byte line whose writes wait for nothing: what the port does not take at once is kept for
/// [`Evented::flush`], and for the next read or write.
pub trait EventBytes: ByteLink + Evented {}

/// A CAN bus whose sendings wait for nothing, as the writes of [`EventBytes`] do.
pub trait EventCan: CanLink + Evented {}

impl<T: ByteLink + Evented> EventBytes for T {}
impl<T: CanLink + Evented> EventCan for T {}
