//! Stops: those that programs ask for, of programs that left, and again until a motor confirms.

use std::sync::Arc;

use super::Hub;
use super::completion_types::{EngineCompletion, WorkResult};
use super::line::SharedLine;
use super::pending_stops::{AGAIN, LONGEST_PAUSE, Why};
use super::requests::Refused;
use super::session::{NO_MOTOR, Part, UNANSWERED};
use super::session_id::SessionId;
use crate::acquisition::Acquisition;
use crate::event::CommandError;
use crate::line::Request;
use crate::schedule::Quiet;
use crate::share::message::{ANY_MOTOR, MotorName, StoppedMotor};
use crate::signal::Motor;

impl Hub {
    pub(super) fn stop_asked(
        &mut self,
        session: SessionId,
        name: &Arc<str>,
        id: u32,
        motor: Option<&MotorName>,
    ) -> Result<(), Refused> {
        let (awaited, others): (Vec<(usize, Motor)>, Vec<_>) = match motor {
            Some(motor) => (vec![self.motor(motor)?], Vec::new()),
            None => {
                let lines = self.lines.iter_mut();
                for (_, held) in lines.filter(|(_, held)| !held.has_answered()) {
                    held.begin_line_stop(name, AGAIN);
                }
                let lines = self.lines.iter();
                let all =
                    lines.flat_map(|(line, held)| held.stoppable().map(move |it| (*line, it)));
                all.partition(|(line, motor)| self.lines[line].is_awaited(*motor))
            }
        };
        let of_all = motor.is_none();
        let why = if of_all { Why::OfAll } else { Why::Asked };
        let mut unreached = if of_all { self.stop_ports(name) } else { Vec::new() };
        // The drive says of each number that it has no such motor.
        let is_left = |(line, held): &(&usize, &SharedLine)| {
            of_all && !held.has_answered() && !awaited.iter().any(|(of, _)| of == *line)
        };
        unreached.extend(self.lines.iter().filter(is_left).map(|(_, held)| StoppedMotor {
            motor: MotorName { line: held.name.clone(), motor: ANY_MOTOR },
            failure: Some(UNANSWERED.to_owned()),
            absent: false,
        }));
        let Some(asker) = self.sessions.get_mut(&session) else { return Ok(()) };
        let part = asker.gather(id, awaited.len(), unreached);
        for (line, motor) in awaited {
            let held = &self.lines[&line];
            if of_all && held.is_absent(motor) {
                let name = MotorName { line: held.name.clone(), motor: motor.number() };
                if let Some(asker) = self.sessions.get_mut(&session) {
                    asker.unheard(part, name, NO_MOTOR);
                }
            } else if of_all && held.has_answered() && !held.may_turn(motor) {
                let tell = self.teller(session, None, line);
                let task = move |engine: &mut Acquisition| {
                    if !engine.has_answered(&Request::stop(motor)) {
                        tell(WorkResult::Unheard(part, motor));
                    }
                };
                // If the engine has ended, the stop fails, too.
                let _ = held.remote().post(task);
            }
            self.stop(why, line, motor, session, Some(part), name);
        }
        for (line, motor) in others {
            self.stop(why, line, motor, session, None, name);
        }
        Ok(())
    }

    /// Repeats stops that no drive has confirmed.
    pub(super) fn repeat_stops(&mut self) {
        for line in self.numbers() {
            let Some(held) = self.lines.get(&line) else { continue };
            let now = held.now();
            for motor in held.due_again(now) {
                self.stop_again(line, motor, Why::Repeated);
            }
            if let Some(motor) = self.lines.get_mut(&line).and_then(|held| held.due_search(now)) {
                self.search(line, motor);
            }
            if let Some(by) = self.lines.get_mut(&line).and_then(|held| held.due_line_stop(now)) {
                self.stop_line(line, None, &by);
            }
        }
    }

    /// Stops all motors that a line can have, but one and those whose stop is under way.
    pub(super) fn stop_line(&mut self, line: usize, but: Option<Motor>, by: &Arc<str>) {
        let Some(held) = self.lines.get(&line) else { return };
        // Those that are under way have more tries.
        let is_meant = |motor: &Motor| Some(*motor) != but && !held.is_stopping(*motor);
        let motors: Vec<Motor> = held.stoppable().filter(is_meant).collect();
        for motor in motors {
            self.stop(Why::OfAll, line, motor, SessionId::default(), None, by);
        }
    }

    /// Repeats a stop that was not confirmed. A motor of a program that left is stopped, too.
    pub(super) fn stop_again(&mut self, line: usize, motor: Motor, why: Why) {
        let Some(held) = self.lines.get_mut(&line) else { return };
        // One that is under way has another try if it fails.
        if held.is_stopping(motor) {
            return;
        }
        match held.pending_stop(motor).map(|stop| Arc::clone(&stop.by)) {
            Some(by) => self.stop(why, line, motor, SessionId::default(), None, &by),
            None => self.stop_if_orphaned(line, motor, why, false),
        }
    }

    /// Stops a motor whose owner has left. A request of a program that is there may be under way: its end
    /// decides, unless one `was_refused`.
    pub(super) fn stop_if_orphaned(
        &mut self,
        line: usize,
        motor: Motor,
        why: Why,
        was_refused: bool,
    ) {
        let Some(held) = self.lines.get(&line) else { return };
        let Some(owner) = held.owners.owner(motor) else { return };
        let is_here = |program| !was_refused && self.sessions.contains_key(&program);
        if !self.sessions.contains_key(&owner)
            && held.owners.left_by(owner, is_here).contains(&motor)
        {
            let by = "share".into();
            if self.switch_off.contains(&owner)
                && let Some(held) = self.lines.get_mut(&line)
            {
                held.begin_switch_off(motor, &by);
            }
            self.stop(why, line, motor, owner, None, &by);
        }
    }

    pub(super) fn stop(
        &mut self,
        why: Why,
        line: usize,
        motor: Motor,
        session: SessionId,
        part: Option<Part>,
        by: &Arc<str>,
    ) {
        let tell = self.teller(session, None, line);
        let Some(held) = self.lines.get_mut(&line) else { return };
        held.owners.interrupt(motor);
        held.begin_stop(motor, by);
        held.motor_state(motor).stops += 1;
        let quiet = match why {
            Why::OfAll if held.is_doubtful(motor) => Some(Quiet::Precaution),
            Why::Repeated => Some(Quiet::Again),
            Why::Asked | Why::OfAll => None,
        };
        let is_precaution = quiet == Some(Quiet::Precaution);
        let request = held.stop_of(motor);
        let motion = request.motion();
        let asker = Arc::clone(by);
        let ended = move |result| {
            tell(WorkResult::Stop { part, motor, by: asker, motion, is_precaution, result });
        };
        if held.remote().stop_then(by, request, quiet, ended).is_err() {
            let (by, result) = (Arc::clone(by), Err(CommandError::Ended));
            let name = held.name.as_str().into();
            let what = WorkResult::Stop { part, motor, by, motion, is_precaution, result };
            self.finish(EngineCompletion { session, id: None, line, name, what });
        }
    }

    /// Stops a motor that may not exist, behind the commands of programs.
    pub(super) fn search(&mut self, line: usize, motor: Motor) {
        let tell = self.teller(SessionId::default(), None, line);
        let Some(held) = self.lines.get(&line) else { return };
        let stop = held.pending_stop(motor);
        let by = stop.map_or_else(|| "share".into(), |stop| Arc::clone(&stop.by));
        let ended = move |result| tell(WorkResult::Search(motor, result));
        // If the engine has ended, the share ends.
        let _ = held.remote().command_then(&by, Request::stop(motor), LONGEST_PAUSE, ended);
    }
}
