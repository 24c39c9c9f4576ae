//! Programs that change motors of a share with leases: the first one has the motor.

use std::sync::Arc;
use std::time::Duration;

use motorlink_proto::Motion;
use motorlink_proto::time::{Instant, Micros};

use super::Hub;
use super::line::SharedLine;
use super::motor_state::Lease;
use super::requests::{Refused, usage};
use super::session_id::SessionId;
use crate::share::message::{Answer, EventKind, MotorName, Reason};
use crate::signal::Motor;

impl Hub {
    /// From now on a motor that a program has changed is not changed by another one for this time, or as
    /// long as it turns for the program, unless the other takes it.
    pub fn lease(&mut self, length: Duration) {
        self.lease = Some(length.into());
    }

    /// Refuses a change of a motor that another program has.
    pub(super) fn check_lease(
        &self,
        session: SessionId,
        line: usize,
        changed: Option<Motor>,
    ) -> Result<(), Refused> {
        let held = changed.filter(|_| self.lease.is_some()).zip(self.lines.get(&line));
        let why = held.and_then(|(motor, it)| it.lease_of_another(motor, session, it.now()));
        why.map_or(Ok(()), |why| Err((Reason::Held, why)))
    }

    /// A program changes a motor, and has it for some time. Gives whether it did not have it before.
    pub(super) fn lease_by(
        &mut self,
        program: (SessionId, &Arc<str>),
        line: usize,
        changed: Option<Motor>,
    ) -> bool {
        let Some((length, motor)) = self.lease.zip(changed) else { return false };
        let Some(held) = self.lines.get_mut(&line) else { return false };
        let until = held.now() + length;
        let before = held.lease_to(motor, program, until);
        before.is_none_or(|lease| lease.session != program.0)
    }

    /// The command with which a program got a motor was refused.
    pub(super) fn give_lease_back(&mut self, session: SessionId, line: usize, motor: Motor) {
        let Some(held) = self.lines.get_mut(&line) else { return };
        if !held.owners.is_own(motor, session) {
            held.motor_state(motor).lease.take_if(|lease| lease.session == session);
        }
    }

    /// A program has moved a motor through a share before this one.
    pub(super) fn claim_moved(
        &mut self,
        session: SessionId,
        name: &Arc<str>,
        motor: &MotorName,
    ) -> Result<Option<Answer>, Refused> {
        let (line, motor) = self.motor(motor)?;
        let Some(held) = self.lines.get_mut(&line) else { return Ok(None) };
        let was_own = held.owners.is_own(motor, session);
        if !held.owners.claim(motor, session) {
            let (line, motor) = (&held.name, motor.number());
            let why = format!("{line}: a program has moved motor {motor} since");
            return Err((Reason::Held, why));
        }
        let now = held.now();
        if let Some(length) =
            self.lease.filter(|_| held.lease_of_another(motor, session, now).is_none())
        {
            held.lease_to(motor, (session, name), now + length);
        }
        self.owns_now(session, (line, motor), was_own);
        Ok(Some(Answer::Claim))
    }

    /// The motor is the program's without a command. If it was before, that makes no command younger.
    fn owns_now(&mut self, session: SessionId, (line, motor): (usize, Motor), was_own: bool) {
        let is_own = |held: &SharedLine| held.owners.is_own(motor, session);
        if !was_own
            && self.lines.get(&line).is_some_and(is_own)
            && let Some(session) = self.sessions.get_mut(&session)
        {
            session.life.commanded(self.now, (line, motor), Motion::Starts);
        }
    }

    /// A program takes a motor from the one that has it, and is responsible for its stop from now on.
    pub(super) fn take(
        &mut self,
        session: SessionId,
        name: &Arc<str>,
        motor: &MotorName,
    ) -> Result<Option<Answer>, Refused> {
        let Some(length) = self.lease else {
            return Err(usage("this share has no leases: each program may command each motor"));
        };
        let (line, motor) = self.motor(motor)?;
        let Some(held) = self.lines.get_mut(&line) else { return Ok(None) };
        let now = held.now();
        let is_held = held.lease_of_another(motor, session, now).is_some();
        let before = held.lease_to(motor, (session, name), now + length);
        let was_own = held.owners.is_own(motor, session);
        held.owners.take(motor, session);
        let (of, number) = (held.name.clone(), motor.number());
        if let Some(before) = before.filter(|_| is_held) {
            let message = format!("{of}, motor {number}: {name} takes it from {}", before.name);
            self.say_of((Some(&of), Some(number)), EventKind::Taken, name, message);
        }
        self.owns_now(session, (line, motor), was_own);
        Ok(Some(Answer::Take))
    }
}

impl SharedLine {
    /// A program has left.
    pub(super) fn give_leases_back(&mut self, gone: SessionId) {
        for (_, state) in self.motors.iter_mut() {
            state.lease.take_if(|lease| lease.session == gone);
        }
    }

    /// A program has a motor until this time. Gives the lease before.
    fn lease_to(
        &mut self,
        motor: Motor,
        (session, name): (SessionId, &Arc<str>),
        until: Instant,
    ) -> Option<Lease> {
        self.motor_state(motor).lease.replace(Lease { session, name: Arc::clone(name), until })
    }

    /// Who has a motor, if it is another program than this one.
    fn lease_of_another(&self, motor: Motor, own: SessionId, now: Instant) -> Option<String> {
        let lease = self.motors.get(&motor)?.lease.as_ref()?;
        if lease.session == own {
            return None;
        }
        let (line, number, name) = (&self.name, motor.number(), &lease.name);
        if self.owners.owner(motor) == Some(lease.session) && !self.owners.is_held(motor) {
            return Some(format!(
                "{line}: motor {number} turns for {name}, who holds it; stop it or take it"
            ));
        }
        let left = Some(lease.until.since(now)).filter(|left| *left != Micros(0))?;
        Some(format!(
            "{line}: {name} holds motor {number} for another {:.1} s; wait or take it",
            Duration::from(left).as_secs_f64()
        ))
    }
}
