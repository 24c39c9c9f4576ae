//! Links with a queue for data that their port does not accept at once.

use std::collections::VecDeque;
use std::os::fd::{AsFd, BorrowedFd};
use std::time::{Duration, Instant};

use motorlink_proto::can::CanFrame;
use rustix::io::Errno;

use super::error::PortError;
use super::event::Evented;
use super::fd::{FdLink, WRITE_TIMEOUT};
use super::link::{ByteLink, CanLink, Link};
use super::socketcan::SocketCanLink;

/// A line on a descriptor, with its queue.
#[derive(Debug)]
pub(super) struct QueuedBytes {
    link: FdLink,
    queue: Vec<u8>,
    /// Since when the peer has accepted nothing.
    stuck: Instant,
}

impl QueuedBytes {
    pub(super) fn new(link: FdLink) -> Self {
        QueuedBytes { link, queue: Vec::new(), stuck: Instant::now() }
    }
}

impl Link for QueuedBytes {}

impl ByteLink for QueuedBytes {
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

impl Evented for QueuedBytes {
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

/// A CAN interface, with its queue of frames.
#[derive(Debug)]
pub(super) struct QueuedCan {
    link: SocketCanLink,
    queue: VecDeque<CanFrame>,
    /// Since when the interface has accepted nothing.
    stuck: Instant,
}

impl QueuedCan {
    pub(super) fn new(link: SocketCanLink) -> Self {
        QueuedCan { link, queue: VecDeque::new(), stuck: Instant::now() }
    }
}

impl Link for QueuedCan {}

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
    fn queued_bytes_follow_in_order() {
        let (near, mut far) = UnixStream::pair().unwrap();
        let mut line = QueuedBytes::new(FdLink::new(near, "pair").unwrap());
        let sent: Vec<u8> = (0..1_000_000_u32).map(|n| (n % 251) as u8).collect();
        sent.chunks(1000).for_each(|chunk| line.write(chunk).unwrap());
        assert!(line.flush().unwrap(), "a socket does not accept a megabyte at once");
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
