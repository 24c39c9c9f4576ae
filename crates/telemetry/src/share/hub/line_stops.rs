//! Which motors of a line a stop is sent to, and what becomes of it.

use std::sync::Arc;

use motorlink_proto::Motion;
use motorlink_proto::time::{Instant, Micros};

use super::error_mapping::reason;
use super::line::SharedLine;
use super::motor_state::Presence;
use super::pending_stops::{AGAIN, LineStop, PendingStop};
use crate::event::CommandError;
use crate::line::Request;
use crate::runner::CommandResult;
use crate::share::message::Reason;
use crate::signal::Motor;

/// What the end of a stop says about an address.
pub(super) enum Address {
    /// No motor of the line has ever answered: motors may be there.
    Unanswered,
    /// No motor was found there, and no program asked for it.
    Empty,
    /// Somebody asked for it, or it answered.
    Motor { is_absent: bool },
}

impl SharedLine {
    /// A stop is asked for. One that switches the motor off, because its owner has left, stays so.
    pub(super) fn begin_stop(&mut self, motor: Motor, by: &Arc<str>) {
        let state = self.motor_state(motor);
        let is_off = state.is_switched_off();
        state.pending_stop = Some(PendingStop::new(by).off(is_off));
    }

    /// The stop of a motor switches it off.
    pub(super) fn begin_switch_off(&mut self, motor: Motor, by: &Arc<str>) {
        self.motor_state(motor).pending_stop = Some(PendingStop::new(by).off(true));
    }

    /// What stops a motor now.
    pub(super) fn stop_of(&self, motor: Motor) -> Request {
        match self.pending_stop(motor) {
            Some(PendingStop { is_off: true, .. }) => Request::off(motor),
            _ => Request::stop(motor),
        }
    }

    /// A motor has confirmed a stop. One that has to be switched off still has to be.
    pub(super) fn stopped(&mut self, motor: Motor, motion: Motion) {
        let state = self.motor_state(motor);
        state.answered();
        if motion != Motion::Holds || !state.is_switched_off() {
            state.pending_stop = None;
        }
    }

    /// A motor has not confirmed a stop.
    pub(super) fn not_stopped(&mut self, motor: Motor, by: &Arc<str>, why: &CommandError) {
        self.motor_state(motor).pending_stop.get_or_insert_with(|| PendingStop::new(by));
        self.repeat(motor, why);
    }

    /// Repeats a stop that failed.
    fn repeat(&mut self, motor: Motor, why: &CommandError) {
        let (now, is_there) = (self.now(), self.is_there(motor));
        // All are stopped again and again while none has answered.
        let is_of_all = self.line_stop.is_some();
        let Some(pending) = &mut self.motor_state(motor).pending_stop else { return };
        match why {
            // The end of these is an event.
            CommandError::Closed | CommandError::Ended => pending.await_answer(),
            _ if is_there => pending.repeat(now),
            _ if is_of_all || why.is_of_no_motor() => pending.await_answer(),
            _ => pending.search(now),
        }
    }

    /// A motor has confirmed motion. A stop that is under way is not ended by an earlier start.
    pub(super) fn started(&mut self, motor: Motor) {
        if !self.is_stopping(motor) {
            self.motor_state(motor).pending_stop = None;
        }
    }

    /// The motors whose stop is repeated now.
    pub(super) fn due_again(&self, now: Instant) -> Vec<Motor> {
        let due = self.pending_stops().filter(|(_, stop)| stop.is_due(now));
        due.map(|(motor, _)| motor).collect()
    }

    /// The number that is searched now, one after the other: a silent line has time for others between
    /// them.
    pub(super) fn due_search(&mut self, now: Instant) -> Option<Motor> {
        if self.searched.is_some() {
            return None;
        }
        // A start that is under way ends the search if it is confirmed.
        let is_free = |it: Motor| !(self.is_stopping(it) || self.owners.is_under_way(it));
        let free = self.pending_stops().filter(|(motor, _)| is_free(*motor));
        let due = free.filter_map(|(motor, stop)| Some((stop.search_due(now)?, motor)));
        self.searched = due.min().map(|(_, motor)| motor);
        self.searched
    }

    /// A search is over. Gives whether a motor is there, which has to be stopped then.
    pub(super) fn search_ended(&mut self, motor: Motor, result: &CommandResult) -> bool {
        self.searched = None;
        self.ended(motor, Motion::Holds, result);
        if let Err(why) = result {
            self.repeat(motor, why);
        }
        result.is_ok()
    }

    /// The motors that a stop of all motors is sent to: all that the line can have, because a share
    /// before this one may have turned any of them.
    pub(super) fn stoppable(&self) -> impl Iterator<Item = Motor> {
        (1..=u8::MAX).filter_map(|number| self.speaks.motor(number))
    }

    /// Whether any motor of the line has answered since it was opened. Until then silence shows nothing: a
    /// share before this one may have turned motors that do not hear the stop now.
    pub(super) fn has_answered(&self) -> bool {
        self.motors.values().any(|state| state.presence == Presence::Answered)
    }

    /// Whether the answer to a stop of all waits for this motor: programs know it, or it has answered.
    /// Where none has answered, for all that the line can have.
    pub(super) fn is_awaited(&self, motor: Motor) -> bool {
        let may_be_there = !self.has_answered() && !self.is_absent(motor);
        self.is_known(motor) || self.has_heard(motor) || may_be_there
    }

    /// Whether nothing shows that the motor exists: no program has turned it and it has never answered.
    /// Where another one has answered, no program has read it, either.
    pub(super) fn is_unheard(&self, motor: Motor) -> bool {
        let is_turned = self.owners.is_owned(motor) || self.may_turn(motor);
        let is_known = self.is_known(motor) && self.has_answered();
        !is_turned && !is_known && !self.has_heard(motor)
    }

    /// Whether its stop is a precaution: there may be no such motor.
    pub(super) fn is_doubtful(&self, motor: Motor) -> bool {
        self.is_unheard(motor) || self.is_absent(motor)
    }

    /// A stop of the motor is over.
    pub(super) fn after_stop(
        &mut self,
        motor: Motor,
        is_precaution: bool,
        result: &CommandResult,
    ) -> Address {
        let state = self.motor_state(motor);
        state.stops = state.stops.saturating_sub(1);
        if is_precaution && result.is_err() {
            if !self.has_answered() {
                return Address::Unanswered;
            }
            if !self.is_known(motor) {
                return Address::Empty;
            }
        }
        let is_silent = result.as_ref().is_err_and(|why| reason(why) == Reason::Silent);
        let is_unheard = is_silent && self.is_unheard(motor);
        // A motor that exists is not stopped as a precaution.
        Address::Motor { is_absent: is_precaution || is_unheard || self.is_absent(motor) }
    }

    /// No motor has answered yet: all are stopped after this time, and again until one answers.
    pub(super) fn begin_line_stop(&mut self, by: &Arc<str>, wait: Micros) {
        let next = self.now() + wait;
        self.line_stop = Some(LineStop { by: Arc::clone(by), next });
    }

    /// Whose stop of all motors has to be repeated now. It is repeated for the last time when one has
    /// answered: the motors that turn may not be those that answer first.
    pub(super) fn due_line_stop(&mut self, now: Instant) -> Option<Arc<str>> {
        let has_answered = self.has_answered();
        let stop = self.line_stop.as_mut().filter(|stop| has_answered || stop.next <= now)?;
        stop.next = now + AGAIN;
        let by = Arc::clone(&stop.by);
        if has_answered {
            self.line_stop = None;
        }
        Some(by)
    }

    /// Ends the repetition of a stop of all motors. Gives whose it was.
    pub(super) fn take_line_stop(&mut self) -> Option<Arc<str>> {
        self.line_stop.take().map(|stop| stop.by)
    }

    /// Motion is wanted again: addresses that no program asked for are not stopped if a motor answers there.
    pub(super) fn release(&mut self) {
        self.line_stop = None;
        let motors: Vec<Motor> = self.pending_stops().map(|(motor, _)| motor).collect();
        for motor in motors {
            if !self.is_there(motor) && !self.is_known(motor) {
                self.motor_state(motor).pending_stop = None;
            }
        }
    }

    /// Whether a motor is there, as far as it is known.
    pub(super) fn is_there(&self, motor: Motor) -> bool {
        self.owners.is_owned(motor) || self.has_heard(motor) || self.may_turn(motor)
    }

    /// The motors that are there and have not confirmed a stop.
    pub(super) fn unconfirmed_stops(&self) -> impl Iterator<Item = (Motor, &Arc<str>)> {
        let there = self.pending_stops().filter(|(motor, _)| self.is_there(*motor));
        there.map(|(motor, stop)| (motor, &stop.by))
    }

    /// Whose stop the motors have not confirmed.
    pub(super) fn pending_stop_by(&self) -> Option<Arc<str>> {
        let of_all = self.line_stop.as_ref().map(|stop| &stop.by);
        of_all.or_else(|| self.unconfirmed_stops().next().map(|(_, by)| by)).cloned()
    }
}
