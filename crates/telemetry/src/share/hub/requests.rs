//! What programs ask for.

use std::sync::Arc;

use motorlink_proto::time::{Instant, Micros};
use serde::Deserialize;
use tracing::debug;

use super::Hub;
use super::completion_types::{Sent, WorkResult};
use super::error_mapping::reason;
use super::session::Session;
use super::session_id::SessionId;
use crate::event::CommandError;
use crate::line::Request;

use crate::share::VERSION;
use crate::share::command_kind::CommandKind;
use crate::share::frame::{Frame, FrameKind};
use crate::share::message::{
    self, Answer, Ask, EventKind, LONGEST_DEADLINE, LONGEST_NAME, LONGEST_SCAN, LONGEST_TIME,
    LONGEST_WHY, MotorName, Reason, SHORTEST_DEADLINE,
};
use crate::share::wire::{MOST_FRAMES, Part};
use crate::signal::Motor;

/// The time to live of a confirmation.
const CONFIRMATION: Micros = Micros::from_millis(1_000);

/// The time to live of a release.
const RELEASE: Micros = Micros::from_millis(1_000);

/// Why a request is refused at once.
pub(super) type Refused = (Reason, String);

pub(super) fn usage(message: impl Into<String>) -> Refused {
    (Reason::Usage, message.into())
}

impl Hub {
    /// A program has sent a message. `waited` is how long it may have waited before it was read: it is
    /// a part of its time to live.
    pub fn received(&mut self, session: SessionId, frame: &Frame, waited: Micros) {
        if frame.kind != FrameKind::Text {
            return self.close(session, "a program sends requests only");
        }
        match message::decode::<message::Request>(&frame.payload) {
            Ok(request) => self.asked(session, request, waited),
            Err(error) => match (self.sessions.get_mut(&session), id_of(&frame.payload)) {
                (Some(session), Some(id)) => {
                    session.refuse(id, Reason::Usage, error.to_string());
                }
                _ => self.close(session, error.to_string()),
            },
        }
    }

    fn asked(&mut self, session: SessionId, request: message::Request, waited: Micros) {
        let message::Request { id, age, ask } = request;
        let age = age.map_or(Ok(Micros(0)), |age| span("the age of a request", age, 0.0));
        if let Some(session) = self.sessions.get_mut(&session) {
            if let Ok(age) = age {
                session.life.heard(made(self.now, age));
            }
            if ask == Ask::Alive {
                return;
            }
            session.pending += 1;
            debug!(program = session.name.as_deref(), id, ?ask, "request");
        }
        let answered = match (self.name(session), ask) {
            (None, Ask::Hello { protocol, name }) => self.hello(session, protocol, &name),
            (None, _) => Err(usage("the first request is `hello`")),
            (Some(_), Ask::Hello { .. }) => Err(usage("this program has said hello")),
            (Some(name), ask) => {
                age.and_then(|age| self.carry_out(session, &name, id, ask, (age, waited + age)))
            }
        };
        let Some(session) = self.sessions.get_mut(&session) else { return };
        match answered {
            Ok(Some(answer)) => session.answer(id, answer),
            Ok(None) => return,
            Err((reason, message)) => session.refuse(id, reason, message),
        }
        session.pending -= 1;
    }

    fn name(&self, session: SessionId) -> Option<Arc<str>> {
        self.sessions.get(&session)?.name.clone()
    }

    fn hello(
        &mut self,
        id: SessionId,
        protocol: u32,
        name: &str,
    ) -> Result<Option<Answer>, Refused> {
        if protocol != VERSION {
            let message = format!("this share speaks version {VERSION}, the program {protocol}");
            return Err((Reason::Version, message));
        }
        if !is_text(name, LONGEST_NAME) {
            return Err(usage(format!("a name has 1 to {LONGEST_NAME} bytes that can be printed")));
        }
        let is_taken = |name: &str| {
            self.sessions.values().any(|session| session.name.as_deref() == Some(name))
        };
        let mut own = name.to_owned();
        let mut count = 1;
        while is_taken(&own) {
            count += 1;
            own = format!("{name} {count}");
        }
        if let Some(session) = self.sessions.get_mut(&id) {
            session.name = Some(own.as_str().into());
        }
        self.say(EventKind::Joined, &own, format!("{own} joined"));
        Ok(Some(Answer::Hello { protocol: VERSION, share: self.share.clone(), name: own }))
    }

    /// Gives the answer, or `None` if it comes later.
    fn carry_out(
        &mut self,
        session: SessionId,
        name: &Arc<str>,
        id: u32,
        ask: Ask,
        (age, waited): (Micros, Micros),
    ) -> Result<Option<Answer>, Refused> {
        let may_stop =
            matches!(ask, Ask::Stop { .. } | Ask::Latch | Ask::Command { .. } | Ask::Leave { .. });
        if !may_stop {
            self.check_busy(session)?;
        }
        if !may_stop && !matches!(ask, Ask::Lines | Ask::Confirm { .. }) {
            self.check_place(session)?;
        }
        match ask {
            Ask::Hello { .. } | Ask::Alive => Ok(None),
            Ask::Lines => {
                let latched_by = self.latch.as_deref().map(str::to_owned);
                Ok(Some(Answer::Lines { lines: self.lines(), latched_by }))
            }
            Ask::Signals { line } => {
                let line = self.line(&line)?;
                Ok(Some(Answer::Signals { signals: self.lines[&line].columns() }))
            }
            Ask::Subscribe { signals, period, queue, drop, rows } => {
                let queue = (queue, drop);
                let subscription = self.subscribe(session, &signals, period, queue, rows)?;
                Ok(Some(Answer::Subscribe { subscription }))
            }
            Ask::Unsubscribe { subscription } => {
                let session = self.sessions.get_mut(&session);
                let feed = session.and_then(|session| session.feeds.remove(&subscription));
                let feed = feed.ok_or_else(|| usage(format!("no subscription {subscription}")))?;
                feed.end(&self.lines);
                Ok(Some(Answer::Unsubscribe))
            }
            Ask::Command { line, motor, bytes, time_to_live, continues, own } => {
                let time_to_live = span("the time to live", time_to_live, 0.0)?;
                let left = time_to_live.0.checked_sub(waited.0).map(Micros);
                let motor = MotorName { line, motor };
                self.command(session, name, id, &motor, (&bytes, continues, own), (age, left))?;
                Ok(None)
            }
            Ask::Confirm { line, motor } => {
                self.confirm(session, name, id, &MotorName { line, motor })?;
                Ok(None)
            }
            Ask::Stop { motor } => {
                self.stop_asked(session, name, id, motor.as_ref())?;
                Ok(None)
            }
            Ask::Ending { motion } => {
                if let Some(session) = self.sessions.get_mut(&session) {
                    session.ending = motion;
                }
                Ok(Some(Answer::Ending))
            }
            Ask::Deadline { silence, motion } => {
                let silence = silence.map(deadline).transpose()?;
                let motion = motion.map(deadline).transpose()?;
                if let Some(session) = self.sessions.get_mut(&session) {
                    (session.life.silence, session.life.motion) = (silence, motion);
                }
                Ok(Some(Answer::Deadline))
            }
            Ask::Take { motor } => self.take(session, name, &motor),
            Ask::Claim { motor } => self.claim_moved(session, name, &motor),
            Ask::Latch => {
                self.latch = Some(Arc::clone(name));
                for (_, held) in self.lines.iter_mut() {
                    held.owners.interrupt_all();
                    held.remote().latch_then(name, || {}).map_err(ended)?;
                }
                Ok(Some(Answer::Latch))
            }
            // Motion may have been refused again meanwhile.
            Ask::Release if waited > RELEASE => Err(refused(&CommandError::Expired)),
            Ask::Release => {
                self.latch = None;
                for (_, held) in self.lines.iter_mut() {
                    held.release();
                    let by = Arc::clone(name);
                    held.remote().post(move |engine| engine.release(&by)).map_err(ended)?;
                }
                Ok(Some(Answer::Release))
            }
            Ask::Rates { line } => self.rates(session, id, line.as_deref()),
            Ask::Ports => self.list_ports(session, name, id),
            Ask::Scan { port, protocol, rate, timeout } => {
                if timeout.is_some_and(|timeout| timeout > LONGEST_SCAN) {
                    return Err(usage(format!("`timeout` of a scan is at most {LONGEST_SCAN} s")));
                }
                let order = self.order(&port, protocol, None, timeout)?;
                self.scan_port(session, name, id, order, rate)
            }
            Ask::Open { port, protocol, profile, timeout } => {
                let order = self.order(&port, protocol, profile.as_deref(), timeout)?;
                self.open_line(session, name, id, order)
            }
            Ask::Close { line } => {
                let line = self.line(&line)?;
                self.close_line(session, name, id, line)
            }
            Ask::Frames { line, from, to, after, most } => {
                let line = self.line(&line)?;
                if !(1..=MOST_FRAMES).contains(&most) {
                    return Err(usage(format!("`most` is 1 to {MOST_FRAMES} frames")));
                }
                let (from, to) = (from.map(instant).transpose()?, to.map(instant).transpose()?);
                Ok(Some(self.lines[&line].frames(Part { from, to, after, most })))
            }
            Ask::Leave { why } => {
                if !is_text(&why, LONGEST_WHY) {
                    return Err(usage(format!(
                        "a reason has 1 to {LONGEST_WHY} bytes that can be printed"
                    )));
                }
                self.leave_because(session, Some(&why));
                Ok(None)
            }
        }
    }

    fn check_busy(&self, session: SessionId) -> Result<(), Refused> {
        match self.sessions.get(&session).is_some_and(Session::is_busy) {
            true => Err(refused(&CommandError::TooMany)),
            false => Ok(()),
        }
    }

    /// Refuses all but stops and reads for a session beyond the limit of programs.
    fn check_place(&self, session: SessionId) -> Result<(), Refused> {
        let why = self.sessions.get(&session).and_then(|session| session.only_stops.clone());
        why.map_or(Ok(()), |why| Err((Reason::Busy, why)))
    }

    pub(super) fn line(&self, name: &str) -> Result<usize, Refused> {
        let found = self.lines.iter().find(|(_, held)| held.name == name);
        found.map(|(line, _)| *line).ok_or_else(|| {
            let names: Vec<_> = self.lines.values().map(|held| held.name.as_str()).collect();
            usage(match names.as_slice() {
                [] => format!("no line `{name}`: the share has no line"),
                _ => format!("no line `{name}`; the lines are {}", names.join(", ")),
            })
        })
    }

    pub(super) fn motor(
        &self,
        MotorName { line, motor }: &MotorName,
    ) -> Result<(usize, Motor), Refused> {
        let line = self.line(line)?;
        Ok((line, self.lines[&line].motor(*motor).map_err(usage)?))
    }

    fn command(
        &mut self,
        session: SessionId,
        name: &Arc<str>,
        id: u32,
        motor: &MotorName,
        (bytes, continues, own): (&[u8], bool, bool),
        (age, time_to_live): (Micros, Option<Micros>),
    ) -> Result<(), Refused> {
        let line = self.line(&motor.line)?;
        let segments = |segment| {
            let own = self.sessions.get(&session)?;
            own.segments.get(&(line, segment)).cloned()
        };
        let request = self.lines[&line].request(motor.motor, bytes, segments);
        let (request, configures) = request.map_err(usage)?;
        let motor = request.motor();
        let motion = request.motion();
        // A stop is never too old.
        let time_to_live = match motion {
            motion if motion.stops() => Micros(0),
            _ => {
                self.check_busy(session)?;
                time_to_live.ok_or_else(|| refused(&CommandError::Expired))?
            }
        };
        let kind = CommandKind::of(&request);
        if kind.changes() {
            self.check_place(session)?;
        }
        let changed = motor.filter(|_| kind.changes());
        self.check_lease(session, line, changed)?;
        let tell = self.teller(session, Some(id), line);
        let Some(held) = self.lines.get_mut(&line) else { return Ok(()) };
        if let Some(motor) = motor {
            if own && !held.owners.is_own(motor, session) {
                let (line, motor) = (&held.name, motor.number());
                let why = format!("{line}: motor {motor} does not belong to this program");
                return Err((Reason::Held, why));
            }
            held.follow((motor, session), motion, continues)
                .map_err(|why| (Reason::Overtaken, why))?;
        }
        if let Some(motor) = motor {
            held.motor_state(motor).is_known = true;
        }
        let leases = self.lease_by((session, name), line, changed);
        let Some(held) = self.lines.get_mut(&line) else { return Ok(()) };
        let sent = Sent { motor, motion, configures, made: made(self.now, age), leases };
        let ended_with = move |result| tell(WorkResult::Command(sent, result));
        let begun = match motion.stops() {
            true => held.remote().stop_then(name, request, None, ended_with),
            false => held.remote().command_then(name, request, time_to_live, ended_with),
        };
        begun.map_err(ended)
    }

    fn confirm(
        &mut self,
        session: SessionId,
        name: &Arc<str>,
        id: u32,
        motor: &MotorName,
    ) -> Result<(), Refused> {
        let (line, motor) = self.motor(motor)?;
        let tell = self.teller(session, Some(id), line);
        let ended_with = move |result| tell(WorkResult::Confirm { motor, result });
        let remote = self.lines[&line].remote();
        remote.command_then(name, Request::Confirm(motor), CONFIRMATION, ended_with).map_err(ended)
    }
}

/// The id of a request that cannot be read otherwise.
fn id_of(payload: &[u8]) -> Option<u32> {
    #[derive(Deserialize)]
    struct Numbered {
        id: u32,
    }
    message::decode::<Numbered>(payload).ok().map(|numbered| numbered.id)
}

/// A time of a line's clock. One before its start is its start.
fn instant(seconds: f64) -> Result<Instant, Refused> {
    match seconds.is_finite() {
        true => Ok(Instant((seconds * 1e6).round() as u64)),
        false => Err(usage("a time is a number of seconds")),
    }
}

/// When a request of this age was made.
fn made(now: Instant, age: Micros) -> Instant {
    Instant(now.0.saturating_sub(age.0))
}

fn deadline(seconds: f64) -> Result<Micros, Refused> {
    match (SHORTEST_DEADLINE..=LONGEST_DEADLINE).contains(&seconds) {
        true => Ok(Micros((seconds * 1e6).round() as u64)),
        false => Err(usage(format!("a deadline is {SHORTEST_DEADLINE} to {LONGEST_DEADLINE} s"))),
    }
}

pub(super) fn span(what: &str, seconds: f64, least: f64) -> Result<Micros, Refused> {
    if !(least..=LONGEST_TIME).contains(&seconds) {
        return Err(usage(format!("{what} is {least} to {LONGEST_TIME} s")));
    }
    Ok(Micros((seconds * 1e6).round() as u64))
}

pub(super) fn ended(error: crate::runner::Ended) -> Refused {
    refused(&error.into())
}

fn refused(error: &CommandError) -> Refused {
    (reason(error), error.to_string())
}

/// Whether a text has 1 to `longest` bytes, and all characters can be printed.
fn is_text(text: &str, longest: usize) -> bool {
    (1..=longest).contains(&text.len()) && text.chars().all(motorlink_link::is_printable)
}
