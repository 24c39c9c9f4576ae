//! Whether a page is alive, and which of its commands may still move a motor. Sans-IO: the time is an
//! argument.
//!
//! A sign of life counts if it shows that the browser has drawn something after the server's latest
//! beats: its frame is a new one, and the beat that it names is younger than the deadline. So a frozen
//! tab is dead, although its browser answers pings, and so is a page behind a network that delays or
//! stores what it sends.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use motorlink_proto::time::{Instant, Micros};
use motorlink_telemetry::share::client::Refusal;
use motorlink_telemetry::share::message::{MotorName, Reason};
use parking_lot::Mutex;

use crate::message::{Alive, Beat};

/// The dead-man of one page.
#[derive(Debug)]
pub struct DeadMan {
    deadline: Micros,
    last_beat: u32,
    /// Beats that a sign of life may name, and when they were sent.
    beats: VecDeque<(u32, Instant)>,
    frame: Option<u32>,
    /// The page's clock in its last sign of life, and when that came.
    heard: Option<(f64, Instant)>,
    /// Until when the last valid sign of life counts.
    until: Option<Instant>,
    motion: Option<Motion>,
    /// How often the page's motion has ended.
    ends: u64,
    /// The stops that this page learned of, and those of all pages.
    stops: Stops,
    shared: Arc<Mutex<Stops>>,
    releases: u64,
}

/// How often motors were stopped.
#[derive(Debug, Default)]
pub struct Stops {
    all: u64,
    of: BTreeMap<MotorName, u64>,
}

impl Stops {
    /// A motor is stopped, or all are.
    pub fn count(&mut self, motor: Option<&MotorName>) {
        match motor {
            Some(motor) => *self.of.entry(motor.clone()).or_default() += 1,
            None => self.all += 1,
        }
    }

    fn of(&self, motor: Option<&MotorName>) -> u64 {
        self.all + motor.and_then(|motor| self.of.get(motor)).copied().unwrap_or_default()
    }
}

/// Motion that depends on the page.
#[derive(Debug, Clone, Copy)]
struct Motion {
    hold: bool,
}

/// Remembers when a command was received. Motion does not begin if the page lapsed or released its key
/// since then, or the motor was stopped.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ticket {
    motor: Option<MotorName>,
    ends: u64,
    stops: u64,
    releases: u64,
}

/// Why the motors of a page stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Lapse {
    /// The deadline passed.
    #[error("the page gave no sign of life for {} ms", .0.0 / 1000)]
    Silent(Micros),
    /// Hold-to-run ended.
    #[error("the key or the finger of hold-to-run is up")]
    Released,
    /// The page asked for it.
    #[error("the page has let its motors go")]
    LetGo,
    /// The connection to the share ended.
    #[error("the share has closed the connection of this page")]
    Share,
}

impl DeadMan {
    /// A page that has given no sign of life. `shared` has the stops of all pages of the server.
    pub fn new(deadline: Micros, shared: Arc<Mutex<Stops>>) -> Self {
        DeadMan {
            deadline,
            last_beat: 0,
            beats: VecDeque::new(),
            frame: None,
            heard: None,
            until: None,
            motion: None,
            ends: 0,
            stops: Stops::default(),
            shared,
            releases: 0,
        }
    }

    /// The next beat, which is sent now. `wall` is the wall clock in seconds.
    pub fn beat(&mut self, now: Instant, wall: f64) -> Beat {
        self.last_beat = self.last_beat.wrapping_add(1);
        self.beats.retain(|(_, sent)| now.since(*sent) <= self.deadline);
        self.beats.push_back((self.last_beat, now));
        let since = self.heard.map_or(0.0, |(_, came)| now.since(came).0 as f64 / 1e3);
        let at = self.heard.map(|(at, _)| at);
        Beat { beat: self.last_beat, wall, at, since, holds: self.motion.is_some() }
    }

    /// Takes a sign of life. Gives why the motors of the page have to stop, if they have to.
    pub fn hear(&mut self, sign: &Alive, now: Instant) -> Option<Lapse> {
        // The deadline goes first: signs may have waited while the server did not run.
        let lapse = self.poll(now);
        self.heard = Some((sign.at, now));
        if !sign.held {
            self.releases += 1;
        }
        let is_young =
            |(beat, sent): &(u32, Instant)| *beat == sign.beat && now.since(*sent) <= self.deadline;
        if self.frame.is_none_or(|last| sign.frame > last) && self.beats.iter().any(is_young) {
            self.frame = Some(sign.frame);
            self.until = Some(now + self.deadline);
        }
        if lapse.is_none() && !sign.held && self.motion.is_some_and(|motion| motion.hold) {
            return self.end(Lapse::Released);
        }
        lapse
    }

    /// Gives why the motors of the page have to stop, if the deadline has passed.
    pub fn poll(&mut self, now: Instant) -> Option<Lapse> {
        if self.motion.is_none() || self.is_alive(now) {
            return None;
        }
        self.end(Lapse::Silent(self.deadline))
    }

    /// When [`poll`](Self::poll) has to be called at the latest.
    pub fn due(&self) -> Option<Instant> {
        self.motion.and(self.until)
    }

    /// A command was received. `None`: it is about no motor.
    pub fn ticket(&self, motor: Option<MotorName>) -> Ticket {
        let stops = self.stops_of(motor.as_ref());
        Ticket { motor, ends: self.ends, stops, releases: self.releases }
    }

    /// Motion of this command begins now, and depends on the page from now on.
    ///
    /// # Errors
    /// The page is not alive or has ended its motion since the command, or the motor was stopped.
    pub fn permit(&mut self, ticket: &Ticket, hold: bool, now: Instant) -> Result<(), Refusal> {
        if !self.is_alive(now) {
            return Err(Refusal::new(Reason::Lapsed, "the page gives no sign of life"));
        }
        let stops = self.stops_of(ticket.motor.as_ref());
        if ticket.ends != self.ends || ticket.stops != stops {
            return Err(Refusal::new(Reason::Overtaken, "a stop came first; nothing was sent"));
        }
        if hold && ticket.releases != self.releases {
            return Err(Refusal::new(Reason::Lapsed, "the key or the finger of hold-to-run is up"));
        }
        let hold = hold || self.motion.is_some_and(|motion| motion.hold);
        self.motion = Some(Motion { hold });
        Ok(())
    }

    /// The page stops a motor, or all: earlier commands of any page move them no more. Call this before
    /// the share learns of it.
    pub fn stop(&mut self, motor: Option<&MotorName>) {
        self.shared.lock().count(motor);
    }

    /// Another program stopped a motor, or all: earlier commands of the page move them no more.
    pub fn stopped(&mut self, motor: Option<&MotorName>) {
        self.stops.count(motor);
    }

    /// No motion depends on the page any more. Gives the reason back if some did.
    pub fn end(&mut self, lapse: Lapse) -> Option<Lapse> {
        self.ends += 1;
        self.motion.take().map(|_| lapse)
    }

    /// Whether its last valid sign of life counts.
    pub fn is_alive(&self, now: Instant) -> bool {
        self.until.is_some_and(|until| now < until)
    }

    fn stops_of(&self, motor: Option<&MotorName>) -> u64 {
        let shared = self.shared.lock();
        self.stops.of(motor) + shared.of(motor)
    }
}

#[cfg(test)]
mod tests;
