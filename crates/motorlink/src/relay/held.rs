//! What the relays of both protocols hold: a port, and what waits between it and the client.

use std::cell::RefCell;
use std::rc::Rc;

use motorlink_link::port::{Evented, Link, PortError};
use motorlink_link::reopening::FULL;
use motorlink_proto::time::Instant;

use super::pace::Pace;
use super::port::Port;
use super::station::{Desk, GuardedPort, Lane};

/// A port of links `L`, which carry `T`: bytes, or frames.
pub(super) struct Held<L, T> {
    pub(super) port: Port<L>,
    pub(super) lane: Rc<RefCell<Lane<T>>>,
    pub(super) pace: Pace,
    /// The port takes nothing at the moment.
    is_full: bool,
}

impl<L: Link + Evented + 'static, T> Held<L, T> {
    pub(super) fn new(port: Port<L>, pace: Pace) -> Self {
        Held { port, lane: Rc::default(), pace, is_full: false }
    }

    /// A served port for the client.
    pub(super) fn place(
        &self,
        desk: &Rc<RefCell<Desk>>,
        port: Rc<RefCell<String>>,
    ) -> GuardedPort<T> {
        GuardedPort { desk: Rc::clone(desk), lane: Rc::clone(&self.lane), port }
    }

    /// How many bytes or frames the port takes now without a backlog.
    pub(super) fn room(&mut self, now: Instant) -> Result<usize, PortError> {
        self.is_full = self.port.with(|link| link.flush())?;
        Ok(if self.is_full { 0 } else { self.pace.room(now) })
    }

    /// Drops what is not in use: the port if it `failed`, or the client if none is connected.
    pub(super) fn drop_untaken(&self, failed: bool, desk: &Desk) {
        let mut lane = self.lane.borrow_mut();
        if failed {
            lane.to_port.clear();
        }
        if desk.client.is_none() {
            lane.to_client.clear();
        }
    }

    /// When there may be room again for what waits.
    pub(super) fn due(&self, now: Instant) -> Option<Instant> {
        let is_waiting = !self.lane.borrow().to_port.is_empty();
        match self.is_full {
            true => Some(now + FULL.into()),
            false => is_waiting.then(|| self.pace.next(now)),
        }
    }

    /// Drops what the client sent and the port has not taken; gives how much that was.
    pub(super) fn forget(&mut self) -> usize {
        self.pace.rest();
        self.lane.take().to_port.len()
    }
}
