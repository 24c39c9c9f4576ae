//! A CAN interface of the kernel as a served port. The station is a node of its bus.

use std::collections::VecDeque;

use motorlink_proto::can::CanFrame;
use motorlink_proto::time::{Instant, Micros};
use rustix::event::{PollFd, PollFlags};

use super::station::Station;
use crate::port::{CanLink, PortError, SocketCanLink};

/// Maximum number of frames per turn, so that the other ports are served as well.
const TURN: usize = 64;
/// Retry interval of an interface without queue space.
const FULL: Micros = Micros::from_millis(1);
/// A frame that could not be sent within this time is dropped.
const STALE: Micros = Micros::from_millis(100);
/// Retry interval of an interface that is down or missing.
const AWAY: Micros = Micros::from_millis(100);

pub(super) struct Node {
    interface: String,
    station: Box<dyn Station<CanFrame>>,
    /// `None` while the interface is down or missing.
    link: Option<SocketCanLink>,
    outgoing: VecDeque<CanFrame>,
    /// Since when the interface has had no queue space.
    full_since: Option<Instant>,
    /// Next attempt with an interface that is down or full.
    retry: Option<Instant>,
    /// Buffer for the station's replies.
    said: Vec<CanFrame>,
}

impl Node {
    /// Opens a CAN interface, which must be up.
    pub(super) fn open(
        interface: &str,
        station: Box<dyn Station<CanFrame>>,
    ) -> Result<Self, PortError> {
        Ok(Node {
            interface: interface.to_owned(),
            station,
            link: Some(SocketCanLink::open(interface)?),
            outgoing: VecDeque::new(),
            full_since: None,
            retry: None,
            said: Vec::new(),
        })
    }

    /// The descriptor to poll; `None` while replies wait for queue space.
    pub(super) fn watch(&self) -> Option<PollFd<'_>> {
        let link = self.link.as_ref().filter(|_| self.outgoing.is_empty())?;
        Some(PollFd::new(link, PollFlags::IN))
    }

    pub(super) fn deadline(&self) -> Option<Instant> {
        self.station.deadline().into_iter().chain(self.retry).min()
    }

    /// Handles events and deadlines. Returns the number of bytes that the bus did not accept.
    /// `ready` is whether the watched descriptor has an event.
    pub(super) fn serve(&mut self, now: Instant, ready: bool) -> u64 {
        if self.retry.is_some_and(|retry| retry <= now) {
            self.retry = None;
            if self.link.is_none() {
                self.reopen(now);
            }
        }
        if ready {
            self.receive(now);
        }
        if self.station.deadline().is_some_and(|deadline| deadline <= now) {
            self.station.poll(now, &mut self.said);
            self.outgoing.extend(self.said.drain(..));
        }
        self.send(now)
    }

    fn receive(&mut self, now: Instant) {
        for _ in 0..TURN {
            let Some(link) = &mut self.link else { return };
            match link.receive(Some(std::time::Duration::ZERO)) {
                Ok(Some(frame)) => self.station.receive(now, &[frame], &mut self.said),
                Ok(None) => break,
                Err(_) => self.lose(now),
            }
            self.outgoing.extend(self.said.drain(..));
        }
    }

    fn send(&mut self, now: Instant) -> u64 {
        while let (Some(link), Some(frame)) = (&mut self.link, self.outgoing.front()) {
            match link.offer(frame) {
                Ok(true) => {
                    self.outgoing.pop_front();
                    self.full_since = None;
                }
                Ok(false) if now.since(*self.full_since.get_or_insert(now)) < STALE => {
                    self.retry = Some(now + FULL);
                    return 0;
                }
                Ok(false) => break,
                Err(_) => self.lose(now),
            }
        }
        self.full_since = None;
        self.outgoing.drain(..).map(|frame| frame.data().len() as u64).sum()
    }

    /// Closes the interface, which is down, removed or bus-off.
    fn lose(&mut self, now: Instant) {
        self.link = None;
        self.retry = Some(now + AWAY);
    }

    fn reopen(&mut self, now: Instant) {
        match SocketCanLink::open(&self.interface) {
            Ok(link) => self.link = Some(link),
            Err(_) => self.lose(now),
        }
    }
}
