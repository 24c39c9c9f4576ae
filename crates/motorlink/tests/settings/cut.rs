//! A link that fails at a given request.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use motorlink::can::CanFrame;
use motorlink::port::{ByteLink, CanLink, Link, PortError};

/// What fails.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cut {
    /// Nothing.
    Never,
    /// This request and everything after it.
    Request(u32),
    /// The reply to this request and everything after it.
    Reply(u32),
    /// This request only.
    OneRequest(u32),
    /// The reply to this request only.
    OneReply(u32),
}

/// A link of a bench with a [`Cut`].
pub struct CutLink<L> {
    pub link: L,
    pub cut: Cut,
    pub sent: Arc<AtomicU32>,
}

impl<L> CutLink<L> {
    /// Counts a request; whether it gets through.
    fn sends(&self) -> bool {
        let number = self.sent.fetch_add(1, Ordering::Relaxed) + 1;
        match self.cut {
            Cut::Request(cut) => number < cut,
            Cut::OneRequest(cut) => number != cut,
            Cut::Reply(cut) => number <= cut,
            Cut::OneReply(_) | Cut::Never => true,
        }
    }

    /// Whether replies to the last request get through.
    fn receives(&self) -> bool {
        let number = self.sent.load(Ordering::Relaxed);
        match self.cut {
            Cut::Reply(cut) => number < cut,
            Cut::OneReply(cut) => number != cut,
            _ => true,
        }
    }
}

impl<L: Link> Link for CutLink<L> {
    fn within(&self) -> Option<&dyn Link> {
        Some(&self.link)
    }
}

impl<L: ByteLink> ByteLink for CutLink<L> {
    fn write(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        if self.sends() { self.link.write(bytes) } else { Ok(()) }
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Option<Duration>) -> Result<usize, PortError> {
        let size = self.link.read(buffer, timeout)?;
        Ok(if self.receives() { size } else { 0 })
    }
}

impl<L: CanLink> CanLink for CutLink<L> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        if self.sends() { self.link.send(frame) } else { Ok(()) }
    }

    fn receive(&mut self, timeout: Option<Duration>) -> Result<Option<CanFrame>, PortError> {
        let frame = self.link.receive(timeout)?;
        Ok(frame.filter(|_| self.receives()))
    }
}
