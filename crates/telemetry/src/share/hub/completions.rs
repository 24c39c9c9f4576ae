//! What an engine has carried out: answers, and whose motors are whose after it.

use std::sync::Arc;

use motorlink::ownership::Carried;
use motorlink_proto::Motion;

use super::Hub;
use super::completion_types::{EngineCompletion, Sent, WorkResult};
use super::error_mapping::{may_be_executed, reason};
use super::line::SharedLine;
use super::line_stops::Address;
use super::pending_stops::Why;
use super::session::UNHEARD;
use super::session_id::SessionId;
use crate::acquisition::Rate;
use crate::event::CommandError;
use crate::line::Reply;
use crate::runner::CommandResult;
use crate::share::command_kind::Configures;
use crate::share::message::{self, MotorName, Reason, SignalName, SignalRate};
use crate::signal::Motor;

/// Why answers are not confirmed.
const UNCONFIRMED: &str = "the line failed, or a reply came twice or late, after the last \
    confirmation: the answers so far may be those to other commands; ask again";

impl Hub {
    pub(super) fn finish(
        &mut self,
        EngineCompletion { session, id, line, name, what }: EngineCompletion,
    ) {
        match what {
            WorkResult::Command(sent, result) => self.command_over(session, id, line, sent, result),
            WorkResult::Confirm { motor, result } => {
                self.doubt_after_failure(line, motor, &result);
                // What the engine found before it answered.
                let _ = self.collect_events();
                let lane = self.lines.get(&line).and_then(|held| held.lane(motor));
                let Some((id, session)) = id.zip(self.sessions.get_mut(&session)) else { return };
                session.pending -= 1;
                match result {
                    Ok(_) if session.confirmed(line, lane) => {
                        session.answer(id, message::Answer::Confirm);
                    }
                    Ok(_) => session.refuse(id, Reason::Unconfirmed, UNCONFIRMED),
                    Err(error) => {
                        // Without an answer of the drive the doubts stay until they are told.
                        if reason(&error) == Reason::Unconfirmed {
                            session.confirmed(line, lane);
                        }
                        session.refuse(id, reason(&error), error.to_string());
                    }
                }
            }
            WorkResult::Stop { part, motor, by, motion, is_precaution, result } => {
                self.stop_ended(line, motor, (&by, motion), &result);
                // A line that was closed meanwhile is one that fails.
                let address = self
                    .lines
                    .get_mut(&line)
                    .map_or(Address::Motor { is_absent: is_precaution }, |held| {
                        held.after_stop(motor, is_precaution, &result)
                    });
                let Some((part, session)) = part.zip(self.sessions.get_mut(&session)) else {
                    return;
                };
                let motor = MotorName { line: name.to_string(), motor: motor.number() };
                match address {
                    Address::Unanswered => session.unanswered(part, motor.line),
                    Address::Empty => session.left_out(part, &motor.line),
                    Address::Motor { is_absent } => {
                        let failure = result.err().map(|error| error.to_string());
                        session.stopped(part, motor, failure, is_absent);
                    }
                }
            }
            WorkResult::Search(motor, result) => {
                let Some(held) = self.lines.get_mut(&line) else { return };
                if held.search_ended(motor, &result) {
                    self.stop_again(line, motor, Why::Asked);
                }
            }
            WorkResult::Unheard(part, motor) => {
                let Some(session) = self.sessions.get_mut(&session) else { return };
                let motor = MotorName { line: name.to_string(), motor: motor.number() };
                session.unheard(part, motor, UNHEARD);
            }
            WorkResult::Rates(part, rates) => {
                let Some(session) = self.sessions.get_mut(&session) else { return };
                let named = |rate: Rate| SignalRate {
                    signal: SignalName::of(&name, rate.signal),
                    asked: rate.asked.0 as f64 / 1e6,
                    predicted: rate.predicted.0 as f64 / 1e6,
                    achieved: rate.achieved,
                };
                session.rates(part, rates.into_iter().map(named).collect());
            }
        }
    }

    /// A motor has confirmed a stop, which its owners know.
    fn stopped(&mut self, line: usize, motor: Motor, motion: Motion) {
        let Some(held) = self.lines.get_mut(&line) else { return };
        held.stopped(motor, motion);
        // A program that has left owns no motor that holds its position.
        if held.owners.owner(motor).is_some_and(|owner| !self.sessions.contains_key(&owner)) {
            held.owners.free(motor);
        }
    }

    /// A stop is over. If the motor did not confirm it, it is repeated.
    fn stop_ended(
        &mut self,
        line: usize,
        motor: Motor,
        (by, motion): (&Arc<str>, Motion),
        result: &CommandResult,
    ) {
        let Some(held) = self.lines.get_mut(&line) else { return };
        match result {
            Ok(_) => {
                held.owners.stopped(motor, motion);
                self.stopped(line, motor, motion);
            }
            Err(error) => {
                held.ended(motor, Motion::Holds, result);
                held.not_stopped(motor, by, error);
            }
        }
    }

    fn command_over(
        &mut self,
        session: SessionId,
        id: Option<u32>,
        line: usize,
        sent: Sent,
        result: CommandResult,
    ) {
        let Sent { motor, motion, configures, made, leases } = sent;
        if let Some(motor) = motor {
            if let Some(held) = self.lines.get_mut(&line) {
                held.ended(motor, motion, &result);
            }
            let carried = match &result {
                Ok(_) => Carried::Out,
                Err(why) if may_be_executed(why) => Carried::Perhaps,
                Err(_) => Carried::Never,
            };
            if let Some(session) =
                self.sessions.get_mut(&session).filter(|_| carried != Carried::Never)
            {
                session.life.commanded(made, (line, motor), motion);
            }
            self.command_ended(session, line, motor, (motion, carried), &result);
            if leases && carried == Carried::Never {
                self.give_lease_back(session, line, motor);
            }
            let is_pending = |held: &SharedLine| held.pending_stop(motor).is_some();
            if result.is_ok() && self.lines.get(&line).is_some_and(is_pending) {
                self.stop_again(line, motor, Why::Asked);
            }
            self.doubt_after_failure(line, motor, &result);
        }
        let Some((id, session)) = id.zip(self.sessions.get_mut(&session)) else { return };
        session.pending -= 1;
        match result {
            Ok(reply) => {
                if let Some(motor) = motor {
                    session.answered(line, motor);
                }
                match configures {
                    Some(Configures { segment, registers }) => {
                        session.segments.insert((line, segment), registers);
                        session.answer(id, message::Answer::Command { bytes: Vec::new() });
                    }
                    None => session.answer(id, answer(reply)),
                }
            }
            Err(error) => {
                use CommandError::{Closed, Displaced, Expired, Overtaken};
                let code = error.code().map(u8::from);
                let of_motor = motor.zip(self.lines.get(&line));
                let is_unheard = of_motor.is_some_and(|(motor, held)| !held.is_there(motor));
                let text = match (&error, of_motor) {
                    (Expired | Overtaken | Displaced | Closed, Some((motor, held))) => {
                        format!("{}, motor {}: {error}", held.name, motor.number())
                    }
                    _ => error.to_string(),
                };
                let reason = match reason(&error) {
                    Reason::Silent if is_unheard => Reason::Unheard,
                    reason => reason,
                };
                session.refuse_with(id, reason, text, code);
            }
        }
    }

    /// Answers from before a failure of the line are not confirmed any more.
    fn doubt_after_failure(&mut self, line: usize, motor: Motor, result: &CommandResult) {
        let is_failure = result.as_ref().is_err_and(|error| match error {
            CommandError::Line(error) => error.is_line_failure(),
            _ => false,
        });
        if is_failure && let Some(held) = self.lines.get(&line) {
            self.mark_unconfirmed(line, held.lane(motor));
        }
    }

    pub(super) fn mark_unconfirmed(&mut self, line: usize, motor: Option<Motor>) {
        self.sessions.iter_mut().for_each(|(_, session)| session.mark_unconfirmed(line, motor));
    }

    /// Whose the motor is after a command.
    fn command_ended(
        &mut self,
        session: SessionId,
        line: usize,
        motor: Motor,
        (motion, carried): (Motion, Carried),
        result: &CommandResult,
    ) {
        let Some(held) = self.lines.get_mut(&line) else { return };
        held.owners.ended(motor, session, motion, carried);
        match result {
            Ok(_) if motion.stops() => self.stopped(line, motor, motion),
            Err(error) if motion.stops() => {
                let name = self.sessions.get(&session).and_then(|session| session.name.clone());
                held.not_stopped(motor, &name.unwrap_or_else(|| "share".into()), error);
            }
            Ok(_) if motion == Motion::Starts => {
                held.started(motor);
                if let Some(by) = held.take_line_stop() {
                    self.stop_line(line, Some(motor), &by);
                }
            }
            _ => {}
        }
        if motion.may_be_owned() {
            let was_refused = carried == Carried::Never && self.sessions.contains_key(&session);
            self.stop_if_orphaned(line, motor, Why::Asked, was_refused);
        }
    }
}

fn answer(reply: Reply) -> message::Answer {
    let bytes = match reply {
        Reply::St(payload) => payload,
        Reply::Rmd(bytes) => bytes.to_vec(),
        Reply::Confirmed => Vec::new(),
    };
    message::Answer::Command { bytes }
}
