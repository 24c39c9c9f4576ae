//! Programs that change motors of a share with leases: the first one has the motor.

use std::sync::Arc;
use std::time::Duration;

use motorlink_proto::time::{Instant, Micros};

use super::Hub;
use super::asked::{Refused, usage};
use super::leases::Lease;
use super::line::Held;
use super::place::SessionId;
use crate::share::message::{Answer, Happening, MotorName, Reason};
use crate::share::request::Kind;
use crate::signal::Motor;

impl Hub {
    /// From now on a motor that a program has changed is not changed by another one for this time, or as
    /// long as it turns for the program, unless the other takes it.
    pub fn lease(&mut self, length: Duration) {
        self.lease = Some(length.into());
    }

    /// A program changes a motor.
    pub(super) fn claim(
        &mut self,
        (session, name): (SessionId, &Arc<str>),
        line: usize,
        motor: Option<Motor>,
        kind: Kind,
    ) -> Result<(), Refused> {
        let (Some(length), Some(motor), Kind::Changes | Kind::Moves) = (self.lease, motor, kind)
        else {
            return Ok(());
        };
        let Some(held) = self.lines.get_mut(&line) else { return Ok(()) };
        let now = held.now();
        if let Some(why) = held.lease_of_another(motor, session, now) {
            return Err((Reason::Held, why));
        }
        let lease = Lease { session, name: Arc::clone(name), until: now + length };
        held.leases.insert(motor, lease);
        Ok(())
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
        let lease = Lease { session, name: Arc::clone(name), until: now + length };
        let before = held.leases.insert(motor, lease);
        if let Some(owner) = held.owners.get_mut(&motor) {
            *owner = session;
        }
        held.sequences.retain(|(other, program)| *other != motor || *program == session);
        let (of, number) = (held.name.clone(), motor.number());
        if let Some(before) = before.filter(|_| is_held) {
            let message = format!("{of}, motor {number}: {name} takes it from {}", before.name);
            self.say_of((Some(&of), Some(number)), Happening::Taken, name, message);
        }
        Ok(Some(Answer::Take))
    }
}

impl Held {
    /// A program has moved a motor. Meanwhile another one may have taken it.
    pub(super) fn own(&mut self, motor: Motor, session: SessionId) {
        let owner = self.leases.get(&motor).map_or(session, |lease| lease.session);
        self.owners.insert(motor, owner);
        self.movers.insert((motor, session));
    }

    /// Whether another program has moved, taken or stopped a motor since this one moved it. A motor
    /// without an owner may turn since before this share began: then the program may stop it.
    pub(super) fn is_lost_to_others(&self, motor: Motor, session: SessionId) -> bool {
        match self.owners.get(&motor) {
            _ if self.starting.contains(&(motor, session)) => false,
            Some(owner) => *owner != session,
            None => self.is_starting(motor) || self.movers.contains(&(motor, session)),
        }
    }

    /// Whether a program is responsible for the stop of a motor.
    pub(super) fn has_owner(&self, motor: Motor) -> bool {
        self.owners.contains_key(&motor) || self.is_starting(motor)
    }

    /// A program has left.
    pub(super) fn give_leases_back(&mut self, gone: SessionId) {
        self.leases.retain(|_, lease| lease.session != gone);
    }

    /// Who has a motor, if it is another program than this one.
    fn lease_of_another(&self, motor: Motor, own: SessionId, now: Instant) -> Option<String> {
        let lease = self.leases.get(&motor).filter(|lease| lease.session != own)?;
        let (line, number, name) = (&self.name, motor.number(), &lease.name);
        if self.owners.get(&motor) == Some(&lease.session) {
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
