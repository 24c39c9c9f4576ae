//! A byte line on a file descriptor: serial device, pty, TCP connection, socket pair.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::io::{Errno, read, write};
use rustix::termios::{QueueSelector, tcflush};

use super::deadline::Deadline;
use super::descriptors::Listed;
use super::error::PortError;
use super::link::{ByteLink, Link};

/// Timeout of a write while the peer accepts no byte.
pub(super) const WRITE_TIMEOUT: Duration = Duration::from_secs(1);

/// A [`ByteLink`] on a file descriptor.
#[derive(Debug)]
pub struct FdLink {
    /// Declared before the descriptor, because fields are dropped in order.
    _listed: Listed,
    fd: OwnedFd,
    port: String,
}

impl FdLink {
    /// Makes a link from an open descriptor, which becomes non-blocking. `port` is for messages.
    pub fn new(fd: impl Into<OwnedFd>, port: impl Into<String>) -> Result<Self, PortError> {
        let (fd, port) = (fd.into(), port.into());
        fcntl_getfl(&fd)
            .and_then(|flags| fcntl_setfl(&fd, flags | OFlags::NONBLOCK))
            .map_err(|errno| PortError::in_use(&port, errno))?;
        Ok(FdLink { _listed: Listed::new(fd.as_fd()), fd, port })
    }

    fn lost(&self, errno: Errno) -> PortError {
        PortError::in_use(&self.port, errno)
    }

    fn wait(&self, event: PollFlags, deadline: Deadline) -> Result<bool, PortError> {
        wait(self.fd.as_fd(), event, deadline).map_err(|errno| self.lost(errno))
    }
}

impl Link for FdLink {}

impl ByteLink for FdLink {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.put(bytes)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        self.fetch(buffer, timeout)
    }
}

impl AsFd for FdLink {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.fd.as_fd()
    }
}

impl FdLink {
    /// As [`ByteLink::write`], for a link with several owners: the kernel shares the descriptor.
    ///
    /// # Errors
    /// Those of the descriptor.
    pub fn put(&self, mut bytes: &[u8]) -> Result<(), PortError> {
        while !bytes.is_empty() {
            match self.offer(bytes)? {
                0 => {
                    if !self.wait(PollFlags::OUT, Deadline::after(Some(WRITE_TIMEOUT)))? {
                        return Err(self.stalled());
                    }
                }
                taken => bytes = &bytes[taken..],
            }
        }
        Ok(())
    }

    /// Writes the part of `bytes` that the kernel accepts at once. Returns its size.
    ///
    /// # Errors
    /// Those of the descriptor.
    pub fn offer(&self, bytes: &[u8]) -> Result<usize, PortError> {
        loop {
            return match write(&self.fd, bytes) {
                Ok(taken) => Ok(taken),
                Err(Errno::INTR) => continue,
                Err(Errno::AGAIN) => Ok(0),
                Err(errno) => Err(self.lost(errno)),
            };
        }
    }

    /// Drops written bytes that were not sent yet. This is not possible on a socket.
    pub(super) fn discard(&self) -> Result<(), PortError> {
        match tcflush(&self.fd, QueueSelector::OFlush) {
            Ok(()) | Err(Errno::NOTTY | Errno::OPNOTSUPP) => Ok(()),
            Err(errno) => Err(self.lost(errno)),
        }
    }

    /// The error if the peer accepts no bytes.
    pub(super) fn stalled(&self) -> PortError {
        PortError::Stalled {
            port: self.port.clone(),
            hint: "the far end does not read; is the right program or device there?",
        }
    }

    /// As [`ByteLink::read`], for a link with several owners.
    ///
    /// # Errors
    /// Those of the descriptor.
    pub fn fetch(&self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        if buffer.is_empty() {
            return Ok(0);
        }
        let deadline = Deadline::after(timeout);
        while self.wait(PollFlags::IN, deadline)? {
            match read(&self.fd, &mut *buffer) {
                Ok(0) => return Err(PortError::Closed(self.port.clone())),
                Ok(len) => return Ok(len),
                Err(Errno::INTR | Errno::AGAIN) => {}
                Err(errno) => return Err(self.lost(errno)),
            }
        }
        Ok(0)
    }
}

/// Waits for `event`, an error or a hang-up on `fd`. Returns false after the timeout.
pub(super) fn wait(
    fd: BorrowedFd<'_>,
    event: PollFlags,
    deadline: Deadline,
) -> Result<bool, Errno> {
    loop {
        let timeout = deadline.remaining().map(timespec);
        match poll(&mut [PollFd::from_borrowed_fd(fd, event)], timeout.as_ref()) {
            Ok(ready) => return Ok(ready > 0),
            Err(Errno::INTR) => {}
            Err(errno) => return Err(errno),
        }
    }
}

/// `span` for the kernel. A span beyond its range is cut to half a million years.
pub(crate) fn timespec(span: Duration) -> Timespec {
    Timespec::try_from(span.min(Duration::from_secs(1 << 44))).unwrap_or_default()
}
