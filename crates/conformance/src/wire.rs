//! What cases speak through: a line or a bus, and a clock that may be virtual.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use motorlink::Clock;
use motorlink::port::{ByteLink, CanLink, PortError};
use motorlink_link::serve::{ByteStation, CanStation};
use motorlink_proto::Hex;
use motorlink_proto::can::CanFrame;
use motorlink_proto::time::Instant;

/// A serial line with a clock.
pub trait Line {
    /// The time on this line.
    fn now(&self) -> Instant;
    /// Sends bytes.
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError>;
    /// What comes until a moment, at most: empty when nothing came. May return early with a part.
    fn receive(&mut self, until: Instant) -> Result<Vec<u8>, PortError>;
}

/// A CAN bus with a clock.
pub trait Bus {
    /// The time on this bus.
    fn now(&self) -> Instant;
    /// Sends a frame.
    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError>;
    /// The next frame that comes until a moment.
    fn receive(&mut self, until: Instant) -> Result<Option<CanFrame>, PortError>;
}

/// Bytes as people write them: `02 01 1e 21`.
pub(crate) fn hex(bytes: &[u8]) -> String {
    Hex(bytes).to_string()
}

/// A port of this machine, and the clock that it goes by.
pub struct Real<L> {
    link: L,
    clock: Clock,
}

impl<L: ByteLink> Real<L> {
    /// Speaks through an open line.
    pub fn on_line(link: L) -> Self {
        Real { clock: link.clock().unwrap_or_default(), link }
    }
}

impl<L: CanLink> Real<L> {
    /// Speaks through an open bus.
    pub fn on_bus(link: L) -> Self {
        Real { clock: link.clock().unwrap_or_default(), link }
    }
}

impl<L: ByteLink> Line for Real<L> {
    fn now(&self) -> Instant {
        self.clock.now()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.link.write(bytes)
    }

    fn receive(&mut self, until: Instant) -> Result<Vec<u8>, PortError> {
        let mut buffer = [0; 256];
        let wait = until.since(self.clock.now()).into();
        let size = self.link.read(&mut buffer, Some(wait))?;
        Ok(buffer[..size].to_vec())
    }
}

impl<L: CanLink> Bus for Real<L> {
    fn now(&self) -> Instant {
        self.clock.now()
    }

    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.link.send(frame)
    }

    fn receive(&mut self, until: Instant) -> Result<Option<CanFrame>, PortError> {
        let wait = until.since(self.clock.now()).into();
        self.link.receive(Some(wait))
    }
}

/// A station in this process whose time passes only while the kit waits.
pub struct Virtual<S, T> {
    /// The station, to look at and to change the world around it.
    pub station: S,
    now: Instant,
    received: VecDeque<T>,
}

impl<S, T> Virtual<S, T> {
    /// Speaks with `station`, whose time is 0.
    pub fn new(station: S) -> Self {
        Virtual { station, now: Instant(0), received: VecDeque::new() }
    }

    /// The next moment at which the station has something to do, up to `until`.
    fn pass(&mut self, until: Instant, deadline: Option<Instant>) -> bool {
        let due = deadline.filter(|deadline| *deadline <= until);
        self.now = self.now.max(due.unwrap_or(until));
        due.is_some()
    }
}

impl<S: ByteStation> Line for Virtual<S, u8> {
    fn now(&self) -> Instant {
        self.now
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        let mut reply = Vec::new();
        self.station.receive(self.now, bytes, &mut reply);
        self.received.extend(reply);
        Ok(())
    }

    fn receive(&mut self, until: Instant) -> Result<Vec<u8>, PortError> {
        while self.received.is_empty() && self.now < until {
            let due = self.pass(until, self.station.deadline());
            let mut reply = Vec::new();
            if due {
                self.station.poll(self.now, &mut reply);
            }
            self.received.extend(reply);
        }
        Ok(self.received.drain(..).collect())
    }
}

/// A line that the world around the drive has a hand on, too.
impl<L: Line> Line for Rc<RefCell<L>> {
    fn now(&self) -> Instant {
        self.borrow().now()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortError> {
        self.borrow_mut().send(bytes)
    }

    fn receive(&mut self, until: Instant) -> Result<Vec<u8>, PortError> {
        self.borrow_mut().receive(until)
    }
}

/// A bus that the world around the drive has a hand on, too.
impl<B: Bus> Bus for Rc<RefCell<B>> {
    fn now(&self) -> Instant {
        self.borrow().now()
    }

    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        self.borrow_mut().send(frame)
    }

    fn receive(&mut self, until: Instant) -> Result<Option<CanFrame>, PortError> {
        self.borrow_mut().receive(until)
    }
}

impl<S: CanStation> Bus for Virtual<S, CanFrame> {
    fn now(&self) -> Instant {
        self.now
    }

    fn send(&mut self, frame: &CanFrame) -> Result<(), PortError> {
        let mut replies = Vec::new();
        self.station.receive(self.now, frame, &mut replies);
        self.received.extend(replies);
        Ok(())
    }

    fn receive(&mut self, until: Instant) -> Result<Option<CanFrame>, PortError> {
        while self.received.is_empty() && self.now < until {
            let due = self.pass(until, self.station.deadline());
            let mut replies = Vec::new();
            if due {
                self.station.poll(self.now, &mut replies);
            }
            self.received.extend(replies);
        }
        Ok(self.received.pop_front())
    }
}
