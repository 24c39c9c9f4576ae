//! The served ports of a relay, where its one client comes and goes.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use motorlink_link::port::PortError;
use motorlink_link::serve::{Station, Traffic};
use motorlink_proto::time::Instant;

use super::event::Event;

/// Why a client has the line no more.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Departure {
    /// It closed its line, or died.
    Gone,
    /// The relay closed the connection.
    Disconnected,
}

/// Who has the line, and what happened.
#[derive(Debug, Default)]
pub(super) struct Desk {
    /// The served port whose client has the line.
    pub(super) client: Option<String>,
    /// The client left since this was looked at last, and why.
    pub(super) left: Option<Departure>,
    /// The client was silent for too long: its connection is closed in the next turn.
    pub(super) ends_connection: bool,
    /// When the client last sent something.
    pub(super) heard_at: Instant,
    /// No client may connect.
    pub(super) is_shut: bool,
    /// The failure of the drive's port was reported.
    is_lost: bool,
    pub(super) events: VecDeque<Event>,
}

impl Desk {
    pub(super) fn port_failed(&mut self, error: PortError) {
        if !self.is_lost {
            self.is_lost = true;
            self.events.push_back(Event::PortLost(error));
        }
    }

    pub(super) fn port_is_open(&mut self) {
        if self.is_lost {
            self.is_lost = false;
            self.events.push_back(Event::PortBack);
        }
    }

    /// Gives the line, if it is free, to the client at `port`.
    fn admit(&mut self, now: Instant, port: &str) -> bool {
        if self.client.is_some() || self.left.is_some() || self.is_shut {
            return false;
        }
        self.client = Some(port.to_owned());
        self.heard_at = now;
        self.events.push_back(Event::Came { port: port.to_owned() });
        true
    }
}

/// What waits between the client and the port: bytes, or frames.
#[derive(Debug)]
pub(super) struct Lane<T> {
    pub(super) to_port: VecDeque<T>,
    pub(super) to_client: VecDeque<T>,
}

impl<T> Default for Lane<T> {
    fn default() -> Self {
        Lane { to_port: VecDeque::new(), to_client: VecDeque::new() }
    }
}

/// One served port.
pub(super) struct GuardedPort<T> {
    pub(super) desk: Rc<RefCell<Desk>>,
    pub(super) lane: Rc<RefCell<Lane<T>>>,
    pub(super) port: Rc<RefCell<String>>,
}

impl<T> GuardedPort<T> {
    fn has_the_line(&self) -> bool {
        self.desk.borrow().client.as_deref() == Some(&*self.port.borrow())
    }
}

impl<T: Traffic> Station<T> for GuardedPort<T> {
    fn receive(&mut self, now: Instant, received: &[T], _: &mut Vec<T>) {
        let has_the_line = self.has_the_line();
        let mut desk = self.desk.borrow_mut();
        // On a pty a refused client stays connected. It gets the line when the line is free.
        if !has_the_line && !desk.admit(now, &self.port.borrow()) {
            return;
        }
        desk.heard_at = now;
        self.lane.borrow_mut().to_port.extend(received);
    }

    fn poll(&mut self, _: Instant, replies: &mut Vec<T>) {
        replies.extend(self.lane.borrow_mut().to_client.drain(..));
    }

    /// At once while there is something to do with the client.
    fn deadline(&self) -> Option<Instant> {
        let is_waiting = self.has_the_line() && !self.lane.borrow().to_client.is_empty();
        (is_waiting || self.disconnects()).then_some(Instant(0))
    }

    fn client_connected(&mut self, now: Instant, others: usize) -> bool {
        let mut desk = self.desk.borrow_mut();
        let port = self.port.borrow();
        let is_welcome = others == 0 && desk.admit(now, &port);
        if is_welcome {
            *self.lane.borrow_mut() = Lane::default();
        } else {
            desk.events.push_back(Event::TurnedAway { port: port.clone() });
        }
        is_welcome
    }

    fn client_disconnected(&mut self, _: Instant) {
        if self.has_the_line() {
            let mut desk = self.desk.borrow_mut();
            desk.client = None;
            let is_ended = std::mem::take(&mut desk.ends_connection);
            desk.left = Some(if is_ended { Departure::Disconnected } else { Departure::Gone });
        }
    }

    fn disconnects(&self) -> bool {
        self.has_the_line() && self.desk.borrow().ends_connection
    }

    /// No more than one reading of a client waits here: the rest stays where it can be dropped.
    fn accepts_input(&self) -> bool {
        !self.has_the_line() || self.lane.borrow().to_port.is_empty()
    }

    fn browser_detected(&mut self, _: Instant) {
        let port = self.port.borrow().clone();
        self.desk.borrow_mut().events.push_back(Event::Browser { port });
    }
}
