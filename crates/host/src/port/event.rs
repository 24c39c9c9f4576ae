//! Ports for event loops, which must never wait inside one.

use std::collections::VecDeque;
use std::os::fd::{AsFd, BorrowedFd};
use std::time::{Duration, Instant};

use motorlink_proto::can::CanFrame;
use rustix::io::Errno;

use super::fd::WRITE_TIMEOUT;
use super::{
    ByteLink, CanLink, EchoCanceller, FdLink, PortError, PortName, SlcanLink, SocketCanLink,
};

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
pub trait EventLine: ByteLink + Evented {}

/// A CAN bus whose sendings wait for nothing, as the writes of an [`EventLine`] do.
pub trait EventCan: CanLink + Evented {}

impl<T: ByteLink + Evented> EventLine for T {}
impl<T: CanLink + Evented> EventCan for T {}

impl PortName {
    /// Opens the port as a serial line for an event loop. Opening itself may wait.
    pub fn open_event_line(&self) -> Result<Box<dyn EventLine>, PortError> {
        match self {
            PortName::Line(line) => Ok(Box::new(QueuedLine::new(line.open()?))),
            #[cfg(feature = "sim")]
            PortName::Sim(config) => Ok(Box::new(crate::sim::open_line(config.as_deref())?)),
            other => Err(other.no_line()),
        }
    }

    /// Opens the port as a CAN bus for an event loop. Opening itself may wait.
    pub fn open_event_can(&self) -> Result<Box<dyn EventCan>, PortError> {
        match self {
            PortName::Slcan { line, bitrate, echo } => {
                let queued = QueuedLine::new(line.open()?);
                let link = SlcanLink::open(queued, line.label(), *bitrate)?;
                Ok(if *echo { Box::new(EchoCanceller::new(link)) } else { Box::new(link) })
            }
            PortName::SocketCan(interface) => {
                Ok(Box::new(QueuedCan::new(SocketCanLink::open(interface)?)))
            }
            #[cfg(feature = "sim")]
            PortName::Sim(config) => Ok(Box::new(crate::sim::open_can(config.as_deref())?)),
            other => Err(other.no_can()),
        }
    }
}

/// A line on a descriptor with what it has not taken yet.
#[derive(Debug)]
struct QueuedLine {
    link: FdLink,
    queue: Vec<u8>,
    /// Since when the far end has taken nothing.
    stuck: Instant,
}

impl QueuedLine {
    fn new(link: FdLink) -> Self {
        QueuedLine { link, queue: Vec::new(), stuck: Instant::now() }
    }
}

impl ByteLink for QueuedLine {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        if self.queue.is_empty() {
            self.stuck = Instant::now();
        }
        self.queue.extend_from_slice(bytes);
        self.flush().map(drop)
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        self.flush()?;
        self.link.read(buffer, timeout)
    }
}

impl Evented for QueuedLine {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        Some(self.link.as_fd())
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        while !self.queue.is_empty() {
            let taken = self.link.offer(&self.queue)?;
            if taken == 0 {
                if self.stuck.elapsed() > WRITE_TIMEOUT {
                    return Err(self.link.stalled());
                }
                return Ok(true);
            }
            self.queue.drain(..taken);
            self.stuck = Instant::now();
        }
        Ok(false)
    }

    fn discard(&mut self) -> Result<(), PortError> {
        self.queue.clear();
        self.link.discard()
    }
}

impl<B: ByteLink + Evented> Evented for SlcanLink<B> {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.line().descriptor()
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        self.line_mut().flush()
    }
}

impl<C: CanLink + Evented> Evented for EchoCanceller<C> {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        self.link().descriptor()
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        self.link_mut().flush()
    }
}

/// A CAN interface with the frames that it had no room for.
#[derive(Debug)]
struct QueuedCan {
    link: SocketCanLink,
    queue: VecDeque<CanFrame>,
    /// Since when the interface has taken nothing.
    stuck: Instant,
}

impl QueuedCan {
    fn new(link: SocketCanLink) -> Self {
        QueuedCan { link, queue: VecDeque::new(), stuck: Instant::now() }
    }
}

impl CanLink for QueuedCan {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        if self.queue.is_empty() {
            self.stuck = Instant::now();
        }
        self.queue.push_back(*frame);
        self.flush().map(drop)
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        self.flush()?;
        self.link.receive(timeout)
    }
}

impl Evented for QueuedCan {
    fn descriptor(&self) -> Option<BorrowedFd<'_>> {
        Some(self.link.as_fd())
    }

    fn flush(&mut self) -> Result<bool, PortError> {
        while let Some(frame) = self.queue.front() {
            if !self.link.offer(frame)? {
                if self.stuck.elapsed() > WRITE_TIMEOUT {
                    return Err(self.link.lost(Errno::NOBUFS));
                }
                return Ok(true);
            }
            self.queue.pop_front();
            self.stuck = Instant::now();
        }
        Ok(false)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read;
    use std::os::unix::net::UnixStream;

    use super::*;

    #[test]
    fn what_the_far_end_does_not_take_at_once_follows_in_order() {
        let (near, mut far) = UnixStream::pair().unwrap();
        let mut line = QueuedLine::new(FdLink::new(near, "pair").unwrap());
        let sent: Vec<u8> = (0..1_000_000_u32).map(|n| (n % 251) as u8).collect();
        sent.chunks(1000).for_each(|chunk| line.write(chunk).unwrap());
        assert!(line.flush().unwrap(), "a socket takes no megabyte at once");
        let mut received = vec![0; sent.len()];
        let mut filled = 0;
        while filled < received.len() {
            let end = (filled + 4096).min(received.len());
            filled += far.read(&mut received[filled..end]).unwrap();
            line.flush().unwrap();
        }
        assert!(!line.flush().unwrap());
        assert_eq!(received, sent);
    }
}
